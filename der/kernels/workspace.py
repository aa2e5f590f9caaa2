"""Memory that kernels share out among their arrays, and use again in the next call.

The pages of large arrays that are new in each call would cost as much as the arithmetic.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from der.packs.kernel import kernel

Array = NDArray[np.float64]

MAX_DELAYED = 8  # pivots of a factorisation, at most


def workspace(n: int, b: int, m: int, r: int = 2) -> Array:
    """Return memory for a matrix of ``n`` blocks (b, b), its factors and ``r`` right-hand sides.

    ``m``: columns of the border, at most. The matrix may be there twice, as that of a state and as
    that of a symmetry class.
    """
    matrix = 2 * b + m
    factors = 2 * b + 1 + 2 * (m + MAX_DELAYED)
    vectors = 4 + 3 * r + 1  # gradient, column and rows; solutions, residuals and one column more
    return np.empty(n * b * (2 * matrix + factors + vectors))


@kernel
def rows(work, n, b):
    """Take an array (n, b) from ``work``; returns it, and what is left."""
    size = n * b
    return work[:size].reshape((n, b)), work[size:]


@kernel
def blocks(work, n, b, m):
    """Take an array (n, b, m) from ``work``; returns it, and what is left."""
    size = n * b * m
    return work[:size].reshape((n, b, m)), work[size:]
