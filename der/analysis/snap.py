"""What happens past a fold: the ring snaps, and comes to rest somewhere else.

At a fold the softest mode has lost its stiffness and the energy falls along it like a cubic. A
kick along it, downhill, starts a dynamic relaxation at that same load (or dead moment); where it
comes to rest Newton's method polishes; the difference of the two equilibria is what is released.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from der.continuation.events import Visit, Wanted, visit
from der.continuation.step import Stuck, Tally
from der.rod import relaxation
from der.rod.equilibrium import ADVICE, Control, Direction, Equilibrium, equilibrium, moved
from der.rod.gripped_ring import Sector
from der.rod.relaxation import Relaxed, Rest, relax
from der.rod.rod import State
from der.rod.stability import all_modes, index, softest_modes

KICK = 0.05  # rad, root mean square: too short is slow, too long is steep in a stiff ring; what it
# costs across the valley is spent at once, and along the valley all of this side is downhill
_TOLERANCE = 1e-6  # GJ/a, of a relaxation before Newton takes over; finer where it cannot
_OFF = 1e-3  # rad, before a stop, from where a ring moves that does not rest on it
_PRESSED = 1e-8  # GJ/a: a moment against a stop that is less than this is rounding
_NEAR = 1e-2  # rad, before a stop: what rests there is looked for by Newton's method at once
_MEETS = 1e-9  # rad, of a stop: nearer is on it
_SOFT = 3  # modes nearest to zero that are looked at
_FALLS = 8  # relaxations of one snap at most
TO_AND_FRO = "its dead moment sends it to its stop and back again"


@dataclass(frozen=True)
class Landing(Visit):
    """The state in which a snap ends, and how it got there.

    ``details`` hold: gamma_fold, where stability was lost [rad]; energy_before, energy_after and
    energy_released, of the full ring, and moment_before, moment_after, of one arm; and
    force_evaluations. Under a dead moment the energy released counts the moment's work.
    """

    history: tuple[State, ...] = ()  # every k-th configuration of the relaxation
    energies: tuple[float, ...] = ()  # of the full ring, at each of them


def heading(piece: Sector, sense: float) -> Direction:
    """Direction of growing (``sense`` = 1) or falling (-1) load: it orients tangents."""
    return Direction(
        np.zeros(piece.held.free.shape), np.zeros(len(piece.held.target)), float(sense)
    )


def downhill(piece: Sector, before: Equilibrium) -> Direction:
    """Steepest way down of an unstable state at given load, of unit mass-weighted norm.

    Next to a branch point of the full ring two modes of opposite stiffness lie near zero: of those
    nearest, it is the one of the lowest eigenvalue. Of its two signs, that with the lower energy
    past a kick.
    """
    modes = all_modes(piece.held)
    stiffness, near = softest_modes(piece.body, piece.held, modes, before.state, _SOFT)
    mode = near[int(np.argmin(stiffness))]
    norm = float(np.sqrt(np.sum(piece.body.length[:, None] * mode**2) / piece.body.length.sum()))
    ways = [heading(piece, 0.0)._replace(q=sign * mode / norm) for sign in (1.0, -1.0)]
    return min(ways, key=lambda way: _kicked(piece, before, way))


def _kicked(piece: Sector, before: Equilibrium, mode: Direction) -> float:
    """Energy after a kick along a mode and onto the conditions."""
    kick = _along(mode, KICK)
    return relax(piece.body, piece.held, before.state, kick=kick, most=1).energy_start


@dataclass(frozen=True)
class _Drop:
    """What all parts of one snap share."""

    piece: Sector
    wanted: Wanted
    tally: Tally
    before: Equilibrium
    sense: float
    every: int

    def relaxed(self, start: State, moment: float | None, tolerance: float) -> Relaxed:
        """The rest of the motion from ``start``, under a dead moment or (None) at given load.

        Raises
        ------
        Stuck
            Where there is none.
        """
        fall = relax(
            self.piece.body,
            self.piece.held,
            start,
            moment=moment,
            stops=self.stops,
            tolerance=tolerance,
            every=self.every,
        )
        self.tally.force_evaluations += fall.evaluations
        if fall.rests or fall.outcome is Rest.AT_STOP:
            return fall
        where = f"vertex {fall.where} " if fall.where >= 0 else ""
        raise Stuck(f"{self.name} came to no rest: {where}{relaxation.ADVICE[fall.outcome]}")

    def polished(self, state: State, moment: float | None) -> Equilibrium:
        """The equilibrium next to a state that is nearly at rest."""
        after = equilibrium(
            self.piece.body,
            self.piece.held,
            state,
            along=heading(self.piece, self.sense),
            control=Control.LOAD if moment is None else Control.MOMENT,
            moment=moment or 0.0,
            tolerance=self.wanted.tolerance,
        )
        self.tally.newton_iterations += after.iterations
        return after

    def stopped(self, state: State, short: float = 0.0) -> State:
        """``state`` with its grips turned to the stop or ``short`` of it, nothing else moved."""
        stop = self.wanted.load_max - self.sense * short
        turn = heading(self.piece, stop - state.load)
        return moved(self.piece.held, state, turn).but(load=stop)

    @property
    def stops(self) -> tuple[float, float]:
        """Loads at which a motion under a dead moment ends: where the march ends, too."""
        end = self.wanted.load_max
        return (-np.inf, end) if self.sense > 0.0 else (end, np.inf)

    def reaches(self, after: Equilibrium) -> bool:
        """Whether a ring rests at its stop, or all but."""
        return after.converged and self.sense * (after.state.load - self.wanted.load_max) > -_MEETS

    def rests_near(self, after: Equilibrium) -> bool:
        """Whether a ring rests under its dead moment so shortly before its stop that it is let be.

        From a start further off, a motion to that state would run into the stop again.
        """
        modes = all_modes(self.piece.held)
        return (
            after.converged
            and abs(after.state.load - self.wanted.load_max) < _NEAR
            and not self.reaches(after)
            and after.slope > 0.0
            and index(self.piece.body, self.piece.held, modes, after.state) == 0
        )

    def overruns(self, after: Equilibrium, moment: float) -> bool:
        """Whether a ring held at the stop would come back from it under a dead moment."""
        return self.sense * (after.moment - moment) > _PRESSED

    @property
    def name(self) -> str:
        """Name of the snap in a sentence."""
        return f"the snap at gamma = {self.before.state.load:.8f}"


def snap(
    piece: Sector,
    wanted: Wanted,
    tally: Tally,
    before: Equilibrium,
    mode: Direction,
    *,
    dead_moment: bool = False,
    sense: float = 1.0,
    gamma_lost: float | None = None,
    every: int = 0,
) -> Landing:
    """The state in which a ring comes to rest that has lost its stability.

    Parameters
    ----------
    before : the state that loses it.
    mode : softest mode there, pointing downhill, of unit mass-weighted norm.
    dead_moment : whether gamma moves, under the moment of ``before``; it stops at
        ``wanted.load_max``.
    sense : of the march in gamma, to orient the tangent; with a dead moment, towards its stop.
    gamma_lost : where stability was lost [rad]; None: at ``before``.
    every : keep every k-th configuration of the relaxation; 0: none.

    Raises
    ------
    Stuck
        Where the ring does not come to rest, or in a state that is no minimum.
    """
    mode = mode if dead_moment else mode._replace(load=0.0)
    drop = _Drop(piece, wanted, tally, before, sense, every)
    fallen, after = _fall(drop, _along(mode, KICK), before.moment if dead_moment else None)
    work = before.moment * (after.state.load - before.state.load)
    details: Mapping[str, object] = {
        "gamma_fold": before.state.load if gamma_lost is None else gamma_lost,
        "energy_before": piece.copies * before.energy,
        "energy_after": piece.copies * after.energy,
        "energy_released": piece.copies * (before.energy + work - after.energy),
        "moment_before": piece.moment(before.moment),
        "moment_after": piece.moment(after.moment),
        "force_evaluations": sum(fall.evaluations for fall in fallen),
    }
    found = visit(piece, wanted, after)
    history = tuple(state for fall in fallen for state in fall.history)
    energies = tuple(piece.copies * float(e) for fall in fallen for e in fall.energies)
    return Landing(after, "snap", found.index, details=details, history=history, energies=energies)


def _fall(drop: _Drop, kick: Direction, moment: float | None) -> tuple[list[Relaxed], Equilibrium]:
    """Relaxations from a kicked state on, and the minimum that they lead to.

    A motion that is symmetric may end on a saddle: the ring is kicked off it and falls on.
    """
    piece = drop.piece
    fallen: list[Relaxed] = []
    start = moved(piece.held, drop.before.state, kick)
    tolerance, reason = _TOLERANCE, TO_AND_FRO
    pressing = moment  # against the stop, once it is reached
    for _ in range(_FALLS):
        fallen.append(drop.relaxed(start, moment, tolerance))
        start = fallen[-1].state
        if fallen[-1].outcome is Rest.AT_STOP:
            # gamma stays at its stop, and the rest of the dead moment presses against it
            start, moment = drop.stopped(start), None
            continue
        after = drop.polished(start, moment)
        own = index(piece.body, piece.held, all_modes(piece.held), after.state)
        if moment is not None and drop.reaches(after):
            start, moment = drop.stopped(after.state), None
        elif not after.converged:
            tolerance, reason = 1e-3 * tolerance, ADVICE[after.outcome]
        elif (
            own == 0 and moment is None and pressing is not None and drop.overruns(after, pressing)
        ):
            # the stop was only overrun: the ring comes back from it, to where the moment holds it
            near = drop.polished(after.state, pressing)
            if drop.rests_near(near):
                return fallen, near
            start, moment = drop.stopped(after.state, short=_OFF), pressing
        elif own == 0:
            return fallen, after
        else:
            mode = downhill(piece, after)
            start, reason = moved(piece.held, after.state, _along(mode, KICK)), f"index {own}"
    raise Stuck(f"{drop.name} came to rest in no minimum: {reason}")


def _along(mode: Direction, size: float) -> Direction:
    """Displacement by ``size`` along a mode; multipliers follow by themselves."""
    return Direction(size * mode.q, 0.0 * mode.force, size * mode.load)
