"""One accepted step of a boundary-value path: the curve between two solutions on one mesh.

Between two neighbouring solutions the path is approximated by a cubic in s, the projection on the
tangent at the start; the solution at any s is the cubic's value, corrected orthogonally to that
tangent. The norm is the mean square of rotations along the rod, plus gamma's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from der import problem
from der.bvp.collocation import CLOSE, REASONS, Collocation, Solution, room, solution_of
from der.bvp.corrector import CONVERGED
from der.bvp.gauss import Array
from der.bvp.march import States, between
from der.continuation.roots import find_root
from der.errors import ContinuationFailed

NEAR = 0.1  # of a step: solutions at a given gamma that lie farther from the cubic are others


@dataclass
class Statistics(problem.Statistics):
    """What a solve has cost so far."""

    intervals: int = 0  # of all steps, those to be repeated included


@dataclass(frozen=True, eq=False)
class Step:
    """The curve between two solutions on one mesh, s in [0, length]."""

    system: Collocation
    start: Solution
    end: Solution
    length: float
    cosine: float  # of the angle between the tangents at both ends
    states: States
    k: int  # of the end, among the states
    statistics: Statistics

    @cached_property
    def _found(self) -> dict[float, Solution]:
        """The solutions that are known, by s."""
        return {0.0: self.start, self.length: self.end}

    @property
    def end_rate(self) -> Array:
        """Rate of gamma by s at the end."""
        return np.array([self.end.tangent.gamma / self.cosine])

    def at(self, s: float) -> Solution:
        """Return the solution at ``s``.

        Raises
        ------
        ContinuationFailed
            Where Newton's method fails, although both ends of the step are solutions.
        """
        if s not in self._found:
            self._found[s] = self._solved(s, s)[0]
        return self._found[s]

    def at_parameter(self, gamma: float, low: float, high: float) -> tuple[float, Solution]:
        """Return the solution at a gamma that is monotonic between s = low and high."""
        try:
            found, s, away = self._solved(low, high, gamma)
        except ContinuationFailed:
            away = math.inf
        if away < NEAR * self.length:
            return s, self._found.setdefault(s, found)
        # close to a fold gamma is a bad coordinate, but s is a good one
        ends = (low, self.at(low)), (high, self.at(high))
        s, found = self.change(lambda at: at.gamma - gamma, *ends)
        return s, found._replace(gamma=gamma)

    def change(
        self,
        value: Callable[[Solution], float],
        low: tuple[float, Solution],
        high: tuple[float, Solution],
        guess: float | None = None,
    ) -> tuple[float, Solution]:
        """Return the place between two, and its solution, where ``value`` changes its sign.

        ``guess``: a place close to it, where one is known.
        """
        self._found.update((low, high))
        s = find_root(lambda s: value(self.at(s)), low[0], high[0], guess=guess)
        return s, self.at(s)

    def _solved(
        self, low: float, high: float, gamma: float | None = None
    ) -> tuple[Solution, float, float]:
        """The solution beside the cubic, its s, and its distance from the cubic; see `between`."""
        mesh, state = self.start.mesh, room(self.start.mesh, len(self.start.p))
        asked = mesh.h, mesh.rest, self.k, low, high, gamma or 0.0, gamma is not None, CLOSE
        status, s, away = between(*self.system.sector.piece, *asked, *self.states, *state)
        if status != CONVERGED:
            reason, place = REASONS[status], self.start.gamma
            message = f"no solution within the step from gamma = {place:.6f}: {reason.value}"
            raise ContinuationFailed(message, reason)
        found = solution_of(mesh, state)
        self.statistics.newton_iterations += found.iterations
        return found, s, away
