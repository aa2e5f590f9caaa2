"""Opening of a folded ring by an actuator, from minimum to minimum.

The push of the actuator, a length or an angle, grows from that of the folded ring. Events:

    pass    the force returns to 0: beyond, the free ring moves on without a push
    fold    the push turns back: the minimum ceases to exist, and the ring snaps
    branch  the minimum becomes a saddle, by a mode that breaks its symmetry
    end     the actuator has reached its largest push

From a fold or a branch point the ring snaps at constant push to a state of less energy. There, and
at a pass, it is also released. The end state of the released ring decides whether the ring is open.
If it folds again, loading continues from the end state in the actuator. The work is the sum of the
increases of U between the snaps.

Between folded and flat, U is at least as high as the lowest pass between them. The actuator has
done this work, because U only decreases in snaps. **Slow loading by a prescribed length or angle
takes at least the work of the free barrier**, and exactly this work if it leads to the pass.

A dead load grows up to the limit of the force, dP/ds = 0, or until the ring snaps to a state of
smaller force. There the ring snaps under this load, and is then released. The work up to the limit
may be less than the barrier: the load does more work during the snap.
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
from der.problem import Increment, Options, Point, Statistics
from der.rod.dynamics import EndState, flow
from der.rod.equilibrium import Equilibrium
from der.rod.free_ring import balance
from der.rod.gripped_ring import free_supports
from der.rod.implicit_step import on_the_conditions
from der.rod.rod import State
from der.rod.system import RodSystem

_KICK = 0.05  # rad, root mean square: from a fold or a branch point
_NUDGE = 0.02  # rad, likewise: over a pass
_PAST = 1e-4  # of the largest push: distance behind a branch point at which the ring snaps
_NOTHING = 1e-5  # of the largest force so far: at a pass, where the index may change, too
_LOWER = 1e-6  # of the force: an end state of smaller force is not reached by a dead load
_AT_REST = 1e-7  # GJ/a, largest force left after a snap
_MOST_SNAPS = 8  # at constant push
_STEPS = 300


@dataclass(frozen=True)
class Instant:
    """A point of the loading with an event."""

    kind: str  # "pass", "fold", "branch", "limit" or "end"
    state: State
    push: float  # load of the actuator
    force: float  # its conjugate
    energy: float
    work: float  # done by the actuator up to there, GJ/a
    index: tuple[int | None, int | None]  # before and after, the push held
    lands: EndState | None = None  # end state of the released ring


@dataclass
class Opening:
    """Loading by one actuator, so far."""

    actuator: Actuator
    folded: float  # energy of the folded ring
    alike: float  # energies that differ by less belong to one state
    options: Options
    most: float  # work beyond which loading is not followed
    statistics: Statistics = field(default_factory=Statistics)
    line: list[tuple[float, float, float]] = field(default_factory=list)  # push, force, energy
    work: float = 0.0
    peak: float = 0.0  # largest force
    snaps: int = 0  # at constant push
    last: Instant | None = None
    dead: Instant | None = None  # the limit of a dead load
    why: str = ""  # a sentence if loading could not continue

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
    """Load a ring until it opens, the actuator reaches its end, or no minimum follows.

    Parameters
    ----------
    folded : energy of the folded ring.
    alike : energies that differ by less belong to one state.
    tolerance : of the residual of an equilibrium, GJ/a.
    most : work beyond which loading is not followed.
    """
    options = Options(tolerance=tolerance, max_steps=_STEPS)
    done = Opening(actuator, folded, alike, options, most)
    start: State | None = actuator.start
    while start is not None:
        start = _pushed(done, start)
    return done


def _pushed(done: Opening, start: State) -> State | None:
    """Follow the minima from one state of the ring in its actuator; return where to continue."""
    begin = done.folded  # the work to place a strut between coincident points counts, too
    before: Point[Equilibrium] | None = None
    came: Equilibrium | None = None
    try:
        for one in _until_event(done, start):
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
        done.why = "the state from which loading continues cannot be solved for"
        return None
    done.work += before.solution.energy - begin
    done.last = _instant(before, done.work)
    return _after(done, before, came)


def _after(done: Opening, one: Point[Equilibrium], came: Equilibrium | None) -> State | None:
    """Return the state from which loading continues after the last point of a path, if any."""
    assert done.last is not None
    if done.why or done.last.kind == "end":
        if done.last.index[0] not in (0, None):
            done.why = f"no minimum to start from: its index is {done.last.index[0]}"
        return None
    if came is not None and done.last.kind == "pass":
        _carry_over(done, done.last, came, one.solution)
        return None
    return _snapped(done, done.last, one)


def _until_event(done: Opening, start: State) -> Iterator[Point[Equilibrium]]:
    """Minima at a growing push, the last one with an event."""
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
    """Events of the loading."""
    ends = (-actuator.load_max, actuator.load_max)
    return Events(
        targets=ends, stop=lambda at: at.parameter in ends, limits=("moment",), stability=True
    )


def _instant(one: Point[Equilibrium], work: float) -> Instant:
    before, after = one.sides or (one.index, one.index)
    index = (before[0] if before else None, after[0] if after else None)
    at = one.solution
    values = (at.parameter, at.moment, at.energy, work)
    return Instant(one.kind or "end", at.state, *values, index)


def _snapped(done: Opening, last: Instant, one: Point[Equilibrium]) -> State | None:
    """Snap to the end state in the actuator after a fold or a branch point.

    Return it if the ring, released there, folds again: loading continues from it.
    """
    at, system = one.solution, done.system
    if one.kind == "fold":
        kick = _kick(system, at, _KICK, load=0.0)
        landed = flow(system, at.state, kick=kick, tolerance=_AT_REST)
    else:
        landed = _past_branch(done, at)
    done.last = last = replace(last, lands=_released(done.actuator, landed.state))
    lower = landed.energy < at.energy or landed.moment < (1.0 - _LOWER) * at.moment
    if done.dead is None and lower:
        done.dead = _under_dead_load(done, last, landed.state)
    if done.opens(last):
        return None
    done.snaps += 1
    if not landed.rests or done.snaps == _MOST_SNAPS:
        done.why = f"the ring did not come to rest in its actuator, at a push of {at.parameter:.6g}"
        return None
    return landed.state


def _carry_over(done: Opening, last: Instant, came: Equilibrium, at: Equilibrium) -> None:
    """Release the ring just past a pass, further along its path; loading has ended."""
    system = done.system
    free = done.actuator.released(at.state)
    index = balance(done.actuator.rod, free.quat, free.stretch).index()
    # not the tangent: if material may shift without energy, there are two of them
    jump = system.difference(came.state, at.state)
    jump[-1] = 0.0
    size = _NUDGE / float(np.sqrt(system.inner(jump, jump)))
    over = system.retract(at.state, system.displacement(jump, size))
    lands = _released(done.actuator, over)
    done.last = replace(last, index=(last.index[0], index), lands=lands)


def _released(actuator: Actuator, state: State) -> EndState:
    """End state of a ring whose actuator is removed."""
    free = RodSystem(actuator.rod, free_supports(actuator.rod))
    return flow(free, actuator.released(state), tolerance=_AT_REST)


def _kick(system: RodSystem, at: Equilibrium, size: float, *, load: float) -> Increment:
    """Displacement along the path; its load moves, too, if ``load`` is 1."""
    kick = system.displacement(at.tangent, size)
    kick[-1] *= load
    return kick


def _past_branch(done: Opening, at: Equilibrium) -> EndState:
    """End state of the ring in its actuator shortly past a branch point.

    The actuator moves to there before the ring snaps, and does work.
    """
    system = done.system
    past = system.retract(at.state, system.increment(load=_PAST * done.actuator.load_max))
    on = system.correct(past, tolerance=done.options.tolerance)
    further = past.load - at.parameter
    done.work += on.energy - at.energy if on.converged else at.moment * further
    _, (mode,) = system.softest_modes(at.state)
    size = _KICK / float(np.sqrt(np.sum(system.rod.mass * mode**2)))
    kicks = [system.increment(sign * size * mode) for sign in (1.0, -1.0)]
    lower = min(kicks, key=lambda one: on_the_conditions(system, system.retract(past, one)).energy)
    return flow(system, past, kick=lower, tolerance=_AT_REST)


def _under_dead_load(done: Opening, limit: Instant, start: State) -> Instant:
    """The limit of a dead load, with the end state of the ring that snaps under it."""
    stops = (-np.inf, done.actuator.load_max)
    end = flow(done.system, start, moment=limit.force, stops=stops, tolerance=_AT_REST)
    return replace(limit, lands=_released(done.actuator, end.state))
