r"""Whether a folded ring stays folded when it is released: its second variation without grips.

The folded ring is planar, with d1 across its plane, M1 = EI1 (k1 - k1u) and a constant force F in
the plane. Frames turned by a small w, in components of d1, d2, d3, have the strains
k + v + v x w / 2 with v = w' + k x w, and d3 becomes d3 + w x d3 + w x (w x d3) / 2. Of the energy
less F . (integral of d3) the terms of second order are

    in the plane    1/2 int  EI1 w1'^2 + F.d3 w1^2
    out of it       1/2 int  EI2 v2^2 + GJ v3^2 + M1 (v2 w3 - v3 w2) - F.d2 w2 w3 + F.d3 w2^2
                    v2 = w2' - k1 w3,  v3 = w3' + k1 w2

on all w of the closed ring, for which the integral of w x d3 vanishes. The number of their negative
squares is the index of the ring without grips. A half-turn of the ring's symmetry turns w into
itself or into -w: at the end of a sector w2 is free and w1 = w3 = 0, or the other way round. Each
class of motions is a problem on the sector; for each rigid motion in it one value is held.

The first class turns the grips, and its other motions are those in the grips. All else relaxed, the
stiffness against that turning is dM/dgamma. So where no class has a negative square the slope is
positive; and on the way out of there the first class loses its stiffness with the slope.

On the intervals of the collocation w has the degree of its polynomials, and integrals are its Gauss
sums: the stationary w are then those of the linearised collocation equations, of the same order.
The values inside the intervals are eliminated first, which leaves the index as it is: it is that of
what is eliminated and that of what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from der.bvp.collocation import Collocation, Solution
from der.bvp.full_ring import directors, moments
from der.bvp.gauss import Array, interpolation, rule
from der.bvp.planar.folded_half import folded_half
from der.geometry.ring import Ring
from der.geometry.section import Section

SITES = np.linspace(0.0, 1.0, len(rule().points) + 1)  # of an interval: values of w
PARTS = 3  # of a panel of the planar rod
SINGULAR = 1e-12  # of the largest eigenvalue: the sign of a smaller one is not known


class Planar(NamedTuple):
    """A planar state on the intervals of a sector; (n, m) values at their stages."""

    quarter: bool  # whether the sector starts on another line of symmetry than that of the grips
    bending: float  # EI1
    across: float  # EI2, of GJ both
    h: Array  # (n,) lengths of the intervals
    k1: Array
    moment: Array  # M1
    shear: Array  # F.d2
    tension: Array  # F.d3
    sideways: Array  # d2.E2
    along: Array  # d2.E3, of the twisting axis


@dataclass(frozen=True, eq=False)
class Motions:
    """A class of motions: the matrix of the second variation, bordered by conditions of closure.

    Parameters
    ----------
    matrix : (k, k), values inside the intervals eliminated
    conditions : how many of its rows are conditions
    inside : index, and sign and logarithm of the determinant, of what was eliminated
    """

    matrix: Array
    conditions: int
    inside: tuple[int, float, float]

    @property
    def index(self) -> int | None:
        """Number of negative eigenvalues; None where the sign of one is not known."""
        values = np.linalg.eigvalsh(self.matrix)
        doubtful = SINGULAR * float(np.abs(values).max())
        if (np.abs(values) <= doubtful).any():
            return None
        return int((values < 0.0).sum()) - self.conditions + self.inside[0]

    def over(self, other: Motions) -> float:
        """The ratio of the determinants of two second variations of the same motions."""
        (sign, size), (own, reference) = map(np.linalg.slogdet, (self.matrix, other.matrix))
        size += self.inside[2] - reference - other.inside[2]
        return float(sign * self.inside[1] * own * other.inside[1] * np.exp(size))


def planar(system: Collocation, at: Solution) -> Planar:
    """The folded state of a solution at gamma = pi."""
    piece, mesh = system.sector.piece, at.mesh
    d = directors(at.frames)
    force = (piece.loads @ at.p)[3:]
    m1 = (moments(system, at, d) * d[:, :, 0]).sum(axis=2)
    bending, across, _ = piece.stiffness
    k1 = mesh.rest + m1 / bending
    d2, d3 = d[:, :, 1], d[:, :, 2]
    return Planar(
        *(piece.quarter, bending, across, mesh.h, k1, m1),
        *(d2 @ force, d3 @ force, d2[..., 1], d2[..., 2]),
    )


def planar_shape(ring: Ring, section: Section) -> Planar:
    """The folded state of a ring by the reduced planar rod, without a path.

    Raises
    ------
    NotFolded
        If it is not found.
    """
    half = folded_half(ring)
    knots = half.panels.knots
    nodes = np.interp(np.arange(PARTS * (len(knots) - 1) + 1) / PARTS, range(len(knots)), knots)
    h = np.diff(nodes)
    s = nodes[:-1, None] + h[:, None] * rule().points
    bent, angle = half.bending(s), half.angle(s)
    force, sine, cosine = section.alpha * half.force, np.sin(angle), np.cos(angle)
    return Planar(
        *(False, section.alpha, section.beta, h, ring.curvature(s) + bent, section.alpha * bent),
        *(force * sine, force * cosine, sine, -cosine),
    )


def index_free(state: Planar) -> int | None:
    """Index of the ring without grips; None where a class of motions is singular."""
    total = 0
    for motions in classes(state):
        if (own := motions.index) is None:
            return None
        total += own
    return total


def stiffnesses(state: Planar) -> list[float]:
    """For each class of motions a smooth function that vanishes where it loses its stiffness.

    The ratio of the determinants of the second variation and of the same without moment and force,
    which is positive.
    """
    none = np.zeros_like(state.moment)
    bare = state._replace(moment=none, shear=none, tension=none)
    return [own.over(other) for own, other in zip(classes(state), classes(bare), strict=True)]


def classes(state: Planar) -> list[Motions]:
    """The classes of motions: out of the plane, and in it where that can be negative.

    A quarter has no force: in its plane 1/2 int EI1 w1'^2 is left.
    """
    ends = ((True, True), (True, False), (False, True), (False, False))
    matrix, inside = _condensed(*_out_of_plane(state))
    n = len(state.h)
    found = []
    for start, end in ends if state.quarter else (ends[0], ends[3]):
        w2, w3, closure = np.array([0, n]), np.array([n + 1, 2 * n + 1]), 2 * n + 2
        held = [int(w3[0] if start else w2[0]), int(w3[1] if end else w2[1])]
        if start != end:  # a half-turn is a rigid motion
            held.append(int(w2[0] if start else w2[1]))
        elif not state.quarter:
            held.append(int(w2[0] if start else w3[0]))
        # the ring is not lifted out of the plane at an end where w2 is free
        conditions = [closure] if start and end else []
        found.append(_motions(matrix, inside, held, conditions, 1))
    if not state.quarter:
        matrix, inside = _condensed(*_in_plane(state))
        found.append(_motions(matrix, inside, [0, n], [n + 1], 2))
        found.append(_motions(matrix, inside, [0], [n + 2], 2))
    return found


def _motions(
    matrix: Array,
    inside: tuple[int, float, float],
    held: Sequence[int],
    conditions: Sequence[int],
    rows: int,
) -> Motions:
    """The motions with some values held, on some of the last ``rows`` of conditions."""
    kept = np.arange(len(matrix)) < len(matrix) - rows
    kept[list(held)] = False
    kept[list(conditions)] = True
    return Motions(matrix[kept][:, kept], len(conditions), inside)


# --- Matrices of the intervals -----------------------------------------------------------------


def _out_of_plane(state: Planar) -> tuple[Array, int]:
    """Matrices (n, 2 k + 1, 2 k + 1) of w2, w3 at k sites, and a row for int w2; 1 such row."""
    w, d, weights = _values(state.h)
    none, k1 = np.zeros_like(w), state.k1[..., None]
    w2, w3 = np.concatenate([w, none], axis=2), np.concatenate([none, w], axis=2)
    v2 = np.concatenate([d, -k1 * w], axis=2)
    v3 = np.concatenate([k1 * w, d], axis=2)
    moment, shear, tension = (
        part[..., None] for part in (state.moment, state.shear, state.tension)
    )
    pairs = (
        (state.across * v2 + moment * w3, v2),
        (v3 - moment * w2, v3),
        (tension * w2 - shear * w3, w2),
    )
    inner = sum(_sums(weights, one, other) for one, other in pairs)
    return _bordered(inner + np.swapaxes(inner, 1, 2), [_row(weights, w2)]), 1


def _in_plane(state: Planar) -> tuple[Array, int]:
    """Matrices (n, k + 2, k + 2) of w1, and rows for closing across the axis and along it."""
    w, d, weights = _values(state.h)
    inner = _sums(weights, state.bending * d, d) + _sums(weights, state.tension[..., None] * w, w)
    rows = [_row(weights, part[..., None] * w) for part in (state.sideways, state.along)]
    return _bordered(inner, rows), 2


@cache
def _tables() -> tuple[Array, Array]:
    """Values and rates at the stages of the unit interval, by the values at the sites, (m, k)."""
    points, degrees = rule().points, np.arange(1, len(SITES))
    rates = np.zeros((len(points), len(SITES)))
    rates[:, 1:] = degrees * points[:, None] ** (degrees - 1)
    slopes = rates @ np.linalg.inv(np.vander(SITES, increasing=True))
    return interpolation(SITES, points), slopes


def _values(h: Array) -> tuple[Array, Array, Array]:
    """W and w' (n, m, k) at the stages, by the values of w at k sites; weights (n, m)."""
    values, slopes = _tables()
    w = np.broadcast_to(values, (len(h), *values.shape))
    return w, slopes / h[:, None, None], h[:, None] * rule().weights


def _sums(weights: Array, one: Array, other: Array) -> Array:
    return np.swapaxes(weights[..., None] * one, 1, 2) @ other


def _row(weights: Array, values: Array) -> Array:
    return np.asarray((weights[..., None] * values).sum(axis=1))


def _bordered(inner: Array, rows: Sequence[Array]) -> Array:
    """Matrices of intervals with the rows of conditions after them."""
    n, k, _ = inner.shape
    out = np.zeros((n, k + len(rows), k + len(rows)))
    out[:, :k, :k] = inner
    for i, row in enumerate(rows, start=k):
        out[:, i, :k] = out[:, :k, i] = row
    return out


def _condensed(matrices: Array, rows: int) -> tuple[Array, tuple[int, float, float]]:
    """The matrix of the values at the ends of intervals, and of ``rows`` conditions.

    With index, sign and logarithm of the determinant of the values inside, which are eliminated.
    """
    n, size, _ = matrices.shape
    k = len(SITES)
    fields = (size - rows) // k
    at = np.arange(size - rows).reshape(fields, k)
    inner, outer = at[:, 1:-1].ravel(), np.append(at[:, [0, -1]].ravel(), range(size - rows, size))
    middle = matrices[:, inner[:, None], inner]
    beside = matrices[:, inner[:, None], outer]
    left = matrices[:, outer[:, None], outer]
    left -= np.swapaxes(beside, 1, 2) @ np.linalg.solve(middle, beside)
    # the values of a field at all ends of intervals, then those of the next one, then conditions
    ends = (n + 1) * np.repeat(np.arange(fields), 2) + np.tile([0, 1], fields)
    places = np.empty((n, len(outer)), dtype=np.int64)
    places[:, : 2 * fields] = np.arange(n)[:, None] + ends
    places[:, 2 * fields :] = fields * (n + 1) + np.arange(rows)
    total = np.zeros((fields * (n + 1) + rows,) * 2)
    np.add.at(total, (places[:, :, None], places[:, None, :]), left)
    signs, sizes = np.linalg.slogdet(middle)
    negative = int((np.linalg.eigvalsh(middle) < 0.0).sum())
    return total, (negative, float(signs.prod()), float(sizes.sum()))
