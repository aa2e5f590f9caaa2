"""Overdamped fall: down the gradient, as in a viscous fluid, by implicit steps.

    M dq/dt = -grad U - B force

with each edge's length for its mass: a mode of eigenvalue mu (`stability.softest_modes`) decays as
exp(-mu t), and the ring never swings past a state of rest. Implicit Euler steps are stable at any
length; theirs follows from the change of velocity over each (error dt^2 q''/2), so that it grows
without bound where the ring comes to rest: the last ones are Newton's method.
"""

from __future__ import annotations

import numpy as np

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

_FIRST = 1e-4  # of time, before anything is known


def flow(
    body: Rod,
    held: Supports,
    start: State,
    *,
    kick: Direction | None = None,
    moment: float | None = None,
    stops: tuple[float, float] = (-np.inf, np.inf),
    tolerance: float = 1e-9,
    accuracy: float = 2e-3,
    most: int = 20_000,
    every: int = 0,
) -> Fallen:
    """The state in which a rod comes to rest that flows down its energy from ``start``.

    Parameters
    ----------
    kick : displacement added to the start, such as along a softest mode.
    moment : dead moment dL/dload under which the load moves; None: the load is given.
    stops : loads at which a fall under dead moment ends.
    tolerance : of the residual, GJ/a.
    accuracy : error allowed to each step, rad, root mean square.
    most : steps at most.
    every : keep every k-th configuration in `Fallen.history`; 0: none.

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
    rate, dt = still, _FIRST
    while trail.steps < most:
        here = trail.last.state
        found = step(
            body,
            held,
            here,
            advanced(held, here, dt * rate),
            mass=mass,
            known=still,
            shift=1.0 / dt,
            moment=moment,
            tolerance=0.1 * tolerance,
        )
        trail.factorisations += found.iterations
        error = 0.5 * rms(mass, found.w - dt * rate)
        failed = found.outcome is not Outcome.CONVERGED
        if failed or error > accuracy:
            dt *= 0.25 if failed else factor_of_step(error, accuracy, 2)
            if dt < SHORTEST:
                return trail.ended(hopeless(found))
            continue
        trail.add(found, dt)
        rate = found.w / dt
        if found.residual <= tolerance:
            return trail.ended(Rest.AT_REST)
        if moment is not None and not stops[0] < found.state.load < stops[1]:
            return trail.ended(Rest.AT_STOP)
        dt = min(dt * factor_of_step(error, accuracy, 2), LONGEST)
    return trail.ended(Rest.TOO_MANY_EVALUATIONS)
