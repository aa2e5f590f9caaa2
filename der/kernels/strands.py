"""Two strands of a closed polygon: where they come nearest, and the signed gap between them.

The link is an integer and can only be bisected, at a cost of O(N^2) each time. The gap between two
strands is the distance of their closest edges with the sign of the edges' triple product. It passes
smoothly through zero where one strand passes through the other.
"""

from __future__ import annotations

import numpy as np

from der.packs.kernel import kernel

_TURN = 3.0  # rad; an arc has to turn by pi to meet itself (Fenchel)


@kernel
def nearest_strands(x, y):
    """Vertices (i, k) of two strands that are closest on the straight line from ``x`` to ``y``.

    Parameters
    ----------
    x, y : (n, 3) vertices of two closed polygons.

    Returns
    -------
    (i, k), or (-1, -1) where no two parts are strands: the curve turns too little between them.
    """
    n = x.shape[0]
    turned = np.zeros(n)  # from vertex 0 on; a vertex turns half before itself, half behind
    total = 0.0
    for j in range(n):
        one, two, dot = 0.0, 0.0, 0.0
        for c in range(3):
            a = x[j, c] - x[j - 1 if j > 0 else n - 1, c]
            b = x[j + 1 if j + 1 < n else 0, c] - x[j, c]
            one, two, dot = one + a * a, two + b * b, dot + a * b
        here = np.arccos(max(-1.0, min(1.0, dot / np.sqrt(one * two))))
        total += here
        turned[j] = total - 0.5 * here
    least, at_i, at_k = np.inf, -1, -1
    for i in range(n):
        for k in range(i + 2, n):
            arc = turned[k] - turned[i]
            if arc < _TURN or total - arc < _TURN:
                continue
            dx, dy, dz = x[k, 0] - x[i, 0], x[k, 1] - x[i, 1], x[k, 2] - x[i, 2]
            ux, uy, uz = y[k, 0] - y[i, 0] - dx, y[k, 1] - y[i, 1] - dy, y[k, 2] - y[i, 2] - dz
            way = ux * ux + uy * uy + uz * uz
            t = -(dx * ux + dy * uy + dz * uz) / way if way > 0.0 else 0.0
            t = max(0.0, min(1.0, t))
            size = (dx + t * ux) ** 2 + (dy + t * uy) ** 2 + (dz + t * uz) ** 2
            if size < least:
                least, at_i, at_k = size, i, k
    return at_i, at_k


@kernel
def _edges_apart(x, i, k):
    """Squared distance of edges ``i`` and ``k``, and their triple product (Ericson 2005, 5.1.9)."""
    n = x.shape[0]
    p, q = (i - 1 if i > 0 else n - 1), (k - 1 if k > 0 else n - 1)
    ax, ay, az = x[i, 0] - x[p, 0], x[i, 1] - x[p, 1], x[i, 2] - x[p, 2]
    bx, by, bz = x[k, 0] - x[q, 0], x[k, 1] - x[q, 1], x[k, 2] - x[q, 2]
    rx, ry, rz = x[p, 0] - x[q, 0], x[p, 1] - x[q, 1], x[p, 2] - x[q, 2]
    aa, bb, ab = (
        ax * ax + ay * ay + az * az,
        bx * bx + by * by + bz * bz,
        ax * bx + ay * by + az * bz,
    )
    ar, br = ax * rx + ay * ry + az * rz, bx * rx + by * ry + bz * rz
    cross = aa * bb - ab * ab
    s = max(0.0, min(1.0, (ab * br - ar * bb) / cross)) if cross > 0.0 else 0.0
    t = (ab * s + br) / bb
    if t < 0.0:
        t, s = 0.0, max(0.0, min(1.0, -ar / aa))
    elif t > 1.0:
        t, s = 1.0, max(0.0, min(1.0, (ab - ar) / aa))
    square = (rx + s * ax - t * bx) ** 2 + (ry + s * ay - t * by) ** 2 + (rz + s * az - t * bz) ** 2
    triple = rx * (ay * bz - az * by) + ry * (az * bx - ax * bz) + rz * (ax * by - ay * bx)
    return square, triple


@kernel
def gap(x, i, k):
    """Signed distance of two strands of the polygon ``x`` (n, 3) near its edges ``i`` and ``k``.

    It is that of the closest edges, found downhill from there.
    """
    n = x.shape[0]
    square, triple, downhill = np.inf, 0.0, True
    while downhill:
        downhill = False
        first, second = i, k
        for a in range(-1, 2):
            for b in range(-1, 2):
                one, two = (first + a) % n, (second + b) % n
                if 1 < (two - one) % n < n - 1:  # neighbours touch
                    there, sign = _edges_apart(x, one, two)
                    if there < square:
                        square, triple, i, k, downhill = there, sign, one, two, True
    return np.copysign(np.sqrt(square), triple)
