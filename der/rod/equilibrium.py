"""Newton's method for an equilibrium of a supported rod, and the path's tangent there.

The load is an unknown, so the equations of equilibrium need one more condition. It is one of three:
the load is given, its conjugate is given, or the correction is orthogonal to a direction
(pseudo-arclength). The index and the tangent come from the factors of the last iterate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.errors import REASONS
from der.kernels.assembly import assemble, hold, system_of
from der.kernels.block_ldl import factor, inertia, solve_refined
from der.kernels.quaternions import Array, turn_between
from der.kernels.workspace import rows
from der.packs.kernel import kernel
from der.problem import Increment, LoadedSolution
from der.rod.manifold import move
from der.rod.rod import Rod, State
from der.rod.supports import Supports

# of the tolerance, for the start and the first iterate: from a good start the residual would end
# just below the tolerance, and a fold magnifies that; close to a branch point later iterates may
# not become smaller
_CLOSE = 1e-2
_LARGEST_TURN = 1.0  # rad; a correction that turns an edge further has left the path
_NOTHING = np.zeros(0)  # masses of a rod at rest

# what closes the equations
LOAD_HELD, DIRECTION_HELD, MOMENT_HELD = range(3)


@dataclass(frozen=True, slots=True)
class Equilibrium(LoadedSolution[State]):
    """An equilibrium of a rod; moment and energy are those of the sector, not of the full ring."""

    @property
    def moment_rate(self) -> float:
        """Rate of the moment along the tangent."""
        return self.observables["moment"][1]

    @property
    def slope(self) -> float:
        """D moment/d load along the path; infinite at a fold."""
        rate = self.parameter_rate
        return self.moment_rate / rate if rate != 0.0 else np.inf


@kernel
def newton(
    cell, length, mass, rest, stiffness, stretching, measure, closed,
    free, weight, axis, target, turn, turn_axis, pull, reach,
    load, control, along, moment, tolerance, most,
    begin_quat, begin_stretch, begin_load, masses, known, shift,
    work, out_quat, out_stretch, out_force, out_change, out_w,
):  # fmt: skip
    """Newton's method for an equilibrium, or (``masses`` not empty) for an implicit step in time.

    Rod and supports come field by field: numba is slow to take named tuples apart. ``along`` (m,)
    is the direction. The line that starts with ``begin_quat`` is that of `implicit_step`: a step w
    from the frames at its begin adds M (known + shift w) to the forces; it stops where the matrix
    is not positive on the conditions, and has no tangent.

    Parameters
    ----------
    work : memory, see `workspace`.
    out_quat, out_stretch, out_force : the start, moved to the end.
    out_change : (m,) the tangent there. out_w : the step in time, as long as ``masses``.

    Returns
    -------
    tuple : load; elastic energy, dL/dload and its rate along the tangent; position in `REASONS`,
        vertex bent too far, iterations, residual, negative eigenvalues of the bordered matrix;
        residual without inertia.
    """
    moving = masses.shape[0] > 0
    w, heavy = out_w, 0.0
    if moving:
        heavy = shift * masses[-1]
        for k in range(w.shape[0]):
            w[k] = 0.0
    rod = Rod(cell, length, mass, rest, stiffness, stretching, measure, closed)
    held = Supports(free, weight, axis, target, turn, turn_axis, pull, reach)
    n, b = held.free.shape
    n_c = held.target.shape[0]
    quat, stretch, force = out_quat, out_stretch, out_force
    # corrections, and the tangent at last, by their parts
    q_rate, force_rate = out_change[: n * b].reshape((n, b)), out_change[n * b : -1]
    x, y, z = q_rate.reshape((n, b, 1)), force_rate.reshape((n_c, 1)), out_change[-1:]
    system, work = system_of(work, n, b, n_c)
    row, work = rows(work, n, b)
    no_row, work = rows(work, n, b)
    no_border = np.zeros(n_c)
    for j in range(n):
        for i in range(b):
            row[j, i] = mass[j, 0] * along[j * b + i]
            no_row[j, i] = 0.0
            q_rate[j, i] = 0.0
    for k in range(n_c):
        force_rate[k] = 0.0
    z[0] = 0.0
    negative, moment_rate, first = -1, 0.0, 0.0
    outcome, iteration = 1, 0
    while True:
        energy, load_grad, load_hess, noise, bent_too_far = assemble(
            rod, held, quat, stretch, force, load, system
        )
        at_rest = residual = _residual(held, system, load_grad, control, moment)
        goal = moment
        if moving:
            _step_so_far(held.free, begin_quat, begin_stretch, quat, stretch, w)
            w[-1] = load - begin_load
            goal -= masses[-1] * known[-1] + heavy * w[-1]
            _add_inertia(held.free, masses, known, shift, w, system.grad, system.diag)
            residual = _residual(held, system, load_grad, control, goal)
        first = residual if iteration == 0 else first
        grown = not moving and iteration > 1 and residual > 1e3 * max(first, 1.0)
        if grown or not np.isfinite(residual):
            outcome = 2
            break
        if bent_too_far >= 0:
            outcome = 3
            break
        early = not moving and iteration <= 1 and iteration < most
        wanted = _CLOSE * tolerance if early else tolerance
        done = residual <= max(wanted, 10.0 * noise)
        if done and moving:
            outcome = 0
            break
        if not done and iteration >= most:
            break
        diag, off, border, column = system.diag, system.off, system.border, system.load_column
        hold(held.free, diag, off, border)
        for j in range(n):
            for i in range(b):
                q_rate[j, i] = -system.grad[j, i]
                if done or not held.free[j, i]:
                    q_rate[j, i] = 0.0
                if not held.free[j, i]:
                    column[j, i] = 0.0
        for k in range(n_c):
            force_rate[k] = 0.0 if done else -system.gap[k]
        z[0] = 0.0
        factors, left = factor(diag, off, border, work)
        # the closing row: of the direction for the tangent, else that of the control
        last, last_border, corner = row, no_border, along[-1]
        if done or moving:
            negative, _ = inertia(factors)
        if done:
            z[0] = 1.0
        elif control == 0:
            last, corner = no_row, 1.0
        elif control == 2:
            last, last_border, corner = column, system.load_border, load_hess + heavy
            z[0] = goal - load_grad
        usable = factors.negative >= 0 and (not moving or negative == n_c)
        solved = usable and solve_refined(
            diag, off, factors, n_c, column, system.load_border, last, last_border, corner, x, y, z,
            left,
        )  # fmt: skip
        if not solved:
            outcome = 4
            break
        if done:
            moment_rate = _normalise(rod, system, load_hess, q_rate, force_rate, z)
            outcome = 0
            break
        if control == 0:
            z[0] = 0.0  # the load is given: not even rounding moves it
        largest = abs(z[0])
        for j in range(n):
            for i in range(3):
                largest = max(largest, abs(q_rate[j, i]))
        if not largest < _LARGEST_TURN:
            outcome = 2
            break
        move(turn, turn_axis, quat, stretch, force, out_change)
        load += z[0]
        iteration += 1
    # a plain tuple: to make a named one runs Python, in which Ctrl-C would end the process
    values = (energy, load_grad, moment_rate)
    return (load, *values, outcome, bent_too_far, iteration, residual, negative, at_rest)


@kernel
def _step_so_far(free, begin_quat, begin_stretch, quat, stretch, out_w):
    """Rotation vectors and stretches of the free unknowns since the begin of a step in time."""
    n, b = free.shape
    turns = np.empty(3)
    for j in range(n):
        turn_between(begin_quat[j], quat[j], turns)
        for i in range(b):
            if free[j, i]:
                out_w[j * b + i] = turns[i] if i < 3 else stretch[j] - begin_stretch[j]


@kernel
def _add_inertia(free, masses, known, shift, w, out_grad, out_diag):
    """Add the forces of inertia M (known + shift w) to the gradient, and shift M to the Hessian."""
    n, b = free.shape
    for j in range(n):
        for i in range(b):
            if free[j, i]:
                k = j * b + i
                out_grad[j, i] += masses[k] * (known[k] + shift * w[k])
                out_diag[j, i, i] += masses[k] * shift


@kernel
def _residual(held, system, load_grad, control, moment):
    """Largest entry of the gradient that is free to vanish, of the position gaps and the moment."""
    largest = 0.0
    n, b = held.free.shape
    for j in range(n):
        for i in range(b):
            if held.free[j, i] and not abs(system.grad[j, i]) <= largest:  # true for NaN, too
                largest = abs(system.grad[j, i])
    for gap in system.gap:
        largest = max(largest, abs(gap))
    if control == 2:
        largest = max(largest, abs(load_grad - moment))
    return largest


@kernel
def _normalise(rod, system, load_hess, x, y, z):
    """Scale a tangent (n, b), (n_c,), (1,) in place to unit norm; returns d(dL/dload) along it."""
    n, b = x.shape
    square = z[0] * z[0]
    for j in range(n):
        for i in range(b):
            square += rod.mass[j, 0] * x[j, i] * x[j, i]
    scale = 1.0 / np.sqrt(square)
    z[0] *= scale
    rate = load_hess * z[0]
    for j in range(n):
        for i in range(b):
            x[j, i] *= scale
            rate += system.load_column[j, i] * x[j, i]
    for k in range(y.shape[0]):
        y[k] *= scale
        rate += system.load_border[k] * y[k]
    return rate


def correct(
    rod: Rod,
    supports: Supports,
    start: State,
    along: Increment,
    closing: tuple[int, float],
    *,
    tolerance: float,
    iterations: int,
    work: Array,
) -> Equilibrium:
    """Newton's method from ``start``; see `RodSystem.correct`.

    Parameters
    ----------
    along : (m,) direction that orients the tangent and, with DIRECTION_HELD, stays orthogonal to
        every correction.
    closing : what is held, and the value of dL/dload where that is it.
    work : memory for kernels, see `workspace`.
    """
    control, moment = closing
    still = (start.quat, start.stretch, start.load, _NOTHING, _NOTHING, 0.0)
    quat, stretch, force = start.quat.copy(), start.stretch.copy(), start.force.copy()
    tangent = np.empty(len(along))
    load, energy, conjugate, rate, outcome, where, taken, residual, negative, _ = newton(
        *rod, *supports, start.load, control, along, moment, tolerance, iterations, *still,
        work, quat, stretch, force, tangent, _NOTHING,
    )  # fmt: skip
    return Equilibrium(
        State(quat, stretch, force, load),
        load,
        tangent,
        {"moment": (conjugate, rate), "energy": (energy, conjugate * float(tangent[-1]))},
        negative - len(supports.target) if negative >= 0 else None,
        REASONS[outcome],
        f"vertex {where}" if where >= 0 else "",
        taken,
        residual,
    )
