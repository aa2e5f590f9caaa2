"""Corners of a phase diagram: where two boundaries meet, solved for with the conditions of both.

Boundaries of unlike states cross, and their polygons say where to begin. The curve of the fold at
pi touches others instead, where they have a state of which one more thing is true: those of
exchanges and cusps where their gamma is pi, that of the infinite slope where gamma = pi is crossed
to the fifth order. That is the second condition then. The curve of a cusp ends there, too. It
touches that of exchanges where gamma is stationary along an asymptote of the paths.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, product

import numpy as np

from der.bvp.gauss import Array
from der.diagram.curves.conditions import NotFound, Value, asymptotic, on, steepening
from der.diagram.curves.polylines import meetings, nearest
from der.diagram.curves.tracing import EXACT, At, Function, by_differences, corrected
from der.errors import ContinuationFailed

FOLD = "foldability"


def _gamma(state: Value) -> float:
    """Gamma less pi."""
    return state.at.gamma - math.pi


CUSP = "snap-back"
TOUCHING = {  # what touches what, and where
    ("exchange", FOLD): _gamma,
    ("exchange", CUSP): asymptotic,
    (CUSP, FOLD): _gamma,
    ("infinite slope", FOLD): steepening,
}
ORDER = (
    "exchange",
    CUSP,
    "infinite slope",
    "stability",
    "stays folded",
    FOLD,
)  # a corner has the state of the first
ON_FOLDED = {"stability", "stays folded"}  # two conditions on one state: where they meet they cross
NEAR = 0.1  # of the square's side: largest distance of a corner from its bracket
BESIDE = 0.02  # of the side: a curve that ends so near to a corner on it ends there
ASIDE = 2.5e-3  # of the side: what a chord of a curve is off at most
SAME = 1e-6  # of the side: two corners so near are one
DIFFERENT = 0.05  # gamma and M of states that are not the same, together
LIKE = 0.5  # likewise, of those on a curve that ends in a corner: they change with a root there
MOST = 20
STEPS = 8  # along the side of a polygon

ConditionOf = Callable[[str], Function[Value]]


@dataclass(frozen=True, eq=False)
class Met:
    """A corner of a diagram; no two are equal.

    Attributes
    ----------
    kinds : of the boundaries that meet, or may
    first, second : the corner as a point of each, with its state; the same state where they touch
    error : of its place, of the square's side
    """

    kinds: tuple[str, ...]
    first: At[Value]
    second: At[Value]
    error: float


@dataclass
class Line:
    """A curve that may be a boundary: its points, and which of them are corners."""

    kind: str
    points: list[At[Value]]
    corners: list[Met | None]

    @property
    def places(self) -> Array:
        """(n, 2) in the unit square."""
        return np.array([at.u for at in self.points])

    def insert(self, k: int, at: At[Value], corner: Met | None) -> None:
        """Make a point the k-th."""
        self.points.insert(k, at)
        self.corners.insert(k, corner)


def mark_corners(lines: list[Line], condition: ConditionOf) -> list[Met]:
    """Solve for all corners, and insert each into its curves."""
    found: list[Met] = []
    for one, other in combinations(sorted(lines, key=lambda line: ORDER.index(line.kind)), 2):
        for u in [meeting.place for meeting in meetings(one.places, other.places)]:
            if (met := _meeting(one, other, u, condition)) is not None:
                met = _once(met, found)
                _put(one, met.first, met)
                _put(other, met.second, met)
    for (kind, touched), value in TOUCHING.items():
        for line in [line for line in lines if line.kind == kind]:
            for k in _touching(line, value):
                ends = line.points[k : k + 2]
                u = 0.5 * (ends[0].u + ends[1].u)
                met = None
                for at in chain(ends, _led(ends, u, condition(kind))):  # the expensive ones last
                    try:
                        met = _solved((kind, touched), u, (at.state,) * 2, condition, value)
                        break
                    except ContinuationFailed:
                        continue
                if met is None:
                    continue
                kinds = (*met.kinds, CUSP) if kind == "infinite slope" else met.kinds
                met = _once(replace(met, kinds=kinds), found)
                _put(line, met.first, met)
                for other in [other for other in lines if other.kind in kinds[1:]]:
                    if _has(other, met):
                        _put(other, met.second, met)
                        _end(other, met)
    for line in lines:
        _separate(line, condition(line.kind))
    return found


def _meeting(one: Line, other: Line, u: Array, condition: ConditionOf) -> Met | None:
    """The corner near the crossing of two polygons, on both curves; None where there is none.

    On the way to the corner a state may be lost, or become one of another curve. So the states at
    both ends of the polygon's side are tried first, then those followed along it.
    """
    (i, _), (j, _) = nearest(u, one.places), nearest(u, other.places)
    firsts, seconds = one.points[i : i + 2], other.points[j : j + 2]
    alike = any(same(a.state, b.state) for a, b in product(firsts, seconds))
    if alike and {one.kind, other.kind} != ON_FOLDED:
        return None  # they touch, or are one: polygons cross there by chance

    def led() -> Iterator[tuple[At[Value], At[Value]]]:
        yield from product(
            list(_led(firsts, u, condition(one.kind))),
            list(_led(seconds, u, condition(other.kind))),
        )

    for first, second in chain(product(firsts, seconds), led()):
        seeds = first.state, second.state
        try:
            met = _solved((one.kind, other.kind), u, seeds, condition)
        except ContinuationFailed:
            continue
        if all(nearest(met.first.u, line.places)[1] < ASIDE for line in (one, other)):
            return met
    return None


def _led(ends: Sequence[At[Value]], u: Array, condition: Function[Value]) -> Iterator[At[Value]]:
    """The curve's point near ``u``, by short steps from others; none where it is lost."""
    for at in ends:
        start = at.u
        try:
            for k in range(1, STEPS + 1):
                at = corrected(condition, start + (u - start) * k / STEPS, at.state)
        except ContinuationFailed:
            continue
        yield at


def _has(line: Line, met: Met) -> bool:
    """Whether a curve passes a corner, or ends close to it, in a state like the corner's."""
    apart = [float(np.linalg.norm(at.u - met.first.u)) for at in line.points]
    if nearest(met.first.u, line.places)[1] > ASIDE and min(apart[0], apart[-1]) > BESIDE:
        return False
    near = [at for at, far in zip(line.points, apart, strict=True) if far < BESIDE]
    return any(same(at.state, met.second.state, LIKE) for at in near)


def _once(met: Met, found: list[Met]) -> Met:
    """A corner, or the one already found in its place, on a curve that was followed twice."""
    for old in found:
        if old.kinds == met.kinds and np.linalg.norm(old.first.u - met.first.u) < SAME:
            return old
    found.append(met)
    return met


def _separate(line: Line, condition: Function[Value]) -> None:
    """Insert a point between neighbouring corners of a curve."""
    for k in range(len(line.points) - 2, -1, -1):
        if line.corners[k] is not None and line.corners[k + 1] is not None:
            a, b = line.points[k], line.points[k + 1]
            try:
                between = corrected(condition, 0.5 * (a.u + b.u), a.state)
            except ContinuationFailed:
                continue
            line.insert(k + 1, between, None)


def _touching(line: Line, value: Callable[[Value], float]) -> list[int]:
    """After which points of a curve a function of its states is zero, the last one first."""
    values = []
    for at in line.points:
        try:
            values.append(value(at.state))
        except ContinuationFailed:
            values.append(math.nan)
    return [k for k in range(len(values) - 2, -1, -1) if values[k] * values[k + 1] < 0.0]


def same(one: Value, other: Value, within: float = DIFFERENT) -> bool:
    """Whether two states are about the same."""
    return abs(one.at.gamma - other.at.gamma) + abs(one.at.moment - other.at.moment) < within


def _put(line: Line, at: At[Value], corner: Met) -> None:
    """Insert a corner where the curve comes nearest to it, beyond its end if it ends before."""
    if corner in line.corners:
        return
    places = line.places
    k, _ = nearest(at.u, places)
    along = 1.0
    if len(places) > 1:
        way = places[k + 1] - places[k]
        along = float((at.u - places[k]) @ way) / float(way @ way)
    line.insert(k if k == 0 and along < 0.0 else k + 1 + (along > 1.0), at, corner)


def _end(line: Line, corner: Met) -> None:
    """End a curve at a corner from which it goes back, or behind which its state is lost."""
    k, places = line.corners.index(corner), line.places
    if not 0 < k < len(places) - 1:
        return
    sides = line.points[: k + 1], line.points[k:]
    if corner.kinds[0] == "infinite slope":
        first = _strongest(sides[0]) > _strongest(sides[1])
    elif (places[k] - places[k - 1]) @ (places[k + 1] - places[k]) < 0.0:
        first = len(sides[0]) > len(sides[1])
    else:
        return
    rest = slice(k + 1) if first else slice(k, None)
    line.points, line.corners = line.points[rest], line.corners[rest]


def _strongest(points: list[At[Value]]) -> float:
    """Largest |M| on a curve."""
    return max(abs(at.state.at.moment) for at in points)


def _solved(
    kinds: tuple[str, str],
    u: Array,
    seeds: tuple[Value, Value],
    condition: ConditionOf,
    touching: Callable[[Value], float] | None = None,
) -> Met:
    """Both conditions' root near ``u`` (Newton's method, Broyden's update of the derivatives).

    Parameters
    ----------
    touching : of a state of the first kind, in place of the second's condition
    """
    one = condition(kinds[0])

    def both(u: Array, seeds: tuple[Value, Value]) -> tuple[Array, tuple[Value, Value]]:
        f, first = one(u, seeds[0])
        if touching is not None:
            return np.array([f, touching(first)]), (first, first)
        g, second = condition(kinds[1])(u, seeds[1])
        return np.array([f, g]), (first, second)

    start = u
    values, seeds = both(u, seeds)
    rates = by_differences(lambda u: both(u, seeds)[0], u, values)
    for _ in range(MOST):
        change = np.linalg.lstsq(rates, -values, rcond=None)[0]
        size = float(np.linalg.norm(change))
        if size < EXACT:
            break
        u = u + change
        if not np.linalg.norm(u - start) < NEAR:
            raise NotFound("no corner nearby")
        before = values
        values, seeds = both(u, seeds)
        rates += np.outer(values - before - rates @ change, change) / size**2
    else:
        raise NotFound("no corner found")
    if ((u < -EXACT) | (u > 1.0 + EXACT)).any():
        raise NotFound("the corner is outside")
    u = np.clip(u, 0.0, 1.0)
    first, second = (At(u, seed, size, rate) for seed, rate in zip(seeds, rates, strict=True))
    one_fine, other_fine = (on(seed.at.mesh.halved, seed) for seed in seeds)
    fine, _ = both(u, (one_fine, other_fine))
    apart = np.linalg.lstsq(rates, fine - values, rcond=None)[0]
    return Met(kinds, first, second, size + float(np.linalg.norm(apart)))
