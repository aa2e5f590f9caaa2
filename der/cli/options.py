"""Options that commands have in common: a ring and its section, and a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from der.cli.output import say
from der.cli.parsing import argument, numbers, option

if TYPE_CHECKING:
    from der.geometry.ring import Ring
    from der.geometry.section import Section
    from der.scene import Scene

SHAPES = {  # and the options that go with each
    "circle": ("natural_curvature",),
    "ellipse": ("b_over_a",),
    "rectangle": ("b_over_a", "r_over_a"),
    "triangle": ("vertex_angle", "r_over_a"),
    "profile": (),
}
UNSURE = 0.02  # relative; of a profile's curvature, which is then warned of
NU = 0.3  # Poisson's ratio where none is given
A_OVER_T = 200.0
MEASURES = ("young", "height", "thickness", "size")  # given with units, all or none


@dataclass(frozen=True)
class RingOptions:
    """A ring and its section."""

    shape: str = argument("The ring: " + ", ".join(SHAPES) + ".", "SHAPE")
    file: str | None = argument(
        "Of a profile: a table of x, y (points) or arc_length, curvature; or JSON.", "[FILE]", None
    )
    b_over_a: float | None = option("Short semi-axis over the long one, ellipse and rectangle.")
    r_over_a: float | None = option("Radius of the fillets, rectangle and triangle.")
    vertex_angle: float | None = option("Angle at the apex of a triangle, degrees.")
    natural_curvature: float | None = option("Natural curvature of a circle, in units of 1/a.")
    axis: str | None = option(
        "Twisting axis: x, grips at the short semi-axis, or y. If not given: x; of a profile with "
        "several axes, the one through its first point."
    )
    h_over_t: float | None = option("Height over thickness of the section.")
    alpha: float | None = option("EI1/GJ, with --beta.")
    beta: float | None = option("EI2/GJ, with --alpha.")
    nu: float = option("Poisson's ratio, with --h-over-t or --young.", NU)
    a_over_t: float = option(
        "Reference length over thickness: finite stretch and drawing.", A_OVER_T
    )
    young: str | None = option("Young's modulus with its unit, 3.5GPa: answers have units.")
    height: str | None = option("Height of the section, with --young: 10mm.")
    thickness: str | None = option("Thickness of the section, with --young: 1mm.")
    size: str | None = option(
        "Reference length a, with --young: 100mm; a profile's lengths are in its unit, or in a."
    )
    units: str | None = option("Of force and length in answers, with --young: N,m or N,mm ...")

    def ring(self) -> Ring:
        """The ring that the command line describes."""
        from der.geometry import shapes as rings

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
            given = "none" if self.file is None else repr(self.file)
            raise typer.TyperException(
                f"FILE must be given with SHAPE profile, and with it only, got {given}"
            )
        if self.axis not in (None, "x", "y"):
            raise ValueError(f"axis must be x or y, got {self.axis!r}")
        if self.shape == "triangle" and self.axis == "y":
            raise ValueError("axis must be x for a triangle, its axis of symmetry, got 'y'")
        if self.shape == "circle":  # both axes are alike
            return rings.circle(1.0 if self.natural_curvature is None else self.natural_curvature)
        if self.shape == "profile":
            from der.geometry.profile_csv import read_profile

            ring = read_profile(str(self.file), self.axis, self.size)
            _warn_if_unsure(ring)
            return ring
        values = {name: getattr(self, name) for name in own}
        if self.shape == "triangle":
            return rings.triangle_in_degrees(**values)
        make: Any = {"ellipse": rings.ellipse, "rectangle": rings.rectangle}[self.shape]
        return make(**values, twist_axis=self.axis or "x")

    def stated(self) -> dict[str, Any]:
        """Section, a/t and scale of the scene that the command line describes."""
        given = [name for name in MEASURES if getattr(self, name) is not None]
        if not given:
            if self.units is not None:
                raise ValueError(f"units must go with --young, got {self.units!r} alone")
            return {"section": self.section(), "a_over_t": self.a_over_t}
        from der.geometry.scale import SI, dimensional

        for name in ("h_over_t", "alpha", "beta"):
            if (value := getattr(self, name)) is not None:
                raise ValueError(f"{name} cannot be given together with --{given[0]}, got {value}")
        if self.a_over_t != A_OVER_T:
            raise ValueError(
                f"a_over_t cannot be given together with --{given[0]}, got {self.a_over_t}: "
                "it is --size over --thickness"
            )
        for name, example in zip(MEASURES, ("3.5GPa", "10mm", "1mm", "100mm"), strict=True):
            if name not in given:
                raise ValueError(
                    f"{name} must be given with --{given[0]}, such as {example}, got none"
                )
        values = {name: getattr(self, name) for name in MEASURES}
        return dimensional(**values, nu=self.nu, units=SI if self.units is None else self.units)

    def section(self) -> Section:
        """The section that the command line describes."""
        from der.geometry.section import rectangular_section, section

        h_over_t, alpha, beta, nu = self.h_over_t, self.alpha, self.beta, self.nu
        if h_over_t is None and nu != NU:
            raise ValueError(f"nu can only be given together with --h-over-t or --young, got {nu}")
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
            raise ValueError(
                "h_over_t (or both --alpha and --beta, or --young with --height, --thickness and "
                "--size) must be given, got neither"
            )
        if alpha is None:
            raise ValueError(f"alpha must be given together with --beta {beta}, got none")
        if beta is None:
            raise ValueError(f"beta must be given together with --alpha {alpha}, got none")
        return section(alpha, beta)


def _warn_if_unsure(ring: Ring) -> None:
    """Say so where the data of a profile do not tell its curvature well."""
    error, grid = ring.parameters["curvature_error"], ring.parameters.get("resolution")
    if error > UNSURE:
        data = f"points known to +-{grid / 2:.2g}" if grid else "these data"
        say(
            f"der: warning: profile: natural curvature known to +-{100 * error:.2g} % from "
            f"{data}; error bars do not include that"
        )


@dataclass(frozen=True)
class PathOptions:
    """What is wanted of a path, and how it is found."""

    edges: int = option("Edges of the full ring.", 64)
    gamma_max: float = option("Where the path ends, rad.", math.pi)
    until: str | None = option("'folded': until the three-covered state, beyond pi too.")
    save_at: str | None = option("Solve at these gammas (rad, commas), not at k pi/8.")
    curvature: str = option("Measure of curvature: logarithm, angle or tangent.", "logarithm")
    stretch: str = option("inextensible or finite (EA).", "inextensible")
    tolerance: float | None = option(
        "fold: residual of an equilibrium, GJ/a, 1e-10; bvp: relative error, 1e-8."
    )
    stability: bool = option("Index of the full ring.", True)
    control: str = option("arclength (through folds), angle or moment (with snaps).", "arclength")
    unload: bool = option("Come back to 0, with --control angle or moment.", False)
    solver: str = option("newton, or relaxation with --control angle.", "newton")
    error_bars: bool = option("Extrapolate from N, N/2, N/4 edges, with errors.", False)
    sector: str = option("auto, full, half or quarter.", "auto")

    def scene(self, ring: RingOptions, **more: Any) -> Scene:
        """The scene that the command line describes."""
        from der.scene import Scene

        wanted: dict[str, Any] = {n: v for n, v in vars(self).items() if v is not None}
        wanted["n_edges"] = wanted.pop("edges")
        wanted["save_at"] = numbers("save_at", self.save_at)
        return Scene(ring.ring(), **ring.stated(), **wanted | more)
