"""Saddles of the free ring: uphill along one mode, downhill along all others.

Eigenvector following (Cerjan and Miller 1981; Wales 1994). In the eigenbasis of the Hessian on the
conditions Newton's step is -g/mu: uphill if mu < 0, downhill if mu > 0. Here its sign is changed in
the softest modes, so that it goes uphill along the followed mode alone. It then converges to a
saddle of index 1, and not to any nearby equilibrium as Newton's method does. One step needs one
factorisation and the softest modes: O(N).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.kernels.assembly import assemble, derivatives, hold, system_of
from der.kernels.block_ldl import factor, solve_refined
from der.kernels.quaternions import Array
from der.kernels.workspace import rows
from der.packs.kernel import kernel
from der.rod.equilibrium import Equilibrium
from der.rod.free_ring import FreeRing, balance
from der.rod.system import RodSystem

_LONGEST = 0.05  # rad, root mean square, of a step; thin strips (h/t = 30) do not follow 0.1
_NEARLY = 1e-5  # GJ/a, largest force: Newton's method takes over
_SOFT = 0.02  # of the softest torsion, GJ (2 pi/L)^2: least stiffness that is used for a step
_STEPS = 100
_MODES = 5  # computed in each step: never more are unstable on the path


@dataclass(frozen=True)
class Climb:
    """The end of following a mode."""

    free: FreeRing
    solution: Equilibrium
    index: int | None
    steps: int

    @property
    def is_saddle(self) -> bool:
        """Whether it is a saddle of index 1."""
        return self.solution.converged and self.index == 1


def climb(start: FreeRing, along: Array, *, kick: Array | None = None) -> Climb | None:
    """Return the equilibrium reached by following a mode uphill; None: it reaches none.

    Parameters
    ----------
    along : (n, b) mode to follow, of unit norm in the edges' lengths.
    kick : (n, b) displacement added to the start [rad].
    """
    here, mode = start, along
    if kick is not None:
        here = displaced(here, kick)
    for step in range(_STEPS):
        system = here.system
        found = newton_step(system, here)
        if found is None:
            return None
        newton, grad = found
        if float(np.abs(grad).max()) < _NEARLY:
            return _polished(here, step)
        values, modes = system.softest_modes(here.state, _MODES)
        # far from the saddle the followed mode is recognised by its shape; near it, it is the only
        # unstable one
        overlap = [abs(float(np.sum(here.rod.length[:, None] * mode * m))) for m in modes]
        chosen = int(np.argmax(overlap))
        if np.sum(values < 0.0) == 1:
            chosen = int(np.argmin(values))
        mode = modes[chosen]
        here = displaced(here, _turned(here, newton, grad, values, modes, chosen))
        if not np.isfinite(here.residual):
            return None
    return None


def downhill_modes(free: FreeRing, count: int = 4) -> list[Array]:
    """Modes (n, b) of negative stiffness among the ``count`` softest, the softest first."""
    values, modes = free.system.softest_modes(free.state, count)
    order = np.argsort(values)
    return [modes[k] for k in order if values[k] < 0.0]


def _turned(
    here: FreeRing, newton: Array, grad: Array, values: Array, modes: Array, chosen: int
) -> Array:
    """Newton's step (n, b) turned in the softest modes: uphill along the chosen one, else down."""
    length = float(here.rod.length.sum())
    softest = _SOFT * float(here.rod.stiffness.min()) * (2.0 * np.pi / length) ** 2
    step = newton.copy()
    for k, (value, mode) in enumerate(zip(values, modes, strict=True)):
        slope = float(np.sum(grad * mode))
        sense = 1.0 if k == chosen else -1.0
        step += (sense * slope / max(abs(value), softest) + slope / value) * mode
    size = float(np.sqrt(np.sum(here.rod.mass * step**2)))
    return step * min(1.0, _LONGEST / max(size, 1e-300))


@kernel
def _step(rod, supports, quat, stretch, force, work, out_step, out_grad):
    """Newton's step (n, b, 1) at fixed load, the gradient (n, b); whether the matrix is regular."""
    n, b = supports.free.shape
    m = force.shape[0]
    system, work = system_of(work, n, b, m)
    assemble(rod, supports, quat, stretch, force, 0.0, system)
    hold(supports.free, system.diag, system.off, system.border)
    no_row, work = rows(work, n, b)
    y, z, none = np.zeros((m, 1)), np.zeros(1), np.zeros(m)
    for j in range(n):
        for i in range(b):
            no_row[j, i] = 0.0
            out_grad[j, i] = system.grad[j, i] if supports.free[j, i] else 0.0
            out_step[j, i, 0] = -out_grad[j, i]
    factors, work = factor(system.diag, system.off, system.border, work)
    return factors.negative >= 0 and solve_refined(
        system.diag, system.off, factors, m, no_row, none, no_row, none, 1.0, out_step, y, z, work
    )


def newton_step(system: RodSystem, here: FreeRing) -> tuple[Array, Array] | None:
    """Newton's step and the gradient (n, b); None where the matrix is singular."""
    state, (n, b) = here.state, system.supports.free.shape
    step, grad = np.empty((n, b, 1)), np.empty((n, b))
    solved = _step(
        system.rod, system.supports, state.quat, state.stretch, state.force, system.work, step, grad
    )
    return (step[:, :, 0], grad) if solved else None


def displaced(here: FreeRing, w: Array) -> FreeRing:
    """A ring displaced by ``w`` (n, b), back on its conditions, with forces of least residual."""
    system, supports, load = here.unpinned, here.supports, here.state.load
    no_force = np.zeros(len(supports.target))
    state = system.retract(here.state, system.increment(w))
    free = supports.free.ravel()
    for _ in range(8):
        found, _ = derivatives(here.rod, supports, state.quat, state.stretch, no_force, load)
        if float(np.abs(found.gap).max()) < 1e-12:
            break
        border = found.border.reshape(len(free), -1)[free]
        back = np.zeros(supports.free.shape)
        back[supports.free] = np.linalg.lstsq(border.T, -found.gap, rcond=None)[0]
        state = system.retract(state, system.increment(back))
    return balance(here.rod, state.quat, state.stretch, supports, load)


def _polished(here: FreeRing, steps: int) -> Climb:
    """The nearby equilibrium, and its index."""
    at = here.polished()
    free = balance(here.rod, at.state.quat, at.state.stretch, here.supports, here.state.load)
    return Climb(free, at, free.index() if at.converged else None, steps)
