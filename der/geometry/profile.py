"""The user's own closed curve, from arrays of curvature or from points: checked, closed, mirrored.

What is typed or measured closes and is symmetric only roughly. The half from the first to the
second end of the axis is kept (of a curve symmetric about both axes the quarter), changed by the
little that closes it, and mirrored.
"""

import numpy as np
from numpy.typing import ArrayLike

from der.geometry.outline import (
    LARGEST_TURN,
    Array,
    Bends,
    ComplexArray,
    PiecewiseLinear,
    reflected,
)
from der.utils.checks import checked_array, shown

CLOSED = 5e-14  # gap of a closed ring, rad and units of its length


def profile_of_knots(
    arc_length: ArrayLike | None, curvature: ArrayLike | None
) -> tuple[PiecewiseLinear, str]:
    """Return the curve of this curvature along the arc, and its symmetry, "C2" or "D2".

    Parameters
    ----------
    arc_length, curvature : array_like, shape (n,)
        Along the complete curve; linear between the knots; an arc length given twice is a jump.

    Raises
    ------
    ValueError
        If they are not such arrays, or the curve is not closed to 1e-6 (rad, and relative to its
        length) and mirror symmetric to 1e-9 rad.
    """
    full = PiecewiseLinear.integrated(*_checked_bends(arc_length, curvature))
    return _closed_and_mirrored(full, 1e-6, 1e-9, "arc_length and curvature")


def profile_of_points(points: ArrayLike) -> tuple[PiecewiseLinear, str]:
    """Return the periodic cubic spline through points, and its symmetry, "C2" or "D2".

    Parameters
    ----------
    points : array_like, shape (n, 2), n >= 8
        The first lies on the axis. The unit of length becomes half of the larger extent.

    Raises
    ------
    ValueError
        If they are not such points, or the curve is not closed to 1e-2 (rad, and relative to its
        length; interpolation leaves a gap) and mirror symmetric to 1e-3 rad.
    """
    full = PiecewiseLinear.integrated(*_spline_bends(_checked_points(points)))
    return _closed_and_mirrored(full, 1e-2, 1e-3, "points")


def _closed_and_mirrored(
    full: PiecewiseLinear, gap: float, asymmetry: float, what: str
) -> tuple[PiecewiseLinear, str]:
    """Return the curve made exactly closed and symmetric, and its symmetry."""
    _check_closed(full, gap, what)
    _check_mirror_symmetric(full, asymmetry, what)
    half, symmetry = _cut(full, full.length / 2), "C2"
    if _asymmetry(full, full.length / 4) <= asymmetry:
        half, symmetry = reflected(*_cut(full, full.length / 4)), "D2"
    return PiecewiseLinear.integrated(*_closed(*half)).mirrored(), symmetry


def _checked_bends(arc_length: ArrayLike | None, curvature: ArrayLike | None) -> Bends:
    """Return the user's arc lengths and curvatures as knots and their one-sided values."""
    s = checked_array("arc_length", arc_length, ("n",))
    k = checked_array("curvature", curvature, ("n",))
    if len(s) < 2 or len(k) != len(s):
        raise ValueError(
            f"arc_length and curvature must be of one length >= 2, got {len(s)} and {len(k)}"
        )
    if s[0] != 0 or s[-1] <= 0 or np.any(np.diff(s) < 0):
        raise ValueError(f"arc_length must start at 0 and not decrease, got {shown(s)}")
    turn = np.diff(s) * np.maximum(np.abs(k[:-1]), np.abs(k[1:]))
    if np.max(turn) > LARGEST_TURN:
        raise ValueError(
            f"arc_length must have knots so close that the curve turns by at most 4 pi between "
            f"them, got {np.max(turn):.3g} rad after arc length {s[np.argmax(turn)]:.6g}"
        )
    return s, k[:-1], k[1:]


def _checked_points(points: ArrayLike) -> ComplexArray:
    """Return the user's points as complex numbers, counter-clockwise and without repetition."""
    xy = checked_array("points", points, ("n", 2))
    z = xy[:, 0] + 1j * xy[:, 1]
    if len(z) > 1 and z[-1] == z[0]:
        z = z[:-1]
    if len(z) < 8 or np.any(z == np.roll(z, 1)):
        raise ValueError(f"points must be at least 8, each unlike its neighbour, got {len(z)}")
    is_clockwise = np.sum((np.conj(z) * np.roll(z, -1)).imag) < 0
    return np.roll(z[::-1], 1) if is_clockwise else z


def _spline_bends(z: ComplexArray) -> Bends:
    """Return the curvature of the periodic cubic spline through `z`, at eight knots an interval."""
    from scipy.interpolate import CubicSpline

    closed = np.append(z, z[0])
    chord_length = np.append(0.0, np.cumsum(np.abs(np.diff(closed))))
    curve = CubicSpline(chord_length, closed, bc_type="periodic")
    samples = np.arange(8 * len(z) + 1) / 8
    u = np.interp(samples, np.arange(len(closed)), chord_length)
    velocity, acceleration = curve(u, 1), curve(u, 2)
    k = (np.conj(velocity) * acceleration).imag / np.abs(velocity) ** 3
    node, weight = np.polynomial.legendre.leggauss(8)
    step = np.diff(u)
    speed = np.abs(curve(u[:-1, None] + np.multiply.outer(step, (1 + node) / 2), 1))
    s = np.append(0.0, np.cumsum(step / 2 * (speed @ weight)))
    in_axes = z * np.conj(velocity[0])  # the curve starts along the first axis
    a = max(np.ptp(in_axes.real), np.ptp(in_axes.imag)) / np.abs(velocity[0]) / 2
    return s / a, k[:-1] * a, k[1:] * a


def _check_closed(full: PiecewiseLinear, allowed: float, what: str) -> None:
    """Raise ValueError where the curve does not turn once, or its ends do not meet."""
    excess = full.knot_angle[-1] - 2 * np.pi
    gap = abs(full.knot_place[-1]) / full.length
    if max(abs(excess), gap) > allowed:
        raise ValueError(
            f"{what} must close the ring to {allowed:g}, got a total turning of 2 pi "
            f"{excess:+.3g} rad and a gap of {gap:.3g} of the length"
        )


def _check_mirror_symmetric(full: PiecewiseLinear, allowed: float, what: str) -> None:
    """Raise ValueError where the curve is not its own mirror image about the twisting axis."""
    difference = _asymmetry(full, full.length / 2)
    if difference > allowed:
        raise ValueError(
            f"{what} must be mirror symmetric about the twisting axis to {allowed:g} rad, "
            f"got tangents that differ by {difference:.3g} rad"
        )


def _asymmetry(full: PiecewiseLinear, centre: float) -> float:
    """Return by how much the curve up to 2 `centre` and its mirror image differ in angle.

    Between knots, and images of knots, the angle is quadratic: ends and midpoints tell all.
    """
    s = np.append(full.knots, 2 * centre - full.knots)
    s = np.unique(s[(s >= 0) & (s <= 2 * centre)])
    s = np.append(s, (s[1:] + s[:-1]) / 2)
    twice = full.angle(s) + full.angle(2 * centre - s)
    return float(np.max(np.abs(twice - 2 * full.angle(np.array(centre)))))


def _cut(full: PiecewiseLinear, end: float) -> Bends:
    """Return the curvature on [0, end]."""
    n = int(np.searchsorted(full.knots, end))  # pieces that begin before the end
    knots = np.append(full.knots[:n], end)
    curvature_end = full.curvature_end[:n].copy()
    if full.knots[n] > end:
        curvature_end[-1] = full.curvature(np.array(end))
    return knots, full.curvature_start[:n], curvature_end


def _closed(knots: Array, start: Array, end: Array) -> Bends:
    """Return the half ring with a smooth small change that makes it end on the axis, turned by pi.

    A constant mends the turning, a multiple of a cosine free of turning the place; a ring of D2
    symmetry needs the first only, and one that is closed already is left as it is.
    """
    length = knots[-1]
    excess = PiecewiseLinear.integrated(knots, start, end).knot_angle[-1] - np.pi
    if abs(excess) > CLOSED:
        start, end = start - excess / length, end - excess / length
    mode = np.cos(np.pi * knots / length)
    mode -= np.trapezoid(mode, knots) / length

    def bends(amount: float) -> Bends:
        return knots, start + amount * mode[:-1], end + amount * mode[1:]

    def offset(amount: float) -> float:
        return float(PiecewiseLinear.integrated(*bends(amount)).knot_place[-1].real / length)

    amount, probe = 0.0, 1e-4 / length
    slope = (offset(probe) - offset(0.0)) / probe
    for _ in range(50):
        if abs(offset(amount)) <= CLOSED:
            return bends(amount)
        amount -= offset(amount) / slope
    raise ValueError(f"the ring's gap of {offset(0.0):.3g} of its length could not be closed")


def knots_of(outline: PiecewiseLinear) -> dict[str, tuple[float, ...]]:
    """Return arc length and curvature at the knots, those of jumps twice."""
    s = np.repeat(outline.knots, 2)[1:-1]
    k = np.column_stack([outline.curvature_start, outline.curvature_end]).ravel()
    is_new = np.append(True, (np.diff(s) > 0) | (np.diff(k) != 0))
    return {"arc_length": tuple(s[is_new].tolist()), "curvature": tuple(k[is_new].tolist())}
