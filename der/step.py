"""One accepted step of a path as a curve of equilibria.

Between two neighbouring states the path is approximated by a cubic in s, the projection on the
tangent at the start; the state at any s is the cubic's value, corrected orthogonally to that
tangent. All that is sought within a step is a root in s, and what is found is an equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from der.chords import chord, end_rates, onward
from der.equilibrium import (
    ADVICE,
    Control,
    Direction,
    Equilibrium,
    dot,
    equilibrium,
    moved,
)
from der.frames import Array, rotation_vector
from der.rod import State
from der.sector import Sector

ROOT = 1e-12  # of s; a fold is a double root of gamma - gamma*, so far below 1e-10 in gamma


class Stuck(RuntimeError):
    """A path that cannot go on; everything found so far has been handed out before."""


@dataclass
class Tally:
    """What the solve has cost so far."""

    newton_iterations: int = 0
    steps: int = 0
    force_evaluations: int = 0  # of dynamic relaxation


@dataclass(frozen=True)
class Step:
    """The curve between two neighbouring states, s in [0, length]."""

    piece: Sector
    start: Equilibrium
    end: Equilibrium
    length: float
    tolerance: float
    tally: Tally
    jump: Direction = field(init=False)  # from the start to the end
    end_rate: Direction = field(init=False)  # d jump/ds

    def __post_init__(self) -> None:
        a, b = self.start, self.end
        jump, t = self.between(a.state, b.state), b.tangent
        # d/ds at the end, where s is measured along the tangent at the start, and in its frames
        q, rate = end_rates(self.piece.body.mass, jump.q, a.tangent.q, a.tangent.load, t.q, t.load)
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "end_rate", Direction(q, t.force * rate, t.load * rate))

    def between(self, a: State, b: State) -> Direction:
        """The increment that leads from one state to another."""
        q = chord(self.piece.held.free, a.quat, a.stretch, b.quat, b.stretch)
        return Direction(q, b.force - a.force, b.load - a.load)

    @cached_property
    def _basis(self) -> Array:
        """Rate at the start, jump and rate at the end, each flat: (3, n b + n_c + 1)."""
        rates = (self.start.tangent, self.jump, self.end_rate)
        return np.array([np.concatenate([d.q.ravel(), d.force, [d.load]]) for d in rates])

    def _hermite(self, s: float) -> tuple[float, float, float]:
        """Weights of the rate at the start, the jump and the rate at the end at ``s``."""
        u = s / self.length
        return (
            self.length * u * (1.0 - u) ** 2,
            u * u * (3.0 - 2.0 * u),
            self.length * u * u * (u - 1.0),
        )

    def offset(self, s: float) -> Direction:
        """Cubic increment from the start to ``s``."""
        cubic = np.array(self._hermite(s)) @ self._basis
        q = self.jump.q
        return Direction(cubic[: q.size].reshape(q.shape), cubic[q.size : -1], float(cubic[-1]))

    def beyond(self, s: float) -> Direction:
        """Increment from the end to ``s`` beyond it, measured along the tangent there.

        The cubic through both states and tangents, in the frames of the end.
        """
        start, t, jump = self.start.tangent, self.end.tangent, self.jump
        q, of_end, of_start, of_jump = onward(
            self.piece.body.mass, s, jump.q, jump.load, start.q, start.load, t.q, t.load
        )
        return Direction(
            q,
            of_end * t.force + of_start * start.force + of_jump * jump.force,
            of_end * t.load + of_start * start.load + of_jump * jump.load,
        )

    @property
    def bulge(self) -> float:
        """How far the end lies beside the tangent at the start, over the length."""
        square = dot(self.piece.body, self.jump, self.jump)
        return max(square / self.length**2 - 1.0, 0.0) ** 0.5

    def at(self, s: float) -> Equilibrium:
        """The equilibrium at ``s``.

        Raises
        ------
        Stuck
            Where Newton's method fails although both ends of the step are equilibria.
        """
        if s == 0.0:
            return self.start
        if s == self.length:
            return self.end
        return self.polished(s, moved(self.piece.held, self.start.state, self.offset(s)))

    def change(
        self,
        value: Callable[[Equilibrium], float],
        low: tuple[float, Equilibrium],
        high: tuple[float, Equilibrium],
    ) -> tuple[float, Equilibrium]:
        """The place between two, and its state, where ``value`` of the state changes its sign."""
        known = dict((low, high))

        def of_place(s: float) -> float:
            if s not in known:
                known[s] = self.at(s)
            return value(known[s])

        s = root(of_place, low[0], high[0])
        return s, known[s]

    def near(self, s: float) -> State:
        """A state near the equilibrium at ``s``: the cubic with one correction, half the price."""
        found = equilibrium(
            self.piece.body,
            self.piece.held,
            moved(self.piece.held, self.start.state, self.offset(s)),
            along=self.start.tangent,
            control=Control.DIRECTION,
            tolerance=0.0,
            iterations=1,
        )
        self.tally.newton_iterations += found.iterations
        return found.state

    def at_load(self, load: float, low: float, high: float) -> tuple[float, Equilibrium]:
        """The equilibrium at ``load`` between s = low and high, where the load is monotonic."""

        def cubic(s: float) -> float:
            return self.start.state.load + self._load(s) - load

        if cubic(low) * cubic(high) < 0.0:
            s = root(cubic, low, high)
            step = self.offset(s)
            step = step._replace(load=load - self.start.state.load)
            try:
                guess = moved(self.piece.held, self.start.state, step)
                found = self.polished(s, guess, Control.LOAD)
            except Stuck:
                found = None
            if found is not None and self._near(found, s):
                # the load given, not the one that differences give, to the last bit
                found = replace(found, state=found.state.but(load=load))
                return min(max(self._place(found, s, step), low), high), found
        # close to a fold: the load is a bad coordinate there, s is not
        ends = (low, self.at(low)), (high, self.at(high))
        s, found = self.change(lambda at: at.state.load - load, *ends)
        return s, replace(found, state=found.state.but(load=load))

    def _place(self, found: Equilibrium, s: float, guess: Direction) -> float:
        """The s of a state found near ``guess`` at ``s``: where its own projection lies."""
        state = moved(self.piece.held, self.start.state, guess)
        away = self.between(state, found.state)._replace(load=0.0)
        return s + dot(self.piece.body, self.start.tangent, away)

    def _near(self, found: Equilibrium, s: float) -> bool:
        """Whether a state found at given load lies where the cubic expects it."""
        q = rotation_vector(self.start.state.quat, found.state.quat)
        q[~self.piece.held.free[:, :3]] = 0.0
        away = float(np.sum(self.piece.body.mass * (q - self.offset(s).q[:, :3]) ** 2)) ** 0.5
        return away < 0.1 * self.length and found.tangent.load * self._load_rate(s) > 0.0

    def _load(self, s: float) -> float:
        """The load of `offset`, less that of the start."""
        of_start, of_jump, of_end = self._hermite(s)
        start, end = self.start.tangent.load, self.end_rate.load
        return of_start * start + of_jump * self.jump.load + of_end * end

    def _load_rate(self, s: float) -> float:
        """Its rate, to leading order."""
        h = 1e-3 * self.length
        return self._load(s + h) - self._load(s - h)

    def as_is(self, s: float, state: State) -> Equilibrium:
        """A ``state`` at ``s`` as the equilibrium that it is to the tolerance, not moved.

        At a branch point Newton's method would move it along the mode that has no stiffness.

        Raises
        ------
        Stuck
            Where it is none and Newton's method, tried then, fails.
        """
        found = self._newton(state, Control.DIRECTION, iterations=0)
        return found if found.converged else self.polished(s, state)

    def polished(self, s: float, guess: State, control: Control = Control.DIRECTION) -> Equilibrium:
        """The equilibrium next to a ``guess`` at ``s``.

        Raises
        ------
        Stuck
            Where Newton's method fails.
        """
        found = self._newton(guess, control)
        if not found.converged:
            raise Stuck(
                f"no equilibrium within a step, at gamma = {guess.load:.6f}"
                f" (s = {s:.3g} of {self.length:.3g}): {ADVICE[found.outcome]}"
            )
        return found

    def _newton(self, guess: State, control: Control, iterations: int = 12) -> Equilibrium:
        found = equilibrium(
            self.piece.body,
            self.piece.held,
            guess,
            along=self.start.tangent,
            control=control,
            tolerance=self.tolerance,
            iterations=iterations,
        )
        self.tally.newton_iterations += found.iterations
        return found


def root(f: Callable[[float], float], low: float, high: float) -> float:
    """Root of ``f`` between two places where its signs differ (Brent)."""
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=ROOT, rtol=8.9e-16))
