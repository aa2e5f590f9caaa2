"""How many ways down: the index of a state, class by class, and the softest modes.

The matrix is the Hessian of the Lagrangian, constraint forces included, on the position
conditions; its negative eigenvalues are those of the bordered matrix less one for each condition.
On a symmetric state the modes of the full ring fall into classes by what the half-turns do to
them, and each class is a problem on the sector with conditions of its own (`SymmetryClass`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from der.assembly import assemble, position_rows, take_out
from der.block_ldl import factor, inertia, solve_refined
from der.frames import Array
from der.rod import Rod, State
from der.supports import Supports, check_cut

_SAFE = 1e-7  # scaled border pivot above which an index needs no second look: wrong counts were
# seen up to 6e-10 on random matrices
_SETTLED = 1e-13  # of an eigenvalue: its change in the last round
_SHIFT = 1e-8  # of the largest stiffness: the second look


class SymmetryClass(NamedTuple):
    """The modes of one symmetry, as a problem on the sector."""

    free: NDArray[np.bool_]  # (n, b) what may move
    weight: Array  # (n_c, n) conditions on positions
    axis: Array  # (n_c, 3)


@njit(cache=True)
def _class_matrix(rod, held, modes, quat, stretch, force, load):
    """Blocks and border of the Hessian at a state of ``held``, for the modes of one class."""
    system = assemble(rod, held, quat, stretch, force, load)
    n, b = held.free.shape
    n_c = modes.axis.shape[0]
    border = np.zeros((n, b, n_c))
    position_rows(rod.length, modes.weight, modes.axis, quat, stretch, np.zeros(n_c), border)
    return take_out(modes.free, system.diag, system.off, border)


@njit(cache=True)
def _count(rod, held, modes, quat, stretch, force, load, shift):
    diag, off, border = _class_matrix(rod, held, modes, quat, stretch, force, load)
    n, b = held.free.shape
    if shift != 0.0:
        for j in range(n):
            for i in range(b):
                diag[j, i, i] += shift * rod.length[j]
    negative, margin = inertia(factor(diag, off, border))
    return negative - modes.axis.shape[0], margin


def index(body: Rod, held: Supports, modes: SymmetryClass, state: State) -> int | None:
    """Number of negative eigenvalues among the modes of a class; None where it is uncertain.

    A state of ``held`` at which the smallest pivot is tiny is factored again with a shift of
    either sign: equal counts certify the index, unequal ones make it None.
    """
    check_cut(body, modes.free)
    at = (body, held, modes, state.quat, state.stretch, state.force, state.load)
    negative, margin = _count(*at, 0.0)
    if negative >= 0 and margin > _SAFE:
        return int(negative)
    shift = _SHIFT * float(body.stiffness.max())
    below, above = (_count(*at, s)[0] for s in (-shift, shift))
    return int(below) if below == above >= 0 else None


def raw_index(body: Rod, held: Supports, modes: SymmetryClass, state: State) -> int:
    """The index by the signs of the pivots alone, as a bisection for its changes needs it."""
    at = (body, held, modes, state.quat, state.stretch, state.force, state.load)
    return int(_count(*at, 0.0)[0])


def all_modes(held: Supports) -> SymmetryClass:
    """Every motion that the supports leave free, as one class."""
    return SymmetryClass(held.free, held.weight, held.axis)


@njit(cache=True)
def _solve_class(rod, held, modes, quat, stretch, force, load, x):
    """Replace ``x`` (n, b, r) by the displacements under it as forces, on the conditions."""
    diag, off, border = _class_matrix(rod, held, modes, quat, stretch, force, load)
    n, b, r = x.shape
    m = modes.axis.shape[0]
    none, no_row = np.zeros(m), np.zeros((n, b))
    factors = factor(diag, off, border)
    solve_refined(
        diag, off, factors, m, no_row, none, no_row, none, 1.0, x, np.zeros((m, r)), np.zeros(r)
    )
    for j in range(n):
        for i in range(b):
            if not modes.free[j, i]:
                for k in range(r):
                    x[j, i, k] = 0.0


def softest_modes(
    body: Rod, held: Supports, modes: SymmetryClass, state: State, count: int = 1
) -> tuple[Array, Array]:
    """Eigenvalues nearest to zero (count,) and their modes (count, n, b).

    The eigenproblem is H w = mu M w on the position conditions, M = diag(edge length): mu is a
    stiffness per length, GJ/a^2, that converges with the mesh. Modes have unit M-norm.

    Notes
    -----
    Subspace iteration with the inverse (Bathe), two guard vectors, until a round no longer changes
    the eigenvalues, or 30 rounds: enough where these are separated by a factor of two from the
    rest. A mode's error is the square root of its eigenvalue's.
    """
    check_cut(body, modes.free)
    n, b = modes.free.shape
    size = min(count + 2, int(modes.free.sum()) - len(modes.axis))
    root = np.sqrt(np.repeat(body.length, b))[:, None]
    start = np.random.default_rng(0).normal(size=(n * b, size)) * modes.free.reshape(-1, 1)
    z, _ = np.linalg.qr(start)  # modes times sqrt(M), orthonormal
    compliance = np.zeros(size)
    for _ in range(30):
        y = np.ascontiguousarray((root * z).reshape(n, b, size))
        _solve_class(body, held, modes, state.quat, state.stretch, state.force, state.load, y)
        y = root * y.reshape(n * b, size)
        projected = z.T @ y
        before = compliance[:count]
        compliance, turn = np.linalg.eigh(0.5 * (projected + projected.T))
        order = np.argsort(-np.abs(compliance))
        compliance = compliance[order]
        z, _ = np.linalg.qr(y @ turn[:, order])
        if np.all(np.abs(compliance[:count] - before) <= _SETTLED * np.abs(before)):
            break
    return 1.0 / compliance[:count], (z / root).T[:count].reshape(count, n, b)
