"""What a state is called, and what is said about it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from der.analysis.multistability.deflation import Known
from der.analysis.multistability.symmetry_images import curvatures, images, repeats
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
    covering = turning(full, state)
    simple = covering is None or abs(covering) == 1
    linked, writhe = None, None
    turns = float(twist(state.quat))
    if simple and rod.n_edges <= CROSSINGS_UP_TO:
        linked = link(state.quat, full.lengths(state))[0]
        writhe = linked - turns
    slides = images(rod, free.supports, state.load).slides
    return RingState(
        name,
        one.energy,
        index,
        free.residual,
        covering is not None,
        covering,
        linked,
        writhe,
        turns,
        needs_cut(state.quat),
        len(one.images),
        repeats(k) if slides else None,
        free.zero_modes,
        full.arm_moment(free.polished().moment) if gripped else None,
        grip_distance(full, state) if gripped else None,
    )


def turning(full: GrippedRing, state: State) -> int | None:
    """Turns of the tangent of a planar centreline, about d1 where it is normal to the plane.

    Where the bar lies on its side, the sense is that of the greater turning. None in space.
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
    """Whether no motion leads to the flat ring, strands passing through each other or not.

    Frames that turn with the curve make a closed line in the space of rotations, of which there
    are two kinds (Dirac's belt): with signs chosen so that each quaternion is next to the one
    before, the last meets the first with the other sign in the flat ring, three-covered and so on,
    and with its own where the turning number is even.
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
    """A name for each state, in their order: what planar shapes are, kind and number in space."""
    plain = [_name(full, one.free.state, index) for one, index in zip(known, indices, strict=True)]
    total, seen = Counter(plain), Counter[str]()
    numbered = []
    for name in plain:
        seen[name] += 1
        free = total[name] == 1 and name not in ("well", "saddle", "singular")
        numbered.append(name if free else f"{name} {seen[name]}")
    return numbered


def _name(full: GrippedRing, state: State, index: int | None) -> str:
    covering = turning(full, state)
    in_space = "singular" if index is None else "saddle" if index else "well"
    if covering is None:
        return in_space
    k = curvatures(full.rod, state) * full.rod.cell.sum() / (2.0 * math.pi)
    spread = np.ptp(k, axis=0)
    if covering == 0:
        bent = k[:, :2].sum(axis=1)
        changes = int(np.sum(bent * np.roll(bent, 1) < 0.0))
        uniform = float(np.ptp(full.rod.rest[:, 0])) < _FLAT  # else straights change sign as well
        often = f" {changes // 2} times" if uniform and changes > 2 else ""
        return f"figure eight{often}{_rolled(k, spread, 1)}"
    number = {2: "two", 3: "three", 4: "four", 5: "five"}.get(abs(covering), str(abs(covering)))
    word = "flat" if abs(covering) == 1 else f"{number}-covered"
    if covering < 0 and float(np.abs(k[:, 1]).max()) <= _TILT * abs(covering):
        return "flipped" if covering == -1 else f"{word}, flipped"
    return word + _rolled(k, spread, abs(covering))


def _rolled(k: Array, spread: Array, covering: int) -> str:
    """In words, how a bar in a planar shape is rolled about its tangent; "" where it is not."""
    small = _TILT * covering
    if float(np.abs(k[:, 1]).max()) <= small:
        return ""
    if float(np.abs(k[:, 2]).max()) > small:
        return ", twisted"
    if float(spread.max()) > small:
        return ", on its side"
    return f", tilted {math.degrees(math.atan2(abs(k[0, 1]), k[0, 0])):.0f}°"
