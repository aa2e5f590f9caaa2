"""What workers do for the boundaries of a slice: curves of conditions, corners, errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache, partial

import numpy as np

from der.bvp.gauss import Array
from der.diagram.cases import Case
from der.diagram.curves.conditions import KINDS, NotFound, Value, fresh, numbers, on
from der.diagram.curves.corners import FOLD, LIKE, Line, Met, mark_corners, same
from der.diagram.curves.infinite_slope import across, infinite_slope_near, is_half
from der.diagram.curves.label_changes import Crossing, seeds
from der.diagram.curves.polylines import distance, nearest
from der.diagram.curves.pruning import BESIDE, SAME_CURVE
from der.diagram.curves.slices import Boundaries, Slice
from der.diagram.curves.tracing import At, Function, States, corrected, trace
from der.diagram.scanned_boundaries import BoundaryPoint, Corner, Curve
from der.errors import ContinuationFailed
from der.scene import Scene

REACH = 3.0  # gaps of the scan within which a crossing must find its curve
EXCHANGE = "exchange"
STABILITY, STAYS = "stability", "stays folded"
INFINITE = "infinite slope"


def traced(
    part: Slice, crossings: Sequence[Crossing], lines: Sequence[Line], one_new: bool
) -> list[Line]:
    """Curves, and those that may bound what differs between cases; one explains many.

    Parameters
    ----------
    lines : what is known
    one_new : whether each pair of cases is to have a curve that was not known
    """
    found: list[Line] = []
    for crossing in crossings:
        if one_new or not explained(crossing, found):
            _trace(part, crossing, lines, found, one_new)
    return [*lines, *found]


def _trace(
    part: Slice, crossing: Crossing, lines: Sequence[Line], found: list[Line], one_new: bool
) -> None:
    """Add the curves that may bound what differs between two cases, until one does."""
    for kind in bounding(crossing.kind):
        there = [*lines, *found]
        if (line := _curve(part, kind, crossing, there)) is None:
            continue
        if new := not known(kind, line.points, there):
            found.append(line)
        if new if one_new else explained(crossing, [*lines, *found]):
            return


def _curve(part: Slice, kind: str, crossing: Crossing, lines: Iterable[Line]) -> Line | None:
    """The curve between two cases, a known one or followed to its ends; None where none is."""
    condition = condition_on(part, kind)
    scene = partial(_scene, part)
    states = States(lambda seed: across(scene, fresh(seed)), numbers)
    for row, place in ((crossing.first, crossing.a), (crossing.second, crossing.b)):
        for seed in seeds(kind, row):
            try:
                near = corrected(condition, np.array(place), seed, near=REACH * crossing.gap)
                if crossing.apart(near.u) < REACH * crossing.gap:
                    if (line := _through(near, kind, lines)) is not None:
                        return line
                    points = trace(condition, near.u, near.state, states=states)
                    return Line(kind, points, [None] * len(points))
            except ContinuationFailed:
                continue
    return None


def _through(near: At[Value], kind: str, lines: Iterable[Line]) -> Line | None:
    """A known curve that passes a point, in a state like its own; not one that ends there."""
    for line in lines:
        k, away = nearest(near.u, line.places)
        ends = np.linalg.norm(line.places[[0, -1]] - near.u, axis=1)
        alike = any(same(near.state, at.state, LIKE) for at in line.points[k : k + 2])
        if line.kind == kind and alike and away < SAME_CURVE and min(ends) > BESIDE:
            return line
    return None


def condition_on(part: Slice, kind: str) -> Function[Value]:
    """A condition as a function of a place in the slice."""
    condition, scene = KINDS[kind], partial(_scene, part)

    def value(u: Array, seed: Value) -> tuple[float, Value]:
        try:
            if kind == INFINITE and is_half(seed):
                found = infinite_slope_near(scene, u, seed)
            else:
                found = condition(scene(u), seed)
        except ValueError as wrong:
            raise NotFound(str(wrong)) from wrong
        return found.value, found

    return value


def _scene(part: Slice, u: Array) -> Scene:
    return _of_case(part.case(u))


@lru_cache(maxsize=16)
def _of_case(case: Case) -> Scene:
    """The scene of a case, cached: derivatives need the same one again."""
    return case.scene()


def with_corners(part: Slice, lines: Sequence[Line]) -> tuple[list[Line], list[Met]]:
    """Curves with the corners where they meet."""
    lines = [Line(line.kind, list(line.points), [None] * len(line.points)) for line in lines]
    met = mark_corners(lines, partial(condition_on, part))
    return lines, met


def between(
    part: Slice, ends: Iterable[tuple[str, At[Value], At[Value]]]
) -> list[At[Value] | None]:
    """Points of curves midway between two others; None where there is none."""

    def midway(kind: str, a: At[Value], b: At[Value]) -> At[Value] | None:
        try:
            return corrected(condition_on(part, kind), 0.5 * (a.u + b.u), a.state)
        except ContinuationFailed:
            return None

    return [midway(*end) for end in ends]


def curves(
    part: Slice, kept: Iterable[Line], released: Iterable[Line], met: Iterable[Met]
) -> Boundaries:
    """Curves, and the parts of curves of stability that bound rings that stay folded, with errors.

    Corners have an error already.
    """

    def point(line: Line, at: At[Value], corner: Met | None) -> BoundaryPoint:
        error = _error(part, line.kind, at) if corner is None else corner.error
        return _point(part, at, error)

    def curve(line: Line, kind: str) -> Curve:
        pairs = zip(line.points, line.corners, strict=True)
        return Curve(kind, part.sheet, tuple(point(line, *pair) for pair in pairs))

    found = [curve(line, line.kind) for line in kept]
    found += [curve(line, STAYS) for line in released]
    corners = [Corner(one.kinds, part.sheet, _point(part, one.first, one.error)) for one in met]
    return Boundaries(found, corners)


def _point(part: Slice, at: At[Value], error: float) -> BoundaryPoint:
    state = at.state.at
    return BoundaryPoint(part.case(at.u), state.gamma, state.moment, part.height * error)


def _error(part: Slice, kind: str, at: At[Value]) -> float:
    """Error of a place: residual of the condition, and its change on a halved mesh."""
    state = at.state
    try:
        fine = on(state.at.mesh.halved, state)
        change = condition_on(part, kind)(at.u, fine)[0] - state.value
    except ContinuationFailed:
        return math.inf
    return at.distance + abs(change) / float(np.linalg.norm(at.gradient))


# --- What curves explain ---------------------------------------------------------------------


def explained(crossing: Crossing, lines: Iterable[Line]) -> bool:
    """Whether a curve that bounds what differs passes between two cases, or close by."""
    kinds = bounding(crossing.kind)
    reach = max(0.75 * crossing.gap, SAME_CURVE)
    return any(
        line.kind in kinds and distance(crossing.middle, line.places) < reach for line in lines
    )


def known(kind: str, points: Sequence[At[Value]], lines: Iterable[Line]) -> bool:
    """Whether a curve is known: its middle lies on one of the same kind."""
    middle = points[len(points) // 2].u
    return any(line.kind == kind and distance(middle, line.places) < SAME_CURVE for line in lines)


def bounding(what: str) -> tuple[str, ...]:
    """Kinds of boundaries at which this changes, the likeliest first."""
    return (FOLD, INFINITE, EXCHANGE) if what == FOLD else (what, EXCHANGE)
