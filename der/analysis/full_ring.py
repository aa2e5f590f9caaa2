"""Shapes of the full ring from the states of a sector, in three dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from der.kernels.linking import unfold_lengths
from der.kernels.quaternions import Array, rotation
from der.problem import Point
from der.records.configurations import Fall, Shapes, Softest
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State

if TYPE_CHECKING:
    from der.analysis.snap import Landing

STEPS = 90  # of a snap at most: three seconds of animation
# signs of modes under the half-turns about E2 and E3, which map the state onto itself
_SIGNS = {"out of phase": (1.0, -1.0), "odd": (-1.0, 1.0)}
_HALF_TURNS = np.array([[-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])


def shapes(
    ring: GrippedRing,
    points: Sequence[Point[Equilibrium]],
    arc_length: Array,
    *,
    history: bool,
    modes: bool,
) -> Shapes:
    """Return vertices and frames at every state, and the snaps and softest modes if asked for.

    Parameters
    ----------
    arc_length : (N,) of the ring's frames.
    history : whether landings hold the history of their relaxations.
    modes : whether to compute the softest mode of each symmetry class at every state.
    """
    states = [point.solution.state for point in points]
    x, frames = _full_shapes(ring, states)
    falls = _falls(ring, points) if history else []
    softest = _softest(ring, states) if modes else None
    return Shapes(x, frames, tuple(falls), softest, arc_length)


def _full_shapes(ring: GrippedRing, states: Sequence[State]) -> tuple[Array, Array]:
    """Vertices (n, N, 3) and frames (n, N, 3, 3) of the ring."""
    pairs = [ring.shape(state) for state in states]
    return np.array([x for x, _ in pairs]), np.array([frames for _, frames in pairs])


def _falls(ring: GrippedRing, points: Sequence[Point[Equilibrium]]) -> list[Fall]:
    """The motions of the snaps among the points."""
    from der.analysis.snap import Landing

    return [
        _fall(ring, k - 1, point)
        for k, point in enumerate(points)
        if isinstance(point, Landing) and point.history
    ]


def _fall(ring: GrippedRing, after: int, landing: Landing) -> Fall:
    """The history of a landing, resampled in steps of about equal length."""
    x, frames = _full_shapes(ring, landing.history)
    steps = [float(np.linalg.norm(b - a, axis=1).max()) for a, b in pairwise(x)]
    length = np.append(0.0, np.cumsum(steps))
    chosen = np.unique(np.searchsorted(length, np.linspace(0.0, length[-1], STEPS)))
    gamma = np.array([state.load for state in landing.history])
    energy = np.array(landing.energies)
    return Fall(after, gamma[chosen], energy[chosen], x[chosen], frames[chosen])


def _softest(ring: GrippedRing, states: Sequence[State]) -> Softest:
    """The softest mode of each symmetry class, and the displacements of the softest of all.

    The sign of a mode is the one closer to the mode of the state before.
    """
    eigenvalues = np.empty((len(states), len(ring.classes)))
    u: list[Array] = []
    for k, state in enumerate(states):
        found = {}
        for c, label in enumerate(ring.classes):
            eigenvalues[k, c : c + 1], (found[label],) = ring.softest_modes(state, symmetry=label)
        label = list(found)[int(np.argmin(eigenvalues[k]))]
        moved = displacements(ring, state, label, found[label])
        u.append(-moved if u and np.vdot(moved, u[-1]) < 0.0 else moved)
    return Softest(tuple(ring.classes), eigenvalues, np.array(u))


def displacements(ring: GrippedRing, state: State, label: str, mode: Array) -> Array:
    """Displacements (N, 3) of the ring's vertices in a mode (n, b) of the class ``label``.

    Notes
    -----
    A rotation w, in the frame R itself, turns the tangent d3 by (R w) x d3. A half-turn that
    reverses the curve maps edges onto the negatives of edges. Odd modes come in pairs: the one that
    is even under the half-turn about E3 is used, so both arms move in the same way.
    """
    turn = rotation(state.quat)
    d3 = turn[:, :, 2]
    rate = np.cross((turn @ mode[:, :3, None])[..., 0], d3) * (1.0 + state.stretch[:, None])
    rate += mode[:, 3:].sum(axis=1, keepdims=True) * d3
    mapped = -np.array(_SIGNS.get(label, (1.0, 1.0)))[:, None] * _HALF_TURNS
    if ring.copies == 4:
        rate = np.concatenate([mapped[0] * rate[:0:-1], rate])
    if ring.copies > 1:
        rate = np.concatenate([rate, mapped[1] * rate[-2:0:-1]])
    edges = unfold_lengths(ring.rod.length, ring.copies)[:, None] * rate
    u: Array = np.cumsum(edges, axis=0)
    grips = (u - 0.5 * edges)[[0, len(u) // 2]]
    return u - grips.mean(axis=0)
