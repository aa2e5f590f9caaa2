"""Neighbouring cases of a scan that fold differently, and states from which conditions start."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from der.bvp.collocation import Collocation, Solution, collocation
from der.bvp.events import Point
from der.bvp.gauss import Array
from der.bvp.released import planar, stiffnesses
from der.bvp.sectors import sector
from der.bvp.solve import solve_with_points
from der.diagram.cases import Case, Row
from der.diagram.curves.conditions import Value, closeness
from der.errors import NotConverged

SEED = 1e-9  # tolerance of the path that a condition starts from: it fixes the mesh carried along
MOST = 3  # places on a path where another one may be near

Placed = dict[tuple[float, float], Row]  # rows by their place in the unit square


class Crossing(NamedTuple):
    """Two neighbouring cases of different modes."""

    kind: str
    a: tuple[float, float]
    b: tuple[float, float]
    first: Row
    second: Row

    @property
    def gap(self) -> float:
        """Their distance."""
        return math.dist(self.a, self.b)

    @property
    def middle(self) -> Array:
        """The place between them."""
        return 0.5 * (np.array(self.a) + np.array(self.b))

    def apart(self, u: Array) -> float:
        """Distance of a place from the line between the two."""
        a, b = np.array(self.a), np.array(self.b)
        along = min(max(float((u - a) @ (b - a)) / self.gap**2, 0.0), 1.0)
        return float(np.linalg.norm(u - a - along * (b - a)))

    def halved(self, place: tuple[float, float], row: Row) -> Crossing | None:
        """The half in which the two cases differ in the same way; None where there is none."""
        halves = (self._replace(b=place, second=row), self._replace(a=place, first=row))
        return next((h for h in halves if self.kind in differences(h.first, h.second)), None)


def crossings_of(placed: Placed) -> list[Crossing]:
    """Neighbours along either coordinate whose modes differ, the closest ones first."""
    found = []
    for axis in (1, 0):
        lines: dict[float, list[tuple[float, float]]] = defaultdict(list)
        for place in placed:
            lines[place[1 - axis]].append(place)
        for line in lines.values():
            line.sort(key=lambda place: place[axis])
            for a, b in pairwise(line):
                ends = placed[a], placed[b]
                found += [Crossing(kind, a, b, *ends) for kind in differences(*ends)]
    return sorted(found, key=lambda crossing: crossing.gap)


def differences(a: Row, b: Row) -> list[str]:
    """Kinds of boundaries that must lie between two cases."""
    if not (a.ok and b.ok):
        return []
    if a.foldable != b.foldable:
        return ["foldability"]
    if not a.foldable:
        return []
    kinds = ["stability"] if a.stable != b.stable else []
    if a.stable and b.stable and a.stays_folded != b.stays_folded:
        kinds.append("stays folded")
    return kinds + (["snap-back"] if a.snapping != b.snapping else [])


def seeds(kind: str, row: Row) -> Iterator[Value]:
    """Solutions of a case from which a condition may start, the likeliest first."""
    if not row.foldable and kind != "exchange":
        return
    system, points = _path(row.case)
    states = [point.solution for point in points]
    if not states:
        return
    folds = [point.solution for point in points if point.kind == "fold"]
    if kind == "stays folded":
        yield from _softest(system, states[-1])
        return
    if kind in ("stability", "infinite slope"):
        chosen = states[-1:]
    elif kind == "foldability":
        chosen = sorted(folds, key=lambda at: -at.gamma)[:1]
    elif kind == "snap-back":
        pairs = sorted(pairwise(folds), key=lambda pair: abs(pair[0].gamma - pair[1].gamma))
        chosen = [at for pair in pairs for at in pair]
    else:
        yield from _closest(system, states)
        return
    for at in chosen:
        yield Value(0.0, at, system)


@lru_cache(maxsize=16)  # each kind of boundary may start from it
def _path(case: Case) -> tuple[Collocation, list[Point]]:
    """The path of a case; without points where it cannot be followed."""
    scene = case.scene(save_at=())
    try:
        _, points = solve_with_points(scene, tolerance=SEED)
    except NotConverged:
        points = []
    return collocation(sector(scene)), points


def _softest(system: Collocation, folded: Solution) -> Iterator[Value]:
    """The folded state with each class of its motions when released, the softest first.

    The first class is left out: it has the turning of the grips, whose stiffness is the slope.
    """
    left = np.abs(stiffnesses(planar(system, folded)))[1:]
    for k in np.argsort(left):
        yield Value(0.0, folded, system, motion=1 + int(k))


def _closest(system: Collocation, states: list[Solution]) -> Iterator[Value]:
    """States of a path where another one may be near, the nearest first."""
    close = [closeness(system, at) for at in states]
    least = [
        k
        for k in range(1, len(states) - 1)
        if close[k][0] < close[k - 1][0] and close[k][0] <= close[k + 1][0]
    ]
    for k in sorted(least, key=lambda k: close[k][0])[:MOST]:
        yield Value(0.0, states[k], system, close[k][1])
