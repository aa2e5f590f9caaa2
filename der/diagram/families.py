"""The phase diagrams: families of rings over a unit square or cube, about one axis or both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from der.diagram.cases import TOLERANCE, Case
from der.utils.checks import checked_number

H_OVER_T = (1.0, 4.0)
DIGITS = 12  # of parameters, so that they read 0.6 and not 0.6000000000000001


@dataclass(frozen=True)
class Family:
    """A phase diagram: cases over the unit square (cube) of its parameters.

    Parameters
    ----------
    name : as on the command line
    title : with mathtext
    shape : of all its cases
    ranges : first and last value of what varies, by name, in the order of the unit coordinates;
        r_over_a comes after what bounds it, and h_over_t is the last
    fixed : parameters that do not vary, by name
    sheets : twisting axes; each has a unit square (cube) of its own
    stadium : whether r_over_a is b_over_a
    marks : cases of the paper's other figures that lie in this diagram
    nu, tolerance : of all its cases
    coarse, finest : intervals along each parameter, of the first grid and of the finest level
    """

    name: str
    title: str
    shape: str
    ranges: Mapping[str, tuple[float, float]]
    fixed: tuple[tuple[str, float], ...] = ()
    sheets: tuple[str, ...] = ("x",)
    stadium: bool = False
    marks: tuple[Case, ...] = ()
    nu: float = 0.3
    tolerance: float = TOLERANCE
    coarse: int = 16
    finest: int = 64

    @property
    def parameters(self) -> tuple[str, ...]:
        """What varies, in the order of the unit coordinates."""
        return tuple(self.ranges)

    @property
    def dimension(self) -> int:
        """Of the diagram: 2 or 3."""
        return len(self.ranges)

    @property
    def span(self) -> tuple[float, float]:
        """First and last value of the first parameter."""
        return self.bounds(self.parameters[0], dict(self.fixed))

    def bounds(self, name: str, values: Mapping[str, float]) -> tuple[float, float]:
        """First and last value of a parameter, given those before it.

        The fillets are at most b (rectangle) or the inscribed circle (triangle): the diagram is a
        prism, and the unit coordinate reaches from its one side to the other.
        """
        low, high = self.ranges[name]
        if name == "r_over_a":
            high = min(high, widest_fillet(self.shape, values))
        return low, high

    def case(self, sheet: str, unit: Sequence[float]) -> Case:
        """The case at unit coordinates, each from 0 to 1.

        A ring with b = a is the same about both axes; its axis is x.
        """
        values = dict(self.fixed)
        for name, part in zip(self.parameters, unit, strict=True):
            low, high = self.bounds(name, values)
            value = min(round(low + (high - low) * part, DIGITS), high)
            # the widest fillet to the last bit: a straight of 1e-13 a is left out
            values[name] = high if part == 1.0 else value
        if self.stadium:
            values["r_over_a"] = values["b_over_a"]
        axis = "x" if values.get("b_over_a", 1.0) == 1.0 else sheet
        return Case(self.shape, **values, twist_axis=axis, nu=self.nu, tolerance=self.tolerance)

    def unit(self, case: Case) -> tuple[float, ...] | None:
        """The unit coordinates of a case; None where it does not lie in the diagram."""
        axes = {*self.sheets} | ({"x"} if case.b_over_a == 1.0 else set())
        if (case.shape, case.nu) != (self.shape, self.nu) or case.twist_axis not in axes:
            return None
        if any(getattr(case, name) != value for name, value in self.fixed):
            return None
        if self.stadium and case.r_over_a != case.b_over_a:
            return None
        values = {name: getattr(case, name) for name in ("b_over_a", "vertex_angle")}
        unit = []
        for name in self.parameters:
            low, high = self.bounds(name, values)
            part = (getattr(case, name) - low) / (high - low) if high > low else 0.0
            if not -1e-9 <= part <= 1.0 + 1e-9:
                return None
            unit.append(min(max(part, 0.0), 1.0))
        return tuple(unit)


def widest_fillet(shape: str, values: Mapping[str, float]) -> float:
    """Largest r/a of a rectangle or triangle with the given b_over_a or vertex_angle [degrees]."""
    if shape == "rectangle":
        return values["b_over_a"]
    return math.tan(math.pi / 4 - math.radians(values["vertex_angle"]) / 4) / 2  # paper, p. 14


def family(
    name: str,
    *,
    nu: float = 0.3,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    finest: int | None = None,
) -> Family:
    """A phase diagram by its name.

    Parameters
    ----------
    name : of FAMILIES
    nu : Poisson's ratio
    ranges : first and last value of parameters, by name, in place of the paper's
    finest : intervals along each parameter at the finest level, a power of two from 2 to 1024

    Raises
    ------
    ValueError
        For what is not such; the message names the argument and its value.
    """
    if name not in FAMILIES:
        raise ValueError(f"name must be one of {', '.join(FAMILIES)}, got {name!r}")
    found = FAMILIES[name]
    checked_number("nu", nu, "a number in (-1, 0.5]", lambda number: -1 < number <= 0.5)
    if finest is not None:
        powers = [2**k for k in range(1, 11)]
        if isinstance(finest, bool) or finest not in powers:
            raise ValueError(f"finest must be a power of two from 2 to 1024, got {finest!r}")
        found = replace(found, finest=finest, coarse=min(found.coarse, finest))
    new = dict(found.ranges)
    for parameter, given in (ranges or {}).items():
        if parameter not in new:
            words = ", ".join(found.parameters)
            raise ValueError(f"ranges of {name} must be of {words}, got {parameter!r}")
        new[parameter] = _checked_range(parameter, given)
    found = replace(
        found,
        ranges=new,
        nu=nu,
        marks=tuple(replace(m, nu=nu) for m in found.marks),
    )
    for corner in product((0.0, 1.0), repeat=found.dimension):
        if "r_over_a" in found.parameters and _empty(found, corner):
            low = new["r_over_a"][0]
            raise ValueError(f"r_over_a must begin below the widest fillet of all rings, got {low}")
        found.case(found.sheets[-1], corner).scene()  # refuses a value that is not allowed, by name
    return found


def _checked_range(name: str, given: tuple[float, float]) -> tuple[float, float]:
    if len(given) != 2:
        raise ValueError(f"{name} must have a first and a last value, got {given!r}")
    low, high = (checked_number(name, value) for value in given)
    if not low < high:
        raise ValueError(f"{name} must have a first value below its last, got {given!r}")
    return low, high


def _empty(found: Family, corner: Sequence[float]) -> bool:
    """Whether no fillet of the range fits at a corner."""
    case = found.case(found.sheets[-1], corner)
    values = {n: getattr(case, n) for n in ("b_over_a", "vertex_angle")}
    low, high = found.bounds("r_over_a", values)
    return not low < high


# --- The diagrams of the paper ---------------------------------------------------------------

_PLAIN = (1.0, 2.0, 3.0, 4.0)  # h/t of figs. 4b, 7b, 10b, 10c


def _both(shape: str, b: float, h: float, **more: float) -> list[Case]:
    return [Case(shape, h, axis, b_over_a=b, **more) for axis in "xy"]


_ELLIPSES = (
    *(Case("ellipse", h, b_over_a=1.0) for h in (1.0, 1.6, 2.0, 4.0)),  # circle, fig. 2b
    *(case for h in _PLAIN for case in _both("ellipse", 0.6, h)),  # fig. 4b
    *(case for b in (0.7, 0.85) for case in _both("ellipse", b, 4.0)),  # fig. D.1
)
_RECTANGLES = (
    *(case for h in _PLAIN for case in _both("rectangle", 0.6, h, r_over_a=0.3)),  # fig. 7b
    *(case for b in (0.4, 0.8) for case in _both("rectangle", b, 4.0, r_over_a=0.3)),  # fig. D.2
)
_SQUARES = tuple(
    Case("rectangle", 4.0, b_over_a=1.0, r_over_a=r)
    for r in (0.1, 0.3, 0.6, 1.0)  # fig. D.2
)
_EQUILATERAL = tuple(
    Case("triangle", h, vertex_angle=60.0, r_over_a=math.sqrt(3) / 12)
    for h in _PLAIN  # fig. 10b
)
_OBTUSE = tuple(
    Case("triangle", h, vertex_angle=120.0, r_over_a=1 / 15)
    for h in _PLAIN  # fig. 10c
)
_SHARP = Case("triangle", 4.0, vertex_angle=90.0, r_over_a=1 / 30)  # fig. 11b

_FAMILIES = (
    Family(
        "fig3a",
        "Elliptical rings",
        "ellipse",
        {"b_over_a": (0.5, 1.0), "h_over_t": (0.2, 4.0)},
        sheets=("x", "y"),
        marks=_ELLIPSES,
    ),
    Family(
        "fig5a",
        "Rounded rectangular rings",
        "rectangle",
        {"b_over_a": (0.2, 1.0), "r_over_a": (0.1, 1.0), "h_over_t": H_OVER_T},
        sheets=("x", "y"),
        marks=(*_RECTANGLES, *_SQUARES),
        coarse=8,
        finest=32,
    ),
    Family(
        "fig5b",
        "Stadium rings, $r = b$",
        "rectangle",
        {"b_over_a": (0.2, 1.0), "h_over_t": H_OVER_T},
        sheets=("x", "y"),
        stadium=True,
        marks=_SQUARES[-1:],
    ),
    Family(
        "fig5c",
        "Rounded square rings, $a = b$",
        "rectangle",
        {"r_over_a": (0.1, 1.0), "h_over_t": H_OVER_T},
        fixed=(("b_over_a", 1.0),),
        marks=_SQUARES,
    ),
    Family(
        "fig8a",
        "Rounded triangular rings",
        "triangle",
        {"vertex_angle": (30.0, 120.0), "r_over_a": (0.033, 0.384), "h_over_t": H_OVER_T},
        marks=(*_EQUILATERAL, *_OBTUSE, _SHARP),
        coarse=8,
        finest=32,
    ),
    Family(
        "fig8b",
        "Rounded equilateral triangular rings, $\\alpha_T$ = 60°",
        "triangle",
        {"r_over_a": (0.033, 0.384), "h_over_t": H_OVER_T},
        fixed=(("vertex_angle", 60.0),),
        marks=_EQUILATERAL,
    ),
    Family(
        "fig8c",
        "Rounded triangular rings, $\\alpha_T$ = 120°",
        "triangle",
        {"r_over_a": (0.033, 0.384), "h_over_t": H_OVER_T},
        fixed=(("vertex_angle", 120.0),),
        marks=_OBTUSE,
    ),
    Family(
        "circle",
        "Circular rings with natural curvature",
        "circle",
        {"natural_curvature": (0.0, 2.0), "h_over_t": H_OVER_T},
        marks=tuple(Case("circle", h, natural_curvature=1.0) for h in (1.0, 1.6, 2.0, 4.0)),
    ),
)
FAMILIES = {one.name: one for one in _FAMILIES}
