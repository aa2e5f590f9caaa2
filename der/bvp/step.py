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
from der.bvp.collocation import Collocation, Direction, Solution, required
from der.bvp.gauss import Array
from der.bvp.meshes import Mesh
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
    statistics: Statistics

    @cached_property
    def jump(self) -> Direction:
        """The change of the unknowns from the start to the end."""
        return self.end.unknowns.plus(-1.0, self.start.unknowns)

    @cached_property
    def cosine(self) -> float:
        """Cosine of the angle between the tangents at both ends."""
        return dot(self.start.mesh, self.start.tangent, self.end.tangent)

    @cached_property
    def _found(self) -> dict[float, Solution]:
        """The solutions that are known, by s."""
        return {0.0: self.start, self.length: self.end}

    def _weights(self, s: float) -> tuple[float, float, float]:
        """Weights of the tangent at the start, the jump and the tangent at the end in the cubic."""
        u = s / self.length
        h10 = self.length * u * (1.0 - u) ** 2
        h01 = u * u * (3.0 - 2.0 * u)
        h11 = self.length * u * u * (u - 1.0) / self.cosine  # s is measured at the start
        return h10, h01, h11

    def _gamma(self, s: float) -> float:
        """Gamma at ``s`` by the cubic."""
        h10, h01, h11 = self._weights(s)
        bent = h10 * self.start.tangent.gamma + h11 * self.end.tangent.gamma
        return self.start.gamma + h01 * self.jump.gamma + bent

    def expected(self, s: float) -> Direction:
        """Unknowns at ``s`` by the cubic, not corrected."""
        h10, h01, h11 = self._weights(s)
        start = self.start.unknowns.plus(h10, self.start.tangent)
        return start.plus(h01, self.jump).plus(h11, self.end.tangent)

    @property
    def end_rate(self) -> Array:
        """Rate of gamma by s at the end."""
        return np.array([self.end.tangent.gamma / self.cosine])

    @property
    def angle(self) -> float:
        """Angle between the tangents at both ends [rad]."""
        return math.acos(min(1.0, max(-1.0, self.cosine)))

    @property
    def bulge(self) -> float:
        """Distance of the end from the tangent at the start, over the length."""
        square = dot(self.start.mesh, self.jump, self.jump)
        return float(max(square / self.length**2 - 1.0, 0.0) ** 0.5)

    def at(self, s: float) -> Solution:
        """Return the solution at ``s``.

        Raises
        ------
        ContinuationFailed
            Where Newton's method fails, although both ends of the step are solutions.
        """
        if s not in self._found:
            self._found[s] = self._solved(self.expected(s))
        return self._found[s]

    def at_parameter(self, gamma: float, low: float, high: float) -> tuple[float, Solution]:
        """Return the solution at a gamma that is monotonic between s = low and high."""
        if (self._gamma(low) - gamma) * (self._gamma(high) - gamma) < 0.0:
            guess = self.expected(find_root(lambda s: self._gamma(s) - gamma, low, high))
            try:
                found = self._solved(guess._replace(gamma=gamma), by_gamma=True)
            except ContinuationFailed:
                found = None
            if found is not None and self._near(found, guess):
                s = along(self.start, found.unknowns)
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

    def _near(self, found: Solution, there: Direction) -> bool:
        """Whether a solution found at given gamma is near the one that the cubic predicts."""
        away = found.unknowns.plus(-1.0, there)._replace(gamma=0.0)
        return dot(self.start.mesh, away, away) < (NEAR * self.length) ** 2

    def _solved(self, guess: Direction, *, by_gamma: bool = False) -> Solution:
        found = self.system.solved(self.start.mesh, guess, self.start.tangent, by_gamma=by_gamma)
        self.statistics.newton_iterations += found.iterations
        return required(found, f"no solution within a step, at gamma = {guess.gamma:.6f}")

    def beyond(self, length: float) -> Direction:
        """Unknowns at a distance beyond the end, measured along the tangent there."""
        guess = self.expected(self.length + length * self.cosine)
        # the cubic does not know the distance along the tangent
        return guess.plus(length - along(self.end, guess), self.end.tangent)


def dot(mesh: Mesh, a: Direction, b: Direction) -> float:
    """Mean over the rod of the product of rotations, plus that of gammas."""
    return float(np.vdot(mesh.weights * a.frames, b.frames)) + a.gamma * b.gamma


def along(start: Solution, there: Direction) -> float:
    """Distance of unknowns on the same mesh along the tangent at the start."""
    return dot(start.mesh, start.tangent, there.plus(-1.0, start.unknowns))
