"""Forces and moments of a boundary-value problem's solutions: constants of its equations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from der.bvp.collocation import Collocation, Solution
from der.bvp.full_ring import at_vertices
from der.records.configurations import Internal
from der.records.forces import Forces


def forces(system: Collocation, solutions: Sequence[Solution]) -> Forces:
    """Return forces and moments of grips and arms, of every solution."""
    loads = np.array([system.sector.piece.loads @ at.p for at in solutions])
    begin, force = loads[:, :3], loads[:, 3:]
    along = np.array([at.places[-1] for at in solutions])
    end = begin + np.cross(force, along)
    return Forces.of_sector(force, begin, end, system.sector.copies)


def internal(
    system: Collocation, solutions: Sequence[Solution], found: Forces, n_edges: int
) -> Internal:
    """Return force, moment and strains at the vertices, by m = m0 + F x (r - r0) in each arm.

    Parameters
    ----------
    found : what `forces` returns.
    n_edges : as in `full_ring`.
    """
    arm = np.arange(n_edges) * 2 // n_edges
    force = found.arm_force[:, arm]
    moment, curvature = found.arm_moment[:, arm], np.empty(force.shape)
    for k, at in enumerate(solutions):
        grips, x, d, rest = at_vertices(system, at, n_edges)
        moment[k] += np.cross(force[k], x - grips[arm])
        strain = (d @ moment[k][:, :, None])[..., 0] / system.sector.piece.stiffness
        curvature[k] = strain + rest[:, None] * [1.0, 0.0, 0.0]
    return Internal(force, moment, curvature, np.zeros(force.shape[:2]))
