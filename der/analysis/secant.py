"""Secant predictor of loading by dynamic relaxation.

Without a Hessian, the rates of the path are differences of up to three successive states. A new
state continues them if it is close to their extrapolation, and if its energy is that of the last
state plus the work between them.
"""

from __future__ import annotations

import math

from der.errors import Reason
from der.problem import Increment
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.relaxation import Relaxed
from der.rod.rod import State

CLOSE = 1e-9  # rad: differences of closer states give no rates
_MISS = 0.1  # rad, root mean square: a state further from the extrapolation has snapped
_LOST = 1e-3  # of the work at the largest moment so far: a larger loss of energy is a snap
_FAINT = 1e-10  # of the energy, and GJ/a: a smaller loss is rounding
_SHORTER = 0.1  # of the last step: a state so close to the last one replaces it
_GAUSS = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))


def ahead(ring: GrippedRing, recent: list[Equilibrium], load: float) -> State:
    """Return the state at ``load`` extrapolated from the last three, or fewer."""
    here = recent[-1]
    rise = load - here.parameter
    rate = ring.increment(load=1.0)
    if len(recent) > 1:
        rate = _per_load(ring, here)
    if len(recent) > 2:
        older = _per_load(ring, recent[-2])
        # rates are means over their steps: from the middle of the last two to that of the next
        span = 0.5 * (here.parameter - recent[-3].parameter)
        lead = 0.5 * (load - recent[-2].parameter) / span
        rate = rate + lead * (rate - older)
    return ring.retract(here.state, rise * rate).but(load=load)


def _per_load(ring: GrippedRing, at: Equilibrium) -> Increment:
    """Mean rate of change over the last step, per unit of load."""
    return ring.displacement(at.tangent, 1.0 / at.parameter_rate)


def went_on(ring: GrippedRing, recent: list[Equilibrium], found: Relaxed) -> bool:
    """Whether a state is close to the extrapolation of the last ones: the ring has not snapped."""
    miss = ring.difference(ahead(ring, recent, found.state.load), found.state)
    return math.sqrt(ring.inner(miss, miss)) < _MISS


def is_work(recent: list[Equilibrium], found: Relaxed, largest: float) -> bool:
    """Whether a state's energy is that of the last one plus the work of the grips between them.

    The moment is that of the polynomial through the last states and this one; ``largest``
    is the greatest so far.
    """
    before = recent[-1]
    rise = found.state.load - before.parameter
    if rise == 0.0:
        return True
    known = [(at.parameter, at.moment) for at in recent]
    known.append((found.state.load, found.moment))
    mean = 0.0  # of a cubic, by Gauss's rule with two points
    for place in _GAUSS:
        load = before.parameter + place * rise
        for x, moment in known:
            mean += 0.5 * moment * math.prod((load - y) / (x - y) for y, _ in known if y != x)
    lost = abs(found.energy - before.energy - rise * mean)
    return lost <= max(_LOST * largest * abs(rise), _FAINT * max(abs(found.energy), 1.0))


def rested(ring: GrippedRing, recent: list[Equilibrium], found: Relaxed) -> Equilibrium:
    """Return a relaxed state as an equilibrium: its rates are differences of successive states."""
    tangent, slope = ring.increment(load=1.0), 0.0
    if recent:
        last = recent[-1]
        step = ring.difference(last.state, found.state)
        rise = float(step[-1])
        tangent, slope = last.tangent, last.slope  # where the two are one state
        apart = abs(rise) > CLOSE
        if apart:
            tangent = step / math.sqrt(ring.inner(step, step))
            slope = (found.moment - last.moment) / rise
        if apart and len(recent) > 1:
            before = recent[-2]
            older = (last.moment - before.moment) / (last.parameter - before.parameter)
            slope += rise * (slope - older) / (found.state.load - before.parameter)
    rate = float(tangent[-1])
    return Equilibrium(
        state=found.state,
        parameter=found.state.load,
        tangent=tangent,
        observables={
            "moment": (found.moment, slope * rate),
            "energy": (found.energy, found.moment * rate),
        },
        index=None,
        reason=Reason.CONVERGED,
        detail="",
        iterations=0,
        residual=found.residual,
    )


def longer(ring: GrippedRing, recent: list[Equilibrium], found: Relaxed) -> list[Equilibrium]:
    """Return the last states with a new one, which replaces one very close to it.

    Otherwise the next step would be extrapolated from differences of almost equal states.
    """
    step = abs(found.state.load - recent[-1].parameter)
    if step <= CLOSE:
        return recent
    if len(recent) > 1 and step < _SHORTER * abs(recent[-1].parameter - recent[-2].parameter):
        recent = recent[:-1]
    return [*recent[-2:], rested(ring, recent, found)]
