"""The free ring: equilibrium and index of a state once the grips are removed.

A twisted ring is mapped onto itself by the half-turn about its twisting axis, which swaps the arms.
What the arms exert on a grip is therefore symmetric under it: a force along the axis, which the
free slide makes zero, and a moment about the axis, which is 2 M. So at M = 0 the grips exert
nothing at all, bending moments included: **every state of a twisted ring with M = 0 is an
equilibrium of the free ring**, stable or not. (Clamped grips still allow fewer motions.)

A ring of uniform natural curvature that is not planar has one more motion without energy: material
shifts along the curve. On the mesh its stiffness is almost zero. One held frame removes the rigid
rotations; one held unknown, the one that the shift moves most, removes the shift. Its null vector z
does not lie in the hyperplane of this condition, so the index is that of the other motions. A
naturally straight isotropic rod may also spin about its own tangents without energy (the seventh
mode of the isotropic ring); this motion is removed in the same way.

Other supports, such as grips, are possible too; they leave no motion without energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.kernels.assembly import derivatives
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
    """A configuration of the free ring, with the forces of least residual."""

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
        """Number of motions without energy, apart from rigid motions."""
        return len(self._costless())

    def pinned(self, least: float = _PLANAR) -> Supports:
        """The supports with one more unknown held for each motion without energy.

        A motion does not count if it differs from a rigid one by less than ``least``.
        """
        places = self._costless(least)
        if not places:
            return self.supports
        free = self.supports.free.copy()
        for place in places:
            free[place] = False
        return self.supports._replace(free=free)

    def _costless(self, least: float = _PLANAR) -> list[tuple[int, int]]:
        """For each motion without energy an unknown that it moves: Gaussian elimination."""
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
        """The ring, its motions without energy held."""
        return RodSystem(self.rod, self.pinned())

    @property
    def unpinned(self) -> RodSystem:
        """The ring with all motions that its supports leave free."""
        return RodSystem(self.rod, self.supports)

    def index(self) -> int | None:
        """Return the index, without zero modes; None: no equilibrium, or singular."""
        return self.system.index(self.state) if self.balanced else None

    def polished(self, tolerance: float = 1e-10) -> Equilibrium:
        """Return the equilibrium next to it, by Newton's method."""
        return self.system.correct(self.state, tolerance=tolerance)


def index_without_grips(
    ring: GrippedRing, full: GrippedRing, state: State, *, tolerance: float = 1e-10
) -> int | None:
    """Return the index of a state of ``ring`` once its grips are removed; None: it would move.

    ``full`` is the full ring on the same mesh. An extensible ring is solved for again first: the
    grips also held the length of their two edges.
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
    """Return a configuration with the forces of least residual, by least squares.

    Parameters
    ----------
    supports : turned to ``load``; None: closure alone.
    """
    supports = free_supports(rod) if supports is None else supports
    no_force = np.zeros(len(supports.target))
    system, _ = derivatives(rod, supports, quat, stretch, no_force, load)
    free = supports.free.reshape(-1)
    grad = system.grad.reshape(-1)[free]
    border = system.border.reshape(len(free), -1)[free]
    force = -np.asarray(np.linalg.lstsq(border, grad, rcond=None)[0], dtype=np.float64)
    gap = float(np.abs(system.gap).max())
    residual = max(float(np.abs(grad + border @ force).max()), gap)
    return FreeRing(rod, supports, State(quat, stretch, force, load), residual)


def shift(rod: Rod, state: State) -> Array:
    """Rates (n, b) of the frames when material shifts along the curve; 0 if that needs energy.

    It does if cells or natural strains differ. A rigid rotation keeps edge 0 in its place; on a
    planar circle the rates then vanish.
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
    """Rates (n, b) of the frames when each spins about its tangent; 0 if that needs energy.

    It does if the natural rod is curved or the section is not isotropic. A rigid rotation keeps
    edge 0 in its place.
    """
    mode = np.zeros((rod.n_edges, rod.block))
    stiff = rod.stiffness
    if abs(stiff[0] - stiff[1]) > _UNIFORM * stiff[0] or np.any(np.abs(rod.rest) > _UNIFORM):
        return mode
    frames = rotation(state.quat)
    mode[:, :3] = np.array([0.0, 0.0, 1.0]) - np.einsum("nji,j->ni", frames, frames[0][:, 2])
    return mode
