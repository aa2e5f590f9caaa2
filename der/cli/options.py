"""Options that commands have in common: a ring, its section, a path, files; and their parsing.

A command's parameters are the fields of such groups, so that commands share options and not text.
"""

from __future__ import annotations

import inspect
import math
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from der.cli.output import kept, say, targets

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from der.cli.output import Targets
    from der.geometry.ring import Ring
    from der.geometry.section import Section
    from der.records.path import Path
    from der.scene import Scene

SHAPES = {  # and the options that go with each
    "circle": ("natural_curvature",),
    "ellipse": ("b_over_a",),
    "rectangle": ("b_over_a", "r_over_a"),
    "triangle": ("vertex_angle", "r_over_a"),
    "profile": (),
}
NU = 0.3  # Poisson's ratio where none is given


def number(text: str) -> float:
    """Parse an option's number, so that a bad one is named with its value."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"must be a number, got {text!r}") from None


def whole(text: str) -> int:
    """Parse an option's whole number, likewise."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"must be a whole number, got {text!r}") from None


@contextmanager
def options_named() -> Iterator[None]:
    """Turn a ValueError about an argument into one about the option of that name."""
    try:
        yield
    except ValueError as wrong:
        words = str(wrong).split(" ", 1)
        option = {"n_edges": "edges", "twist_axis": "axis"}.get(words[0], words[0])
        option = "FILE" if option == "file" else f"--{option.replace('_', '-')}"
        raise typer.TyperException(" ".join([option, *words[1:]])) from None


def number_option(text: str, **more: Any) -> Any:
    """An option that takes a number."""
    return typer.Option(parser=number, help=text, **more)


@dataclass(frozen=True)
class RingOptions:
    """A ring and its section."""

    shape: Annotated[
        str, typer.Argument(metavar="SHAPE", help="The ring: " + ", ".join(SHAPES) + ".")
    ]
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[FILE]", help="Of a profile: CSV of arc_length, curvature or x, y."
        ),
    ] = None
    b_over_a: Annotated[
        float | None, number_option("Short semi-axis over the long one, ellipse and rectangle.")
    ] = None
    r_over_a: Annotated[
        float | None, number_option("Radius of the fillets, rectangle and triangle.")
    ] = None
    vertex_angle: Annotated[
        float | None, number_option("Angle at the apex of a triangle, degrees.")
    ] = None
    natural_curvature: Annotated[
        float | None, number_option("Natural curvature of a circle, in units of 1/a.")
    ] = None
    axis: Annotated[
        str, typer.Option(help="Twisting axis: x (grips at the short semi-axis) or y.")
    ] = "x"
    h_over_t: Annotated[float | None, number_option("Height over thickness of the section.")] = None
    alpha: Annotated[float | None, number_option("EI1/GJ, with --beta.")] = None
    beta: Annotated[float | None, number_option("EI2/GJ, with --alpha.")] = None
    nu: Annotated[float, number_option("Poisson's ratio, with --h-over-t.")] = NU
    a_over_t: Annotated[
        float, number_option("Reference length over thickness: finite stretch and drawing.")
    ] = 200.0

    def ring(self) -> Ring:
        """The ring that the command line describes."""
        from der.geometry import ring as rings

        if self.shape not in SHAPES:
            raise typer.TyperException(f"SHAPE must be {', '.join(SHAPES)}, got {self.shape!r}")
        own = SHAPES[self.shape]
        for name in ("b_over_a", "r_over_a", "vertex_angle", "natural_curvature"):
            value = getattr(self, name)
            if value is not None and name not in own:
                takers = [shape for shape, takes in SHAPES.items() if name in takes]
                raise ValueError(f"{name} must go with SHAPE {' or '.join(takers)}, got {value}")
            if value is None and name in own and self.shape != "circle":
                raise ValueError(f"{name} must be given with SHAPE {self.shape}, got none")
        if (self.file is None) is (self.shape == "profile"):
            raise typer.TyperException(
                f"FILE must be given with SHAPE profile, and with it only, got {self.file!r}"
            )
        if self.axis not in ("x", "y"):
            raise ValueError(f"axis must be x or y, got {self.axis!r}")
        if self.shape in ("triangle", "profile") and self.axis == "y":
            raise ValueError(f"axis must be x for a {self.shape}, its axis of symmetry, got 'y'")
        if self.shape == "circle":  # both axes are alike
            return rings.circle(1.0 if self.natural_curvature is None else self.natural_curvature)
        if self.shape == "profile":
            from der.geometry.profile_csv import read_profile

            return read_profile(str(self.file))
        values = {name: getattr(self, name) for name in own}
        if self.shape == "triangle":
            return rings.triangle_in_degrees(**values)
        make: Any = {"ellipse": rings.ellipse, "rectangle": rings.rectangle}[self.shape]
        return make(**values, twist_axis=self.axis)

    def section(self) -> Section:
        """The section that the command line describes."""
        return _section(self.h_over_t, self.alpha, self.beta, self.nu)


@dataclass(frozen=True)
class PathOptions:
    """What is wanted of a path, and how it is found."""

    edges: Annotated[int, typer.Option(parser=whole, help="Edges of the full ring.")] = 64
    gamma_max: Annotated[float, number_option("Where the path ends, rad.")] = math.pi
    until: Annotated[
        str | None, typer.Option(help="'folded': until the three-covered state, beyond pi too.")
    ] = None
    save_at: Annotated[
        str | None, typer.Option(help="Solve at these gammas (rad, commas), not at k pi/8.")
    ] = None
    curvature: Annotated[
        str, typer.Option(help="Measure of curvature: logarithm, angle or tangent.")
    ] = "logarithm"
    stretch: Annotated[str, typer.Option(help="inextensible or finite (EA).")] = "inextensible"
    tolerance: Annotated[
        float | None,
        number_option("fold: residual of an equilibrium, GJ/a, 1e-10; bvp: relative error, 1e-8."),
    ] = None
    stability: Annotated[
        bool, typer.Option("--stability/--no-stability", help="Index of the full ring.")
    ] = True
    control: Annotated[
        str, typer.Option(help="arclength (through folds), angle or moment (with snaps).")
    ] = "arclength"
    unload: Annotated[
        bool, typer.Option("--unload", help="Come back to 0, with --control angle or moment.")
    ] = False
    solver: Annotated[str, typer.Option(help="newton, or relaxation with --control angle.")] = (
        "newton"
    )
    error_bars: Annotated[
        bool, typer.Option("--error-bars", help="Extrapolate from N, N/2, N/4 edges, with errors.")
    ] = False
    sector: Annotated[str, typer.Option(help="auto, full, half or quarter.")] = "auto"

    def scene(self, ring: RingOptions, **more: Any) -> Scene:
        """The scene that the command line describes."""
        from der.scene import Scene

        wanted: dict[str, Any] = {
            "n_edges": self.edges,
            "sector": self.sector,
            "stability": self.stability,
            "error_bars": self.error_bars,
            "control": self.control,
            "unload": self.unload,
            "solver": self.solver,
            "gamma_max": self.gamma_max,
            "until": self.until,
            "save_at": _numbers("save_at", self.save_at),
            "curvature": self.curvature,
            "stretch": self.stretch,
            "a_over_t": ring.a_over_t,
        }
        if self.tolerance is not None:
            wanted["tolerance"] = self.tolerance
        return Scene(ring.ring(), ring.section(), **wanted | more)


@dataclass(frozen=True)
class FileOptions:
    """What is written."""

    json: Annotated[
        str | None, typer.Option(metavar="F", help="Write the record here ('-': output).")
    ] = None
    plot: Annotated[
        str | None, typer.Option(metavar="F", help="Draw the path: .png, .pdf or .svg.")
    ] = None
    rrd: Annotated[
        str | None, typer.Option(metavar="F", help="Record for playback with rerun: .rrd.")
    ] = None
    movie: Annotated[
        str | None, typer.Option(metavar="F", help="Film it: .gif, or .mp4 (needs ffmpeg).")
    ] = None
    html: Annotated[
        str | None, typer.Option(metavar="F", help="A page to scrub in any browser: .html.")
    ] = None
    beside: Annotated[
        str | None,
        typer.Option(metavar="DIR", help="Show the ring of this --out DIR, too, where it moves."),
    ] = None
    out: Annotated[
        str | None,
        typer.Option(metavar="DIR", help="Write path.json, path.png and shapes.npz here."),
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False

    @property
    def moving(self) -> bool:
        """Whether something is written that shows how the ring moves."""
        return any(file is not None for file in (self.rrd, self.movie, self.html))

    @property
    def drawn(self) -> bool:
        """Whether shapes are needed."""
        return self.moving or any(file is not None for file in (self.plot, self.out))

    def targets(self) -> Targets:
        """The files to write, after making sure that they can be written."""
        return targets(self.json, self.plot, self.rrd, self.out, movie=self.movie, html=self.html)

    def other(self) -> Path | None:
        """The path that is to be shown beside this one."""
        if self.beside is None:
            return None
        if not self.moving:
            raise ValueError(
                f"beside must go with --rrd, --movie or --html, got {self.beside!r} alone"
            )
        return kept(self.beside)


@dataclass(frozen=True)
class LiveOptions:
    """Watching."""

    live: Annotated[
        bool, typer.Option("--live", help="Serve what --rrd records for watching, until Ctrl-C.")
    ] = False
    port: Annotated[int, typer.Option(parser=whole, help="Where --live serves.")] = 9876


def command(app: typer.Typer, *groups: Any) -> Callable[[Callable[..., int]], Callable[..., None]]:
    """Make a command of a function of groups of options; what it returns is the exit code.

    The command's parameters are the groups' fields, so that commands share options and not text.
    """

    def wrap(function: Callable[..., int]) -> Callable[..., None]:
        def run(**given: Any) -> None:
            made = [group(**{f.name: given[f.name] for f in fields(group)}) for group in groups]
            try:
                code = function(*made)
            except KeyboardInterrupt:  # typer would say nothing
                say("der: stopped by the user before anything was found")
                code = 130
            raise typer.Exit(code)

        hints = {name: h for g in groups for name, h in get_type_hints(g, None, None, True).items()}
        parameters = [
            inspect.Parameter(
                f.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if f.default is MISSING else f.default,
                annotation=hints[f.name],
            )
            for group in groups
            for f in fields(group)
        ]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = hints
        run.__doc__ = function.__doc__
        app.command(name=function.__name__.strip("_"))(run)
        return run

    return wrap


def _section(h_over_t: float | None, alpha: float | None, beta: float | None, nu: float) -> Section:
    """The section that the command line describes."""
    from der.geometry.section import rectangular_section, section

    if h_over_t is None and nu != NU:
        raise ValueError(f"nu can only be given together with --h-over-t, got {nu}")
    if h_over_t is not None:
        if alpha is not None or beta is not None:
            raise ValueError(
                f"h_over_t cannot be given together with --alpha and --beta, got {h_over_t}"
            )
        try:
            return rectangular_section(h_over_t, nu)
        except ValueError as wrong:
            if str(wrong).startswith(("alpha", "beta")):  # not what the user gave
                raise ValueError(f"h_over_t is too extreme: {wrong} for {h_over_t}") from None
            raise
    if alpha is None and beta is None:
        raise ValueError("h_over_t (or both --alpha and --beta) must be given, got neither")
    if alpha is None:
        raise ValueError(f"alpha must be given together with --beta {beta}, got none")
    if beta is None:
        raise ValueError(f"beta must be given together with --alpha {alpha}, got none")
    return section(alpha, beta)


def _numbers(name: str, text: str | None) -> tuple[float, ...] | None:
    """The numbers in a comma-separated list."""
    if text is None:
        return None
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"{name} must be numbers separated by commas, got {text!r}") from None
