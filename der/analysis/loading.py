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

from der.analysis.snap import downhill, heading, snap
from der.continuation.arclength import FIRST_STEP, LARGEST_STEP, SMALLEST_STEP
from der.continuation.events import Visit, Wanted, special_points, touches_itself, visit
from der.continuation.step import Step, Stuck, Tally
from der.rod.equilibrium import (
    ADVICE,
    Control,
    Direction,
    Equilibrium,
    dot,
    equilibrium,
    moved,
)
from der.rod.gripped_ring import Sector
from der.rod.stability import all_modes

_ANGLE = 0.12  # rad, aimed at between tangents of neighbouring states
_SHARPEST = 0.4  # rad, a step that turns more is repeated shorter
_WIDEST = 0.2  # bulge of a step; more is another part of the path
_STEEP = 0.1  # of the first rate: below, a step is measured along the tangent
_PAST = 1e-3  # rad: how far past a branch point the ring is let go
_LEVEL = 1e-2  # of the rate of the moment where a branch returns to its symmetric path, GJ/a


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
    piece: Sector, wanted: Wanted, tally: Tally, *, unload: bool = False, every: int = 0
) -> Iterator[Visit]:
    """Hand out the minima under a growing dead moment, until gamma arrives at ``load_max``.

    Past a limit of the moment the ring snaps through, to rest or to the stop at ``load_max``.
    ``unload`` lowers the moment again: the ring leaves the stop when the moment is its own, snaps
    at once if it is unstable there, else at the limits on the way, and ends at a stop at gamma = 0.

    Raises
    ------
    Stuck
        Where the march cannot go on, after all that was found has been handed out.
    """
    last: Equilibrium | None = None
    for one in _march(piece, wanted, tally, Control.MOMENT, None, every):
        last = one.at
        yield one
    if not unload:
        return
    down = replace(wanted, load_max=0.0)
    begin, _ = _begun(piece, down, tally, Control.MOMENT, last)
    last = begin.at
    if last.slope < 0.0:
        # M grows as gamma falls: no dead moment holds the ring once it is off the stop
        landed = snap(
            piece, down, tally, last, last.tangent, dead_moment=True, sense=-1.0, every=every
        )
        yield landed
        _check_other_classes(piece, landed)
        last = landed.at
        if last.state.load == 0.0:
            return
    back = _march(piece, down, tally, Control.MOMENT, last, every)
    next(back)  # the state that was handed out last
    yield from back


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
        found = [_named(piece, march, one) for one in found]
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
    if wanted.contacts and touches_itself(piece, here.at):
        wanted = replace(wanted, contacts=False)  # no link to start from
    found, ended = special_points(piece, wanted, step, here)
    folds = any(one.kind == "fold" for one in found)
    if wanted.stability or folds or _own_index(piece, step.end) == 0:
        return found, ended
    own = replace(piece, classes={_own_class(piece): (1, all_modes(piece.held))})
    asked = replace(wanted, stability=True)
    found, ended = special_points(own, asked, step, replace(here, index=(0,)))
    return [replace(one, index=None, sides=None) for one in found], ended


def _own_class(piece: Sector) -> str:
    """Name of the modes that the sector itself can follow."""
    return next(iter(piece.classes))


def _named(piece: Sector, march: March, one: Visit) -> Visit:
    """A visit; a fold of a branch that returns to its symmetric path is a branch point.

    There the moment is stationary, too: the branch goes back on itself, mirrored.
    """
    at = one.at
    if march.control is Control.LOAD and one.kind == "fold" and abs(at.moment_rate) < _LEVEL:
        return replace(one, kind="branch", details={"symmetry": _own_class(piece)})
    return one


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
    if abs(at.moment_rate) < _LEVEL and abs(at.tangent.load) < _LEVEL:
        kept = _kept(wanted, march, step, at)
        if kept is not None:
            return kept
    before = _past(step, march.sense, at.state.load)
    return snapped(before, downhill(piece, before), gamma_lost=at.state.load)


def _kept(wanted: Wanted, march: March, step: Step, at: Equilibrium) -> Visit | None:
    """The minimum past the end of a branch, on its symmetric path: the ring just goes on.

    None where there is none so close.
    """
    piece = step.piece
    load = at.state.load + march.sense * _PAST
    if (wanted.load_max - load) * march.sense < 0.0:
        load = wanted.load_max
    turned = moved(piece.held, at.state, heading(piece, load - at.state.load)).but(load=load)
    along = heading(piece, march.sense)
    found = equilibrium(piece.body, piece.held, turned, along=along, tolerance=wanted.tolerance)
    step.tally.newton_iterations += found.iterations
    if not found.converged or _own_index(piece, found) != 0:
        return None
    return visit(piece, wanted, found)


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
