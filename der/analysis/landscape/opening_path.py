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
from der.continuation.events import Visit, Wanted
from der.continuation.step import Step, Stuck, Tally
from der.rod.equilibrium import Direction, Equilibrium, equilibrium, moved
from der.rod.falls import Fallen
from der.rod.free_ring import balance
from der.rod.gradient_flow import flow
from der.rod.gripped_ring import Sector, free_ring
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
    index: tuple[int | None, int | None]  # ways down before and after, the push held
    lands: Fallen | None = None  # where the ring comes to rest once it is let go


@dataclass
class March:
    """What a push has come to so far."""

    tool: Tool
    folded: float  # energy of the folded ring
    alike: float  # by how much that of the same one may differ
    wanted: Wanted
    tally: Tally
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
    done = March(tool, folded, alike, wanted, Tally(), most)
    start: State | None = tool.piece.start
    while start is not None:
        start = _marched(done, replace(tool.piece, start=start))
    return done


def _marched(done: March, piece: Sector) -> State | None:
    """Minima from one state of the ring in its tool on; where to go on from, if anywhere."""
    begin = done.folded  # what a strut has cost that starts between points in one place counts, too
    before: Visit | None = None
    came: Equilibrium | None = None
    try:
        for one in _until_something(piece, done):
            if before is None and done.line:
                begin = one.at.energy
            came, before = before.at if before is not None else None, one
            done.line.append((one.at.state.load, one.at.moment, one.at.energy))
            done.peak = max(done.peak, one.at.moment)
            if one.kind == "limit" and done.dead is None:
                work = done.work + one.at.energy - begin
                past = moved(piece.held, one.at.state, _kick(one.at, _KICK, load=1.0))
                done.dead = _under_dead_load(done, piece, _moment(one, work), past)
            if done.work + one.at.energy - begin > done.most:
                done.why = f"more work than {done.most:.4g}: not followed further"
                break
    except Stuck as stuck:
        done.why = str(stuck).replace("gamma", "push")  # the load of a path is a push here
    if before is None:
        done.why = "the state from which it has to go on cannot be solved for"
        return None
    done.work += before.at.energy - begin
    done.last = _moment(before, done.work)
    if done.why or done.last.kind == "end":
        if done.last.index[0] not in (0, None):
            done.why = f"no minimum to start from: {done.last.index[0]} ways down"
        return None
    if came is not None and done.last.kind == "pass":
        return _carried_over(done, piece, came, before.at)
    return _let_go(done, piece, before)


def _until_something(piece: Sector, done: March) -> Iterator[Visit]:
    """Minima at a growing push, the last one that at which something happens."""
    before: Visit | None = None
    peak = done.peak
    for one in follow(piece, done.wanted, done.tally):
        peak = max(peak, one.at.moment)
        nothing = _NOTHING * peak
        if before is not None and before.at.moment > nothing >= one.at.moment:
            at = one.at
            if at.moment < -nothing:
                at = without_moment(piece, done.wanted, done.tally, before.at, at)
            yield Visit(at, "pass", index=before.index)
            return
        yield one
        if one.kind in ("fold", "branch") or (before is None and one.index != (0,)):
            return
        before = one


def _moment(one: Visit, work: float) -> Moment:
    before, after = one.sides or (one.index, one.index)
    return Moment(
        one.kind or "end",
        one.at.state,
        one.at.state.load,
        one.at.moment,
        one.at.energy,
        work,
        (before[0] if before else None, after[0] if after else None),
    )


def _let_go(done: March, piece: Sector, one: Visit) -> State | None:
    """Let the ring go at what has happened; the state in its tool to go on from, if it folds up."""
    if done.last is None:
        return None
    at = one.at
    if one.kind == "fold":
        kick = _kick(at, _KICK, load=0.0)
        landed = flow(piece.body, piece.held, at.state, kick=kick, tolerance=_AT_REST)
    else:
        landed = _branched(done, piece, at)
    done.last = replace(done.last, lands=_freed(done.tool, landed.state))
    falls = landed.energy < at.energy or landed.moment < (1.0 - _LOWER) * at.moment
    if done.dead is None and falls:
        done.dead = _under_dead_load(done, piece, done.last, landed.state)
    if done.opens(done.last):
        return None
    done.falls += 1
    if not landed.rests or done.falls == _FALLS:
        done.why = f"the ring came to no rest in its tool, at a push of {at.state.load:.6g}"
        return None
    return landed.state


def _carried_over(done: March, piece: Sector, came: Equilibrium, at: Equilibrium) -> State | None:
    """Let the ring go just past a pass, further along the way it came; the march has ended."""
    free = done.tool.let_go(at.state)
    index = balance(done.tool.body, free.quat, free.stretch).index()
    jump = Step(piece, came, at, 1.0, done.wanted.tolerance, done.tally).jump
    # not the tangent: where material may shift at no cost, there are two of them
    size = _NUDGE / float(np.sqrt(np.sum(piece.body.mass * jump.q**2)))
    over = moved(piece.held, at.state, Direction(size * jump.q, 0.0 * jump.force, 0.0))
    if done.last is not None:
        lands = _freed(done.tool, over)
        done.last = replace(done.last, index=(done.last.index[0], index), lands=lands)
    return None


def _freed(tool: Tool, state: State) -> Fallen:
    """Where a ring comes to rest that its tool lets go of."""
    return flow(tool.body, free_ring(tool.body), tool.let_go(state), tolerance=_AT_REST)


def _kick(at: Equilibrium, size: float, *, load: float) -> Direction:
    """Displacement along the path, of its load too where ``load`` is 1."""
    t = at.tangent
    return Direction(size * t.q, 0.0 * t.force, load * size * t.load)


def _branched(done: March, piece: Sector, at: Equilibrium) -> Fallen:
    """Where the ring comes to rest in its tool shortly past a branch point.

    The tool goes so far before the ring falls, and that is work, too.
    """
    body, held = piece.body, piece.held
    past = moved(held, at.state, heading(piece, _PAST * done.tool.load_max))
    on = equilibrium(body, held, past, tolerance=done.wanted.tolerance)
    further = past.load - at.state.load
    done.work += on.energy - at.energy if on.converged else at.moment * further
    _, (mode,) = softest_modes(body, held, all_modes(held), at.state)
    size = _KICK / float(np.sqrt(np.sum(body.mass * mode**2)))
    ways = [heading(piece, 0.0)._replace(q=sign * size * mode) for sign in (1.0, -1.0)]
    lower = min(ways, key=lambda way: on_the_conditions(body, held, moved(held, past, way)).energy)
    return flow(body, held, past, kick=lower, tolerance=_AT_REST)


def _under_dead_load(done: March, piece: Sector, limit: Moment, start: State) -> Moment:
    """The limit of a dead load, with where the ring rests that falls under it and is let go."""
    fall = flow(
        piece.body,
        piece.held,
        start,
        moment=limit.force,
        stops=(-np.inf, done.tool.load_max),
        tolerance=_AT_REST,
    )
    return replace(limit, lands=_freed(done.tool, fall.state))
