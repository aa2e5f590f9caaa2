"""The folded shape of a ring, which covers itself three times: its centreline in the plane."""

from __future__ import annotations

from dataclasses import dataclass
from operator import index

import numpy as np

from der.bvp.gauss import Array
from der.bvp.planar.elastica import FOLDED_TURN
from der.bvp.planar.folded_half import NotFolded, folded_half
from der.geometry.ring import Ring

__all__ = ["Folded", "NotFolded", "folded"]


@dataclass(frozen=True, eq=False)
class Folded:
    """The centreline of a folded ring, in the plane (E2, E3), at equal arc lengths.

    Parameters
    ----------
    s : (n,) array
        Arc lengths i L/n from the first grip, units of a; the closing point is not repeated.
    points : (n, 2) array
        Places (r2, r3), units of a. The twisting axis is r2 = 0, with r3 = 0 midway between grips.
    angle : (n,) array
        Tangent angle phi, rad, 0 at s = 0.
    curvature : (n,) array
        phi', units of 1/a; right-continuous at jumps of the natural curvature.
    force : float
        Internal force F2, units of EI1/a^2; 0 for rings of D2 symmetry.
    turning : float
        Total turning, rad: 6 pi.
    closure_error : float
        Distance of the second grip from the twisting axis, or its error of angle in rad, whichever
        is the larger, relative to L/2 and 3 pi.
    """

    s: Array
    points: Array
    angle: Array
    curvature: Array
    force: float
    turning: float
    closure_error: float


def folded(ring: Ring, n: int = 960) -> Folded:
    """Return the folded three-covered shape of a ring.

    Parameters
    ----------
    ring : der.Ring
        Any; the shape does not depend on the cross-section.
    n : int
        Number of points, even, at least 12.

    Returns
    -------
    Folded
        Exact to rounding, about 1e-14 L, or its multiple by the largest curvature: 1e-11 L for
        fillets of 1e-6 a.

    Raises
    ------
    ValueError
        If `ring` is no ring or `n` no such number.
    NotFolded
        If the equations of the half ring have no solution that Newton's method finds.
    """
    if not isinstance(ring, Ring):
        raise ValueError(f"ring must be a der.Ring, got {ring!r}")
    n = _checked_count(n)
    half = folded_half(ring)
    s = np.linspace(0.0, ring.length, n, endpoint=False)
    first = s[: n // 2 + 1]
    turned, z = half.angle(first), half.place(first)
    z = z - 0.5j * half.knot_place[-1].imag
    angle = np.append(turned, FOLDED_TURN - turned[-2:0:-1])
    z = np.append(z, -np.conj(z[-2:0:-1]))
    off_axis = abs(half.knot_place[-1].real) / (ring.length / 2)
    off_angle = abs(half.knot_angle[-1] / (FOLDED_TURN / 2) - 1)
    return Folded(
        s=s,
        points=np.column_stack([z.real, z.imag]),
        angle=angle,
        curvature=ring.curvature(s) + half.bending(np.minimum(s, ring.length - s)),
        force=half.force,
        turning=2 * float(half.knot_angle[-1]),
        closure_error=max(off_axis, off_angle),
    )


def _checked_count(n: object) -> int:
    try:
        count = index(n)  # type: ignore[arg-type]
    except TypeError:
        count = 0
    if isinstance(n, bool) or count < 12 or count % 2:
        raise ValueError(f"n must be an even integer >= 12, got {n!r}")
    return count
