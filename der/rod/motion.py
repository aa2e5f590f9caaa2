"""Inertial fall: the ring swings, lightly damped, until it comes to rest.

    M (d2q/dt2 + damping dq/dt) = -grad U - B force

with each edge's length for its rotary mass: a mode of eigenvalue mu (`stability.softest_modes`) has
the frequency sqrt(mu). Steps are those of the generalised-alpha method on the rotation group (Chung
and Hulbert 1993; Arnold and Bruels 2007), of second order, which damps what steps do not resolve.
The conditions on positions are part of each step, so that there is no drift off them; its length
follows from the change of acceleration over it (Zienkiewicz and Xie 1991).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.kernels.quaternions import Array
from der.rod.equilibrium import Direction, Outcome
from der.rod.falls import (
    LONGEST,
    SHORTEST,
    Fallen,
    Trail,
    advanced,
    factor_of_step,
    hopeless,
    kicked,
    rms,
)
from der.rod.implicit_step import on_the_conditions, step, weights
from der.rod.relaxation import Rest
from der.rod.rod import Rod, State
from der.rod.supports import Supports

_FIRST = 1e-3  # of time
_RADIUS = 0.8  # spectral radius at infinite frequency: 1 keeps all energy, 0 damps at once
_ALPHA_M = (2.0 * _RADIUS - 1.0) / (_RADIUS + 1.0)
_ALPHA_F = _RADIUS / (_RADIUS + 1.0)
_GAMMA = 0.5 + _ALPHA_F - _ALPHA_M
_BETA = 0.25 * (_GAMMA + 0.5) ** 2


@dataclass(frozen=True)
class _Moving:
    """Rates (n b + 1,): velocity, acceleration, and the method's own average of that."""

    velocity: Array
    acceleration: Array
    average: Array

    def after(self, w: Array, dt: float) -> _Moving:
        """Rates after a step ``w`` that took ``dt``."""
        average = (w / dt - self.velocity - dt * (0.5 - _BETA) * self.average) / (dt * _BETA)
        velocity = self.velocity + dt * ((1.0 - _GAMMA) * self.average + _GAMMA * average)
        past = _ALPHA_M * self.average - _ALPHA_F * self.acceleration
        acceleration = ((1.0 - _ALPHA_M) * average + past) / (1.0 - _ALPHA_F)
        return _Moving(velocity, acceleration, average)


def move(
    body: Rod,
    held: Supports,
    start: State,
    *,
    kick: Direction | None = None,
    moment: float | None = None,
    stops: tuple[float, float] = (-np.inf, np.inf),
    damping: float = 0.1,
    tolerance: float = 1e-6,
    accuracy: float = 1e-3,
    most: int = 100_000,
    every: int = 0,
    duration: float = np.inf,
) -> Fallen:
    """The state in which a rod comes to rest that swings from ``start``, at first at rest.

    Parameters
    ----------
    kick : displacement added to the start, such as along a softest mode.
    moment : dead moment dL/dload under which the load moves; None: the load is given.
    stops : loads at which a motion under dead moment ends.
    damping : rate at which velocities decay; kinetic energies decay at twice this.
    tolerance : of the residual, GJ/a; the kinetic energy has to be below its square.
    accuracy : error allowed to each step, rad, root mean square.
    most : steps at most.
    every : keep every k-th configuration in `Fallen.history`; 0: none.
    duration : of the motion, at most.

    Notes
    -----
    Failure to come to rest is a value: see `Fallen.outcome` and `relaxation.ADVICE`.
    """
    mass = weights(body, held)
    begin = on_the_conditions(body, held, kicked(held, start, kick))
    trail = Trail(every, begin, begin.energy)
    if begin.outcome is not Outcome.CONVERGED:
        return trail.ended(hopeless(begin))
    still = np.zeros(len(mass))
    now, dt, kinetic = _Moving(still, still, still), _FIRST, 0.0
    while trail.steps < most and trail.time < duration:
        here = trail.last.state
        ahead = dt * now.velocity + 0.5 * dt * dt * now.average
        inertia, unit = now.after(still, dt), _Moving(still, still, still).after(still + 1.0, dt)
        found = step(
            body,
            held,
            here,
            advanced(held, here, ahead),
            mass=mass,
            known=inertia.acceleration + damping * inertia.velocity,
            shift=float(unit.acceleration[0] + damping * unit.velocity[0]),
            moment=moment,
            tolerance=0.1 * tolerance,
        )
        trail.factorisations += found.iterations
        then = now.after(found.w, dt)
        error = (_BETA - 1.0 / 6.0) * dt * dt * rms(mass, then.average - now.average)
        failed = found.outcome is not Outcome.CONVERGED
        if failed or error > accuracy:
            dt *= 0.25 if failed else factor_of_step(error, accuracy, 3)
            if dt < SHORTEST:
                return trail.ended(hopeless(found), kinetic)
            continue
        trail.add(found, dt)
        now = then
        kinetic = 0.5 * float(np.sum(mass * now.velocity**2))
        if found.residual <= tolerance and kinetic <= tolerance**2:
            return trail.ended(Rest.AT_REST, kinetic)
        if moment is not None and not stops[0] < found.state.load < stops[1]:
            return trail.ended(Rest.AT_STOP, kinetic)
        dt = min(dt * factor_of_step(error, accuracy, 3), LONGEST)
    return trail.ended(Rest.TOO_MANY_EVALUATIONS, kinetic)
