"""The discrete rod and its state, without loads or supports.

Edges j = 0 .. n-1 carry material frames, vertices s between neighbouring edges carry the strains.
Frames sit at arc lengths with spacing ``cell[s]`` (the Voronoi length of vertex s); an edge's rest
length is half of the cells on its two sides. So an end edge of an open rod is half an edge: the
other half lies beyond the end, or beyond a plane of symmetry. All ends, clamped, free or mirrored,
are therefore treated in the same way, and the error of smooth rods has even powers of the cell
only.

    ends    |-o---|---o---|---o-|        o vertex, | middle of an edge (its frame)
    closed  the last vertex joins edge n-1 to edge 0
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.kernels.quaternions import Array, relative, rotation
from der.kernels.strain import vertex_energy
from der.scene import MEASURES


class Rod(NamedTuple):
    """A rod's constants, in units of a and GJ/a; built by `discrete_rod` (kernels take it)."""

    cell: Array  # (n_s,) Voronoi length of each vertex
    length: Array  # (n,) rest length of each edge
    mass: Array  # (n, 1) the same over their sum: weights of the edges in norms
    rest: Array  # (n_s, 3) natural integrated strains kappa1, kappa2, twist [rad]
    stiffness: Array  # (3,) EI1, EI2, GJ
    stretching: float  # EA; 0 where the rod is inextensible
    measure: int  # index into scene.MEASURES
    closed: bool  # whether the last vertex joins the last edge to the first

    @property
    def n_edges(self) -> int:
        """Number of edges."""
        return len(self.length)

    @property
    def block(self) -> int:
        """Unknowns per edge: a rotation vector, and the stretch where the rod is extensible."""
        return 4 if self.stretching > 0.0 else 3


class State(NamedTuple):
    """One configuration of a rod; arrays are never written to after construction."""

    quat: Array  # (n, 4) material frame of each edge
    stretch: Array  # (n,) strain of each edge, its length over its rest length, less 1
    force: Array  # (n_c,) multipliers of the position conditions: internal forces, in GJ/a^2
    load: float  # rotation of a grip [rad], or the factor of the dead load

    def but(self, **changes: object) -> State:
        """Copy with some entries replaced."""
        return self._replace(**changes)  # type: ignore[arg-type]


def discrete_rod(
    cell: Array,
    rest: Array,
    stiffness: tuple[float, float, float],
    *,
    stretching: float = 0.0,
    measure: str = "logarithm",
    closed: bool = False,
) -> Rod:
    """A rod from its cells and natural strains.

    Parameters
    ----------
    cell : (n_s,) arc length between the frames on both sides of each vertex, > 0.
    rest : (n_s,) natural turning kappa1 of each cell, or (n_s, 3) all natural strains [rad].
    stiffness : EI1, EI2, GJ.
    stretching : EA; 0 for an inextensible rod.
    measure : one of `scene.MEASURES`.
    closed : whether the last vertex joins the last edge to the first.

    Raises
    ------
    ValueError
        For shapes that do not fit, cells or stiffnesses that are not positive, unknown measures.
    """
    cell = np.ascontiguousarray(cell, dtype=float)
    strains = np.zeros((len(cell), 3))
    rest = np.asarray(rest, dtype=float)
    if rest.shape == cell.shape:
        strains[:, 0] = rest
    elif rest.shape == strains.shape:
        strains[:] = rest
    else:
        raise ValueError(f"rest has shape {rest.shape}; allowed are {cell.shape}, {strains.shape}")
    if not (np.all(cell > 0.0) and np.all(np.isfinite(cell))):
        raise ValueError(f"cell lengths must be finite and > 0, got a smallest of {cell.min()}")
    if not all(np.isfinite(k) and k > 0.0 for k in stiffness):
        raise ValueError(f"stiffness must be three finite numbers > 0, got {stiffness}")
    if not (np.isfinite(stretching) and stretching >= 0.0):
        raise ValueError(f"stretching must be finite and >= 0, got {stretching}")
    if measure not in MEASURES:
        raise ValueError(f"curvature must be one of {', '.join(MEASURES)}, got {measure!r}")
    if closed:
        length = 0.5 * (cell + np.roll(cell, 1))
    else:
        length = 0.5 * (np.append(cell, 0.0) + np.append(0.0, cell))
    number = MEASURES.index(measure)
    mass = (length / length.sum())[:, None]
    return Rod(cell, length, mass, strains, np.array(stiffness), stretching, number, bool(closed))


def straight(rod: Rod, conditions: int = 0) -> State:
    """Return the straight state of an open rod along E3, at load 0.

    Parameters
    ----------
    conditions : how many position conditions its supports have.
    """
    quat = np.zeros((rod.n_edges, 4))
    quat[:, 0] = 1.0
    return State(quat, np.zeros(rod.n_edges), np.zeros(conditions), 0.0)


def edges(rod: Rod, state: State) -> Array:
    """Edge vectors (n, 3): length times tangent."""
    lengths = rod.length * (1.0 + state.stretch)
    return rotation(state.quat)[:, :, 2] * lengths[:, None]


def strains(rod: Rod, state: State) -> tuple[Array, Array]:
    """Integrated strains kappa1, kappa2, twist (n_s, 3) [rad] and energies (n_s,) of the vertices.

    The energies are those of bending and twisting, in GJ/a.
    """
    kappa, energy, _ = _vertices(rod, state)
    return kappa, energy


def moments(rod: Rod, state: State) -> Array:
    """Moments (n_s, 3) in space that the edge behind each vertex exerts on the one before, GJ/a."""
    behind = np.arange(1, len(rod.cell) + 1) % rod.n_edges
    in_frame = _vertices(rod, state)[2]
    return np.asarray((rotation(state.quat[behind]) @ in_frame[:, :, None])[..., 0])


def _vertices(rod: Rod, state: State) -> tuple[Array, Array, Array]:
    """Strains (n_s, 3), energies (n_s,) and moments (n_s, 3) in the frames of the edges behind."""
    n, n_s = rod.n_edges, len(rod.cell)
    kappa, energy, moment = np.empty((n_s, 3)), np.empty(n_s), np.empty((n_s, 3))
    p, hess = np.empty(4), np.empty((3, 3))
    for s in range(n_s):
        relative(state.quat[s], state.quat[(s + 1) % n], p)
        if p[0] < 0.0:
            p *= -1.0
        stiff = rod.stiffness / rod.cell[s]
        energy[s] = vertex_energy(p, rod.measure, rod.rest[s], stiff, kappa[s], moment[s], hess)
    return kappa, energy, moment
