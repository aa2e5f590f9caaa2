"""Transitions: the states reached from an unstable state along its unstable modes.

The ring is displaced along each mode of negative stiffness, to both sides, and flows down its
energy (`rod.dynamics.flow`); Newton's method finishes. The displacement and the flow keep the
symmetry of the mode. So the flow may end on a saddle that is a minimum among symmetric shapes only.
The saddle is recorded, and the ring is displaced from there along its most unstable mode, until a
minimum is reached.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from der.analysis.multistability.deflation import Known, solved
from der.analysis.multistability.symmetry_images import Images
from der.kernels.quaternions import Array
from der.rod.dynamics import flow
from der.rod.free_ring import FreeRing, balance

_NUDGE = 0.03  # rad, root mean square
_TOLERANCE = 1e-6  # GJ/a, of the flow; Newton's method goes on
_MOST_MODES = 24  # computed: those nearest to zero come first, and very unstable ones last
_MOST_SADDLES = 6  # of one transition; each has fewer unstable modes than the one before
_MOST_STEPS = 2000  # of a flow; most take below 200


@dataclass(frozen=True)
class Descent:
    """The transition along one mode."""

    stiffness: float  # of the mode
    sign: int
    rests: tuple[Known, ...]  # equilibria reached, the last a minimum
    ended: bool  # whether a minimum is reached


def unstable_modes(one: FreeRing, index: int) -> tuple[Array, Array]:
    """Return eigenvalues (m,) and modes (m, n, b) of negative stiffness, the lowest first."""
    system = one.system
    negative = np.zeros(0, dtype=int)
    count = index + 2
    while True:
        values, modes = system.softest_modes(one.state, count)
        negative = np.argsort(values)[: int(np.sum(values < 0.0))]
        if len(negative) >= index or count >= _MOST_MODES:
            return values[negative], modes[negative]
        count = min(2 * count, _MOST_MODES)


def descents(one: Known, index: int, images: Images) -> Iterator[Descent]:
    """Yield the transitions along all unstable modes, to both sides of each."""
    values, modes = unstable_modes(one.free, index)
    for value, mode in zip(values, modes, strict=True):
        for sign in (1, -1):
            yield _descent(one, float(value), sign, mode, images)


def _descent(one: Known, stiffness: float, sign: int, mode: Array, images: Images) -> Descent:
    rests: list[Known] = []
    here = one
    push = sign * mode
    while len(rests) < _MOST_SADDLES:
        landed = _landed(here.free, push, images)
        if landed is None or landed.energy >= here.energy:
            return Descent(stiffness, sign, tuple(rests), ended=False)
        rests.append(landed)
        index = landed.free.index()
        if index == 0:
            return Descent(stiffness, sign, tuple(rests), ended=True)
        if index is None:
            break
        push, here = unstable_modes(landed.free, index)[1][0], landed
    return Descent(stiffness, sign, tuple(rests), ended=False)


def _landed(here: FreeRing, push: Array, images: Images) -> Known | None:
    """The equilibrium in which the flow from a displacement ends; None: it does not end."""
    size = _NUDGE * math.sqrt(float(here.rod.length.sum()))
    system = here.unpinned
    kick = system.increment(size * push)
    end = flow(system, here.state, kick=kick, tolerance=_TOLERANCE, most=_MOST_STEPS)
    if not end.rests:
        return None
    state = end.state
    return solved(balance(here.rod, state.quat, state.stretch, here.supports, state.load), images)
