"""Snaps: the ring loses stability at a fold or branch point and relaxes to another equilibrium.

At a fold the softest mode has no stiffness, and the energy decreases along it like a cubic. A small
displacement along it, downhill, starts a dynamic relaxation at the same load (or dead moment).
Newton's method polishes its end state. The energy released is the difference of the two equilibria.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.analysis.request import Request
from der.errors import ContinuationFailed, Reason
from der.problem import PARAMETER, Increment, Indices, Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.relaxation import Relaxed, Rest, relax
from der.rod.rod import State

KICK = 0.05  # rad, root mean square: a smaller one makes relaxation slow, a larger one costs energy
# in a stiff ring; that energy is lost at once, and the motion then goes downhill
_TOLERANCE = 1e-6  # GJ/a, of a relaxation before Newton's method; finer if that fails
_OFF = 1e-3  # rad, before a stop: from here a ring moves that does not stay at the stop
_PRESSED = 1e-8  # GJ/a: a smaller moment against a stop is rounding
_NEAR = 1e-2  # rad, before a stop: equilibria so close are found by Newton's method at once
_MEETS = 1e-9  # rad, of a stop: nearer is at the stop
_SOFT = 3  # modes nearest to zero that are computed
_RELAXATIONS = 8  # relaxations of one snap at most
TO_AND_FRO = "its dead moment sends it to its stop and back again"


@dataclass(frozen=True)
class Landing(Point[Equilibrium]):
    """The end state of a snap, and the relaxation to it.

    ``details`` hold: gamma_fold, where stability was lost [rad]; energy_before, energy_after and
    energy_released, of the full ring, and moment_before, moment_after, of one arm; and
    force_evaluations. Under a dead moment the energy released counts the moment's work.
    """

    history: tuple[State, ...] = ()  # every k-th configuration of the relaxation
    energies: tuple[float, ...] = ()  # of the full ring, at each of them


def downhill(ring: GrippedRing, before: Equilibrium) -> Increment:
    """Return the direction of steepest decrease of the energy of an unstable state, at given load.

    It has unit mass-weighted norm. Next to a branch point of the full ring two modes of opposite
    stiffness lie near zero: of those nearest, it is the one of the lowest eigenvalue. Its sign is
    that of the lower energy after a small displacement.
    """
    stiffness, near = ring.softest_modes(before.state, _SOFT)
    mode = near[int(np.argmin(stiffness))]
    norm = float(np.sqrt(np.sum(ring.rod.length[:, None] * mode**2) / ring.rod.length.sum()))

    def energy(direction: Increment) -> float:
        kick = ring.displacement(direction, KICK)
        return relax(ring, before.state, kick=kick, most=1).energy_start

    return min((ring.increment(sign * mode / norm) for sign in (1.0, -1.0)), key=energy)


def check_symmetry(ring: GrippedRing, at: Equilibrium, index: Indices | None) -> None:
    """Raise an error if a state is unstable in a class that the sector cannot follow."""
    counts = list(zip(ring.classes, index or (), strict=False))
    breaking = [name for name, count in counts[1:] if count]
    if breaking:
        raise ContinuationFailed(
            f"the state at gamma = {at.parameter:.8f} is unstable to modes"
            f" ({', '.join(breaking)}) that break the symmetry of its {ring.name};"
            " the sector 'full' follows it",
            Reason.BREAKS_SYMMETRY,
        )


def snap_details(
    ring: GrippedRing,
    gamma: float,
    before: tuple[float, float],
    after: tuple[float, float],
    evaluations: int,
    work: float = 0.0,
) -> dict[str, object]:
    """Return the ``details`` of a `Landing`.

    Parameters
    ----------
    gamma : where stability was lost [rad].
    before, after : energy and conjugate moment of the sector in the two states.
    work : of a dead moment on the sector.
    """
    return {
        "gamma_fold": gamma,
        "energy_before": ring.copies * before[0],
        "energy_after": ring.copies * after[0],
        "energy_released": ring.copies * (before[0] + work - after[0]),
        "moment_before": ring.arm_moment(before[1]),
        "moment_after": ring.arm_moment(after[1]),
        "force_evaluations": evaluations,
    }


@dataclass(frozen=True)
class Snap:
    """The snap of a ring that has lost its stability.

    Parameters
    ----------
    before : the state that loses it.
    sense : of loading in gamma, to orient the tangent; with a dead moment, towards its stop.
    every : keep every k-th configuration of the relaxation; 0: none.
    """

    ring: GrippedRing
    request: Request
    statistics: Statistics
    before: Equilibrium
    sense: float = 1.0
    every: int = 0

    def landing(
        self, mode: Increment, *, dead_moment: bool = False, gamma_lost: float | None = None
    ) -> Landing:
        """Return the end state of the snap.

        Parameters
        ----------
        mode : softest mode before the snap, pointing downhill, of unit mass-weighted norm.
        dead_moment : whether gamma moves, under the moment of ``before``; it stops at
            ``request.gamma_max``.
        gamma_lost : where stability was lost [rad]; None: at ``before``.

        Raises
        ------
        ContinuationFailed
            If the ring does not come to rest, or its end state is no minimum.
        """
        ring, before = self.ring, self.before
        kick, moment = ring.displacement(mode, KICK), before.moment if dead_moment else None
        kick[-1] *= dead_moment
        relaxations, after = _settled(self, kick, moment)
        details = snap_details(
            ring,
            before.parameter if gamma_lost is None else gamma_lost,
            (before.energy, before.moment),
            (after.energy, after.moment),
            sum(one.evaluations for one in relaxations),
            work=before.moment * (after.parameter - before.parameter),
        )
        index = self.request.point(ring, after).index
        history = tuple(state for one in relaxations for state in one.history)
        energies = tuple(ring.copies * float(e) for one in relaxations for e in one.energies)
        return Landing(after, "snap", index, details=details, history=history, energies=energies)

    def relaxed(self, start: State, moment: float | None, tolerance: float) -> Relaxed:
        """The relaxation from ``start``, under a dead moment or (None) at given load.

        Raises
        ------
        ContinuationFailed
            If the ring does not come to rest.
        """
        found = relax(
            self.ring,
            start,
            moment=moment,
            stops=self.stops,
            tolerance=tolerance,
            every=self.every,
        )
        self.statistics.force_evaluations += found.evaluations
        if found.rests or found.outcome is Rest.AT_STOP:
            return found
        raise ContinuationFailed(f"{self.name} came to no rest: {found.advice}", Reason.NOT_AT_REST)

    def polished(self, state: State, moment: float | None) -> Equilibrium:
        """The equilibrium next to a state that is almost at rest."""
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
        """``state`` with its grips turned to the stop or ``short`` of it, all else unchanged."""
        return self.ring.at_load(state, self.request.gamma_max - self.sense * short)

    @property
    def stops(self) -> tuple[float, float]:
        """Loads at which a motion under a dead moment ends: the end of loading."""
        end = self.request.gamma_max
        return (-np.inf, end) if self.sense > 0.0 else (end, np.inf)

    def reaches(self, after: Equilibrium) -> bool:
        """Whether a state is at the stop or beyond, to rounding."""
        return after.converged and self.sense * (after.parameter - self.request.gamma_max) > -_MEETS

    def rests_near(self, after: Equilibrium) -> bool:
        """Whether a state is a minimum under the dead moment just before the stop.

        A motion to it from a more distant start would reach the stop again.
        """
        return (
            after.converged
            and abs(after.parameter - self.request.gamma_max) < _NEAR
            and not self.reaches(after)
            and after.slope > 0.0
            and self.ring.index(after.state) == 0
        )

    def overruns(self, after: Equilibrium, moment: float) -> bool:
        """Whether a ring held at the stop would move back from it under a dead moment."""
        return self.sense * (after.moment - moment) > _PRESSED

    @property
    def name(self) -> str:
        """Name of the snap in a sentence."""
        return f"the snap at gamma = {self.before.parameter:.8f}"


def _settled(
    snapping: Snap, kick: Increment, moment: float | None
) -> tuple[list[Relaxed], Equilibrium]:
    """Relaxations from a displaced state, and the minimum at their end.

    A symmetric motion may end on a saddle: the ring is displaced from it and relaxes further.
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
            # gamma stays at its stop, and part of the dead moment presses against it
            start, moment = snapping.stopped(start), None
            continue
        after = snapping.polished(start, moment)
        own = ring.index(after.state)
        if moment is not None and snapping.reaches(after):
            start, moment = snapping.stopped(after.state), None
        elif not after.converged:
            tolerance, reason = 1e-3 * tolerance, after.advice
        elif own != 0:
            mode = downhill(ring, after)
            start, reason = ring.retract(after.state, ring.displacement(mode, KICK)), f"index {own}"
        elif moment is not None and after.slope < 0.0:
            # with the moment held there is one more unstable mode: the tangent
            start = ring.retract(after.state, ring.displacement(after.tangent, KICK))
            reason = "dM/dgamma < 0"
        elif moment is None and pressing is not None and snapping.overruns(after, pressing):
            # the ring moves back from the stop, to its equilibrium under the dead moment
            near = snapping.polished(after.state, pressing)
            if snapping.rests_near(near):
                return relaxations, near
            start, moment = snapping.stopped(after.state, short=_OFF), pressing
        else:
            return relaxations, after
    raise ContinuationFailed(
        f"{snapping.name} came to rest in no minimum: {reason}", Reason.NO_MINIMUM
    )
