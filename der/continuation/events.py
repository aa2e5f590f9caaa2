"""Events on a continuation step: where a scalar function of the solution changes sign.

After each accepted step the events are located on the step's interpolant and corrected to
equilibria.

    fold    d(parameter)/ds = 0     the path turns back
    limit   d(observable)/ds = 0    a maximum or minimum of, say, the moment
    target  parameter = value       a solution the user asked for
    branch  the index of one symmetry class changes, and it is not a fold

This module knows nothing of rods. An event that needs more than the solution, as a self-crossing
needs the shape of the curve, is a `Further` event that the caller supplies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Generic, NamedTuple, Protocol, cast

from der.continuation.bifurcations import Change, Counting, is_fold, is_stiff, merged, own_changes
from der.continuation.extrema import (
    Curve,
    Found,
    extrema,
    keeps_sense,
    of_observable,
    of_parameter,
)
from der.continuation.step import SAME, Step
from der.errors import ContinuationFailed, Reason
from der.problem import Indices, Point, S, Solution, Stability, System

_FLANK = 1e-3  # of a step: distance from a fold at which its two sides are computed


class Mark(NamedTuple):
    """A point and its place within a step."""

    s: float
    point: Point[Any]
    change: tuple[str, int] | None = None  # of a branch point: its class, and by how much


class Further(Protocol):
    """An event that is not a function of the solution alone."""

    def located(self, step: Step[Any], line: list[Mark], *, ended: bool) -> list[Mark]:
        """Return the marks of a step together with those of this event, in order."""


@dataclass(frozen=True)
class Events(Generic[S]):
    """The events of a path, and where it stops.

    Parameters
    ----------
    targets : values of the parameter at which solutions are wanted.
    spacing : solutions are also wanted at all its multiples; 0: none.
    stop : whether the path ends at a solution at one of these values; None: it never does.
    limits : observables whose extrema are wanted.
    stability : whether index and branch points are wanted; the system is then a `Stability`.
    further : events that the caller supplies.
    """

    targets: tuple[float, ...] = ()
    spacing: float = 0.0
    stop: Callable[[Solution[S]], bool] | None = None
    limits: tuple[str, ...] = ()
    stability: bool = False
    further: tuple[Further, ...] = ()

    def values_between(self, low: float, high: float) -> list[float]:
        """Values of the parameter to solve for between two, in order from ``low``."""
        least, most = min(low, high), max(low, high)
        values = {value for value in self.targets if least <= value <= most}
        if self.spacing > 0.0:
            first, last = math.floor(least / self.spacing), math.ceil(most / self.spacing)
            multiples = (k * self.spacing for k in range(first, last + 1))
            values |= {value for value in multiples if least <= value <= most}
        return sorted(values - {low}, reverse=bool(high < low))


def regular(
    system: System[S], events: Events[S], solution: Solution[S], **entries: Any
) -> Point[Any]:
    """Return a point with the index of its solution, if that is wanted."""
    if not events.stability:
        return Point(solution, **entries)
    index, stiffness = _stable(system).indices(solution.state)
    return Point(solution, index=index, stiffness=stiffness, **entries)


def _stable(system: System[S]) -> Stability[S]:
    """The system, which the caller declares to be a `Stability`."""
    return system  # type: ignore[return-value]


def located(events: Events[Any], step: Curve, here: Point[Any]) -> tuple[list[Point[Any]], bool]:
    """Return the points after ``here`` in ``step``, and whether the path ends with them.

    The index and further events need a `Step`; for the others any curve of solutions will do.
    """
    if _plain(events, step):
        return [Point(step.end)], False
    folds = _folds(step)
    marks, ended = _at_targets(events, step, folds)
    if not ended:
        marks.append(Mark(step.length, regular(step.system, events, step.end)))
    end = marks[-1].s
    marks += [Mark(s, Point(at, "fold")) for s, at in folds if s < end]
    line = sorted([Mark(0.0, here), *marks], key=lambda m: m.s)
    for name in events.limits:
        line += _limits(step, line, name)
        line.sort(key=lambda m: m.s)
    for event in events.further:
        line = event.located(cast(Step[Any], step), line, ended=ended)
    if events.stability:  # the index at further events is used, too
        line = _Stability(step.system, events, cast(Step[Any], step)).located(line)
    return [m.point for m in line[1:]], ended


def _plain(events: Events[Any], step: Curve) -> bool:
    """Whether nothing is to be looked for in a step, as its ends tell."""
    start, end, length = step.start, step.end, step.length
    return (
        not (events.stability or events.further)
        and not events.values_between(start.parameter, end.parameter)
        and keeps_sense(length, of_parameter(start), (end.parameter, float(step.end_rate[-1])))
        and all(
            keeps_sense(length, start.observables[name], end.observables[name])
            for name in events.limits
        )
    )


def _folds(step: Curve) -> list[Found]:
    """Folds of the parameter within a step, even a pair of them between tangents of equal sign."""

    def along(at: Solution[Any]) -> tuple[float, float]:
        value, rate = of_parameter(at)
        return value, float(step.end_rate[-1]) if at is step.end else rate

    return extrema(step, (0.0, step.start), (step.length, step.end), of_parameter, along)


def _at_targets(events: Events[Any], step: Curve, folds: list[Found]) -> tuple[list[Mark], bool]:
    """Solutions at the targets, in order, up to the end of the path if it is in this step."""
    cuts = [(0.0, step.start), *folds, (step.length, step.end)]
    marks: list[Mark] = []
    for (s0, a), (s1, b) in pairwise(cuts):
        for value in events.values_between(a.parameter, b.parameter):
            s, at = (s1, b) if value == b.parameter else step.at_parameter(value, s0, s1)
            if marks:  # values may lie closer than places can be told
                s = max(s, marks[-1].s)
            marks.append(Mark(s, regular(step.system, events, at)))
            if events.stop is not None and events.stop(at):
                return marks, True
    return [m for m in marks if m.s < step.length], False


def _limits(step: Curve, line: list[Mark], name: str) -> list[Mark]:
    """Extrema of an observable between the marks of a line."""
    value = of_observable(name)
    return [
        Mark(s, Point(at, "limit"))
        for a, b in pairwise(line)
        for s, at in extrema(step, (a.s, a.point.solution), (b.s, b.point.solution), value)
    ]


def _groups(step: Step[Any], marks: list[Mark]) -> Iterator[list[Mark]]:
    """Marks in order, those in one place together."""
    group: list[Mark] = []
    for m in marks:
        if group and m.s - group[-1].s >= SAME * step.length:
            yield group
            group = []
        group.append(m)
    if group:
        yield group


@dataclass(frozen=True)
class _Stability:
    """The search of one step for changes of the index."""

    system: Stability[Any]
    events: Events[Any]
    step: Step[Any]

    def located(self, line: list[Mark]) -> list[Mark]:
        """The line with branch points, the index at limits, and that on the sides of folds."""
        line = [
            m._replace(point=self._regular(m.point.solution, kind="limit"))
            if m.point.kind == "limit"
            else m
            for m in line
        ]
        folds = [m for m in line if m.point.kind == "fold"]
        flanks = [s for m in folds for s in self._beside([m], folds, line[-1].s)]
        known = [m for m in line if m.point.kind != "fold"]
        known += [Mark(s, self._regular(self.step.at(s))) for s in flanks]
        known = [m for m in known if m.point.index is not None and None not in m.point.index]
        found: list[Change] = []
        for a, b in pairwise(sorted(known, key=lambda m: m.s)):
            found += self._changes(a, b, [m for m in folds if a.s < m.s < b.s])
        # two folds within a step that its cubic does not show
        hidden = [Mark(one.s, Point(one.at, "fold")) for one in found if one.fold]
        if len(hidden) % 2:  # a smooth curve has two of them, or none
            raise ContinuationFailed(Reason.OTHER_BRANCH.value, Reason.OTHER_BRANCH)
        others = [one for one in found if not one.fold]
        branches = [
            Mark(m.s, Point(m.at, "branch", details={"symmetry": m.symmetry}), (m.symmetry, m.by))
            for m in merged(self.system, self.step, others)
        ]
        return self._with_sides([*line, *hidden, *branches])

    def _regular(self, solution: Solution[Any], **entries: Any) -> Point[Any]:
        return regular(self.system, self.events, solution, **entries)

    def _changes(self, a: Mark, b: Mark, across: list[Mark]) -> list[Change]:
        """Changes of the index of any class between two marks, with folds ``across`` them."""
        found: list[Change] = []
        for c, symmetry in enumerate(self.system.classes):
            low, high = ((m.s, (m.point.index or ())[c]) for m in (a, b))
            softest: list[tuple[float, float]] = []  # at both ends, of each part of the class
            if a.point.stiffness and b.point.stiffness:
                softest = list(zip(a.point.stiffness[c], b.point.stiffness[c], strict=True))
            beside = c == 0 and bool(across)
            if not beside and low[1] == high[1] and all(is_stiff(self.system, p) for p in softest):
                continue
            counting = Counting(self.step, self.system, symmetry)
            if beside:
                folds = [(m.s, m.point.solution) for m in across]
                if not self._returns(a, b):
                    found += counting.beside_folds((low, a.point.solution), high, folds)
                continue
            places = [low, high]
            if low[1] == high[1]:
                for part, pair in enumerate(softest):
                    places += replace(counting, part=part).between_equals(low, high, pair)
            ends = pairwise(sorted(places))
            changes = [one for low, high in ends for one in counting.changes(low, high)]
            found += [replace(one, fold=c == 0 and is_fold(self.step, one.s)) for one in changes]
        return found

    def _returns(self, a: Mark, b: Mark) -> bool:
        """Whether a branch returns to its path at a fold: its stiffness only touches zero."""
        first, last = (m.point.solution.observables[self.system.conjugate][1] for m in (a, b))
        return first * last <= 0.0

    def _beside(self, group: list[Mark], singular: list[Mark], end: float) -> tuple[float, float]:
        """Places just before and after marks, closer to them than to other singular ones."""
        apart = SAME * self.step.length
        low, high = group[0].s, group[-1].s
        last = max((m.s for m in singular if m.s < low - apart), default=0.0)
        following = min((m.s for m in singular if m.s > high + apart), default=end)
        flank = _FLANK * self.step.length
        return low - min(flank, 0.5 * (low - last)), high + min(flank, 0.5 * (following - high))

    def _with_sides(self, marks: list[Mark]) -> list[Mark]:
        """Marks in order, with the index on the two sides of singular solutions."""
        step = self.step
        line = sorted(marks, key=lambda m: m.s)
        singular = [m for m in line if m.point.kind in ("fold", "branch")]
        sided: dict[int, Mark] = {}
        groups = list(_groups(step, singular))
        while groups:
            group = groups.pop(0)
            places = [step.at(s) for s in self._beside(group, singular, line[-1].s)]
            before, after = (self._regular(at).index for at in places)
            near = groups and groups[0][0].s - group[-1].s < 2.0 * _FLANK * step.length
            if near and None in (after or ()):
                # the index midway to the next is uncertain: both are treated as one group
                groups[0] = group + groups[0]
                continue
            sides = self._shared(places[0], group, before, after)
            for m, pair in zip(group, sides, strict=True):
                sided[id(m)] = m._replace(point=replace(m.point, sides=pair))
        return [sided.get(id(m), m) for m in line]

    def _shared(
        self, start: Solution[Any], group: list[Mark], before: Indices | None, after: Indices | None
    ) -> list[tuple[Indices, Indices] | None]:
        """Index on the two sides of each of several singular solutions in one place.

        ``start``: the solution before them.
        """
        if before is None or after is None:
            return [None] * len(group)
        if len(group) == 1:
            return [(before, after)]
        classes = list(self.system.classes)
        folds = own_changes(self.system, start, [m.point.solution for m in group if not m.change])
        sides: list[tuple[Indices, Indices] | None] = []
        for m in group:
            symmetry, by = m.change or (classes[0], folds.pop(0))
            past = tuple(
                None if count is None else count + by * (name == symmetry)
                for name, count in zip(classes, before, strict=True)
            )
            sides.append((before, past))
            before = past
        return sides if before == after else [None] * len(group)
