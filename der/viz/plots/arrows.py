"""Arrows between points of a picture, with labels: bent so that they avoid points and each other.

All places are in pixels. An arrow is the parabola of matplotlib's `arc3`: its control point lies
`bend` times the chord off the chord's middle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from der.utils.checks import Array

# bends to try, small ones first
_BENDS = (0.1, -0.1, 0.16, -0.16, 0.22, -0.22, 0.29, -0.29, 0.37, -0.37, 0.46, -0.46, 0.6, -0.6)
_FINE = np.linspace(0.0, 1.0, 61)  # points of an arrow at which distances are measured
_SHARED = 3.0  # clearances around a common end within which arrows may be close
_PLACES = np.linspace(0.14, 0.86, 37)  # of a label along its arrow
_MIDDLE = 0.36  # best place of a label: near the start, because arrows share their ends
LETTERS = 6.8  # points: size of the letters of a label


def arc(start: Array, end: Array, bend: float, t: Array = _FINE) -> Array:
    """Points (k, 2) of an arrow at ``t`` (k,), from 0 at its start to 1."""
    chord = end - start
    control = 0.5 * (start + end) + bend * np.array([chord[1], -chord[0]])
    t = t[:, None]
    return (1.0 - t) ** 2 * start + 2.0 * t * (1.0 - t) * control + t**2 * end


def bends(
    points: Array, pairs: Sequence[tuple[int, int]], clear: float, box: tuple[Array, Array]
) -> list[float]:
    """The bend of each arrow, in the order of ``pairs``.

    Parameters
    ----------
    points : (n, 2), which arrows join, and which other arrows avoid.
    pairs : start and end of each arrow, as positions in ``points``.
    clear : least distance of an arrow from other arrows and from points that it does not join.
    box : lower left and upper right corner (2,) of the region of the arrows.
    """
    found = [0.0] * len(pairs)
    drawn: list[tuple[tuple[int, int], Array]] = []
    chords = [float(np.linalg.norm(points[b] - points[a])) for a, b in pairs]
    for k in sorted(range(len(pairs)), key=lambda k: (chords[k], pairs[k])):  # short ones first
        start, end = (points[i] for i in pairs[k])
        others = np.delete(points, pairs[k], axis=0)
        costs = []
        for bend in _BENDS:
            curve = arc(start, end, bend)
            hits = np.maximum(0.0, 1.0 - _nearest(others, curve) / clear).sum()
            outside = np.any((curve < box[0]) | (curve > box[1]), axis=1).mean()
            close = sum(_close(curve, pairs[k], one, points, clear) for one in drawn)
            costs.append(100.0 * hits + 60.0 * outside + 30.0 * close + 10.0 * abs(bend))
        found[k] = _BENDS[int(np.argmin(costs))]
        drawn.append((pairs[k], arc(start, end, found[k])))
    return found


def half_sizes(texts: Sequence[str], dpi: float) -> list[Array]:
    """Half the width and the height (2,) of each label, in pixels."""
    return [np.array([0.31 * len(text) + 0.2, 0.75]) * LETTERS * dpi / 72.0 for text in texts]


def label_places(
    points: Array, arcs: Sequence[Array], half: Sequence[Array], clear: float
) -> list[Array]:
    """The middle of each arrow's label: on the arrow, away from points, other arrows and labels.

    Parameters
    ----------
    arcs : (k, 2) each, an arrow from its start to its end.
    half : (2,) each, half the width and the height of its label.
    clear : half the size of a point.
    """
    found: list[Array] = []
    for k, curve in enumerate(arcs):
        others = [*arcs[:k], *arcs[k + 1 :]]
        t = np.linspace(0.0, 1.0, len(curve))
        spots = np.column_stack([np.interp(_PLACES, t, values) for values in curve.T])
        costs = []
        for place, at in zip(_PLACES, spots, strict=True):
            crossed = [np.any(_within(other, at, half[k] + 2.0)) for other in others]
            labels = [
                np.all(np.abs(other - at) < half[k] + size + 2.0)
                for other, size in zip(found, half, strict=False)
            ]
            hits = np.sum(_within(points, at, half[k] + clear)) + np.sum(labels)
            costs.append(2.0 * abs(place - _MIDDLE) + 20.0 * hits + 5.0 * np.sum(crossed))
        found.append(spots[int(np.argmin(costs))])
    return found


def _nearest(points: Array, curve: Array) -> Array:
    """Distance of each point from a curve."""
    return np.linalg.norm(points[:, None] - curve, axis=2).min(axis=1)


def _close(
    curve: Array,
    pair: tuple[int, int],
    drawn: tuple[tuple[int, int], Array],
    points: Array,
    clear: float,
) -> float:
    """Share of a curve that is close to another one, except near common ends."""
    apart = _nearest(curve, drawn[1]) < 0.5 * clear
    for i in set(pair) & set(drawn[0]):
        apart &= np.linalg.norm(curve - points[i], axis=1) > _SHARED * clear
    return float(apart.mean())


def _within(points: Array, at: Array, half: Array) -> NDArray[np.bool_]:
    return np.all(np.abs(points - at) < half, axis=1)
