"""Actuators that open a free ring: a strut between two of its points, or two wrenches.

The ring floats in space, so the loads on it are always in balance:

    force    a strut, hinged to the ring at both ends, becomes longer or shorter. It is one more
             edge without bending stiffness; three position conditions attach its ends to the ring.
             Their multipliers are the pair of forces, always along the line between the points.
    couple   two wrenches hold the directions of two cross-sections and turn one against the other
             about an axis fixed to the first. The load is the couple about that axis; the other
             two directions are held by couples, too. No force acts.

The load is the prescribed length or angle. Its conjugate dL/dload is the force or the couple, dU is
its work, and the index of a state is that of the ring with the actuator held.

The ring is renumbered so that the first point is edge 0, whose frame is held: by the wrench, or to
remove rigid rotations. With a strut the ring is cut there: one half of edge 0 stands at each end of
an open rod, and both halves are held alike, so that they stay together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from der.kernels.assembly import derivatives
from der.kernels.linking import vertices
from der.kernels.quaternions import Array, rotation
from der.rod.free_ring import FreeRing
from der.rod.gripped_ring import E1, E2, E3, free_supports
from der.rod.manifold import split
from der.rod.planar_ring import chord_weights
from der.rod.rod import Rod, State
from der.rod.supports import supported
from der.rod.system import RodSystem

APART, TOGETHER, OUT = "apart", "together", "out of plane"
LIFTED = 1e-3  # of the ring's length: first length of a strut between coincident points
_ONE_PLACE = 1e-6  # of the ring's length: points that coincide
_MET = 0.02  # of a strut's first length: its ends meet
_TAUT = 0.97  # of the shorter arc between the points: largest length of a strut
_ROUND = 2.0 * np.pi  # rad, the most that a wrench turns


@dataclass(frozen=True)
class Actuator:
    """A ring in an actuator, before loading."""

    kind: str  # "force" or "couple"
    points: tuple[int, int]  # edges of the ring at whose middles it acts
    direction: str  # a short name
    axis: Array  # (3,) direction in which the second point moves, or axis about which it turns
    system: RodSystem  # the ring in the actuator; its load is the push
    start: State  # at load 0
    load_max: float  # largest load
    rod: Rod  # of the ring without the actuator

    @property
    def first(self) -> float:
        """Length of a strut at load 0, a."""
        return float(self.system.rod.length[-1])

    def released(self, state: State) -> State:
        """The same shape of the ring without the actuator; in general no equilibrium."""
        n, first = self.rod.n_edges, self.points[0]
        return State(
            np.roll(state.quat[:n], first, axis=0),
            np.roll(state.stretch[:n], first),
            np.zeros(3),
            0.0,
        )

    def shape(self, state: State) -> tuple[Array, Array]:
        """Vertices (N, 3) of the ring in the actuator, and the two loaded points (2, 3)."""
        free = self.released(state)
        x = vertices(free.quat, self.rod.length * (1.0 + free.stretch))
        return x, _places(self.rod, free, x)[list(self.points)]


def _places(rod: Rod, state: State, x: Array) -> Array:
    """Points (n, 3) at which the frames of a closed ring sit, from its vertices.

    Edge j ends at vertex j; its frame sits half a cell before.
    """
    before = 0.5 * rod.cell * (1.0 + state.stretch)
    return np.asarray(x - before[:, None] * rotation(state.quat)[:, :, 2])


@dataclass(frozen=True)
class _Renumbered:
    """A ring whose edge 0 is the first of two points, and its state."""

    points: tuple[int, int]  # by the numbers of the original ring
    original: Rod
    rod: Rod
    state: State

    @classmethod
    def of(cls, free: FreeRing, points: tuple[int, int]) -> _Renumbered:
        """The ring, renumbered."""

        def rolled(own: Any, *names: str) -> dict[str, Array]:
            return {name: np.roll(getattr(own, name), -points[0], axis=0) for name in names}

        rod = free.rod._replace(**rolled(free.rod, "cell", "length", "mass", "rest"))  # type: ignore[arg-type]
        state = free.state.but(**rolled(free.state, "quat", "stretch"))
        return cls(points, free.rod, rod, state)

    @property
    def far(self) -> int:
        """Number of the second point's edge."""
        return (self.points[1] - self.points[0]) % self.rod.n_edges


# --- Struts ----------------------------------------------------------------------------------


def struts(free: FreeRing, points: tuple[int, int]) -> list[Actuator]:
    """Struts between two points that become longer, and shorter if their first length is not 0.

    Where the points coincide a strut may start in three directions, the eigenvectors of the ring's
    compliance between the points: a force along one moves the points apart along it.
    """
    ring = _Renumbered.of(free, points)
    weight = chord_weights(ring.rod.cell, ring.rod.length, ring.far)
    lengths = ring.rod.length * (1.0 + ring.state.stretch)
    chord = (weight * lengths) @ rotation(ring.state.quat)[:, :, 2]
    first, around = float(np.linalg.norm(chord)), float(ring.rod.length.sum())
    along = np.cumsum(ring.rod.cell)[ring.far - 1]
    room = _TAUT * float(min(along, around - along)) - first
    if first > _ONE_PLACE * around:
        longer = [_strutted(ring, chord, 1.0, room, APART)] if room > 0.0 else []
        return [*longer, _strutted(ring, chord, -1.0, (1.0 - _MET) * first, TOGETHER)]
    room += first - LIFTED * around
    normal = _normal(free.state)
    return [
        _strutted(
            ring, LIFTED * around * axis, 1.0, room, OUT if abs(axis @ normal) > 0.9 else APART
        )
        for axis in _compliant_axes(ring)
    ]


def _strutted(
    ring: _Renumbered, chord: Array, sense: float, load_max: float, direction: str
) -> Actuator:
    """A strut that starts as ``chord`` (3,)."""
    first = float(np.linalg.norm(chord))
    own, state, n = ring.rod, ring.state, ring.rod.n_edges
    length = np.concatenate([own.length, [0.5 * own.cell[-1], first]])
    length[0] = 0.5 * own.cell[0]
    mass = length / length[:-1].sum()
    mass[-1] = 0.0  # rotations of the strut do not count in norms
    rod = own._replace(length=length, mass=mass[:, None], closed=False)
    closing, placed = np.ones(n + 2), np.zeros(n + 2)
    closing[-1] = 0.0
    placed[:n] = chord_weights(own.cell, own.length, ring.far)
    placed[0], placed[-1] = 1.0, -1.0
    conditions = [(weight, e, 0.0) for weight in (closing, placed) for e in (E1, E2, E3)]
    supports = supported(rod, clamped=(0, n), held=tuple(conditions), reach={n + 1: sense})
    supports.free[[0, n], 3:] = True
    supports.free[-1] = [True, True, False, False][: rod.block]  # a strut has no spin or strain
    axis = chord / first
    quat = np.vstack([state.quat, state.quat[:1], _with_tangent(axis)])
    stretch = np.concatenate([state.stretch, [state.stretch[0], 0.0]])
    system = RodSystem(rod, supports, parameter_name="push")
    start = State(quat, stretch, np.zeros(6), 0.0)
    return Actuator(
        "force", ring.points, direction, sense * axis, system, start, load_max, ring.original
    )


def _with_tangent(axis: Array) -> Array:
    """A frame (4,) whose tangent is ``axis``."""
    half = np.array([1.0 + axis[2], -axis[1], axis[0], 0.0])
    size = float(np.linalg.norm(half))
    return half / size if size > 1e-8 else np.array([0.0, 1.0, 0.0, 0.0])


def _compliant_axes(ring: _Renumbered) -> Array:
    """Directions (3, 3), the most compliant first, in which a force pair parts its points."""
    rod, state = ring.rod, ring.state
    supports = free_supports(rod)
    weight = np.tile(chord_weights(rod.cell, rod.length, ring.far), (3, 1))
    measured = supports._replace(weight=weight, axis=np.eye(3), target=np.zeros(3))
    system, _ = derivatives(rod, measured, state.quat, state.stretch, np.zeros(3), 0.0)
    compliance = np.empty((3, 3))
    for k in range(3):
        loaded = supports._replace(pull=weight[0][:, None] * np.eye(3)[k])
        t = split(loaded, RodSystem(rod, loaded).correct(state).tangent)
        compliance[:, k] = np.einsum("jbi,jb->i", system.border, t.q) / t.load
    _, axes = np.linalg.eigh(0.5 * (compliance + compliance.T))
    return np.ascontiguousarray(axes.T[::-1])


# --- Wrenches --------------------------------------------------------------------------------


def wrenches(free: FreeRing, points: tuple[int, int]) -> list[Actuator]:
    """Wrenches at two points of the planar folded ring that turn about each of three axes.

    The axes are the line between the points, the normal to it in the plane, and the normal to the
    plane. Reflection in its plane maps a folded ring to itself, so both senses are equivalent about
    the first two.
    """
    ring = _Renumbered.of(free, points)
    first, second = (rotation(free.state.quat[j]) for j in points)
    normal = _normal(free.state)
    x = vertices(free.state.quat, free.rod.length * (1.0 + free.state.stretch))
    place = _places(free.rod, free.state, x)
    line = place[points[1]] - place[points[0]]
    if float(np.linalg.norm(line)) < _ONE_PLACE * float(free.rod.length.sum()):
        line = first[:, 2] + second[:, 2]
    line = line - (line @ normal) * normal
    line /= np.linalg.norm(line)
    return [
        _wrenched(ring, line, 1.0, "about the line"),
        _wrenched(ring, np.cross(normal, line), 1.0, "across the line"),
        _wrenched(ring, normal, 1.0, "about the normal"),
        _wrenched(ring, normal, -1.0, "about the normal, reversed"),
    ]


def _wrenched(ring: _Renumbered, axis: Array, sense: float, direction: str) -> Actuator:
    rod = ring.rod
    one = np.ones(rod.n_edges)
    supports = supported(
        rod,
        clamped=(0, ring.far),
        held=tuple((one, e, 0.0) for e in (E1, E2, E3)),
        turn={ring.far: sense},
        turn_axis=tuple(axis),
    )
    supports.free[[0, ring.far], 3:] = True
    system = RodSystem(rod, supports, parameter_name="push")
    start = ring.state.but(force=np.zeros(3), load=0.0)
    return Actuator(
        "couple", ring.points, direction, sense * axis, system, start, _ROUND, ring.original
    )


def _normal(state: State) -> Array:
    """Normal (3,) of the plane of a planar ring: that of the tangents."""
    return np.asarray(np.linalg.svd(rotation(state.quat)[:, :, 2])[2][2])
