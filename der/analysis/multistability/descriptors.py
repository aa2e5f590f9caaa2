"""The name and the record of a state."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from der.analysis.multistability.deflation import Known
from der.analysis.multistability.symmetry_images import curvatures, images, repeats
from der.analysis.state_names import covered_name, numbered, planar_name
from der.kernels.linking import link, twist, vertices
from der.kernels.quaternions import Array, rotation
from der.records.states import RingState
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State, edges
from der.scene import CROSSINGS_UP_TO

_FLAT = 1e-6  # a, out of the plane; rad, of strains that are zero
_TILT = 1e-3  # rad, of the bar in a circle


def described(full: GrippedRing, one: Known, name: str, index: int | None) -> RingState:
    """The record of a state."""
    free = one.free
    rod, state = free.rod, free.state
    gripped = bool(np.any(free.supports.turn))
    k = curvatures(rod, state)
    times = turning(full, state)
    linked, writhe = None, None
    turns = float(twist(state.quat))
    if times in (None, 1, -1) and rod.n_edges <= CROSSINGS_UP_TO:
        linked = link(state.quat, full.lengths(state))[0]
        writhe = linked - turns
    periods = repeats(k) if images(rod, free.supports, state.load).slides else None
    moment = full.arm_moment(free.polished().moment) if gripped else None
    distance = grip_distance(full, state) if gripped else None
    shape = (one.energy, index, free.residual, times is not None, times, linked, writhe, turns)
    cut, zero = needs_cut(state.quat), free.zero_modes
    return RingState(name, *shape, cut, len(one.images), periods, zero, moment, distance)


def turning(full: GrippedRing, state: State) -> int | None:
    """Turning number of a planar centreline, about d1 if that is normal to the plane; else None.

    If the bar lies on its side, the turning number is positive.
    """
    x = vertices(state.quat, full.lengths(state))
    x = x - x.mean(axis=0)
    normal = np.linalg.svd(x, full_matrices=False)[2][2]
    if float(np.abs(x @ normal).max()) > _FLAT:
        return None
    tangents = edges(full.rod, state)
    after = np.roll(tangents, -1, axis=0)
    angle = np.arctan2(np.cross(tangents, after) @ normal, np.sum(tangents * after, axis=1))
    across = float(np.mean(rotation(state.quat)[:, :, 0] @ normal))
    total = round(float(angle.sum()) / (2.0 * math.pi))
    return total if across > _TILT else -total if across < -_TILT else abs(total)


def needs_cut(quat: Array) -> bool:
    """Whether no motion leads to the flat ring, even if strands may pass through each other.

    The frames along the ring are a closed line in the space of rotations. There are two classes of
    such lines (Dirac's belt). Choose the sign of each quaternion so that it is close to the one
    before. Then the last meets the first with the opposite sign if the turning number is odd, as in
    the flat and the three-covered ring, and with the same sign if it is even.
    """
    products = np.sum(quat * np.roll(quat, -1, axis=0), axis=1)
    return int(np.sum(products < 0.0)) % 2 == 0


def grip_distance(full: GrippedRing, state: State) -> float:
    """Distance between the two grips, a."""
    steps = edges(full.rod, state)
    half = len(steps) // 2
    span = 0.5 * (steps[0] + steps[half]) + steps[1:half].sum(axis=0)
    return float(np.linalg.norm(span))


def names(full: GrippedRing, known: Sequence[Known], indices: Sequence[int | None]) -> list[str]:
    """Return a name for each state, in their order: planar shapes, or kind and number in space."""
    plain = [_name(full, one.free.state, index) for one, index in zip(known, indices, strict=True)]
    return numbered(plain, always=("well", "saddle", "singular"))


def _name(full: GrippedRing, state: State, index: int | None) -> str:
    times = turning(full, state)
    if times is None:
        return "singular" if index is None else "saddle" if index else "well"
    k = curvatures(full.rod, state) * full.rod.cell.sum() / (2.0 * math.pi)
    if times == 0:
        bent = k[:, :2].sum(axis=1)
        changes = int(np.sum(bent * np.roll(bent, 1) < 0.0))
        uniform = float(np.ptp(full.rod.rest[:, 0])) < _FLAT  # else straights change sign as well
        often = f" {changes // 2} times" if uniform and changes > 2 else ""
        return f"figure eight{often}{_rolled(k, 1)}"
    if times < 0 and float(np.abs(k[:, 1]).max()) <= _TILT * abs(times):
        return planar_name(times)
    return covered_name(times) + _rolled(k, abs(times))


def _rolled(k: Array, covering: int) -> str:
    """How a bar in a planar shape is rolled about its tangent, in words; "": not at all."""
    small = _TILT * covering
    if float(np.abs(k[:, 1]).max()) <= small:
        return ""
    if float(np.abs(k[:, 2]).max()) > small:
        return ", twisted"
    if float(np.ptp(k, axis=0).max()) > small:
        return ", on its side"
    return f", tilted {math.degrees(math.atan2(abs(k[0, 1]), k[0, 0])):.0f}°"
