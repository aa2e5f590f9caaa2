"""A gripped ring as a rod: the smallest sector that its symmetry allows, or the full ring.

The ring lies in the plane (E2, E3) and is twisted about E3 by two grips, at s = 0 (-E3) turning by
+gamma and at s = L/2 (+E3) by -gamma. A grip holds the edge whose middle it sits on, its frame
and its length, and slides along E3. Half-turns that map a twisted ring onto itself:

    about E3   swaps the arms,   s -> L - s           (all rings)
    about E2   swaps the grips,  s -> L/2 - s         (D2: circle, ellipse, rectangle)

so that the ring is made of 2 halves (grip to grip) or 4 quarters (free point to grip). Grips, free
points, jumps and kinks of curvature hold a frame at every resolution (`sites`).

The clamped grips join the arms through the grip distance alone. Hence the modes of the full ring:

    in phase      both arms alike: one arm with the slide free
    out of phase  arms opposed: one arm with the slide held
    odd           under an arm's own half-turn: the slide does not move, so they come in pairs
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from der.geometry.mesh import CLOSE, kink_offsets, natural_turning, sites
from der.geometry.ring import Ring
from der.geometry.section import Section
from der.kernels.linking import link, unfold, unfold_lengths, vertices
from der.kernels.quaternions import Array, rotation, rotation_vector
from der.rod.equilibrium import Equilibrium
from der.rod.rod import Rod, State, discrete_rod
from der.rod.stability import SymmetryClass
from der.rod.supports import Supports, supported
from der.rod.system import RodSystem
from der.scene import COPIES, sector_name

E1, E2, E3 = np.eye(3)
_PLANAR = 1e-6  # a, and turns: a state that is planar


@dataclass(frozen=True)
class GrippedRing(RodSystem):
    """A gripped ring on one of its symmetry sectors; its load is gamma."""

    name: str  # of the sector
    copies: int  # how many of the sector make the ring
    start: State  # the flat ring, gamma = 0
    symmetry: Mapping[str, tuple[int, SymmetryClass]]  # label -> (multiplicity, modes)
    arc_length: Array  # (n,) of the frames along the ring
    breaks: Array  # jumps of the curvature, as fractions of the ring's edges
    kinks_in_cells: bool  # of the natural curvature: errors are not even in the cells' length
    parameter_name: str = field(default="gamma", kw_only=True)

    @cached_property
    def modes(self) -> Mapping[str, SymmetryClass]:
        """Modes by symmetry class; the first class keeps the symmetry of the sector."""
        return {label: modes for label, (_, modes) in self.symmetry.items()}

    @cached_property
    def classes(self) -> Mapping[str, int]:
        """How often the modes of each class count in the full ring."""
        return {label: count for label, (count, _) in self.symmetry.items()}

    @property
    def n_edges(self) -> int:
        """Edges of the full ring."""
        return self.copies * len(self.rod.cell)

    @property
    def length(self) -> float:
        """Length of the full ring."""
        return self.copies * float(self.rod.length.sum())

    @cached_property
    def turning(self) -> float:
        """Mass of the frames that turn with the load, times the square of how fast."""
        return float(self.rod.mass[:, 0] @ self.supports.turn**2)

    def arm_moment(self, conjugate: float) -> float:
        """M of one arm, from dL/dgamma of the sector: M = (1/4) dU/dgamma of the full ring."""
        return 0.25 * self.copies * conjugate

    def values(self, at: Equilibrium) -> tuple[float, float, float]:
        """Return gamma [rad], M of one arm [GJ/a] and U of the full ring [GJ/a]."""
        return at.parameter, self.arm_moment(at.moment), self.copies * at.energy

    def lengths(self, state: State) -> Array:
        """Present lengths (n,) of the sector's edges."""
        return self.rod.length * (1.0 + state.stretch)

    def full_frames(self, state: State) -> Array:
        """Frames (N, 4) of all edges of the ring, from the first grip on."""
        return unfold(state.quat, self.copies)

    def full_lengths(self, state: State) -> Array:
        """Present lengths (N,) of all edges of the ring."""
        return unfold_lengths(self.lengths(state), self.copies)

    def shape(self, state: State) -> tuple[Array, Array]:
        """Vertices (N, 3) of the ring and frames (N, 3, 3), rows d1, d2, d3, of its edges.

        Vertex j joins edges j and j + 1, edge 0 is the first grip's; the origin is midway between
        the grips.
        """
        return self.vertices(state), rotation(self.full_frames(state)).swapaxes(1, 2)

    def vertices(self, state: State) -> Array:
        """Vertices (N, 3) of the ring, as in `shape`."""
        x: Array = vertices(self.full_frames(state), self.full_lengths(state))
        return x

    def link(self, state: State) -> int:
        """Linking number of the ring."""
        return link(state.quat, self.lengths(state), self.copies)[0]

    def turning_number(self, state: State) -> int | None:
        """Turning number of a planar state, to 1e-6, < 0 if flipped; None: not planar."""
        x = self.vertices(state)
        quat = state.quat
        # not the strains: some measures of curvature are no angles
        angle = rotation_vector(quat, np.roll(quat, -1, axis=0))[: len(self.rod.cell), 0]
        count = self.copies * float(angle.sum()) / (2.0 * np.pi)
        planar = float(np.ptp(x[:, 0])) < _PLANAR and abs(count - round(count)) < _PLANAR
        return round(count) if planar else None

    def folded(self, state: State) -> bool:
        """Whether a state is the folded ring: planar, three-covered."""
        return self.turning_number(state) == 3

    def overlaps(self, state: State) -> bool:
        """Whether a state is planar and crosses or covers itself: then no link is defined."""
        return self.turning_number(state) not in (None, 1, -1)

    def own_class(self) -> GrippedRing:
        """Return the same with only the modes that the sector itself can follow."""
        first = next(iter(self.symmetry))
        return replace(self, symmetry={first: self.symmetry[first]})


def gripped_ring(
    ring: Ring,
    section: Section,
    n_edges: int,
    *,
    name: str = "auto",
    measure: str = "logarithm",
    stretching: float = 0.0,
    finest: int | None = None,
) -> GrippedRing:
    """Return a sector of a gripped ring with ``n_edges`` edges in the full ring.

    Parameters
    ----------
    name : "full", "half" (one arm), "quarter" (D2 rings), or "auto", the smallest possible.
    stretching : EA in GJ/a^2; 0 for an inextensible ring.
    finest : edges of the mesh of which this is a coarser one, see `sites`.

    Raises
    ------
    ValueError
        If ``n_edges`` is not divisible, or the ring lacks the symmetry.
    """
    name = sector_name(ring, name, n_edges)
    joints = sites(ring, n_edges, name, finest)
    closed = name == "full"
    s = joints[:-1] if closed else joints
    rod = discrete_rod(
        np.diff(joints),
        natural_turning(ring, joints),
        (section.alpha, section.beta, 1.0),
        stretching=stretching,
        measure=measure,
        closed=closed,
    )
    offsets = kink_offsets(ring, joints)
    turned = ring.angle(s) + offsets[: len(s)]
    angle = 0.5 * (turned - 0.5 * np.pi)  # half the turn about E1 from d3 = E3
    quat = np.stack([np.cos(angle), np.sin(angle), 0.0 * s, 0.0 * s], axis=1)
    supports, classes = {"full": _full, "half": _half, "quarter": _quarter}[name](rod)
    half_turns = _half_turns(name, len(s), ring.symmetry == "D2")
    classes = {
        label: (count, modes._replace(half_turns=half_turns))
        for label, (count, modes) in classes.items()
    }
    start = State(quat, np.zeros(len(s)), np.zeros(len(supports.target)), 0.0)
    return GrippedRing(
        *(rod, supports, name, COPIES[name], start, classes, s),
        breaks=_breaks(ring, n_edges, finest),
        kinks_in_cells=bool(offsets.any()),
    )


def _breaks(ring: Ring, n_edges: int, finest: int | None) -> Array:
    """Edges where the curvature jumps, over the number of edges.

    At the grips, where the moment about E3 jumps by 2 M, and with the natural curvature.
    """
    if not ring.breaks:
        return np.array([0.0, 0.5])
    at = sites(ring, n_edges, "full", finest)[:-1]
    jumps = np.sort([0.0, 0.5 * ring.length, ring.length, *ring.breaks])
    k = np.searchsorted(jumps, at, side="right")
    away = np.minimum(at - jumps[k - 1], jumps[k] - at)
    return np.flatnonzero(away < CLOSE * ring.length) / n_edges


Classes = dict[str, tuple[int, SymmetryClass]]


def _class(free: NDArray[np.bool_], weight: Array, *axes: Array) -> SymmetryClass:
    return SymmetryClass(free, np.array([weight] * len(axes)), np.array(axes))


def _half_turns(name: str, n: int, twofold: bool) -> NDArray[np.int64]:
    """Edges (g, n) to which the half-turns lead that map a sector onto itself.

    ``twofold``: whether the one about E2 maps the ring onto itself.
    """
    j = np.arange(n)
    found = [-j % n] if name == "full" else []
    if twofold and name != "quarter":
        found.append((n // 2 - j) % n if name == "full" else n - 1 - j)
    return np.array(found, dtype=np.int64).reshape(-1, n)


def _full(rod: Rod) -> tuple[Supports, Classes]:
    n, half = rod.n_edges, rod.n_edges // 2
    arm = np.zeros((2, n))
    arm[0, 1:half] = 1.0
    arm[1, half + 1 :] = 1.0
    arm[:, [0, half]] = 0.5
    conditions = [(arm[k], axis, 0.0) for k in (0, 1) for axis in (E1, E2)]
    conditions.append((arm[0] + arm[1], E3, 0.0))  # both arms span the same grip distance
    supports = supported(rod, clamped=(0, half), held=tuple(conditions), turn={0: 1.0, half: -1.0})
    return supports, {"all": (1, SymmetryClass(supports.free, supports.weight, supports.axis))}


def _half(rod: Rod) -> tuple[Supports, Classes]:
    end = rod.n_edges - 1
    one = np.ones(end + 1)
    supports = supported(
        rod, clamped=(0, end), held=((one, E1, 0.0), (one, E2, 0.0)), turn={0: 1.0, end: -1.0}
    )
    return supports, {
        "in phase": (1, _class(supports.free, one, E1, E2)),
        "out of phase": (1, _class(supports.free, one, E1, E2, E3)),
    }


def _quarter(rod: Rod) -> tuple[Supports, Classes]:
    end = rod.n_edges - 1
    one = np.ones(end + 1)
    supports = supported(rod, clamped=(end,), held=((one, E1, 0.0),), turn={end: -1.0})
    odd = supports.free.copy()
    # the free point: a mode that the half-turn keeps turns about d2 = E2 there, others about d1, d3
    supports.free[0] = [False, True, False, True][: rod.block]
    odd[0] = [True, False, True, False][: rod.block]
    return supports, {
        "in phase": (1, _class(supports.free, one, E1)),
        "out of phase": (1, _class(supports.free, one, E1, E3)),
        "odd": (2, _class(odd, one, E2)),
    }


def free_supports(rod: Rod) -> Supports:
    """Supports of a closed rod without grips: the conditions of closure alone.

    The frame of edge 0 is held, which removes rigid rotations; translations are no unknowns.
    """
    one = np.ones(rod.n_edges)
    supports = supported(rod, clamped=(0,), held=((one, E1, 0.0), (one, E2, 0.0), (one, E3, 0.0)))
    supports.free[0, 3:] = True
    return supports
