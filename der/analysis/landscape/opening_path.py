"""A folded ring is pushed until it opens: a march of minima at a prescribed push.

The push, a length or an angle, grows from that of the folded ring. What may happen on the way:

    pass    the force is back at 0: the ring has been carried to where it goes on without a push
    fold    the push turns back: the minimum ceases to exist, and the ring snaps
    branch  the minimum becomes a saddle, by a mode that breaks its symmetry
    end     the tool has no more room

From a fold or a branch point the ring falls at the push as it is, down its energy. There and at a
pass it is let go: where it then comes to rest decides whether it has been opened. If it folds up
again, the march goes on from where the ring has landed in its tool. Work is what the tool has done
in all: the sum of the rises of U between the falls.

On its way from folded to flat U has been as high as the lowest pass between them at least, and the
tool has paid for it, since in all falls U only sinks. **A slow push of prescribed length or angle
takes at least the work of the free barrier**, and just that where it leads to the pass itself.

A dead load goes up to the limit of the force, dP/ds = 0, or to a landing under less of it. There
the ring falls under that load, and is then let go. The work up to the limit may well be less than
the barrier: on the way from there the load goes on working, so that it is more in all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from der.analysis.landscape.actuators import Tool
from der.analysis.landscape.rest_states import without_moment
from der.analysis.snap import heading
from der.continuation.arclength import follow
from der.continuation.events import Point, Wanted
from der.continuation.step import Step, ContinuationFailed, Statistics
from der.rod.equilibrium import Direction, Equilibrium, equilibrium, moved
from der.rod.falls import EndState
from der.rod.free_ring import balance
from der.rod.gradient_flow import flow
from der.rod.gripped_ring import GrippedRing, free_ring
from der.rod.implicit_step import on_the_conditions
from der.rod.rod import State
from der.rod.stability import all_modes, softest_modes

_KICK = 0.05  # rad, root mean square: off a fold or a branch point
_NUDGE = 0.02  # rad, likewise: over a pass
_PAST = 1e-4  # of the tool's room: how far past a branch point the ring is let fall
_NOTHING = 1e-5  # of the largest force so far: at a pass, where the index may change, too
_LOWER = 1e-6  # of the force: a landing under less is beyond what a dead load reaches
_AT_REST = 1e-7  # GJ/a, largest force left after a fall
_FALLS = 8  # at the push as it is
_STEPS = 300


@dataclass(frozen=True)
class Moment:
    """An instant of a march at which something happens."""

    kind: str  # "pass", "fold", "branch", "limit" or "end"
    state: State
    push: float  # load of the tool
    force: float  # its conjugate
    energy: float
    work: float  # done by the tool up to there, GJ/a
    index: tuple[int | None, int | None]  # ways down before and after, the push supports
    lands: EndState | None = None  # where the ring comes to rest once it is let go


@dataclass
class March:
    """What a push has come to so far."""

    tool: Tool
    folded: float  # energy of the folded ring
    alike: float  # by how much that of the same one may differ
    wanted: Wanted
    statistics: Statistics
    most: float  # work beyond which it is not followed
    line: list[tuple[float, float, float]] = field(default_factory=list)  # push, force, energy
    work: float = 0.0
    peak: float = 0.0  # largest force
    falls: int = 0  # at the push as it is
    last: Moment | None = None
    dead: Moment | None = None  # the limit of a dead load
    why: str = ""  # a sentence where the march could not go on

    def opens(self, moment: Moment | None) -> bool:
        """Whether the ring, let go at a moment, stays away from its folded state."""
        lands = None if moment is None else moment.lands
        return lands is not None and lands.rests and abs(lands.energy - self.folded) > self.alike


def march(
    tool: Tool, folded: float, alike: float, *, tolerance: float = 1e-10, most: float = np.inf
) -> March:
    """Push a ring until it is opened, the tool has no more room, or the march cannot go on.

    Parameters
    ----------
    folded, alike : energy of the folded ring, and by how much that of the same one may differ.
    tolerance : of the residual of an equilibrium, GJ/a.
    most : work beyond which the march is not followed.
    """
    wanted = Wanted(tool.load_max, targets=(), contacts=False, tolerance=tolerance)
    wanted = replace(wanted, most_steps=_STEPS)
    done = March(tool, folded, alike, wanted, Statistics(), most)
    start: State | None = tool.ring.start
    while start is not None:
        start = _marched(done, replace(tool.ring, start=start))
    return done


def _marched(done: March, ring: GrippedRing) -> State | None:
    """Minima from one state of the ring in its tool on; where to go on from, if anywhere."""
    begin = done.folded  # what a strut has cost that starts between points in one place counts, too
    before: Point | None = None
    came: Equilibrium | None = None
    try:
        for one in _until_something(ring, done):
            if before is None and done.line:
                begin = one.solution.energy
            came, before = before.solution if before is not None else None, one
            done.line.append((one.solution.parameter, one.solution.moment, one.solution.energy))
            done.peak = max(done.peak, one.solution.moment)
            if one.kind == "limit" and done.dead is None:
                work = done.work + one.solution.energy - begin
                past = ring.retract(one.solution.state, _kick(one.solution, _KICK, load=1.0))
                done.dead = _under_dead_load(done, ring, _moment(one, work), past)
            if done.work + one.solution.energy - begin > done.most:
                done.why = f"more work than {done.most:.4g}: not followed further"
                break
    except ContinuationFailed as stuck:
        done.why = str(stuck).replace("gamma", "push")  # the load of a path is a push here
    if before is None:
        done.why = "the state from which it has to go on cannot be solved for"
        return None
    done.work += before.solution.energy - begin
    done.last = _moment(before, done.work)
    if done.why or done.last.kind == "end":
        if done.last.index[0] not in (0, None):
            done.why = f"no minimum to start from: {done.last.index[0]} ways down"
        return None
    if came is not None and done.last.kind == "pass":
        return _carried_over(done, ring, came, before.solution)
    return _let_go(done, ring, before)


def _until_something(ring: GrippedRing, done: March) -> Iterator[Point]:
    """Minima at a growing push, the last one that at which something happens."""
    before: Point | None = None
    peak = done.peak
    for one in follow(ring, done.wanted, done.statistics):
        peak = max(peak, one.solution.moment)
        nothing = _NOTHING * peak
        if before is not None and before.solution.moment > nothing >= one.solution.moment:
            at = one.solution
            if at.moment < -nothing:
                at = without_moment(ring, done.wanted, done.statistics, before.solution, at)
            yield Point(at, "pass", index=before.index)
            return
        yield one
        if one.kind in ("fold", "branch") or (before is None and one.index != (0,)):
            return
        before = one


def _moment(one: Point, work: float) -> Moment:
    before, after = one.sides or (one.index, one.index)
    return Moment(
        one.kind or "end",
        one.solution.state,
        one.solution.parameter,
        one.solution.moment,
        one.solution.energy,
        work,
        (before[0] if before else None, after[0] if after else None),
    )


def _let_go(done: March, ring: GrippedRing, one: Point) -> State | None:
    """Let the ring go at what has happened; the state in its tool to go on from, if it folds up."""
    if done.last is None:
        return None
    at = one.solution
    if one.kind == "fold":
        kick = _kick(at, _KICK, load=0.0)
        landed = flow(ring, at.state, kick=kick, tolerance=_AT_REST)
    else:
        landed = _branched(done, ring, at)
    done.last = replace(done.last, lands=_freed(done.tool, landed.state))
    falls = landed.energy < at.energy or landed.moment < (1.0 - _LOWER) * at.moment
    if done.dead is None and falls:
        done.dead = _under_dead_load(done, ring, done.last, landed.state)
    if done.opens(done.last):
        return None
    done.falls += 1
    if not landed.rests or done.falls == _FALLS:
        done.why = f"the ring came to no rest in its tool, at a push of {at.state.load:.6g}"
        return None
    return landed.state


def _carried_over(
    done: March, ring: GrippedRing, came: Equilibrium, at: Equilibrium
) -> State | None:
    """Let the ring go just past a pass, further along the way it came; the march has ended."""
    free = done.tool.let_go(at.state)
    index = balance(done.tool.rod, free.quat, free.stretch).index()
    jump = Step(ring, came, at, 1.0, done.wanted.tolerance, done.statistics).jump
    # not the tangent: where material may shift at no cost, there are two of them
    size = _NUDGE / float(np.sqrt(np.sum(ring.rod.mass * jump.q**2)))
    over = ring.retract(at.state, Direction(size * jump.q, 0.0 * jump.force, 0.0))
    if done.last is not None:
        lands = _freed(done.tool, over)
        done.last = replace(done.last, index=(done.last.index[0], index), lands=lands)
    return None


def _freed(tool: Tool, state: State) -> EndState:
    """Where a ring comes to rest that its tool lets go of."""
    return flow(tool.rod, free_ring(tool.rod), tool.let_go(state), tolerance=_AT_REST)


def _kick(at: Equilibrium, size: float, *, load: float) -> Direction:
    """Displacement along the path, of its load too where ``load`` is 1."""
    t = at.tangent
    return Direction(size * t.q, 0.0 * t.force, load * size * t.load)


def _branched(done: March, ring: GrippedRing, at: Equilibrium) -> EndState:
    """Where the ring comes to rest in its tool shortly past a branch point.

    The tool goes so far before the ring falls, and that is work, too.
    """
    rod, supports = ring.rod, ring.supports
    past = moved(supports, at.state, ring.heading(_PAST * done.tool.load_max))
    on = equilibrium(rod, supports, past, tolerance=done.wanted.tolerance)
    further = past.load - at.state.load
    done.work += on.energy - at.energy if on.converged else at.moment * further
    _, (mode,) = softest_modes(rod, supports, all_modes(supports), at.state)
    size = _KICK / float(np.sqrt(np.sum(rod.mass * mode**2)))
    ways = [ring.heading(0.0)._replace(q=sign * size * mode) for sign in (1.0, -1.0)]
    lower = min(
        ways, key=lambda way: on_the_conditions(rod, supports, moved(supports, past, way)).energy
    )
    return flow(rod, supports, past, kick=lower, tolerance=_AT_REST)


def _under_dead_load(done: March, ring: GrippedRing, limit: Moment, start: State) -> Moment:
    """The limit of a dead load, with where the ring rests that falls under it and is let go."""
    fall = flow(
        ring,
        start,
        moment=limit.force,
        stops=(-np.inf, done.tool.load_max),
        tolerance=_AT_REST,
    )
    return replace(limit, lands=_freed(done.tool, fall.state))
