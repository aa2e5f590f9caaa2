"""Fictitious masses: the lightest with which a rod moves stably in unit time steps.

They are half of the stiffnesses of the vertices on both sides of an edge, times a margin. Because
(a - b)'K(a - b) <= 2 (a'Ka + b'Kb), no frequency is larger than that of the unit step, 2. The
motion is projected onto the conditions in the metric of these masses.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.kernels.forces import clear
from der.kernels.quaternions import Array, into_frame, relative
from der.packs.kernel import kernel


class Masses(NamedTuple):
    """Fictitious masses; kernels write to it."""

    block: Array  # (n, b, b) each edge's own
    inverse: Array  # (n, b, b) their inverses, 0 for what is held
    of_load: Array  # (1,) inverse mass of the load, 0 where it is given


@kernel
def weigh(rod, held, motion, heaviness, frees_load, out_masses):
    """Inverse masses for the present configuration: ``heaviness`` times the vertex stiffnesses."""
    n, b = held.free.shape
    mass = out_masses.block
    for j in range(n):
        clear(mass[j])
    first, second = np.empty((3, 3)), np.empty((3, 3))
    p, v, stiffness = np.empty(4), np.empty(3), np.empty(3)
    for s in range(rod.cell.shape[0]):
        c = s + 1 if s + 1 < n else 0
        relative(motion.quat[s], motion.quat[c], p)
        sign = 1.0 if p[0] >= 0.0 else -1.0
        for i in range(4):
            p[i] *= sign
        for i in range(3):
            stiffness[i] = heaviness * rod.stiffness[i] / rod.cell[s]
        _vertex_masses(p, stiffness, first, second)
        for i in range(3):
            for j in range(3):
                mass[s, i, j] += first[i, j]
                mass[c, i, j] += second[i, j]
    of_load = 0.0
    for j in range(n):
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, v)
            for i in range(3):
                for k in range(3):
                    of_load += held.turn[j] ** 2 * v[i] * mass[j, i, k] * v[k]
        _invert(mass[j], held.free[j], out_masses.inverse[j])
        if b == 4:
            mass[j, 3, 3] = heaviness * rod.stretching * rod.length[j]
            out_masses.inverse[j, 3, 3] = 1.0 / mass[j, 3, 3] if held.free[j, 3] else 0.0
    out_masses.of_load[0] = 1.0 / of_load if frees_load and of_load > 0.0 else 0.0


@kernel
def _vertex_masses(p, stiffness, out_first, out_second):
    """Stiffness (3,) of a vertex, in the frame half way, seen in its two edges' frames (3, 3)."""
    half = np.empty(4)
    scale = 1.0 / np.sqrt(2.0 + 2.0 * p[0])
    for i in range(4):
        half[i] = scale * (p[i] + (1.0 if i == 0 else 0.0))
    R = np.empty((3, 3))
    unit = np.eye(3)
    for k in range(3):
        into_frame(half, unit[k], R[k])
    for i in range(3):
        for j in range(3):
            out_first[i, j] = 0.0
            out_second[i, j] = 0.0
            for k in range(3):
                out_first[i, j] += stiffness[k] * R[i, k] * R[j, k]
                out_second[i, j] += stiffness[k] * R[k, i] * R[k, j]


@kernel
def _invert(mass, free, out_inverse):
    """Inverse of ``mass`` (3, 3) on the entries that are free; the rest 0."""
    a = mass.copy()
    for i in range(3):
        if not free[i]:
            for j in range(3):
                a[i, j] = 0.0
                a[j, i] = 0.0
            a[i, i] = 1.0
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            out_inverse[i, j] = a[j1, i1] * a[j2, i2] - a[j1, i2] * a[j2, i1]
    scale = 1.0 / (
        a[0, 0] * out_inverse[0, 0] + a[0, 1] * out_inverse[1, 0] + a[0, 2] * out_inverse[2, 0]
    )
    for i in range(3):
        for j in range(3):
            out_inverse[i, j] *= scale if free[i] and free[j] else 0.0


@kernel
def condition_metric(masses, pull):
    """Fill ``lever`` = M^-1 B and ``metric``, the Cholesky factor of B' M^-1 B."""
    n, b, m = pull.border.shape
    metric, lever = pull.metric, pull.lever
    for k in range(m):
        for i in range(k + 1):
            metric[k, i] = masses.of_load[0] * pull.load_border[k] * pull.load_border[i]
    for j in range(n):
        for k in range(m):
            for i in range(b):
                lever[j, i, k] = 0.0
                for r in range(b):
                    lever[j, i, k] += masses.inverse[j, i, r] * pull.border[j, r, k]
            for i in range(k + 1):
                for r in range(b):
                    metric[k, i] += lever[j, r, k] * pull.border[j, r, i]
    for k in range(m):
        for i in range(k + 1):
            for r in range(i):
                metric[k, i] -= metric[k, r] * metric[i, r]
            metric[k, i] = np.sqrt(metric[k, i]) if i == k else metric[k, i] / metric[i, i]


@kernel
def solve_metric(metric, y):
    """Solve, in place, for the multipliers ``y`` (m,) with the factor of `condition_metric`."""
    m = y.shape[0]
    for k in range(m):
        for i in range(k):
            y[k] -= metric[k, i] * y[i]
        y[k] /= metric[k, k]
    for k in range(m - 1, -1, -1):
        for i in range(k + 1, m):
            y[k] -= metric[i, k] * y[i]
        y[k] /= metric[k, k]
