"""Meshes of a sector, fitted to a solution.

Mesh points sit where the natural curvature is not smooth; between them the intervals share the
(m+1)-th derivative of the solution equally, as in COLSYS and AUTO (de Boor 1973; Ascher, Mattheij &
Russell 1995, section 9.3).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from der.bvp.gauss import Array, Rule, interpolation
from der.bvp.sectors import Sector

FLOOR = 0.25  # of the mean density: no interval is longer than four times the mean


@dataclass(frozen=True, eq=False)
class Mesh:
    """Intervals of a sector, with its natural curvature at their stages."""

    sector: Sector
    rule: Rule
    nodes: Array  # (n + 1,) arc lengths from 0
    h: Array  # (n,)
    stages: Array  # (n, m) arc lengths
    rest: Array  # (n, m) k1u, 1/a

    @cached_property
    def weights(self) -> Array:
        """Weights (n, m, 1) of the mean square of rotations: |dq|^2 is a quarter of theirs."""
        return 4.0 / self.sector.length * (self.h[:, None] * self.rule.weights)[..., None]

    @cached_property
    def halved(self) -> Mesh:
        """The mesh with every interval cut in two."""
        nodes = np.empty(2 * len(self.h) + 1)
        nodes[::2] = self.nodes
        nodes[1::2] = 0.5 * (self.nodes[1:] + self.nodes[:-1])
        return mesh_at(self.sector, self.rule, nodes)


def mesh_at(sector: Sector, rule: Rule, nodes: Array) -> Mesh:
    """The mesh with these mesh points."""
    h = np.diff(nodes)
    stages = nodes[:-1, None] + h[:, None] * rule.points
    return Mesh(sector, rule, nodes, h, stages, sector.curvature(stages))


def first_mesh(sector: Sector, rule: Rule, n: int) -> Mesh:
    """A mesh of about n intervals for the flat ring: by its length and by its turning."""
    s = np.unique(np.concatenate([np.linspace(0.0, sector.length, 16 * n + 1), sector.joints]))
    middle = 0.5 * (s[1:] + s[:-1])
    density = np.abs(sector.curvature(middle)) + 2.0 * np.pi / sector.ring.length
    return mesh_at(sector, rule, distributed(sector, s, density, n))


def fitted(mesh: Mesh, ends: Array, frames: Array, n: int) -> Mesh:
    """A mesh of about n intervals for a solution: left ends (n, 4) and stages (n, m, 4) of it."""
    sector, rule = mesh.sector, mesh.rule
    values = np.concatenate([ends[:, None], frames], axis=1)
    top = np.einsum("j,njk->nk", rule.top, values) / mesh.h[:, None] ** len(rule.points)
    jump = np.linalg.norm(np.diff(top, axis=0), axis=1) / (0.5 * (mesh.h[1:] + mesh.h[:-1]))
    joints = np.isin(mesh.nodes[1:-1], sector.joints)
    jump[joints] = 0.0  # the natural curvature jumps, which is no error
    at_left, at_right = np.append(0.0, jump), np.append(jump, 0.0)
    density = np.maximum(at_left, at_right) ** (1.0 / (len(rule.points) + 1))
    single = (at_left == 0.0) & (at_right == 0.0)  # one interval between two joints
    if single.any():
        scale = np.linalg.norm(top[single], axis=1) / mesh.h[single]
        density[single] = scale ** (1.0 / (len(rule.points) + 1))
    mean = float(np.sum(density * mesh.h)) / sector.length
    if not mean > 0.0:
        density = np.ones_like(density)
        mean = 1.0
    density = np.maximum(density, FLOOR * mean)
    return mesh_at(sector, rule, distributed(sector, mesh.nodes, density, n))


def distributed(sector: Sector, s: Array, density: Array, n: int) -> Array:
    """Mesh points that share a density equally, piecewise constant between ``s``."""
    shares = np.append(0.0, np.cumsum(density * np.diff(s)))
    at_joints = np.interp(sector.joints, s, shares)
    each = shares[-1] / n
    nodes = [0.0]
    for a, b in pairwise(at_joints):
        count = max(1, round((b - a) / each))
        nodes += list(np.interp(np.linspace(a, b, count + 1)[1:], shares, s))
        nodes[-1] = float(sector.joints[np.searchsorted(at_joints, b)])
    return np.array(nodes)


def moved_to(mesh: Mesh, ends: Array | None, frames: Array, s: Array) -> Array:
    """Values at arc lengths ``s`` (any shape) of the collocation polynomials, (..., 4).

    Without the values at the left ``ends`` of the intervals, of one order less.
    """
    flat, rule = s.ravel(), mesh.rule
    i = np.clip(np.searchsorted(mesh.nodes, flat, side="right") - 1, 0, len(mesh.h) - 1)
    sites = rule.points if ends is None else np.append(0.0, rule.points)
    values = frames if ends is None else np.concatenate([ends[:, None], frames], axis=1)
    weights = interpolation(sites, (flat - mesh.nodes[i]) / mesh.h[i])
    return np.einsum("kj,kjc->kc", weights, values[i]).reshape(*s.shape, -1)
