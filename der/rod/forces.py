"""Internal forces and moments of a gripped ring, and those of its grips, from its equilibria.

The multipliers of the position conditions are minus the internal force F: the Lagrangian has
+ F_k e_j . axis_k, and an outside force P at the end of a rod has the potential -P . r. The moment
m of a vertex is the derivative of its energy along a rotation of the edge behind it. Equilibrium of
edge j is m_j - m_(j-1) + e_j x F = 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from der.kernels.quaternions import Array
from der.problem import Point
from der.records.configurations import Internal
from der.records.forces import ABOUT_E2, ABOUT_E3, Forces
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State, edges, moments, strains


def forces(ring: GrippedRing, points: Sequence[Point[Equilibrium]]) -> Forces:
    """Return forces and moments of grips and arms at every point."""
    states = [point.solution.state for point in points]
    force, begin, end = (
        np.array(parts) for parts in zip(*(_arms(ring, state) for state in states), strict=True)
    )
    if ring.copies == 1:
        return Forces.of_arms(force, begin, end)
    return Forces.of_sector(force[:, 0], begin[:, 0], end[:, 0], ring.copies)


def internal(ring: GrippedRing, points: Sequence[Point[Equilibrium]]) -> Internal:
    """Return force, moment and strains at the vertices of the full ring, at every point."""
    found = [_along(ring, point.solution.state) for point in points]
    force, moment, curvature, stretch = (np.array(part) for part in zip(*found, strict=True))
    return Internal(force, moment, curvature, stretch)


def arm_forces(ring: GrippedRing, state: State) -> Array:
    """Return F (k, 3) in each arm of the sector, GJ/a^2; k is 2 for the full ring, else 1."""
    held = ring.supports
    inside = [1, ring.rod.n_edges // 2 + 1] if ring.copies == 1 else [1]
    return -np.einsum("k,kj,ki->ji", state.force, held.weight[:, inside], held.axis)


def _arms(ring: GrippedRing, state: State) -> tuple[Array, Array, Array]:
    """F and m at both ends of each arm of the sector, (k, 3) each."""
    force, at_vertices, edge = (
        arm_forces(ring, state),
        moments(ring.rod, state),
        edges(ring.rod, state),
    )
    n = len(edge)
    half = n // 2
    # a grip or free point is the middle of its edge; the sector's end edges are halves already
    first, last, share = ([0, half], [half, 0], 0.5) if ring.copies == 1 else ([0], [n - 1], 1.0)
    begin = at_vertices[first] + np.cross(share * edge[first], force)
    before = np.array(last) - 1
    end = at_vertices[before] - np.cross(share * edge[last], force)
    return force, begin, end


def _along(ring: GrippedRing, state: State) -> tuple[Array, Array, Array, Array]:
    """F, m, curvatures (N, 3) at the vertices, and stretch (N,) of the edges of the full ring."""
    moment, arm = moments(ring.rod, state), arm_forces(ring, state)
    curvature = strains(ring.rod, state)[0] / ring.rod.cell[:, None]
    force = np.repeat(arm, len(moment) // len(arm), axis=0)
    if ring.copies == 4:
        force, moment = (_extended(values, -ABOUT_E2) for values in (force, moment))
        curvature = _extended(curvature, _REVERSED)
    if ring.copies > 1:
        force, moment = (_extended(values, -ABOUT_E3, behind=True) for values in (force, moment))
        curvature = _extended(curvature, _REVERSED, behind=True)
    stretch = ring.full_lengths(state) / ring.full_lengths(ring.start) - 1.0
    return force, moment, curvature, stretch


# a half-turn keeps k1 and k3 of the reversed ring, and changes the sign of k2
_REVERSED = np.array([1.0, -1.0, 1.0])


def _extended(values: Array, signs: Array, *, behind: bool = False) -> Array:
    """Values (n, 3) at vertices, with those of the mirrored vertices before or behind them."""
    mirrored = signs * values[::-1]
    return np.concatenate([values, mirrored] if behind else [mirrored, values])
