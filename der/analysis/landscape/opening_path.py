"""Opening of a folded ring by a growing push, from minimum to minimum.

The push, a length or an angle, grows from that of the folded ring. What may happen on the way:

    pass    the force is back at 0: the ring has been carried to where it goes on without a push
    fold    the push turns back: the minimum ceases to exist, and the ring snaps
    branch  the minimum becomes a saddle, by a mode that breaks its symmetry
    end     the actuator has no more room

From a fold or a branch point the ring snaps at the push as it is, down its energy. There and at a
pass it is released: where it then comes to rest decides whether it has been opened. If it folds up
again, pushing goes on from where the ring rests in its actuator. Work is what that has done
in all: the sum of the rises of U between the snaps.

On its way from folded to flat U has been as high as the lowest pass between them at least, and the
actuator has paid for it, since in all snaps U only sinks. **A slow push of prescribed length or
angle takes at least the work of the free barrier**, and just that where it leads to the pass.


A dead load goes up to the limit of the force, dP/ds = 0, or to a landing under less of it. There
the ring snaps under that load, and is then released. The work up to the limit may well be less than
the barrier: on the way from there the load goes on working, so that it is more in all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from der.analysis.landscape.actuators import Actuator
from der.analysis.landscape.rest_states import without_moment
from der.continuation.arclength import follow
from der.continuation.events import Events
from der.errors import ContinuationFailed
from der.problem import Increment, Options, Point, Solution, Statistics
from der.rod.dynamics import EndState, flow
from der.rod.equilibrium import Equilibrium
from der.rod.free_ring import balance
from der.rod.gripped_ring import free_supports
from der.rod.implicit_step import on_the_conditions
from der.rod.rod import State
from der.rod.system import RodSystem

_KICK = 0.05  # rad, root mean square: off a fold or a branch point
_NUDGE = 0.02  # rad, likewise: over a pass
_PAST = 1e-4  # of the tool's room: how far past a branch point the ring is let fall
_NOTHING = 1e-5  # of the largest force so far: at a pass, where the index may change, too
_LOWER = 1e-6  # of the force: a landing under less is beyond what a dead load reaches
_AT_REST = 1e-7  # GJ/a, largest force left after a fall
_MOST_SNAPS = 8  # at the push as it is
_STEPS = 300


@dataclass(frozen=True)
class Instant:
    """A point on the way to opening at which something happens."""

    kind: str  # "pass", "fold", "branch", "limit" or "end"
    state: State
    push: float  # load of the actuator
    force: float  # its conjugate
    energy: float
    work: float  # done by the actuator up to there, GJ/a
    index: tuple[int | None, int | None]  # before and after, the push held
    lands: EndState | None = None  # where the ring comes to rest once it is released


@dataclass
class Opening:
    """What a push has come to so far."""

    actuator: Actuator
    folded: float  # energy of the folded ring
    alike: float  # by how much that of the same one may differ
    options: Options
    most: float  # work beyond which it is not followed
    statistics: Statistics = field(default_factory=Statistics)
    line: list[tuple[float, float, float]] = field(default_factory=list)  # push, force, energy
    work: float = 0.0
    peak: float = 0.0  # largest force
    snaps: int = 0  # at the push as it is
    last: Instant | None = None
    dead: Instant | None = None  # the limit of a dead load
    why: str = ""  # a sentence where it could not go on

    @property
    def system(self) -> RodSystem:
        """The ring in its actuator."""
        return self.actuator.system

    def opens(self, instant: Instant | None) -> bool:
        """Whether the ring, released at an instant, stays away from its folded state."""
        lands = None if instant is None else instant.lands
        return lands is not None and lands.rests and abs(lands.energy - self.folded) > self.alike


def opened(
    actuator: Actuator,
    folded: float,
    alike: float,
    *,
    tolerance: float = 1e-10,
    most: float = np.inf,
) -> Opening:
    """Push a ring until it is opened, the actuator has no more room, or no minimum follows.

    Parameters
    ----------
    folded, alike : energy of the folded ring, and by how much that of the same one may differ.
    tolerance : of the residual of an equilibrium, GJ/a.
    most : work beyond which the push is not followed.
    """
    options = Options(tolerance=tolerance, max_steps=_STEPS)
    done = Opening(actuator, folded, alike, options, most)
    start: State | None = actuator.start
    while start is not None:
        start = _pushed(done, start)
    return done


def _pushed(done: Opening, start: State) -> State | None:
    """Minima from one state of the ring in its actuator on; where to go on from, if anywhere."""
    begin = done.folded  # what a strut has cost that starts between points in one place counts, too
    before: Point[Equilibrium] | None = None
    came: Equilibrium | None = None
    try:
        for one in _until_something(done, start):
            at = one.solution
            if before is None and done.line:
                begin = at.energy
            came, before = before.solution if before is not None else None, one
            done.line.append((at.parameter, at.moment, at.energy))
            done.peak = max(done.peak, at.moment)
            if one.kind == "limit" and done.dead is None:
                work = done.work + at.energy - begin
                past = done.system.retract(at.state, _kick(done.system, at, _KICK, load=1.0))
                done.dead = _under_dead_load(done, _instant(one, work), past)
            if done.work + at.energy - begin > done.most:
                done.why = f"more work than {done.most:.4g}: not followed further"
                break
    except ContinuationFailed as failed:
        done.why = str(failed)
    if before is None:
        done.why = "the state from which it has to go on cannot be solved for"
        return None
    done.work += before.solution.energy - begin
    done.last = _instant(before, done.work)
    return _after(done, before, came)


def _after(done: Opening, one: Point[Equilibrium], came: Equilibrium | None) -> State | None:
    """Where to go on from after the last point of a path, if anywhere."""
    assert done.last is not None
    if done.why or done.last.kind == "end":
        if done.last.index[0] not in (0, None):
            done.why = f"no minimum to start from: its index is {done.last.index[0]}"
        return None
    if came is not None and done.last.kind == "pass":
        _carry_over(done, done.last, came, one.solution)
        return None
    return _snapped(done, done.last, one)


def _until_something(done: Opening, start: State) -> Iterator[Point[Equilibrium]]:
    """Minima at a growing push, the last one that at which something happens."""
    system, before, peak = done.system, None, done.peak
    for one in follow(
        system, start, _events(done.actuator), options=done.options, statistics=done.statistics
    ):
        peak = max(peak, one.solution.moment)
        nothing = _NOTHING * peak
        if before is not None and before.solution.moment > nothing >= one.solution.moment:
            at = one.solution
            if at.moment < -nothing:
                tolerance, statistics = done.options.tolerance, done.statistics
                at = without_moment(system, before.solution, at, tolerance, statistics)
            yield Point(at, "pass", index=before.index)
            return
        yield one
        if one.kind in ("fold", "branch") or (before is None and one.index != (0,)):
            return
        before = one


def _events(actuator: Actuator) -> Events[State]:
    """What is looked for while the actuator pushes."""
    ends = (-actuator.load_max, actuator.load_max)

    def stop(at: Solution[State]) -> bool:
        return at.parameter in ends

    return Events(targets=ends, stop=stop, limits=("moment",), stability=True)


def _instant(one: Point[Equilibrium], work: float) -> Instant:
    before, after = one.sides or (one.index, one.index)
    at = one.solution
    return Instant(
        one.kind or "end",
        at.state,
        at.parameter,
        at.moment,
        at.energy,
        work,
        (before[0] if before else None, after[0] if after else None),
    )


def _snapped(done: Opening, last: Instant, one: Point[Equilibrium]) -> State | None:
    """Where the ring comes to rest in its actuator after a fold or a branch point.

    Return the state to go on from, if the ring, released there, folds up again.
    """
    at, system = one.solution, done.system
    if one.kind == "fold":
        kick = _kick(system, at, _KICK, load=0.0)
        landed = flow(system, at.state, kick=kick, tolerance=_AT_REST)
    else:
        landed = _past_branch(done, at)
    done.last = last = replace(last, lands=_released(done.actuator, landed.state))
    falls = landed.energy < at.energy or landed.moment < (1.0 - _LOWER) * at.moment
    if done.dead is None and falls:
        done.dead = _under_dead_load(done, last, landed.state)
    if done.opens(last):
        return None
    done.snaps += 1
    if not landed.rests or done.snaps == _MOST_SNAPS:
        done.why = f"the ring came to no rest in its actuator, at a push of {at.parameter:.6g}"
        return None
    return landed.state


def _carry_over(done: Opening, last: Instant, came: Equilibrium, at: Equilibrium) -> None:
    """Release the ring just past a pass, further along the way it came; pushing has ended."""
    system = done.system
    free = done.actuator.released(at.state)
    index = balance(done.actuator.rod, free.quat, free.stretch).index()
    # not the tangent: where material may shift at no cost, there are two of them
    jump = system.difference(came.state, at.state)
    jump[-1] = 0.0
    size = _NUDGE / float(np.sqrt(system.inner(jump, jump)))
    over = system.retract(at.state, system.displacement(jump, size))
    lands = _released(done.actuator, over)
    done.last = replace(last, index=(last.index[0], index), lands=lands)


def _released(actuator: Actuator, state: State) -> EndState:
    """Where a ring comes to rest whose actuator is taken away."""
    free = RodSystem(actuator.rod, free_supports(actuator.rod))
    return flow(free, actuator.released(state), tolerance=_AT_REST)


def _kick(system: RodSystem, at: Equilibrium, size: float, *, load: float) -> Increment:
    """Displacement along the path, of its load too where ``load`` is 1."""
    kick = system.displacement(at.tangent, size)
    kick[-1] *= load
    return kick


def _past_branch(done: Opening, at: Equilibrium) -> EndState:
    """Where the ring comes to rest in its actuator shortly past a branch point.

    The actuator goes so far before the ring snaps, and that is work, too.
    """
    system = done.system
    past = system.retract(at.state, system.increment(load=_PAST * done.actuator.load_max))
    on = system.correct(past, tolerance=done.options.tolerance)
    further = past.load - at.parameter
    done.work += on.energy - at.energy if on.converged else at.moment * further
    _, (mode,) = system.softest_modes(at.state)
    size = _KICK / float(np.sqrt(np.sum(system.rod.mass * mode**2)))
    ways = [system.increment(sign * size * mode) for sign in (1.0, -1.0)]

    def energy(way: Increment) -> float:
        start = system.retract(past, way)
        return on_the_conditions(system.rod, system.supports, start).energy

    return flow(system, past, kick=min(ways, key=energy), tolerance=_AT_REST)


def _under_dead_load(done: Opening, limit: Instant, start: State) -> Instant:
    """The limit of a dead load, with where the ring rests that snaps under it and is released."""
    end = flow(
        done.system,
        start,
        moment=limit.force,
        stops=(-np.inf, done.actuator.load_max),
        tolerance=_AT_REST,
    )
    return replace(limit, lands=_released(done.actuator, end.state))
