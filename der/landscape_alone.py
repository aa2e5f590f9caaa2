"""The ring with its grips removed: is a state one of its equilibria, and how many ways lead down.

A twisted ring is mapped onto itself by the half-turn about its twisting axis, which swaps the arms.
What the arms exert on a grip is therefore symmetric under it: a force along the axis, which the
free slide makes zero, and a moment about the axis, which is 2 M. So at M = 0 the grips exert
nothing at all, bending moments included: **every rest of a twisted ring is an equilibrium of the
ring left alone**, stable or not. (They still guide: in clamped grips fewer motions are allowed.)

A ring of uniform natural curvature has one more motion at no cost, where it is not planar: material
shifts along the curve. On the mesh it costs next to nothing, and as the rigid rotations are taken
out by one held frame, it is taken out by holding one unknown, that which it moves most. A null
vector z is not in the hyperplane of such a condition, so the index is that of the other motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.assembly import assemble
from der.equilibrium import Equilibrium, equilibrium
from der.frames import Array, rotation, rotation_vector
from der.rod import Rod, State
from der.sector import Sector, free_ring
from der.stability import all_modes, index
from der.supports import Supports

BALANCED = 1e-8  # residual over the ring's largest bending stiffness EI/cell: at rest
_UNIFORM = 1e-9  # of strains and cells that are equal
_PLANAR = 1e-6  # of a shift that is a rigid rotation


@dataclass(frozen=True)
class Alone:
    """A configuration of the ring left alone, with the forces that balance it best."""

    body: Rod  # of the full ring
    held: Supports  # closed, one frame held
    state: State
    residual: float  # largest entry of the gradient, GJ/a

    @property
    def balanced(self) -> bool:
        """Whether it is an equilibrium, to rounding."""
        stiffest = float(self.body.stiffness.max() / self.body.cell.min())
        return self.residual <= BALANCED * stiffest

    @property
    def zero_modes(self) -> int:
        """How many motions cost nothing, beyond rigid ones."""
        return int(np.any(shift(self.body, self.state)))

    def pinned(self) -> Supports:
        """The supports with one more unknown held where the material may shift at no cost."""
        mode = np.abs(shift(self.body, self.state))
        if not np.any(mode):
            return self.held
        free = self.held.free.copy()
        free[np.unravel_index(int(np.argmax(mode)), mode.shape)] = False
        return self.held._replace(free=free)

    def index(self) -> int | None:
        """Ways down; None where it is no equilibrium, or singular."""
        if not self.balanced:
            return None
        held = self.pinned()
        return index(self.body, held, all_modes(held), self.state)

    def polished(self, tolerance: float = 1e-10) -> Equilibrium:
        """The equilibrium next to it, by Newton's method."""
        return equilibrium(self.body, self.pinned(), self.state, tolerance=tolerance)


def left_alone(piece: Sector, whole: Sector, state: State) -> Alone:
    """A state of a sector on ``whole``, the full ring of the same mesh, without grips."""
    quat = piece.full_frames(state)
    stretch = piece.full_lengths(state) / whole.body.length - 1.0
    return balance(whole.body, quat, stretch)


def balance(body: Rod, quat: Array, stretch: Array) -> Alone:
    """A configuration with the forces that balance it best, in least squares."""
    held = free_ring(body)
    system = assemble(body, held, quat, stretch, np.zeros(3), 0.0)
    free = held.free.reshape(-1)
    grad = system.grad.reshape(-1)[free]
    border = system.border.reshape(-1, 3)[free]
    force = -np.linalg.lstsq(border, grad, rcond=None)[0]
    gap = float(np.abs(system.gap).max())
    residual = max(float(np.abs(grad + border @ force).max()), gap)
    return Alone(body, held, State(quat, stretch, force, 0.0), residual)


def shift(body: Rod, state: State) -> Array:
    """Rates (n, b) at which frames turn when material shifts along the curve; 0 where that costs.

    It costs where cells or natural strains are not alike. Edge 0 is kept where it is by a rigid
    rotation, which leaves nothing of it on a planar circle.
    """
    n, b = body.n_edges, body.block
    mode = np.zeros((n, b))
    if np.ptp(body.cell) > _UNIFORM or np.any(np.ptp(body.rest, axis=0) > _UNIFORM):
        return mode
    turn = rotation_vector(state.quat, np.roll(state.quat, -1, axis=0)) / body.cell[:, None]
    rate = 0.5 * (turn + np.roll(turn, 1, axis=0))
    frames = rotation(state.quat)
    mode[:, :3] = rate - np.einsum("nji,j->ni", frames, frames[0] @ rate[0])
    return mode if float(np.abs(mode).max()) > _PLANAR else np.zeros((n, b))
