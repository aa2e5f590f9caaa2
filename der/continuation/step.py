"""One accepted step of a path as a curve of equilibria.

Between two neighbouring solutions the path is approximated by a cubic in s, the projection on the
tangent at the start. The solution at any s is the cubic's value, corrected orthogonally to that
tangent. An event within a step is a root in s, and its solution is an equilibrium. The distance of
the solution from the cubic is kept, over u^2 (1 - u)^2, which vanishes with its rate at both ends.
The next solution in the step starts from the polynomial through all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Generic

import numpy as np

from der.continuation.interpolant import Interpolant, combined
from der.continuation.roots import brent, find_root, smooth_root
from der.errors import ContinuationFailed, Reason
from der.problem import PARAMETER, PLANE, Increment, S, Solution, Statistics, System

SAME = 1e-6  # of a step: singular solutions that lie closer are one solution
_ASTRAY = 0.2  # of a step: solutions that lie farther from its curve are on another branch
_NEAR = 0.1  # of a step: the same for solutions at a given parameter
_ELSEWHERE = 1e-6  # of s: larger than rounding errors, but not than motions of a zero mode


@dataclass(frozen=True)
class Step(Generic[S]):
    """The curve between two neighbouring solutions, s in [0, length]."""

    system: System[S]
    start: Solution[S]
    end: Solution[S]
    length: float
    tolerance: float
    statistics: Statistics
    jump: Increment = field(init=False)  # from the start to the end
    end_rate: Increment = field(init=False)  # d jump/ds at the end, in the chart of the start
    _found: dict[float, Solution[S]] = field(init=False, default_factory=dict)  # at these s

    def __post_init__(self) -> None:
        jump = self.system.difference(self.start.state, self.end.state)
        rate = self.system.transport(jump, self.end.tangent)
        # s is measured along the tangent at the start
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "end_rate", rate / self.system.inner(self.start.tangent, rate))

    @cached_property
    def _curve(self) -> Interpolant:
        """The curve from the start to the end, through the solutions found between them."""
        return Interpolant(self.length, self.start.tangent, self.jump, self.end_rate)

    def expected(self, s: float) -> S:
        """State at ``s`` by the interpolant, not corrected."""
        return self.system.retract(self.start.state, self._curve.at(s))

    def beyond(self, s: float) -> Increment:
        """Increment from the end to ``s`` beyond it, measured along the tangent there.

        By the cubic through both solutions and tangents, in the chart of the end.
        """
        inner, jump, t = self.system.inner, self.jump, self.end.tangent
        first = self.system.transport(-jump, self.start.tangent)
        u = s / inner(t, jump)
        of_start = s * u * (1.0 + u) / inner(t, first)
        of_end, of_jump = s * (1.0 + u) ** 2, -u * u * (3.0 + 2.0 * u)
        increment = np.empty_like(t)
        combined(of_end, t, of_start, first, of_jump, jump, increment)
        return increment

    @property
    def bulge(self) -> float:
        """Distance of the end from the tangent at the start, over the length."""
        square = self.system.inner(self.jump, self.jump)
        return max(square / self.length**2 - 1.0, 0.0) ** 0.5

    def at(self, s: float) -> Solution[S]:
        """Return the equilibrium at ``s``.

        Raises
        ------
        ContinuationFailed
            If Newton's method fails, or converges to another branch.
        """
        if s == 0.0:
            return self.start
        if s == self.length:
            return self.end
        if s not in self._found:
            expected = self.expected(s)
            found = self.polished(s, expected)
            away = self.system.difference(expected, found.state)
            if self.system.inner(away, away) > (_ASTRAY * self.length) ** 2:
                raise self._failed(s, replace(found, reason=Reason.DIVERGED, detail=""))
            self._found[s] = found
            self._keep(s, found)
        return self._found[s]

    def _keep(self, s: float, found: Solution[S]) -> None:
        """Make the curve pass through a solution at ``s``."""
        self._curve.keep(s, self.system.difference(self.start.state, found.state))

    def change(
        self,
        value: Callable[[Solution[S]], float],
        low: tuple[float, Solution[S]],
        high: tuple[float, Solution[S]],
        guess: float | None = None,
    ) -> tuple[float, Solution[S]]:
        """Return the place between two, and its solution, where ``value`` changes its sign.

        ``guess``: a place close to it, if one is known.
        """
        known = dict((low, high))

        def of_place(s: float, step: Step[S] = self) -> float:
            if s not in known:
                known[s] = step.at(s)
            return value(known[s])

        s = smooth_root(of_place, low[0], high[0], guess=guess)
        if s is None:
            # Close to a branch point the interpolant is so good a guess that Newton's method does
            # not correct a mode without stiffness. With the cubic alone one more iteration does.
            known = dict((low, high))
            bare = replace(self)
            s = brent(lambda s: of_place(s, bare), low[0], high[0])
        return s, known[s]

    def near(self, s: float) -> S:
        """State near the equilibrium at ``s``: the interpolant with one correction."""
        return self._newton(self.expected(s), tolerance=0.0, iterations=1).state

    def at_parameter(self, value: float, low: float, high: float) -> tuple[float, Solution[S]]:
        """Return the equilibrium at a parameter that is monotonic between s = low and high."""

        def expected(s: float) -> float:
            return self._parameter(s) - value

        if expected(low) * expected(high) < 0.0:
            s = find_root(expected, low, high)
            guess = self.expected(s)
            found = self._newton(guess, PARAMETER, value)
            if found.converged and self._rises(s) * found.parameter_rate > 0.0:
                away = self.system.difference(guess, found.state)
                away[-1] = 0.0  # the root is exact; what is left of it is rounding
                if self.system.inner(away, away) < (_NEAR * self.length) ** 2:
                    s += self.system.inner(self.start.tangent, away)  # its own projection
                    self._keep(s, found)
                    return min(max(s, low), high), found
        # close to a fold the parameter is a bad coordinate, s is not
        ends = (low, self.at(low)), (high, self.at(high))
        s, found = self.change(lambda at: at.parameter - value, *ends)
        return s, replace(found, parameter=value)

    def _parameter(self, s: float) -> float:
        """Parameter at ``s`` by the interpolant."""
        return self.start.parameter + float(self._curve.at(s)[-1])

    def _rises(self, s: float) -> float:
        """By how much the parameter grows around ``s``, to leading order: the sign of its rate."""
        h = 1e-3 * self.length
        return self._parameter(s + h) - self._parameter(s - h)

    def as_is(self, s: float, state: S) -> Solution[S]:
        """Return a ``state`` at ``s``, an equilibrium to the tolerance, without moving it.

        At a branch point Newton's method would move it along the mode without stiffness. If its
        residual is above the tolerance, Newton's method is tried; the result is used only if it is
        close.

        Raises
        ------
        ContinuationFailed
            If the state is no equilibrium and Newton's method fails.
        """
        found = self._newton(state, iterations=0)
        if found.converged:
            return found
        moved_on = self.polished(s, state)
        away = self.system.difference(state, moved_on.state)
        if self.system.inner(away, away) < _ELSEWHERE**2:
            return moved_on
        return replace(found, reason=Reason.CONVERGED)

    def polished(self, s: float, guess: S) -> Solution[S]:
        """Return the equilibrium next to a ``guess`` at ``s``.

        Raises
        ------
        ContinuationFailed
            If Newton's method fails.
        """
        found = self._newton(guess)
        if not found.converged:
            raise self._failed(s, found)
        return found

    def _failed(self, s: float, found: Solution[S]) -> ContinuationFailed:
        place = f"{self.system.parameter_name} = {self._parameter(s):.6f}"
        return ContinuationFailed(
            f"no equilibrium within a step, at {place} (s = {s:.3g} of {self.length:.3g}):"
            f" {found.reason.value}",
            found.reason,
        )

    def _newton(
        self,
        guess: S,
        hold: str = PLANE,
        value: float | None = None,
        iterations: int = 12,
        tolerance: float | None = None,
    ) -> Solution[S]:
        found = self.system.correct(
            guess,
            along=self.start.tangent,
            hold=hold,
            value=value,
            tolerance=self.tolerance if tolerance is None else tolerance,
            iterations=iterations,
        )
        self.statistics.newton_iterations += found.iterations
        return found


def between(
    system: System[S], a: Solution[S], b: Solution[S], *, tolerance: float, statistics: Statistics
) -> Step[S]:
    """Return the step between two neighbouring solutions, s measured along the first's tangent."""
    step = Step(system, a, b, 1.0, tolerance, statistics)
    return replace(step, length=system.inner(a.tangent, step.jump))
