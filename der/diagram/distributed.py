"""Distributed tracing of a diagram's boundaries, by workers that may die; and what is incomplete.

Boundaries are complete where they separate all unlike neighbours of the scan (`unexplained`), and
where none of them has a loose end (`loose_ends`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from der.bvp.gauss import Array
from der.diagram.cases import Case, Row
from der.diagram.curves import polylines as polygons
from der.diagram.curves.boundaries import boundaries, slice_boundaries
from der.diagram.curves.polylines import distance
from der.diagram.curves.slices import Boundaries, Slice, joined, slices
from der.diagram.families import Family
from der.diagram.jobs import Jobs
from der.diagram.scan import Scan, Solve, solve_all
from der.diagram.scanned_boundaries import BoundaryPoint, Corner, Curve, scanned_boundaries
from der.diagram.store import Store
from der.diagram.workers import Workers


@dataclass(frozen=True, eq=False)
class _Task:
    """A slice of a cube and its rows; no two are equal."""

    part: Slice
    known: tuple[Row, ...]


def follow(found: Scan, store: Store, crew: Workers, solve: Solve) -> Boundaries:
    """Boundaries followed in two parameters; rows that are solved for them are kept, too.

    Each slice of a cube is one task. A slice that ends its workers has the boundaries of the scan.

    Raises
    ------
    OSError
        If a row cannot be written.
    RuntimeError
        If workers die before they have done anything, or the executor has stopped.
    """

    def all_of(cases: Sequence[Case]) -> list[Row]:
        new = [case for case in dict.fromkeys(cases) if case.key not in store.rows]
        solve_all(new, store, crew, solve=solve)
        return [store.rows[case.key] for case in cases]

    if found.family.dimension == 2:
        return boundaries(found.family, found.sorted_rows, solve=all_of)
    tasks = [
        _Task(part, tuple(row for row in store.rows.values() if part.has(row.case)))
        for part in slices(found.family, found.sorted_rows)
    ]
    parts: dict[_Task, Boundaries] = {}
    for (task,), followed in Jobs(crew, partial(_follow, solve), [(t,) for t in tasks]).done():
        if followed is None:
            parts[task] = _scanned(found, task.part)
        else:
            parts[task], rows = followed
            store.add(rows)
    return joined(parts[task] for task in tasks)


def _follow(solve: Solve, batch: tuple[_Task, ...]) -> tuple[Boundaries, list[Row]]:
    """What a worker does."""
    (task,) = batch
    return slice_boundaries(task.part, task.known, solve)


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
        found += [own[n].points[k] for n, k in polygons.loose_ends(lines, ends)]
    return found


def _places(family: Family, curve: Curve) -> Array:
    """Unit coordinates of the points of a curve that lie in the diagram, (n, dimension)."""
    places = [family.unit(point.case) for point in curve.points]
    return np.array([place for place in places if place is not None])
