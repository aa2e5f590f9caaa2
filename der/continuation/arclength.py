"""Follow a path of equilibria through its folds, by pseudo-arclength (Riks, Keller).

The predictor is the cubic through the last two solutions (`Step.beyond`); steps are as long as the
angle between tangents allows. The norm is the system's own, and does not depend on its mesh.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic

from der.continuation.events import Events, located, regular
from der.continuation.step import Step, between
from der.errors import ContinuationFailed, Reason
from der.problem import PLANE, Increment, Options, Point, S, Solution, Statistics, System

_STRAIGHT = 0.01  # bulge of a piece of a step that may have a branch point within it
_EASY = 4  # Newton iterations; a step that takes more is followed by a shorter one


def follow(
    system: System[S],
    start: S,
    events: Events[S] | None = None,
    *,
    along: Increment | None = None,
    options: Options | None = None,
    statistics: Statistics | None = None,
) -> Iterator[Point[Any]]:
    """Yield the points of the path through a state, events included in path order.

    Parameters
    ----------
    start : near an equilibrium, at the parameter where the path begins.
    events : the events to locate, and where the path stops.
    along : direction of the first step; default: that of a growing parameter.
    options : steps and tolerances.
    statistics : increased in each step.

    Raises
    ------
    ValueError
        For limits of an observable that the system does not have.
    ContinuationFailed
        If the path cannot be continued, after all points found have been yielded.
    """
    path = _Path(system, events or Events(), options or Options(), statistics or Statistics())
    yield from path.points(path.begun(start, along))


@dataclass(frozen=True)
class _Path(Generic[S]):
    """The settings of one path."""

    system: System[S]
    events: Events[S]
    options: Options
    statistics: Statistics

    def begun(self, start: S, along: Increment | None) -> Solution[S]:
        """The equilibrium at the start."""
        at = self.system.correct(start, along=along, tolerance=self.options.tolerance)
        self.statistics.newton_iterations += at.iterations
        if not at.converged:
            raise ContinuationFailed(
                f"the start, {self._place(at)}, is no equilibrium: {at.advice}", Reason.NO_START
            )
        unknown = [name for name in self.events.limits if name not in at.observables]
        if unknown:
            known = ", ".join(at.observables)
            raise ValueError(f"limits must be observables ({known}), got {unknown[0]!r}")
        return at

    def points(self, start: Solution[S]) -> Iterator[Point[Any]]:
        """Points from the start."""
        options = self.options
        here = regular(self.system, self.events, start)
        yield here
        before: Step[S] | None = None
        length = options.first_step
        while True:
            if self.statistics.steps >= options.max_steps:
                raise ContinuationFailed(
                    f"the path has not ended after {self.statistics.steps} steps",
                    Reason.TOO_MANY_STEPS,
                )
            step = self._advance(here.solution, before, length)
            try:
                found, ended = located(self.events, step, here)
            except ContinuationFailed:
                # both ends are equilibria, but not of one smooth curve: repeat the step shorter
                if step.length < 4.0 * options.smallest_step:
                    raise
                length = 0.25 * step.length
                continue
            self.statistics.steps += 1
            before = step
            yield from found
            here = found[-1]
            if ended:
                return
            length = self._next_length(step)

    def _next_length(self, step: Step[S]) -> float:
        """Length of the next step, by how far the tangent has turned and Newton had to iterate."""
        turn = max(self._angle(step.start, step.end), 1e-3)
        ease = math.sqrt(self.options.aimed_turn / turn)
        if step.end.iterations > _EASY:
            ease = min(ease, 0.7)
        return min(step.length * min(max(ease, 0.5), 2.0), self.options.largest_step)

    def _angle(self, a: Solution[S], b: Solution[S]) -> float:
        """Angle between the tangents at two solutions [rad]."""
        return math.acos(min(1.0, max(-1.0, self.system.inner(a.tangent, b.tangent))))

    def _advance(self, start: Solution[S], before: Step[S] | None, length: float) -> Step[S]:
        """One accepted step of about ``length``, shortened until Newton's method follows."""
        options, reason, end = self.options, Reason.TOO_SHARP, start
        length = max(length, 2.0 * options.smallest_step)
        while length > options.smallest_step:
            guess = length * start.tangent if before is None else before.beyond(length)
            end = self.system.correct(
                self.system.retract(start.state, guess),
                along=start.tangent,
                hold=PLANE,
                tolerance=options.tolerance,
                iterations=7,
            )
            self.statistics.newton_iterations += end.iterations
            reason = end.reason
            if end.converged:
                reason = Reason.TOO_SHARP
                if self._angle(start, end) < options.sharpest_turn:
                    step = Step(self.system, start, end, length, options.tolerance, self.statistics)
                    if self._one_curve(step):
                        return step
                    reason = Reason.OTHER_BRANCH
            length *= 0.5
        advice = reason.value if end.converged else end.advice
        raise ContinuationFailed(f"no step forward from {self._place(start)}: {advice}", reason)

    def _one_curve(self, step: Step[S]) -> bool:
        """Whether the ends of a step lie on one branch.

        Where their orientations differ, the change is bisected on the step's curve, until the piece
        around it is straight. A step that leads to another branch has a corner there.
        """
        low, high = (0.0, step.start), (step.length, step.end)
        piece = step
        while _orientation(low[1]) != _orientation(high[1]) and piece.bulge >= _STRAIGHT:
            s = 0.5 * (low[0] + high[0])
            if high[0] - low[0] < self.options.smallest_step:
                return False
            try:
                middle = s, step.at(s)
            except ContinuationFailed:
                return False
            if _orientation(middle[1]) == _orientation(low[1]):
                low = middle
            else:
                high = middle
            piece = between(
                self.system,
                low[1],
                high[1],
                tolerance=self.options.tolerance,
                statistics=self.statistics,
            )
        return True

    def _place(self, at: Solution[S]) -> str:
        return f"{self.system.parameter_name} = {at.parameter:.8f}"


def _orientation(at: Solution[S]) -> bool:
    """Orientation of a path. A fold changes the sign of the rate and the index, so it keeps it.

    The determinant of the augmented matrix vanishes along a path only at branch points (Keller).
    Elsewhere two solutions of unequal sign lie on two branches.
    """
    return ((at.index or 0) % 2 == 0) == (at.parameter_rate > 0.0)
