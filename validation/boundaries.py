"""The boundaries between folding modes, as curves through a phase diagram.

Wherever neighbouring cases of a scan differ, something happens between them. Three things are
conditions that can be followed across the diagram (`conditions`, `tracing`): the folded state loses
its stability; the fold at which the path turns back reaches gamma = pi; two folds merge in a cusp.
A fourth is found by bisection of the label between the two cases: the path from the flat ring
changes partners with another one, and leads elsewhere ("exchange"). A curve is kept where the
labels on its two sides, solved for, differ by what it bounds.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from der.unfinished import NotConverged
from validation.cases import Case, Row, solve_case
from validation.collocation import Failure, Solution, collocation
from validation.conditions import KINDS, Lost, Value
from validation.families import Family
from validation.gauss import Array
from validation.sectors import sector
from validation.solving import solve_visits
from validation.tracing import At, corrected, trace

SEED = 1e-9  # tolerance of the path that a condition starts from: it fixes the mesh carried along
BESIDE = 1e-4  # of the diagram's side: where the labels beside a curve are asked for
BISECTED = 1e-6  # of the diagram's side
REACH = 3.0  # gaps of the scan within which a crossing must find its curve
EXCHANGE = "exchange"


@dataclass(frozen=True)
class BoundaryPoint:
    """A point of a boundary."""

    case: Case
    gamma: float  # rad, of the state in which it happens
    moment: float  # GJ/a
    error: float  # estimated, in h/t


@dataclass(frozen=True)
class Curve:
    """A boundary, in the order of the curve."""

    kind: str  # "stability", "foldability", "snap-back" or "exchange"
    twist_axis: str
    points: tuple[BoundaryPoint, ...]


def boundaries(family: Family, rows: Sequence[Row]) -> list[Curve]:
    """Boundaries of a diagram from the rows of its scan; of a cube, slice by slice.

    Slices of a cube are those of the scan's coarsest values of the second coordinate.
    """
    found: list[Curve] = []
    for sheet in family.sheets:
        for plane, placed in _slices(family, sheet, rows):
            found += _Diagram(family, sheet, plane).curves(placed)
    return found


Placed = dict[tuple[float, float], Row]  # rows by their place in the unit square


def _slices(
    family: Family, sheet: str, rows: Sequence[Row]
) -> Iterator[tuple[float | None, Placed]]:
    """Rows of a sheet by their place in the square; a cube's by its second coordinate."""
    slices: dict[float | None, Placed] = defaultdict(dict)
    for row in rows:
        unit = family.unit(row.case)
        if unit is None or not row.ok:
            continue
        if row.case.twist_axis != sheet and row.case.b_over_a != 1.0:
            continue
        if family.dimension == 2:
            slices[None][(unit[0], unit[1])] = row
        else:
            middle = round(unit[1] * family.coarse)
            if abs(unit[1] * family.coarse - middle) < 1e-6:
                slices[middle / family.coarse][(unit[0], unit[2])] = row
    yield from sorted(slices.items(), key=lambda item: (item[0] is not None, item[0] or 0.0))


class _Crossing(NamedTuple):
    """Two neighbouring cases of different modes."""

    kind: str
    a: tuple[float, float]
    b: tuple[float, float]
    first: Row
    second: Row

    @property
    def gap(self) -> float:
        return math.dist(self.a, self.b)

    @property
    def middle(self) -> Array:
        return 0.5 * (np.array(self.a) + np.array(self.b))


class _Diagram:
    """One unit square of a family: its cases, and what happens between them."""

    def __init__(self, family: Family, sheet: str, plane: float | None) -> None:
        self.family, self.sheet, self.plane = family, sheet, plane
        low, high = family.ranges[-1]
        self.height = high - low  # of h/t
        self.row = lru_cache(maxsize=None)(self._row)

    def case(self, u: Array | tuple[float, float]) -> Case:
        """The case at a place, also a little outside of the square."""
        x, y = (min(max(float(part), 0.0), 1.0) for part in u)
        unit = (x, y) if self.plane is None else (x, self.plane, y)
        return self.family.case(self.sheet, unit)

    def _row(self, u: tuple[float, float]) -> Row:
        return solve_case(self.case(u))

    def curves(self, placed: Placed) -> list[Curve]:
        """All boundaries between the cases of a scan."""
        traced: list[tuple[str, list[At[Value]]]] = []

        def explained(crossing: _Crossing) -> bool:
            return any(
                kind == crossing.kind and _passes(points, crossing) for kind, points in traced
            )

        crossings = _crossings(placed)
        for crossing in crossings:  # one after the other: a curve explains many
            points = [] if explained(crossing) else self._traced(crossing)
            if points:
                traced.append((crossing.kind, points))
        exchanges: list[BoundaryPoint] = []
        for crossing in crossings:
            if crossing.kind != "foldability" or explained(crossing):
                continue
            # so close to the boundary the fold that makes it, if one does, is at pi
            narrow = self._bisected(crossing)
            if narrow is None or explained(narrow):
                continue
            if points := self._traced(narrow):
                traced.append((narrow.kind, points))
            else:
                exchanges.append(self._exchange(narrow))
        curves = [
            Curve(kind, self.sheet, tuple(self._point(kind, at) for at in piece))
            for kind, points in traced
            for piece in self._kept(kind, points)
        ]
        return curves + [
            Curve(EXCHANGE, self.sheet, chain) for chain in self._chains(exchanges) if chain
        ]

    # --- curves of a condition ---

    def _traced(self, crossing: _Crossing) -> list[At[Value]]:
        """The curve between two cases, followed to its ends; none where no condition finds one."""
        for row, place in ((crossing.first, crossing.a), (crossing.second, crossing.b)):
            for seed in _seeds(crossing.kind, row):
                try:
                    near = corrected(
                        self._condition(crossing.kind),
                        np.array(place),
                        seed,
                        near=REACH * crossing.gap,
                    )
                    if _apart(near.u, crossing) < REACH * crossing.gap:
                        return trace(self._condition(crossing.kind), near.u, near.state)
                except Lost:
                    continue
        return []

    def _condition(self, kind: str):  # type: ignore[no-untyped-def]
        condition = KINDS[kind].condition

        def value(u: Array, seed: Value) -> tuple[float, Value]:
            try:
                found = condition(self.case(u).scene(), seed)
            except ValueError as wrong:
                raise Lost(str(wrong)) from wrong
            return found.value, found

        return value

    def _point(self, kind: str, at: At[Value]) -> BoundaryPoint:
        state = at.state.at
        return BoundaryPoint(self.case(at.u), state.gamma, state.moment, self._error(kind, at))

    def _error(self, kind: str, at: At[Value]) -> float:
        """Error of the place in h/t: what is left of the condition, and what halving changes."""
        value, state, system = at.state
        fine = system.on(state.mesh.halved, state)
        if isinstance(fine, Failure):
            return math.inf
        try:
            change = self._condition(kind)(at.u, Value(value, fine, system))[0] - value
        except Lost:
            return math.inf
        return self.height * (at.distance + abs(change) / float(np.linalg.norm(at.gradient)))

    def _kept(self, kind: str, points: list[At[Value]]) -> Iterator[list[At[Value]]]:
        """Pieces of a curve on whose two sides the modes differ by its kind."""
        piece: list[At[Value]] = []
        for before, at, after in zip(
            [points[0], *points[:-1]], points, [*points[1:], points[-1]], strict=True
        ):
            if self._bounds(kind, at.u, after.u - before.u):
                piece.append(at)
                continue
            if len(piece) > 1:
                yield piece
            piece = []
        if len(piece) > 1:
            yield piece

    def _bounds(self, kind: str, u: Array, way: Array) -> bool:
        """Whether the modes beside a curve differ by what it bounds."""
        normal = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-300)
        sides = []
        for sign in (1.0, -1.0):
            beside = np.clip(u + sign * BESIDE * normal, 0.0, 1.0)
            sides.append(self.row((float(beside[0]), float(beside[1]))))
        return kind in _differences(*sides)

    # --- what only the label tells ---

    def _bisected(self, crossing: _Crossing) -> _Crossing | None:
        """Two cases between the two, close together, one of them foldable; None if one fails."""
        a, b = np.array(crossing.a), np.array(crossing.b)
        first, second = crossing.first, crossing.second
        while np.linalg.norm(b - a) > BISECTED:
            middle = 0.5 * (a + b)
            row = solve_case(self.case(middle))
            if not row.ok:
                return None
            if row.foldable == first.foldable:
                a, first = middle, row
            else:
                b, second = middle, row
        one, other = ((float(u[0]), float(u[1])) for u in (a, b))
        return _Crossing(crossing.kind, one, other, first, second)

    def _exchange(self, narrow: _Crossing) -> BoundaryPoint:
        """The place where paths exchange, with the last fold before pi on the foldable side."""
        good, bad = narrow.first, narrow.second
        if not good.foldable:
            good, bad = bad, good
        error = self.height * narrow.gap
        moment = 0.0 if bad.moment is None else bad.moment
        return BoundaryPoint(
            self.case(narrow.middle), max(good.folds, default=math.pi), moment, error
        )

    def _chains(self, points: list[BoundaryPoint]) -> Iterator[tuple[BoundaryPoint, ...]]:
        """Points in the order of their curves: each the nearest to the one before."""
        left = [(np.array(self._place(p.case)), p) for p in points]
        left.sort(key=lambda item: tuple(item[0]))
        chain: list[tuple[Array, BoundaryPoint]] = []
        while left:
            if chain:
                apart = [float(np.linalg.norm(u - chain[-1][0])) for u, _ in left]
                k = int(np.argmin(apart))
                if apart[k] > 3.0 / self.family.coarse:
                    yield tuple(p for _, p in chain)
                    chain = []
                    continue
                chain.append(left.pop(k))
            else:
                chain.append(left.pop(0))
        yield tuple(p for _, p in chain)

    def _place(self, case: Case) -> tuple[float, float]:
        unit = self.family.unit(replace(case)) or (0.0,) * self.family.dimension
        return unit[0], unit[-1]


def _crossings(placed: Placed) -> list[_Crossing]:
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
                found += [_Crossing(kind, a, b, *ends) for kind in _differences(*ends)]
    return sorted(found, key=lambda crossing: crossing.gap)


def _differences(a: Row, b: Row) -> list[str]:
    """What must lie between two cases."""
    if not (a.ok and b.ok):
        return []
    if a.foldable != b.foldable:
        return ["foldability"]
    if not a.foldable:
        return []
    kinds = ["stability"] if a.stable != b.stable else []
    return kinds + (["snap-back"] if a.snapping != b.snapping else [])


def _passes(points: Iterable[At[Value]], crossing: _Crossing) -> bool:
    """Whether a curve passes between two neighbouring cases, or close by."""
    u = np.array([at.u for at in points])
    a, b = u[:-1], u[1:]
    way = b - a
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    along = np.clip(((crossing.middle - a) * way).sum(axis=1) / square, 0.0, 1.0)
    apart = np.linalg.norm(a + along[:, None] * way - crossing.middle, axis=1)
    return bool(apart.min(initial=math.inf) < max(0.75 * crossing.gap, 1e-4))


def _apart(u: Array, crossing: _Crossing) -> float:
    """Distance of a place from the line between two cases."""
    a, b = np.array(crossing.a), np.array(crossing.b)
    along = min(max(float((u - a) @ (b - a)) / crossing.gap**2, 0.0), 1.0)
    return float(np.linalg.norm(u - a - along * (b - a)))


def _seeds(kind: str, row: Row) -> Iterator[Value]:
    """Solutions of a case from which a condition may start, the likeliest first."""
    if not row.foldable:
        return
    scene = row.case.scene(save_at=())
    try:
        _, visits = solve_visits(scene, tolerance=SEED)
    except NotConverged:
        return
    system = collocation(sector(scene))
    folds = [visit.at for visit in visits if visit.kind == "fold"]
    chosen: list[Solution]
    if kind == "stability":
        chosen = [visits[-1].at]
    elif kind == "foldability":
        chosen = sorted(folds, key=lambda at: -at.gamma)[:1]
    else:
        pairs = sorted(pairwise(folds), key=lambda pair: abs(pair[0].gamma - pair[1].gamma))
        chosen = [at for pair in pairs for at in pair]
    for at in chosen:
        yield Value(0.0, at, system)
