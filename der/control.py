"""Marching by what a user turns: the angle, or a dead moment. The state is a minimum, or it snaps.

The march goes from minimum to minimum at given gamma (or moment) until stability is lost:

    angle   at a fold, dgamma/ds = 0, or where the index changes (a branch point)
    moment  at a limit of the moment, dM/ds = 0

then the ring snaps (`snap.py`), and the march goes on from where it has landed. Towards a fold the
gamma of neighbouring states tells them apart ever worse; where the path is that steep a step is
measured along its tangent instead, so that it reaches over the fold and brackets it. Everything
between two states, folds included, is found by the same code as on a path (`special.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from der import relaxation
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
from der.frames import rotation_vector
from der.path import FIRST_STEP, LARGEST_STEP, SMALLEST_STEP
from der.relaxation import Relaxed, relax
from der.rod import State
from der.sector import Sector
from der.snap import Landing, downhill, heading, snap
from der.special import Visit, Wanted, special_points, three_covered, visit
from der.stability import all_modes
from der.step import Step, Stuck, Tally

_ANGLE = 0.12  # rad, aimed at between tangents of neighbouring states
_SHARPEST = 0.4  # rad, a step that turns more is repeated shorter
_WIDEST = 0.2  # bulge of a step; more is another part of the path
_STEEP = 0.1  # of the first rate: below, a step is measured along the tangent
RISE = math.pi / 64.0  # rad, step of a march by dynamic relaxation alone
RESOLUTION = 1e-6  # rad, of where such a march finds a snap
_MISS = 0.1  # rad, root mean square: a state further from the extrapolation has snapped
_PAST = 1e-3  # rad: how far past a branch point the ring is let go


@dataclass(frozen=True)
class March:
    """What is marched by, and which way."""

    control: Control  # LOAD: the angle; MOMENT: a dead moment
    sense: float  # 1: loading, -1: unloading
    first_rate: float  # of gamma or of the moment along the path, where the march begins

    def rate(self, at: Equilibrium) -> float:
        """How fast the controlled quantity grows along the tangent, over its first rate."""
        rate = at.tangent.load if self.control is Control.LOAD else at.moment_rate
        return rate / self.first_rate

    @property
    def ends_at(self) -> str:
        """Kind of the point at which a minimum ceases to exist."""
        return "fold" if self.control is Control.LOAD else "limit"


def follow_angle(
    piece: Sector,
    wanted: Wanted,
    tally: Tally,
    *,
    start: Equilibrium | None = None,
    unload: bool = False,
    every: int = 0,
) -> Iterator[Visit]:
    """Hand out the minima at given gamma, from the flat ring (or ``start``) to ``load_max``.

    A snap is handed out as the state before it (a visit of kind "fold" or "branch") and a
    `snap.Landing`. ``unload`` comes back to 0; ``every`` keeps every k-th configuration of snaps.

    Raises
    ------
    Stuck
        Where the march cannot go on, after all that was found has been handed out.
    """
    last = start
    for one in _march(piece, wanted, tally, Control.LOAD, start, every):
        last = one.at
        yield one
    if unload:
        back = _march(piece, replace(wanted, load_max=0.0), tally, Control.LOAD, last, every)
        next(back)  # the state at which loading has ended
        yield from back


def follow_moment(
    piece: Sector, wanted: Wanted, tally: Tally, *, every: int = 0
) -> Iterator[Visit]:
    """Hand out the minima under a growing dead moment, until gamma arrives at ``load_max``.

    Past a limit of the moment the ring snaps through, to rest or to the stop at ``load_max``.

    Raises
    ------
    Stuck
        Where the march cannot go on, after all that was found has been handed out.
    """
    return _march(piece, wanted, tally, Control.MOMENT, None, every)


def _march(
    piece: Sector,
    wanted: Wanted,
    tally: Tally,
    control: Control,
    start: Equilibrium | None,
    every: int,
) -> Iterator[Visit]:
    here, march = _begun(piece, wanted, tally, control, start)
    yield here
    length = FIRST_STEP
    while True:
        if tally.steps >= wanted.most_steps:
            raise Stuck(f"the march has not ended after {tally.steps} steps")
        step = _advance(piece, wanted, tally, march, here.at, length)
        try:
            found, ended = _found(piece, wanted, step, here)
        except Stuck:
            # both ends are equilibria, but not of one smooth curve: look again from closer
            if step.length < 4.0 * SMALLEST_STEP:
                raise
            length = 0.25 * step.length
            continue
        tally.steps += 1
        lost = next((k for k, one in enumerate(found) if _is_lost(march, one)), None)
        yield from found[: None if lost is None else lost + 1]
        if lost is None:
            if ended:
                return
            here = found[-1]
            length = _next_length(step)
            continue
        here = _after(wanted, march, step, found[lost], every)
        yield here
        _check_other_classes(piece, here)
        if here.at.state.load == wanted.load_max:
            return
        length = FIRST_STEP


def _begun(
    piece: Sector, wanted: Wanted, tally: Tally, control: Control, start: Equilibrium | None
) -> tuple[Visit, March]:
    """The first state of a march, its tangent pointing onward."""
    state = piece.start if start is None else start.state
    sense = 1.0 if wanted.load_max >= state.load else -1.0
    at = equilibrium(
        piece.body, piece.held, state, along=heading(piece, sense), tolerance=wanted.tolerance
    )
    tally.newton_iterations += at.iterations
    if not at.converged:
        raise Stuck(f"gamma = {state.load:.8f} is no equilibrium: {ADVICE[at.outcome]}")
    if _own_index(piece, at) != 0:
        raise Stuck(f"the state at gamma = {state.load:.8f} is no minimum: it cannot be marched on")
    rate = at.tangent.load if control is Control.LOAD else at.moment_rate
    return visit(piece, wanted, at), March(control, sense, abs(rate))


def _own_index(piece: Sector, at: Equilibrium) -> int:
    """Negative eigenvalues among the motions that the sector allows, from Newton's last factors."""
    return at.negative - len(piece.held.target)


def _advance(
    piece: Sector, wanted: Wanted, tally: Tally, march: March, start: Equilibrium, length: float
) -> Step:
    """One accepted step of about ``length``, shortened until it stays on the path."""
    t = start.tangent
    reason = ""
    while length > SMALLEST_STEP:
        guess = Direction(length * t.q, length * t.force, length * t.load)
        steep = abs(march.rate(start)) < _STEEP
        end = equilibrium(
            piece.body,
            piece.held,
            moved(piece.held, start.state, guess),
            along=t,
            control=Control.DIRECTION if steep else march.control,
            moment=start.moment + length * start.moment_rate,
            tolerance=wanted.tolerance,
            iterations=7,
        )
        tally.newton_iterations += end.iterations
        reason = ADVICE[end.outcome] if not end.converged else "the path turns too sharply"
        if end.where >= 0:
            reason = f"vertex {end.where} {reason}"
        if end.converged:
            step = Step(piece, start, end, length, wanted.tolerance, tally)
            step = replace(step, length=dot(piece.body, t, step.jump))
            if _stays(step) and (steep or march.rate(start) * march.rate(end) > 0.0):
                return step
        length *= 0.5
    raise Stuck(f"no step forward from gamma = {start.state.load:.8f}: {reason}")


def _angle(step: Step) -> float:
    """Angle between the tangents at the ends of a step [rad]."""
    cosine = dot(step.piece.body, step.start.tangent, step.end.tangent)
    return math.acos(min(1.0, max(-1.0, cosine)))


def _stays(step: Step) -> bool:
    """Whether the two ends of a step lie on one path, as far as tangents and distance tell."""
    return step.length > 0.0 and step.bulge < _WIDEST and _angle(step) < _SHARPEST


def _next_length(step: Step) -> float:
    ease = math.sqrt(_ANGLE / max(_angle(step), 1e-3))
    if step.end.iterations > 4:
        ease = min(ease, 0.7)
    return min(step.length * min(max(ease, 0.5), 2.0), LARGEST_STEP)


def _found(piece: Sector, wanted: Wanted, step: Step, here: Visit) -> tuple[list[Visit], bool]:
    """Visits of one step; a loss of stability in the sector's own class is among them always."""
    if wanted.contacts and three_covered(piece, here.at):
        wanted = replace(wanted, contacts=False)  # strands lie in each other: no link to start from
    found, ended = special_points(piece, wanted, step, here)
    folds = any(one.kind == "fold" for one in found)
    if wanted.stability or folds or _own_index(piece, step.end) == 0:
        return found, ended
    own = replace(piece, classes={_own_class(piece): (1, all_modes(piece.held))})
    asked = replace(wanted, stability=True)
    found, ended = special_points(own, asked, step, replace(here, index=(0,)))
    return [replace(one, index=None) for one in found], ended


def _own_class(piece: Sector) -> str:
    """Name of the modes that the sector itself can follow."""
    return next(iter(piece.classes))


def _is_lost(march: March, one: Visit) -> bool:
    return one.kind in (march.ends_at, "branch")


def _after(wanted: Wanted, march: March, step: Step, lost: Visit, every: int) -> Visit:
    """Where the ring lands that has lost its stability at a fold, a limit or a branch point."""
    piece, at = step.piece, lost.at
    snapped = partial(snap, piece, wanted, step.tally, sense=march.sense, every=every)
    if lost.kind == march.ends_at:
        # the tangent is the softest mode itself, and past the fold is downhill
        return snapped(at, at.tangent, dead_moment=march.control is Control.MOMENT)
    if lost.details.get("symmetry") != _own_class(piece):
        raise Stuck(
            f"the ring loses stability at gamma = {at.state.load:.8f} by a mode "
            f"({lost.details.get('symmetry')}) that breaks the symmetry of its {piece.name}; "
            f"the sector 'full' follows it"
        )
    before = _past(step, march.sense, at.state.load)
    return snapped(before, downhill(piece, before), gamma_lost=at.state.load)


def _past(step: Step, sense: float, load: float) -> Equilibrium:
    """The unstable state a little past a branch point at ``load``, on the path that came to it.

    Not from the tangent at the branch point: two of them meet there, and the solver finds neither.
    """
    load += sense * _PAST
    if (step.end.state.load - load) * sense <= 0.0:
        return step.end
    return step.at_load(load, 0.0, step.length)[1]


def _check_other_classes(piece: Sector, landed: Visit) -> None:
    """Refuse to march on from a landing that is unstable in a class the sector cannot follow."""
    for label, count in zip(piece.classes, landed.index or (), strict=False):
        if count:
            raise Stuck(
                f"the ring lands at gamma = {landed.at.state.load:.8f} in a state that is unstable "
                f"to modes ({label}) that break the symmetry of its {piece.name}; "
                f"the sector 'full' follows it"
            )


# --- by dynamic relaxation alone ------------------------------------------------------------------


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
            trail = [*trail[-2:], _rested(piece, trail, found)]
            yield Visit(trail[-1])
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
        tangent = Direction(step.q / norm, step.force / norm, step.load / norm)
        slope = (found.moment - last.moment) / step.load
        if len(trail) > 1:
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
    window: list[Visit] = []
    for one in states:
        if one.kind == "snap":
            yield from window[1:]
            window = []
        window.append(one)
        if len(window) == 1:
            yield one
        if len(window) < 3:
            continue
        a, b, c = (each.at for each in window)
        turn = [window[1]]
        if (b.moment - a.moment) * (c.moment - b.moment) < 0.0:
            turn.append(_turning(walk, a, b, c))
        yield from sorted(turn, key=lambda v: v.at.state.load, reverse=c.state.load < b.state.load)
        window.pop(0)
    yield from window[1:]


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
