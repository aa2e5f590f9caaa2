"""Where the index of a symmetry class changes within a step, and what such a change is.

A mode that breaks the symmetry of the path is resisted by its stiffness alone, which vanishes at a
branch point: a residual r displaces a state by r over the stiffness along it, and by Koiter's law
the change of the index then shows r^(2/3) away. So a change is sought on a chord between two states
far enough from it to be clean, and short enough to be the path to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from der.continuation.roots import ROOT
from der.continuation.step import Step
from der.rod.equilibrium import Direction, Equilibrium, moved
from der.rod.rod import State
from der.rod.stability import raw_index

SAME = 1e-6  # of a step: singular states that lie closer are one state
_CHORD = 2e-7  # of s: a residual of 1e-12 displaces its ends by 1e-5, its sagitta is below 1e-12
_NEXT = 1e-6  # of s: from here the root of dgamma/dM is looked at; next to a branch point both
# rates lose digits, their quotient does not
_AT = 0.1  # of `_NEXT`: how far off that root may be; places err by 1e-9 at most

Place = tuple[float, int | None]  # s, and the index of a class there


@dataclass(frozen=True)
class Change:
    """A place at which the index of one class changes."""

    s: float
    at: Equilibrium
    c: int  # which class
    by: int  # how much the index changes


def changes(step: Step, c: int, low: Place, high: Place) -> list[Change]:
    """Where the index of class ``c`` changes between two places, by bisection."""
    if low[1] == high[1]:
        return []
    if high[0] - low[0] < _CHORD:
        return _on_chord(step, c, low, high)
    s = 0.5 * (low[0] + high[0])
    middle = (s, _raw(step, c, step.at(s).state))
    return [*changes(step, c, low, middle), *changes(step, c, middle, high)]


def _raw(step: Step, c: int, state: State) -> int:
    _, modes = list(step.piece.classes.values())[c]
    return raw_index(step.piece.body, step.piece.held, modes, state)


def _on_chord(step: Step, c: int, low: Place, high: Place) -> list[Change]:
    """The same between two places so near that the path between them is straight."""
    ends = max(low[0] - _CHORD, 0.0), min(high[0] + _CHORD, step.length)
    a, b = (step.at(s).state for s in ends)

    def state(s: float) -> State:
        jump, u = step.between(a, b), (s - ends[0]) / (ends[1] - ends[0])
        part = Direction(u * jump.q, u * jump.force, u * jump.load)
        return moved(step.piece.held, a, part)

    def search(low: Place, high: Place) -> list[Change]:
        if low[1] == high[1]:
            return []
        if high[0] - low[0] < 2.0 * ROOT:
            at = step.as_is(low[0], state(low[0]))
            return [Change(low[0], at, c, (high[1] or 0) - (low[1] or 0))]
        s = 0.5 * (low[0] + high[0])
        middle = (s, _raw(step, c, state(s)))
        return [*search(low, middle), *search(middle, high)]

    wide: list[Place] = [(s, _raw(step, c, x)) for s, x in zip(ends, (a, b), strict=True)]
    # the ends that were found may lie on the wrong side, if by chance they are very near
    if (wide[1][1] or 0) - (wide[0][1] or 0) == (high[1] or 0) - (low[1] or 0):
        low, high = wide
    return search(low, high)


def is_fold(step: Step, s: float) -> bool:
    """Whether a change of the index at ``s`` is a fold: dgamma/dM vanishes there, and not beside.

    Then the null vector w has w . d(grad)/dgamma = dM/ds != 0.
    """
    low, high = max(s - _NEXT, 0.0), min(s + _NEXT, step.length)
    a, b = step.at(low), step.at(high)
    # dgamma/dM at both, times the same
    first, last = a.tangent.load * b.moment_rate, b.tangent.load * a.moment_rate
    if first == last:
        return False
    return abs(low - first * (high - low) / (last - first) - s) < _AT * _NEXT


def beside_folds(
    step: Step,
    low: tuple[Place, Equilibrium],
    high: tuple[Place, Equilibrium],
    folds: Sequence[tuple[float, Equilibrium]],
) -> list[Change]:
    """Changes of the first class between two places on either side of folds, but for their own.

    Along a path the stiffness of the mode that a fold makes soft is - dM/ds dgamma/ds times
    something positive, to leading order; so the fold's own change is known.
    """
    (first, a), (last, b) = low, high
    own = sum(own_changes(a, [at for _, at in folds]))
    if a.moment_rate * b.moment_rate <= 0.0 or (last[1] or 0) - (first[1] or 0) == own:
        return []  # in the first case a branch returns to its path: its mode just touches zero
    apart = SAME * step.length
    before, after = (folds[0][0] - apart, first), (folds[-1][0] + apart, last)
    near: list[Place] = [
        end if abs(s - end[0]) < apart else (s, _raw(step, 0, step.at(s).state))
        for s, end in (before, after)
    ]
    rest = (near[1][1] or 0) - (near[0][1] or 0) - own
    return [
        *changes(step, 0, first, near[0]),
        *([Change(*folds[0], 0, rest)] if rest else []),
        *changes(step, 0, near[1], last),
    ]


def own_changes(before: Equilibrium, folds: Sequence[Equilibrium]) -> list[int]:
    """By how much each of some folds in a row changes the index; ``before``: a state before."""
    signs, rising = [], before.tangent.load > 0.0
    for at in folds:
        signs.append(1 if rising == (at.moment_rate < 0.0) else -1)
        rising = not rising
    return signs


def merged(step: Step, found: Sequence[Change]) -> list[Change]:
    """Changes in order, those of one class in one place as one, several classes in their order.

    The two modes of a pair cross zero together; to rounding the one does before the other, or to
    and fro.
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
        for same in ([one for one in group if one.c == c] for c in sorted({o.c for o in group}))
        if (total := sum(one.by for one in same))
    ]
