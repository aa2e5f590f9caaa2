"""The full ring from the solution on its sector, at the points where a rod of N edges has them.

The half-turn about E3 brings one arm to the other, that about E2 one half of an arm of a D2 ring to
its other half. A half-turn R reverses the sense of arc length and keeps d2 outward, so that
(d1, d2, d3) becomes (-R d1, R d2, -R d3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from der.bvp.collocation import Collocation, Solution
from der.bvp.gauss import Array, interpolation
from der.bvp.meshes import moved_to
from der.geometry.mesh import sites

Flags = NDArray[np.bool_]
Places = NDArray[np.intp]

ABOUT_E2 = np.array([-1.0, 1.0, -1.0])
ABOUT_E3 = np.array([-1.0, -1.0, 1.0])
REVERSED = np.array([-1.0, 1.0, -1.0])  # of d1, d2, d3


def full_ring(system: Collocation, at: Solution, n_edges: int) -> tuple[Array, Array]:
    """Vertices (N, 3) and frames (N, 3, 3), rows d1, d2, d3, of the full ring.

    Edge 0 is the first grip's, vertex j joins edges j and j + 1, whose frames stand at `sites`; the
    origin is midway between the grips. Interpolated on halved intervals, with an error of (h/2)^5.
    """
    at = _finer(system, at)
    s = sites(system.sector.ring, n_edges, "full")
    return _places(system, at, 0.5 * (s[:-1] + s[1:])), _frames(system, at, s[:-1])


def at_vertices(
    system: Collocation, at: Solution, n_edges: int
) -> tuple[Array, Array, Array, Array]:
    """Places (2, 3) of the grips; of the vertices places, frames (N, 3, 3), and k1u (N,)."""
    at, ring = _finer(system, at), system.sector.ring
    s = sites(ring, n_edges, "full")
    s = 0.5 * (s[:-1] + s[1:])
    grips = _places(system, at, np.array([0.0, 0.5 * ring.length]))
    return grips, _places(system, at, s), _frames(system, at, s), ring.curvature(s)


def _finer(system: Collocation, at: Solution) -> Solution:
    """The solution on halved intervals; itself where that is not found."""
    fine = system.on(at.mesh.halved, at)
    return fine if isinstance(fine, Solution) else at


def _folded(system: Collocation, s: Array) -> tuple[Array, Flags, Flags]:
    """Place on the sector for each arc length of the ring, and which half-turns lead back."""
    ring, sector = system.sector.ring, system.sector
    arm = s > 0.5 * ring.length
    s = np.where(arm, ring.length - s, s)
    near = np.zeros(len(s), dtype=bool)
    if sector.piece.quarter:
        near = s < sector.begin
        s = np.where(near, 2.0 * sector.begin - s, s)
    return s - sector.begin, near, arm


def _places(system: Collocation, at: Solution, s: Array) -> Array:
    """Positions (k, 3)."""
    inside, near, arm = _folded(system, s)
    i, weights = _integrals(system, at, inside)
    d3 = np.einsum("ij,ijk->ik", weights, directors(at.frames)[i, :, 2])
    x = at.places[i] + at.mesh.h[i, None] * d3
    end = at.places[-1]
    x -= np.array([0.0, end[1], 0.0]) if system.sector.piece.quarter else 0.5 * end
    x[near] *= ABOUT_E2
    x[arm] *= ABOUT_E3
    return np.asarray(x)


def _frames(system: Collocation, at: Solution, s: Array) -> Array:
    """Directors (k, 3, 3)."""
    inside, near, arm = _folded(system, s)
    q = moved_to(at.mesh, at.nodes[:-1], at.frames, inside)
    d = directors(q / np.linalg.norm(q, axis=1, keepdims=True))
    d[near] *= REVERSED[:, None] * ABOUT_E2
    d[arm] *= REVERSED[:, None] * ABOUT_E3
    return d


def _integrals(system: Collocation, at: Solution, s: Array) -> tuple[Places, Array]:
    """Interval of each arc length, and weights of its stages for the integral from its left end."""
    nodes, points = at.mesh.nodes, system.rule.points
    i: Places = np.clip(np.searchsorted(nodes, s, side="right") - 1, 0, len(nodes) - 2)
    u = (s - nodes[i]) / at.mesh.h[i]
    # integrals from 0 to u of the stages' polynomials, by the rule itself on [0, u]
    inner = interpolation(points, (u[:, None] * points).ravel()).reshape(*u.shape, -1, len(points))
    weights: Array = u[:, None] * np.einsum("j,ujk->uk", system.rule.weights, inner)
    return i, weights


def directors(q: Array) -> Array:
    """Rows d1, d2, d3 of each frame (..., 4), as in (A.10)."""
    a, b, c, d = np.moveaxis(q, -1, 0)
    rows = [
        [a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)],
        [2 * (b * c - a * d), a * a - b * b + c * c - d * d, 2 * (c * d + a * b)],
        [2 * (b * d + a * c), 2 * (c * d - a * b), a * a - b * b - c * c + d * d],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1)).copy()


def moments(system: Collocation, at: Solution, d: Array) -> Array:
    """Moments m0 + F x r (n, m, 3) at the stages, whose directors are ``d``."""
    constants = system.sector.piece.loads @ at.p
    inner = np.einsum("jl,ilk->ijk", system.rule.partial, d[:, :, 2])
    x = at.places[:-1, None] + at.mesh.h[:, None, None] * inner
    return np.asarray(constants[:3] + np.cross(constants[3:], x))


def turning(system: Collocation, at: Solution) -> float:
    """Integral of k1 over the full ring [rad]."""
    sector, mesh, d = system.sector, at.mesh, directors(at.frames)
    bending = (d[:, :, 0] * moments(system, at, d)).sum(axis=2)
    k1 = mesh.rest + bending / sector.piece.stiffness[0]
    return sector.copies * float((mesh.h[:, None] * system.rule.weights * k1).sum())
