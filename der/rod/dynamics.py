"""Motion in time until a rod comes to rest, overdamped or with inertia, by implicit steps.

    flow    M dq/dt = -grad U - B force                       as in a viscous fluid
    swing   M (d2q/dt2 + damping dq/dt) = -grad U - B force   lightly damped

The mass of each edge is its length: a mode of eigenvalue mu (`stability.softest_modes`) decays as
exp(-mu t), or has the frequency sqrt(mu). Both motions share one loop around `implicit_step.step`
and differ in the rule of integration. The flow uses implicit Euler steps. They are stable at any
length, and the last ones are Newton's method. The swing uses the generalised-alpha method on the
rotation group (Chung and Hulbert 1993; Arnold and Bruels 2007), of second order, which damps
frequencies that the steps do not resolve. The conditions on positions are part of each step, so
there is no drift. The length of a step follows from its error (for the swing: Zienkiewicz and Xie
1991).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from der.errors import Reason
from der.kernels.quaternions import Array
from der.problem import Increment
from der.rod.implicit_step import Inertia, Stepped, on_the_conditions, step, weights
from der.rod.relaxation import MotionEnd, Rest
from der.rod.rod import State
from der.rod.system import RodSystem

_SHORTEST = 1e-12  # of time; a step this short that fails will fail at any length
_LONGEST = 1e9  # beyond, a step is Newton's method
_GROWTH = (0.2, 3.0)  # of a step's length from one to the next
_SAFE = 0.9  # of the length that the error allows
_RADIUS = 0.8  # spectral radius at infinite frequency: 1 keeps all energy, 0 damps at once
_ALPHA_M = (2.0 * _RADIUS - 1.0) / (_RADIUS + 1.0)
_ALPHA_F = _RADIUS / (_RADIUS + 1.0)
_GAMMA = 0.5 + _ALPHA_F - _ALPHA_M
_BETA = 0.25 * (_GAMMA + 0.5) ** 2


@dataclass(frozen=True)
class EndState(MotionEnd):
    """End of a motion in time."""

    steps: int
    factorisations: int  # of rejected steps, too
    time: float  # the unit follows from the masses, see above
    times: Array  # (len(history),)


@dataclass(frozen=True)
class _Overdamped:
    """The implicit Euler step of a gradient flow."""

    mass: Array  # (n b + 1,)
    rate: Array  # of the last step
    order: int = 2  # power of a step's length with which its error grows
    kinetic: float = 0.0  # kinetic energy

    def ahead(self, dt: float) -> Array:
        """Displacement (n b + 1,) expected over a step."""
        return dt * self.rate

    def terms(self, dt: float) -> tuple[Array, float]:
        """``known`` and ``shift`` of the implicit step."""
        return np.zeros(len(self.mass)), 1.0 / dt

    def after(self, w: Array, dt: float) -> _Overdamped:
        """The rates after a step ``w`` that took ``dt``."""
        return _Overdamped(self.mass, w / dt)

    def error(self, w: Array, dt: float) -> float:
        """Error of that step, root mean square [rad]: half of dt^2 q''."""
        return 0.5 * _rms(self.mass, w - dt * self.rate)


@dataclass(frozen=True)
class _Inertial:
    """The generalised-alpha step of a damped motion; methods as those of `_Overdamped`."""

    mass: Array  # (n b + 1,)
    damping: float
    velocity: Array
    acceleration: Array
    average: Array  # of the acceleration, the method's own
    order: int = 3

    def ahead(self, dt: float) -> Array:
        return dt * self.velocity + 0.5 * dt * dt * self.average

    def terms(self, dt: float) -> tuple[Array, float]:
        still = np.zeros(len(self.mass))
        inertia = self.after(still, dt)
        rest = _Inertial(self.mass, self.damping, still, still, still)
        unit = rest.after(still + 1.0, dt)
        known = inertia.acceleration + self.damping * inertia.velocity
        return known, float(unit.acceleration[0] + self.damping * unit.velocity[0])

    def after(self, w: Array, dt: float) -> _Inertial:
        average = (w / dt - self.velocity - dt * (0.5 - _BETA) * self.average) / (dt * _BETA)
        velocity = self.velocity + dt * ((1.0 - _GAMMA) * self.average + _GAMMA * average)
        past = _ALPHA_M * self.average - _ALPHA_F * self.acceleration
        acceleration = ((1.0 - _ALPHA_M) * average + past) / (1.0 - _ALPHA_F)
        return _Inertial(self.mass, self.damping, velocity, acceleration, average)

    def error(self, w: Array, dt: float) -> float:
        change = self.after(w, dt).average - self.average
        return (_BETA - 1.0 / 6.0) * dt * dt * _rms(self.mass, change)

    @property
    def kinetic(self) -> float:
        return 0.5 * float(np.sum(self.mass * self.velocity**2))


_Rule: TypeAlias = _Overdamped | _Inertial


def flow(
    system: RodSystem,
    start: State,
    *,
    kick: Increment | None = None,
    moment: float | None = None,
    stops: tuple[float, float] = (-np.inf, np.inf),
    tolerance: float = 1e-9,
    accuracy: float = 2e-3,
    most: int = 20_000,
    every: int = 0,
) -> EndState:
    """Return the end state of the gradient flow of the energy from ``start``.

    Parameters
    ----------
    kick : (m,) displacement added to the start, such as along a softest mode.
    moment : dead moment dL/dload under which the load moves; None: the load is given.
    stops : loads at which a motion under dead moment ends.
    tolerance : of the residual, GJ/a.
    accuracy : error allowed to each step, rad, root mean square.
    most : largest number of steps.
    every : keep every k-th configuration in `EndState.history`; 0: none.

    Notes
    -----
    Failure to come to rest is a value: see `EndState.outcome` and `EndState.advice`.
    """
    mass = weights(system)
    motion = _Motion(system, moment, stops, tolerance, accuracy, most, every)
    return motion.from_rest(start, kick, _Overdamped(mass, np.zeros(len(mass))), first=1e-4)


def swing(
    system: RodSystem,
    start: State,
    *,
    kick: Increment | None = None,
    moment: float | None = None,
    stops: tuple[float, float] = (-np.inf, np.inf),
    damping: float = 0.1,
    tolerance: float = 1e-6,
    accuracy: float = 1e-3,
    most: int = 100_000,
    every: int = 0,
    duration: float = np.inf,
) -> EndState:
    """Return the end state of the damped motion of a rod from ``start``, where it is at rest.

    Parameters
    ----------
    damping : rate at which velocities decay; kinetic energies decay at twice this.
    tolerance : of the residual, GJ/a; the kinetic energy has to be below its square.
    duration : of the motion, at most.
    kick, moment, stops, accuracy, most, every : as of `flow`.
    """
    mass = weights(system)
    still = np.zeros(len(mass))
    motion = _Motion(system, moment, stops, tolerance, accuracy, most, every, duration)
    rule = _Inertial(mass, damping, still, still, still)
    return motion.from_rest(start, kick, rule, first=1e-3)


@dataclass
class _Motion:
    """A motion so far, and the settings of its steps."""

    system: RodSystem
    moment: float | None
    stops: tuple[float, float]
    tolerance: float
    accuracy: float
    most: int
    every: int
    duration: float = np.inf
    steps: int = 0
    factorisations: int = 0
    time: float = 0.0
    kept: list[tuple[State, float, float]] = field(default_factory=list)

    def from_rest(
        self, start: State, kick: Increment | None, now: _Rule, *, first: float
    ) -> EndState:
        """The motion from a configuration at rest; ``first``: length of the first step."""
        system = self.system
        start = start if kick is None else system.retract(start, kick)
        last = begin = on_the_conditions(system, start)
        dt = first
        if begin.reason is not Reason.CONVERGED:
            return self._ended(begin, begin, _hopeless(begin), 0.0)
        while self.steps < self.most and self.time < self.duration:
            found = self._step(last.state, now, dt)
            failed, error = found.reason is not Reason.CONVERGED, now.error(found.w, dt)
            if failed or error > self.accuracy:
                dt *= 0.25 if failed else _factor(error, self.accuracy, now.order)
                if dt < _SHORTEST:
                    return self._ended(begin, last, _hopeless(found), now.kinetic, found.where)
                continue
            self._keep(last)
            last, now = found, now.after(found.w, dt)
            self.steps += 1
            self.time += dt
            outcome = self._outcome(last, now.kinetic)
            if outcome is not None:
                return self._ended(begin, last, outcome, now.kinetic)
            dt = min(dt * _factor(error, self.accuracy, now.order), _LONGEST)
        return self._ended(begin, last, Rest.TOO_MANY_EVALUATIONS, now.kinetic)

    def _step(self, here: State, now: _Rule, dt: float) -> Stepped:
        system, ahead = self.system, now.ahead(dt)
        found = step(
            system,
            here,
            system.retract(here, system.increment(ahead[:-1], float(ahead[-1]))),
            Inertia(now.mass, *now.terms(dt)),
            moment=self.moment,
            tolerance=0.1 * self.tolerance,
        )
        self.factorisations += found.iterations
        return found

    def _outcome(self, last: Stepped, kinetic: float) -> Rest | None:
        """How the motion has ended; None: it goes on."""
        if last.residual <= self.tolerance and kinetic <= self.tolerance**2:
            return Rest.AT_REST
        if self.moment is not None and not self.stops[0] < last.state.load < self.stops[1]:
            return Rest.AT_STOP
        return None

    def _keep(self, last: Stepped) -> None:
        if self.every and self.steps % self.every == 0:
            self.kept.append((last.state, last.energy, self.time))

    def _ended(
        self, begin: Stepped, last: Stepped, outcome: Rest, kinetic: float, where: int = -1
    ) -> EndState:
        """The motion's end."""
        if self.every:
            self.kept.append((last.state, last.energy, self.time))
        states, energies, times = zip(*self.kept, strict=True) if self.kept else ((), (), ())
        values = (last.residual, kinetic, begin.energy, last.energy, last.moment)
        ends = (last.state, outcome, max(where, last.where), *values, states, np.array(energies))
        counts = (self.steps, self.factorisations)
        return EndState(*ends, *counts, time=self.time, times=np.array(times))


def _rms(mass: Array, w: Array) -> float:
    """Root mean square of a displacement (n b + 1,), weighted by masses [rad]."""
    return float(np.sqrt(np.sum(mass * w * w) / mass[-1]))


def _factor(error: float, accuracy: float, order: int) -> float:
    """By how much the next step may be longer, for an error that grows with a power of it."""
    ease = _SAFE * (accuracy / max(error, 1e-300)) ** (1.0 / order)
    return min(max(ease, _GROWTH[0]), _GROWTH[1])


def _hopeless(found: Stepped) -> Rest:
    """Why a step fails at any length."""
    return Rest.BENT_TOO_FAR if found.reason is Reason.OUT_OF_RANGE else Rest.DIVERGED
