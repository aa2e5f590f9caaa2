"""Slices of a phase diagram: unit squares in which boundaries are located, and their cases."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from der.bvp.gauss import Array
from der.diagram.cases import Case, Row
from der.diagram.curves.asking import Search, rows_of
from der.diagram.curves.label_changes import Crossing, Placed
from der.diagram.families import Family
from der.diagram.scanned_boundaries import BoundaryPoint, Corner, Curve


class Boundaries(NamedTuple):
    """The boundaries of a diagram and their corners."""

    curves: list[Curve]
    corners: list[Corner]


def joined(parts: Iterable[Boundaries]) -> Boundaries:
    """The boundaries of all slices."""
    found = Boundaries([], [])
    for part in parts:
        found.curves.extend(part.curves)
        found.corners.extend(part.corners)
    return found


class Slice(NamedTuple):
    """A unit square of a family, and the scanned cases there."""

    family: Family
    sheet: str
    plane: float | None  # second coordinate, of a cube
    placed: Placed

    @property
    def bare(self) -> Slice:
        """The square without its cases."""
        return self._replace(placed={})

    @property
    def height(self) -> float:
        """Of h/t."""
        low, high = self.family.ranges["h_over_t"]
        return high - low

    def case(self, u: Array | tuple[float, float]) -> Case:
        """The case at a place, also a little outside of the square."""
        x, y = (min(max(float(part), 0.0), 1.0) for part in u)
        unit = (x, y) if self.plane is None else (x, self.plane, y)
        return self.family.case(self.sheet, unit)

    def has(self, case: Case) -> bool:
        """Whether a case lies in it."""
        unit = self.family.unit(case)
        if unit is None or (case.twist_axis != self.sheet and case.b_over_a != 1.0):
            return False
        return self.plane is None or abs(unit[1] - self.plane) < 1e-9


def slices(family: Family, rows: Sequence[Row]) -> list[Slice]:
    """The squares of a diagram; of a cube at the scan's coarsest values of the second coordinate.

    Each with the rows in it, by their place.
    """
    found: dict[tuple[str, float | None], Placed] = defaultdict(dict)
    for row in rows:
        unit = family.unit(row.case)
        if unit is None or not row.ok:
            continue
        plane = None
        if family.dimension == 3:
            middle = round(unit[1] * family.coarse)
            if abs(unit[1] * family.coarse - middle) > 1e-6:
                continue
            plane = middle / family.coarse
        for sheet in family.sheets:
            if row.case.twist_axis == sheet or row.case.b_over_a == 1.0:
                found[sheet, plane][unit[0], unit[-1]] = row
    return [
        Slice(family, sheet, plane, placed)
        for (sheet, plane), placed in sorted(
            found.items(), key=lambda item: (family.sheets.index(item[0][0]), item[0][1] or 0.0)
        )
    ]


def bisected(part: Slice, crossings: list[Crossing], width: float) -> Search[list[Crossing]]:
    """Closer pairs of cases that differ in the same way, all bisected at the same time."""
    while crossings and max(crossing.gap for crossing in crossings) > width:
        middles = [crossing.middle for crossing in crossings]
        rows = yield from rows_of([part.case(middle) for middle in middles])
        halves = [
            crossing.halved((float(middle[0]), float(middle[1])), row)
            for crossing, middle, row in zip(crossings, middles, rows, strict=True)
        ]
        crossings = [half for half in halves if half is not None]
    return crossings


def between(part: Slice, narrow: Crossing) -> BoundaryPoint:
    """The place between two cases, with the last fold of the one that has any."""
    row = narrow.first if narrow.first.folds else narrow.second
    gamma = max(row.folds, default=math.nan)
    return BoundaryPoint(part.case(narrow.middle), gamma, math.nan, part.height * narrow.gap)


def chains(family: Family, points: list[BoundaryPoint]) -> Iterator[tuple[BoundaryPoint, ...]]:
    """Points in the order of their curves: each the nearest to the one before."""
    left = [(np.array(_place(family, p.case)), p) for p in points]
    left.sort(key=lambda item: tuple(item[0]))
    chain: list[tuple[Array, BoundaryPoint]] = []
    while left:
        apart = [float(np.linalg.norm(u - chain[-1][0])) if chain else 0.0 for u, _ in left]
        k = int(np.argmin(apart))
        if apart[k] > 3.0 / family.coarse:
            yield tuple(p for _, p in chain)
            chain = []
        else:
            chain.append(left.pop(k))
    if chain:
        yield tuple(p for _, p in chain)


def _place(family: Family, case: Case) -> tuple[float, float]:
    unit = family.unit(case) or (0.0,) * family.dimension
    return unit[0], unit[-1]
