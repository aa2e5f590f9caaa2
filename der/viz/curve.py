"""The drawn curve of a path: smooth through all states, in stretches of one stability."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from der.records.path import Path
from der.utils.checks import Array

SNAP = "snap"  # a stretch between two equilibria without equilibria between them


def stretches(path: Path, height: Array) -> Iterator[tuple[bool | str | None, Array]]:
    """Yield the smooth curve (gamma/pi, height) in stretches of one stability."""
    if len(path) == 1:
        return
    stability = sides(path)
    curve = smooth(path, height)
    ends = [k for k in range(1, len(stability)) if stability[k] != stability[k - 1]]
    per = (len(curve) - 1) // len(stability)
    for first, last in zip([0, *ends], [*ends, len(stability)], strict=True):
        yield stability[first], curve[first * per : last * per + 1]


def smooth(path: Path, height: Array, per: int = 16) -> Array:
    """Return `per` points an interval on a smooth curve (gamma/pi, height) through all states.

    The curve is the natural cubic spline over the chord length along (gamma, M), which can turn
    back at folds. On circles it is within 0.3% of the range of the true path; monotone cubics are
    within 0.4%. Snaps are straight lines. The moment of a ring that snaps under a dead moment stays
    constant until the ring meets a stop, and then takes the ring's own value.
    """
    values = np.column_stack([path.gamma / math.pi, height])
    place = np.arange(per * (len(path) - 1) + 1) / per
    curve = np.column_stack([np.interp(place, np.arange(len(path)), v) for v in values.T])
    chord = chord_length(path)
    for first, last in pieces(path):
        piece = slice(first, last + 1)
        inside = slice(first * per, last * per + 1)
        curve[inside] = spline(chord[piece], values[piece], place[inside] - first)
    if path.numerics.get("control") == "moment" and np.array_equal(height, path.moment):
        for k in _snaps(path):
            inside = slice((k - 1) * per, k * per)
            curve[inside, 0] = np.linspace(values[k - 1, 0], values[k, 0], per)
            curve[inside, 1] = height[k - 1]
    return curve


def sides(path: Path) -> list[bool | str | None]:
    """Whether each interval between neighbouring states is stable; None where nothing is known.

    An interval over which the ring snaps is SNAP. Special points have no index: the intervals
    beside them take the stability of their other ends, so the style changes there.
    """
    known: list[bool | str | None] = [None if i is None else i == 0 for i in path.index.tolist()]
    if len(known) == 1:
        return known
    found = [a if a is not None else b for a, b in pairwise(known)]
    for order in (range(1, len(found)), range(len(found) - 2, -1, -1)):
        for k in order:
            if found[k] is None:
                found[k] = found[k - order.step]
    for k in _snaps(path):
        found[k - 1] = SNAP
    return found


def _snaps(path: Path) -> list[int]:
    """Positions of the end states of snaps."""
    return [point.position for point in path.points if point.kind == "snap" and point.position]


def pieces(path: Path) -> list[tuple[int, int]]:
    """First and last states of the smooth pieces, between snaps and reversals of gamma."""
    landed = _snaps(path)
    steps = np.diff(np.column_stack([path.gamma, path.moment]), axis=0)
    size = np.linalg.norm(steps, axis=1)
    turns = np.sum(steps[:-1] * steps[1:], axis=1) < -0.9 * size[:-1] * size[1:]
    turned = (1 + np.flatnonzero(turns)).tolist()
    starts = sorted({0, *landed, *turned})
    lasts = [k - 1 if k in landed else k for k in starts[1:]] + [len(path) - 1]
    return list(zip(starts, lasts, strict=True))


def spline(chord: Array, values: Array, place: Array) -> Array:
    """Natural cubic spline of rows (n, m) over the chord, at places counted in rows."""
    from scipy.interpolate import CubicSpline

    is_new = np.append(True, np.diff(chord) > 1e-5)  # equal neighbours give no slope
    if np.count_nonzero(is_new) == 1:
        return np.repeat(values[:1], len(place), axis=0)
    at = np.interp(place, np.arange(len(chord)), chord)
    return CubicSpline(chord[is_new], values[is_new], bc_type="natural")(at)


def chord_length(path: Path) -> Array:
    """Return the chord length along (gamma, M), each over its range, up to every state."""
    spans = [float(np.ptp(v)) or 1.0 for v in (path.gamma, path.moment)]
    return arc_length(np.column_stack([path.gamma, path.moment]) / spans)


def arc_length(points: Array) -> Array:
    """Length (n,) of a polygon through points (n, ...) up to each of them."""
    steps = np.diff(points.reshape(len(points), -1), axis=0)
    return np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))


def evenly(length: Array, n: int, keep: int | None = None) -> list[int]:
    """Positions of ``n`` points spread evenly over a length (m,); ``keep`` is one of them."""
    even = np.linspace(0.0, length[-1], n)
    chosen = np.argmin(np.abs(length - even[:, None]), axis=1)
    if keep is not None and keep not in chosen:
        chosen[1 + np.argmin(np.abs(length[chosen[1:-1]] - length[keep]))] = keep
    return sorted(set(chosen.tolist()))
