"""One accepted step of a path as a curve of equilibria.

Between two neighbouring states the path is approximated by a cubic in s, the projection on the
tangent at the start; the state at any s is the cubic's value, corrected orthogonally to that
tangent. All that is sought within a step is a root in s, and what is found is an equilibrium. What
it lies off the cubic, over the u^2 (1 - u)^2 that vanishes with its rate at both ends, is kept, and
the next state in the step starts from the polynomial through all of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

from der.continuation.interpolant import Curve, between, end_rates, onward
from der.continuation.roots import brent, find_root, smooth_root
from der.rod.equilibrium import (
    ADVICE,
    Control,
    Direction,
    Equilibrium,
    Outcome,
    dot,
    equilibrium,
    moved,
)
from der.rod.gripped_ring import Sector
from der.rod.rod import State

_ASTRAY = 0.2  # of a step: states that lie farther from its curve are on another branch
_NEAR = 0.1  # of a step: the same for states at a given load
_ELSEWHERE = 1e-6  # of s: no rounding leads so far, but a mode without stiffness does


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
    _found: dict[float, Equilibrium] = field(init=False, default_factory=dict)  # at these s

    def __post_init__(self) -> None:
        a, b = self.start, self.end
        jump, t = self.between(a.state, b.state), b.tangent
        # d/ds at the end, where s is measured along the tangent at the start, and in its frames
        q, rate = end_rates(self.piece.body.mass, jump.q, a.tangent.q, a.tangent.load, t.q, t.load)
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "end_rate", Direction(q, t.force * rate, t.load * rate))

    def between(self, a: State, b: State) -> Direction:
        """The increment that leads from one state to another."""
        return between(self.piece.held, a, b)

    @cached_property
    def _curve(self) -> Curve:
        """The curve from the start to the end, through the states that were found between them."""
        return Curve(self.length, self.start.tangent, self.jump, self.end_rate)

    def expected(self, s: float) -> State:
        """The state at ``s`` as far as the curve tells, not corrected."""
        return moved(self.piece.held, self.start.state, self._curve.at(s))

    def beyond(self, s: float) -> Direction:
        """Increment from the end to ``s`` beyond it, measured along the tangent there.

        The cubic through both states and tangents, in the frames of the end.
        """
        ways = (*self.jump, *self.start.tangent, *self.end.tangent)
        return Direction(*onward(self.piece.body.mass, s, *ways))

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
            Where Newton's method fails, or leads to another branch, although both ends of the step
            are equilibria.
        """
        if s == 0.0:
            return self.start
        if s == self.length:
            return self.end
        if s not in self._found:
            expected = self.expected(s)
            found = self.polished(s, expected)
            away = self.between(expected, found.state)
            if dot(self.piece.body, away, away) > (_ASTRAY * self.length) ** 2:
                raise self._stuck(expected, s, Outcome.DIVERGED)
            self._found[s] = found
            self._keep(s, found)
        return self._found[s]

    def _keep(self, s: float, found: Equilibrium) -> None:
        """Lead the curve through a state at ``s``."""
        self._curve.keep(s, self.between(self.start.state, found.state))

    def change(
        self,
        value: Callable[[Equilibrium], float],
        low: tuple[float, Equilibrium],
        high: tuple[float, Equilibrium],
        guess: float | None = None,
    ) -> tuple[float, Equilibrium]:
        """The place between two, and its state, where ``value`` of the state changes its sign.

        ``guess``: a place close to it, where one is known.
        """
        known = dict((low, high))

        def of_place(s: float, step: Step = self) -> float:
            if s not in known:
                known[s] = step.at(s)
            return value(known[s])

        s = smooth_root(of_place, low[0], high[0], guess=guess)
        if s is None:
            # beside a branch point so good a start leaves what has no stiffness as it was: a
            # worse one, the cubic alone, costs an iteration more that moves it, too
            known = dict((low, high))
            bare = replace(self)
            s = brent(lambda s: of_place(s, bare), low[0], high[0])
        return s, known[s]

    def near(self, s: float) -> State:
        """A state near the equilibrium at ``s``: the curve with one correction, half the price."""
        found = equilibrium(
            self.piece.body,
            self.piece.held,
            self.expected(s),
            along=self.start.tangent,
            control=Control.DIRECTION,
            tolerance=0.0,
            iterations=1,
        )
        self.tally.newton_iterations += found.iterations
        return found.state

    def at_load(self, load: float, low: float, high: float) -> tuple[float, Equilibrium]:
        """The equilibrium at ``load`` between s = low and high, where the load is monotonic."""

        def expected(s: float) -> float:
            return self.start.state.load + self._curve.load(s) - load

        if expected(low) * expected(high) < 0.0:
            s = find_root(expected, low, high)
            step = self._curve.at(s)._replace(load=load - self.start.state.load)
            # the load given, not the one that differences give, to the last bit
            guess = moved(self.piece.held, self.start.state, step).but(load=load)
            try:
                found = self.polished(s, guess, Control.LOAD)
            except Stuck:
                found = None
            if found is not None and self._rises(s) * found.tangent.load > 0.0:
                away = self.between(guess, found.state)
                if dot(self.piece.body, away, away) < (_NEAR * self.length) ** 2:
                    s += dot(self.piece.body, self.start.tangent, away)  # its own projection
                    self._keep(s, found)
                    return min(max(s, low), high), found
        # close to a fold: the load is a bad coordinate there, s is not
        ends = (low, self.at(low)), (high, self.at(high))
        s, found = self.change(lambda at: at.state.load - load, *ends)
        return s, replace(found, state=found.state.but(load=load))

    def _rises(self, s: float) -> float:
        """By how much the load grows around ``s``, to leading order: the sign of its rate."""
        h = 1e-3 * self.length
        return self._curve.load(s + h) - self._curve.load(s - h)

    def as_is(self, s: float, state: State) -> Equilibrium:
        """A ``state`` at ``s`` as the equilibrium that it is to the tolerance, not moved.

        At a branch point Newton's method would move it along the mode that has no stiffness. Where
        rounding leaves more than the tolerance it is tried all the same, but not believed if it
        leads elsewhere.

        Raises
        ------
        Stuck
            Where the state is none and Newton's method, tried then, fails.
        """
        found = self._newton(state, Control.DIRECTION, iterations=0)
        if found.converged:
            return found
        moved_on = self.polished(s, state)
        away = self.between(state, moved_on.state)
        if dot(self.piece.body, away, away) < _ELSEWHERE**2:
            return moved_on
        return replace(found, outcome=Outcome.CONVERGED)

    def polished(self, s: float, guess: State, control: Control = Control.DIRECTION) -> Equilibrium:
        """The equilibrium next to a ``guess`` at ``s``.

        Raises
        ------
        Stuck
            Where Newton's method fails.
        """
        found = self._newton(guess, control)
        if not found.converged:
            raise self._stuck(guess, s, found.outcome)
        return found

    def _stuck(self, guess: State, s: float, outcome: Outcome) -> Stuck:
        return Stuck(
            f"no equilibrium within a step, at gamma = {guess.load:.6f}"
            f" (s = {s:.3g} of {self.length:.3g}): {ADVICE[outcome]}"
        )

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
