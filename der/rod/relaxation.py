"""Dynamic relaxation: a rod moves, is stopped at every peak of kinetic energy, and comes to rest.

Fictitious masses turn the search for a minimum of the energy into motion in unit time steps
(Day 1965; Barnes 1999; Papadrakakis 1981). The full matrix of the rod is neither formed nor
factored: a step needs the gradient, one mass block for each edge, and an m x m system for m <= 5
position conditions.

    masses      the lightest that the unit step allows (`masses`), times a margin; if the rod gains
                energy nevertheless, they are increased
    conditions  constraint forces keep the accelerations on them; the velocity of each step removes
                the error of the last step, in the metric of the masses
    damping     kinetic: after a peak of the kinetic energy the rod goes back to the middle of the
                last step and starts again from rest (Barnes 1999)

Bending and twisting are of second order in arc length when the unknowns are rotations of frames,
so the number of steps grows like the number of edges. With positions it would grow like its square.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from der.kernels.forces import Motion, Pull, clear, conditions, gradient
from der.kernels.masses import Masses, condition_metric, solve_metric, weigh
from der.kernels.quaternions import Array, into_frame, turned
from der.packs.kernel import kernel
from der.problem import Increment
from der.rod.rod import State
from der.rod.supports import Supports
from der.rod.system import RodSystem

_MARGIN = 1.2  # of the masses above the lightest stable ones; 1.05 to 1.5: -10 to +70 % of the cost
_HEAVIER = 1.5  # factor on the masses of a rod that has gained energy
_GAIN = 1e-9  # of the energy: less is rounding and the second order of the conditions
_CLOSED = 1e-6  # a; a larger gap is closed before the motion starts
_PROJECTIONS = 20
_SLOTS = 2048  # of the album: of a longer motion every second configuration is removed


class Rest(IntEnum):
    """How a motion ended."""

    AT_REST = 0
    TOO_MANY_EVALUATIONS = 1
    DIVERGED = 2
    BENT_TOO_FAR = 3
    AT_STOP = 4


ADVICE = {
    Rest.AT_REST: "at rest",
    Rest.TOO_MANY_EVALUATIONS: "did not come to rest; allow more force evaluations",
    Rest.DIVERGED: "the motion left all bounds; start closer to the conditions",
    Rest.BENT_TOO_FAR: "turns or twists by more than 160 degrees; use more edges",
    Rest.AT_STOP: "the load reached its stop",
}


class Aim(NamedTuple):
    """Load, stopping conditions and cost limit of a relaxation."""

    frees_load: bool  # whether the load moves, under a dead moment
    moment: float  # that moment, dL/dload
    low: float  # stops of the load
    high: float
    tolerance: float  # of the residual; its square is that of the kinetic energy
    most: int  # gradients
    every: int  # k of the album; 0: none


class Album(NamedTuple):
    """Every k-th configuration of a relaxation, fewer of a long one; kernels write to it."""

    quat: Array  # (slots, n, 4)
    stretch: Array  # (slots, n)
    load: Array  # (slots,)
    energy: Array  # (slots,)


@dataclass(frozen=True)
class MotionEnd:
    """End of a motion: its last configuration, where ``outcome`` is not AT_REST or AT_STOP."""

    state: State
    outcome: Rest
    where: int  # vertex that is bent too far; -1: none
    residual: float  # largest entry of gradient and position gap, GJ/a and a
    kinetic: float  # kinetic energy at the end, GJ/a; 0 where there is no inertia
    energy_start: float  # elastic energy at the start of the motion
    energy: float  # and at its end
    moment: float  # dL/dload
    history: tuple[State, ...]  # every k-th configuration
    energies: Array  # (len(history),) elastic energies

    @property
    def rests(self) -> bool:
        """Whether the end is an equilibrium, under given load or moment."""
        return self.outcome is Rest.AT_REST

    @property
    def advice(self) -> str:
        """How the motion ended, as part of a sentence."""
        where = f"vertex {self.where} " if self.where >= 0 else ""
        return f"{where}{ADVICE[self.outcome]}"


@dataclass(frozen=True)
class Relaxed(MotionEnd):
    """End of a dynamic relaxation; the states of its history have no multipliers."""

    evaluations: int  # of the gradient
    restarts: int  # from rest, at peaks of the kinetic energy


@kernel
def _balance(supports, masses, aim, pull):
    """Add the forces that keep accelerations on the conditions; returns the largest residual.

    F = -(B' M^-1 B)^-1 B' M^-1 grad.
    """
    n, b, m = pull.border.shape
    largest = 0.0
    condition_metric(masses, pull)
    for k in range(m):
        largest = max(largest, abs(pull.gap[k]))
        of_load = masses.of_load[0] * (pull.load_grad[0] - aim.moment)
        pull.force[k] = -of_load * pull.load_border[k]
        for j in range(n):
            for i in range(b):
                pull.force[k] -= pull.lever[j, i, k] * pull.grad[j, i]
    solve_metric(pull.metric, pull.force)
    for k in range(m):
        pull.load_grad[0] += pull.load_border[k] * pull.force[k]
    if aim.frees_load:
        largest = max(largest, abs(pull.load_grad[0] - aim.moment))
    for j in range(n):
        for i in range(b):
            for k in range(m):
                pull.grad[j, i] += pull.border[j, i, k] * pull.force[k]
            if supports.free[j, i] and not abs(pull.grad[j, i]) <= largest:  # true for NaN, too
                largest = abs(pull.grad[j, i])
    return largest


@kernel
def _accelerate(pull, masses, moment, time, motion):
    """Kinetic energy after ``time`` steps of acceleration, with the velocity on the conditions.

    The part of the velocity across the conditions closes their gap in one step.
    """
    n, b, m = pull.border.shape
    velocity, rate = motion.velocity, motion.rate
    y = pull.gap.copy()
    motion.last_rate[0] = rate[0]
    rate[0] -= time * masses.of_load[0] * (pull.load_grad[0] - moment)
    for k in range(m):
        y[k] += pull.load_border[k] * rate[0]
    for j in range(n):
        for i in range(b):
            motion.last[j, i] = velocity[j, i]
            for r in range(b):
                velocity[j, i] -= time * masses.inverse[j, i, r] * pull.grad[j, r]
            for k in range(m):
                y[k] += pull.border[j, i, k] * velocity[j, i]
    solve_metric(pull.metric, y)
    for k in range(m):
        rate[0] -= masses.of_load[0] * pull.load_border[k] * y[k]
    kinetic = 0.5 * rate[0] ** 2 / masses.of_load[0] if masses.of_load[0] > 0.0 else 0.0
    for j in range(n):
        for i in range(b):
            for k in range(m):
                velocity[j, i] -= pull.lever[j, i, k] * y[k]
        for i in range(b):
            for r in range(b):
                kinetic += 0.5 * velocity[j, i] * masses.block[j, i, r] * velocity[j, r]
    return kinetic


@kernel
def _go(supports, time, velocity, rate, motion):
    """Move for ``time`` steps at a velocity."""
    n, b = velocity.shape
    w = np.empty(3)
    for j in range(n):
        if supports.turn[j] != 0.0:
            into_frame(motion.quat[j], supports.turn_axis, w)
            for i in range(3):
                w[i] *= time * supports.turn[j] * rate[0]
        else:
            for i in range(3):
                w[i] = time * velocity[j, i]
        turned(motion.quat[j], w, motion.quat[j])
        if b == 4:
            motion.stretch[j] += time * velocity[j, 3]
    motion.load[0] += time * rate[0]


@kernel
def _stop(motion):
    clear(motion.velocity)
    motion.rate[0] = 0.0


@kernel
def _close(rod, supports, masses, pull, motion):
    """Move the rod onto its conditions, from rest to rest, by projections in the mass metric."""
    for _ in range(_PROJECTIONS):
        clear(pull.grad)
        pull.load_grad[0] = 0.0
        conditions(rod, supports, motion, pull)
        gap = 0.0
        for k in range(pull.gap.shape[0]):
            gap = max(gap, abs(pull.gap[k]))
        if gap <= _CLOSED:
            break
        condition_metric(masses, pull)
        _accelerate(pull, masses, 0.0, 0.0, motion)
        _go(supports, 1.0, motion.velocity, motion.rate, motion)
        _stop(motion)


@kernel
def _verdict(aim, residual, first, kinetic, load, bent_too_far, count):
    """Value of `Rest` where the motion ends here; -1: it goes on."""
    if not np.isfinite(residual) or residual > 1e3 * max(first, 1.0):
        return 2
    if bent_too_far >= 0:
        return 3
    if residual <= aim.tolerance and kinetic <= aim.tolerance * aim.tolerance:
        return 0
    if aim.frees_load and not aim.low < load < aim.high:
        return 4
    return 1 if count >= aim.most else -1


@kernel
def _keep(motion, energy, slot, out_album):
    """Copy a configuration to its place in the album."""
    for j in range(motion.stretch.shape[0]):
        for i in range(4):
            out_album.quat[slot, j, i] = motion.quat[j, i]
        out_album.stretch[slot, j] = motion.stretch[j]
    out_album.load[slot] = motion.load[0]
    out_album.energy[slot] = energy


@kernel
def _thin(out_album):
    """Keep every second configuration; returns how many."""
    kept = (out_album.load.shape[0] + 1) // 2
    for k in range(1, kept):
        for j in range(out_album.stretch.shape[1]):
            for i in range(4):
                out_album.quat[k, j, i] = out_album.quat[2 * k, j, i]
            out_album.stretch[k, j] = out_album.stretch[2 * k, j]
        out_album.load[k] = out_album.load[2 * k]
        out_album.energy[k] = out_album.energy[2 * k]
    return kept


@kernel
def _potential(energy, aim, motion, pull):
    """Potential energy: elastic, less the work of dead loads; gaps count to first order."""
    potential = energy - pull.work[0] - aim.moment * motion.load[0]
    for k in range(pull.gap.shape[0]):
        potential += pull.force[k] * pull.gap[k]
    return potential


@kernel
def _relax(rod, supports, aim, motion, pull, masses, album):
    """Motion with kinetic damping until it ends; writes to all that follows ``aim``."""
    heaviness, kinetic, at_rest = 0.5 * _MARGIN, 0.0, 0.0
    count, restarts, kept, first, start = 0, 0, 0, 0.0, 0.0
    every = aim.every
    weigh(rod, supports, motion, heaviness, aim.frees_load, masses)
    _close(rod, supports, masses, pull, motion)
    while True:
        energy, bent_too_far = gradient(rod, supports, motion, pull)
        residual = _balance(supports, masses, aim, pull)
        if count == 0:
            first, start = residual, energy
        if every > 0 and count % every == 0:
            if kept == album.load.shape[0]:
                kept, every = _thin(album), 2 * every
            if count % every == 0:
                _keep(motion, energy, kept, album)
                kept += 1
        count += 1
        outcome = _verdict(aim, residual, first, kinetic, motion.load[0], bent_too_far, count)
        if outcome >= 0:
            break
        before, potential = kinetic, _potential(energy, aim, motion, pull)
        at_rest = potential if before == 0.0 else at_rest
        kinetic = _accelerate(pull, masses, aim.moment, 0.5 if before == 0.0 else 1.0, motion)
        gained = potential > at_rest + _GAIN * max(abs(energy), 1.0)
        if kinetic >= before and not gained:
            _go(supports, 1.0, motion.velocity, motion.rate, motion)
            continue
        _go(supports, -0.5, motion.last, motion.last_rate, motion)
        _stop(motion)
        kinetic = 0.0
        restarts += 1
        heaviness *= _HEAVIER if gained else 1.0
        weigh(rod, supports, motion, heaviness, aim.frees_load, masses)
    values = (residual, kinetic, start, energy, pull.load_grad[0])
    return (outcome, bent_too_far, *values, count, restarts, kept)


def _at_rest(supports: Supports, state: State) -> Motion:
    """A motion that starts from rest."""
    shape, load = supports.free.shape, np.array([float(state.load)])
    velocities = (np.zeros(size) for size in (shape, 1, shape, 1))
    return Motion(state.quat.copy(), state.stretch.copy(), load, *velocities)


def _no_pull(supports: Supports) -> Pull:
    """Arrays for the forces on a rod."""
    (n, b), m = supports.free.shape, len(supports.target)
    conditions = {"gap": m, "border": (n, b, m), "load_border": m, "lever": (n, b, m)}
    sizes = {"grad": (n, b), "load_grad": 1, **conditions, "metric": (m, m), "force": m, "work": 1}
    return Pull(**{name: np.zeros(size) for name, size in sizes.items()})


def relax(
    system: RodSystem,
    start: State,
    *,
    kick: Increment | None = None,
    moment: float | None = None,
    stops: tuple[float, float] = (-np.inf, np.inf),
    tolerance: float = 1e-9,
    most: int = 200_000,
    every: int = 0,
) -> Relaxed:
    """Return the state in which a rod comes to rest from ``start``.

    Parameters
    ----------
    kick : displacement added to the start, such as along a softest mode.
    moment : dead moment dL/dload under which the load moves; None: the load is given.
    stops : loads at which a motion under dead moment ends.
    tolerance : of the residual, GJ/a; the kinetic energy has to be below its square.
    most : largest number of evaluations of the gradient.
    every : keep every k-th configuration in `Relaxed.history`; 0: none. Of a long motion every
        2k-th, 4k-th, ... is kept, so that there are never more than 2,048.

    Raises
    ------
    ValueError
        For a rod with an edge without bending stiffness, such as a strut: it has no mass.

    Notes
    -----
    Failure to come to rest is a value: see `Relaxed.outcome` and `Relaxed.advice`.
    """
    rod, supports = system.rod, system.supports
    if rod.n_edges > len(rod.cell) + 1:
        raise ValueError(
            f"rod must have no more than {len(rod.cell) + 1} edges on {len(rod.cell)} vertices "
            f"to be relaxed, got {rod.n_edges}: a strut moves by implicit steps (dynamics.flow)"
        )
    if kick is not None:
        start = system.retract(start, kick)
    n, b = supports.free.shape
    motion, pull = _at_rest(supports, start), _no_pull(supports)
    masses = Masses(np.zeros((n, b, b)), np.zeros((n, b, b)), np.zeros(1))
    slots = min(most // every + 1, _SLOTS) if every > 0 else 0
    album = Album(np.empty((slots, n, 4)), np.empty((slots, n)), np.empty(slots), np.empty(slots))
    free = moment is not None
    aim = Aim(free, 0.0 if moment is None else moment, *stops, tolerance, most, every)
    outcome, where, residual, kinetic, first, last, conjugate, count, restarts, kept = _relax(
        rod, supports, aim, motion, pull, masses, album
    )
    values = (residual, kinetic, first, last, conjugate)
    no_force = np.zeros(len(pull.force))
    history = tuple(
        State(album.quat[k].copy(), album.stretch[k].copy(), no_force, float(album.load[k]))
        for k in range(kept)
    )
    state = State(motion.quat, motion.stretch, pull.force, float(motion.load[0]))
    energies = album.energy[:kept].copy()
    return Relaxed(state, Rest(outcome), where, *values, history, energies, count, restarts)
