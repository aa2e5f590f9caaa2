"""Where a state falls to when it is pushed along its ways down.

The ring flows down its energy (`gradient_flow`) from a nudge along each mode of negative stiffness,
to either side, and Newton's method finishes. A nudge keeps the symmetry of its mode, and so does
the flow, which then may come to rest on a saddle that is a minimum among symmetric shapes only; it
is noted, and the ring nudged on along the steepest way down from there, until nothing leads down.
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
_MOST_MODES = 24  # looked at: nearest to zero come first, so steep ones ask for more
_MOST_SADDLES = 6  # passed on one fall; each has fewer ways down than the one before
_MOST_STEPS = 2000  # of a flow; most take below 200


@dataclass(frozen=True)
class Descent:
    """One push and what it led to."""

    stiffness: float  # of the mode pushed along
    sign: int
    rests: tuple[Known, ...]  # states in which the ring came to rest, the last a minimum
    ended: bool  # whether there is such a last one


def unstable_modes(one: FreeRing, index: int) -> tuple[Array, Array]:
    """Eigenvalues (m,) and modes (m, n, b) of negative stiffness, the steepest first."""
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
    """What pushes along all ways down lead to, to either side of each."""
    values, modes = unstable_modes(one.free, index)
    for value, mode in zip(values, modes, strict=True):
        for sign in (1, -1):
            yield _fall(one, float(value), sign, mode, images)


def _fall(one: Known, stiffness: float, sign: int, mode: Array, images: Images) -> Descent:
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
    """The equilibrium in which the flow from a push ends; None where it does not."""
    size = _NUDGE * math.sqrt(float(here.rod.length.sum()))
    system = here.unpinned
    kick = system.increment(size * push)
    end = flow(system, here.state, kick=kick, tolerance=_TOLERANCE, most=_MOST_STEPS)
    if not end.rests:
        return None
    state = end.state
    return solved(balance(here.rod, state.quat, state.stretch, here.supports, state.load), images)
