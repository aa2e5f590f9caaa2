"""Distributed tracing of a diagram's boundaries, by workers that may die; and what is incomplete.

Boundaries are complete where they separate all unlike neighbours of the scan (`unexplained`), and
where none of them has a loose end (`loose_ends`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from der.bvp.gauss import Array
from der.diagram.cases import Case, Row
from der.diagram.curves import polylines
from der.diagram.curves.asking import Call, Question, answer
from der.diagram.curves.boundaries import located
from der.diagram.curves.polylines import distance
from der.diagram.curves.slices import Boundaries, Slice, joined, slices
from der.diagram.families import Family
from der.diagram.jobs import Jobs
from der.diagram.scan import Scan, Solve, batches, given_up
from der.diagram.scanned_boundaries import BoundaryPoint, Corner, Curve, scanned_boundaries
from der.diagram.store import Store
from der.diagram.workers import Workers


class _Followed:
    """A slice whose boundaries are sought, and what the search knows and waits for."""

    def __init__(self, part: Slice) -> None:
        self.part = part
        self.boundaries: Boundaries | None = None  # once they are known
        self._search = located(part)
        self._asked: Sequence[Question] = ()
        self._results: dict[Question, Any] = {}
        self._go_on(None)

    def open(self, rows: Mapping[str, Row]) -> list[Question]:
        """Go on, with the rows and results known, up to questions without answer; none: it ends."""
        while self._asked:
            left = [one for one in self._asked if self._answer(one, rows) is None]
            if left:
                return left
            self._go_on([self._answer(one, rows) for one in self._asked])
        return []

    def take(self, question: Call, result: Any) -> None:
        """Take note of the result of a call; None: it ends its workers, and the search."""
        if question in self._asked:
            self._results = {question: result}
            if result is None:
                self._asked = ()

    def _answer(self, question: Question, rows: Mapping[str, Row]) -> Any:
        if isinstance(question, Case):
            return rows.get(question.key)
        return self._results.get(question)

    def _go_on(self, answers: Any) -> None:
        try:
            self._asked = self._search.send(answers)
        except StopIteration as end:
            self._asked, self.boundaries = (), end.value


def follow(found: Scan, store: Store, crew: Workers, solve: Solve) -> Boundaries:
    """Boundaries followed in two parameters; rows that are solved for them are kept, too.

    All slices are searched at the same time. One that ends its workers has the boundaries of the
    scan.

    Raises
    ------
    OSError
        If a row cannot be written.
    RuntimeError
        If workers die before they have done anything, or the executor has stopped.
    """
    jobs: Jobs[Question, list[Any]] = Jobs(crew, partial(_answered, solve))
    parts = [_Followed(part) for part in slices(found.family, found.sorted_rows)]
    asked: set[Question] = set()

    def ask() -> None:
        new = {one: None for part in parts for one in part.open(store.rows) if one not in asked}
        asked.update(new)
        jobs.add((one,) for one in new if isinstance(one, Call))
        jobs.add(batches([one for one in new if isinstance(one, Case)], crew.width))

    ask()
    for batch, answers in jobs.done():
        if isinstance(call := batch[0], Call):
            for part in parts:
                part.take(call, None if answers is None else answers[0])
        else:
            cases = [one for one in batch if isinstance(one, Case)]
            store.add(given_up(cases) if answers is None else answers)
        ask()
    return joined(part.boundaries or _scanned(found, part.part) for part in parts)


def _answered(solve: Solve, batch: tuple[Question, ...]) -> list[Any]:
    """What a worker does."""
    return [answer(solve, question) for question in batch]


def _scanned(found: Scan, part: Slice) -> Boundaries:
    """The boundaries of a slice as the scan sees them."""
    curves = [
        curve
        for curve in scanned_boundaries(found)
        if curve.twist_axis == part.sheet and all(part.has(point.case) for point in curve.points)
    ]
    return Boundaries(curves, [])


def unexplained(found: Scan, curves: Iterable[Curve]) -> int:
    """How many edges of the scan's finest cells have no boundary within one and a half cells."""
    family = found.family
    lines: dict[str, list[Array]] = {}
    for curve in curves:
        if len(known := _places(family, curve)):
            lines.setdefault(curve.twist_axis, []).append(known)
    return sum(
        min(
            (distance(np.array(place), line) for line in lines.get(curve.twist_axis, [])),
            default=math.inf,
        )
        > 1.5 / family.finest
        for curve in scanned_boundaries(found)
        for point in curve.points
        if (place := family.unit(point.case)) is not None
    )


def loose_ends(
    family: Family, curves: Iterable[Curve], corners: Iterable[Corner]
) -> list[BoundaryPoint]:
    """Loose ends of curves.

    They are neither corners, nor on an edge of their square, nor on another curve of it. A closed
    curve has no ends.
    """
    meet = {corner.point.case for corner in corners}
    squares: dict[tuple[object, ...], list[Curve]] = {}
    for curve in curves:
        if len(places := _places(family, curve)):
            plane = (round(float(part), 9) for part in places[0, 1:-1])
            squares.setdefault((curve.twist_axis, *plane), []).append(curve)
    found = []
    for own in squares.values():
        lines = [_places(family, curve)[:, [0, -1]] for curve in own]
        ends = [(c.points[0].case in meet, c.points[-1].case in meet) for c in own]
        found += [own[n].points[k] for n, k in polylines.loose_ends(lines, ends)]
    return found


def _places(family: Family, curve: Curve) -> Array:
    """Unit coordinates of the points of a curve that lie in the diagram, (n, dimension)."""
    places = [family.unit(point.case) for point in curve.points]
    return np.array([place for place in places if place is not None])
