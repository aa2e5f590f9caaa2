r"""The rod equations (A.15) with the force's and the moment's first integrals used.

Without loads along the rod the force F is constant in space, and with it m + r x F: the moment is

    m(s) = m0 + F x (r(s) - r(0)),     k_i = k1u delta_i1 + d_i . m / B_i,     B = (alpha, beta, 1),

so that of the thirteen equations only (A.11) and (A.13) are left to be integrated,

    q' = q o (0, k) / 2,     r' = d3(q),

with m0 and F as unknown constants. Moments are continuous where the natural curvature jumps, so
there are no jump conditions. The frames q are those of (A.10); d1 is along the height of the
section, d2 is the outward normal of the flat ring, d3 the tangent.

Kernels: scalars and small arrays, `out_*` last.
"""

from __future__ import annotations

from der.packs.kernel import kernel


@kernel
def directors(q, out_d):
    """Rows d1, d2, d3 (A.10), as quadratic forms of q."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    out_d[0, 0] = a * a + b * b - c * c - d * d
    out_d[0, 1] = 2.0 * (b * c + a * d)
    out_d[0, 2] = 2.0 * (b * d - a * c)
    out_d[1, 0] = 2.0 * (b * c - a * d)
    out_d[1, 1] = a * a - b * b + c * c - d * d
    out_d[1, 2] = 2.0 * (c * d + a * b)
    out_d[2, 0] = 2.0 * (b * d + a * c)
    out_d[2, 1] = 2.0 * (c * d - a * b)
    out_d[2, 2] = a * a - b * b - c * c + d * d


@kernel
def stage(q, moment, rest, stiffness, d, turn, out_f, out_fq, out_fm, out_gq):
    """Right-hand side q' at one point, its derivatives by q and by the moment, and that of d3 by q.

    Parameters
    ----------
    q : (4,) frame; moment : (3,) m in space; rest : k1u; stiffness : (3,) B.
    d : (3, 3) directors of q, an input.
    turn : (3, 4) workspace.
    out_f : (4,); out_fq : (4, 4); out_fm : (4, 3); out_gq : (3, 4).
    """
    a, b, c, e = q[0], q[1], q[2], q[3]
    m1, m2, m3 = moment[0], moment[1], moment[2]
    i1, i2, i3 = 1.0 / stiffness[0], 1.0 / stiffness[1], 1.0 / stiffness[2]
    k1 = rest + (d[0, 0] * m1 + d[0, 1] * m2 + d[0, 2] * m3) * i1
    k2 = (d[1, 0] * m1 + d[1, 1] * m2 + d[1, 2] * m3) * i2
    k3 = (d[2, 0] * m1 + d[2, 1] * m2 + d[2, 2] * m3) * i3
    out_f[0] = 0.5 * (-b * k1 - c * k2 - e * k3)
    out_f[1] = 0.5 * (a * k1 - e * k2 + c * k3)
    out_f[2] = 0.5 * (e * k1 + a * k2 - b * k3)
    out_f[3] = 0.5 * (-c * k1 + b * k2 + a * k3)
    # columns of dq'/dk
    turn[0, 0], turn[0, 1], turn[0, 2], turn[0, 3] = -0.5 * b, 0.5 * a, 0.5 * e, -0.5 * c
    turn[1, 0], turn[1, 1], turn[1, 2], turn[1, 3] = -0.5 * c, -0.5 * e, 0.5 * a, 0.5 * b
    turn[2, 0], turn[2, 1], turn[2, 2], turn[2, 3] = -0.5 * e, 0.5 * c, -0.5 * b, 0.5 * a
    # derivatives of d_i . m by q, four numbers that serve all three
    s0 = 2.0 * (m1 * a + m2 * e - m3 * c)
    s1 = 2.0 * (m1 * b + m2 * c + m3 * e)
    s2 = 2.0 * (-m1 * c + m2 * b - m3 * a)
    s3 = 2.0 * (-m1 * e + m2 * a + m3 * b)
    for row in range(4):
        t1, t2, t3 = turn[0, row] * i1, turn[1, row] * i2, turn[2, row] * i3
        out_fq[row, 0] = t1 * s0 + t2 * s3 - t3 * s2
        out_fq[row, 1] = t1 * s1 - t2 * s2 - t3 * s3
        out_fq[row, 2] = t1 * s2 + t2 * s1 + t3 * s0
        out_fq[row, 3] = t1 * s3 - t2 * s0 + t3 * s1
        for k in range(3):
            out_fm[row, k] = t1 * d[0, k] + t2 * d[1, k] + t3 * d[2, k]
    h1, h2, h3 = 0.5 * k1, 0.5 * k2, 0.5 * k3
    out_fq[0, 1] -= h1
    out_fq[0, 2] -= h2
    out_fq[0, 3] -= h3
    out_fq[1, 0] += h1
    out_fq[1, 2] += h3
    out_fq[1, 3] -= h2
    out_fq[2, 0] += h2
    out_fq[2, 1] -= h3
    out_fq[2, 3] += h1
    out_fq[3, 0] += h3
    out_fq[3, 1] += h2
    out_fq[3, 2] -= h1
    out_gq[0, 0], out_gq[0, 1], out_gq[0, 2], out_gq[0, 3] = 2 * c, 2 * e, 2 * a, 2 * b
    out_gq[1, 0], out_gq[1, 1], out_gq[1, 2], out_gq[1, 3] = -2 * b, -2 * a, 2 * e, 2 * c
    out_gq[2, 0], out_gq[2, 1], out_gq[2, 2], out_gq[2, 3] = 2 * a, -2 * b, -2 * c, 2 * e


@kernel
def product(p, q, out):
    """Quaternion product p o q."""
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    out[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
