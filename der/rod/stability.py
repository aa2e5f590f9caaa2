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
from numpy.typing import NDArray

from der.kernels.assembly import assemble, hold, position_rows, system_of
from der.kernels.block_ldl import factor, inertia, solve, solve_refined
from der.kernels.quaternions import Array
from der.kernels.workspace import blocks, rows, workspace
from der.packs.kernel import kernel
from der.problem import Indices, Softest
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
    # (g, n) edges to which half-turns lead that map the sector onto itself
    half_turns: NDArray[np.int64] = np.empty((0, 0), dtype=np.int64)


class Stack(NamedTuple):
    """Several classes, for a kernel that assembles the matrix of a state once for all of them."""

    free: NDArray[np.bool_]  # (k, n, b)
    weight: Array  # (k, m, n), of the class with most conditions; the rest are padding
    axis: Array  # (k, m, 3)
    conditions: NDArray[np.int64]  # (k,) how many each class has
    starts: Array  # (k, p, n, b, 2) of `start_vectors`; p = 0: no stiffness is wanted
    work: Array  # memory for kernels


def stack(classes: Sequence[SymmetryClass], work: Array, *, looks: bool = False) -> Stack:
    """Some classes of one sector, one behind another; ``looks``: for their stiffness, too."""
    sizes = [len(modes.axis) for modes in classes]
    (n, b), m = classes[0].free.shape, max(sizes)
    weight, axis = np.zeros((len(sizes), m, n)), np.zeros((len(sizes), m, 3))
    for k, (modes, size) in enumerate(zip(classes, sizes, strict=True)):
        weight[k, :size], axis[k, :size] = modes.weight, modes.axis
    starts = (
        [start_vectors(modes) for modes in classes] if looks else np.empty((len(sizes), 0, n, b, 2))
    )
    free = np.array([c.free for c in classes])
    return Stack(free, weight, axis, np.array(sizes), np.array(starts), work)


def start_vectors(modes: SymmetryClass) -> Array:
    """Start vectors (p, n, b, 2) for the softest modes of a class: two for each of p symmetries.

    Inverse iteration keeps the symmetry of its vectors under the half-turns of a state, so a mode
    does not hide one of another symmetry.
    """
    n, b = modes.free.shape
    # of no symmetry, neither smooth nor of any sign
    spread = np.arange(1, n * b + 1).reshape(n, b, 1) * np.array(_IRRATIONAL) % 1.0 - 0.5
    found = [spread * modes.free[:, :, None]]
    # half-turns that run the curve backwards keep d2 and reverse d1 and d3
    sense = np.array([-1.0, 1.0, -1.0, 1.0])[:b, None]
    for onto in modes.half_turns:
        found = [x + sign * sense * x[onto] for x in found for sign in (1.0, -1.0)]
    return np.array(found)


@kernel
def _class_matrix(rod, supports, system, free, weight, axis, m, state, out_blocks):
    """Blocks and border of the Hessian at a state of ``supports``, for a class's ``m`` conditions.

    ``state``: frames, stretches and the load. ``out_blocks``: diag, off, border.
    """
    quat, stretch, load = state
    diag, off, border = out_blocks
    n, b = free.shape
    for j in range(n):
        for i in range(b):
            for k in range(b):
                diag[j, i, k] = system.diag[j, i, k]
                off[j, i, k] = system.off[j, i, k]
    position_rows(rod, supports, weight, axis, quat, stretch, load, np.zeros(m), border)
    hold(free, diag, off, border)


@kernel
def _stiffness(length, factors, start, work):
    """Estimate of the eigenvalue nearest to zero, by `_ROUNDS` of inverse iteration of ``start``.

    The largest compliance in the span of two vectors; one alone would mix modes of either sign.
    """
    n, b, _ = start.shape
    x, work = blocks(work, n, b, 2)
    f, _ = blocks(work, n, b, 2)
    c = np.zeros((2, 2))
    for j in range(n):
        for i in range(b):
            for r in range(2):
                x[j, i, r] = start[j, i, r]
    for _ in range(_ROUNDS):
        _orthonormalise(length, x)
        for j in range(n):
            for i in range(b):
                for r in range(2):
                    f[j, i, r] = length[j] * x[j, i, r]
                    x[j, i, r] = f[j, i, r]
        if not solve(factors, x):
            return 0.0
    for j in range(n):
        for i in range(b):
            for r in range(2):
                for q in range(2):
                    c[q, r] += f[j, i, q] * x[j, i, r]
    middle, half = 0.5 * (c[0, 0] + c[1, 1]), 0.5 * (c[0, 0] - c[1, 1])
    radius = np.sqrt(half * half + c[0, 1] * c[1, 0])
    largest = middle + radius if middle > 0.0 else middle - radius
    return 1.0 / largest if largest != 0.0 else 0.0


@kernel
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


@kernel
def _counts(
    cell, length, mass, rest, bending, stretching, measure, closed,
    free, weight, axis, target, turn, turn_axis, pull, reach,
    frees, weights, axes, conditions, starts, work, quat, stretch, force, load, shift,
    out_negative, out_margin, out_stiffness,
):  # fmt: skip
    """Index and its safety (k,), and the stiffness of the softest modes (k, p).

    Rod, supports and classes come field by field: numba is slow to take named tuples apart.
    """
    rod = Rod(cell, length, mass, rest, bending, stretching, measure, closed)
    supports = Supports(free, weight, axis, target, turn, turn_axis, pull, reach)
    classes, p = starts.shape[:2]
    n, b = supports.free.shape
    system, work = system_of(work, n, b, target.shape[0])
    assemble(rod, supports, quat, stretch, force, load, system)
    diag, work = blocks(work, n, b, b)
    off, work = blocks(work, n, b, b)
    for c in range(classes):
        m = conditions[c]
        border, left = blocks(work, n, b, m)
        _class_matrix(
            rod, supports, system, frees[c], weights[c], axes[c], m, (quat, stretch, load),
            (diag, off, border),
        )  # fmt: skip
        if shift != 0.0:
            for j in range(n):
                for i in range(b):
                    diag[j, i, i] += shift * rod.length[j]
        factors, left = factor(diag, off, border, left)
        count, out_margin[c] = inertia(factors)
        out_negative[c] = count - m
        for r in range(p):
            looks = count >= 0
            out_stiffness[c, r] = _stiffness(length, factors, starts[c, r], left) if looks else 0.0


def index(rod: Rod, supports: Supports, modes: SymmetryClass, state: State) -> int | None:
    """Number of negative eigenvalues among the modes of a class; None where it is uncertain.

    A state of ``supports`` at which the smallest pivot is tiny is factored again with a shift of
    either sign: equal counts certify the index, unequal ones make it None.
    """
    check_cut(rod, modes.free)
    (n, b), m = modes.free.shape, max(len(modes.axis), len(supports.target))
    alone = stack([modes], workspace(n, b, m))
    return _certified(rod, supports, alone, state)[0][0]


def indices_and_stiffness(
    rod: Rod, supports: Supports, classes: Stack, state: State
) -> tuple[Indices, Softest]:
    """`index` of each class, and how stiff its softest modes are [GJ/a^2], with their signs.

    One mode for each symmetry of `start_vectors`. The stiffness is that of `softest_modes`,
    estimated at little cost: good where it is small.
    """
    for free in classes.free:
        check_cut(rod, free)
    return _certified(rod, supports, classes, state)


def _certified(
    rod: Rod, supports: Supports, classes: Stack, state: State
) -> tuple[Indices, Softest]:
    negative, margin, stiffness = _counted(rod, supports, classes, state)
    counts: list[int | None] = negative.tolist()
    safe = margin.tolist()
    doubtful = [c for c in range(len(safe)) if negative[c] < 0 or not safe[c] > _SAFE]
    if doubtful:
        shift = _SHIFT * float(rod.stiffness.max())
        counting = _counting(classes)
        below, above = (_counted(rod, supports, counting, state, s)[0] for s in (-shift, shift))
        for c in doubtful:
            counts[c] = int(below[c]) if below[c] == above[c] >= 0 else None
    return tuple(counts), tuple(map(tuple, stiffness.tolist()))


def _counted(
    rod: Rod, supports: Supports, classes: Stack, state: State, shift: float = 0.0
) -> tuple[NDArray[np.int64], Array, Array]:
    """Index and its safety (k,), and the stiffness of the softest modes (k, p)."""
    k, p = classes.starts.shape[:2]
    found = np.empty(k, dtype=np.int64), np.empty(k), np.empty((k, p))
    _counts(*rod, *supports, *classes, *state, shift, *found)
    return found


def _counting(classes: Stack) -> Stack:
    """The same without a look at the stiffness."""
    return classes._replace(starts=classes.starts[:, :0])


def raw_index(rod: Rod, supports: Supports, alone: Stack, state: State) -> int:
    """The index of one class by the signs of the pivots alone, as a bisection for it needs it."""
    return int(_counted(rod, supports, _counting(alone), state)[0][0])


def all_modes(supports: Supports) -> SymmetryClass:
    """Every motion that the supports leave free, as one class."""
    return SymmetryClass(supports.free, supports.weight, supports.axis)


@kernel
def _solve_class(rod, supports, modes, quat, stretch, force, load, work, out_x):
    """Replace ``out_x`` (n, b, r) by the displacements under it as forces, on the conditions."""
    n, b, r = out_x.shape
    m = modes.axis.shape[0]
    system, work = system_of(work, n, b, force.shape[0])
    assemble(rod, supports, quat, stretch, force, load, system)
    diag, work = blocks(work, n, b, b)
    off, work = blocks(work, n, b, b)
    border, work = blocks(work, n, b, m)
    _class_matrix(
        rod, supports, system, modes.free, modes.weight, modes.axis, m, (quat, stretch, load),
        (diag, off, border),
    )  # fmt: skip
    no_row, work = rows(work, n, b)
    for j in range(n):
        for i in range(b):
            no_row[j, i] = 0.0
    none, y, z = np.zeros(m), np.zeros((m, r)), np.zeros(r)
    factors, work = factor(diag, off, border, work)
    solve_refined(diag, off, factors, m, no_row, none, no_row, none, 1.0, out_x, y, z, work)
    for j in range(n):
        for i in range(b):
            if not modes.free[j, i]:
                for k in range(r):
                    out_x[j, i, k] = 0.0


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
    work = workspace(n, b, max(len(modes.axis), len(supports.target)), size)
    for _ in range(30):
        y = np.ascontiguousarray((root * z).reshape(n, b, size))
        _solve_class(rod, supports, modes, *state, work, y)
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
