"""The command `der`: the roof over the packages, and the only file that imports typer.

Exit codes: 0 done; 2 bad input, in one line that names the option, the value and what is allowed;
3 not converged, with the last good state saved and named; 130 stopped by Ctrl-C, likewise saved.
"""

from __future__ import annotations

import atexit
import inspect
import math
import signal
import sys
import time
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path as File
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from der.output import (
    OUTPUT,
    check_named,
    check_writable,
    deliver,
    keep_somewhere,
    kept,
    places,
    say,
    show,
    targets,
    whereabouts,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from der.output import Record, Targets, Writers
    from der.record import Path
    from der.ring import Ring
    from der.scene import Scene
    from der.sections import Section
    from der.view_rerun import Live

SHAPES = {  # and the options that go with each
    "circle": ("natural_curvature",),
    "ellipse": ("b_over_a",),
    "rectangle": ("b_over_a", "r_over_a"),
    "triangle": ("vertex_angle", "r_over_a"),
    "profile": (),
}
NU = 0.3  # Poisson's ratio where none is given

app = typer.Typer(
    help="Discrete elastic rods for rings that fold by twisting.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command and leave with its exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        code = app(args=arguments or ["--help"], prog_name="der", standalone_mode=False)
    except typer.TyperException as wrong:
        text = " ".join(str(getattr(wrong, "message", wrong)).split())
        if hasattr(wrong, "format_message"):
            text = " ".join(wrong.format_message().split())
        say(f"der: {text}")
        code = 2
    except (typer.Abort, KeyboardInterrupt) as stopped:
        # a second Ctrl-C in the midst of leaving would leave semaphores behind
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        if str(stopped):
            say(f"der: {stopped}")
        code = 130
    except (OSError, RuntimeError) as wrong:  # a full disk; workers that cannot work
        say(f"der: {wrong}")
        code = 3
    sys.exit(code or 0)


def _number(text: str) -> float:
    """Parse an option's number, so that a bad one is named with its value."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"must be a number, got {text!r}") from None


def _whole(text: str) -> int:
    """Parse an option's whole number, likewise."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"must be a whole number, got {text!r}") from None


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"der {version('ring-origami')}")
        raise typer.Exit


@app.callback()
def _top(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Say the version."),
    ] = False,
) -> None:
    """Discrete elastic rods for rings that fold by twisting."""


@contextmanager
def _options_named() -> Iterator[None]:
    """Turn a ValueError about an argument into one about the option of that name."""
    try:
        yield
    except ValueError as wrong:
        words = str(wrong).split(" ", 1)
        option = {"n_edges": "edges", "twist_axis": "axis"}.get(words[0], words[0])
        option = "FILE" if option == "file" else f"--{option.replace('_', '-')}"
        raise typer.TyperException(" ".join([option, *words[1:]])) from None


# --- What commands have in common ------------------------------------------------------------


def _number_option(text: str, **more: Any) -> Any:
    """An option that takes a number."""
    return typer.Option(parser=_number, help=text, **more)


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
        float | None, _number_option("Short semi-axis over the long one, ellipse and rectangle.")
    ] = None
    r_over_a: Annotated[
        float | None, _number_option("Radius of the fillets, rectangle and triangle.")
    ] = None
    vertex_angle: Annotated[
        float | None, _number_option("Angle at the apex of a triangle, degrees.")
    ] = None
    natural_curvature: Annotated[
        float | None, _number_option("Natural curvature of a circle, in units of 1/a.")
    ] = None
    axis: Annotated[
        str, typer.Option(help="Twisting axis: x (grips at the short semi-axis) or y.")
    ] = "x"
    h_over_t: Annotated[float | None, _number_option("Height over thickness of the section.")] = (
        None
    )
    alpha: Annotated[float | None, _number_option("EI1/GJ, with --beta.")] = None
    beta: Annotated[float | None, _number_option("EI2/GJ, with --alpha.")] = None
    nu: Annotated[float, _number_option("Poisson's ratio, with --h-over-t.")] = NU
    a_over_t: Annotated[
        float, _number_option("Reference length over thickness: finite stretch and drawing.")
    ] = 200.0

    def ring(self) -> Ring:
        """The ring that the command line describes."""
        from der import ring as rings

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
            from der.profile_files import read_profile

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

    edges: Annotated[int, typer.Option(parser=_whole, help="Edges of the full ring.")] = 64
    gamma_max: Annotated[float, _number_option("Where the path ends, rad.")] = math.pi
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
        _number_option("fold: residual of an equilibrium, GJ/a, 1e-10; bvp: relative error, 1e-8."),
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
    port: Annotated[int, typer.Option(parser=_whole, help="Where --live serves.")] = 9876


def _command(*groups: Any) -> Callable[[Callable[..., int]], Callable[..., None]]:
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
    from der.sections import rectangular_section, section

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


# --- The commands ----------------------------------------------------------------------------


@_command(RingOptions, PathOptions, FileOptions, LiveOptions)
def fold(ring: RingOptions, path: PathOptions, files: FileOptions, watch: LiveOptions) -> int:
    """Fold a ring: the path of equilibria from flat on, its folds, and the index of every state."""
    with _options_named():
        playback = watch.live or files.rrd is not None
        other = files.other()
        scene = path.scene(
            ring,
            shapes=playback or files.drawn,
            history=playback or files.moving,
            modes=playback and path.stability and path.solver == "newton",
        )
        written = files.targets()
        served = _served(watch.port) if watch.live else nullcontext()
    from der.folding import fold as solve

    with served as shown:

        def run(progress: Callable[[float], object] | None) -> Path:
            return solve(scene, progress=progress, watch=None if shown is None else shown.show)

        found, code = _follow(run, scene, written, other, quiet=files.quiet)
        if shown is not None and len(found) and found.status != "interrupted":
            _keep_showing(shown, found)
    return code


@_command(RingOptions, PathOptions, FileOptions)
def bvp(ring: RingOptions, path: PathOptions, files: FileOptions) -> int:
    """Solve the boundary-value problem: the same path, to the error that you ask for."""
    with _options_named():
        from validation.solving import TOLERANCE, check, solve

        tolerance = TOLERANCE if path.tolerance is None else path.tolerance
        scene = path.scene(ring, shapes=files.drawn, error_bars=False, tolerance=1e-10)
        check(scene, tolerance)
        written = files.targets()
        other = files.other()

    def run(progress: Callable[[float], object] | None) -> Path:
        return solve(scene, tolerance=tolerance, progress=progress)

    return _follow(run, scene, written, other, quiet=files.quiet)[1]


@dataclass(frozen=True)
class ComparisonFiles:
    """What a comparison writes."""

    json: Annotated[
        str | None, typer.Option(metavar="F", help="Write both records and differences here.")
    ] = None
    plot: Annotated[
        str | None, typer.Option(metavar="F", help="Draw both: .png, .pdf or .svg.")
    ] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write comparison.json and .png here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no table.")] = False


@_command(RingOptions, PathOptions, ComparisonFiles)
def compare(ring: RingOptions, path: PathOptions, files: ComparisonFiles) -> int:
    """Hold the rod against the boundary-value problem, state by state, with their error bars."""
    with _options_named():
        from validation.solving import TOLERANCE, check

        check(path.scene(ring, error_bars=False), TOLERANCE)  # what the other solver cannot do
        scene = path.scene(ring, error_bars=True)
        written = targets(files.json, files.plot, None, files.out, stem="comparison", shapes=False)
    from der.folding import fold as solve
    from der.unfinished import Interrupted, NotConverged
    from validation.comparison import compare as compared
    from validation.comparison import table

    try:
        with _progress(scene, quiet=files.quiet) as tick:
            found = compared(scene, solve(scene, progress=tick), progress=tick)
    except (NotConverged, Interrupted) as unfinished:
        code = 3 if isinstance(unfinished, NotConverged) else 130
        return _finish(unfinished.path, {}, code, quiet=files.quiet)

    def plot(file: File) -> None:
        from validation.comparison_plot import save_comparison

        save_comparison(found, file)

    return _hand_over(found, written, 0, {"plot": plot}, lambda: table(found), quiet=files.quiet)


HYSTERESIS = "hysteresis"  # a figure that the rod draws: loading and unloading of four rings


@app.command()
def figure(
    names: Annotated[
        list[str],
        typer.Argument(metavar="NAME...", help="fig2b, fig3b, ..., hysteresis; all; or diagrams."),
    ],
    out: Annotated[str, typer.Option(metavar="DIR", help="The folder to write to.")],
    workers: Annotated[
        int | None, typer.Option(parser=_whole, help="Processes; one a core if not given.")
    ] = None,
) -> None:
    """Draw the paper's figures: PNG, and the data as CSV. Diagrams are the phase diagrams."""
    with _options_named():
        check_named(out=out)
        from validation.figures import DIAGRAMS, FIGURES, Interrupted, draw

        several = {"all": [*FIGURES, HYSTERESIS], "diagrams": list(DIAGRAMS)}
        chosen = several.get(" ".join(names), names)
        turned = HYSTERESIS in chosen
        chosen = [name for name in chosen if name != HYSTERESIS]
        try:
            drawn = draw(chosen, out, workers=workers)
        except Interrupted as stopped:
            drawn, code = stopped.drawn, 130
        else:
            code = 3 if drawn.failed else 0
    written = [file for files in drawn.written.values() for file in files]
    if turned and code != 130:
        from scenarios.hysteresis import draw as draw_loops

        written += draw_loops(File(out))
    for file in written:
        show(str(file))
    for name, reason in drawn.failed.items():
        say(f"der: {name} failed: {reason}")
    raise typer.Exit(code)


CELLS = 60  # along each side of a surface


@dataclass(frozen=True)
class LandscapeOptions:
    """Which landscape, and what is written."""

    two_dimensional: Annotated[
        bool, typer.Option("--two-dimensional", help="Over twist and grip distance.")
    ] = False
    free: Annotated[bool, typer.Option("--free", help="The barrier with the grips removed.")] = (
        False
    )
    push: Annotated[
        bool, typer.Option("--push", help="The forces or couples that open it with least work.")
    ] = False
    cells: Annotated[
        int, typer.Option(parser=_whole, help="Along each side, with --two-dimensional.")
    ] = CELLS
    json: Annotated[str | None, typer.Option(metavar="F", help="Write it here ('-': output).")] = (
        None
    )
    plot: Annotated[str | None, typer.Option(metavar="F", help="Draw it: .png, .pdf, .svg.")] = None
    rrd: Annotated[
        str | None,
        typer.Option(metavar="F", help="Record it with the ring for playback with rerun: .rrd."),
    ] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write landscape.json and .png here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False


@_command(RingOptions, PathOptions, LandscapeOptions)
def landscape(ring: RingOptions, path: PathOptions, wanted: LandscapeOptions) -> int:
    """Map the energy: rests, wells, saddles, and barriers to fold the ring and to open it."""
    with _options_named():
        _check_landscape(path, wanted)
        scene = path.scene(ring, error_bars=not wanted.two_dimensional)
        if wanted.rrd is not None and not wanted.two_dimensional:
            scene = _with_shapes(scene)
        written = targets(
            wanted.json, wanted.plot, wanted.rrd, wanted.out, stem="landscape", shapes=False
        )
        from der.landscape_curve import landscape as curve

        found: Any
        with _progress(scene, quiet=wanted.quiet) as tick:
            if wanted.two_dimensional:
                from der.landscape_surface import surface

                found = surface(scene, shape=(wanted.cells, wanted.cells), progress=tick)
            elif wanted.push:
                from der.landscape_push import least_push

                found = least_push(scene, progress=tick)
            elif wanted.free:
                from der.landscape_free import free_barrier

                found = free_barrier(scene)
            else:
                found = curve(scene, progress=tick)
    from der.drawings import of_landscape
    from der.landscape_words import reason, words

    def along() -> Any:
        return curve(_with_shapes(scene), index_free=False) if wanted.two_dimensional else found

    code = {"done": 0, "interrupted": 130}.get(found.status, 3)
    return _hand_over(
        found,
        written,
        code,
        of_landscape(found, along),
        lambda: words(found, why=not code),
        unfinished=f"{reason(found)}; what was found is",
        quiet=wanted.quiet,
    )


def _check_landscape(path: PathOptions, wanted: LandscapeOptions) -> None:
    """Refuse options that a landscape of this kind would not look at."""
    modes = {
        "--two-dimensional": wanted.two_dimensional,
        "--free": wanted.free,
        "--push": wanted.push,
    }
    kinds = [name for name, is_given in modes.items() if is_given]
    if len(kinds) > 1:
        raise ValueError(f"{kinds[-1][2:]} cannot be given together with {kinds[0]}, got both")
    if not 3 <= wanted.cells <= 1000:
        raise ValueError(f"cells must be from 3 to 1000, got {wanted.cells}")
    if wanted.cells != CELLS and not wanted.two_dimensional:
        raise ValueError(f"cells must go with --two-dimensional, got {wanted.cells} alone")
    if wanted.rrd is not None and (wanted.free or wanted.push):
        raise ValueError(f"rrd cannot be given together with {kinds[0]}, got {wanted.rrd!r}")
    if path.control != "arclength":
        raise ValueError(f"control must be 'arclength' for a landscape, got {path.control!r}")
    if path.gamma_max != math.pi:
        raise ValueError(
            "gamma_max cannot be given for a landscape, which ends where the ring has folded, "
            f"got {path.gamma_max}"
        )
    for name in ("until", "save_at") if kinds else ():
        value = getattr(path, name)
        if value is not None:
            raise ValueError(f"{name} cannot be given together with {kinds[0]}, got {value!r}")


def _with_shapes(scene: Scene) -> Scene:
    """The scene with the ring at every state, and its softest modes."""
    return replace(scene, shapes=True, modes=True)


@dataclass(frozen=True)
class StatesOptions:
    """Which states, and what is written."""

    gamma: Annotated[
        float | None, _number_option("Rotation of each grip, rad; the ring is free if not given.")
    ] = None
    count: Annotated[
        int,
        typer.Option(
            parser=_whole,
            help="States after which to stop; minima that these fall to are added.",
        ),
    ] = 12
    edges: Annotated[int, typer.Option(parser=_whole, help="Edges of the full ring.")] = 64
    json: Annotated[str | None, typer.Option(metavar="F", help="Write it here ('-': output).")] = (
        None
    )
    plot: Annotated[str | None, typer.Option(metavar="F", help="Draw it: .png, .pdf, .svg.")] = None
    out: Annotated[
        str | None, typer.Option(metavar="DIR", help="Write states.json, .png and shapes.npz here.")
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False


@_command(RingOptions, StatesOptions)
def states(ring: RingOptions, wanted: StatesOptions) -> int:
    """Find the states of a ring, free or in its grips, and which of them falls to which."""
    from der.scene import Scene

    with _options_named():
        whole = ring.ring()
        divisor, piece = (4, "a quarter") if whole.symmetry == "D2" else (2, "half")
        if wanted.edges % divisor:
            raise ValueError(
                f"edges must be divisible by {divisor}, as the path of twisting, where the search "
                f"starts, is followed on {piece} of the ring, got {wanted.edges}"
            )
        scene = Scene(whole, ring.section(), n_edges=wanted.edges, a_over_t=ring.a_over_t)
        written = targets(wanted.json, wanted.plot, None, wanted.out, stem="states")
        from der.states_search import states as search

        with _counted("states", wanted.count, quiet=wanted.quiet) as tick:
            found = search(scene, gamma=wanted.gamma, count=wanted.count, progress=tick)
    from der.drawings import of_states
    from der.states_words import words

    return _hand_over(
        found,
        written,
        {"done": 0, "interrupted": 130}.get(found.status, 3),
        of_states(found),
        lambda: words(found),
        unfinished=f"{found.message}; states that were found: {len(found)},",
        quiet=wanted.quiet,
    )


PHASES = {  # the diagrams of each shape, that of a cube last
    "ellipse": ("fig3a",),
    "rectangle": ("fig5b", "fig5c", "fig5a"),
    "triangle": ("fig8b", "fig8c", "fig8a"),
    "circle": ("circle",),
}


@app.command()
def phase(
    shape: Annotated[
        str,
        typer.Argument(
            metavar="SHAPE", help="ellipse, rectangle, triangle, circle; or a diagram: fig3a, ..."
        ),
    ],
    out: Annotated[str, typer.Option(metavar="DIR", help="The folder to write to.")],
    workers: Annotated[
        int | None, typer.Option(parser=_whole, help="Processes; one a core if not given.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler, instead.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the cases that the folder has.")
    ] = False,
    nu: Annotated[float, _number_option("Poisson's ratio.")] = NU,
    span: Annotated[
        list[str] | None,
        typer.Option("--range", metavar="NAME=A:B", help="Of a parameter, such as b_over_a=0.7:1."),
    ] = None,
    finest: Annotated[
        int | None, typer.Option(parser=_whole, help="Finest cells along a side, a power of two.")
    ] = None,
    check: Annotated[
        str | None, typer.Option(help="'der': ask the rod about a sample of the cases.")
    ] = None,
    sample: Annotated[int, typer.Option(parser=_whole, help="Cases that --check asks about.")] = 40,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="No progress and no summary; warnings.")
    ] = False,
) -> None:
    """Map how rings fold over profile and cross-section: cases, sharp boundaries, a picture."""
    with _options_named():
        check_named(out=out)
        from der.folding import fold as rod
        from validation.phase import FAMILIES, run_phase

        chosen = PHASES.get(shape, (shape,) if shape in FAMILIES else ())
        if not chosen:
            words = ", ".join(dict.fromkeys([*PHASES, *FAMILIES]))
            raise typer.TyperException(f"SHAPE must be one of {words}, got {shape!r}")
        if check not in (None, "der"):
            raise ValueError(f"check must be 'der', got {check!r}")
        for name in chosen:
            text = run_phase(
                name,
                File(out) / name if len(chosen) > 1 else out,
                workers=workers,
                scheduler=scheduler,
                resume=resume,
                nu=nu,
                ranges=tuple(span or ()),
                check=rod if check else None,
                sample=sample,
                finest=finest,
                quiet=quiet,
                warn=lambda words: say(f"der: {words}"),
            )
            if not quiet:
                show(text)


@app.command()
def bench(
    json: Annotated[str | None, typer.Option(metavar="F", help="Write what is measured.")] = None,
    out: Annotated[
        str | None,
        typer.Option(metavar="DIR", help="Write bench.json, bench_error.png and bench_cost.png."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions and sizes.")] = False,
    only: Annotated[
        str | None,
        typer.Option(
            metavar="PARTS",
            help="Of paths, needs, orders, error, state, scaling, sweep, start; commas between.",
        ),
    ] = None,
) -> None:
    """Measure time, memory and error of this package and its peers, on this machine, in one run."""
    with _options_named():
        check_named(json=json, out=out)
        if json is not None:
            check_writable("json", File(json))
        folder = (
            None if out is None else targets(None, None, None, out, stem="bench")["json"][0].parent
        )
        from validation.bench import PARTS, run

        parts = PARTS if only is None else tuple(part.strip() for part in only.split(","))
        run(None if json is None else File(json), out=folder, quick=quick, only=parts)


@app.command()
def stress(
    quick: Annotated[bool, typer.Option("--quick", help="120 cases, under a minute.")] = False,
    long: Annotated[bool, typer.Option("--long", help="10,000 cases, about an hour.")] = False,
    json: Annotated[str | None, typer.Option(metavar="F", help="Write the summary here.")] = None,
) -> None:
    """Try to break both solvers, and count what has no named reason."""
    with _options_named():
        if quick and long:
            raise ValueError("quick cannot be given together with --long, got both")
        check_named(json=json)
        if json is not None:
            check_writable("json", File(json))
        from validation.stress import stress as run

        summary = run("long" if long else "quick", None if json is None else File(json))
    show(str(summary))
    raise typer.Exit(130 if summary.interrupted else 0)


# --- From the scene to the files -------------------------------------------------------------


def _follow(
    run: Callable[[Callable[[float], object] | None], Path],
    scene: Scene,
    written: Targets,
    other: Path | None,
    *,
    quiet: bool,
) -> tuple[Path, int]:
    """Follow the path, write what was asked for, and return it with the exit code.

    Where ``other`` is given, what moves shows it, too.
    """
    from der.unfinished import Interrupted, NotConverged

    code = 0
    try:
        with _progress(scene, quiet=quiet) as tick:
            path = run(tick)
    except (NotConverged, Interrupted) as unfinished:
        path = unfinished.path
        code = 3 if isinstance(unfinished, NotConverged) else 130
    return path, _finish(path, written, code, other, quiet=quiet)


def _finish(
    path: Path, written: Targets, code: int, other: Path | None = None, *, quiet: bool
) -> int:
    """Write a path, finished or not, say what there is to say, and return the exit code."""
    from der.drawings import of_path
    from der.summary import summary

    if path.status != "done":
        keep_somewhere(written)
    code = max(code, deliver(path, written, of_path(path, other)))
    if path.status != "done":
        say(f"der: {path.message}; {whereabouts(path, written)}")
    return _tell(lambda: summary(path), written, code, quiet=quiet)


def _hand_over(
    found: Record,
    written: Targets,
    code: int,
    writers: Writers,
    text: Callable[[], str],
    *,
    unfinished: str = "",
    quiet: bool,
) -> int:
    """Write an answer and what is drawn of it, say what there is to say; the exit code.

    ``unfinished`` begins the line that says where what was found of it is.
    """
    if code:
        keep_somewhere(written)
    written_code = deliver(found, written, writers)
    if code:
        say(f"der: {unfinished} {places(written, shapes='shapes' in writers)}")
    return _tell(text, written, max(code, written_code), quiet=quiet)


def _tell(text: Callable[[], str], written: Targets, code: int, *, quiet: bool) -> int:
    """Print the summary of an answer, where output is not the record's; the exit code."""
    if quiet or OUTPUT in written.get("json", ()):
        return code
    return code if show(text()) else max(code, 3)


def _served(port: int) -> Live:
    """What is watched while it is made, its address told."""
    from der.view_rerun import Live

    live = Live(port)
    say(f"der: to watch, run: rerun {live.address}")
    return live


def _keep_showing(live: Live, path: Path) -> None:
    """Serve the whole film until Ctrl-C."""
    with suppress(KeyboardInterrupt):
        live.finish(path)
        say("der: the film can be watched until Ctrl-C")
        while True:
            time.sleep(3600.0)


@contextmanager
def _progress(scene: Scene, *, quiet: bool) -> Iterator[Callable[[float], object] | None]:
    """A progress bar over gamma, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("loading kernels (compiled once, in half a minute)", total=None)
        states = 0

        def tick(gamma: float) -> None:
            nonlocal states
            states += 1
            text = f"gamma = {gamma:.3f}, {states} states"
            bar.update(task, completed=gamma, total=scene.gamma_max, description=text)

        yield tick


@contextmanager
def _counted(what: str, most: int, *, quiet: bool) -> Iterator[Callable[[int], object] | None]:
    """A progress bar over things found, on a terminal only."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("loading kernels (compiled once, in half a minute)", total=most)
        yield lambda found: bar.update(task, completed=found, description=f"{found} {what}")
