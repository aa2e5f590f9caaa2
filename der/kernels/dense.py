"""Small dense matrices inside kernels: the pivot blocks and the border of `block_ldl`.

They have few rows: a call of LAPACK would take longer than the arithmetic.
"""

import numpy as np

from der.packs.kernel import kernel

_BUNCH_PARLETT = 0.6403882032022076  # (1 + sqrt 17)/8, Bunch & Parlett 1971


@kernel
def invert(A, delay_below, out_delayed):
    """Replace the symmetric ``A`` (m, m) by -A^-1, by sweeps with complete pivoting.

    Pivots are single entries or pairs (Bunch & Parlett), so ``A`` may be indefinite. If all
    remaining entries are below ``delay_below``, 1 is added to the largest remaining diagonal entry
    k, and noted in ``out_delayed[k]``; with ``delay_below`` = 0 nothing is added.

    Returns (number of negative pivots, smallest |pivot|); a zero pivot ends with (count, 0).
    """
    m = A.shape[0]
    swept = np.zeros(m, dtype=np.bool_)
    left = m
    negative = 0
    smallest = np.inf
    while left > 0:
        on, off, k, i2, j2 = -1.0, -1.0, 0, 0, 0
        for i in range(m):
            if swept[i]:
                continue
            if abs(A[i, i]) > on:
                on, k = abs(A[i, i]), i
            for j in range(i):
                if not swept[j] and abs(A[i, j]) > off:
                    off, i2, j2 = abs(A[i, j]), i, j
        if max(on, off) <= delay_below:
            if delay_below == 0.0:
                return negative, 0.0
            out_delayed[k] = 1.0
            A[k, k] += 1.0
            on, off = abs(A[k, k]), 0.0
        if on >= _BUNCH_PARLETT * off:
            d = A[k, k]
            negative += d < 0.0
            smallest = min(smallest, abs(d))
            for i in range(m):
                if i != k:
                    ratio = A[i, k] / d
                    for j in range(i + 1):
                        if j != k:
                            A[i, j] -= ratio * A[j, k]
                            A[j, i] = A[i, j]
            for i in range(m):
                if i != k:
                    A[i, k] /= d
                    A[k, i] = A[i, k]
            A[k, k] = -1.0 / d
            swept[k] = True
            left -= 1
        else:
            a, c, d = A[i2, i2], A[i2, j2], A[j2, j2]
            det = a * d - c * c  # negative, by the choice of the pair
            negative += 1
            smallest = min(smallest, np.sqrt(-det))
            for i in range(m):
                if i != i2 and i != j2:
                    x = (d * A[i, i2] - c * A[i, j2]) / det
                    y = (a * A[i, j2] - c * A[i, i2]) / det
                    for j in range(i + 1):
                        if j != i2 and j != j2:
                            A[i, j] -= x * A[j, i2] + y * A[j, j2]
                            A[j, i] = A[i, j]
            for i in range(m):
                if i != i2 and i != j2:
                    x = (d * A[i, i2] - c * A[i, j2]) / det
                    y = (a * A[i, j2] - c * A[i, i2]) / det
                    A[i, i2] = x
                    A[i2, i] = x
                    A[i, j2] = y
                    A[j2, i] = y
            A[i2, i2], A[j2, j2] = -d / det, -a / det
            A[i2, j2] = c / det
            A[j2, i2] = A[i2, j2]
            swept[i2] = True
            swept[j2] = True
            left -= 2
    return negative, smallest


@kernel
def invert_one(A, smallest):
    """`invert` of a single entry (1, 1) above ``smallest``; else -1, with ``A`` as it was."""
    a = A[0, 0]
    if not abs(a) > smallest:
        return -1
    A[0, 0] = -1.0 / a
    return int(a < 0.0)


@kernel
def invert_three(A, smallest):
    """`invert` of a matrix (3, 3) by formula, with its pivots in order, where they allow that.

    Each pivot must be above ``smallest`` and, as by Bunch & Kaufman, no smaller against its column
    than `invert` would take it, which bounds the growth alike.

    Returns the number of negative pivots, or -1 with ``A`` as it was.
    """
    a, b, c = A[0, 0], A[1, 0], A[2, 0]
    if not (abs(a) > smallest and abs(a) >= _BUNCH_PARLETT * max(abs(b), abs(c))):
        return -1
    i0 = 1.0 / a
    l10, l20 = b * i0, c * i0
    d, e = A[1, 1] - l10 * b, A[2, 1] - l20 * b
    if not (abs(d) > smallest and abs(d) >= _BUNCH_PARLETT * abs(e)):
        return -1
    i1 = 1.0 / d
    l21 = e * i1
    f = A[2, 2] - l20 * c - l21 * e
    if not abs(f) > smallest:
        return -1
    i2 = 1.0 / f
    m20 = l10 * l21 - l20  # of L^-1
    A[0, 0] = -i0 - l10 * l10 * i1 - m20 * m20 * i2
    A[1, 0] = l10 * i1 + l21 * m20 * i2
    A[1, 1] = -i1 - l21 * l21 * i2
    A[2, 0] = -m20 * i2
    A[2, 1] = l21 * i2
    A[2, 2] = -i2
    A[0, 1], A[0, 2], A[1, 2] = A[1, 0], A[2, 0], A[2, 1]
    return int(a < 0.0) + int(d < 0.0) + int(f < 0.0)


@kernel
def solve_dense(A, x):
    """Replace ``x`` (m, r) by A^-1 x; Gaussian elimination with partial pivoting, destroys A.

    Returns False, with ``x`` undefined, where a pivot is exactly zero.
    """
    m, r = x.shape
    for k in range(m):
        p = k
        for i in range(k + 1, m):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        if A[p, k] == 0.0:
            return False
        if p != k:
            for j in range(m):
                A[k, j], A[p, j] = A[p, j], A[k, j]
            for c in range(r):
                x[k, c], x[p, c] = x[p, c], x[k, c]
        for i in range(k + 1, m):
            ratio = A[i, k] / A[k, k]
            for j in range(k + 1, m):
                A[i, j] -= ratio * A[k, j]
            for c in range(r):
                x[i, c] -= ratio * x[k, c]
    for k in range(m - 1, -1, -1):
        for c in range(r):
            for j in range(k + 1, m):
                x[k, c] -= A[k, j] * x[j, c]
            x[k, c] /= A[k, k]
    return True
