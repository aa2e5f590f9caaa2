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
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, repeat
from typing import NamedTuple

import numpy as np

from der.unfinished import NotConverged
from validation.cases import Case, Row, solve_case
from validation.collocation import Failure, Solution, collocation
from validation.conditions import KINDS, Lost, Value, fresh
from validation.edges import BoundaryPoint, Curve
from validation.families import Family
from validation.gauss import Array
from validation.sectors import sector
from validation.solving import solve_visits
from validation.tracing import At, corrected, trace

SEED = 1e-9  # tolerance of the path that a condition starts from: it fixes the mesh carried along
BESIDE = 2e-3  # of the diagram's side: where the labels beside a curve are asked for
BISECTED = 1e-6  # of the diagram's side
SAME_CURVE = 1e-3  # of the diagram's side: above what chords leave of a curve
REACH = 3.0  # gaps of the scan within which a crossing must find its curve
EXCHANGE = "exchange"


Solve = Callable[[Sequence[Case]], Sequence[Row]]  # cases -> their rows, in the same order


def one_by_one(cases: Sequence[Case]) -> list[Row]:
    """The rows of cases, solved in this process."""
    return [solve_case(case) for case in cases]


def boundaries(
    family: Family,
    rows: Sequence[Row],
    *,
    solve: Solve = one_by_one,
    side_by_side: Callable[..., Iterable[list[Curve]]] | None = None,
) -> list[Curve]:
    """Boundaries of a diagram from the rows of its scan; of a cube, slice by slice.

    Slices of a cube are those of the scan's coarsest values of the second coordinate.

    Parameters
    ----------
    solve : how the cases beside curves and between neighbours are solved, many at a time; used
        where the slices are not shared out.
    side_by_side : such as the `map` of an executor, to share out slices where there are several.
    """
    slices = [
        (sheet, plane, placed)
        for sheet in family.sheets
        for plane, placed in _slices(family, sheet, rows)
    ]
    if side_by_side is not None and len(slices) > 1:
        found = side_by_side(_slice_curves, repeat(family), *zip(*slices, strict=True))
    else:
        found = (
            _Diagram(family, sheet, plane, solve).curves(placed) for sheet, plane, placed in slices
        )
    return [curve for curves in found for curve in curves]


def _slice_curves(family: Family, sheet: str, plane: float | None, placed: Placed) -> list[Curve]:
    """The boundaries of one slice."""
    return _Diagram(family, sheet, plane, one_by_one).curves(placed)


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

    def halved(self, place: tuple[float, float], row: Row) -> _Crossing:
        """The half in which one case is foldable and the other is not."""
        if row.foldable == self.first.foldable:
            return self._replace(a=place, first=row)
        return self._replace(b=place, second=row)


class _Diagram:
    """One unit square of a family: its cases, and what happens between them."""

    def __init__(self, family: Family, sheet: str, plane: float | None, solve: Solve) -> None:
        self.family, self.sheet, self.plane, self.solve = family, sheet, plane, solve
        low, high = family.ranges[-1]
        self.height = high - low  # of h/t

    def case(self, u: Array | tuple[float, float]) -> Case:
        """The case at a place, also a little outside of the square."""
        x, y = (min(max(float(part), 0.0), 1.0) for part in u)
        unit = (x, y) if self.plane is None else (x, self.plane, y)
        return self.family.case(self.sheet, unit)

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
            if points and not _known(crossing.kind, points, traced):
                traced.append((crossing.kind, points))
        exchanges: list[BoundaryPoint] = []
        left = [c for c in crossings if c.kind == "foldability" and not explained(c)]
        for narrow in self._bisected(left):
            # so close to the boundary the fold that makes it, if one does, is at pi
            if explained(narrow):
                continue
            points = self._traced(narrow)
            if points and not _known(narrow.kind, points, traced):
                traced.append((narrow.kind, points))
            elif not points:
                exchanges.append(self._exchange(narrow))
        curves = [
            Curve(kind, self.sheet, tuple(self._point(kind, at) for at in piece))
            for kind, piece in self._kept(traced)
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
                        return trace(
                            self._condition(crossing.kind), near.u, near.state, fresh=fresh
                        )
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

    def _kept(self, traced: list[tuple[str, list[At[Value]]]]) -> list[tuple[str, list[At[Value]]]]:
        """Pieces of curves on whose two sides the modes differ by their kind, each once."""
        beside = [
            self.case(place)
            for _, points in traced
            for k in range(len(points))
            for place in _beside(points, k)
        ]
        rows = iter(self.solve(beside))
        pieces: list[tuple[str, list[At[Value]]]] = []
        for kind, points in traced:
            piece: list[At[Value]] = []
            for at in [*points, None]:
                if at is not None and kind in _differences(next(rows), next(rows)):
                    piece.append(at)
                    continue
                if len(piece) > 1:
                    pieces.append((kind, piece))
                piece = []
        pieces.sort(key=lambda item: -len(item[1]))
        kept: list[tuple[str, list[At[Value]]]] = []
        for kind, piece in pieces:
            if not _known(kind, piece, kept):
                kept.append((kind, piece))
        return kept

    # --- what only the label tells ---

    def _bisected(self, crossings: list[_Crossing]) -> list[_Crossing]:
        """Two cases between each two, close together, one of them foldable; all in lockstep."""
        while crossings and max(crossing.gap for crossing in crossings) > BISECTED:
            middles = [crossing.middle for crossing in crossings]
            rows = self.solve([self.case(middle) for middle in middles])
            crossings = [
                crossing.halved((float(middle[0]), float(middle[1])), row)
                for crossing, middle, row in zip(crossings, middles, rows, strict=True)
                if row.ok
            ]
        return crossings

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


def _beside(points: list[At[Value]], k: int) -> list[Array]:
    """Two places, one on each side of a curve at its k-th point."""
    way = points[min(k + 1, len(points) - 1)].u - points[max(k - 1, 0)].u
    normal = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-300)
    return [np.clip(points[k].u + sign * BESIDE * normal, 0.0, 1.0) for sign in (1.0, -1.0)]


def _known(kind: str, points: list[At[Value]], traced: list[tuple[str, list[At[Value]]]]) -> bool:
    """Whether a curve has been followed before: its middle lies on one of the same kind."""
    middle = points[len(points) // 2].u
    return any(
        other == kind and _distance(middle, old) < SAME_CURVE for other, old in traced if old
    )


def _passes(points: Sequence[At[Value]], crossing: _Crossing) -> bool:
    """Whether a curve passes between two neighbouring cases, or close by."""
    return _distance(crossing.middle, points) < max(0.75 * crossing.gap, SAME_CURVE)


def _distance(place: Array, points: Sequence[At[Value]]) -> float:
    """Distance of a place from the polygon through the points of a curve."""
    u = np.array([at.u for at in points])
    a, way = u[:-1], np.diff(u, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    along = np.clip(((place - a) * way).sum(axis=1) / square, 0.0, 1.0)
    apart = np.linalg.norm(a + along[:, None] * way - place, axis=1)
    return float(apart.min(initial=math.inf))


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
