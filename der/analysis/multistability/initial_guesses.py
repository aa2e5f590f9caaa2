r"""Initial guesses of the search for states: known planar shapes, and the states of twisting.

A planar closed elastica is a circle, covered n times, or a figure eight (Euler 1744; Langer and
Singer 1984), and natural curvature kappa0, uniform along the ring, changes nothing about that: in
alpha (k - kappa0)^2/2 the cross term integrates to the turning number and the rest is a constant.
In space the bar may be rolled about its own tangent by phi, k = n (cos phi, sin phi, 0), where

    U'(phi) = 0:    sin phi = 0    or    cos phi = -alpha kappa0/((beta - alpha) n),

where the second is the tilted ring between a circle and its inside-out image, the pass between them
if beta > alpha. It exists if alpha |kappa0| < |beta - alpha| n. At the end of this range the circle
flips: alpha (n - kappa0) = beta n, or the same with -n.

For other rings these shapes are approximate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from der.analysis.landscape.barrier import twisted_states
from der.analysis.landscape.landscape import bare_request
from der.analysis.landscape.saddle_search import displaced
from der.analysis.request import ring_of
from der.errors import ContinuationFailed
from der.kernels.quaternions import Array, turned
from der.rod.free_ring import FreeRing, balance, released
from der.rod.gripped_ring import GrippedRing
from der.rod.planar_ring import eight_angles
from der.scene import Scene

_AS_IS = np.ones(4)
_MIRRORED = np.array([1.0, 1.0, -1.0, -1.0])  # quaternions, across the plane of the flat ring
_COVERED = 3  # times, or as often as the natural curvature has turns
_EDGES_A_COVER = 4  # least edges on each cover


def free_starts(scene: Scene, full: GrippedRing) -> Iterator[FreeRing]:
    """Yield shapes of a ring without grips, the flat ring first."""
    wanted = math.ceil(abs(scene.ring.natural_ratio))
    most = min(max(_COVERED, wanted), scene.n_edges // _EDGES_A_COVER)
    for turns in range(1, most + 1):
        yield covered(full, turns)
    yield eight(full)
    for turns in range(1, _COVERED + 1):
        yield covered(full, turns, math.pi)
    for turns in range(1, _COVERED + 1):
        tilt = _tilt(scene, turns)
        if tilt is not None:
            yield covered(full, turns, tilt)
    yield eight(full, 0.5 * math.pi)
    yield from twisted_states(scene).free


def gripped_starts(scene: Scene, full: GrippedRing, gamma: float) -> Iterator[FreeRing]:
    """Yield the states on the path of twisting at a rotation of the grips, stable or not.

    It also yields the mirror images of the states at 2 pi - gamma: grips turned by -(2 pi - gamma)
    have the same position as grips turned by gamma.
    """
    ring = ring_of(scene)
    other = 2.0 * math.pi - gamma
    until_folded = max(gamma, other) <= math.pi
    request = replace(bare_request(scene), until_folded=until_folded, targets=(gamma, other))
    try:
        for one in request.follow(ring):
            state = one.solution.state
            for load, signs in ((gamma, _AS_IS), (other, _MIRRORED)):
                if one.solution.parameter == load:
                    free = released(ring, full, state)
                    quat, stretch = free.state.quat * signs, free.state.stretch
                    yield balance(full.rod, quat, stretch, full.supports, gamma)
    except ContinuationFailed:  # the states found before are kept
        return


def covered(full: GrippedRing, turns: int, roll: float = 0.0) -> FreeRing:
    """The ring wound ``turns`` times, planar, its bar rolled about its tangent [rad]."""
    s = full.arc_length
    return _bent(full, (turns - 1) * 2.0 * math.pi * s / full.rod.cell.sum(), roll)


def eight(full: GrippedRing, roll: float = 0.0) -> FreeRing:
    """The ring as a planar figure eight."""
    share = full.arc_length / full.rod.cell.sum()
    return _bent(full, eight_angles(share) - 2.0 * math.pi * share, roll)


def _bent(full: GrippedRing, more: Array, roll: float) -> FreeRing:
    """The flat ring with its tangents turned in its plane by ``more`` [rad], closed again."""
    quat = np.empty_like(full.start.quat)
    for j, (flat, angle) in enumerate(zip(full.start.quat, more, strict=True)):
        turned(flat, np.array([angle, 0.0, 0.0]), quat[j])  # d1 is the plane's normal
        turned(quat[j], np.array([0.0, 0.0, roll]), quat[j])
    free = balance(full.rod, quat, np.zeros(len(more)))
    return displaced(free, np.zeros(free.supports.free.shape))


def _tilt(scene: Scene, turns: int) -> float | None:
    """Roll of the tilted circle [rad]; None where there is none."""
    alpha, beta = scene.section.alpha, scene.section.beta
    if alpha == beta:
        return None
    natural = scene.ring.natural_ratio * 2.0 * math.pi / scene.ring.length
    cosine = -alpha * natural / ((beta - alpha) * turns)
    return math.acos(cosine) if abs(cosine) < 1.0 else None
