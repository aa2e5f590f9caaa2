"""The index of a state for each symmetry class, and its softest modes.

The matrix is the Hessian of the Lagrangian, constraint forces included, on the position
conditions; its negative eigenvalues are those of the bordered matrix less one for each condition.
On a symmetric state the modes of the full ring fall into classes by what the half-turns do to
them, and each class is a problem on the sector with conditions of its own (`SymmetryClass`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from der.kernels.assembly import assemble, lengthened, position_rows, take_out
from der.kernels.block_ldl import factor, inertia, solve_band, solve_refined
from der.kernels.dense import solve_dense
from der.kernels.quaternions import Array
from der.rod.rod import Rod, State
from der.rod.supports import Supports, check_cut

_SAFE = 1e-7  # scaled border pivot above which an index needs no second look: wrong counts were
# seen up to 6e-10 on random matrices
_SETTLED = 1e-13  # of an eigenvalue: its change in the last round
_ROUNDS = 3  # of inverse iteration, in the estimate of a stiffness
_IRRATIONAL = (0.6180339887498949, 0.7548776662466927)  # their multiples fill (0, 1) evenly
_SHIFT = 1e-8  # of the largest stiffness: the second look


class SymmetryClass(NamedTuple):
    """The modes of one symmetry, as a problem on the sector."""

    free: NDArray[np.bool_]  # (n, b) unknowns that may move
    weight: Array  # (n_c, n) conditions on positions
    axis: Array  # (n_c, 3)


class Stack(NamedTuple):
    """Several classes, for a kernel that assembles the matrix of a state once for all of them."""

    free: NDArray[np.bool_]  # (k, n, b)
    weight: Array  # (k, m, n), of the class with most conditions; the rest are padding
    axis: Array  # (k, m, 3)
    conditions: NDArray[np.int64]  # (k,) how many each class has


def stack(classes: Sequence[SymmetryClass]) -> Stack:
    """Some classes of one sector, one behind another."""
    sizes = [len(modes.axis) for modes in classes]
    n, m = classes[0].free.shape[0], max(sizes)
    weight, axis = np.zeros((len(sizes), m, n)), np.zeros((len(sizes), m, 3))
    for k, (modes, size) in enumerate(zip(classes, sizes, strict=True)):
        weight[k, :size], axis[k, :size] = modes.weight, modes.axis
    return Stack(np.array([modes.free for modes in classes]), weight, axis, np.array(sizes))


@njit(cache=True, inline="always")
def _class_matrix(rod, supports, system, free, weight, axis, quat, stretch, load):
    """Blocks and border of the Hessian at a state of ``supports``, for the modes of one class."""
    n, b = supports.free.shape
    n_c = axis.shape[0]
    border = np.zeros((n, b, n_c))
    strain = lengthened(rod, supports, stretch, load)
    position_rows(rod.length, weight, axis, quat, strain, np.zeros(n_c), border)
    return take_out(free, system.diag, system.off, border)


@njit(cache=True)
def _stiffness(rod, free, factors):
    """Estimate of the eigenvalue nearest to zero, by `_ROUNDS` of inverse iteration of two vectors.

    The largest compliance among the two in their span; one alone would mix modes of either sign.
    """
    n, b = free.shape
    M = factors.schur.shape[0]
    start, x = np.zeros((n, b, 2)), np.zeros((n, b, 2))
    for j in range(n):  # of no symmetry, neither smooth nor of any sign
        for i in range(b):
            if free[j, i]:
                for r in range(2):
                    x[j, i, r] = ((j * b + i + 1) * _IRRATIONAL[r]) % 1.0 - 0.5
    y, c = np.empty((M, 2)), np.zeros((2, 2))
    for _ in range(_ROUNDS):
        _orthonormalise(rod.length, x)
        for j in range(n):
            for i in range(b):
                for r in range(2):
                    start[j, i, r] = x[j, i, r]
                    x[j, i, r] *= rod.length[j]
        solve_band(factors.inverse, factors.lower, x)
        A = factors.schur.copy()
        for p in range(M):
            for r in range(2):
                y[p, r] = 0.0
        for j in range(n):
            for i in range(b):
                for p in range(M):
                    for r in range(2):
                        y[p, r] -= factors.border[j, i, p] * x[j, i, r]
        if not solve_dense(A, y):
            return 0.0
        for j in range(n):
            for i in range(b):
                for r in range(2):
                    if not free[j, i]:
                        x[j, i, r] = 0.0
                        continue
                    for p in range(M):
                        x[j, i, r] -= factors.lifted[j, i, p] * y[p, r]
    for j in range(n):
        for i in range(b):
            for r in range(2):
                for q in range(2):
                    c[q, r] += start[j, i, q] * rod.length[j] * x[j, i, r]
    middle, half = 0.5 * (c[0, 0] + c[1, 1]), 0.5 * (c[0, 0] - c[1, 1])
    radius = np.sqrt(half * half + c[0, 1] * c[1, 0])
    largest = middle + radius if middle > 0.0 else middle - radius
    return 1.0 / largest if largest != 0.0 else 0.0


@njit(cache=True)
def _orthonormalise(length, out_x):
    """Make the two columns of (n, b, 2) orthonormal in the product with the edges' lengths."""
    n, b, _ = out_x.shape
    first, mixed, second = 0.0, 0.0, 0.0
    for j in range(n):
        for i in range(b):
            first += length[j] * out_x[j, i, 0] ** 2
            mixed += length[j] * out_x[j, i, 0] * out_x[j, i, 1]
    part = mixed / first if first > 0.0 else 0.0
    for j in range(n):
        for i in range(b):
            out_x[j, i, 1] -= part * out_x[j, i, 0]
            second += length[j] * out_x[j, i, 1] ** 2
    one = 1.0 / np.sqrt(first) if first > 0.0 else 0.0
    other = 1.0 / np.sqrt(second) if second > 0.0 else 0.0  # 0 where there is one unknown only
    for j in range(n):
        for i in range(b):
            out_x[j, i, 0] *= one
            out_x[j, i, 1] *= other


@njit(cache=True)
def _counts(
    cell, length, mass, rest, bending, stretching, measure, closed,
    free, weight, axis, target, turn, turn_axis, pull, reach,
    frees, weights, axes, conditions, quat, stretch, force, load, shift, looks,
):  # fmt: skip
    """Index, its safety, and (if ``looks``) the stiffness of the softest mode, (k,) each.

    Rod, supports and classes come field by field: numba is slow to take named tuples apart.
    """
    rod = Rod(cell, length, mass, rest, bending, stretching, measure, closed)
    supports = Supports(free, weight, axis, target, turn, turn_axis, pull, reach)
    classes = Stack(frees, weights, axes, conditions)
    k = classes.free.shape[0]
    n, b = supports.free.shape
    negative, margin = np.empty(k, dtype=np.int64), np.empty(k)
    stiffness = np.zeros(k)
    system = assemble(rod, supports, quat, stretch, force, load)
    for c in range(k):
        m = classes.conditions[c]
        # copies: what they are slices of need not be contiguous, and one kind is compiled
        own_weight, own_axis = classes.weight[c, :m].copy(), classes.axis[c, :m].copy()
        own_free = classes.free[c].copy()
        diag, off, border = _class_matrix(
            rod, supports, system, own_free, own_weight, own_axis, quat, stretch, load
        )
        if shift != 0.0:
            for j in range(n):
                for i in range(b):
                    diag[j, i, i] += shift * rod.length[j]
        factors = factor(diag, off, border)
        count, margin[c] = inertia(factors)
        negative[c] = count - m
        if looks and count >= 0:
            stiffness[c] = _stiffness(rod, own_free, factors)
    return negative, margin, stiffness


def index(rod: Rod, supports: Supports, modes: SymmetryClass, state: State) -> int | None:
    """Number of negative eigenvalues among the modes of a class; None where it is uncertain.

    A state of ``supports`` at which the smallest pivot is tiny is factored again with a shift of
    either sign: equal counts certify the index, unequal ones make it None.
    """
    check_cut(rod, modes.free)
    return _certified(rod, supports, stack([modes]), state, looks=False)[0][0]


def indices_and_stiffness(
    rod: Rod, supports: Supports, classes: Stack, state: State
) -> tuple[tuple[int | None, ...], tuple[float, ...]]:
    """`index` of each class, and about how stiff its softest mode is [GJ/a^2], with its sign.

    The stiffness is that of `softest_modes`, estimated at little cost: good where it is small.
    """
    for free in classes.free:
        check_cut(rod, free)
    return _certified(rod, supports, classes, state, looks=True)


def _certified(
    rod: Rod, supports: Supports, classes: Stack, state: State, *, looks: bool
) -> tuple[tuple[int | None, ...], tuple[float, ...]]:
    at = (*rod, *supports, *classes, *state)
    negative, margin, stiffness = _counts(*at, 0.0, looks)
    counts: list[int | None] = negative.tolist()
    safe = margin.tolist()
    doubtful = [c for c in range(len(safe)) if negative[c] < 0 or not safe[c] > _SAFE]
    if doubtful:
        shift = _SHIFT * float(rod.stiffness.max())
        below, above = (_counts(*at, s, False)[0] for s in (-shift, shift))
        for c in doubtful:
            counts[c] = int(below[c]) if below[c] == above[c] >= 0 else None
    return tuple(counts), tuple(stiffness.tolist())


def raw_index(rod: Rod, supports: Supports, modes: SymmetryClass, state: State) -> int:
    """The index by the signs of the pivots alone, as a bisection for its changes needs it."""
    at = (*rod, *supports, *stack([modes]), *state)
    return int(_counts(*at, 0.0, False)[0][0])


def all_modes(supports: Supports) -> SymmetryClass:
    """Every motion that the supports leave free, as one class."""
    return SymmetryClass(supports.free, supports.weight, supports.axis)


@njit(cache=True)
def _solve_class(rod, supports, modes, quat, stretch, force, load, x):
    """Replace ``x`` (n, b, r) by the displacements under it as forces, on the conditions."""
    system = assemble(rod, supports, quat, stretch, force, load)
    diag, off, border = _class_matrix(
        rod, supports, system, modes.free, modes.weight, modes.axis, quat, stretch, load
    )
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
    rod: Rod, supports: Supports, modes: SymmetryClass, state: State, count: int = 1
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
    check_cut(rod, modes.free)
    n, b = modes.free.shape
    size = min(count + 2, int(modes.free.sum()) - len(modes.axis))
    root = np.sqrt(np.repeat(rod.length, b))[:, None]
    start = np.random.default_rng(0).normal(size=(n * b, size)) * modes.free.reshape(-1, 1)
    z, _ = np.linalg.qr(start)  # modes times sqrt(M), orthonormal
    compliance = np.zeros(size)
    for _ in range(30):
        y = np.ascontiguousarray((root * z).reshape(n, b, size))
        _solve_class(rod, supports, modes, state.quat, state.stretch, state.force, state.load, y)
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
