"""One accepted step of a path as a curve of equilibria.

Between two neighbouring states the path is approximated by a cubic in s, the projection on the
tangent at the start; the state at any s is the cubic's value, corrected orthogonally to that
tangent. All that is sought within a step is a root in s, and what is found is an equilibrium. What
it lies off the cubic, over the u^2 (1 - u)^2 that vanishes with its rate at both ends, is kept, and
the next state in the step starts from the polynomial through all of them.
"""

from __future__ import annotations

import math
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
    Outcome,
    dot,
    equilibrium,
    moved,
)
from der.frames import Array, rotation_vector
from der.rod import State
from der.sector import Sector

ROOT = 1e-12  # of s; a fold is a double root of gamma - gamma*, so far below 1e-10 in gamma
_ASTRAY = 0.2  # of a step: states that lie farther from its curve are on another branch
_ELSEWHERE = 1e-6  # of s: no rounding leads so far, but a mode without stiffness does
_LAST = 1e-9  # of s: a correction this small leaves the next one, its square, below `ROOT`
_GAIN = 0.5  # of a value: a round that leaves more of it is one that Brent's method does better
_APART = 0.1  # of a step: states that lie closer would tell more of rounding than of the path
_MOST = 3  # states kept to interpolate between


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
    _off: list[tuple[float, Array]] = field(init=False, default_factory=list)  # u, off the cubic

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
        return np.array([_flat(d) for d in (self.start.tangent, self.jump, self.end_rate)])

    def _hermite(self, s: float) -> tuple[float, float, float]:
        """Weights of the rate at the start, the jump and the rate at the end at ``s``."""
        u = s / self.length
        return (
            self.length * u * (1.0 - u) ** 2,
            u * u * (3.0 - 2.0 * u),
            self.length * u * u * (u - 1.0),
        )

    def offset(self, s: float) -> Direction:
        """Increment from the start to ``s``: the cubic, and what is known to lie off it."""
        away = np.array(self._hermite(s)) @ self._basis
        for weight, off in self._weights(s):
            away += weight * off
        q = self.jump.q
        return Direction(away[: q.size].reshape(q.shape), away[q.size : -1], float(away[-1]))

    def _weights(self, s: float) -> list[tuple[float, Array]]:
        """What lies off the cubic, by state, and its weights at ``s`` (Lagrange)."""
        u = s / self.length
        bump = (u * (1.0 - u)) ** 2
        weights = []
        for one, off in self._off:
            weight = bump
            for other, _ in self._off:
                if other != one:
                    weight *= (u - other) / (one - other)
            weights.append((weight, off))
        return weights

    def _keep(self, s: float, state: State) -> None:
        """Keep what an equilibrium at ``s`` lies off the cubic, where that says something new."""
        u = s / self.length
        places = (0.0, *(place for place, _ in self._off), 1.0)
        if len(self._off) < _MOST and min(abs(u - place) for place in places) >= _APART:
            off = _flat(self.between(self.start.state, state))
            off -= np.array(self._hermite(s)) @ self._basis
            self._off.append((u, off / (u * (1.0 - u)) ** 2))

    def expected(self, s: float) -> State:
        """The state at ``s`` as far as the curve tells, not corrected."""
        return moved(self.piece.held, self.start.state, self.offset(s))

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
            self._keep(s, found.state)
        return self._found[s]

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
            return self.start.state.load + self._load(s) - load

        if expected(low) * expected(high) < 0.0:
            s = root(expected, low, high)
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
                s = self._place(found, s, step)
                self._keep(s, found.state)
                return min(max(s, low), high), found
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
        load = of_start * start + of_jump * self.jump.load + of_end * end
        return load + sum(float(weight * off[-1]) for weight, off in self._weights(s))

    def _load_rate(self, s: float) -> float:
        """Its rate, to leading order."""
        h = 1e-3 * self.length
        return self._load(s + h) - self._load(s - h)

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


def _flat(d: Direction) -> Array:
    """A direction as one row."""
    return np.concatenate([d.q.ravel(), d.force, [d.load]])


def root(f: Callable[[float], float], low: float, high: float, within: float = ROOT) -> float:
    """Root of ``f`` between two places where its signs differ, to ``within``."""
    s = smooth_root(f, low, high, within)
    return brent(f, low, high, within) if s is None else s


def brent(f: Callable[[float], float], low: float, high: float, within: float = ROOT) -> float:
    """`root` by Brent's method."""
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=within, rtol=8.9e-16))


def smooth_root(
    f: Callable[[float], float],
    low: float,
    high: float,
    within: float = ROOT,
    *,
    guess: float | None = None,
) -> float | None:
    """`root` by inverse interpolation through four places; None where ``f`` is not that smooth.

    It takes half as many places as Brent's method; the root is the last of them.

    Parameters
    ----------
    guess : the first place to look at.
    """
    known = [(f(low), low), (f(high), high)]
    for value, s in known:
        if value == 0.0:
            return s
    sides = {value > 0.0: s for value, s in known}  # the root lies between these two
    following, last, least = guess, math.inf, math.inf
    while True:
        s = _interpolated(known[-4:]) if following is None else following
        if not min(sides.values()) < s < max(sides.values()):
            return None
        value = f(s)
        if value == 0.0 or (abs(s - last) < max(within, _LAST) and abs(value) <= least):
            return s  # a value that grows there is one beyond a jump
        sides[value > 0.0] = s
        if not abs(value) <= _GAIN * least:
            return None
        known.append((value, s))
        following, last, least = None, s, abs(value)


def _interpolated(known: list[tuple[float, float]]) -> float:
    """Where the polynomial s(value) through some values and places is at 0; NaN if there is none.

    Neville's scheme.
    """
    column = [s for _, s in known]
    for k in range(1, len(known)):
        for j in range(len(known) - k):
            low, high = known[j][0], known[j + k][0]
            if low == high:
                return math.nan
            column[j] = (high * column[j] - low * column[j + 1]) / (high - low)
    return column[0]
