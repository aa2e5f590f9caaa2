"""Dynamic relaxation: a rod moves, is stopped at every peak of kinetic energy, and comes to rest.

Fictitious masses turn the search for a minimum of the energy into motion in unit time steps
(Day 1965; Barnes 1999; Papadrakakis 1981). No matrix of the whole rod is formed or factored: a step
needs the gradient, one block of mass an edge, and an m x m system for m <= 5 position conditions.

    masses      half of the stiffnesses of the vertices on both sides of an edge, times a margin:
                (a - b)'K(a - b) <= 2 (a'Ka + b'Kb), so that no frequency exceeds that of the
                unit step, 2; a rod that gains energy all the same gets heavier
    conditions  constraint forces keep accelerations on them, and the velocity of each step takes
                back, in the metric of the masses, what the last one strayed
    damping     kinetic: where the kinetic energy has passed a peak, the rod goes back to the middle
                of the last step and starts again from rest (Barnes 1999)

In the rotations of frames bending and twisting are of second order in arc length, so the number of
steps grows like the number of edges; in positions it would grow like its square.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from der.assembly import position_rows
from der.equilibrium import Direction, moved
from der.frames import Array, into_frame, relative, turned
from der.rod import Rod, State
from der.strain import vertex_energy
from der.supports import Supports

_MARGIN = 1.2  # of the masses above the lightest stable ones; 1.05 to 1.5: -10 to +70 % of the cost
_HEAVIER = 1.5  # factor on the masses of a rod that has gained energy
_GAIN = 1e-9  # of the energy: less is rounding and the second order of the conditions
_BENT_TOO_FAR = 0.0301537  # cos(80 deg)^2, as in assembly.py
_CLOSED = 1e-6  # a; a larger gap is closed before the motion starts
_PROJECTIONS = 20


class Rest(IntEnum):
    """How a relaxation ended."""

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


class Motion(NamedTuple):
    """Configuration and velocity of a moving rod; kernels write to it."""

    quat: Array  # (n, 4)
    stretch: Array  # (n,)
    load: Array  # (1,)
    velocity: Array  # (n, b) in the frames, per step
    rate: Array  # (1,) of the load, per step
    last: Array  # (n, b) velocity of the step before
    last_rate: Array  # (1,)


class Masses(NamedTuple):
    """Fictitious masses; kernels write to it."""

    block: Array  # (n, b, b) each edge's own
    inverse: Array  # (n, b, b) their inverses, 0 for what is held
    of_load: Array  # (1,) inverse mass of the load, 0 where it is given


class Pull(NamedTuple):
    """Generalised forces on a rod in motion; kernels write to it."""

    grad: Array  # (n, b) of the energy, on held edges too
    load_grad: Array  # (1,) likewise along the load
    gap: Array  # (m,) position conditions
    border: Array  # (n, b, m) their derivatives B
    load_border: Array  # (m,) likewise along the load
    lever: Array  # (n, b, m) M^-1 B
    metric: Array  # (m, m) Cholesky factor of B' M^-1 B
    force: Array  # (m,) multipliers of the conditions
    work: Array  # (1,) of the dead load


class Aim(NamedTuple):
    """What a relaxation is after, and what it may cost."""

    frees_load: bool  # whether the load moves, under a dead moment
    moment: float  # that moment, dL/dload
    low: float  # stops of the load
    high: float
    tolerance: float  # of the residual; its square is that of the kinetic energy
    most: int  # gradients
    every: int  # k of the album; 0: none


class Album(NamedTuple):
    """Every k-th configuration of a relaxation; kernels write to it."""

    quat: Array  # (slots, n, 4)
    stretch: Array  # (slots, n)
    load: Array  # (slots,)
    energy: Array  # (slots,)


class Ended(NamedTuple):
    """What the kernel returns."""

    outcome: int
    where: int
    evaluations: int
    restarts: int
    residual: float
    kinetic: float
    energy_start: float
    energy: float
    moment: float
    kept: int


@dataclass(frozen=True, slots=True)
class Relaxed:
    """A relaxation; where ``outcome`` is not AT_REST (or AT_STOP), its last configuration."""

    state: State
    outcome: Rest
    where: int  # vertex that is bent too far; -1: none
    evaluations: int  # of the gradient
    restarts: int  # from rest, at peaks of the kinetic energy
    residual: float  # largest entry of gradient and position gap, GJ/a and a
    kinetic: float  # kinetic energy at the end, GJ/a
    energy_start: float  # elastic energy of the rod as given, where it starts to move
    energy: float  # and where it ends
    moment: float  # dL/dload
    history: tuple[State, ...]  # every k-th configuration, without multipliers
    energies: Array  # (len(history),) elastic energies

    @property
    def rests(self) -> bool:
        """Whether the end is an equilibrium, under given load or moment."""
        return self.outcome is Rest.AT_REST


@njit(cache=True)
def vertex_gradient(p, measure, rest, stiffness, out_kappa, out_g, out_H):
    """Elastic energy of one vertex and its gradient, as `strain.vertex_energy` without Hessian.

    ``p`` (4,) has unit length; ``out_H`` (3, 3) is scratch for the measures that have no gradient
    of their own. With W = log p and m the moments, g = m - W x m/2 + c W x (W x m), the transposed
    inverse Jacobian of the rotation vector; c = (1 - x cot x)/|W|^2, x = |W|/2.
    """
    if measure != 0:
        return vertex_energy(p, measure, rest, stiffness, out_kappa, out_g, out_H)
    sine = np.sqrt(p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
    half = np.arctan2(sine, p[0])
    scale = 2.0 * half / sine if sine > 0.0 else 2.0
    t = 4.0 * half * half
    # cot x = p0/sine; by its series where 1 - x cot x loses digits
    c = (1.0 - half * p[0] / sine) / t if t > 1e-4 else 1.0 / 12.0 + t / 720.0
    energy = 0.0
    for i in range(3):
        out_kappa[i] = scale * p[i + 1]
        out_g[i] = stiffness[i] * (out_kappa[i] - rest[i])
        energy += 0.5 * out_g[i] * (out_kappa[i] - rest[i])
    x, y, z = out_kappa[0], out_kappa[1], out_kappa[2]
    m0, m1, m2 = out_g[0], out_g[1], out_g[2]
    mW = m0 * x + m1 * y + m2 * z
    d = 1.0 - c * t
    out_g[0] = d * m0 - 0.5 * (y * m2 - z * m1) + c * mW * x
    out_g[1] = d * m1 - 0.5 * (z * m0 - x * m2) + c * mW * y
    out_g[2] = d * m2 - 0.5 * (x * m1 - y * m0) + c * mW * z
    return energy


@njit(cache=True)
def gradient(rod, held, motion, out_pull):
    """Elastic energy, first vertex bent too far (or -1); forces and conditions to ``out_pull``.

    The gradient is that of the energy less the work of the dead load; the forces of the position
    conditions are not in it.
    """
    n = out_pull.grad.shape[0]
    energy, bent_too_far = 0.0, -1
    _clear(out_pull.grad)
    p, back = np.empty(4), np.empty(4)
    kappa, stiffness, g, turned_g = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    H = np.empty((3, 3))
    for s in range(rod.cell.shape[0]):
        c = s + 1 if s + 1 < n else 0
        relative(motion.quat[s], motion.quat[c], p)
        sign = 1.0 if p[0] >= 0.0 else -1.0
        for i in range(4):
            p[i] *= sign
            back[i] = p[i] if i == 0 else -p[i]
        cosine = p[0] * p[0] + p[3] * p[3]
        if bent_too_far < 0 and (cosine < _BENT_TOO_FAR or p[0] * p[0] < _BENT_TOO_FAR * cosine):
            bent_too_far = s
        for i in range(3):
            stiffness[i] = rod.stiffness[i] / rod.cell[s]
        energy += vertex_gradient(p, rod.measure, rod.rest[s], stiffness, kappa, g, H)
        into_frame(back, g, turned_g)
        for i in range(3):
            out_pull.grad[c, i] += g[i]
            out_pull.grad[s, i] -= turned_g[i]
    _conditions(rod, held, motion, out_pull)
    energy += _edge_forces(rod, held, motion, out_pull)
    return energy, bent_too_far


@njit(cache=True)
def _conditions(rod, held, motion, out_pull):
    """Gaps of the position conditions and their derivatives, along the load too."""
    m = out_pull.gap.shape[0]
    for k in range(m):
        out_pull.gap[k] = -held.target[k]
        out_pull.load_border[k] = 0.0
    position_rows(
        rod.length,
        held.weight,
        held.axis,
        motion.quat,
        motion.stretch,
        out_pull.gap,
        out_pull.border,
    )
    v = np.empty(3)
    for j in range(rod.length.shape[0]):
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, v)
            for k in range(m):
                for i in range(3):
                    out_pull.load_border[k] += held.turn[j] * v[i] * out_pull.border[j, i, k]


@njit(cache=True)
def _edge_forces(rod, held, motion, out_pull):
    """Energy of stretching; its forces and those of the dead load, and the force on the load."""
    n, b = out_pull.grad.shape
    grad, load, energy = out_pull.grad, motion.load[0], 0.0
    out_pull.load_grad[0], out_pull.work[0] = 0.0, 0.0
    f, v = np.empty(3), np.empty(3)
    for j in range(n):
        eps = motion.stretch[j]
        now = rod.length[j] * (1.0 + eps)
        into_frame(motion.quat[j], held.pull[j], f)
        grad[j, 0] += load * now * f[1]
        grad[j, 1] -= load * now * f[0]
        if b == 4:
            grad[j, 3] += rod.length[j] * (rod.stretching * eps - load * f[2])
            energy += 0.5 * rod.stretching * rod.length[j] * eps * eps
        out_pull.load_grad[0] -= now * f[2]
        out_pull.work[0] += load * now * f[2]
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, v)
            for i in range(3):
                out_pull.load_grad[0] += held.turn[j] * v[i] * grad[j, i]
    return energy


@njit(cache=True)
def _vertex_masses(p, stiffness, out_first, out_second):
    """Stiffness (3,) of a vertex, in the frame half way, seen in its two edges' frames (3, 3)."""
    half = np.empty(4)
    scale = 1.0 / np.sqrt(2.0 + 2.0 * p[0])
    for i in range(4):
        half[i] = scale * (p[i] + (1.0 if i == 0 else 0.0))
    R = np.empty((3, 3))
    unit = np.eye(3)
    for k in range(3):
        into_frame(half, unit[k], R[k])
    for i in range(3):
        for j in range(3):
            out_first[i, j] = 0.0
            out_second[i, j] = 0.0
            for k in range(3):
                out_first[i, j] += stiffness[k] * R[i, k] * R[j, k]
                out_second[i, j] += stiffness[k] * R[k, i] * R[k, j]


@njit(cache=True)
def _weigh(rod, held, motion, heaviness, frees_load, out_masses):
    """Inverse masses for the present configuration: ``heaviness`` times the vertex stiffnesses."""
    n, b = held.free.shape
    mass = out_masses.block
    for j in range(n):
        _clear(mass[j])
    first, second = np.empty((3, 3)), np.empty((3, 3))
    p, v, stiffness = np.empty(4), np.empty(3), np.empty(3)
    for s in range(rod.cell.shape[0]):
        c = s + 1 if s + 1 < n else 0
        relative(motion.quat[s], motion.quat[c], p)
        sign = 1.0 if p[0] >= 0.0 else -1.0
        for i in range(4):
            p[i] *= sign
        for i in range(3):
            stiffness[i] = heaviness * rod.stiffness[i] / rod.cell[s]
        _vertex_masses(p, stiffness, first, second)
        for i in range(3):
            for j in range(3):
                mass[s, i, j] += first[i, j]
                mass[c, i, j] += second[i, j]
    of_load = 0.0
    for j in range(n):
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, v)
            for i in range(3):
                for k in range(3):
                    of_load += held.turn[j] ** 2 * v[i] * mass[j, i, k] * v[k]
        _invert(mass[j], held.free[j], out_masses.inverse[j])
        if b == 4:
            mass[j, 3, 3] = heaviness * rod.stretching * rod.length[j]
            out_masses.inverse[j, 3, 3] = 1.0 / mass[j, 3, 3] if held.free[j, 3] else 0.0
    out_masses.of_load[0] = 1.0 / of_load if frees_load and of_load > 0.0 else 0.0


@njit(cache=True)
def _invert(mass, free, out_inverse):
    """Inverse of ``mass`` (3, 3) on the entries that are free; the rest 0."""
    a = mass.copy()
    for i in range(3):
        if not free[i]:
            for j in range(3):
                a[i, j] = 0.0
                a[j, i] = 0.0
            a[i, i] = 1.0
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            out_inverse[i, j] = a[j1, i1] * a[j2, i2] - a[j1, i2] * a[j2, i1]
    scale = 1.0 / (
        a[0, 0] * out_inverse[0, 0] + a[0, 1] * out_inverse[1, 0] + a[0, 2] * out_inverse[2, 0]
    )
    for i in range(3):
        for j in range(3):
            out_inverse[i, j] *= scale if free[i] and free[j] else 0.0


@njit(cache=True)
def _condition_metric(masses, pull):
    """Fill ``lever`` = M^-1 B and ``metric``, the Cholesky factor of B' M^-1 B."""
    n, b, m = pull.border.shape
    metric, lever = pull.metric, pull.lever
    for k in range(m):
        for i in range(k + 1):
            metric[k, i] = masses.of_load[0] * pull.load_border[k] * pull.load_border[i]
    for j in range(n):
        for k in range(m):
            for i in range(b):
                lever[j, i, k] = 0.0
                for r in range(b):
                    lever[j, i, k] += masses.inverse[j, i, r] * pull.border[j, r, k]
            for i in range(k + 1):
                for r in range(b):
                    metric[k, i] += lever[j, r, k] * pull.border[j, r, i]
    for k in range(m):
        for i in range(k + 1):
            for r in range(i):
                metric[k, i] -= metric[k, r] * metric[i, r]
            metric[k, i] = np.sqrt(metric[k, i]) if i == k else metric[k, i] / metric[i, i]


@njit(cache=True)
def _solve_metric(metric, y):
    """Solve, in place, for the multipliers ``y`` (m,) with the factor of `_condition_metric`."""
    m = y.shape[0]
    for k in range(m):
        for i in range(k):
            y[k] -= metric[k, i] * y[i]
        y[k] /= metric[k, k]
    for k in range(m - 1, -1, -1):
        for i in range(k + 1, m):
            y[k] -= metric[i, k] * y[i]
        y[k] /= metric[k, k]


@njit(cache=True)
def _balance(held, masses, aim, pull):
    """Add the forces that keep accelerations on the conditions; returns the largest residual.

    F = -(B' M^-1 B)^-1 B' M^-1 grad.
    """
    n, b, m = pull.border.shape
    largest = 0.0
    _condition_metric(masses, pull)
    for k in range(m):
        largest = max(largest, abs(pull.gap[k]))
        of_load = masses.of_load[0] * (pull.load_grad[0] - aim.moment)
        pull.force[k] = -of_load * pull.load_border[k]
        for j in range(n):
            for i in range(b):
                pull.force[k] -= pull.lever[j, i, k] * pull.grad[j, i]
    _solve_metric(pull.metric, pull.force)
    for k in range(m):
        pull.load_grad[0] += pull.load_border[k] * pull.force[k]
    if aim.frees_load:
        largest = max(largest, abs(pull.load_grad[0] - aim.moment))
    for j in range(n):
        for i in range(b):
            for k in range(m):
                pull.grad[j, i] += pull.border[j, i, k] * pull.force[k]
            if held.free[j, i] and not abs(pull.grad[j, i]) <= largest:  # true for NaN, too
                largest = abs(pull.grad[j, i])
    return largest


@njit(cache=True)
def _accelerate(pull, masses, moment, time, motion):
    """Kinetic energy after ``time`` steps of acceleration, with the velocity on the conditions.

    The velocity's part across the conditions is what takes back their gap in one step.
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
    _solve_metric(pull.metric, y)
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


@njit(cache=True)
def _go(held, time, velocity, rate, motion):
    """Move for ``time`` steps at a velocity."""
    n, b = velocity.shape
    w = np.empty(3)
    for j in range(n):
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, w)
            for i in range(3):
                w[i] *= time * held.turn[j] * rate[0]
        else:
            for i in range(3):
                w[i] = time * velocity[j, i]
        turned(motion.quat[j], w, motion.quat[j])
        if b == 4:
            motion.stretch[j] += time * velocity[j, 3]
    motion.load[0] += time * rate[0]


@njit(cache=True)
def _stop(motion):
    _clear(motion.velocity)
    motion.rate[0] = 0.0


@njit(cache=True)
def _clear(out_rows):
    """Zero everywhere: loops, since assigning to a slice takes numba a second to compile."""
    n, b = out_rows.shape
    for j in range(n):
        for i in range(b):
            out_rows[j, i] = 0.0


@njit(cache=True)
def _close(rod, held, masses, pull, motion):
    """Move the rod onto its conditions, from rest to rest, by projections in the mass metric."""
    for _ in range(_PROJECTIONS):
        _clear(pull.grad)
        pull.load_grad[0] = 0.0
        _conditions(rod, held, motion, pull)
        gap = 0.0
        for k in range(pull.gap.shape[0]):
            gap = max(gap, abs(pull.gap[k]))
        if gap <= _CLOSED:
            break
        _condition_metric(masses, pull)
        _accelerate(pull, masses, 0.0, 0.0, motion)
        _go(held, 1.0, motion.velocity, motion.rate, motion)
        _stop(motion)


@njit(cache=True)
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


@njit(cache=True)
def _keep(motion, energy, slot, out_album):
    """Copy a configuration to its place in the album."""
    for j in range(motion.stretch.shape[0]):
        for i in range(4):
            out_album.quat[slot, j, i] = motion.quat[j, i]
        out_album.stretch[slot, j] = motion.stretch[j]
    out_album.load[slot] = motion.load[0]
    out_album.energy[slot] = energy


@njit(cache=True)
def _potential(energy, aim, motion, pull):
    """What a motion spends: energy less the work of dead loads; gaps count to first order."""
    potential = energy - pull.work[0] - aim.moment * motion.load[0]
    for k in range(pull.gap.shape[0]):
        potential += pull.force[k] * pull.gap[k]
    return potential


@njit(cache=True)
def _relax(rod, held, aim, motion, pull, masses, album):
    """Motion with kinetic damping until it ends; writes to all that follows ``aim``."""
    heaviness, kinetic, at_rest = 0.5 * _MARGIN, 0.0, 0.0
    count, restarts, kept, first, start = 0, 0, 0, 0.0, 0.0
    _weigh(rod, held, motion, heaviness, aim.frees_load, masses)
    _close(rod, held, masses, pull, motion)
    while True:
        energy, bent_too_far = gradient(rod, held, motion, pull)
        residual = _balance(held, masses, aim, pull)
        if count == 0:
            first, start = residual, energy
        if aim.every > 0 and count % aim.every == 0 and kept < album.load.shape[0]:
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
            _go(held, 1.0, motion.velocity, motion.rate, motion)
            continue
        _go(held, -0.5, motion.last, motion.last_rate, motion)
        _stop(motion)
        kinetic = 0.0
        restarts += 1
        heaviness *= _HEAVIER if gained else 1.0
        _weigh(rod, held, motion, heaviness, aim.frees_load, masses)
    moment = pull.load_grad[0]
    return Ended(
        outcome, bent_too_far, count, restarts, residual, kinetic, start, energy, moment, kept
    )


def _at_rest(held: Supports, state: State) -> Motion:
    """A rod that is about to move."""
    n, b = held.free.shape
    load = np.array([float(state.load)])
    return Motion(
        state.quat.copy(),
        state.stretch.copy(),
        load,
        np.zeros((n, b)),
        np.zeros(1),
        np.zeros((n, b)),
        np.zeros(1),
    )


def no_pull(held: Supports) -> Pull:
    """Room for the forces on a rod."""
    (n, b), m = held.free.shape, len(held.target)
    return Pull(
        grad=np.zeros((n, b)),
        load_grad=np.zeros(1),
        gap=np.zeros(m),
        border=np.zeros((n, b, m)),
        load_border=np.zeros(m),
        lever=np.zeros((n, b, m)),
        metric=np.zeros((m, m)),
        force=np.zeros(m),
        work=np.zeros(1),
    )


def relax(
    body: Rod,
    held: Supports,
    start: State,
    *,
    kick: Direction | None = None,
    moment: float | None = None,
    stops: tuple[float, float] = (-np.inf, np.inf),
    tolerance: float = 1e-9,
    most: int = 200_000,
    every: int = 0,
) -> Relaxed:
    """The state in which a rod comes to rest from ``start``.

    Parameters
    ----------
    kick : displacement added to the start, such as along a softest mode.
    moment : dead moment dL/dload under which the load moves; None: the load is given.
    stops : loads at which a motion under dead moment ends.
    tolerance : of the residual, GJ/a; the kinetic energy has to be below its square.
    most : gradients to be evaluated at most.
    every : keep every k-th configuration in `Relaxed.history`; 0: none.

    Notes
    -----
    Failure to come to rest is a value: see `Relaxed.outcome` and `ADVICE`.
    """
    if kick is not None:
        start = moved(held, start, kick)
    n, b = held.free.shape
    motion, pull = _at_rest(held, start), no_pull(held)
    masses = Masses(np.zeros((n, b, b)), np.zeros((n, b, b)), np.zeros(1))
    slots = most // every + 1 if every > 0 else 0
    album = Album(np.empty((slots, n, 4)), np.empty((slots, n)), np.empty(slots), np.empty(slots))
    free = moment is not None
    aim = Aim(free, 0.0 if moment is None else moment, *stops, tolerance, most, every)
    end = _relax(body, held, aim, motion, pull, masses, album)
    nothing = np.zeros(len(held.target))
    history = tuple(
        State(album.quat[k].copy(), album.stretch[k].copy(), nothing, float(album.load[k]))
        for k in range(end.kept)
    )
    return Relaxed(
        State(motion.quat, motion.stretch, pull.force, float(motion.load[0])),
        Rest(end.outcome),
        end.where,
        end.evaluations,
        end.restarts,
        end.residual,
        end.kinetic,
        end.energy_start,
        end.energy,
        end.moment,
        history,
        album.energy[: end.kept].copy(),
    )
