"""Bending and twisting of one vertex: integrated strains of two neighbouring frames.

The two edges that meet at a vertex differ by a relative rotation p = conj(qa) o qb. Split
symmetrically, half the twist, then the turn of the tangent, then the other half of the twist, it
reads (Euler angles about d3, bend, d3)

    p0 = cos(phi/2) cos(tau/2),   p1 = sin(phi/2) cos(psi),
    p3 = cos(phi/2) sin(tau/2),   p2 = sin(phi/2) sin(psi)

with phi the turning angle of the tangent, tau the twist (difference of the material angles plus
the reference twist, Bergou et al. 2010: parallel transport over the vertex takes out exactly the
bend), psi the direction of the curvature binormal seen in the frame half way.

Measures of the strains (kappa1, kappa2, tau) of a vertex:

    "logarithm"  the rotation vector of p, all three at once
    "angle"      phi cos(tau/2) (cos psi, sin psi), tau            mean of both frames
    "tangent"    2 tan(phi/2) cos(tau/2) (cos psi, sin psi), tau   likewise: Bergou et al. 2008

All are second order in the cell length; `der bench` shows which is most accurate for its time.
"""

import numpy as np

from der.packs.kernel import kernel

_SERIES_BELOW = 0.03  # 10 terms reach 1e-16 here, and f'' still has 13 digits above it


@kernel
def arctangent_quotient(r):
    """f = 2 arctan(sqrt r)/sqrt r and its first two derivatives in r = tan(angle/2)^2."""
    if r < _SERIES_BELOW:
        f, f1, f2 = 0.0, 0.0, 0.0
        for k in range(11, -1, -1):  # Horner's rule for sum (-r)^k/(2k+1) and its derivatives
            f2 = f2 * r + 2.0 * f1
            f1 = f1 * r + f
            f = f * r + (2.0 if k % 2 == 0 else -2.0) / (2 * k + 1)
        return f, f1, f2
    x = np.sqrt(r)
    f = 2.0 * np.arctan(x) / x
    f1 = (1.0 / (1.0 + r) - 0.5 * f) / r
    f2 = -(1.0 / (1.0 + r) ** 2 + 1.5 * f1) / r
    return f, f1, f2


@kernel
def _split_energy(p, tangent, rest, stiffness, out_kappa, out_g, out_H):
    """`vertex_energy` for the measures "angle" and "tangent", bend and twist apart.

    The strains are kappa_k = p_k p0 h(A, B) for the bend and p3 f(B/A)/p0 for the twist, with
    h = f(B/A)/A and A, B the squares of cosine and sine of the half angles: A = p0^2 + p3^2 and
    B = p1^2 + p2^2 for the bend, A = p0^2 and B = p3^2 for the twist. Both are homogeneous of
    degree 0 in p, so neither its norm nor its second derivative along exp(w/2) enters: with w and Q
    the first and second derivatives in p, g = L' w and H = L' Q L, L = d(p o exp(w/2))/dw.
    """
    w = np.zeros(4)
    Q = np.zeros((4, 4))
    dh = np.empty(4)
    dG = np.empty(4)
    # bend
    A = p[0] * p[0] + p[3] * p[3]
    r = (p[1] * p[1] + p[2] * p[2]) / A
    f, f1, f2 = 2.0, 0.0, 0.0
    if not tangent:
        f, f1, f2 = arctangent_quotient(r)
    h_A, h_B = -(f + r * f1) / A**2, f1 / A**2
    h_AA, h_BB = (2.0 * f + 4.0 * r * f1 + r * r * f2) / A**3, f2 / A**3
    h_AB = -(2.0 * f1 + r * f2) / A**3
    for i in range(4):
        dh[i] = 2.0 * (h_A if i == 0 or i == 3 else h_B) * p[i]
        dG[i] = p[0] * dh[i]
    dG[0] += f / A
    energy, mp = 0.0, 0.0
    for k in range(1, 3):
        out_kappa[k - 1] = p[k] * p[0] * f / A
        moment = stiffness[k - 1] * (out_kappa[k - 1] - rest[k - 1])
        energy += 0.5 * moment * (out_kappa[k - 1] - rest[k - 1])
        mp += moment * p[k]
        for i in range(4):
            J_i = p[k] * dG[i] + (p[0] * f / A if i == k else 0.0)
            w[i] += moment * J_i
            Q[i, k] += moment * dG[i]
            Q[k, i] += moment * dG[i]
            for j in range(4):
                J_j = p[k] * dG[j] + (p[0] * f / A if j == k else 0.0)
                Q[i, j] += stiffness[k - 1] * J_i * J_j
    for i in range(4):
        for j in range(4):
            cosines = (i == 0 or i == 3) + (j == 0 or j == 3)
            second = h_AA if cosines == 2 else (h_AB if cosines == 1 else h_BB)
            d2G = 4.0 * p[0] * second * p[i] * p[j]
            if i == j:
                d2G += 2.0 * p[0] * (h_A if cosines == 2 else h_B)
            d2G += dh[j] if i == 0 else 0.0
            d2G += dh[i] if j == 0 else 0.0
            Q[i, j] += mp * d2G
    # twist: tau = 2 arctan(p3/p0) has simple derivatives of its own
    tau = 2.0 * np.arctan(p[3] / p[0])
    out_kappa[2] = tau
    moment = stiffness[2] * (tau - rest[2])
    energy += 0.5 * moment * (tau - rest[2])
    t0, t3 = -2.0 * p[3] / A, 2.0 * p[0] / A
    w[0] += moment * t0
    w[3] += moment * t3
    Q[0, 0] += stiffness[2] * t0 * t0 + moment * 4.0 * p[0] * p[3] / A**2
    Q[3, 3] += stiffness[2] * t3 * t3 - moment * 4.0 * p[0] * p[3] / A**2
    mixed = stiffness[2] * t0 * t3 + moment * 2.0 * (p[3] * p[3] - p[0] * p[0]) / A**2
    Q[0, 3] += mixed
    Q[3, 0] += mixed

    L = np.empty((4, 3))
    L[0, 0], L[0, 1], L[0, 2] = -0.5 * p[1], -0.5 * p[2], -0.5 * p[3]
    L[1, 0], L[1, 1], L[1, 2] = 0.5 * p[0], -0.5 * p[3], 0.5 * p[2]
    L[2, 0], L[2, 1], L[2, 2] = 0.5 * p[3], 0.5 * p[0], -0.5 * p[1]
    L[3, 0], L[3, 1], L[3, 2] = -0.5 * p[2], 0.5 * p[1], 0.5 * p[0]
    for i in range(3):
        out_g[i] = w[0] * L[0, i] + w[1] * L[1, i] + w[2] * L[2, i] + w[3] * L[3, i]
        for j in range(i, 3):
            s = 0.0
            for k in range(4):
                for n in range(4):
                    s += L[k, i] * Q[k, n] * L[n, j]
            out_H[i, j] = s
            out_H[j, i] = s
    return energy


@kernel
def _arc_coefficient(t):
    """c = (1 - x cot x)/t with x = sqrt(t)/2, and dc/dt, at the squared angle ``t`` [rad^2].

    The coefficient of the double cross product in the inverse Jacobian of the rotation vector.
    """
    if t < 0.5:
        # sum |B_2k| t^(k-1)/(2k)!, Bernoulli numbers
        c = (
            8.333333333333333e-2,
            1.388888888888889e-3,
            3.306878306878307e-5,
            8.267195767195768e-7,
            2.08767569878681e-8,
            5.284190138687493e-10,
            1.338253653068468e-11,
            3.389680296322583e-13,
            8.586062056277845e-15,
        )
        value, rate = 0.0, 0.0
        for k in range(8, -1, -1):
            rate = rate * t + value
            value = value * t + c[k]
        return value, rate
    x = 0.5 * np.sqrt(t)
    cotangent = np.cos(x) / np.sin(x)
    value = (1.0 - x * cotangent) / t
    rate = -(cotangent - x * (1.0 + cotangent * cotangent)) / (8.0 * x * t) - value / t
    return value, rate


@kernel
def _rotation_vector_energy(p, rest, stiffness, out_kappa, out_g, out_H):
    """`vertex_energy` for the measure "logarithm".

    With W = log(p o exp(w)): dW = B w, B w = w + W x w/2 + c W x (W x w), and along one w the
    second derivative is dB[B w] w; c = c(|W|^2) is `_arc_coefficient`.
    """
    sine = np.sqrt(p[1] * p[1] + p[2] * p[2] + p[3] * p[3])
    scale = 2.0 * np.arctan2(sine, p[0]) / sine if sine > 0.0 else 2.0 / p[0]
    x, y, z = scale * p[1], scale * p[2], scale * p[3]
    out_kappa[0], out_kappa[1], out_kappa[2] = x, y, z
    t = x * x + y * y + z * z
    c, c1 = _arc_coefficient(t)
    dx, dy, dz = x - rest[0], y - rest[1], z - rest[2]
    mx, my, mz = stiffness[0] * dx, stiffness[1] * dy, stiffness[2] * dz
    mW = mx * x + my * y + mz * z

    # B = (1 - c t) 1 + [W x]/2 + c W W', row by row
    d = 1.0 - c * t
    b00, b01, b02 = d + c * x * x, -0.5 * z + c * x * y, 0.5 * y + c * x * z
    b10, b11, b12 = 0.5 * z + c * x * y, d + c * y * y, -0.5 * x + c * y * z
    b20, b21, b22 = -0.5 * y + c * x * z, 0.5 * x + c * y * z, d + c * z * z
    g0 = b00 * mx + b10 * my + b20 * mz
    g1 = b01 * mx + b11 * my + b21 * mz
    g2 = b02 * mx + b12 * my + b22 * mz
    out_g[0], out_g[1], out_g[2] = g0, g1, g2

    # S_ij = m . dB[B e_i] e_j; its symmetric part is the second derivative of m . W
    u = 2.0 * c1 * mW
    w = -2.0 * (c + c1 * t)
    s00 = -0.5 * (b10 * mz - b20 * my) + c * (mW * b00 + g0 * x) + x * (u * x + w * mx)
    s11 = -0.5 * (b21 * mx - b01 * mz) + c * (mW * b11 + g1 * y) + y * (u * y + w * my)
    s22 = -0.5 * (b02 * my - b12 * mx) + c * (mW * b22 + g2 * z) + z * (u * z + w * mz)
    s01 = -0.5 * (b20 * mx - b00 * mz) + c * (mW * b10 + g0 * y) + x * (u * y + w * my)
    s10 = -0.5 * (b11 * mz - b21 * my) + c * (mW * b01 + g1 * x) + y * (u * x + w * mx)
    s02 = -0.5 * (b00 * my - b10 * mx) + c * (mW * b20 + g0 * z) + x * (u * z + w * mz)
    s20 = -0.5 * (b12 * mz - b22 * my) + c * (mW * b02 + g2 * x) + z * (u * x + w * mx)
    s12 = -0.5 * (b01 * my - b11 * mx) + c * (mW * b21 + g1 * z) + y * (u * z + w * mz)
    s21 = -0.5 * (b22 * mx - b02 * mz) + c * (mW * b12 + g2 * y) + z * (u * y + w * my)

    k0, k1, k2 = stiffness[0], stiffness[1], stiffness[2]
    out_H[0, 0] = k0 * b00 * b00 + k1 * b10 * b10 + k2 * b20 * b20 + s00
    out_H[1, 1] = k0 * b01 * b01 + k1 * b11 * b11 + k2 * b21 * b21 + s11
    out_H[2, 2] = k0 * b02 * b02 + k1 * b12 * b12 + k2 * b22 * b22 + s22
    out_H[0, 1] = k0 * b00 * b01 + k1 * b10 * b11 + k2 * b20 * b21 + 0.5 * (s01 + s10)
    out_H[0, 2] = k0 * b00 * b02 + k1 * b10 * b12 + k2 * b20 * b22 + 0.5 * (s02 + s20)
    out_H[1, 2] = k0 * b01 * b02 + k1 * b11 * b12 + k2 * b21 * b22 + 0.5 * (s12 + s21)
    out_H[1, 0], out_H[2, 0], out_H[2, 1] = out_H[0, 1], out_H[0, 2], out_H[1, 2]
    return 0.5 * (mx * dx + my * dy + mz * dz)


@kernel
def vertex_energy(p, measure, rest, stiffness, out_kappa, out_g, out_H):
    """Elastic energy of one vertex and its derivatives in the frame of the second edge.

    Parameters
    ----------
    p : (4,) relative rotation conj(qa) o qb, any norm, p0 > 0.
    rest, stiffness : (3,) natural integrated strains [rad] and stiffness/cell length.
    out_kappa : (3,) integrated strains. out_g : (3,) gradient, out_H : (3, 3) Hessian along
        p o exp(w/2) at w = 0.
    """
    if measure == 0:
        return _rotation_vector_energy(p, rest, stiffness, out_kappa, out_g, out_H)
    return _split_energy(p, measure == 2, rest, stiffness, out_kappa, out_g, out_H)
