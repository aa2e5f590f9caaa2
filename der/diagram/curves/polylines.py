"""Polygons through the points of curves in a plane: distances, where two cross, loose ends."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from der.bvp.gauss import Array

MEETS = 1e-3  # of the square's side: above what chords leave of a curve
CLOSES = 1.5  # times its longest step: the ends of a closed curve are not farther from each other


class Meeting(NamedTuple):
    """Where two polygons cross: after which point of each, and in which place."""

    first: int
    second: int
    place: Array


def distance(place: Array, points: Array) -> float:
    """Distance of a place from the polygon through points, (n, dimension); inf without any."""
    return math.inf if not len(points) else nearest(place, points)[1]


def nearest(place: Array, points: Array) -> tuple[int, float]:
    """After which point the polygon comes nearest to a place, and how near."""
    a, way = points[:-1], np.diff(points, axis=0)
    if not len(way):
        return 0, float(np.linalg.norm(points[0] - place))
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    along = np.clip(((place - a) * way).sum(axis=1) / square, 0.0, 1.0)
    apart = np.linalg.norm(a + along[:, None] * way - place, axis=1)
    k = int(np.argmin(apart))
    return k, float(apart[k])


def meetings(one: Array, other: Array) -> Iterator[Meeting]:
    """Where two polygons of a plane, (n, 2) and (m, 2), cross."""
    a, u = one[:-1, None], np.diff(one, axis=0)[:, None]
    b, v = other[None, :-1], np.diff(other, axis=0)[None]
    across = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    away = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (away[..., 0] * v[..., 1] - away[..., 1] * v[..., 0]) / across
        t = (away[..., 0] * u[..., 1] - away[..., 1] * u[..., 0]) / across
    inside = (s >= 0.0) & (s < 1.0) & (t >= 0.0) & (t < 1.0)
    for i, j in np.argwhere(inside):
        yield Meeting(int(i), int(j), one[i] + s[i, j] * (one[i + 1] - one[i]))


def loose_ends(
    lines: Sequence[Array], corners: Sequence[tuple[bool, bool]]
) -> list[tuple[int, int]]:
    """Loose ends of lines, (n, 2) in the unit square: number of the line, and 0 or -1 for the end.

    Such an end is no corner, nor on an edge of the square, nor on another line. A closed line has
    no ends.

    Parameters
    ----------
    corners : whether the first and the last point of each line is one
    """
    found = []
    for n, line in enumerate(lines):
        steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
        apart = float(np.linalg.norm(line[-1] - line[0]))
        if len(steps) > 2 and apart < CLOSES * float(steps.max()):
            continue
        for known, k in zip(corners[n], (0, -1), strict=True):
            here = line[k]
            edge = bool(((here < MEETS) | (here > 1.0 - MEETS)).any())
            others = (distance(here, other) for m, other in enumerate(lines) if m != n)
            if not (known or edge or any(apart < MEETS for apart in others)):
                found.append((n, k))
    return found
