"""Energy, gradient and Hessian of a supported rod, summed over its vertices and edges: O(n).

The Lagrangian is

    L = sum_s W_s(conj(q_s) o q_{s+1}) + sum_j EA l_j eps_j^2/2
        + sum_k F_k (sum_j weight_kj e_j . axis_k - target_k) - load sum_j pull_j . e_j

with e_j = (l_j (1 + eps_j) + load reach_j) d3_j. Along q o exp(w/2) the tangent moves as

    d3 + (w2 d1 - w1 d2) + [w1 w3 d1 + w2 w3 d2 - (w1^2 + w2^2) d3]/2 + O(w^3),

which gives the geometric stiffness of the forces edge by edge. For a vertex, W depends on the
relative rotation p alone, so turning the first edge by w is turning the second by -R' w with
R = rotation(p). With g and H the gradient and Hessian in the second edge's frame this leaves

    g_a = -R g,   H_aa = R H R',   H_ab = -R (H + [e_j x g]/2),

and one 3 x 3 Hessian serves all four blocks.
"""

from typing import Any, NamedTuple

import numpy as np

from der.kernels.quaternions import Array, into_frame, relative
from der.kernels.strain import vertex_energy
from der.kernels.workspace import blocks, rows
from der.packs.kernel import kernel

_BENT_TOO_FAR = 0.0301537  # cos(80 deg)^2: half-angle limit, turning or twist beyond 160 degrees


class System(NamedTuple):
    """Derivatives of the Lagrangian at a state; unknowns that are held are *not* yet taken out.

    Kernels write to it.
    """

    grad: Array  # (n, b) dL/dq
    diag: Array  # (n, b, b) Hessian blocks
    off: Array  # (n, b, b) blocks (s, s+1); the closing one of a ring stands last
    gap: Array  # (n_c,) position conditions, 0 where they are met
    border: Array  # (n, b, n_c) their derivatives
    load_column: Array  # (n, b) d2L/dq dload
    load_border: Array  # (n_c,) d gap/dload


@kernel
def system_of(work, n, b, n_c):
    """A `System` in ``work``, and what is left of that."""
    grad, work = rows(work, n, b)
    diag, work = blocks(work, n, b, b)
    off, work = blocks(work, n, b, b)
    border, work = blocks(work, n, b, n_c)
    column, work = rows(work, n, b)
    return System(grad, diag, off, np.empty(n_c), border, column, np.empty(n_c)), work


@kernel
def position_rows(rod, held, weight, axis, quat, stretch, load, out_sum, out_border):
    """Weighted sums of the edge vectors along axes, added to ``out_sum``, and their derivatives.

    Parameters
    ----------
    weight : (n_c or more, n). axis : (n_c or more, 3). quat : (n, 4). stretch : (n,).
    out_sum : (n_c,). out_border : (n, b, n_c).
    """
    n, b, n_c = out_border.shape
    d = np.empty(3)
    for j in range(n):
        now = rod.length[j] * (1.0 + stretch[j]) + load * held.reach[j]
        for k in range(n_c):
            w = weight[k, j]
            for i in range(b):
                out_border[j, i, k] = 0.0
            if w == 0.0:
                continue
            into_frame(quat[j], axis[k], d)
            out_sum[k] += w * now * d[2]
            out_border[j, 0, k] = -w * now * d[1]
            out_border[j, 1, k] = w * now * d[0]
            if b == 4:
                out_border[j, 3, k] = w * rod.length[j] * d[2]


@kernel
def assemble(rod, held, quat, stretch, force, load, out):
    """Derivatives of the Lagrangian; see `System` (``out``), `rod.Rod`, `supports.Supports`.

    Returns
    -------
    tuple : elastic energy; dL/dload, the generalised force that does work on the load; d2L/dload2;
        rounding error of an entry of the gradient, estimated; first vertex that turns or twists by
        more than 160 degrees, or -1.
    """
    n, b = held.free.shape
    n_s = rod.cell.shape[0]
    n_c = held.target.shape[0]
    grad, diag, off, column = out.grad, out.diag, out.off, out.load_column
    border, load_border = out.border, out.load_border
    for j in range(n):
        for i in range(b):
            grad[j, i] = 0.0
            column[j, i] = 0.0
            for k in range(b):
                diag[j, i, k] = 0.0
                off[j, i, k] = 0.0
    for k in range(n_c):
        out.gap[k] = -held.target[k]
        load_border[k] = 0.0
    position_rows(rod, held, held.weight, held.axis, quat, stretch, load, out.gap, border)
    load_grad, load_hess, energy, noise = 0.0, 0.0, 0.0, 0.0
    bent_too_far = -1

    p = np.empty(4)
    kappa = np.empty(3)
    stiffness = np.empty(3)
    g = np.empty(3)
    H = np.empty((3, 3))
    RH = np.empty((3, 3))
    va = np.zeros(3)
    vb = np.zeros(3)
    R = np.empty((3, 3))
    for s in range(n_s):
        a = s
        c = s + 1 if s + 1 < n else 0
        relative(quat[a], quat[c], p)
        if p[0] < 0.0:
            for i in range(4):
                p[i] = -p[i]
        cosine = p[0] * p[0] + p[3] * p[3]
        if bent_too_far < 0 and (cosine < _BENT_TOO_FAR or p[0] * p[0] < _BENT_TOO_FAR * cosine):
            bent_too_far = s
        for i in range(3):
            stiffness[i] = rod.stiffness[i] / rod.cell[s]
            noise = max(noise, 1e-15 * stiffness[i])  # a strain is good to a few 1e-16
        energy += vertex_energy(p, rod.measure, rod.rest[s], stiffness, kappa, g, H)
        _relative_rotation(p, R)
        for i in range(3):
            grad[c, i] += g[i]
            grad[a, i] -= R[i, 0] * g[0] + R[i, 1] * g[1] + R[i, 2] * g[2]
            for j in range(3):
                diag[c, i, j] += H[i, j]
                RH[i, j] = R[i, 0] * H[0, j] + R[i, 1] * H[1, j] + R[i, 2] * H[2, j]
        for i in range(3):
            for j in range(i + 1):
                h = RH[i, 0] * R[j, 0] + RH[i, 1] * R[j, 1] + RH[i, 2] * R[j, 2]
                diag[a, i, j] += h
                if j < i:
                    diag[a, j, i] += h
            # columns of [e_j x g]: (0, -g3, g2), (g3, 0, -g1), (-g2, g1, 0)
            off[s, i, 0] = -RH[i, 0] - 0.5 * (R[i, 2] * g[1] - R[i, 1] * g[2])
            off[s, i, 1] = -RH[i, 1] - 0.5 * (R[i, 0] * g[2] - R[i, 2] * g[0])
            off[s, i, 2] = -RH[i, 2] - 0.5 * (R[i, 1] * g[0] - R[i, 0] * g[1])
        if held.turn[a] != 0.0 or held.turn[c] != 0.0:
            into_frame(quat[a], held.turn_axis, va)
            into_frame(quat[c], held.turn_axis, vb)
            for i in range(3):
                va[i] *= held.turn[a]
                vb[i] *= held.turn[c]
            for i in range(3):
                of_a, of_c = 0.0, 0.0
                for j in range(3):
                    aa = RH[i, 0] * R[j, 0] + RH[i, 1] * R[j, 1] + RH[i, 2] * R[j, 2]
                    of_a += aa * va[j] + off[s, i, j] * vb[j]
                    of_c += off[s, j, i] * va[j] + H[i, j] * vb[j]
                column[a, i] += of_a
                column[c, i] += of_c
                load_hess += va[i] * of_a + vb[i] * of_c
                load_grad += vb[i] * g[i]
                load_grad -= va[i] * (R[i, 0] * g[0] + R[i, 1] * g[1] + R[i, 2] * g[2])

    total = np.empty(3)
    f = np.empty(3)
    pull = np.empty(3)
    for j in range(n):
        eps = stretch[j]
        now = rod.length[j] * (1.0 + eps) + load * held.reach[j]
        into_frame(quat[j], held.turn_axis, va)
        for i in range(3):
            va[i] *= held.turn[j]
            total[i] = -load * held.pull[j, i]
        for k in range(n_c):
            for i in range(3):
                total[i] += force[k] * held.weight[k, j] * held.axis[k, i]
        into_frame(quat[j], total, f)
        into_frame(quat[j], held.pull[j], pull)
        for k in range(n_c):
            load_border[k] += border[j, 0, k] * va[0] + border[j, 1, k] * va[1]
        grad[j, 0] -= now * f[1]
        grad[j, 1] += now * f[0]
        diag[j, 0, 0] -= now * f[2]
        diag[j, 1, 1] -= now * f[2]
        diag[j, 0, 2] += 0.5 * now * f[0]
        diag[j, 2, 0] += 0.5 * now * f[0]
        diag[j, 1, 2] += 0.5 * now * f[1]
        diag[j, 2, 1] += 0.5 * now * f[1]
        column[j, 0] += now * pull[1]
        column[j, 1] -= now * pull[0]
        load_grad -= now * pull[2]
        if b == 4:
            grad[j, 3] += rod.length[j] * (rod.stretching * eps + f[2])
            diag[j, 3, 3] += rod.stretching * rod.length[j]
            diag[j, 0, 3] -= rod.length[j] * f[1]
            diag[j, 3, 0] -= rod.length[j] * f[1]
            diag[j, 1, 3] += rod.length[j] * f[0]
            diag[j, 3, 1] += rod.length[j] * f[0]
            column[j, 3] -= rod.length[j] * pull[2]
            energy += 0.5 * rod.stretching * rod.length[j] * eps * eps
        if held.turn[j] != 0.0:
            load_grad += now * (va[1] * f[0] - va[0] * f[1])
            load_hess += now * (
                (va[0] * f[0] + va[1] * f[1]) * va[2] - (va[0] ** 2 + va[1] ** 2) * f[2]
            )
            load_hess += 2.0 * now * (va[0] * pull[1] - va[1] * pull[0])
        if held.reach[j] != 0.0:
            reach = held.reach[j]
            load_grad += reach * f[2]
            load_hess -= 2.0 * reach * pull[2]
            column[j, 0] -= reach * f[1]
            column[j, 1] += reach * f[0]
            for k in range(n_c):
                into_frame(quat[j], held.axis[k], va)
                load_border[k] += held.weight[k, j] * reach * va[2]
    return energy, load_grad, load_hess, noise, bent_too_far


def derivatives(
    rod: Any, held: Any, quat: Array, stretch: Array, force: Array, load: float
) -> tuple[System, tuple[float, float, float, float, int]]:
    """Return the `System` of a state in arrays of its own, and the numbers from `assemble`."""
    (n, b), n_c = held.free.shape, len(held.target)
    sizes = ((n, b), (n, b, b), (n, b, b), n_c, (n, b, n_c), (n, b), n_c)
    found = System(*(np.empty(size) for size in sizes))
    return found, assemble(rod, held, quat, stretch, force, load, found)


@kernel
def _relative_rotation(p, out_R):
    """Rotation matrix of ``p`` (4,), of any norm."""
    q0, q1, q2, q3 = p[0], p[1], p[2], p[3]
    scale = 1.0 / (q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    out_R[0, 0] = (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3) * scale
    out_R[0, 1] = 2.0 * (q1 * q2 - q0 * q3) * scale
    out_R[0, 2] = 2.0 * (q1 * q3 + q0 * q2) * scale
    out_R[1, 0] = 2.0 * (q1 * q2 + q0 * q3) * scale
    out_R[1, 1] = (q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3) * scale
    out_R[1, 2] = 2.0 * (q2 * q3 - q0 * q1) * scale
    out_R[2, 0] = 2.0 * (q1 * q3 - q0 * q2) * scale
    out_R[2, 1] = 2.0 * (q2 * q3 + q0 * q1) * scale
    out_R[2, 2] = (q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3) * scale


@kernel
def hold(free, out_diag, out_off, out_border):
    """Take the unknowns that are not ``free`` (n, b) out of Hessian blocks and border.

    A held unknown's row and column are those of the identity: it stays put and counts as positive.
    """
    n, b = free.shape
    for j in range(n):
        for i in range(b):
            if free[j, i]:
                continue
            for k in range(b):
                out_diag[j, i, k] = 0.0
                out_diag[j, k, i] = 0.0
                out_off[j, i, k] = 0.0
                if j > 0:
                    out_off[j - 1, k, i] = 0.0
            out_diag[j, i, i] = 1.0
            for k in range(out_border.shape[2]):
                out_border[j, i, k] = 0.0
