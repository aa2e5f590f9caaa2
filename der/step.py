"""One accepted step of a path as a curve of equilibria.

Between two neighbouring states the path is approximated by a cubic in s, the projection on the
tangent at the start; the state at any s is the cubic's value, corrected orthogonally to that
tangent. All that is sought within a step is a root in s, and what is found is an equilibrium.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

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
    jump: Direction = field(init=False)
    end_rate: Direction = field(init=False)
    basis: Array = field(init=False)  # (3, n b + n_c + 1) rate, jump and end rate, flat

    def __post_init__(self) -> None:
        a, b = self.start, self.end
        q = np.empty_like(a.tangent.q)
        q[:, :3] = rotation_vector(a.state.quat, b.state.quat)
        if q.shape[1] == 4:
            q[:, 3] = b.state.stretch - a.state.stretch
        q[~self.piece.held.free] = 0.0
        jump = Direction(q, b.state.force - a.state.force, b.state.load - a.state.load)
        # d/ds at the end, where s is measured along the tangent at the start
        rate = 1.0 / dot(self.piece.body, a.tangent, b.tangent)
        t = b.tangent
        end_rate = Direction(t.q * rate, t.force * rate, t.load * rate)
        flat = [
            np.concatenate([d.q.ravel(), d.force, [d.load]]) for d in (a.tangent, jump, end_rate)
        ]
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "end_rate", end_rate)
        object.__setattr__(self, "basis", np.array(flat))

    def offset(self, s: float) -> Direction:
        """Cubic increment from the start to ``s``."""
        u = s / self.length
        h10 = self.length * u * (1.0 - u) ** 2
        h01 = u * u * (3.0 - 2.0 * u)
        h11 = self.length * u * u * (u - 1.0)
        cubic = np.array([h10, h01, h11]) @ self.basis
        q = self.jump.q
        return Direction(cubic[: q.size].reshape(q.shape), cubic[q.size : -1], float(cubic[-1]))

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
        return self._solved(s, self.offset(s), Control.DIRECTION)

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
            return self.start.state.load + self.offset(s).load - load

        if cubic(low) * cubic(high) < 0.0:
            s = root(cubic, low, high)
            step = self.offset(s)
            step = step._replace(load=load - self.start.state.load)
            try:
                found = self._solved(s, step, Control.LOAD)
            except Stuck:
                found = None
            if found is not None and self._near(found, s):
                # the load given, not the one that differences give, to the last bit
                found = replace(found, state=found.state.but(load=load))
                return min(max(self._place(found, s, step), low), high), found
        # close to a fold: the load is a bad coordinate there, s is not
        s = root(lambda t: self.at(t).state.load - load, low, high)
        found = self.at(s)
        return s, replace(found, state=found.state.but(load=load))

    def _place(self, found: Equilibrium, s: float, guess: Direction) -> float:
        """The s of a state found near ``guess`` at ``s``: where its own projection lies."""
        state = moved(self.piece.held, self.start.state, guess)
        q = np.zeros_like(self.jump.q)
        q[:, :3] = rotation_vector(state.quat, found.state.quat)
        if q.shape[1] == 4:
            q[:, 3] = found.state.stretch - state.stretch
        q[~self.piece.held.free] = 0.0
        return s + dot(self.piece.body, self.start.tangent, Direction(q, guess.force, 0.0))

    def _near(self, found: Equilibrium, s: float) -> bool:
        """Whether a state found at given load lies where the cubic expects it."""
        q = rotation_vector(self.start.state.quat, found.state.quat)
        q[~self.piece.held.free[:, :3]] = 0.0
        away = float(np.sum(self.piece.body.mass * (q - self.offset(s).q[:, :3]) ** 2)) ** 0.5
        return away < 0.1 * self.length and found.tangent.load * self._load_rate(s) > 0.0

    def _load_rate(self, s: float) -> float:
        h = 1e-3 * self.length
        return self.offset(s + h).load - self.offset(s - h).load

    def _solved(self, s: float, step: Direction, control: Control) -> Equilibrium:
        found = equilibrium(
            self.piece.body,
            self.piece.held,
            moved(self.piece.held, self.start.state, step),
            along=self.start.tangent,
            control=control,
            tolerance=self.tolerance,
        )
        self.tally.newton_iterations += found.iterations
        if not found.converged:
            raise Stuck(
                f"no equilibrium within a step, at gamma = {self.start.state.load + step.load:.6f}"
                f" (s = {s:.3g} of {self.length:.3g}): {ADVICE[found.outcome]}"
            )
        return found


def root(f: Callable[[float], float], low: float, high: float) -> float:
    """Root of ``f`` between two places where its signs differ (Brent)."""
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=ROOT, rtol=8.9e-16))
