"""Block LDL^T of a symmetric block-tridiagonal matrix with a dense border: O(n), with inertia.

        [ T  B ]   T: n diagonal blocks (b, b), and off[j] = T[j, j+1], (b, b) each
    K = [      ]
        [ B' 0 ]   B: m border columns

Blocks are eliminated in order, with complete (Bunch-Parlett) pivoting inside each. This alone is
not backward stable, because a pivot block may be almost singular when K is not. Such a pivot is
*delayed*: delta > 0 is added to its diagonal entry u and removed again by one more border column,

    [ T + delta u u'   u       ]
    [ u'               1/delta ]     the Schur complement over 1/delta is T,

an exact identity that keeps the number of negative eigenvalues. Growth stays bounded, and the small
border is factored with full pivoting. The inertia of K is that of the pivots plus that of the
border's Schur complement (Haynsworth).

Two bands (the arms of a gripped ring) are one T with a zero block between them; the condition that
joins them, the grip distance, is a border column. In a closed ring without grips one edge's frame
is held, which removes rigid rotations and cuts the cycle.

SciPy has banded Cholesky and LU, but no symmetric-indefinite band solver that tells the inertia.
"""

from typing import NamedTuple

import numpy as np

from der.kernels.dense import invert, invert_one, invert_three, solve_dense
from der.kernels.workspace import MAX_DELAYED, Array, blocks, rows
from der.packs.kernel import kernel

_DELAY_BELOW = 1e-4  # relative size below which a pivot is delayed: growth stays under its inverse
_NO_STIFFNESS = 1e-10  # of the row's largest entry: an unknown without stiffness of its own
_NOTHING = 1e-18  # of the largest entry: a row without stiffness at all


class Factors(NamedTuple):
    """Factors of K. ``border`` holds B and the columns of delayed pivots, M = m + delayed."""

    inverse: Array  # (n, b, b) inverses of the pivot blocks
    lower: Array  # (n, b, b) subdiagonal blocks of L; lower[0] is not used
    border: Array  # (n, b, M)
    lifted: Array  # (n, b, M) T^-1 border
    schur: Array  # (M, M) C - border' lifted
    magnitude: Array  # (M,) size of the terms that make the diagonal of schur
    negative: int  # negative pivots of T


@kernel
def _own_stiffness(diag, off, out_size):
    """Diagonal entries (n, b), in size, or what stands in for them; returns the largest entry.

    That is the largest entry of its row where an unknown has next to no stiffness of its own.
    """
    n, b = out_size.shape
    whole = 1e-300
    for j in range(n):
        for k in range(b):
            own = abs(diag[j, k, k])
            around = own  # stretch may be stiffer by far than bending
            for i in range(b):
                around = max(around, abs(diag[j, k, i]))
                if j < n - 1:
                    around = max(around, abs(off[j, k, i]))
                if j > 0:
                    around = max(around, abs(off[j - 1, i, k]))
            out_size[j, k] = own if own > _NO_STIFFNESS * around else around
            whole = max(whole, around)
    return whole


@kernel
def _reduce(b, j, diag, off, inverse, unit, out_lower, out_pivot):
    """The block of L before pivot ``j``, and this pivot (b, b) in the units of its unknowns."""
    for k in range(b):
        for i in range(b):
            out_pivot[k, i] = diag[j, k, i]
    if j > 0:
        for k in range(b):
            for i in range(b):
                s = 0.0
                for r in range(b):
                    s += off[j - 1, r, k] * inverse[j - 1, r, i]
                out_lower[j, k, i] = s
        for k in range(b):
            for i in range(k + 1):
                s = out_pivot[k, i]
                for r in range(b):
                    s -= out_lower[j, k, r] * off[j - 1, r, i]
                out_pivot[k, i] = s
                out_pivot[i, k] = s
    for k in range(b):
        for i in range(b):
            out_pivot[k, i] *= unit[k] * unit[i]


@kernel
def factor(diag, off, border, work):
    """Factor K in ``work``; returns the factors, and what is left of that.

    Parameters
    ----------
    diag : (n, b, b) diagonal blocks, symmetric. off : (n - 1 or more, b, b) blocks T[j, j+1].
    border : (n, b, m).

    Returns
    -------
    Factors, work : ``negative`` is -1 where too many pivots had to be delayed.
    """
    n, b, m = border.shape
    inverse, work = blocks(work, n, b, b)
    lower, work = blocks(work, n, b, b)
    where = np.empty((MAX_DELAYED, 2), dtype=np.int64)
    added = np.empty(MAX_DELAYED)
    delayed = np.zeros(b)
    pivot = np.empty((b, b))
    count = 0
    negative = 0
    size, work = rows(work, n, b)  # an unknown's own stiffness: pivots are judged by it
    whole = _own_stiffness(diag, off, size)
    unit = np.empty(b)  # its inverse square root
    for j in range(n):
        for k in range(b):
            unit[k] = 1.0 / np.sqrt(size[j, k] if size[j, k] > _NOTHING * whole else whole)
        if b == 3:  # a constant, so that loops are unrolled
            _reduce(3, j, diag, off, inverse, unit, lower, pivot)
            minus = invert_three(pivot, _DELAY_BELOW)
        elif b == 1:  # likewise: a rod in a plane
            _reduce(1, j, diag, off, inverse, unit, lower, pivot)
            minus = invert_one(pivot, _DELAY_BELOW)
        else:
            _reduce(b, j, diag, off, inverse, unit, lower, pivot)
            minus = -1
        if minus < 0:
            minus, _ = invert(pivot, _DELAY_BELOW, delayed)
        negative += minus
        for k in range(b):
            for i in range(b):
                inverse[j, k, i] = -pivot[k, i] * (unit[k] * unit[i])
            if delayed[k] != 0.0:
                if count < MAX_DELAYED:
                    where[count, 0], where[count, 1] = j, k
                    added[count] = delayed[k] / unit[k] ** 2
                count += 1
                delayed[k] = 0.0
    if count > MAX_DELAYED:
        count, negative = 0, -1

    M = m + count
    wide, work = blocks(work, n, b, M)
    lifted, work = blocks(work, n, b, M)
    for j in range(n):
        for k in range(b):
            for p in range(M):
                wide[j, k, p] = border[j, k, p] if p < m else 0.0
                lifted[j, k, p] = wide[j, k, p]
    for d in range(count):
        wide[where[d, 0], where[d, 1], m + d] = 1.0
        lifted[where[d, 0], where[d, 1], m + d] = 1.0
    solve_band(inverse, lower, lifted)
    schur = np.zeros((M, M))
    magnitude = np.zeros(M)
    for d in range(count):
        schur[m + d, m + d] = 1.0 / added[d]
        magnitude[m + d] = 1.0 / added[d]
    for j in range(n):
        for k in range(b):
            for p in range(M):
                if wide[j, k, p] != 0.0:
                    magnitude[p] += abs(wide[j, k, p] * lifted[j, k, p])
                    for q in range(p + 1):
                        schur[p, q] -= wide[j, k, p] * lifted[j, k, q]
    for p in range(M):
        for q in range(p):
            schur[q, p] = schur[p, q]
    return Factors(inverse, lower, wide, lifted, schur, magnitude, negative), work


@kernel
def solve_band(inverse, lower, x):
    """Replace ``x`` (n, b, r), r right-hand sides, by (T + delayed)^-1 x."""
    b = x.shape[1]
    if b == 3:  # a constant, so that loops are unrolled
        _sweep(3, inverse, lower, x)
    elif b == 1:
        _sweep(1, inverse, lower, x)
    else:
        _sweep(b, inverse, lower, x)


@kernel
def _sweep(b, inverse, lower, x):
    """`solve_band`, forward and back."""
    n, _, r = x.shape
    y = np.empty((b, r))
    for j in range(1, n):
        for c in range(r):
            for k in range(b):
                s = x[j, k, c]
                for i in range(b):
                    s -= lower[j, k, i] * x[j - 1, i, c]
                x[j, k, c] = s
    for j in range(n - 1, -1, -1):
        for c in range(r):
            for k in range(b):
                s = 0.0
                for i in range(b):
                    s += inverse[j, k, i] * x[j, i, c]
                if j < n - 1:
                    for i in range(b):
                        s -= lower[j + 1, i, k] * x[j + 1, i, c]
                y[k, c] = s
            for k in range(b):
                x[j, k, c] = y[k, c]


@kernel
def inertia(factors):
    """Number of negative eigenvalues of K, and how safe that is: smallest scaled border pivot.

    The count is -1 where `factor` gave up. A second value below about 1e-8 means that K is close to
    singular and the count may be off by one.
    """
    M = factors.schur.shape[0]
    if factors.negative < 0:
        return -1, 0.0
    if M == 0:
        return factors.negative, np.inf
    scaled = np.empty((M, M))
    for p in range(M):
        for q in range(M):
            size = np.sqrt(factors.magnitude[p] * factors.magnitude[q])
            scaled[p, q] = factors.schur[p, q] / size if size > 0.0 else 0.0
    minus, smallest = invert(scaled, 0.0, np.zeros(M))
    return factors.negative + minus, smallest


@kernel
def solve(factors, x):
    """Replace ``x`` (n, b, r) by K^-1 x, the border's own entries zero. False: K is singular."""
    n, b, r = x.shape
    M = factors.schur.shape[0]
    y = np.zeros((M, r))
    solve_band(factors.inverse, factors.lower, x)
    for j in range(n):
        for k in range(b):
            for p in range(M):
                for c in range(r):
                    y[p, c] -= factors.border[j, k, p] * x[j, k, c]
    if not solve_dense(factors.schur.copy(), y):
        return False
    for j in range(n):
        for k in range(b):
            for c in range(r):
                for p in range(M):
                    x[j, k, c] -= factors.lifted[j, k, p] * y[p, c]
    return True


@kernel
def solve_augmented(factors, m, column, column_border, row, row_border, corner, x, y, z, work):
    """Solve K with one more column and one more, unsymmetric, row, such as an arclength condition.

        [ T     B              column        ] [x]   [x]
        [ B'    0              column_border ] [y] = [y]     in place; r right-hand sides
        [ row'  row_border'    corner        ] [z]   [z]

    K itself may be singular, as it is at a fold.

    Parameters
    ----------
    factors : of K, whose own border has ``m`` columns.
    column, row : (n, b). column_border, row_border : (m,). corner : float.
    x, y, z : (n, b, r), (m, r), (r,), replaced by the solution.
    work : memory for n b (r + 1) numbers.

    Returns
    -------
    bool : False where the augmented matrix is singular to the last digit.
    """
    n, b, r = x.shape
    M = factors.schur.shape[0]
    Y, _ = blocks(work, n, b, r + 1)
    for j in range(n):
        for k in range(b):
            Y[j, k, 0] = column[j, k]
            for c in range(r):
                Y[j, k, c + 1] = x[j, k, c]
    solve_band(factors.inverse, factors.lower, Y)
    A = np.zeros((M + 1, M + 1))
    rhs = np.zeros((M + 1, r))
    for p in range(M):
        for q in range(M):
            A[p, q] = factors.schur[p, q]
    for p in range(m):
        A[p, M] = column_border[p]
        A[M, p] = row_border[p]
        for c in range(r):
            rhs[p, c] = y[p, c]
    A[M, M] = corner
    for c in range(r):
        rhs[M, c] = z[c]
    for j in range(n):
        for k in range(b):
            for p in range(M):
                w = factors.border[j, k, p]
                if w != 0.0:
                    A[p, M] -= w * Y[j, k, 0]
                    for c in range(r):
                        rhs[p, c] -= w * Y[j, k, c + 1]
            w = row[j, k]
            if w != 0.0:
                for p in range(M):
                    A[M, p] -= w * factors.lifted[j, k, p]
                A[M, M] -= w * Y[j, k, 0]
                for c in range(r):
                    rhs[M, c] -= w * Y[j, k, c + 1]
    if not solve_dense(A, rhs):
        return False
    for j in range(n):
        for k in range(b):
            for c in range(r):
                s = Y[j, k, c + 1] - Y[j, k, 0] * rhs[M, c]
                for p in range(M):
                    s -= factors.lifted[j, k, p] * rhs[p, c]
                x[j, k, c] = s
    for c in range(r):
        for p in range(m):
            y[p, c] = rhs[p, c]
        z[c] = rhs[M, c]
    return True


@kernel
def solve_refined(
    diag, off, factors, m, column, column_border, row, row_border, corner, x, y, z, work
):  # fmt: skip
    """`solve_augmented` with its residual checked, and refined once where that is not tiny.

    ``diag`` and ``off`` are the blocks that were factored; ``work`` has n b (3 r + 1) numbers.
    Returns False where the matrix is singular, or where refinement leaves a residual above 1e-6 of
    the right-hand side and of the terms that should cancel in it: the caller must not use such a
    solution.
    """
    n, b, r = x.shape
    rx, work = blocks(work, n, b, r)
    wanted_x, work = blocks(work, n, b, r)
    wanted_y, wanted_z = y.copy(), z.copy()
    ry, rz = y.copy(), z.copy()
    for j in range(n):
        for k in range(b):
            for c in range(r):
                rx[j, k, c] = x[j, k, c]
                wanted_x[j, k, c] = x[j, k, c]
    if not solve_augmented(
        factors, m, column, column_border, row, row_border, corner, x, y, z, work
    ):
        return False
    border = factors.border
    error = _subtract(
        diag, off, border, column, column_border, row, row_border, corner, x, y, z, rx, ry, rz
    )
    if error < 1e-12:
        return True
    if not solve_augmented(
        factors, m, column, column_border, row, row_border, corner, rx, ry, rz, work
    ):
        return False
    for c in range(r):
        for j in range(n):
            for k in range(b):
                x[j, k, c] += rx[j, k, c]
        for p in range(m):
            y[p, c] += ry[p, c]
        z[c] += rz[c]
    error = _subtract(
        diag, off, border, column, column_border, row, row_border, corner, x, y, z,
        wanted_x, wanted_y, wanted_z,
    )  # fmt: skip
    return error < 1e-6


@kernel
def _subtract(
    diag, off, border, column, column_border, row, row_border, corner, x, y, z, out_x, out_y, out_z
):
    """Subtract the augmented matrix times (x, y, z) from ``out``.

    Returns the largest entry left over the largest term that went into it.
    """
    n, b, r = x.shape
    m = y.shape[0]
    size, left = 1e-300, 0.0
    for c in range(r):
        sums = np.zeros(m)
        last = corner * z[c]
        for p in range(m):
            sums[p] = column_border[p] * z[c]
            last += row_border[p] * y[p, c]
        for j in range(n):
            for k in range(b):
                s = column[j, k] * z[c]
                size = max(size, abs(s), abs(out_x[j, k, c]))
                for i in range(b):
                    term = diag[j, k, i] * x[j, i, c]
                    s += term
                    size = max(size, abs(term))
                    if j + 1 < n:
                        s += off[j, k, i] * x[j + 1, i, c]
                    if j > 0:
                        s += off[j - 1, i, k] * x[j - 1, i, c]
                for p in range(m):
                    s += border[j, k, p] * y[p, c]
                    sums[p] += border[j, k, p] * x[j, k, c]
                last += row[j, k] * x[j, k, c]
                out_x[j, k, c] -= s
                left = max(left, abs(out_x[j, k, c]))
        for p in range(m):
            size = max(size, abs(out_y[p, c]))
            out_y[p, c] -= sums[p]
            left = max(left, abs(out_y[p, c]))
        size = max(size, abs(out_z[c]))
        out_z[c] -= last
        left = max(left, abs(out_z[c]))
    return left / size
