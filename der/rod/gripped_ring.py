"""A gripped ring as a rod: the smallest piece that its symmetry allows, or the whole.

The ring lies in the plane (E2, E3) and is twisted about E3 by two grips, at s = 0 (-E3) turning by
+gamma and at s = L/2 (+E3) by -gamma. A grip holds the edge whose middle it sits on, its frame
and its length, and slides along E3. Half-turns that map a twisted ring onto itself:

    about E3   swaps the arms,   s -> L - s           (all rings)
    about E2   swaps the grips,  s -> L/2 - s         (D2: circle, ellipse, rectangle)

so that the ring is made of 2 halves (grip to grip) or 4 quarters (free point to grip). Grips, free
points and jumps of curvature hold a frame at every resolution (`sites`).

The clamped grips join the arms through the grip distance alone. Hence the modes of the full ring:

    in phase      both arms alike: one arm with the slide free
    out of phase  arms opposed: one arm with the slide held
    odd           under an arm's own half-turn: the slide rests by itself, so they come in pairs
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from der.geometry.mesh import sites
from der.geometry.ring import Ring
from der.geometry.section import Section
from der.kernels.linking import link, unfold, unfold_lengths, vertices
from der.kernels.quaternions import Array, rotation
from der.rod.rod import Rod, State, rod
from der.rod.stability import Stack, SymmetryClass, stack
from der.rod.supports import Supports, supports
from der.scene import COPIES, sector_name

E1, E2, E3 = np.eye(3)


@dataclass(frozen=True)
class Sector:
    """A piece of a gripped ring, ready to be solved."""

    name: str
    copies: int  # how many make the ring
    body: Rod
    held: Supports
    start: State  # the flat ring, gamma = 0
    classes: dict[str, tuple[int, SymmetryClass]]  # label -> (multiplicity, modes)
    arc_length: Array  # (n,) of the frames along the ring

    @cached_property
    def modes(self) -> Stack:
        """The modes of all classes."""
        return stack([modes for _, modes in self.classes.values()])

    @cached_property
    def turning(self) -> float:
        """Mass of the frames that turn with the load, times the square of how fast."""
        return float(self.body.mass[:, 0] @ self.held.turn**2)

    def moment(self, generalised: float) -> float:
        """M of one arm, from dL/dgamma of the piece: M = (1/4) dU/dgamma of the full ring."""
        return 0.25 * self.copies * generalised

    def lengths(self, state: State) -> Array:
        """Present lengths (n,) of the sector's edges."""
        return self.body.length * (1.0 + state.stretch)

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


def sector(
    ring: Ring,
    section: Section,
    n_edges: int,
    *,
    name: str = "auto",
    measure: str = "logarithm",
    stretching: float = 0.0,
) -> Sector:
    """The sector of a gripped ring with ``n_edges`` edges in the full ring.

    Parameters
    ----------
    name : "full", "half" (one arm), "quarter" (D2 rings), or "auto", the smallest there is.
    stretching : EA in GJ/a^2; 0 for an inextensible ring.

    Raises
    ------
    ValueError
        Where ``n_edges`` does not divide, or the ring lacks the symmetry.
    """
    name = sector_name(ring, name, n_edges)
    joints = sites(ring, n_edges, name)
    closed = name == "full"
    s = joints[:-1] if closed else joints
    body = rod(
        np.diff(joints),
        np.diff(ring.natural_angle(joints)),
        (section.alpha, section.beta, 1.0),
        stretching=stretching,
        measure=measure,
        closed=closed,
    )
    angle = 0.5 * (ring.angle(s) - 0.5 * np.pi)  # half the turn about E1 from d3 = E3
    quat = np.stack([np.cos(angle), np.sin(angle), 0.0 * s, 0.0 * s], axis=1)
    held, classes = {"full": _full, "half": _half, "quarter": _quarter}[name](body)
    start = State(quat, np.zeros(len(s)), np.zeros(len(held.target)), 0.0)
    return Sector(name, COPIES[name], body, held, start, classes, s)


Classes = dict[str, tuple[int, SymmetryClass]]


def _class(free: NDArray[np.bool_], weight: Array, *axes: Array) -> SymmetryClass:
    return SymmetryClass(free, np.array([weight] * len(axes)), np.array(axes))


def _full(body: Rod) -> tuple[Supports, Classes]:
    n, half = body.n_edges, body.n_edges // 2
    arm = np.zeros((2, n))
    arm[0, 1:half] = 1.0
    arm[1, half + 1 :] = 1.0
    arm[:, [0, half]] = 0.5
    conditions = [(arm[k], axis, 0.0) for k in (0, 1) for axis in (E1, E2)]
    conditions.append((arm[0] + arm[1], E3, 0.0))  # both arms span the same grip distance
    held = supports(body, clamped=(0, half), held=tuple(conditions), turn={0: 1.0, half: -1.0})
    return held, {"all": (1, SymmetryClass(held.free, held.weight, held.axis))}


def _half(body: Rod) -> tuple[Supports, Classes]:
    end = body.n_edges - 1
    one = np.ones(end + 1)
    held = supports(
        body,
        clamped=(0, end),
        held=((one, E1, 0.0), (one, E2, 0.0)),
        turn={0: 1.0, end: -1.0},
    )
    return held, {
        "in phase": (1, _class(held.free, one, E1, E2)),
        "out of phase": (1, _class(held.free, one, E1, E2, E3)),
    }


def _quarter(body: Rod) -> tuple[Supports, Classes]:
    end = body.n_edges - 1
    one = np.ones(end + 1)
    held = supports(body, clamped=(end,), held=((one, E1, 0.0),), turn={end: -1.0})
    odd = held.free.copy()
    # the free point: a mode that the half-turn keeps turns about d2 = E2 there, others about d1, d3
    held.free[0] = [False, True, False, True][: body.block]
    odd[0] = [True, False, True, False][: body.block]
    return held, {
        "in phase": (1, _class(held.free, one, E1)),
        "out of phase": (1, _class(held.free, one, E1, E3)),
        "odd": (2, _class(odd, one, E2)),
    }


def free_ring(body: Rod) -> Supports:
    """Supports of a closed rod without grips: it has to stay closed, and nothing else.

    The frame of edge 0 is held, which takes out rigid rotations; translations are no unknowns.
    """
    one = np.ones(body.n_edges)
    held = supports(body, clamped=(0,), held=((one, E1, 0.0), (one, E2, 0.0), (one, E3, 0.0)))
    held.free[0, 3:] = True
    return held
