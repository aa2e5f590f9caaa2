"""What happens past a fold: the ring snaps, and comes to rest somewhere else.

At a fold the softest mode has lost its stiffness and the energy falls along it like a cubic. A
kick along it, downhill, starts a dynamic relaxation at that same load (or dead moment); where it
comes to rest Newton's method polishes; the difference of the two equilibria is what is released.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from der.analysis.request import Request
from der.errors import ContinuationFailed, Reason
from der.problem import PARAMETER, Increment, Point, Statistics
from der.rod import relaxation
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.relaxation import Relaxed, Rest, relax
from der.rod.rod import State

KICK = 0.05  # rad, root mean square: too short is slow, too long is steep in a stiff ring; what it
# costs across the valley is spent at once, and along the valley all of this side is downhill
_TOLERANCE = 1e-6  # GJ/a, of a relaxation before Newton takes over; finer where it cannot
_OFF = 1e-3  # rad, before a stop, from where a ring moves that does not rest on it
_PRESSED = 1e-8  # GJ/a: a moment against a stop that is less than this is rounding
_NEAR = 1e-2  # rad, before a stop: what rests there is looked for by Newton's method at once
_MEETS = 1e-9  # rad, of a stop: nearer is on it
_SOFT = 3  # modes nearest to zero that are looked at
_RELAXATIONS = 8  # relaxations of one snap at most
TO_AND_FRO = "its dead moment sends it to its stop and back again"


@dataclass(frozen=True)
class Landing(Point[Equilibrium]):
    """The state in which a snap ends, and how it got there.

    ``details`` hold: gamma_fold, where stability was lost [rad]; energy_before, energy_after and
    energy_released, of the full ring, and moment_before, moment_after, of one arm; and
    force_evaluations. Under a dead moment the energy released counts the moment's work.
    """

    history: tuple[State, ...] = ()  # every k-th configuration of the relaxation
    energies: tuple[float, ...] = ()  # of the full ring, at each of them


def downhill(ring: GrippedRing, before: Equilibrium) -> Increment:
    """Return the direction in which the energy of an unstable state falls most, at given load.

    It has unit mass-weighted norm. Next to a branch point of the full ring two modes of opposite
    stiffness lie near zero: of those nearest, it is the one of the lowest eigenvalue. Of its two
    signs, that with the lower energy past a kick.
    """
    stiffness, near = ring.softest_modes(before.state, _SOFT)
    mode = near[int(np.argmin(stiffness))]
    norm = float(np.sqrt(np.sum(ring.rod.length[:, None] * mode**2) / ring.rod.length.sum()))
    ways = [ring.increment(sign * mode / norm) for sign in (1.0, -1.0)]
    return min(ways, key=lambda way: _kicked(ring, before, way))


def _kicked(ring: GrippedRing, before: Equilibrium, mode: Increment) -> float:
    """Energy after a kick along a mode and onto the conditions."""
    kick = ring.displacement(mode, KICK)
    return relax(ring, before.state, kick=kick, most=1).energy_start


@dataclass(frozen=True)
class _Snap:
    """What all parts of one snap share."""

    ring: GrippedRing
    request: Request
    statistics: Statistics
    before: Equilibrium
    sense: float
    every: int

    def relaxed(self, start: State, moment: float | None, tolerance: float) -> Relaxed:
        """The rest of the motion from ``start``, under a dead moment or (None) at given load.

        Raises
        ------
        ContinuationFailed
            Where there is none.
        """
        fall = relax(
            self.ring,
            start,
            moment=moment,
            stops=self.stops,
            tolerance=tolerance,
            every=self.every,
        )
        self.statistics.force_evaluations += fall.evaluations
        if fall.rests or fall.outcome is Rest.AT_STOP:
            return fall
        where = f"vertex {fall.where} " if fall.where >= 0 else ""
        advice = relaxation.ADVICE[fall.outcome]
        raise ContinuationFailed(
            f"{self.name} came to no rest: {where}{advice}", Reason.NOT_AT_REST
        )

    def polished(self, state: State, moment: float | None) -> Equilibrium:
        """The equilibrium next to a state that is nearly at rest."""
        after = self.ring.correct(
            state,
            along=self.ring.increment(load=self.sense),
            hold=PARAMETER if moment is None else "moment",
            value=moment,
            tolerance=self.request.tolerance,
        )
        self.statistics.newton_iterations += after.iterations
        return after

    def stopped(self, state: State, short: float = 0.0) -> State:
        """``state`` with its grips turned to the stop or ``short`` of it, nothing else moved."""
        stop = self.request.gamma_max - self.sense * short
        turn = self.ring.increment(load=stop - state.load)
        return self.ring.retract(state, turn).but(load=stop)

    @property
    def stops(self) -> tuple[float, float]:
        """Loads at which a motion under a dead moment ends: where the march ends, too."""
        end = self.request.gamma_max
        return (-np.inf, end) if self.sense > 0.0 else (end, np.inf)

    def reaches(self, after: Equilibrium) -> bool:
        """Whether a ring rests at its stop, or all but."""
        return after.converged and self.sense * (after.parameter - self.request.gamma_max) > -_MEETS

    def rests_near(self, after: Equilibrium) -> bool:
        """Whether a ring rests under its dead moment so shortly before its stop that it is let be.

        From a start further off, a motion to that state would run into the stop again.
        """
        return (
            after.converged
            and abs(after.parameter - self.request.gamma_max) < _NEAR
            and not self.reaches(after)
            and after.slope > 0.0
            and self.ring.index(after.state) == 0
        )

    def overruns(self, after: Equilibrium, moment: float) -> bool:
        """Whether a ring held at the stop would come back from it under a dead moment."""
        return self.sense * (after.moment - moment) > _PRESSED

    @property
    def name(self) -> str:
        """Name of the snap in a sentence."""
        return f"the snap at gamma = {self.before.parameter:.8f}"


def snap(
    ring: GrippedRing,
    request: Request,
    statistics: Statistics,
    before: Equilibrium,
    mode: Increment,
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
        ``request.gamma_max``.
    sense : of the march in gamma, to orient the tangent; with a dead moment, towards its stop.
    gamma_lost : where stability was lost [rad]; None: at ``before``.
    every : keep every k-th configuration of the relaxation; 0: none.

    Raises
    ------
    ContinuationFailed
        Where the ring does not come to rest, or in a state that is no minimum.
    """
    if not dead_moment:
        mode = np.append(mode[:-1], 0.0)
    snapping = _Snap(ring, request, statistics, before, sense, every)
    moment = before.moment if dead_moment else None
    relaxations, after = _settled(snapping, ring.displacement(mode, KICK), moment)
    work = before.moment * (after.parameter - before.parameter)
    details: Mapping[str, object] = {
        "gamma_fold": before.parameter if gamma_lost is None else gamma_lost,
        "energy_before": ring.copies * before.energy,
        "energy_after": ring.copies * after.energy,
        "energy_released": ring.copies * (before.energy + work - after.energy),
        "moment_before": ring.arm_moment(before.moment),
        "moment_after": ring.arm_moment(after.moment),
        "force_evaluations": sum(one.evaluations for one in relaxations),
    }
    found = request.point(ring, after)
    history = tuple(state for one in relaxations for state in one.history)
    energies = tuple(ring.copies * float(e) for one in relaxations for e in one.energies)
    return Landing(after, "snap", found.index, details=details, history=history, energies=energies)


def _settled(
    snapping: _Snap, kick: Increment, moment: float | None
) -> tuple[list[Relaxed], Equilibrium]:
    """Relaxations from a kicked state on, and the minimum that they lead to.

    A motion that is symmetric may end on a saddle: the ring is kicked off it and falls on.
    """
    ring = snapping.ring
    relaxations: list[Relaxed] = []
    start = ring.retract(snapping.before.state, kick)
    tolerance, reason = _TOLERANCE, TO_AND_FRO
    pressing = moment  # against the stop, once it is reached
    for _ in range(_RELAXATIONS):
        relaxations.append(snapping.relaxed(start, moment, tolerance))
        start = relaxations[-1].state
        if relaxations[-1].outcome is Rest.AT_STOP:
            # gamma stays at its stop, and the rest of the dead moment presses against it
            start, moment = snapping.stopped(start), None
            continue
        after = snapping.polished(start, moment)
        own = ring.index(after.state)
        if moment is not None and snapping.reaches(after):
            start, moment = snapping.stopped(after.state), None
        elif not after.converged:
            tolerance, reason = 1e-3 * tolerance, after.advice
        elif (
            own == 0
            and moment is None
            and pressing is not None
            and snapping.overruns(after, pressing)
        ):
            # the stop was only overrun: the ring comes back from it, to where the moment holds it
            near = snapping.polished(after.state, pressing)
            if snapping.rests_near(near):
                return relaxations, near
            start, moment = snapping.stopped(after.state, short=_OFF), pressing
        elif own == 0:
            return relaxations, after
        else:
            mode = downhill(ring, after)
            start, reason = ring.retract(after.state, ring.displacement(mode, KICK)), f"index {own}"
    raise ContinuationFailed(
        f"{snapping.name} came to rest in no minimum: {reason}", Reason.NO_MINIMUM
    )
