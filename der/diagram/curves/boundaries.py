"""The boundaries between folding modes of one slice of a phase diagram.

Where neighbouring cases of a scan differ, a boundary lies between them. Six kinds are curves on
which a condition holds (`conditions`), and are traced across the slice (`tracing`):

    stability        the folded state loses its stability at fixed moment
    stays folded     the folded state loses its stability when released
    foldability      the fold at which the path turns back reaches gamma = pi
    infinite slope   that fold merges with its mirror image in the folded state
    snap-back        two folds merge in a cusp
    exchange         the path from the flat ring exchanges branches with another one: it then leads
                     elsewhere, or leaves folds behind on a closed one

Where curves meet, the corner is solved for (`corners`). A curve is kept from corner to corner where
the labels on its two sides, solved for, differ by what it bounds (`pruning`). Where no condition
explains a difference, the boundary is found by bisection of the label between two cases.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from der.bvp.gauss import Array
from der.diagram.cases import Case, Row, solve_case
from der.diagram.curves.conditions import KINDS, NotFound, Value, fresh, numbers, on
from der.diagram.curves.corners import FOLD, Line, Met, mark_corners
from der.diagram.curves.infinite_slope import across, infinite_slope_near, is_half
from der.diagram.curves.label_changes import Crossing, crossings_of, differences, seeds
from der.diagram.curves.polylines import distance, loose_ends, meetings
from der.diagram.curves.pruning import BESIDE, SAME_CURVE, asked_beside, beside, pieces_of, unlike
from der.diagram.curves.slices import Boundaries, Slice, SliceCases, Solve, joined, slices
from der.diagram.curves.tracing import At, Function, States, corrected, trace
from der.diagram.families import Family
from der.diagram.scanned_boundaries import BoundaryPoint, Corner, Curve
from der.errors import ContinuationFailed
from der.scene import Scene

NARROW = 1e-3  # of the side: cases so near to each other have the state that a condition needs
NEAREST = 1e-4  # likewise, beside the end of another curve
SHARPER = 8  # halvings between such points of a curve
ROUNDS, ROUND = 3, 12  # searches around loose ends, and places of each
BISECTED = 1e-6  # of the diagram's side
REACH = 3.0  # gaps of the scan within which a crossing must find its curve
EXCHANGE = "exchange"
STABILITY, STAYS = "stability", "stays folded"
INFINITE = "infinite slope"


def one_by_one(cases: Sequence[Case]) -> list[Row]:
    """The rows of cases, solved in this process."""
    return [solve_case(case) for case in cases]


def boundaries(family: Family, rows: Sequence[Row], *, solve: Solve = one_by_one) -> Boundaries:
    """Boundaries of a diagram from the rows of its scan; of a cube, slice by slice.

    Parameters
    ----------
    solve : how the cases beside curves and between neighbours are solved, many at a time
    """
    parts = [_Search(SliceCases(part, solve)).located() for part in slices(family, rows)]
    return joined(parts)


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

    return _Search(SliceCases(part, all_of)).located(), new


class _Search:
    """The search for what happens between the cases of a slice."""

    def __init__(self, cases: SliceCases) -> None:
        self.cases = cases

    def located(self) -> Boundaries:
        """Return the boundaries between the cases of a scan."""
        lines: list[Line] = []
        crossings = crossings_of(self.cases.placed)
        for crossing in crossings:  # in order: one curve explains many
            if not _explained(crossing, lines):
                self._trace(crossing, lines)
        kept, met = self._kept(lines)
        left = [crossing for crossing in crossings if not _explained(crossing, kept)]
        found = len(lines)
        left = self.cases.bisected(left, NARROW)
        for narrow in left:
            # near the boundary, a state is close to the one that makes it
            if not _explained(narrow, kept):
                self._trace(narrow, lines)
        if len(lines) > found:
            kept, met = self._kept(lines)
            left = [narrow for narrow in left if not _explained(narrow, kept)]
        kept, met = self._continued(lines, kept, met)
        left = [narrow for narrow in left if not _explained(narrow, kept)]
        curves = [self._curve(line) for line in kept]
        curves += [replace(self._curve(line), kind=STAYS) for line in self._released(kept)]
        points: dict[str, list[BoundaryPoint]] = defaultdict(list)
        for narrow in self.cases.bisected(left, BISECTED):
            points[narrow.kind].append(self.cases.between(narrow))
        curves += [
            Curve(f"{kind} (bisected)", self.cases.sheet, chain)
            for kind, some in points.items()
            for chain in self.cases.chains(some)
        ]
        return Boundaries(curves, [self._corner(one) for one in met])

    # --- curves of a condition ---

    def _trace(self, crossing: Crossing, lines: list[Line], *, one_new: bool = False) -> None:
        """Add the curves that may bound what differs between two cases, until one does.

        ``one_new``: until a new one is found, instead.
        """
        for kind in _bounding(crossing.kind):
            points = self._traced(kind, crossing)
            new = bool(points) and not _known(kind, points, lines)
            if new:
                lines.append(Line(kind, points, [None] * len(points)))
            if new if one_new else points and _explained(crossing, lines):
                return

    def _continued(
        self, lines: list[Line], kept: list[Line], met: list[Met]
    ) -> tuple[list[Line], list[Met]]:
        """Kept curves and corners, with the curves that continue those with loose ends."""
        asked: list[Array] = []
        for _ in range(ROUNDS):
            before = len(lines)
            ends = [end for end in _loose(kept, met) if distance(end, np.array(asked)) > BESIDE]
            asked += ends
            for crossing in self.cases.bisected(self._around(ends, kept), NEAREST):
                self._trace(crossing, lines, one_new=True)
            if len(lines) == before:
                break
            kept, met = self._kept(lines)
        return kept, met

    def _around(self, ends: list[Array], kept: list[Line]) -> list[Crossing]:
        """Unlike neighbours on small circles, with no curve between that bounds what differs."""
        turns = 2.0 * math.pi * np.arange(ROUND) / ROUND
        circle = BESIDE * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        found = []
        for end in ends:
            places = [(float(u[0]), float(u[1])) for u in np.clip(end + circle, 0.0, 1.0)]
            rows = self.cases.solve([self.cases.case(u) for u in places])
            there = list(zip(places, rows, strict=True))
            for (a, first), (b, second) in pairwise([*there, there[0]]):
                chord = np.array([a, b])
                for kind in differences(first, second):
                    bounding = [line for line in kept if line.kind in _bounding(kind)]
                    if not any([*meetings(chord, line.places)] for line in bounding):
                        found.append(Crossing(kind, a, b, first, second))
        return found

    def _traced(self, kind: str, crossing: Crossing) -> list[At[Value]]:
        """The curve between two cases, followed to its ends; none where no condition finds one."""
        condition = self._condition(kind)
        for row, place in ((crossing.first, crossing.a), (crossing.second, crossing.b)):
            for seed in seeds(kind, row):
                try:
                    near = corrected(condition, np.array(place), seed, near=REACH * crossing.gap)
                    if crossing.apart(near.u) < REACH * crossing.gap:
                        return trace(condition, near.u, near.state, states=self._states())
                except ContinuationFailed:
                    continue
        return []

    def _condition(self, kind: str) -> Function[Value]:
        condition = KINDS[kind]

        def value(u: Array, seed: Value) -> tuple[float, Value]:
            try:
                if kind == INFINITE and is_half(seed):
                    found = infinite_slope_near(self._scene, u, seed)
                else:
                    found = condition(self._scene(u), seed)
            except ValueError as wrong:
                raise NotFound(str(wrong)) from wrong
            return found.value, found

        return value

    def _scene(self, u: Array) -> Scene:
        """The scene at a place, cached: derivatives need the same one again."""
        return _scene(self.cases.case(u))

    def _states(self) -> States[Value]:
        return States(lambda seed: across(self._scene, fresh(seed)), numbers)

    def _curve(self, line: Line) -> Curve:
        height = self.cases.height
        points = [
            self._point(at, self._error(line.kind, at) if met is None else height * met.error)
            for at, met in zip(line.points, line.corners, strict=True)
        ]
        return Curve(line.kind, self.cases.sheet, tuple(points))

    def _corner(self, met: Met) -> Corner:
        point = self._point(met.first, self.cases.height * met.error)
        return Corner(met.kinds, self.cases.sheet, point)

    def _point(self, at: At[Value], error: float) -> BoundaryPoint:
        state = at.state.at
        return BoundaryPoint(self.cases.case(at.u), state.gamma, state.moment, error)

    def _error(self, kind: str, at: At[Value]) -> float:
        """Error of the place in h/t: residual of the condition, and its change on a halved mesh."""
        state = at.state
        try:
            fine = on(state.at.mesh.halved, state)
            change = self._condition(kind)(at.u, fine)[0] - state.value
        except ContinuationFailed:
            return math.inf
        return self.cases.height * (at.distance + abs(change) / float(np.linalg.norm(at.gradient)))

    def _kept(self, lines: list[Line]) -> tuple[list[Line], list[Met]]:
        """Pieces of curves on whose two sides the modes differ by their kind, and their corners."""
        lines = [Line(line.kind, list(line.points), [None] * len(line.points)) for line in lines]
        met = mark_corners(lines, self._condition)
        asked = [(n, k) for n, line in enumerate(lines) for k in asked_beside(line)]
        holds: list[list[bool | None]] = [[None] * len(line.points) for line in lines]
        for _ in range(SHARPER):
            for (n, k), rows in zip(asked, self._sides(lines, asked), strict=True):
                holds[n][k] = None if rows is None else _bounds(lines[n].kind, *rows)
            if not (asked := self._sharpened(lines, holds)):
                break
        pieces: list[Line] = []
        for line, own in zip(lines, holds, strict=True):
            pieces += pieces_of(line, own)
        pieces.sort(key=lambda piece: -len(piece.points))
        kept: list[Line] = []
        for piece in pieces:
            if not _known(piece.kind, piece.points, kept):
                kept.append(piece)
        there = {(corner, piece.kind) for piece in kept for corner in piece.corners}
        met = [replace(m, kinds=tuple(k for k in m.kinds if (m, k) in there)) for m in met]
        return kept, [one for one in met if len(one.kinds) > 1]

    def _released(self, kept: list[Line]) -> Iterator[Line]:
        """The parts of curves of stability that bound rings that stay folded when released, too.

        What they lose there is the stiffness of the class that turns the grips.
        """
        for n, line in enumerate(kept):
            asked = asked_beside(line) if line.kind == STABILITY else []
            holds: list[bool | None] = [None] * len(line.points)
            sides = self._sides(kept, [(n, k) for k in asked])
            for k, rows in zip(asked, sides, strict=True):
                if rows is not None:
                    holds[k] = rows[0].stays_folded != rows[1].stays_folded
            yield from pieces_of(line, holds)

    def _sides(
        self, lines: list[Line], asked: list[tuple[int, int]]
    ) -> Iterator[tuple[Row, Row] | None]:
        """The cases on the two sides of points; None where those do not tell."""
        sides = [beside(lines[n], k, lines) for n, k in asked]
        rows = iter(self.cases.solve([self.cases.case(u) for places in sides for u in places]))
        for places in sides:
            yield (next(rows), next(rows)) if places else None

    def _sharpened(
        self, lines: list[Line], holds: list[list[bool | None]]
    ) -> list[tuple[int, int]]:
        """New points between neighbours where the modes differ on the sides of only one."""
        new = []
        for n, (line, own) in enumerate(zip(lines, holds, strict=True)):
            added = 0
            for k in unlike(line, own, NARROW):
                a, b = line.points[k + added : k + added + 2]
                try:
                    at = corrected(self._condition(line.kind), 0.5 * (a.u + b.u), a.state)
                except ContinuationFailed:
                    continue
                added += 1
                line.insert(k + added, at, None)
                own.insert(k + added, None)
                new.append((n, k + added))
        return new


@lru_cache(maxsize=16)
def _scene(case: Case) -> Scene:
    return case.scene()


def _loose(kept: list[Line], met: list[Met]) -> list[Array]:
    """The loose ends of curves."""
    ends = [(line.corners[0] in met, line.corners[-1] in met) for line in kept]
    return [kept[n].points[k].u for n, k in loose_ends([line.places for line in kept], ends)]


def _explained(crossing: Crossing, lines: Iterable[Line]) -> bool:
    """Whether a curve that bounds what differs passes between two cases, or close by."""
    kinds = _bounding(crossing.kind)
    reach = max(0.75 * crossing.gap, SAME_CURVE)
    return any(
        line.kind in kinds and distance(crossing.middle, line.places) < reach for line in lines
    )


def _known(kind: str, points: Sequence[At[Value]], lines: Iterable[Line]) -> bool:
    """Whether a curve is known: its middle lies on one of the same kind."""
    middle = points[len(points) // 2].u
    return any(line.kind == kind and distance(middle, line.places) < SAME_CURVE for line in lines)


def _bounds(kind: str, one: Row, other: Row) -> bool:
    """Whether two cases differ by what a curve of this kind bounds."""
    return any(kind in _bounding(what) for what in differences(one, other))


def _bounding(what: str) -> tuple[str, ...]:
    """Kinds of boundaries at which this changes, the likeliest first."""
    return (FOLD, INFINITE, EXCHANGE) if what == FOLD else (what, EXCHANGE)
