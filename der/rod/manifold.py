"""Increments of a rod's configuration: the difference of two, and motion by one.

A configuration is frames, stretches, forces and the load. Frames are rotations, so an increment is
a rotation vector in each frame; a rate at the end of an increment is turned back to its start.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.kernels.quaternions import Array, chart_rate, into_frame, turn_between, turned
from der.packs.kernel import kernel
from der.problem import Increment
from der.rod.rod import State
from der.rod.supports import Supports


class Direction(NamedTuple):
    """The parts of an increment; those from `split` are views of the flat array."""

    q: Array  # (n, b) rotation vectors in the frames, and stretch
    force: Array  # (n_c,)
    load: float

    @property
    def flat(self) -> Increment:
        """The same as one array (m,)."""
        return np.concatenate([self.q.ravel(), self.force, [self.load]])


def split(supports: Supports, increment: Increment) -> Direction:
    """Return the parts of an increment of a rod on these supports."""
    size = supports.free.size
    q = increment[:size].reshape(supports.free.shape)
    return Direction(q, increment[size:-1], float(increment[-1]))


@kernel
def product(weight, a, b):
    """Inner product of two increments (m,): mass-weighted rotations and stretches, and the load."""
    total = 0.0
    for i in range(a.shape[0]):
        total += weight[i] * a[i] * b[i]
    return total


@kernel
def difference(
    free, quat, stretch, force, load, next_quat, next_stretch, next_force, next_load, out_jump
):
    """Increment (m,) that leads from one configuration to the next."""
    n, b = free.shape
    m = force.shape[0]
    w = np.empty(3)
    for j in range(n):
        turn_between(quat[j], next_quat[j], w)
        for i in range(b):
            change = w[i] if i < 3 else next_stretch[j] - stretch[j]
            out_jump[j * b + i] = change if free[j, i] else 0.0
    for k in range(m):
        out_jump[n * b + k] = next_force[k] - force[k]
    out_jump[n * b + m] = next_load - load


@kernel
def transport(n, b, jump, rates, out_rates):
    """Rates (m,) at the end of an increment, in the frames of its start."""
    for j in range(n):
        k = j * b
        chart_rate(jump[k : k + 3], rates[k : k + 3], out_rates[k : k + 3])
        if b == 4:
            out_rates[k + 3] = rates[k + 3]
    for k in range(n * b, rates.shape[0]):
        out_rates[k] = rates[k]


@kernel
def move(turn, turn_axis, quat, stretch, force, increment):
    """Add an increment (m,) to frames (n, 4), stretch (n,) and forces (n_c,), in place.

    The frames that turn with the load turn about a fixed axis, so theirs is exact at any angle.
    """
    n, m = quat.shape[0], force.shape[0]
    b = (increment.shape[0] - m - 1) // n
    load = increment[n * b + m]
    axis = np.empty(3)
    for j in range(n):
        for i in range(3):
            axis[i] = increment[j * b + i]
        if turn[j] != 0.0:
            into_frame(quat[j], turn_axis, axis)
            for i in range(3):
                axis[i] *= turn[j] * load
        turned(quat[j], axis, quat[j])
        if b == 4:
            stretch[j] += increment[j * b + 3]
    for k in range(m):
        force[k] += increment[n * b + k]


def retract(supports: Supports, state: State, increment: Increment) -> State:
    """Return ``state`` moved by an increment."""
    quat, stretch, force = state.quat.copy(), state.stretch.copy(), state.force.copy()
    move(supports.turn, supports.turn_axis, quat, stretch, force, increment)
    return State(quat, stretch, force, state.load + float(increment[-1]))
