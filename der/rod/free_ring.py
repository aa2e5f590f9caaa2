"""The free ring: whether a state is an equilibrium once the grips are removed, and its index.

A twisted ring is mapped onto itself by the half-turn about its twisting axis, which swaps the arms.
What the arms exert on a grip is therefore symmetric under it: a force along the axis, which the
free slide makes zero, and a moment about the axis, which is 2 M. So at M = 0 the grips exert
nothing at all, bending moments included: **every state of a twisted ring with M = 0 is an
equilibrium of the free ring**, stable or not. (They still guide: in clamped grips fewer motions are
allowed.)

A ring of uniform natural curvature has one more motion at no cost, where it is not planar: material
shifts along the curve. On the mesh it costs next to nothing, and as the rigid rotations are taken
out by one held frame, it is taken out by holding one unknown, that which it moves most. A null
vector z is not in the hyperplane of such a condition, so the index is that of the other motions.
A naturally straight rod as stiff one way as the other may also spin about its own tangents at no
cost (the seventh mode of the isotropic ring), which is taken out likewise.

Other supports serve as well, such as grips: they leave no motion without cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.kernels.assembly import assemble
from der.kernels.quaternions import Array, rotation, rotation_vector
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, free_supports
from der.rod.rod import Rod, State
from der.rod.supports import Supports
from der.rod.system import RodSystem

BALANCED = 1e-8  # residual over the ring's largest bending stiffness EI/cell: at rest
_UNIFORM = 1e-9  # of strains and cells that are equal
_PLANAR = 1e-6  # of a shift that is a rigid rotation


@dataclass(frozen=True)
class FreeRing:
    """A configuration of the free ring, with the forces that balance it best."""

    rod: Rod  # of the full ring
    supports: Supports  # closed, one frame held; or its grips
    state: State
    residual: float  # largest entry of the gradient, GJ/a

    @property
    def balanced(self) -> bool:
        """Whether it is an equilibrium, to rounding."""
        stiffest = float(self.rod.stiffness.max() / self.rod.cell.min())
        return self.residual <= BALANCED * stiffest

    @property
    def zero_modes(self) -> int:
        """How many motions cost nothing, beyond rigid ones."""
        return len(self._costless())

    def pinned(self, least: float = _PLANAR) -> Supports:
        """The supports with one more unknown held for each motion at no cost.

        Motions that, but for rigid ones, move nothing by more than ``least`` do not count.
        """
        places = self._costless(least)
        if not places:
            return self.supports
        free = self.supports.free.copy()
        for place in places:
            free[place] = False
        return self.supports._replace(free=free)

    def _costless(self, least: float = _PLANAR) -> list[tuple[int, int]]:
        """For each motion at no cost an unknown that it moves: Gauss's elimination."""
        if np.any(self.supports.turn):
            return []
        places: list[tuple[int, int]] = []
        rows: list[Array] = []
        for mode in (shift(self.rod, self.state), spin(self.rod, self.state)):
            for place, row in zip(places, rows, strict=True):
                mode = mode - mode[place] / row[place] * row
            j, i = divmod(int(np.argmax(np.abs(mode))), mode.shape[1])
            if abs(mode[j, i]) > least:
                places.append((j, i))
                rows.append(mode)
        return places

    @property
    def system(self) -> RodSystem:
        """The ring without its motions at no cost."""
        return RodSystem(self.rod, self.pinned())

    @property
    def unpinned(self) -> RodSystem:
        """The ring with all motions that its supports leave free."""
        return RodSystem(self.rod, self.supports)

    def index(self) -> int | None:
        """Return the index, motions at no cost not counted; None: no equilibrium, or singular."""
        if not self.balanced:
            return None
        return self.system.index(self.state)

    def polished(self, tolerance: float = 1e-10) -> Equilibrium:
        """Return the equilibrium next to it, by Newton's method."""
        return self.system.correct(self.state, tolerance=tolerance)


def index_without_grips(
    ring: GrippedRing, full: GrippedRing, state: State, *, tolerance: float = 1e-10
) -> int | None:
    """Return the index of a state of ``ring`` once its grips are removed; None: it would move.

    ``full`` is the full ring on the same mesh. An extensible ring first settles: the grips also
    held the length of their two edges.
    """
    free = released(ring, full, state)
    if not free.balanced and full.rod.stretching > 0.0:
        settled = free.polished(tolerance)
        if settled.converged:
            free = balance(full.rod, settled.state.quat, settled.state.stretch)
    return free.index()


def released(ring: GrippedRing, full: GrippedRing, state: State) -> FreeRing:
    """A state of a sector on ``full``, the full ring of the same mesh, without grips."""
    quat = ring.full_frames(state)
    stretch = ring.full_lengths(state) / full.rod.length - 1.0
    return balance(full.rod, quat, stretch)


def balance(
    rod: Rod, quat: Array, stretch: Array, supports: Supports | None = None, load: float = 0.0
) -> FreeRing:
    """A configuration with the forces that balance it best, in least squares.

    ``held`` are its supports, none but closure if not given, turned to ``load``.
    """
    supports = free_supports(rod) if supports is None else supports
    nothing = np.zeros(len(supports.target))
    system = assemble(rod, supports, quat, stretch, nothing, load)
    free = supports.free.reshape(-1)
    grad = system.grad.reshape(-1)[free]
    border = system.border.reshape(len(free), -1)[free]
    force = -np.linalg.lstsq(border, grad, rcond=None)[0]
    gap = float(np.abs(system.gap).max())
    residual = max(float(np.abs(grad + border @ force).max()), gap)
    return FreeRing(rod, supports, State(quat, stretch, force, load), residual)


def shift(rod: Rod, state: State) -> Array:
    """Rates (n, b) at which frames turn when material shifts along the curve; 0 where that costs.

    It costs where cells or natural strains are not alike. Edge 0 is kept where it is by a rigid
    rotation, which leaves nothing of it on a planar circle.
    """
    n, b = rod.n_edges, rod.block
    mode = np.zeros((n, b))
    if np.ptp(rod.cell) > _UNIFORM or np.any(np.ptp(rod.rest, axis=0) > _UNIFORM):
        return mode
    turn = rotation_vector(state.quat, np.roll(state.quat, -1, axis=0)) / rod.cell[:, None]
    rate = 0.5 * (turn + np.roll(turn, 1, axis=0))
    frames = rotation(state.quat)
    mode[:, :3] = rate - np.einsum("nji,j->ni", frames, frames[0] @ rate[0])
    return mode if float(np.abs(mode).max()) > _PLANAR else np.zeros((n, b))


def spin(rod: Rod, state: State) -> Array:
    """Rates (n, b) at which frames turn when each spins about its tangent; 0 where that costs.

    It does where the natural ring is bent or the section has a stiff and a weak side. Edge 0 is
    kept where it is by a rigid rotation.
    """
    mode = np.zeros((rod.n_edges, rod.block))
    stiff = rod.stiffness
    if abs(stiff[0] - stiff[1]) > _UNIFORM * stiff[0] or np.any(np.abs(rod.rest) > _UNIFORM):
        return mode
    frames = rotation(state.quat)
    mode[:, :3] = np.array([0.0, 0.0, 1.0]) - np.einsum("nji,j->ni", frames, frames[0][:, 2])
    return mode
