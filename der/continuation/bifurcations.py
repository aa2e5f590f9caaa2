"""Bifurcations within a step: where the index of one symmetry class changes.

The stiffness of a mode that breaks the symmetry of the path vanishes at a branch point. A residual
r displaces a state along the mode by r over the stiffness, and by Koiter's law the change of the
index then appears at a distance r^(2/3). So a change is located on a chord between two states. They
are far enough from it to be accurate, and close enough for the chord to be the path to rounding.

The first class keeps the symmetry of the path. It also loses or gains one by each fold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from der.continuation.roots import ROOT
from der.continuation.step import SAME, Step
from der.problem import Indices, Solution, Stability

_CHORD = 2e-7  # of s: a residual of 1e-12 displaces its ends by 1e-5, its sagitta is below 1e-12
_NEXT = 1e-6  # of s: distance at which dparameter/dconjugate is computed; next to a branch point
# both rates lose digits, their quotient does not
_AT = 0.1  # of `_NEXT`: largest distance of its root; places have errors of at most 1e-9
_AHEAD = 1e-3  # of an interval: distance over which the rate of a stiffness is taken
_STEEPER = 1.5  # rates are taken to be so much larger than found
_HALVINGS = 4  # of a step, in the search for two changes of opposite sense
_SHRINKS = 0.75  # by a bisection: the difference of a stiffness whose root it is, by half

Place: TypeAlias = tuple[float, int | None]  # s, and the index of a class there
Found: TypeAlias = tuple[float, Solution[Any]]


@dataclass(frozen=True)
class Change:
    """A place at which the index of one class changes."""

    s: float
    at: Solution[Any]
    symmetry: str
    by: int  # how much the index changes
    fold: bool = False  # whether it is a fold


@dataclass(frozen=True)
class Counting:
    """A step on which the index of one symmetry class is counted."""

    step: Step[Any]
    system: Stability[Any]
    symmetry: str
    part: int = 0  # which of the stiffnesses of the class is looked at

    def at(self, s: float) -> Place:
        """Place ``s`` with the count there."""
        return s, self.system.count(self.step.at(s).state, self.symmetry)

    def _looked(self, state: Any) -> tuple[Indices, float]:
        count, (softest,) = self.system.indices(state, self.symmetry)
        return count, softest[self.part]

    def changes(self, low: Place, high: Place) -> list[Change]:
        """Return where the index changes between two places, by bisection."""
        if low[1] == high[1]:
            return []
        if high[0] - low[0] < _CHORD:
            return self._on_chord(low, high)
        middle = self.at(0.5 * (low[0] + high[0]))
        return [*self.changes(low, middle), *self.changes(middle, high)]

    def _on_chord(self, low: Place, high: Place) -> list[Change]:
        """The same between two places so close that the path between them is straight."""
        system, step = self.system, self.step
        ends = max(low[0] - _CHORD, 0.0), min(high[0] + _CHORD, step.length)
        a, b = (step.at(s).state for s in ends)
        jump = system.difference(a, b)

        def state(s: float) -> Any:
            return system.retract(a, (s - ends[0]) / (ends[1] - ends[0]) * jump)

        def search(low: Place, high: Place) -> list[Change]:
            if low[1] == high[1]:
                return []
            if high[0] - low[0] < 2.0 * ROOT:
                at = step.as_is(low[0], state(low[0]))
                return [Change(low[0], at, self.symmetry, _jump(low, high))]
            s = 0.5 * (low[0] + high[0])
            middle = (s, system.count(state(s), self.symmetry))
            return [*search(low, middle), *search(middle, high)]

        first, last = (
            (s, system.count(x, self.symmetry)) for s, x in zip(ends, (a, b), strict=True)
        )
        # the ends found may lie on the wrong side if they are very close to the change
        wider = _jump(first, last) == _jump(low, high)
        return search(first, last) if wider else search(low, high)

    def between_equals(
        self, low: Place, high: Place, stiffness: tuple[float, float], halvings: int = _HALVINGS
    ) -> list[Place]:
        """A place between two of equal index where the index is different, if there is one.

        Two changes of opposite sense within a step are visible at its ends only by a soft mode
        (``stiffness`` there). Only where it softens from the softer end on, and its tangent there,
        taken steeper, goes through zero, is the index computed in between. Where its signs differ
        at the ends, two modes change in opposite sense, perhaps close together: the root of the one
        is bisected as long as the difference shrinks, as it does not at a jump.
        """
        if (
            not halvings
            or is_stiff(self.system, stiffness)
            or high[0] - low[0] < SAME * self.step.length
        ):
            return []
        u = self._reaches(low[0], high[0], stiffness)
        if u is None:
            return []
        s = low[0] + u * (high[0] - low[0])
        (count,), stiff = self._looked(self.step.at(s).state)
        if count != low[1]:
            return [] if count is None else [(s, count)]
        halves = (low, (s, count), (stiffness[0], stiff)), ((s, count), high, (stiff, stiffness[1]))
        for start, end, ends in halves:
            root = ends[0] * ends[1] < 0.0 and _span(ends) < _SHRINKS * _span(stiffness)
            found = self.between_equals(start, end, ends, halvings - (not root))
            if found:
                return found
        return []

    def _reaches(self, low: float, high: float, stiffness: tuple[float, float]) -> float | None:
        """Where between two places, 0 to 1, the tangent at the softer one goes through zero."""
        first, last = stiffness
        if first * last <= 0.0:  # not of one mode
            return 0.5
        end = int(abs(last) < abs(first))
        inward = -_AHEAD if end else _AHEAD
        _, beside = self._looked(self.step.expected((low, high)[end] + inward * (high - low)))
        rise = _STEEPER * (beside - stiffness[end]) / _AHEAD
        if rise * stiffness[end] >= 0.0 or abs(rise) < abs(stiffness[end]):
            return None
        u = min(max(-stiffness[end] / rise, 0.1), 0.9)
        return 1.0 - u if end else u

    def beside_folds(
        self, low: tuple[Place, Solution[Any]], last: Place, folds: Sequence[Found]
    ) -> list[Change]:
        """Changes between two places on either side of folds, without those of the folds.

        Along a path the stiffness of the mode that is soft at a fold is -(d conjugate/ds)
        (d parameter/ds) times a positive factor, to leading order; so the change by the fold is
        known.
        """
        first, before = low
        own = sum(own_changes(self.system, before, [at for _, at in folds]))
        if _jump(first, last) == own:
            return []
        apart = SAME * self.step.length
        ends = (folds[0][0] - apart, first), (folds[-1][0] + apart, last)
        near = [end if abs(s - end[0]) < apart else self.at(s) for s, end in ends]
        rest = _jump(*near) - own
        return [
            *self.changes(first, near[0]),
            *([Change(*folds[0], self.symmetry, rest)] if rest else []),
            *self.changes(near[1], last),
        ]


def is_stiff(system: Stability[Any], stiffness: tuple[float, float]) -> bool:
    """Whether stiffnesses of one sign at two places are too large to vanish between them."""
    first, last = stiffness
    return first * last > 0.0 and abs(first) > system.soft and abs(last) > system.soft


def _span(ends: tuple[float, float]) -> float:
    return abs(ends[1] - ends[0])


def _jump(low: Place, high: Place) -> int:
    return (high[1] or 0) - (low[1] or 0)


def is_fold(step: Step[Any], s: float) -> bool:
    """Whether a change of the index at ``s`` is a fold: dparameter/dconjugate vanishes there.

    Then the null vector w has w . d(residual)/dparameter = d conjugate/ds != 0.
    """
    low, high = max(s - _NEXT, 0.0), min(s + _NEXT, step.length)
    a, b = step.at(low), step.at(high)
    rate_a, rate_b = (at.observables[step.system.conjugate][1] for at in (a, b))
    # dparameter/dconjugate at both, times the same
    first, last = a.parameter_rate * rate_b, b.parameter_rate * rate_a
    if first == last or rate_a * rate_b <= 0.0:  # a pole, as on a path that crosses another
        return False
    return abs(low - first * (high - low) / (last - first) - s) < _AT * _NEXT


def own_changes(
    system: Stability[Any], before: Solution[Any], folds: Sequence[Solution[Any]]
) -> list[int]:
    """Return the changes of the index by successive folds; ``before``: a solution before them."""
    signs, rising = [], before.parameter_rate > 0.0
    for at in folds:
        signs.append(1 if rising == (at.observables[system.conjugate][1] < 0.0) else -1)
        rising = not rising
    return signs


def merged(system: Stability[Any], step: Step[Any], found: Sequence[Change]) -> list[Change]:
    """Return the changes in order, those of one class in one place as one.

    The two modes of a pair cross zero together; rounding may separate them, or repeat a crossing.
    """
    groups: list[list[Change]] = []
    for one in sorted(found, key=lambda one: one.s):
        if groups and one.s - groups[-1][-1].s < SAME * step.length:
            groups[-1].append(one)
        else:
            groups.append([one])
    return [
        replace(same[0], s=group[0].s, at=group[0].at, by=total)
        for group in groups
        for same in ([one for one in group if one.symmetry == c] for c in system.classes)
        if (total := sum(one.by for one in same))
    ]
