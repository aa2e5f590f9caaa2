"""Marching by dynamic relaxation alone: no Hessian, no factorisation, only forces.

The grips turn in steps, and after each the ring comes to rest from where the last states lead. A
state that rests elsewhere has snapped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from der import relaxation
from der.equilibrium import Direction, Equilibrium, Outcome, dot, moved
from der.frames import rotation_vector
from der.relaxation import Relaxed, relax
from der.rod import State
from der.sector import Sector
from der.snap import Landing, heading
from der.special import Visit, Wanted
from der.step import Stuck, Tally

RISE = math.pi / 64.0  # rad, step of a march by dynamic relaxation alone
RESOLUTION = 1e-6  # rad, of where such a march finds a snap
CLOSE = 1e-9  # rad: states nearer than this tell no rates by their differences
_MISS = 0.1  # rad, root mean square: a state further from the extrapolation has snapped


def follow_relaxed(
    piece: Sector,
    wanted: Wanted,
    tally: Tally,
    *,
    start: Equilibrium | None = None,
    unload: bool = False,
    rise: float = RISE,
    tolerance: float = 1e-9,
    every: int = 0,
) -> Iterator[Visit]:
    """Hand out the minima at given gamma, each by dynamic relaxation: no Hessian anywhere.

    Gamma goes in steps of ``rise`` [rad] and through every load that is asked for. Limits of the
    moment are located by parabolas through relaxed states; a state that is not where the last ones
    lead has snapped, and where is bracketed by bisection to `RESOLUTION` ("gamma_uncertainty" of
    the landing). Indices are not known, contacts not looked for; tangents and slopes are
    differences of second order; ``tolerance`` is that of `relaxation.relax`.

    Raises
    ------
    Stuck
        Where a state does not come to rest.
    """
    walk = _Walk(piece, wanted, tally, rise, tolerance, every)
    last = start
    for one in _with_limits(walk, _relaxed_states(walk, start)):
        last = one.at
        yield one
    if unload:
        back = replace(walk, wanted=replace(wanted, load_max=0.0))
        states = _with_limits(back, _relaxed_states(back, last))
        next(states)  # the state at which loading has ended
        yield from states


@dataclass(frozen=True)
class _Walk:
    """What the states of one march by relaxation share."""

    piece: Sector
    wanted: Wanted
    tally: Tally
    rise: float
    tolerance: float
    every: int

    def relaxed(self, start: State, every: int = 0) -> Relaxed:
        """The state of rest at the load of ``start``.

        Raises
        ------
        Stuck
            Where there is none.
        """
        found = relax(
            self.piece.body, self.piece.held, start, tolerance=self.tolerance, every=every
        )
        self.tally.force_evaluations += found.evaluations
        if not found.rests:
            where = f"vertex {found.where} " if found.where >= 0 else ""
            raise Stuck(
                f"at gamma = {start.load:.8f} the ring {where}{relaxation.ADVICE[found.outcome]}"
            )
        return found

    def loads(self, first: float) -> list[float]:
        """Loads to relax at, in the order of the march from ``first``."""
        last = self.wanted.load_max
        low, high = min(first, last), max(first, last)
        if high - low > self.wanted.most_steps * self.rise:
            raise Stuck(f"the march would not end within {self.wanted.most_steps} steps")
        grid = [k * self.rise for k in range(math.ceil(low / self.rise), int(high / self.rise) + 1)]
        asked = self.wanted.targets
        if asked is None:
            eighth = math.pi / 8.0
            asked = tuple(
                k * eighth for k in range(math.ceil(low / eighth), int(high / eighth) + 1)
            )
        asked = (*(load for load in (*asked, math.pi) if low <= load <= high), last)
        # a step of the grid that all but meets a load that is asked for is left out
        near = 0.1 * self.rise
        grid = [load for load in grid if min(abs(load - one) for one in asked) > near]
        return sorted({*grid, *asked} - {first}, reverse=last < first)


def _relaxed_states(walk: _Walk, start: Equilibrium | None) -> Iterator[Visit]:
    """Relaxed states at the loads of a march, with landings where the ring has snapped."""
    piece = walk.piece
    first = walk.relaxed(piece.start if start is None else start.state)
    trail = [_rested(piece, [], first)]
    yield Visit(trail[-1])
    loads = walk.loads(first.state.load)[::-1]
    while loads:
        found = walk.relaxed(_ahead(piece, trail, loads[-1]))
        walk.tally.steps += 1
        if _went_on(piece, trail, found):
            loads.pop()
            rested = _rested(piece, trail, found)
            if abs(rested.state.load - trail[-1].state.load) > CLOSE:
                trail = [*trail[-2:], rested]
            yield Visit(rested)
        elif abs(loads[-1] - trail[-1].state.load) > RESOLUTION:
            loads.append(0.5 * (trail[-1].state.load + loads[-1]))
        else:
            landing = _landed(walk, trail, loads.pop())
            trail = [landing.at]
            yield landing


def _ahead(piece: Sector, trail: list[Equilibrium], load: float) -> State:
    """State at ``load`` extrapolated from the last three, or as many as there are."""
    here = trail[-1]
    rise = load - here.state.load
    rate = heading(piece, 1.0)
    if len(trail) > 1:
        rate = _per_load(here)
    if len(trail) > 2:
        older = _per_load(trail[-2])
        # rates are means over their steps: from the middle of the last two to that of the next
        span = 0.5 * (here.state.load - trail[-3].state.load)
        lead = 0.5 * (load - trail[-2].state.load) / span
        rate = rate._replace(q=rate.q + lead * (rate.q - older.q))
    return moved(piece.held, here.state, Direction(rise * rate.q, 0.0 * rate.force, rise)).but(
        load=load
    )


def _per_load(at: Equilibrium) -> Direction:
    """Mean rate of change over the last step, per unit of load."""
    return Direction(at.tangent.q / at.tangent.load, 0.0 * at.tangent.force, 1.0)


def _change(piece: Sector, a: State, b: State) -> Direction:
    """The increment that takes one state to another."""
    q = np.zeros(piece.held.free.shape)
    q[:, :3] = rotation_vector(a.quat, b.quat)
    if piece.body.block == 4:
        q[:, 3] = b.stretch - a.stretch
    q[~piece.held.free] = 0.0
    return Direction(q, b.force - a.force, b.load - a.load)


def _went_on(piece: Sector, trail: list[Equilibrium], found: Relaxed) -> bool:
    """Whether a state lies where the last ones lead, and not where the ring has snapped to."""
    miss = _change(piece, _ahead(piece, trail, found.state.load), found.state)
    return math.sqrt(dot(piece.body, miss, miss)) < _MISS


def _rested(piece: Sector, trail: list[Equilibrium], found: Relaxed) -> Equilibrium:
    """A relaxed state as an equilibrium: its rates are differences along the trail behind it."""
    tangent, slope = heading(piece, 1.0), 0.0
    if trail:
        last = trail[-1]
        step = _change(piece, last.state, found.state)
        norm = math.sqrt(dot(piece.body, step, step))
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
        Outcome.CONVERGED,
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


def _landed(walk: _Walk, trail: list[Equilibrium], load: float) -> Landing:
    """The state that a ring has snapped to between the last state of a trail and ``load``."""
    piece, before = walk.piece, trail[-1]
    found = walk.relaxed(_ahead(piece, trail, load), walk.every)
    rise = load - before.state.load
    energy = piece.copies * (before.energy + before.moment * rise)
    details: dict[str, object] = {
        "gamma_fold": load,
        "gamma_uncertainty": abs(rise),
        "energy_before": energy,
        "energy_after": piece.copies * found.energy,
        "energy_released": energy - piece.copies * found.energy,
        "moment_before": piece.moment(before.moment),
        "moment_after": piece.moment(found.moment),
        "force_evaluations": found.evaluations,
    }
    energies = tuple(piece.copies * float(e) for e in found.energies)
    at = _rested(piece, [], found)
    return Landing(at, "snap", details=details, history=found.history, energies=energies)


def _with_limits(walk: _Walk, states: Iterator[Visit]) -> Iterator[Visit]:
    """The visits with the limits of the moment put in, each state a step late."""
    window: list[list[Visit]] = []  # each with those that are all but the same state
    for one in states:
        if one.kind == "snap":
            for same in window[1:]:
                yield from same
            window = []
        if window and abs(one.at.state.load - window[-1][0].at.state.load) <= CLOSE:
            window[-1].append(one)
        else:
            window.append([one])
        if len(window) == 1:
            yield one
        if len(window) < 3 or len(window[-1]) > 1:
            continue
        a, b, c = (same[0].at for same in window)
        turn = list(window[1])
        if (b.moment - a.moment) * (c.moment - b.moment) < 0.0:
            turn.append(_turning(walk, a, b, c))
        yield from sorted(turn, key=lambda v: v.at.state.load, reverse=c.state.load < b.state.load)
        window.pop(0)
    for same in window[1:]:
        yield from same


def _turning(walk: _Walk, a: Equilibrium, b: Equilibrium, c: Equilibrium) -> Visit:
    """The limit of the moment among three relaxed states, by ever narrower parabolas."""
    trail = [a, b, c]
    for narrower in (0.1, 0.01, 0.0):
        load = _vertex(trail)
        h = narrower * (c.state.load - a.state.load)
        trail = [_between(walk, a, c, x) for x in sorted({load - h, load, load + h})]
    return Visit(trail[0], "limit")


def _vertex(trail: list[Equilibrium]) -> float:
    """Load at which a parabola through three moments is stationary."""
    x, y, z = (at.state.load for at in trail)
    p, q, r = (at.moment for at in trail)
    first, second = (q - p) / (y - x), (r - q) / (z - y)
    return 0.5 * (x + y) - 0.5 * first * (z - x) / (second - first)


def _between(walk: _Walk, a: Equilibrium, c: Equilibrium, load: float) -> Equilibrium:
    """The relaxed state at a load between those of two others."""
    part = (load - a.state.load) / (c.state.load - a.state.load)
    step = _change(walk.piece, a.state, c.state)
    guess = Direction(part * step.q, 0.0 * step.force, load - a.state.load)
    found = walk.relaxed(moved(walk.piece.held, a.state, guess).but(load=load))
    return _rested(walk.piece, [a], found)
