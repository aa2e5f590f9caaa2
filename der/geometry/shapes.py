"""The shapes of rings: circle, ellipse, rectangle, triangle, and the user's own profile.

Lengths are in units of the ring's reference length a.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from der.geometry.outline import Ellipse, arc, closed_curve, straight
from der.geometry.profile import (
    knots_of,
    profile_of_curvature,
    profile_of_knots,
    profile_of_points,
)
from der.geometry.ring import Ring
from der.utils.checks import checked_number, shown

DATA = ("reference_length", "curvature_error", "resolution")  # of a profile: what it was made of
SMALLEST = 1e-6  # semi-axis or fillet: rounding of s, 1e-16, times the curvature is lost in angles

# fillet: s is rounded by 4e-16, angles by that over the radius, which must stay below 1e-10, the
# tolerance of equilibria; paths of sharper ones end in noise
SHARPEST = 1e-5


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
        If `natural_curvature` is not a number from -1e8 to 1e8.
    """
    largest = 1e8  # energies go with its square
    allowed = f"a finite number from {-largest:g} to {largest:g}"
    natural_curvature = checked_number(
        "natural_curvature", natural_curvature, allowed, lambda k: abs(k) <= largest
    )
    parameters = {"natural_curvature": natural_curvature}
    outline = closed_curve(arc(1.0, np.pi))
    return Ring("circle", parameters, "x", "D2", outline, natural_curvature)


def ellipse(b_over_a: float, twist_axis: str = "x") -> Ring:
    """Return an elliptical ring, free of stress.

    Parameters
    ----------
    b_over_a : float
        Short semi-axis over the long one, in (0, 1], at least 1e-5; a is the long one, about
        either axis.
    twist_axis : str
        "x": grips at the ends of the short semi-axis; "y": of the long one.

    Raises
    ------
    ValueError
        If an argument is not allowed.

    Notes
    -----
    Paper, section 2.1.2 and Eq. (1).
    """
    b = _semi_minor(b_over_a)
    outline = Ellipse(*_oriented(b, twist_axis))
    return Ring("ellipse", {"b_over_a": b}, twist_axis, "D2", outline)


def rectangle(b_over_a: float, r_over_a: float, twist_axis: str = "x") -> Ring:
    """Return a rectangular ring with rounded corners, free of stress.

    Parameters
    ----------
    b_over_a : float
        Short half-side over the long one, in (0, 1], at least 1e-5; a is the long one, about
        either axis.
    r_over_a : float
        Radius of the fillets, in (0, b_over_a], at least 1e-5; b_over_a makes a stadium.
    twist_axis : str
        "x": grips at the ends of the short semi-axis; "y": of the long one.

    Raises
    ------
    ValueError
        If an argument is not allowed.

    Notes
    -----
    Paper, section 3.3 and figure 5a.
    """
    b = _semi_minor(b_over_a, SHARPEST)
    across, along = _oriented(b, twist_axis)
    r = _fillet(r_over_a, b, "b_over_a")
    side, fillet = straight(across - r), arc(r, np.pi / 2)
    outline = closed_curve(side, fillet, straight(2 * (along - r)), fillet, side)
    return Ring("rectangle", {"b_over_a": b, "r_over_a": r}, twist_axis, "D2", outline)


def triangle(vertex_angle: float, r_over_a: float) -> Ring:
    """Return a ring, an isosceles triangle with rounded corners, free of stress.

    The grips are at the base's midpoint, s = 0, and at the apex, s = L/2.

    Parameters
    ----------
    vertex_angle : float
        Angle at the apex, rad, in (0, pi).
    r_over_a : float
        Radius of the fillets, in (0, tan(pi/4 - vertex_angle/4)/2], at least 1e-5 and at most that
        of the inscribed circle. a is the base of the sharp triangle.

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
    allowed = "an angle in (0, 180) degrees"
    degrees = checked_number(
        "vertex_angle", vertex_angle, allowed, lambda x: 0 < round(x, 12) < 180
    )
    degrees = round(degrees, 12)
    apex = math.radians(degrees)
    inscribed = math.tan(math.pi / 4 - apex / 4) / 2
    r = _fillet(r_over_a, inscribed, "the inscribed circle's radius")
    base_turn, apex_turn = (np.pi + apex) / 2, np.pi - apex
    base_cut, apex_cut = r * math.tan(base_turn / 2), r * math.tan(apex_turn / 2)
    straights = 1 / 2 - base_cut, 1 / 2 / math.sin(apex / 2) - base_cut - apex_cut
    if r == inscribed:  # a circle; a straight that rounding leaves would bend one arm only
        straights = 0.0, 0.0
    outline = closed_curve(
        straight(straights[0]), arc(r, base_turn), straight(straights[1]), arc(r, apex_turn / 2)
    )
    return Ring("triangle", {"vertex_angle": degrees, "r_over_a": r}, "x", "C2", outline)


def profile(
    arc_length: ArrayLike | None = None,
    curvature: ArrayLike | None = None,
    *,
    points: ArrayLike | None = None,
    twist_axis: str | None = None,
    resized: bool = False,
) -> Ring:
    """Return a ring of the user's own shape, mirror symmetric about the twisting axis.

    Parameters
    ----------
    arc_length, curvature : array_like, shape (n,)
        Natural curvature along the complete ring, counter-clockwise, in units of the user's a and
        1/a; linear between the knots. An arc length given twice is a jump.
    points : array_like, shape (n, 2) or (n, 3), n >= 8
        Or, instead: points along a smooth closed curve in a plane, in order, from anywhere, in any
        unit of length. The curve is the periodic cubic spline through them; where they are rounded,
        a quintic smoothing spline as near to them as rounding is. a is half of the larger of the
        curve's extents along and across the twisting axis.
    twist_axis : str, optional
        The first grip is at the first knot or point where that is on a mirror axis, else on the
        shortest axis, at the end nearer to the first point. "x" is the shortest axis anyway (from
        grip to grip), "y" the longest.
    resized : bool
        Whether a is half of the larger extent for arc_length and curvature, too.

    Returns
    -------
    Ring
        Free of stress; its second half is exactly the mirror image of the first, and small gaps
        (below) are closed by the smoothest change of the curvature. Its `parameters` have
        "reference_length", a in the user's unit, where that is not 1; "curvature_error", how well
        the natural curvature is known: relative, of means over 64 equal cells, in mean squares;
        "resolution", the unit to which points are rounded, or sqrt(12) times their noise.

    Raises
    ------
    ValueError
        If the input is not of this form; if the distance from the mirror image is more than 2e-3 of
        half the extent, 1.5 units of rounding, and what half of the points leaves open; if the
        total turning is not 2 pi or the ends do not meet, within 1e-2 in rad and relative to the
        length.
    """
    if twist_axis is not None:
        _oriented(1.0, twist_axis)
    if points is None:
        make = profile_of_curvature if resized else profile_of_knots
        made = make(arc_length, curvature, twist_axis)
    elif arc_length is None and curvature is None:
        made = profile_of_points(points, twist_axis)
    else:
        raise ValueError("points must be given without arc_length and curvature, got both")
    return Ring("profile", knots_of(made.outline) | made.data, "x", made.symmetry, made.outline)


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
    data = {
        name: checked_number(name, entries.pop(name), "a finite number >= 0", lambda x: x >= 0)
        for name in DATA
        if shape == "profile" and name in entries
    }
    if set(entries) != expected:
        raise ValueError(
            f"ring {shape!r} must have entries {sorted(expected)}, got {sorted(entries)}"
        )
    ring = make(**entries)
    return replace(ring, parameters={**ring.parameters, **data}) if data else ring


def _semi_minor(b_over_a: object, least: float = SMALLEST) -> float:
    allowed = f"a number in (0, 1], at least {least:g}"
    return checked_number("b_over_a", b_over_a, allowed, lambda b: least <= b <= 1)


def _fillet(r_over_a: object, largest: float, which: str) -> float:
    # A largest fillet that the user computed may differ from ours in rounding, to either side.
    allowed = f"a number in (0, {largest:.12g}], at least {SHARPEST:g} and at most {which}"
    limit = largest * (1 + 1e-12)
    r = checked_number("r_over_a", r_over_a, allowed, lambda r: SHARPEST <= r <= limit)
    return r if r < largest * (1 - 1e-12) else largest


def _oriented(b: float, twist_axis: object) -> tuple[float, float]:
    """Return the half extents along E2 and E3 (the twisting axis) of a ring with a = 1."""
    if not isinstance(twist_axis, str) or twist_axis not in ("x", "y"):
        raise ValueError(f"twist_axis must be 'x' or 'y', got {shown(twist_axis)}")
    return (1.0, b) if twist_axis == "x" else (b, 1.0)
