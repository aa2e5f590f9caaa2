"""Curve pruning: labels on the two sides of a curve, and the parts of it that are boundaries."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import groupby

import numpy as np

from der.bvp.gauss import Array
from der.diagram.curves.corners import CUSP, LIKE, Line, same
from der.diagram.curves.polylines import meetings, nearest

BESIDE = 2e-3  # of the diagram's side: where the labels beside a curve are asked for,
CLOSEST = 3e-5  # and beside one with another near it, at least: nearer, labels do not tell
CLOSEST_CUSP = 2e-4  # likewise: beside a cusp its two folds differ by the distance to the power 3/2
SAME_CURVE = 1e-3  # of the side: above what chords leave of a curve
CROWDED = 2e-4  # likewise: points nearer to each other than this have one pair of labels


def asked_beside(line: Line) -> list[int]:
    """Points beside which labels are solved for: no corners, and not all crowded ones."""
    asked: list[int] = []
    last: Array | None = None
    for k, (at, corner) in enumerate(zip(line.points, line.corners, strict=True)):
        if corner is not None:
            last = None
        elif last is None or float(np.linalg.norm(at.u - last)) >= CROWDED:
            asked.append(k)
            last = at.u
    return asked


def unlike(line: Line, holds: Sequence[bool | None], apart: float) -> list[int]:
    """After which points, farther than that from the next, a curve begins or ends to bound."""
    return [
        k
        for k in range(len(holds) - 1)
        if {holds[k], holds[k + 1]} == {True, False}
        and float(np.linalg.norm(line.points[k + 1].u - line.points[k].u)) > apart
    ]


def beside(line: Line, k: int, lines: Iterable[Line]) -> list[Array]:
    """Two places, one on each side of a curve at its k-th point, with no other curve between.

    None where another one is too near.
    """
    places = line.places
    way = places[min(k + 1, len(places) - 1)] - places[max(k - 1, 0)]
    normal = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-300)
    free = min((_away(line, k, other) for other in lines if other is not line), default=math.inf)
    free = min(free, *(_own(places, k, sign * BESIDE * normal) for sign in (1.0, -1.0)))
    reach = min(BESIDE, 0.3 * free)
    if reach < (CLOSEST_CUSP if line.kind == CUSP else CLOSEST):
        return []
    return [np.clip(places[k] + sign * reach * normal, 0.0, 1.0) for sign in (1.0, -1.0)]


def _away(line: Line, k: int, other: Line) -> float:
    """How far another curve is from a curve's k-th point; inf: it is the same, followed twice."""
    j, away = nearest(line.places[k], other.places)
    if other.kind == line.kind and away < SAME_CURVE:
        states = [at.state for at in other.points[j : j + 2]]
        if any(same(line.points[k].state, state, LIKE) for state in states):
            return math.inf
    return away


def _own(places: Array, k: int, way: Array) -> float:
    """How far from its k-th point a curve that turns back passes again, in a direction."""
    side = np.array([places[k], places[k] + way])
    again = [*meetings(side, places[: max(k - 1, 0)]), *meetings(side, places[k + 2 :])]
    return min((float(np.linalg.norm(m.place - places[k])) for m in again), default=math.inf)


def pieces_of(line: Line, holds: Sequence[bool | None]) -> list[Line]:
    """The parts of a curve that are boundaries, up to the corners at their ends.

    Parameters
    ----------
    holds : whether the modes on the two sides of a point differ; None: a corner, or so near to
        another curve that they do not tell
    """
    kept = [held is True for held in holds]
    for k in [k for k, held in enumerate(holds) if held]:
        for way in (1, -1):
            end = k + way
            while 0 <= end < len(holds) and holds[end] is None and line.corners[end] is None:
                end += way
            beyond = not 0 <= end < len(holds)
            if beyond or holds[end] is not False:
                inside = range(k, end, way) if beyond else range(k, end + way, way)
                for j in inside:
                    kept[j] = True
    pieces = []
    for held, places in groupby(range(len(kept)), key=kept.__getitem__):
        start, *others = places
        if held and others:
            piece = slice(start, others[-1] + 1)
            pieces.append(Line(line.kind, line.points[piece], line.corners[piece]))
    return pieces
