r"""Rings: closed planar curves, their grips, and the bars that were bent to make them.

Lengths are in units of the ring's reference length a. The ring lies in the plane (E2, E3) and is
traversed counter-clockwise, E2 being the first axis and E3 the second. E3 is always the twisting
axis: s = 0 is the first grip, at -E3 with tangent +E2, and s = L/2 the second, at +E3. Every ring
is its own mirror image about E3.

        E3
        ^      second grip, s = L/2
        |    .-o-.
        |   /     \
        |  |       |        tangent (0, cos Theta, sin Theta)
        |   \     /
        |    '-o-'
        |      first grip, s = 0 ->
        +-------------> E2
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from der.geometry.outline import Array, Ellipse, Outline, arc, closed_curve, straight
from der.geometry.profile import knots_of, profile_of_knots, profile_of_points
from der.utils.checks import checked_number, shown

SMALLEST = 1e-6  # semi-axis or fillet: rounding of s, 1e-16, times the curvature is lost in angles


@dataclass(frozen=True, repr=False)
class Ring:
    """A ring: a closed planar curve, its natural curvature and its twisting axis.

    Made by `circle`, `ellipse`, `rectangle`, `triangle` and `profile`. Two rings are equal where
    shape, parameters and axis are.

    Parameters
    ----------
    shape : str
        "circle", "ellipse", "rectangle", "triangle" or "profile".
    parameters : dict
        What defines the shape, as it goes into the record (angles in degrees).
    twist_axis : str
        "x": the grips are at the ends of the short semi-axis; "y": of the long one.
    symmetry : str
        "D2": mirror symmetric about E2 and E3; "C2": about E3 only.
    outline : Outline
        The closed curve.
    natural_ratio : float
        Natural curvature over that of the closed curve, 1 for a ring that is free of stress.

    Notes
    -----
    The methods take arc lengths `s` from the first grip in units of a, any real numbers in an array
    of any shape, and raise ValueError where one is not finite.
    """

    shape: str
    parameters: Mapping[str, Any] = field(hash=False)
    twist_axis: str
    symmetry: str
    outline: Outline = field(compare=False)
    natural_ratio: float = field(default=1.0, compare=False)

    def __repr__(self) -> str:
        if self.shape == "profile":
            return f"Ring(profile, {len(self.parameters['arc_length'])} knots)"
        values = ", ".join(f"{name}={value}" for name, value in self.parameters.items())
        return f"Ring({self.shape}, {values}, twist_axis={self.twist_axis})"

    @property
    def length(self) -> float:
        """Full length L, units of a."""
        return self.outline.length

    @property
    def breaks(self) -> tuple[float, ...]:
        """Arc lengths in (0, L) at which the natural curvature jumps, increasing."""
        return self.outline.breaks

    @property
    def kinks(self) -> tuple[float, ...]:
        """Arc lengths in (0, L) at which the natural curvature is not smooth, increasing."""
        return self.outline.kinks

    def angle(self, s: ArrayLike) -> Array:
        """Return the tangent angle Theta of the closed ring, rad: 2 pi more with every turn."""
        turns, local = self._around(s)
        return self.outline.angle(local) + 2 * np.pi * turns

    def natural_angle(self, s: ArrayLike) -> Array:
        """Return the tangent angle of the ring cut open and freed of stress, rad."""
        return self.natural_ratio * self.angle(s)

    def curvature(self, s: ArrayLike) -> Array:
        """Return the natural curvature k1u, units of 1/a; right-continuous at jumps."""
        _, local = self._around(s)
        return self.natural_ratio * self.outline.curvature(local)

    def position(self, s: ArrayLike) -> Array:
        """Return points (r1, r2, r3) of the flat ring, one more dimension than `s`; r1 = 0.

        The twisting axis is r2 = 0, with r3 = 0 midway between the grips.
        """
        _, local = self._around(s)
        place = self.outline.place(local)
        return np.stack([np.zeros_like(place.real), place.real, place.imag], axis=-1)

    def to_json(self) -> dict[str, Any]:
        """Return the ring as it stands in the record: shape, parameters, twisting axis."""
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in self.parameters.items()}
        return {"shape": self.shape, **plain, "twist_axis": self.twist_axis}

    def _around(self, s: ArrayLike) -> tuple[Array, Array]:
        """Return full turns done, and the arc length since the last."""
        given = np.asarray(s) if not isinstance(s, list | tuple) else np.array(s, dtype=object)
        try:
            s = given.astype(float) if given.dtype.kind in "iufO" else np.array(np.nan)
        except (TypeError, ValueError, OverflowError):
            s = np.array(np.nan)
        if not np.all(np.isfinite(s)):
            raise ValueError(f"s must be finite arc lengths, got {shown(given)}")
        turns = np.floor(s / self.length)
        return turns, s - turns * self.length


def ring_from_json(record: Mapping[str, Any]) -> Ring:
    """Return the ring that `Ring.to_json` wrote.

    Parameters
    ----------
    record : mapping
        {"shape": ..., parameters, "twist_axis": "x" or "y"}; vertex_angle in degrees.

    Returns
    -------
    Ring
        Equal to the one written.

    Raises
    ------
    ValueError
        If the shape is unknown, an entry is missing or not known, or a value not allowed.
    """
    makers: dict[str, tuple[Callable[..., Ring], set[str]]] = {
        "circle": (circle, {"natural_curvature"}),
        "ellipse": (ellipse, {"b_over_a", "twist_axis"}),
        "rectangle": (rectangle, {"b_over_a", "r_over_a", "twist_axis"}),
        "triangle": (triangle_in_degrees, {"vertex_angle", "r_over_a"}),
        "profile": (profile, {"arc_length", "curvature"}),
    }
    entries = dict(record)
    shape = entries.pop("shape", None)
    if not isinstance(shape, str) or shape not in makers:
        raise ValueError(f"shape must be one of {', '.join(makers)}, got {shape!r}")
    make, expected = makers[shape]
    if "twist_axis" not in expected and entries.pop("twist_axis", "x") != "x":
        raise ValueError(f"twist_axis of ring {shape!r} must be 'x', got {record['twist_axis']!r}")
    if set(entries) != expected:
        raise ValueError(
            f"ring {shape!r} must have entries {sorted(expected)}, got {sorted(entries)}"
        )
    return make(**entries)


# --- The shapes ------------------------------------------------------------------------------


def circle(natural_curvature: float = 1.0) -> Ring:
    """Return a circular ring of radius a.

    Parameters
    ----------
    natural_curvature : float
        Curvature of the bar before it was closed, units of 1/a: 1 for a ring free of stress, 0 for
        one bent from a straight bar, < 0 for one bent against its natural curvature.

    Returns
    -------
    Ring
        The same about both axes.

    Raises
    ------
    ValueError
        If `natural_curvature` is not a finite number.
    """
    natural_curvature = checked_number("natural_curvature", natural_curvature)
    return Ring(
        shape="circle",
        parameters={"natural_curvature": natural_curvature},
        twist_axis="x",
        symmetry="D2",
        outline=closed_curve(arc(1.0, np.pi)),
        natural_ratio=natural_curvature,
    )


def ellipse(b_over_a: float, twist_axis: str = "x") -> Ring:
    """Return an elliptical ring.

    Parameters
    ----------
    b_over_a : float
        Short semi-axis over the long one, in (0, 1], at least 1e-6; a is the long one, about
        either axis.
    twist_axis : str
        "x": grips at the ends of the short semi-axis; "y": of the long one.

    Returns
    -------
    Ring
        Free of stress.

    Raises
    ------
    ValueError
        If an argument is not allowed.

    Notes
    -----
    Paper, section 2.1.2 and Eq. (1).
    """
    b = _semi_minor(b_over_a)
    across, along = _oriented(b, twist_axis)
    return Ring(
        shape="ellipse",
        parameters={"b_over_a": b},
        twist_axis=twist_axis,
        symmetry="D2",
        outline=Ellipse(across, along),
    )


def rectangle(b_over_a: float, r_over_a: float, twist_axis: str = "x") -> Ring:
    """Return a rectangular ring with rounded corners.

    Parameters
    ----------
    b_over_a : float
        Short half-side over the long one, in (0, 1], at least 1e-6; a is the long one, about
        either axis.
    r_over_a : float
        Radius of the fillets, in (0, b_over_a], at least 1e-6; b_over_a makes a stadium.
    twist_axis : str
        "x": grips at the ends of the short semi-axis; "y": of the long one.

    Returns
    -------
    Ring
        Free of stress.

    Raises
    ------
    ValueError
        If an argument is not allowed.

    Notes
    -----
    Paper, section 3.3 and figure 5a.
    """
    b = _semi_minor(b_over_a)
    across, along = _oriented(b, twist_axis)
    r = _fillet(r_over_a, b, "b_over_a")
    half = [
        straight(across - r),
        arc(r, np.pi / 2),
        straight(2 * (along - r)),
        arc(r, np.pi / 2),
        straight(across - r),
    ]
    return Ring(
        shape="rectangle",
        parameters={"b_over_a": b, "r_over_a": r},
        twist_axis=twist_axis,
        symmetry="D2",
        outline=closed_curve(*half),
    )


def triangle(vertex_angle: float, r_over_a: float) -> Ring:
    """Return a ring in the shape of an isosceles triangle with rounded corners.

    The grips are at the base's midpoint, s = 0, and at the apex, s = L/2.

    Parameters
    ----------
    vertex_angle : float
        Angle at the apex, rad, in (0, pi).
    r_over_a : float
        Radius of the fillets, in (0, tan(pi/4 - vertex_angle/4)/2], at least 1e-6 and at most that
        of the inscribed circle. a is the base of the sharp triangle.

    Returns
    -------
    Ring
        Free of stress.

    Raises
    ------
    ValueError
        If an argument is not allowed.

    Notes
    -----
    Paper, section 3.4 and figure 8a.
    """
    vertex_angle = checked_number(
        "vertex_angle", vertex_angle, "an angle in (0, pi) rad", lambda number: 0 < number < np.pi
    )
    return triangle_in_degrees(math.degrees(vertex_angle), r_over_a)


def triangle_in_degrees(vertex_angle: float, r_over_a: float) -> Ring:
    """Return the `triangle` whose angle is given in degrees, as in records and on command lines."""
    # The geometry follows the number in the record, so that a ring read back is the ring written;
    # rounding makes it 60 where degrees(pi/3) is not.
    degrees = round(
        checked_number(
            "vertex_angle",
            vertex_angle,
            "an angle in (0, 180) degrees",
            lambda number: 0 < round(number, 12) < 180,
        ),
        12,
    )
    apex = math.radians(degrees)
    inscribed = math.tan(math.pi / 4 - apex / 4) / 2
    r = _fillet(r_over_a, inscribed, "the inscribed circle's radius")
    base_turn, apex_turn = (np.pi + apex) / 2, np.pi - apex
    base_cut, apex_cut = r * math.tan(base_turn / 2), r * math.tan(apex_turn / 2)
    straights = 1 / 2 - base_cut, 1 / 2 / math.sin(apex / 2) - base_cut - apex_cut
    if r == inscribed:  # a circle; what rounding leaves of a straight would bend one arm alone
        straights = 0.0, 0.0
    half = [
        straight(straights[0]),
        arc(r, base_turn),
        straight(straights[1]),
        arc(r, apex_turn / 2),
    ]
    return Ring(
        shape="triangle",
        parameters={"vertex_angle": degrees, "r_over_a": r},
        twist_axis="x",
        symmetry="C2",
        outline=closed_curve(*half),
    )


def profile(
    arc_length: ArrayLike | None = None,
    curvature: ArrayLike | None = None,
    *,
    points: ArrayLike | None = None,
) -> Ring:
    """Return a ring of the user's own shape, mirror symmetric about the twisting axis.

    Parameters
    ----------
    arc_length, curvature : array_like, shape (n,)
        Natural curvature along the whole closed ring, counter-clockwise from the first grip (arc
        length 0) back to it, in units of the user's a and 1/a; linear between the knots. An arc
        length given twice is a jump.
    points : array_like, shape (n, 2), n >= 8
        Or, instead: points along a smooth closed curve, the first at the first grip; any unit of
        length, placed and turned at will. The curve is the periodic cubic spline through them, and
        a is half of the larger of the points' extents along and across the twisting axis.

    Returns
    -------
    Ring
        Free of stress; its second half is exactly the mirror image of the first, and small gaps
        (below) are closed by the smoothest change of the curvature.

    Raises
    ------
    ValueError
        If the input is not of this form; if the mirrored tangents differ by more than 1e-9 rad
        (1e-3 rad for points); if the total turning is not 2 pi or the ends do not meet, within 1e-6
        (1e-2 for points, where interpolation leaves a gap) in rad and relative to the length.
    """
    if points is None:
        outline, symmetry = profile_of_knots(arc_length, curvature)
    elif arc_length is None and curvature is None:
        outline, symmetry = profile_of_points(points)
    else:
        raise ValueError("points must be given without arc_length and curvature, got both")
    return Ring(
        shape="profile",
        parameters=knots_of(outline),
        twist_axis="x",
        symmetry=symmetry,
        outline=outline,
    )


def _semi_minor(b_over_a: object) -> float:
    return checked_number(
        "b_over_a",
        b_over_a,
        f"a number in (0, 1], at least {SMALLEST:g}",
        lambda number: SMALLEST <= number <= 1,
    )


def _fillet(r_over_a: object, largest: float, which: str) -> float:
    # A largest fillet that the user computed may differ from ours in rounding, to either side.
    r = checked_number(
        "r_over_a",
        r_over_a,
        f"a number in (0, {largest:.12g}], at least {SMALLEST:g} and at most {which}",
        lambda number: SMALLEST <= number <= largest * (1 + 1e-12),
    )
    return r if r < largest * (1 - 1e-12) else largest


def _oriented(b: float, twist_axis: object) -> tuple[float, float]:
    """Return the half extents along E2 and E3 (the twisting axis) of a ring with a = 1."""
    if not isinstance(twist_axis, str) or twist_axis not in ("x", "y"):
        raise ValueError(f"twist_axis must be 'x' or 'y', got {shown(twist_axis)}")
    return (1.0, b) if twist_axis == "x" else (b, 1.0)
