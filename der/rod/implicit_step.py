"""One implicit step in time of a rod with masses: Newton's method with the rod's own factors.

The step from frames q0 looks for q = q0 o exp(w/2) at which

    grad U(q) + B force + M (known + shift w) = 0,   conditions met,

with one mass for each edge, its length: eigenvalues of the softest modes are then squared
frequencies, or rates of decay. Time integrators differ in ``known`` and ``shift`` alone: 0 and 1/dt
for the implicit Euler step of a gradient flow, what is left of the past and about 1/dt^2 for one of
motion. The matrix is that of the equilibrium with shift M on its diagonal.

The step is taken only where that matrix is positive on the conditions, so that what it finds is the
minimum of its potential next to q0 and no saddle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from der.errors import REASONS, Reason
from der.kernels.assembly import assemble, take_out
from der.kernels.block_ldl import factor, inertia, solve_refined
from der.kernels.quaternions import Array, into_frame, rotation_vector, turned
from der.rod.rod import Rod, State
from der.rod.supports import Supports, check_cut

_LARGEST_TURN = 1.0  # rad; a correction that turns an edge further has left the neighbourhood
_ITERATIONS = 6  # a step that needs more is too long


@dataclass(frozen=True, slots=True)
class Stepped:
    """An implicit step; where ``reason`` is not CONVERGED, its last iterate."""

    state: State
    reason: Reason
    where: int  # vertex that is bent too far; -1: none
    iterations: int
    w: Array  # (n b + 1,) the step: rotation vectors and stretches, flat, and the load
    energy: float  # elastic
    moment: float  # dL/dload
    residual: float  # of the forces without those of inertia: 0 at rest


def weights(rod: Rod, supports: Supports) -> Array:
    """Masses (n b + 1,) of all unknowns, held ones 0; the load's is the rod's whole length."""
    own = rod.length[:, None] * supports.free
    return np.append(own.ravel(), rod.length.sum())


@njit(cache=True)
def _step(
    rod,
    supports,
    begin_quat,
    begin_stretch,
    begin_load,
    quat,
    stretch,
    force,
    load,
    mass,
    known,
    shift,
    frees_load,
    moment,
    tolerance,
):
    """Newton's method for one step; see the module's text."""
    n, b = supports.free.shape
    n_c = supports.target.shape[0]
    quat, stretch, force = quat.copy(), stretch.copy(), force.copy()
    x, y, z = np.zeros((n, b, 1)), np.zeros((n_c, 1)), np.zeros(1)
    no_row, no_border = np.zeros((n, b)), np.zeros(n_c)
    w, axis = np.zeros(n * b + 1), np.empty(3)
    outcome, iteration, residual = 1, 0, 0.0
    while True:
        system = assemble(rod, supports, quat, stretch, force, load)
        if system.bent_too_far >= 0:
            outcome = 3
            break
        turns = rotation_vector(begin_quat, quat)
        largest, residual = 0.0, 0.0
        for k in range(n_c):
            largest = max(largest, abs(system.gap[k]))
        residual = largest
        for j in range(n):
            for i in range(b):
                k = j * b + i
                x[j, i, 0] = 0.0
                if not supports.free[j, i]:
                    system.load_column[j, i] = 0.0
                    continue
                w[k] = turns[j, i] if i < 3 else stretch[j] - begin_stretch[j]
                rest = system.grad[j, i]
                residual = max(residual, abs(rest))
                x[j, i, 0] = -rest - mass[k] * (known[k] + shift * w[k])
                system.diag[j, i, i] += mass[k] * shift
                if not abs(x[j, i, 0]) <= largest:  # true for NaN, too
                    largest = abs(x[j, i, 0])
        if frees_load:
            w[-1] = load - begin_load
            rest = system.load_grad - moment
            residual = max(residual, abs(rest))
            z[0] = -rest - mass[-1] * (known[-1] + shift * w[-1])
            largest = max(largest, abs(z[0]))
        if not np.isfinite(largest):
            outcome = 2
            break
        if largest <= max(tolerance, 10.0 * system.noise):
            outcome = 0
            break
        if iteration >= _ITERATIONS:
            break
        diag, off, border = take_out(supports.free, system.diag, system.off, system.border)
        factors = factor(diag, off, border)
        negative, _ = inertia(factors)
        if negative != n_c:
            outcome = 4
            break
        last, last_border, corner = no_row, no_border, 1.0
        if frees_load:
            last, last_border = system.load_column, system.load_border
            corner = system.load_hess + mass[-1] * shift
        for k in range(n_c):
            y[k, 0] = -system.gap[k]
        if not solve_refined(
            diag,
            off,
            factors,
            n_c,
            system.load_column,
            system.load_border,
            last,
            last_border,
            corner,
            x,
            y,
            z,
        ):
            outcome = 4
            break
        if not frees_load:
            z[0] = 0.0
        size = abs(z[0])
        for j in range(n):
            for i in range(3):
                size = max(size, abs(x[j, i, 0]))
        if not size < _LARGEST_TURN:
            outcome = 2
            break
        for j in range(n):
            for i in range(3):
                axis[i] = x[j, i, 0]
            if supports.turn[j] != 0.0:
                into_frame(quat[j], supports.turn_axis, axis)
                for i in range(3):
                    axis[i] *= supports.turn[j] * z[0]
            turned(quat[j], axis, quat[j])
            if b == 4:
                stretch[j] += x[j, 3, 0]
        for k in range(n_c):
            force[k] += y[k, 0]
        load += z[0]
        iteration += 1
    return (
        outcome,
        system.bent_too_far,
        iteration,
        quat,
        stretch,
        force,
        load,
        w,
        system.energy,
        system.load_grad,
        residual,
    )


def step(
    rod: Rod,
    supports: Supports,
    begin: State,
    guess: State,
    *,
    mass: Array,
    known: Array,
    shift: float,
    moment: float | None,
    tolerance: float,
) -> Stepped:
    """The implicit step from ``begin``, by Newton's method from ``guess``.

    Parameters
    ----------
    mass, known : (n b + 1,) as from `weights`; the last entries are the load's.
    moment : dead moment under which the load moves, too; None: it is given.
    tolerance : of the residual, GJ/a.

    Raises
    ------
    ValueError
        For a closed rod whose edge 0 is free (`supports.check_cut`).

    Notes
    -----
    Failure to converge is a value: see `Stepped.reason`; a matrix that is singular or not positive
    on the conditions is `Reason.SINGULAR`. A shorter step helps.
    """
    check_cut(rod, supports.free)
    outcome, where, iterations, quat, stretch, force, load, w, energy, now, residual = _step(
        rod,
        supports,
        begin.quat,
        begin.stretch,
        float(begin.load),
        guess.quat,
        guess.stretch,
        guess.force,
        float(guess.load),
        mass,
        known,
        shift,
        moment is not None,
        0.0 if moment is None else moment,
        tolerance,
    )
    state = State(quat, stretch, force, load)
    return Stepped(state, REASONS[outcome], where, iterations, w, energy, now, residual)


def on_the_conditions(rod: Rod, supports: Supports, start: State) -> Stepped:
    """``start`` moved onto its conditions by the shortest way, in the metric of the masses.

    Its multipliers stay those of the start: the ones of so short a step are no internal forces.
    """
    mass = weights(rod, supports)
    still = np.zeros(len(mass))
    found = step(
        rod,
        supports,
        start,
        start,
        mass=mass,
        known=still,
        shift=1e9,
        moment=None,
        tolerance=1e-6,
    )
    return replace(found, state=found.state.but(force=start.force))
