"""Newton's method for an equilibrium of a supported rod, and the path's tangent there.

Three conditions can close the system of equilibrium equations, in which the load is one of the
unknowns: the load is given, the generalised moment is given, or the correction is orthogonal to a
direction (pseudo-arclength). The index and the tangent come from the factors of the last iterate.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import njit

from der.kernels.assembly import assemble, hold
from der.kernels.block_ldl import factor, inertia, solve_refined
from der.kernels.quaternions import Array, into_frame, turned
from der.rod.rod import Rod, State
from der.rod.supports import Supports, check_cut

# of the tolerance, for the start and the first iterate: a good start would stop right below it,
# which a fold magnifies; later iterates may not get there, close to a branch point
_CLOSE = 1e-2
_LARGEST_TURN = 1.0  # rad; a correction that turns an edge further has left the path


class Control(IntEnum):
    """Which condition closes the equilibrium equations."""

    LOAD = 0
    DIRECTION = 1
    MOMENT = 2


class Outcome(IntEnum):
    """How a solve ended."""

    CONVERGED = 0
    TOO_MANY_ITERATIONS = 1
    DIVERGED = 2
    BENT_TOO_FAR = 3
    SINGULAR = 4


_OUTCOMES = tuple(Outcome)
ADVICE = {
    Outcome.CONVERGED: "converged",
    Outcome.TOO_MANY_ITERATIONS: "Newton's method did not converge; try a closer start",
    Outcome.DIVERGED: "Newton's method left the neighbourhood of its start; try a smaller step",
    Outcome.BENT_TOO_FAR: "turns or twists by more than 160 degrees; use more edges",
    Outcome.SINGULAR: "the tangent matrix is singular to the last digit",
}


class Direction(NamedTuple):
    """A rate of change of a state along a path."""

    q: Array  # (n, b) rotation vectors in the frames, and stretch
    force: Array  # (n_c,)
    load: float


@dataclass(frozen=True, slots=True)
class Equilibrium:
    """An equilibrium, or, where ``outcome`` is not CONVERGED, the last iterate."""

    state: State
    outcome: Outcome
    where: int  # vertex that is bent too far; -1: none
    iterations: int
    residual: float  # largest entry of gradient and position gap, GJ/a and a
    energy: float  # elastic energy of the rod as given (a sector's, not the ring's)
    moment: float  # dL/dload, work-conjugate to the load
    tangent: Direction  # of the path, of unit length in the mass-weighted norm
    moment_rate: float  # d moment along the tangent
    negative: int  # negative eigenvalues of the bordered matrix; -1: the factorisation gave up
    margin: float  # smallest scaled pivot; the count is safe above about 1e-8

    @property
    def converged(self) -> bool:
        """Whether this is an equilibrium."""
        return self.outcome is Outcome.CONVERGED

    @property
    def slope(self) -> float:
        """D moment/d load along the path; infinite at a fold."""
        rate = self.tangent.load
        return self.moment_rate / rate if rate != 0.0 else np.inf


@njit(cache=True)
def product(mass, a, b):
    """Mass-weighted inner product of two (n, b); ``mass`` (n, 1)."""
    total = 0.0
    for j in range(a.shape[0]):
        for i in range(a.shape[1]):
            total += mass[j, 0] * a[j, i] * b[j, i]
    return total


@njit(cache=True)
def _correct(
    cell, length, mass, rest, stiffness, stretching, measure, closed,
    free, weight, axis, target, turn, turn_axis, pull, reach,
    quat, stretch, force, load, control, along, along_load, moment, tolerance, most,
):  # fmt: skip
    """Newton's method; ``along`` (n, b) and ``along_load`` are the direction.

    Rod and supports come field by field: numba is slow to take named tuples apart. For what is
    returned see `Equilibrium`.
    """
    rod = Rod(cell, length, mass, rest, stiffness, stretching, measure, closed)
    held = Supports(free, weight, axis, target, turn, turn_axis, pull, reach)
    n, b = held.free.shape
    n_c = held.target.shape[0]
    quat, stretch, force = quat.copy(), stretch.copy(), force.copy()
    q_rate, force_rate = np.zeros((n, b)), np.zeros(n_c)  # corrections, and the tangent at last
    x, y, z = q_rate.reshape((n, b, 1)), force_rate.reshape((n_c, 1)), np.zeros(1)  # the same
    row, no_row, no_border = np.empty((n, b)), np.zeros((n, b)), np.zeros(n_c)
    for j in range(n):
        for i in range(b):
            row[j, i] = mass[j, 0] * along[j, i]
    negative, margin, moment_rate, first = -1, 0.0, 0.0, 0.0
    outcome, iteration = 1, 0
    while True:
        system = assemble(rod, held, quat, stretch, force, load)
        residual = _residual(held, system, control, moment)
        first = residual if iteration == 0 else first
        if not np.isfinite(residual) or (iteration > 1 and residual > 1e3 * max(first, 1.0)):
            outcome = 2
            break
        if system.bent_too_far >= 0:
            outcome = 3
            break
        wanted = tolerance if iteration > 1 or iteration == most else _CLOSE * tolerance
        done = residual <= max(wanted, 10.0 * system.noise)
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
        factors = factor(diag, off, border)
        # the closing row: of the direction for the tangent, else that of the control
        last, last_border, corner = row, no_border, along_load
        if done:
            negative, margin = inertia(factors)
            z[0] = 1.0
        elif control == 0:
            last, corner = no_row, 1.0
        elif control == 2:
            last, last_border, corner = column, system.load_border, system.load_hess
            z[0] = moment - system.load_grad
        solved = factors.negative >= 0 and solve_refined(
            diag,
            off,
            factors,
            n_c,
            column,
            system.load_border,
            last,
            last_border,
            corner,
            x,
            y,
            z,
        )
        if not solved:
            outcome = 4
            break
        if done:
            moment_rate = _normalise(rod, system, column, q_rate, force_rate, z)
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
        _move(turn, turn_axis, quat, stretch, force, q_rate, force_rate, z[0])
        load += z[0]
        iteration += 1
    # plain tuples: to make a named one runs Python, in which Ctrl-C would end the process
    state, tangent = (quat, stretch, force, load), (q_rate, force_rate, z[0])
    ends = (system.bent_too_far, iteration, residual, system.energy, system.load_grad)
    return outcome, state, ends, tangent, (moment_rate, negative, margin)


@njit(cache=True)
def _residual(held, system, control, moment):
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
        largest = max(largest, abs(system.load_grad - moment))
    return largest


@njit(cache=True)
def _normalise(rod, system, column, x, y, z):
    """Scale a tangent (n, b), (n_c,), (1,) in place to unit norm; returns d(dL/dload) along it."""
    n, b = x.shape
    scale = 1.0 / np.sqrt(product(rod.mass, x, x) + z[0] * z[0])
    z[0] *= scale
    rate = system.load_hess * z[0]
    for j in range(n):
        for i in range(b):
            x[j, i] *= scale
            rate += column[j, i] * x[j, i]
    for k in range(y.shape[0]):
        y[k] *= scale
        rate += system.load_border[k] * y[k]
    return rate


@njit(cache=True)
def _move(turn, turn_axis, quat, stretch, force, dq, dforce, dload):
    """Add an increment ``dq`` (n, b), ``dforce`` (n_c,) to the three arrays before, in place.

    The frames that turn with the load turn about a fixed axis, so theirs is exact at any angle.
    """
    n, b = dq.shape
    axis = np.empty(3)
    for j in range(n):
        for i in range(3):
            axis[i] = dq[j, i]
        if turn[j] != 0.0:
            into_frame(quat[j], turn_axis, axis)
            for i in range(3):
                axis[i] *= turn[j] * dload
        turned(quat[j], axis, quat[j])
        if b == 4:
            stretch[j] += dq[j, 3]
    for k in range(force.shape[0]):
        force[k] += dforce[k]


@njit(cache=True)
def _moved(turn, turn_axis, quat, stretch, force, dq, dforce, dload):
    """Copies of frames (n, 4), stretch (n,) and forces (n_c,), moved by an increment."""
    quat, stretch, force = quat.copy(), stretch.copy(), force.copy()
    _move(turn, turn_axis, quat, stretch, force, dq, dforce, dload)
    return quat, stretch, force


def dot(body: Rod, a: Direction, b: Direction) -> float:
    """Inner product of two directions, mass-weighted and so independent of the mesh.

    Forces do not enter.
    """
    return float(product(body.mass, a.q, b.q)) + a.load * b.load


def moved(held: Supports, state: State, step: Direction) -> State:
    """``state`` moved by the increment ``step``."""
    quat, stretch, force = _moved(
        held.turn, held.turn_axis, state.quat, state.stretch, state.force, step.q, step.force,
        step.load,
    )  # fmt: skip
    return State(quat, stretch, force, state.load + step.load)


def equilibrium(
    body: Rod,
    held: Supports,
    start: State,
    *,
    along: Direction | None = None,
    control: Control = Control.LOAD,
    moment: float = 0.0,
    tolerance: float = 1e-10,
    iterations: int = 12,
) -> Equilibrium:
    """Newton's method from ``start``.

    Parameters
    ----------
    along : direction that orients the tangent and, with Control.DIRECTION, stays orthogonal to
        every correction; default: increasing load.
    moment : value of dL/dload with Control.MOMENT.
    tolerance : of the residual; rounding sets a floor of ten times its estimate.

    Raises
    ------
    ValueError
        For a closed rod whose edge 0 is free (`supports.check_cut`).

    Notes
    -----
    Failure to converge is a value: see `Equilibrium.outcome` and `ADVICE`.
    """
    check_cut(body, held.free)
    if along is None:
        along = Direction(np.zeros(held.free.shape), np.zeros(len(held.target)), 1.0)
    outcome, state, ends, tangent, rates = _correct(
        *body,
        *held,
        start.quat,
        start.stretch,
        start.force,
        float(start.load),
        int(control),
        along.q,
        along.load,
        moment,
        tolerance,
        iterations,
    )
    where, taken, residual, energy, generalised = ends
    moment_rate, negative, margin = rates
    return Equilibrium(
        State(*state),
        _OUTCOMES[outcome],
        where,
        taken,
        residual,
        energy,
        generalised,
        Direction(*tangent),
        moment_rate,
        negative,
        margin,
    )
