"""A ring as a boundary-value problem on its smallest symmetry sector.

A quarter (two mirror lines, D2) runs from the free point at +E2 to the grip at +E3, with (A.17) to
(A.20) at its ends; a half (one mirror line, C2) from the grip at -E3 to that at +E3, with BC-III
and BC-II. In both, arc length s counts from the sector's start.

    quarter   start: turned about E2 by the unknown phi; m . d2 = 0, F . E2 = 0
              end:   turned about E3 by -gamma; r1 = 0, F . E3 = 0 (it slides)
              unknown constants p = (phi, m1, m3, F1)
    half      start: turned about E3 by +gamma
              end:   turned about E3 by -gamma; r1 = r2 = 0, F . E3 = 0
              unknown constants p = (m1, m2, m3, F1, F2)

With F . E2 = F . E3 = 0 the force of a quarter is f E1 everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from der.bvp.condensing import Piece
from der.bvp.gauss import Array
from der.geometry.ring import Ring
from der.scene import Scene

CLOSE = 1e-12  # of the ring's length: joints nearer to each other than this are one

# p -> (m0, F)
QUARTER = np.zeros((6, 4))
QUARTER[[0, 2, 3], [1, 2, 3]] = 1.0
HALF = np.zeros((6, 5))
HALF[[0, 1, 2, 3, 4], [0, 1, 2, 3, 4]] = 1.0


@dataclass(frozen=True, eq=False)
class Sector:
    """The symmetry sector of a ring that is solved, and its section."""

    ring: Ring
    begin: float  # arc length of the ring at the sector's start, a
    length: float  # of the sector, a
    joints: tuple[float, ...]  # where the natural curvature is not smooth, from 0 to length
    piece: Piece  # the same for the kernels

    @property
    def copies(self) -> int:
        """How many of it make the ring."""
        return 4 if self.piece.quarter else 2

    def curvature(self, s: Array) -> Array:
        """Natural curvature k1u, 1/a."""
        return self.ring.curvature(self.begin + s)

    def flat(self, s: Array) -> Array:
        """Frames of the flat ring, (..., 4)."""
        return _flat(self.ring, self.begin + s)

    def flat_constants(self) -> Array:
        """Constants p of the flat ring: the moment that closes it, if it was bent to be closed."""
        p = np.zeros(self.piece.loads.shape[1])
        ratio = self.ring.natural_ratio
        if ratio != 1.0:  # a circle, of curvature 1
            p[1 if self.piece.quarter else 0] = self.piece.stiffness[0] * (1.0 - ratio)
        return p


def _flat(ring: Ring, s: Array) -> Array:
    """Frames (..., 4) of the flat ring at arc lengths of its own."""
    half = 0.5 * (ring.angle(s) - 0.5 * np.pi)
    zero = np.zeros_like(half)
    return np.stack([np.cos(half), np.sin(half), zero, zero], axis=-1)


def sector(scene: Scene) -> Sector:
    """The sector of a scene.

    Raises
    ------
    ValueError
        For a sector that the solver does not have.
    """
    ring = scene.ring
    quarter = ring.symmetry == "D2" and scene.sector != "half"
    if scene.sector == "full":
        raise ValueError(
            "sector must be auto, half or quarter for a boundary-value problem, got 'full'"
        )
    begin = 0.25 * ring.length if quarter else 0.0
    length = 0.5 * ring.length - begin
    margin = CLOSE * ring.length
    inside = [s - begin for s in ring.kinks if begin + margin < s < begin + length - margin]
    # rounding may leave a straight between two fillets: it is left out
    inside = [a for a, b in pairwise([*inside, length]) if b - a > margin]
    start, end = _flat(ring, np.array([begin, begin + length]))
    section = scene.section
    stiffness = np.array([section.alpha, section.beta, 1.0])
    piece = Piece(quarter, stiffness, start, end, QUARTER if quarter else HALF)
    return Sector(ring, begin, length, (0.0, *inside, length), piece)
