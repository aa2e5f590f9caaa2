"""The last states of a march by dynamic relaxation, and where they lead.

A march without a Hessian knows its path by differences alone: up to three states in a row. A state
goes on from them if it lies where they lead, and if its energy is theirs and the work in between.
"""

from __future__ import annotations

import math

from der.analysis.snap import heading
from der.continuation.interpolant import between
from der.rod.equilibrium import Direction, Equilibrium, Outcome, dot, moved
from der.rod.gripped_ring import GrippedRing
from der.rod.relaxation import Relaxed
from der.rod.rod import State

CLOSE = 1e-9  # rad: states nearer than this tell no rates by their differences
_MISS = 0.1  # rad, root mean square: a state further from the extrapolation has snapped
_LOST = 1e-3  # of the work at the largest moment so far: energy beyond that is lost in a snap
_FAINT = 1e-10  # of the energy, and GJ/a: a loss of less is rounding
_SHORTER = 0.1  # of the last step: a state so near the last one takes its place
_GAUSS = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))


def ahead(ring: GrippedRing, trail: list[Equilibrium], load: float) -> State:
    """State at ``load`` extrapolated from the last three, or as many as there are."""
    here = trail[-1]
    rise = load - here.state.load
    rate = ring.heading(1.0)
    if len(trail) > 1:
        rate = _per_load(here)
    if len(trail) > 2:
        older = _per_load(trail[-2])
        # rates are means over their steps: from the middle of the last two to that of the next
        span = 0.5 * (here.state.load - trail[-3].state.load)
        lead = 0.5 * (load - trail[-2].state.load) / span
        rate = rate._replace(q=rate.q + lead * (rate.q - older.q))
    return ring.retract(here.state, Direction(rise * rate.q, 0.0 * rate.force, rise)).but(
        load=load
    )


def _per_load(at: Equilibrium) -> Direction:
    """Mean rate of change over the last step, per unit of load."""
    return Direction(at.tangent.q / at.parameter_rate, 0.0 * at.tangent.force, 1.0)


def went_on(ring: GrippedRing, trail: list[Equilibrium], found: Relaxed) -> bool:
    """Whether a state lies where the last ones lead, and not where the ring has snapped to."""
    miss = ring.difference(ahead(ring, trail, found.state.load), found.state)
    return math.sqrt(ring.inner(miss, miss)) < _MISS


def is_work(trail: list[Equilibrium], found: Relaxed, largest: float) -> bool:
    """Whether a state's energy is that of the last one and the work of the grips in between.

    The moment is that of the polynomial through the states of the trail and this one; ``largest``
    is the greatest so far.
    """
    before = trail[-1]
    rise = found.state.load - before.state.load
    if rise == 0.0:
        return True
    known = [(at.state.load, at.moment) for at in trail]
    known.append((found.state.load, found.moment))
    mean = 0.0  # of a cubic, by two points of Gauss's
    for place in _GAUSS:
        load = before.state.load + place * rise
        for x, moment in known:
            mean += 0.5 * moment * math.prod((load - y) / (x - y) for y, _ in known if y != x)
    lost = abs(found.energy - before.energy - rise * mean)
    return lost <= max(_LOST * largest * abs(rise), _FAINT * max(abs(found.energy), 1.0))


def rested(ring: GrippedRing, trail: list[Equilibrium], found: Relaxed) -> Equilibrium:
    """A relaxed state as an equilibrium: its rates are differences along the trail behind it."""
    tangent, slope = ring.heading(1.0), 0.0
    if trail:
        last = trail[-1]
        step = ring.difference(last.state, found.state)
        norm = math.sqrt(ring.inner(step, step))
        tangent, slope = last.tangent, last.slope  # where the two are one state
        apart = abs(step.load) > CLOSE
        if apart:
            tangent = Direction(step.q / norm, step.force / norm, step.load / norm)
            slope = (found.moment - last.moment) / step.load
        if apart and len(trail) > 1:
            before = trail[-2]
            older = (last.moment - before.moment) / (last.state.load - before.state.load)
            slope += step.load * (slope - older) / (found.state.load - before.state.load)
    return Equilibrium(
        found.state,
        Reason.CONVERGED,
        -1,
        0,
        found.residual,
        found.energy,
        found.moment,
        tangent,
        slope * tangent.load,
        -1,
        0.0,
    )


def longer(ring: GrippedRing, trail: list[Equilibrium], found: Relaxed) -> list[Equilibrium]:
    """The last states of a trail with a new one, which takes the place of one all but beside it.

    What the next step is extrapolated from would otherwise be differences of next to nothing.
    """
    step = abs(found.state.load - trail[-1].state.load)
    if step <= CLOSE:
        return trail
    if len(trail) > 1 and step < _SHORTER * abs(trail[-1].state.load - trail[-2].state.load):
        trail = trail[:-1]
    return [*trail[-2:], rested(ring, trail, found)]
