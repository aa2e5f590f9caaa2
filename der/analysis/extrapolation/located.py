"""Branch points and self-crossings on the extrapolated curve.

Neither is a root of gamma, M, U or their rates. So the same point is located on each mesh by
itself, within a step between two states that are matched to the finest path on either side of it:
a branch point as on any path, a self-crossing as that of the smooth curve (`crossing.py`). Its
gamma, M and U then have errors in even powers of h, as those of states. Its place on the path is
where the extrapolated curve has its extrapolated values.

A point that is not found on every mesh, as a self-crossing of the polygon that is none of the
smooth curve, has no errors and says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from der.analysis.extrapolation.crossing import smooth_crossing, strands
from der.analysis.extrapolation.curve import (
    FARTHEST,
    GAMMA,
    LEVELS,
    RATE,
    Family,
    Goal,
    Matched,
    Place,
    sought,
)
from der.continuation.events import Events, regular
from der.continuation.events import located as points_within
from der.continuation.richardson import romberg
from der.continuation.step import Step, between
from der.errors import ContinuationFailed
from der.kernels.quaternions import Array
from der.problem import Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State

_SAME = 1e-7  # of values that Newton's method has found twice, from other starts
_NOT_COMPARED = "coarser meshes could not be compared"  # they have no matched state
_NOT_FOUND = "it was not found on every mesh"
_WIDTHS = (0.05, 0.15, FARTHEST)  # of s: how far on both sides it is looked for, in turn


def located(family: Family, point: Point[Equilibrium], place: Place, scales: Array) -> Place:
    """Return the place of a branch point or self-crossing; as it is if a mesh lacks that point.

    Parameters
    ----------
    place : that of the point of the finest mesh.
    scales : (6,) of the columns of a table.
    """
    own = _on_each_mesh(family, point) if point.kind in ("branch", "contact") else None
    if own is None:
        return place
    own, unsure = own[:LEVELS], np.abs(np.diff(own[::LEVELS], axis=0)).sum(axis=0)
    values, rates = romberg(own)[-1], place.table[0, RATE:]
    column = int(np.argmax(np.abs(rates / scales[:RATE])))  # gamma may be stationary, not all three
    goal = Goal(column, float(values[column]), float(rates[GAMMA]))
    found = sought(family, point.solution, Matched(place.table, place.residual), goal)
    return place if found is None else replace(found, values=values, own=own, unsure=unsure)


def marked(point: Point[Equilibrium], place: Place | None) -> Point[Equilibrium]:
    """Return the point; one of a kind without an error says why it has none."""
    if point.kind == "" or (place is not None and place.sought):
        return point
    why = _NOT_COMPARED if place is None else _NOT_FOUND
    return replace(point, details={**point.details, "no_error_bar": f"because {why}"})


def merged(
    points: Sequence[Point[Equilibrium]], places: Sequence[Place | None]
) -> tuple[list[Point[Equilibrium]], list[Place | None]]:
    """Return points and places in path order, a self-crossing of the curve once.

    The polygon may cross in two stages, which lead to the same crossing of the smooth curve.
    """
    kept: list[tuple[Point[Equilibrium], Place | None]] = []
    for point, place in zip(points, places, strict=True):
        if kept and _same_crossing(*kept[-1], point, place):
            first, there = kept.pop()
            after = point.details["linking_after"]
            sides = first.sides and point.sides and (first.sides[0], point.sides[1])
            details = {**first.details, "linking_after": after}
            point, place = replace(first, sides=sides, details=details), there
        kept.append((point, place))
    return [point for point, _ in kept], [place for _, place in kept]


def _same_crossing(
    one: Point[Equilibrium], here: Place | None, other: Point[Equilibrium], there: Place | None
) -> bool:
    """Whether two neighbours are one crossing of the smooth curve: their values are the same."""
    if {one.kind, other.kind} != {"contact"} or here is None or there is None:
        return False
    if here.own is None or there.own is None:
        return False
    return bool(np.allclose(here.values, there.values, rtol=_SAME, atol=_SAME))


def _on_each_mesh(family: Family, point: Point[Equilibrium]) -> Array | None:
    """Gamma, M and U (LEVELS, 3) of a point on every mesh; None: one lacks it.

    A self-crossing has a further row: that of the finest mesh by cubic splines.
    """
    for width in _WIDTHS:
        steps = _steps(family, point.solution, width)
        if not steps:
            return None
        try:
            find = _branch_points if point.kind == "branch" else _crossings
            found = find(family, point, steps)
        except (ContinuationFailed, np.linalg.LinAlgError):
            continue
        if None not in found:
            states = enumerate(found)
            return np.array([family.values(k % LEVELS, at) for k, at in states if at is not None])
    return None


def _steps(family: Family, base: Equilibrium, width: float) -> list[Step[State]]:
    """Steps on every mesh from a ``width`` before a state to one behind it; empty: one has none."""
    lines = []
    for s in (-width, width):
        end = family.beside(base, s)
        there = None if end is None else family.matched(end)
        if end is None or there is None or there.coarse is None:
            return []
        lines.append((end, *(level.solution for level in there.coarse)))
    return [
        between(ring, start, end, tolerance=family.tolerance, statistics=Statistics())
        for ring, start, end in zip(family.rings, *lines, strict=True)
    ]


def _crossings(
    family: Family, point: Point[Equilibrium], steps: Sequence[Step[State]]
) -> list[Equilibrium | None]:
    """The state of each step in which the smooth curve crosses itself; the first also by cubics.

    The curve between the vertices has an error that depends on where it crosses: no series tells.
    """
    where = strands(family.rings[0], steps[0])
    if where is None:
        return [None]
    pairs = zip(family.rings, steps, strict=True)
    found = [smooth_crossing(ring, step, steps[0], where) for ring, step in pairs]
    return [*found, smooth_crossing(family.rings[0], steps[0], steps[0], where, degree=3)]


def _branch_points(
    family: Family, point: Point[Equilibrium], steps: Sequence[Step[State]]
) -> list[Equilibrium | None]:
    """The same branch point on each mesh."""
    pairs = zip(family.rings[1:], steps[1:], strict=True)
    return [point.solution, *(_branch_point(ring, point, step) for ring, step in pairs)]


def _branch_point(
    ring: GrippedRing, point: Point[Equilibrium], step: Step[State]
) -> Equilibrium | None:
    """The branch point of the same class and sense in a step, closest to its middle."""
    events: Events[State] = Events(stability=True)
    points, _ = points_within(events, step, regular(ring, events, step.start))

    def from_middle(at: Equilibrium) -> float:
        s = ring.inner(step.start.tangent, ring.difference(step.start.state, at.state))
        return abs(s - 0.5 * step.length)

    same = [one.solution for one in points if _alike(one, point)]
    return min(same, key=from_middle, default=None)


def _alike(one: Point[Equilibrium], other: Point[Equilibrium]) -> bool:
    """Whether two points are branch points of one symmetry class and sense."""
    if one.kind != "branch" or one.details != other.details:
        return False
    return None in (one.sides, other.sides) or _change(one) == _change(other)


def _change(point: Point[Equilibrium]) -> list[int]:
    """How the index of each class changes."""
    before, after = point.sides or ((), ())
    return [(b or 0) - (a or 0) for a, b in zip(before, after, strict=True)]
