"""Forces on a rod in motion: the gradient of its energy, and the conditions on its positions.

The half of `assembly` that dynamic relaxation needs, without Hessians.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.kernels.assembly import position_rows
from der.kernels.quaternions import Array, into_frame, relative
from der.kernels.strain import vertex_energy
from der.packs.kernel import kernel

_BENT_TOO_FAR = 0.0301537  # cos(80 deg)^2, as in assembly.py


class Motion(NamedTuple):
    """Configuration and velocity of a moving rod; kernels write to it."""

    quat: Array  # (n, 4)
    stretch: Array  # (n,)
    load: Array  # (1,)
    velocity: Array  # (n, b) in the frames, per step
    rate: Array  # (1,) of the load, per step
    last: Array  # (n, b) velocity of the step before
    last_rate: Array  # (1,)


class Pull(NamedTuple):
    """Generalised forces on a rod in motion; kernels write to it."""

    grad: Array  # (n, b) of the energy, on held edges too
    load_grad: Array  # (1,) likewise along the load
    gap: Array  # (m,) position conditions
    border: Array  # (n, b, m) their derivatives B
    load_border: Array  # (m,) likewise along the load
    lever: Array  # (n, b, m) M^-1 B
    metric: Array  # (m, m) Cholesky factor of B' M^-1 B
    force: Array  # (m,) multipliers of the conditions
    work: Array  # (1,) of the dead load


@kernel
def vertex_gradient(p, measure, rest, stiffness, out_kappa, out_g, out_H):
    """Elastic energy of one vertex and its gradient, as `strain.vertex_energy` without Hessian.

    ``p`` (4,) has unit length; ``out_H`` (3, 3) is scratch for the measures that have no gradient
    of their own. With W = log p and m the moments, g = m - W x m/2 + c W x (W x m), the transposed
    inverse Jacobian of the rotation vector; c = (1 - x cot x)/|W|^2, x = |W|/2.
    """
    if measure != 0:
        return vertex_energy(p, measure, rest, stiffness, out_kappa, out_g, out_H)
    sine = np.sqrt(p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
    half = np.arctan2(sine, p[0])
    scale = 2.0 * half / sine if sine > 0.0 else 2.0
    t = 4.0 * half * half
    # cot x = p0/sine; by its series where 1 - x cot x loses digits
    c = (1.0 - half * p[0] / sine) / t if t > 1e-4 else 1.0 / 12.0 + t / 720.0
    energy = 0.0
    for i in range(3):
        out_kappa[i] = scale * p[i + 1]
        out_g[i] = stiffness[i] * (out_kappa[i] - rest[i])
        energy += 0.5 * out_g[i] * (out_kappa[i] - rest[i])
    x, y, z = out_kappa[0], out_kappa[1], out_kappa[2]
    m0, m1, m2 = out_g[0], out_g[1], out_g[2]
    mW = m0 * x + m1 * y + m2 * z
    d = 1.0 - c * t
    out_g[0] = d * m0 - 0.5 * (y * m2 - z * m1) + c * mW * x
    out_g[1] = d * m1 - 0.5 * (z * m0 - x * m2) + c * mW * y
    out_g[2] = d * m2 - 0.5 * (x * m1 - y * m0) + c * mW * z
    return energy


@kernel
def gradient(rod, held, motion, out_pull):
    """Elastic energy, first vertex bent too far (or -1); forces and conditions to ``out_pull``.

    The gradient is that of the energy less the work of the dead load; the forces of the position
    conditions are not in it.
    """
    n = out_pull.grad.shape[0]
    energy, bent_too_far = 0.0, -1
    clear(out_pull.grad)
    p, back = np.empty(4), np.empty(4)
    kappa, stiffness, g, turned_g = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    H = np.empty((3, 3))
    for s in range(rod.cell.shape[0]):
        c = s + 1 if s + 1 < n else 0
        relative(motion.quat[s], motion.quat[c], p)
        sign = 1.0 if p[0] >= 0.0 else -1.0
        for i in range(4):
            p[i] *= sign
            back[i] = p[i] if i == 0 else -p[i]
        cosine = p[0] * p[0] + p[3] * p[3]
        if bent_too_far < 0 and (cosine < _BENT_TOO_FAR or p[0] * p[0] < _BENT_TOO_FAR * cosine):
            bent_too_far = s
        for i in range(3):
            stiffness[i] = rod.stiffness[i] / rod.cell[s]
        energy += vertex_gradient(p, rod.measure, rod.rest[s], stiffness, kappa, g, H)
        into_frame(back, g, turned_g)
        for i in range(3):
            out_pull.grad[c, i] += g[i]
            out_pull.grad[s, i] -= turned_g[i]
    conditions(rod, held, motion, out_pull)
    energy += _edge_forces(rod, held, motion, out_pull)
    return energy, bent_too_far


@kernel
def conditions(rod, held, motion, out_pull):
    """Gaps of the position conditions and their derivatives, along the load too."""
    m = out_pull.gap.shape[0]
    for k in range(m):
        out_pull.gap[k] = -held.target[k]
        out_pull.load_border[k] = 0.0
    position_rows(
        rod, held, held.weight, held.axis, motion.quat, motion.stretch, motion.load[0],
        out_pull.gap, out_pull.border,
    )  # fmt: skip
    v = np.empty(3)
    for j in range(rod.length.shape[0]):
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, v)
            for k in range(m):
                for i in range(3):
                    out_pull.load_border[k] += held.turn[j] * v[i] * out_pull.border[j, i, k]
        if held.reach[j] != 0.0:
            for k in range(m):
                into_frame(motion.quat[j], held.axis[k], v)
                out_pull.load_border[k] += held.weight[k, j] * held.reach[j] * v[2]


@kernel
def _edge_forces(rod, held, motion, out_pull):
    """Energy of stretching; its forces and those of the dead load, and the force on the load."""
    n, b = out_pull.grad.shape
    grad, load, energy = out_pull.grad, motion.load[0], 0.0
    out_pull.load_grad[0], out_pull.work[0] = 0.0, 0.0
    f, v = np.empty(3), np.empty(3)
    for j in range(n):
        eps = motion.stretch[j]
        now = rod.length[j] * (1.0 + eps) + load * held.reach[j]
        into_frame(motion.quat[j], held.pull[j], f)
        grad[j, 0] += load * now * f[1]
        grad[j, 1] -= load * now * f[0]
        if b == 4:
            grad[j, 3] += rod.length[j] * (rod.stretching * eps - load * f[2])
            energy += 0.5 * rod.stretching * rod.length[j] * eps * eps
        out_pull.load_grad[0] -= (now + load * held.reach[j]) * f[2]
        out_pull.work[0] += load * now * f[2]
        if held.turn[j] != 0.0:
            into_frame(motion.quat[j], held.turn_axis, v)
            for i in range(3):
                out_pull.load_grad[0] += held.turn[j] * v[i] * grad[j, i]
    return energy


@kernel
def clear(out_rows):
    """Zero everywhere."""
    n, b = out_rows.shape
    for j in range(n):
        for i in range(b):
            out_rows[j, i] = 0.0
