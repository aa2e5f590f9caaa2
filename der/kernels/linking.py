"""Twist, writhe and link of a closed ribbon.

Lk = Tw + Wr (Calugareanu, White, Fuller) holds exactly for a polygon when Tw sums the twist that
parallel transport over each vertex leaves (`strain`) and Wr is the polygon's Gauss integral. Lk is
an integer at every state without self-crossing and jumps by +-2 when a strand passes through
another, which is how self-crossings of the ideal ring are found.
"""

import numpy as np

from der.kernels.quaternions import Array, relative, tangent
from der.packs.kernel import kernel

_THIN = 0.1  # of 16: the size of the product of complex numbers below which digits are lost


@kernel
def twist(quat):
    """Total twist (turns) of the closed ribbon with edge frames ``quat`` (n, 4)."""
    n = quat.shape[0]
    p = np.empty(4)
    total = 0.0
    for j in range(n):
        relative(quat[j], quat[(j + 1) % n], p)
        total += np.arctan(p[3] / p[0]) if p[0] != 0.0 else 0.5 * np.pi
    return total / np.pi


@kernel
def writhe(x, copies):
    """Writhe of the closed polygon with vertices ``x`` (n, 3): Klenin & Langowski 2000, method 1a.

    Edge j ends at vertex j. Of a polygon made of ``copies`` half-turn images one sector's edges,
    i and k, are paired with each other and with all their images, each pair once: for k from i on
    the images of k are two runs of edges, i .. n/2 - i and n/2 + i .. n - i of four copies, one,
    i .. n - i, of two. The edges in a sector's two planes of symmetry belong to it by half.
    """
    n = x.shape[0]
    last = n // copies if copies > 1 else n - 1
    total = 0.0
    for i in range(last + 1):
        share = 0.5 if copies > 1 and (i == 0 or i == last) else 1.0
        before = n - 2 if i == 0 else n - 1  # the last edge that is not next to i
        for run in range(5):  # with the images of edges beyond i, and with those of i itself
            first, end, weight = 0, -1, 2.0 * share if run < 2 else share * share
            if run == 0:
                first = i + 2
                end = before if copies == 1 else (n if copies == 2 else n // 2) - i - 1
            elif run == 1 and copies == 4:
                first, end = n // 2 + i + 1, n - i - 1
            elif run == 2 and copies == 4:
                first = end = n // 2 + i
            elif run == 3 and copies == 4 and i < last:
                first = end = n // 2 - i
            elif run == 4 and i > 0 and (copies == 4 or (copies == 2 and i < last)):
                first = end = n - i
            total += weight * _solid_angles(x, i, first, min(end, before))
    return copies * total / (4.0 * np.pi)


@kernel
def _solid_angles(x, i, first, last):
    """Sum of the signed areas, on the sphere, of the directions from edge ``i`` to a run of edges.

    None of the edges ``first`` .. ``last`` may be next to i. With p, p' and q, q' the directions
    from the start and the end of edge i to the ends of another, the area is the quadrilateral
    p, p', q', q; the two triangles (Van Oosterom & Strackee 1983) that it is cut into along p q'
    have one triple product. They are arguments of complex numbers, added by multiplying these, up
    to four quadrilaterals that are small. The area is below 2 pi, so half of it never leaves the
    principal branch. Where an edge all but touches another, corners lie opposite each other and the
    complex numbers all but vanish: there `_quadrilateral` keeps the digits.
    """
    if last < first:
        return 0.0
    start = i - 1 if i > 0 else x.shape[0] - 1
    k = first - 1  # the vertex where the first edge begins
    ex, ey, ez = x[i, 0] - x[start, 0], x[i, 1] - x[start, 1], x[i, 2] - x[start, 2]
    px, py, pz = x[k, 0] - x[start, 0], x[k, 1] - x[start, 1], x[k, 2] - x[start, 2]
    qx, qy, qz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
    p = np.sqrt(px * px + py * py + pz * pz)
    q = np.sqrt(qx * qx + qy * qy + qz * qz)
    pq = px * qx + py * qy + pz * qz
    total, real, imaginary, count = 0.0, 1.0, 0.0, 0
    for _ in range(last - first + 1):
        k += 1
        ux, uy, uz = x[k, 0] - x[start, 0], x[k, 1] - x[start, 1], x[k, 2] - x[start, 2]  # p'
        vx, vy, vz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]  # q'
        u = np.sqrt(ux * ux + uy * uy + uz * uz)
        v = np.sqrt(vx * vx + vy * vy + vz * vz)
        uv = ux * vx + uy * vy + uz * vz
        pv = px * vx + py * vy + pz * vz
        # p . (p' x q') = p . (q' x q) = e . (q' x q)
        triple = ex * (vy * qz - vz * qy) + ey * (vz * qx - vx * qz) + ez * (vx * qy - vy * qx)
        r1 = (p * u + px * ux + py * uy + pz * uz) * v + uv * p + pv * u
        r2 = (p * v + pv) * q + (vx * qx + vy * qy + vz * qz) * p + pq * v
        a, b = r1 * r2 - triple * triple, triple * (r1 + r2)
        far = a > 2.0 * abs(b)
        least = _THIN * (p * v) * (p * v) * u * q
        if count == 4 or not far:
            total += np.arctan2(imaginary, real)
            real, imaginary, count = 1.0, 0.0, 0
        if far and a > least:
            real, imaginary = real * a - imaginary * b, real * b + imaginary * a
            count += 1
        elif abs(a) + abs(b) > least:
            total += np.arctan2(b, a)
        else:
            total += 0.5 * _quadrilateral(x[start], x[i], x[k - 1], x[k])
        px, py, pz, p = ux, uy, uz, u
        qx, qy, qz, q = vx, vy, vz, v
        pq = uv
    return -2.0 * (total + np.arctan2(imaginary, real))


@kernel
def _quadrilateral(p, q, r, s):
    """Signed area, on the sphere, of the directions from the edge pq to the edge rs.

    The sum of arcsines of Klenin & Langowski (Eq. 16), each as an arctangent. The normals of the
    four sides are products with the edges themselves, which are exact where corners are opposite
    or all but equal, and that of two normals is a corner times the triple product they all share.
    """
    A, B, C, D = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    a2, b2, c2, d2, triple = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        ej, ek, fj, fk = q[j] - p[j], q[k] - p[k], s[j] - r[j], s[k] - r[k]
        A[i] = (r[j] - p[j]) * fk - (r[k] - p[k]) * fj
        B[i] = ej * (s[k] - p[k]) - ek * (s[j] - p[j])
        C[i] = fj * (s[k] - q[k]) - fk * (s[j] - q[j])
        D[i] = (r[j] - q[j]) * ek - (r[k] - q[k]) * ej
        a2 += (r[i] - p[i]) ** 2
        b2 += (s[i] - p[i]) ** 2
        c2 += (s[i] - q[i]) ** 2
        d2 += (r[i] - q[i]) ** 2
        triple += (r[i] - p[i]) * (ej * fk - ek * fj)
    ab, bc, cd, da = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        ab += A[i] * B[i]
        bc += B[i] * C[i]
        cd += C[i] * D[i]
        da += D[i] * A[i]
    size = abs(triple)
    area = np.arctan2(ab, np.sqrt(b2) * size) + np.arctan2(bc, np.sqrt(c2) * size)
    area += np.arctan2(cd, np.sqrt(d2) * size) + np.arctan2(da, np.sqrt(a2) * size)
    return area * np.sign(triple)


def unfold(quat: Array, copies: int) -> Array:
    """Frames (N, 4) of the full ring from those of a sector, from the first grip on.

    A quarter (``copies`` = 4) runs from a free point to the second grip, a half (2) from grip to
    grip.
    """
    whole = np.empty((_whole(len(quat), copies), 4))
    _unfold(quat, copies, whole)
    return whole


@kernel
def _whole(n, copies):
    """Edges of the ring made of ``copies`` of a sector with ``n``, which ends in half edges."""
    return n if copies == 1 else copies * (n - 1)


@kernel
def _unfold(quat, copies, out_quat):
    """Half-turns about E2 and E3 that run the curve backwards carry d2 along, reverse d1 and d3.

    q -> e2 q e2 and q -> e3 q e2.
    """
    n, whole = quat.shape[0], out_quat.shape[0]
    shift = n - 1 if copies == 4 else 0
    for j in range(n):
        for i in range(4):
            out_quat[shift + j, i] = quat[j, i]
    for j in range(shift):
        q, out = quat[shift - j], out_quat[j]
        out[0], out[1], out[2], out[3] = -q[0], q[1], -q[2], q[3]
    for j in range(shift + n, whole):
        q, out = out_quat[whole - j], out_quat[j]
        out[0], out[1], out[2], out[3] = -q[1], -q[0], -q[3], -q[2]


def unfold_lengths(length: Array, copies: int) -> Array:
    """Edge lengths (N,) of the full ring from those (n,) of a sector, which ends in half edges."""
    whole = np.empty(_whole(len(length), copies))
    _unfold_lengths(length, copies, whole)
    return whole


@kernel
def _unfold_lengths(length, copies, out_length):
    n, whole = length.shape[0], out_length.shape[0]
    shift = n - 1 if copies == 4 else 0
    for j in range(n):
        halved = copies > 1 and (j == 0 or j == n - 1)
        out_length[shift + j] = length[j] * (2.0 if halved else 1.0)
    for j in range(shift):
        out_length[j] = out_length[2 * shift - j]
    for j in range(shift + n, whole):
        out_length[j] = out_length[whole - j]


def vertices(quat: Array, length: Array) -> Array:
    """Vertices (N, 3) of the closed ring with these edges; the origin is midway between the grips.

    Vertex j ends edge j; the grips are the middles of edges 0 and N/2.
    """
    x = np.empty((len(quat), 3))
    _vertices(quat, length, x)
    return x


@kernel
def _vertices(quat, length, out_x):
    n = quat.shape[0]
    d3 = np.empty(3)
    before = np.zeros(3)
    origin = np.zeros(3)
    for j in range(n):
        tangent(quat[j], d3)
        for i in range(3):
            step = length[j] * d3[i]
            if j == 0 or j == n // 2:
                origin[i] += 0.5 * (before[i] + 0.5 * step)
            before[i] += step
            out_x[j, i] = before[i]
    for j in range(n):
        for i in range(3):
            out_x[j, i] -= origin[i]


@kernel
def link_number(quat, length, copies):
    """Tw + Wr of the ring made of ``copies`` of a sector with frames (n, 4) and lengths (n,)."""
    n = _whole(quat.shape[0], copies)
    whole, lengths, x = np.empty((n, 4)), np.empty(n), np.empty((n, 3))
    _unfold(quat, copies, whole)
    _unfold_lengths(length, copies, lengths)
    _vertices(whole, lengths, x)
    return twist(whole) + writhe(x, copies)


def link(quat: Array, length: Array, copies: int = 1) -> tuple[int, float]:
    """Linking number, and by how much Tw + Wr misses the integer.

    Parameters
    ----------
    quat : (n, 4) edge frames of the sector. length : (n,) its edge lengths.
    copies : number of half-turn images of which the ring is made: 1, 2 or 4.
    """
    number = float(link_number(quat, length, copies))
    return round(number), abs(number - round(number))
