"""A planar ring as a discrete rod: the rod, initial guesses and shapes.

All states are symmetric about the twisting axis, as every ring is. With uniform natural curvature a
planar closed elastica is a circle, covered T times, or a figure eight at any place along the ring.
For other rings these are initial guesses: the uniform natural curvature is changed step by step
into the ring's own. A figure eight then keeps its place if one of its two axes of symmetry is the
twisting axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from der.continuation.roots import find_root
from der.geometry.mesh import kink_offsets, natural_turning, sites
from der.geometry.ring import Ring
from der.kernels.planar import Array, PlanarRod
from der.records.configurations import Shapes
from der.scene import Scene

_UNIFORM = 1e-9  # rad: turnings and cells that are equal


@dataclass(frozen=True, eq=False)
class PlanarRing:
    """The mesh of a planar ring; EI1 is 1."""

    ring: Ring
    places: Array  # (N + 1,) arc lengths of the frames, the first at both ends
    cell: Array  # (N,) between them
    length: Array  # (N,) of the edges
    rest: Array  # (N,) natural turning, rad
    kinks_in_cells: bool  # of the natural curvature: errors are not even in the cells' length

    @property
    def n_edges(self) -> int:
        """Edges of the ring."""
        return len(self.cell)

    @property
    def uniform(self) -> bool:
        """Whether cells and natural curvature are uniform."""
        return bool(np.ptp(self.rest) < _UNIFORM and np.ptp(self.cell) < _UNIFORM)

    @property
    def natural(self) -> Array:
        """Tangent angles (N,) of the stress-free ring, cut open; 0 at the first grip."""
        return np.append(0.0, np.cumsum(self.rest[:-1]))

    @property
    def share(self) -> Array:
        """Arc lengths (N,) of the frames, over the length of the ring."""
        return self.places[:-1] / self.places[-1]

    def chord(self) -> Array:
        """Weights (N,) of the edges in the chord between the two points on the twisting axis.

        The points are the middles of edges 0 and N/2.
        """
        return chord_weights(self.cell, self.length, self.n_edges // 2)

    def rod(self, turning: int, rest: Array | None = None, rate: Array | None = None) -> PlanarRod:
        """The free ring with turning number ``turning``.

        Parameters
        ----------
        rest, rate : (N,) natural turning at load 0, and its change per unit of load. Default: that
            of the ring, and 0.
        """
        n = self.n_edges
        free = np.ones(n, dtype=bool)
        free[0] = False
        return PlanarRod(
            1.0 / self.cell,
            self.rest if rest is None else rest,
            np.zeros(n) if rate is None else rate,
            2.0 * math.pi * turning,
            self.length,
            np.zeros(n),
            self.length / self.length.sum(),
            np.ones((1, n)),
            free,
        )

    def strutted(self) -> PlanarRod:
        """The flat ring with a strut between its points on the axis; the load is its length.

        The strut is one more edge without bending stiffness, free to turn.
        """
        body, n = self.rod(1), self.n_edges
        strut = np.zeros(n + 1)
        strut[-1] = 1.0
        return body._replace(
            length=np.append(body.length, 0.0),
            reach=strut,
            mass=np.append(body.mass, 0.0),  # rotations of the strut do not count in norms
            weight=np.array([1.0 - strut, np.append(self.chord(), -1.0)]),
            free=np.append(body.free, True),
        )

    def positions(self, phi: Array) -> Array:
        """Vertices (N, 2) of the ring with tangents at ``phi``: across the axis, and along it.

        The first grip lies on the axis, with the second as far up as the first is down.
        """
        edges = self.length[:, None] * np.column_stack([np.cos(phi), np.sin(phi)])
        x = np.cumsum(edges, axis=0) - edges[0] + 0.5 * self.cell[0] / self.length[0] * edges[0]
        up = float((self.chord() @ edges)[1])
        return np.asarray(x - [0.0, 0.5 * up])


def chord_weights(cell: Array, length: Array, end: int) -> Array:
    """Weights (n,) of edges whose sum is the chord from the middle of edge 0 to that of ``end``."""
    weight = np.zeros(len(length))
    weight[1:end] = 1.0
    weight[0] = 0.5 * cell[0] / length[0]
    weight[end] = 0.5 * cell[end - 1] / length[end]
    return weight


def planar_ring(scene: Scene, n_edges: int | None = None) -> PlanarRing:
    """The ring of a scene on its mesh, or on a coarser one."""
    n = scene.n_edges if n_edges is None else n_edges
    places = sites(scene.ring, n, "full", scene.n_edges)
    cell = np.diff(places)
    rest = natural_turning(scene.ring, places)
    length = 0.5 * (cell + np.roll(cell, 1))
    uneven = bool(kink_offsets(scene.ring, places).any())
    return PlanarRing(scene.ring, places, cell, length, rest, uneven)


def covered(mesh: PlanarRing, turning: int) -> Array:
    """Tangent angles (N,) of the ring bent uniformly until its turning number is ``turning``."""
    more = 2.0 * math.pi * turning - float(mesh.rest.sum())
    return mesh.natural + more * mesh.share


def eight(mesh: PlanarRing, shift: float) -> Array:
    """Tangent angles (N,) of a figure eight; ``shift`` in turns, 0 and 1/4 are symmetric."""
    theta = eight_angles(np.append(shift, shift + mesh.share))
    return theta[1:] - theta[0]


def eight_angles(places: Array) -> Array:
    """Tangent angles (n,) of a figure eight at arc lengths over its length.

    Notes
    -----
    The tangent angle theta of an inflectional elastica is sin(theta/2) = k sn(u), one period of
    4 K(k) to the length; it closes where 2 E(k) = K(k) (Love 1927, 263). At u = 0 the strands
    cross, at u = K the curvature is largest.
    """
    from scipy.special import ellipe, ellipj, ellipk

    m = find_root(lambda m: float(2.0 * ellipe(m) - ellipk(m)), 0.5, 0.95)
    return np.asarray(2.0 * np.arcsin(math.sqrt(m) * ellipj(4.0 * ellipk(m) * places, m)[0]))


def shifted(mesh: PlanarRing, phi: Array) -> Array:
    """Rates (N,) at which tangents turn when material shifts along the curve, edge 0 held."""
    turn = (np.roll(phi, -1) - phi) / mesh.cell
    turn[-1] = (phi[0] - phi[-1] + 2.0 * math.pi * round((phi[-1] - phi[0]) / (2.0 * math.pi))) / (
        mesh.cell[-1]
    )
    rate = 0.5 * (turn + np.roll(turn, 1))
    return np.asarray(rate - rate[0])


def shapes(mesh: PlanarRing, angles: list[Array]) -> Shapes:
    """Vertices and frames in space: the ring lies in (E2, E3), d1 is E1, d2 points outwards."""
    x = np.zeros((len(angles), mesh.n_edges, 3))
    frames = np.zeros((len(angles), mesh.n_edges, 3, 3))
    frames[:, :, 0, 0] = 1.0
    for k, phi in enumerate(angles):
        x[k, :, 1:] = mesh.positions(phi)
        cosine, sine = np.cos(phi), np.sin(phi)
        frames[k, :, 1, 1], frames[k, :, 1, 2] = sine, -cosine
        frames[k, :, 2, 1], frames[k, :, 2, 2] = cosine, sine
    return Shapes(x, frames, arc_length=mesh.places[:-1])
