"""The user's own closed curve, from arrays of curvature or from points: checked, closed, mirrored.

What is typed or measured closes and is symmetric only roughly. Its mirror axis is found, the half
from one end of the axis to the other is kept (of a curve symmetric about both axes the quarter),
changed by the little that closes it, and mirrored.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from der.geometry.mirror import Axis, axis_at, fourier_series, mirror_axes
from der.geometry.outline import (
    LARGEST_TURN,
    Array,
    Bends,
    ComplexArray,
    PiecewiseLinear,
    reflected,
)
from der.geometry.points import joined, planar_points, unsteadiness
from der.utils.checks import checked_array, shown

CLOSED = 5e-14  # gap of a closed ring, rad and units of its length
GAP = 1e-2  # that is closed, rad and units of the length
TYPED = 1e-9  # rad; knots that are mirror symmetric to this are kept as they are
ASYMMETRY = 2e-3  # of half the extent
SAMPLES = 4096  # of a curve whose axes are sought
CELLS = 64  # over which a rod of the usual mesh sees the mean of the curvature
SIZES = 1e-3, 1e3  # of a ring's length in units of a
NOISY = 2  # times rounding: noise is more than that
COARSER = 8  # times the rounding of the fit that is compared: 94 % of 180 errors were then less
UNSURE = 0.05  # rad; by how much tangents of two fits may differ, to count against symmetry
EVEN = 3  # times the distance from one image: a second axis is as good
ROUNDING = 1e-12  # relative: a difference of curvatures that is none
SLIGHT = 1e-6  # relative: an error of the curvature that is not worth a word
SNAP = 1e-6  # of the length: knots nearer than this to an axis are on it
ARRAYS = "arc_length and curvature"

Sampled: TypeAlias = tuple[Array, ComplexArray]  # arc lengths, places there


@dataclass(frozen=True)
class Profile:
    """A closed curve, mirror symmetric about its second axis, and what its data are worth."""

    outline: PiecewiseLinear
    symmetry: str  # "C2" or "D2"
    data: dict[str, float]  # reference_length, curvature_error, resolution: see `shapes.profile`


@dataclass(frozen=True)
class _Given:
    """A curve as it was given, nearly closed, and how to speak of it."""

    curve: PiecewiseLinear
    shape: Sampled  # its places, as well as they are known
    unit: float  # of its lengths, in the user's
    allowed: float  # distance from its mirror image
    near: float  # of an axis to the first point, in units of the curve's length: it lies on it
    is_smooth: bool  # its curvature has no jumps: mirrored parts can be averaged
    what: str
    place: Callable[[float], str]  # where an arc length is, in units of the length, in words

    def asymmetric(self, axis: Axis) -> str:
        """Return how far the curve is from its mirror image about its best axis."""
        return (
            f"{self.what} must be mirror symmetric about an axis to {self.allowed * self.unit:.2g}"
            f", got a distance of {axis.deviation * self.unit:.3g} from the mirror image "
            f"{self.place(axis.where)}; the grips of a ring are on such an axis"
        )


def profile_of_knots(
    arc_length: ArrayLike | None, curvature: ArrayLike | None, twist_axis: str | None = None
) -> Profile:
    """Return the curve of this curvature along the arc, in its own unit of length.

    Parameters
    ----------
    arc_length, curvature : array_like, shape (n,)
        Along the complete curve; linear between the knots; an arc length given twice is a jump.
    twist_axis : str, optional
        "x" or "y": of several mirror axes the shortest or the longest, from one end on the curve
        to the other. Without it, the one through the first knot, if there is one, else "x".

    Raises
    ------
    ValueError
        If they are not such arrays, or the curve is not closed and mirror symmetric.
    """
    knots, start, end = _checked_bends(arc_length, curvature)
    if not SIZES[0] <= knots[-1] <= SIZES[1]:
        raise ValueError(
            f"arc_length must be in units of a and end between {SIZES[0]:g} and {SIZES[1]:g}, "
            f"got {knots[-1]:.6g}"
        )
    curve = _closed_curve((knots, start, end), ARRAYS)
    if twist_axis is None and _asymmetry(curve, curve.length / 2) <= TYPED:
        is_even = _asymmetry(curve, curve.length / 4) <= TYPED
        outline = _finished(*_first_half(curve, is_even))
        made = Profile(outline, "D2" if is_even else "C2", {})
        error = _difference(outline, curve)
    else:
        given = _typed(curve, 1.0)
        made = _mirrored(given, *_found(given, twist_axis), resized=False)
        error = made.data["curvature_error"]
    return replace(made, data={"curvature_error": error} if error > SLIGHT else {})


def profile_of_curvature(
    arc_length: ArrayLike | None, curvature: ArrayLike | None, twist_axis: str | None = None
) -> Profile:
    """Return the same curve in units of half its larger extent."""
    knots, start, end = _checked_bends(arc_length, curvature)
    unit = float(knots[-1]) / (2 * np.pi)
    curve = _closed_curve((knots / unit, start * unit, end * unit), ARRAYS)
    given = _typed(curve, unit)
    return _mirrored(given, *_found(given, twist_axis))


def profile_of_points(points: ArrayLike, twist_axis: str | None = None) -> Profile:
    """Return the smooth closed curve through points, in units of half its larger extent.

    Parameters
    ----------
    points : array_like, shape (n, 2) or (n, 3), n >= 8
        Along the curve, from anywhere on it, either way round.
    twist_axis : str, optional
        As in `profile_of_knots`.

    Raises
    ------
    ValueError
        If they are not such points, or the curve is not closed and mirror symmetric.

    Notes
    -----
    The error of the curvature is its change where every other point is left out and the others are
    known `COARSER` times less, or that from a part of the ring to its mirror image. Of 90 rounded
    and 90 noisy curves, with jumps of curvature and without, it was 0.95 to 9 times the true one
    (5 % and 95 % quantiles, median 2.3); of 30 exact ones never less.
    """
    z, grid = planar_points(points)
    unit = float(max(np.ptp(z.real), np.ptp(z.imag))) / 2
    w = (z - z[0]) / unit
    noise = float(f"{unit * unsteadiness(w):.3g}")
    grid = noise if noise > NOISY * grid else grid
    step = grid / unit
    u = np.cumsum(np.abs(np.diff(w)))

    def place(fraction: float) -> str:
        at = z[np.searchsorted(u, fraction * (u[-1] + abs(w[-1])))]
        return f"at ({at.real:.6g}, {at.imag:.6g})"

    bends, shape = joined(w, step)
    curve, other = _closed_curve(bends, "points"), None
    with suppress(ValueError):  # where half of the points have lost the curve
        other = _closed_curve(joined(w[::2], COARSER * step)[0], "points")
    near = min(abs(w[1]), abs(w[-1])) / 2 / curve.length
    unsure = UNSURE if other is None else min(UNSURE, _turned_by(curve, other))
    allowed = ASYMMETRY + 1.5 * step + unsure
    given = _Given(curve, (curve.knots, shape), unit, allowed, near, True, "points", place)
    start, is_even = _found(given, twist_axis)
    made, error = _mirrored(given, start, is_even), 1.0
    if other is not None:
        fewer = _mirrored(replace(given, curve=other), start, is_even)
        error = max(made.data["curvature_error"], _difference(made.outline, fewer.outline))
    if error > 1:
        raise ValueError(
            f"points must tell the ring's curvature, got points that leave it open by "
            f"{100 * error:.3g} %; more points, or more digits, are needed"
        )
    resolution = {"resolution": grid} if grid > 0 else {}
    return replace(made, data=made.data | {"curvature_error": error} | resolution)


def _typed(curve: PiecewiseLinear, unit: float) -> _Given:
    """Return a curve that was given by its curvature."""

    def place(fraction: float) -> str:
        return f"at arc length {fraction * curve.length * unit:.6g}"

    allowed = ASYMMETRY * curve.length / (2 * np.pi)
    s = np.linspace(0, curve.length, SAMPLES + 1)
    return _Given(curve, (s, curve.place(s)), unit, allowed, 1e-4, False, ARRAYS, place)


def _closed_curve(bends: Bends, what: str) -> PiecewiseLinear:
    """Return the curve of this curvature, which must turn once and whose ends must nearly meet."""
    curve = PiecewiseLinear.integrated(*bends)
    excess = curve.knot_angle[-1] - 2 * np.pi
    gap = abs(curve.knot_place[-1]) / curve.length
    if not max(abs(excess), gap) <= GAP:
        order = ", in order along the curve" if what == "points" else ""
        raise ValueError(
            f"{what} must go once round a closed ring{order}, to {GAP:g}: got a total turning of "
            f"2 pi {excess:+.3g} rad and a gap of {gap:.3g} of the length"
        )
    return curve


def _found(given: _Given, twist_axis: str | None) -> tuple[float, bool]:
    """Return where the ring begins, in units of its length, and whether it has D2 symmetry."""
    s = np.arange(SAMPLES) / SAMPLES
    place = given.curve.place(s * given.curve.length) - given.curve.knot_place[-1] * s
    series = fourier_series(place)
    axis = _chosen(mirror_axes(series), given, twist_axis)
    gap = abs(given.curve.knot_place[-1]) + abs(given.curve.knot_angle[-1] - 2 * np.pi)
    even = min(given.allowed, EVEN * (axis.deviation + gap) + 1e-6)
    return axis.start, axis_at(series, axis.start + 0.25).deviation <= even


def _chosen(axes: list[Axis], given: _Given, twist_axis: str | None) -> Axis:
    """Return the axis that is asked for, its first end the one nearer to the first point."""
    good = [axis for axis in axes if axis.deviation <= given.allowed]
    if not good:
        raise ValueError(given.asymmetric(axes[0]))
    if twist_axis == "y" and len(good) == 1:
        raise ValueError("twist_axis must be 'x' for a profile with one mirror axis, got 'y'")
    axis = min(good, key=lambda axis: axis.away)
    if twist_axis is not None or axis.away > given.near:
        spans = [axis.span for axis in good]
        wanted = max(spans) if twist_axis == "y" else min(spans)
        like = [a for a in good if abs(a.span - wanted) <= 2 * a.deviation + 1e-6 * wanted]
        axis = min(like, key=lambda axis: axis.away)
    return axis if axis.start <= 0.25 else replace(axis, start=axis.start + 0.5)


def _mirrored(given: _Given, start: float, is_even: bool, *, resized: bool = True) -> Profile:
    """Return the curve from `start` on, made exactly closed and symmetric."""
    turned = _turned(given.curve, start * given.curve.length)
    knots, before, after = (_averaged if given.is_smooth else _first_half)(turned, is_even)
    a = _half_extent(given, start) if resized else 1.0
    outline = _finished(knots / a, before * a, after * a)
    data = {"reference_length": a * given.unit, "curvature_error": _difference(outline, turned)}
    return Profile(outline, "D2" if is_even else "C2", data)


def _half_extent(given: _Given, start: float) -> float:
    """Return half of the larger of the extents along and across the axis with an end at `start`."""
    s, place = given.shape
    ends = np.interp(np.array([start, (start + 0.5) % 1]) * given.curve.length, s, place)
    along = place * np.conj(ends[1] - ends[0]) / abs(ends[1] - ends[0])
    return float(max(np.ptp(along.real), np.ptp(along.imag))) / 2


def _finished(knots: Array, start: Array, end: Array) -> PiecewiseLinear:
    """Return the closed ring whose first half has this curvature, or nearly."""
    return PiecewiseLinear.integrated(*_closed(knots, start, end)).mirrored()


def _turned(curve: PiecewiseLinear, begin: float) -> PiecewiseLinear:
    """Return the closed curve from `begin` on, snapped to a knot that is there but for rounding."""
    nearest = float(curve.knots[np.argmin(np.abs(curve.knots - begin))])
    begin = (nearest if abs(nearest - begin) <= SNAP * curve.length else begin) % curve.length
    if begin == 0:
        return curve
    p = int(np.searchsorted(curve.knots, begin, side="right")) - 1  # the piece that is cut
    at = curve.curvature(np.array([begin]))
    before, after = curve.curvature_start, curve.curvature_end
    knots = [curve.knots[p + 1 :], curve.knots[1 : p + 1] + curve.length]
    return PiecewiseLinear.integrated(
        np.concatenate([[0.0], *(part - begin for part in knots), [curve.length]]),
        np.concatenate([at, before[p + 1 :], before[:p], before[p : p + 1]]),
        np.concatenate([after[p:], after[:p], at]),
    )


def _first_half(curve: PiecewiseLinear, is_even: bool) -> Bends:
    """Return the curvature of the first half, of D2 symmetry its first half and the image."""
    if is_even:
        return reflected(*_cut(curve, curve.length / 4))
    return _cut(curve, curve.length / 2)


def _averaged(curve: PiecewiseLinear, is_even: bool) -> Bends:
    """Return the mean curvature of the halves, or quarters, at as many knots as they have."""
    length, parts = curve.length, 4 if is_even else 2
    folded = np.minimum(curve.knots, length - curve.knots)
    if is_even:
        folded = np.minimum(folded, length / 2 - folded)
    end, margin = length / parts, SNAP * length
    inner = np.sort(folded[(folded > margin) & (folded < end - margin)])[::parts]
    s = np.concatenate([[0.0], inner, [end]])
    images = [s, length - s, length / 2 - s, length / 2 + s][:parts]
    k = np.mean([curve.curvature(image) for image in images], axis=0)
    return reflected(s, k[:-1], k[1:]) if is_even else (s, k[:-1], k[1:])


def _turned_by(one: PiecewiseLinear, two: PiecewiseLinear) -> float:
    """Return by how much the tangents of two curves differ, but for a rotation, rad."""
    at = np.linspace(0, 1, SAMPLES)
    angles = [curve.angle(at * curve.length) for curve in (one, two)]
    return float(np.std(angles[1] - angles[0]))


def _difference(one: PiecewiseLinear, two: PiecewiseLinear) -> float:
    """Return the difference of the curvatures' means over cells, relative, in mean squares."""
    at = np.linspace(0, 1, CELLS + 1)
    turns = [np.diff(curve.angle(at * curve.length)) for curve in (one, two)]
    error = np.linalg.norm(turns[1] - turns[0]) / np.linalg.norm(turns[0])
    return float(f"{error:.2g}") if error > ROUNDING else 0.0


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
