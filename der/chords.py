"""What leads from one state to a neighbour, and on beyond: the arithmetic of `step`, in kernels.

A path takes some thirty steps, of a few dozen edges: in numpy, calls would cost more than work.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from der.frames import chart_rate, rotation_vector


@njit(cache=True)
def chord(free, quat, stretch, next_quat, next_stretch):
    """Rotation vectors, and stretch, (n, b) that lead from one state to the next."""
    n, b = free.shape
    jump = np.zeros((n, b))
    turn = rotation_vector(quat, next_quat)
    for j in range(n):
        for i in range(b):
            if free[j, i]:
                jump[j, i] = turn[j, i] if i < 3 else next_stretch[j] - stretch[j]
    return jump


@njit(cache=True)
def _in_frames(jump, rates):
    """Rates (n, b) of a chord whose end moves at ``rates``, in the frames of its start."""
    own = rates.copy()
    turn = chart_rate(jump, rates)
    for j in range(own.shape[0]):
        for i in range(3):
            own[j, i] = turn[j, i]
    return own


@njit(cache=True)
def _product(mass, a, b):
    """Mass-weighted inner product of two (n, b)."""
    total = 0.0
    for j in range(a.shape[0]):
        for i in range(a.shape[1]):
            total += mass[j, 0] * a[j, i] * b[j, i]
    return total


@njit(cache=True)
def end_rates(mass, jump, rates, load_rate, next_rates, next_load_rate):
    """Rates (n, b) at the end of a chord per length along the tangent at its start, and a factor.

    The factor does the same to those of load and forces. All in the frames of the start.
    """
    own = _in_frames(jump, next_rates)
    factor = 1.0 / (_product(mass, rates, own) + load_rate * next_load_rate)
    return own * factor, factor


@njit(cache=True)
def onward(mass, s, jump, jump_load, rates, load_rate, next_rates, next_load_rate):
    """Increment (n, b) from the end of a chord to ``s`` beyond, by the cubic through both ends.

    Returns the weights of the rates at the end, those at the start and the chord, too. All in the
    frames of the end.
    """
    first = _in_frames(-jump, rates)
    u = s / (_product(mass, next_rates, jump) + next_load_rate * jump_load)
    along = _product(mass, next_rates, first) + next_load_rate * load_rate
    of_start = s * u * (1.0 + u) / along
    of_end, of_jump = s * (1.0 + u) ** 2, -u * u * (3.0 + 2.0 * u)
    increment = of_end * next_rates + of_start * first + of_jump * jump
    return increment, of_end, of_start, of_jump
