"""The boundaries between folding modes, as curves through a phase diagram.

Wherever neighbouring cases of a scan differ, something happens between them. Five things are
conditions that can be followed across the diagram (`conditions`, `tracing`): the folded state loses
its stability; the fold at which the path turns back reaches gamma = pi; it merges there with its
mirror image, in the folded state, whose slope is infinite then; two folds merge in a cusp; the path
from the flat ring changes partners with another one ("exchange"): it leads elsewhere then, or
leaves folds behind on a closed one. Where curves meet, the corner is solved for (`corners`). A
curve is kept from corner to corner where the labels on its two sides, solved for, differ by what it
bounds. What no condition explains is found by bisection of the label between two cases.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from validation.cases import Case, Row, solve_case
from validation.conditions import KINDS, Lost, Value, fresh, on
from validation.corners import FOLD, Line, Met, mark_corners
from validation.crossings import Crossing, Placed, crossings_of, differences, seeds
from validation.edges import BoundaryPoint, Corner, Curve
from validation.families import Family
from validation.gauss import Array
from validation.polygons import distance
from validation.tracing import At, Function, corrected, trace

BESIDE = 2e-3  # of the diagram's side: where the labels beside a curve are asked for,
CLOSEST = 3e-5  # and beside one with another near it, at least: nearer, labels do not tell
NARROW = 1e-3  # of the side: cases so near to each other have the state that a condition needs
BISECTED = 1e-6  # of the diagram's side
SAME_CURVE = 1e-3  # of the diagram's side: above what chords leave of a curve
REACH = 3.0  # gaps of the scan within which a crossing must find its curve
EXCHANGE = "exchange"
INFINITE = "infinite slope"


Solve = Callable[[Sequence[Case]], Sequence[Row]]  # cases -> their rows, in the same order


def one_by_one(cases: Sequence[Case]) -> list[Row]:
    """The rows of cases, solved in this process."""
    return [solve_case(case) for case in cases]


class Boundaries(NamedTuple):
    """The boundaries of a diagram and their corners."""

    curves: list[Curve]
    corners: list[Corner]


def boundaries(family: Family, rows: Sequence[Row], *, solve: Solve = one_by_one) -> Boundaries:
    """Boundaries of a diagram from the rows of its scan; of a cube, slice by slice.

    Parameters
    ----------
    solve : how the cases beside curves and between neighbours are solved, many at a time
    """
    parts = [_Diagram(part, solve).boundaries() for part in slices(family, rows)]
    return joined(parts)


def joined(parts: Iterable[Boundaries]) -> Boundaries:
    """The boundaries of all slices."""
    found = Boundaries([], [])
    for part in parts:
        found.curves.extend(part.curves)
        found.corners.extend(part.corners)
    return found


class Slice(NamedTuple):
    """A unit square of a family, and what a scan has found there."""

    family: Family
    sheet: str
    plane: float | None  # second coordinate, of a cube
    placed: Placed

    def has(self, case: Case) -> bool:
        """Whether a case lies in it."""
        unit = self.family.unit(case)
        if unit is None or (case.twist_axis != self.sheet and case.b_over_a != 1.0):
            return False
        return self.plane is None or abs(unit[1] - self.plane) < 1e-9


def slice_boundaries(
    part: Slice, known: Sequence[Row], solve: Callable[[Case], Row]
) -> tuple[Boundaries, list[Row]]:
    """The boundaries of one slice, and the rows of the cases solved for it besides those known."""
    rows = {row.case: row for row in known}
    new: list[Row] = []

    def all_of(cases: Sequence[Case]) -> list[Row]:
        for case in dict.fromkeys(cases):
            if case not in rows:
                rows[case] = solve(case)
                new.append(rows[case])
        return [rows[case] for case in cases]

    return _Diagram(part, all_of).boundaries(), new


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


class _Diagram:
    """One unit square of a family: its cases, and what happens between them."""

    def __init__(self, part: Slice, solve: Solve) -> None:
        self.family, self.sheet, self.plane, self.placed = part
        self.solve = solve
        low, high = self.family.ranges[-1]
        self.height = high - low  # of h/t

    def case(self, u: Array | tuple[float, float]) -> Case:
        """The case at a place, also a little outside of the square."""
        x, y = (min(max(float(part), 0.0), 1.0) for part in u)
        unit = (x, y) if self.plane is None else (x, self.plane, y)
        return self.family.case(self.sheet, unit)

    def boundaries(self) -> Boundaries:
        """All boundaries between the cases of a scan."""
        lines: list[Line] = []
        crossings = crossings_of(self.placed)
        for crossing in crossings:  # one after the other: a curve explains many
            if not _explained(crossing, lines):
                self._trace(crossing, lines)
        kept, met = self._kept(lines)
        left = [crossing for crossing in crossings if not _explained(crossing, kept)]
        found = len(lines)
        left = self._bisected(left, NARROW)
        for narrow in left:
            # so close to the boundary the state that makes it is almost there
            if not _explained(narrow, kept):
                self._trace(narrow, lines)
        if len(lines) > found:
            kept, met = self._kept(lines)
            left = [narrow for narrow in left if not _explained(narrow, kept)]
        curves = [self._curve(line) for line in kept]
        points: dict[str, list[BoundaryPoint]] = defaultdict(list)
        for narrow in self._bisected(left, BISECTED):
            points[narrow.kind].append(self._between(narrow))
        curves += [
            Curve(f"{kind} (bisected)", self.sheet, chain)
            for kind, some in points.items()
            for chain in self._chains(some)
        ]
        return Boundaries(curves, [self._corner(one) for one in met])

    # --- curves of a condition ---

    def _trace(self, crossing: Crossing, lines: list[Line]) -> None:
        """Add the curves that may bound what differs between two cases, until one does."""
        for kind in _bounding(crossing.kind):
            points = self._traced(kind, crossing)
            if points and not _known(kind, points, lines):
                lines.append(Line(kind, points, [None] * len(points)))
            if points and _explained(crossing, lines):
                return

    def _traced(self, kind: str, crossing: Crossing) -> list[At[Value]]:
        """The curve between two cases, followed to its ends; none where no condition finds one."""
        condition = self._condition(kind)
        for row, place in ((crossing.first, crossing.a), (crossing.second, crossing.b)):
            for seed in seeds(kind, row):
                try:
                    near = corrected(condition, np.array(place), seed, near=REACH * crossing.gap)
                    if crossing.apart(near.u) < REACH * crossing.gap:
                        return trace(condition, near.u, near.state, fresh=fresh)
                except Lost:
                    continue
        return []

    def _condition(self, kind: str) -> Function[Value]:
        condition = KINDS[kind].condition

        def value(u: Array, seed: Value) -> tuple[float, Value]:
            try:
                found = condition(self.case(u).scene(), seed)
            except ValueError as wrong:
                raise Lost(str(wrong)) from wrong
            return found.value, found

        return value

    def _curve(self, line: Line) -> Curve:
        points = [
            self._point(at, self._error(line.kind, at) if met is None else self.height * met.error)
            for at, met in zip(line.points, line.corners, strict=True)
        ]
        return Curve(line.kind, self.sheet, tuple(points))

    def _corner(self, met: Met) -> Corner:
        point = self._point(met.first, self.height * met.error)
        return Corner(met.kinds, self.sheet, point)

    def _point(self, at: At[Value], error: float) -> BoundaryPoint:
        state = at.state.at
        return BoundaryPoint(self.case(at.u), state.gamma, state.moment, error)

    def _error(self, kind: str, at: At[Value]) -> float:
        """Error of the place in h/t: what is left of the condition, and what halving changes."""
        state = at.state
        try:
            fine = on(state.at.mesh.halved, state)
            change = self._condition(kind)(at.u, fine)[0] - state.value
        except Lost:
            return math.inf
        return self.height * (at.distance + abs(change) / float(np.linalg.norm(at.gradient)))

    def _kept(self, lines: list[Line]) -> tuple[list[Line], list[Met]]:
        """Pieces of curves on whose two sides the modes differ by their kind, and their corners."""
        lines = [Line(line.kind, list(line.points), [None] * len(line.points)) for line in lines]
        met = mark_corners(lines, self._condition)
        sides = [
            [_beside(line, k, lines) if c is None else [] for k, c in enumerate(line.corners)]
            for line in lines
        ]
        beside = [self.case(u) for line in sides for places in line for u in places]
        rows = iter(self.solve(beside))
        pieces: list[Line] = []
        for line, own in zip(lines, sides, strict=True):
            holds = [_bounds(line.kind, next(rows), next(rows)) if u else None for u in own]
            pieces += _pieces(line, holds)
        pieces.sort(key=lambda piece: -len(piece.points))
        kept: list[Line] = []
        for piece in pieces:
            if not _known(piece.kind, piece.points, kept):
                kept.append(piece)
        there = {(corner, piece.kind) for piece in kept for corner in piece.corners}
        met = [replace(m, kinds=tuple(k for k in m.kinds if (m, k) in there)) for m in met]
        return kept, [one for one in met if len(one.kinds) > 1]

    # --- what only the label tells ---

    def _bisected(self, crossings: list[Crossing], width: float) -> list[Crossing]:
        """Two cases between each two, so close together, that differ likewise; in lockstep."""
        while crossings and max(crossing.gap for crossing in crossings) > width:
            middles = [crossing.middle for crossing in crossings]
            rows = self.solve([self.case(middle) for middle in middles])
            halves = [
                crossing.halved((float(middle[0]), float(middle[1])), row)
                for crossing, middle, row in zip(crossings, middles, rows, strict=True)
            ]
            crossings = [half for half in halves if half is not None]
        return crossings

    def _between(self, narrow: Crossing) -> BoundaryPoint:
        """The place between two cases, with the last fold of the one that has any."""
        row = narrow.first if narrow.first.folds else narrow.second
        gamma = max(row.folds, default=math.nan)
        error = self.height * narrow.gap
        return BoundaryPoint(self.case(narrow.middle), gamma, math.nan, error)

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
        if chain:
            yield tuple(p for _, p in chain)

    def _place(self, case: Case) -> tuple[float, float]:
        unit = self.family.unit(case) or (0.0,) * self.family.dimension
        return unit[0], unit[-1]


def _explained(crossing: Crossing, lines: Iterable[Line]) -> bool:
    """Whether a curve that bounds what differs passes between two cases, or close by."""
    kinds = _bounding(crossing.kind)
    reach = max(0.75 * crossing.gap, SAME_CURVE)
    return any(
        line.kind in kinds and distance(crossing.middle, line.places) < reach for line in lines
    )


def _known(kind: str, points: Sequence[At[Value]], lines: Iterable[Line]) -> bool:
    """Whether a curve has been followed before: its middle lies on one of the same kind."""
    middle = points[len(points) // 2].u
    return any(line.kind == kind and distance(middle, line.places) < SAME_CURVE for line in lines)


def _beside(line: Line, k: int, lines: Iterable[Line]) -> list[Array]:
    """Two places, one on each side of a curve at its k-th point, with no other curve between.

    None where another one is too near.
    """
    places = line.places
    way = places[min(k + 1, len(places) - 1)] - places[max(k - 1, 0)]
    normal = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-300)
    free = min(
        (distance(places[k], other.places) for other in lines if other.kind != line.kind),
        default=math.inf,
    )
    reach = min(BESIDE, 0.3 * free)
    if reach < CLOSEST:
        return []
    return [np.clip(places[k] + sign * reach * normal, 0.0, 1.0) for sign in (1.0, -1.0)]


def _bounds(kind: str, one: Row, other: Row) -> bool:
    """Whether two cases differ by what a curve of this kind bounds."""
    return any(kind in _bounding(what) for what in differences(one, other))


def _bounding(what: str) -> tuple[str, ...]:
    """Kinds of boundaries at which this changes, the likeliest first."""
    return (FOLD, INFINITE, EXCHANGE) if what == FOLD else (what, EXCHANGE)


def _pieces(line: Line, holds: Sequence[bool | None]) -> list[Line]:
    """A curve's pieces that bound something, to the corners at their ends.

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
    start = None
    for k, held in enumerate([*kept, False]):
        if held and start is None:
            start = k
        elif not held and start is not None:
            if k - start > 1:
                pieces.append(Line(line.kind, line.points[start:k], line.corners[start:k]))
            start = None
    return pieces
