"""Small operators on material frames, kept as unit quaternions.

A frame (d1, d2, d3) is the rotation that carries the global basis (E1, E2, E3) to it; d3 is the
tangent. With q = (q0, q1, q2, q3) the columns of ``rotation(q)`` are d1, d2, d3 (paper, Eq. A.10).

An edge's frame moves by a rotation vector w given in the frame itself, q <- q o exp(w/2): w1 and w2
turn the tangent and carry the frame along in parallel (the time-parallel, or Bishop, rule of
Bergou et al. 2010), w3 is the increment of the material angle theta.
"""

import numpy as np
from numpy.typing import NDArray

from der.packs.kernel import kernel

Array = NDArray[np.float64]


@kernel
def turned(q, w, out_q):
    """Frame ``q`` (4,) turned by the rotation vector ``w`` (3,) [rad] given in the frame itself."""
    angle = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    c = np.cos(0.5 * angle)
    # sin(angle/2)/angle, by its series where the quotient would lose digits
    s = np.sin(0.5 * angle) / angle if angle > 1e-4 else 0.5 - angle * angle / 48.0
    r1, r2, r3 = s * w[0], s * w[1], s * w[2]
    p0 = q[0] * c - q[1] * r1 - q[2] * r2 - q[3] * r3
    p1 = q[0] * r1 + q[1] * c + q[2] * r3 - q[3] * r2
    p2 = q[0] * r2 - q[1] * r3 + q[2] * c + q[3] * r1
    p3 = q[0] * r3 + q[1] * r2 - q[2] * r1 + q[3] * c
    scale = 1.0 / np.sqrt(p0 * p0 + p1 * p1 + p2 * p2 + p3 * p3)
    out_q[0], out_q[1], out_q[2], out_q[3] = p0 * scale, p1 * scale, p2 * scale, p3 * scale


@kernel
def relative(qa, qb, out_p):
    """Rotation from frame ``qa`` to frame ``qb``, as seen in ``qa``: conj(qa) o qb, (4,)."""
    out_p[0] = qa[0] * qb[0] + qa[1] * qb[1] + qa[2] * qb[2] + qa[3] * qb[3]
    out_p[1] = qa[0] * qb[1] - qa[1] * qb[0] - qa[2] * qb[3] + qa[3] * qb[2]
    out_p[2] = qa[0] * qb[2] + qa[1] * qb[3] - qa[2] * qb[0] - qa[3] * qb[1]
    out_p[3] = qa[0] * qb[3] - qa[1] * qb[2] + qa[2] * qb[1] - qa[3] * qb[0]


@kernel
def into_frame(q, a, out_b):
    """Components (a . d1, a . d2, a . d3) of the global vector ``a`` (3,) in the frame ``q``."""
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    a0, a1, a2 = a[0], a[1], a[2]
    out_b[0] = (
        (q0 * q0 + q1 * q1 - q2 * q2 - q3 * q3) * a0
        + 2.0 * (q1 * q2 + q0 * q3) * a1
        + 2.0 * (q1 * q3 - q0 * q2) * a2
    )
    out_b[1] = (
        2.0 * (q1 * q2 - q0 * q3) * a0
        + (q0 * q0 - q1 * q1 + q2 * q2 - q3 * q3) * a1
        + 2.0 * (q2 * q3 + q0 * q1) * a2
    )
    out_b[2] = (
        2.0 * (q1 * q3 + q0 * q2) * a0
        + 2.0 * (q2 * q3 - q0 * q1) * a1
        + (q0 * q0 - q1 * q1 - q2 * q2 + q3 * q3) * a2
    )


@kernel
def tangent(q, out_d3):
    """Tangent d3 (3,) of the frame ``q`` (4,), in the global basis."""
    out_d3[0] = 2.0 * (q[1] * q[3] + q[0] * q[2])
    out_d3[1] = 2.0 * (q[2] * q[3] - q[0] * q[1])
    out_d3[2] = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3]


def rotation(quat: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4); their columns are d1, d2, d3."""
    q0, q1, q2, q3 = np.moveaxis(quat, -1, 0)
    rows = [
        [q0**2 + q1**2 - q2**2 - q3**2, 2 * (q1 * q2 - q0 * q3), 2 * (q1 * q3 + q0 * q2)],
        [2 * (q1 * q2 + q0 * q3), q0**2 - q1**2 + q2**2 - q3**2, 2 * (q2 * q3 - q0 * q1)],
        [2 * (q1 * q3 - q0 * q2), 2 * (q2 * q3 + q0 * q1), q0**2 - q1**2 - q2**2 + q3**2],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


@kernel
def turn_between(qa, qb, out_w):
    """Rotation vector (3,) [rad], in the frame ``qa`` (4,), that turns this into ``qb``."""
    p = np.empty(4)
    relative(qa, qb, p)
    sine = np.sqrt(p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
    scale = 2.0
    if sine > 0.0:
        # p and -p are the same rotation: take the angle that lies in [0, pi]
        scale = 2.0 * np.arctan2(sine, abs(p[0])) / sine
    if p[0] < 0.0:
        scale = -scale
    for i in range(3):
        out_w[i] = scale * p[i + 1]


@kernel
def _turns_between(qa, qb, out_w):
    """`turn_between` of each row."""
    for j in range(out_w.shape[0]):
        turn_between(qa[j], qb[j], out_w[j])


def rotation_vector(qa: Array, qb: Array) -> Array:
    """Rotation vectors (n, 3) [rad], in the frames ``qa`` (n, 4), that turn these into ``qb``."""
    w = np.empty((len(qa), 3))
    _turns_between(qa, qb, w)
    return w


@kernel
def chart_rate(w, omega, out_rate):
    """Rate (3,) of the rotation vector ``w`` (3,) of a frame that turns at the rate ``omega``.

    Both in the moving frame q o exp(w/2); to third order in w: dw = omega + w x omega/2 +
    w x (w x omega)/12.
    """
    x, y, z = w[0], w[1], w[2]
    a, b, c = omega[0], omega[1], omega[2]
    u, v, t = y * c - z * b, z * a - x * c, x * b - y * a  # w x omega
    out_rate[0] = a + 0.5 * u + (y * t - z * v) / 12.0
    out_rate[1] = b + 0.5 * v + (z * u - x * t) / 12.0
    out_rate[2] = c + 0.5 * t + (x * v - y * u) / 12.0
