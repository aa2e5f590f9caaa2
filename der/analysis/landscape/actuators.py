"""Actuators that open a free ring: a strut between two of its points, or two wrenches.

Loads on a ring that floats in space balance each other, whatever it does:

    force    a strut, hinged to the ring at both ends, that is made longer or shorter. It is one
             more edge, which nothing bends, whose ends sit on the ring: three position conditions.
             Its multiplier is the pair of forces, always along the line between the two points.
    couple   two wrenches that hold the directions of two cross-sections, and turn one of them
             against the other about an axis fixed to the first. The load is the couple about that
             axis; what keeps the other two directions is a couple, too. No force acts.

In both the load is what is prescribed: a length, or an angle. Its conjugate dL/dload is the force
or the couple, dU is its work, and a state's index is that of the ring in its actuator, held.

The ring is renumbered so that the first point is edge 0, whose frame is held: by the wrench,
or to take out rigid rotations. With a strut, it is cut there and stands at both ends of an open
rod, in halves; both are held alike, so that they stay one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from der.kernels.assembly import assemble
from der.kernels.linking import vertices
from der.kernels.quaternions import Array, rotation
from der.rod.free_ring import FreeRing
from der.rod.gripped_ring import E1, E2, E3, free_supports
from der.rod.manifold import split
from der.rod.rod import Rod, State
from der.rod.supports import supported
from der.rod.system import RodSystem

APART, TOGETHER, OUT = "apart", "together", "out of plane"
LIFTED = (
    1e-3  # of the ring's length: a strut between points that lie in each other starts this long
)
_ONE_PLACE = 1e-6  # of the ring's length: points that lie in each other
_MET = 0.02  # of a strut's first length: its ends have met
_TAUT = 0.97  # of the shorter way along the ring: a strut cannot be much longer
_ROUND = 2.0 * np.pi  # rad, the most that a wrench turns


@dataclass(frozen=True)
class Actuator:
    """A ring in an actuator that is about to be used."""

    kind: str  # "force" or "couple"
    points: tuple[int, int]  # edges of the ring whose middles it is put to
    direction: str  # in a word or two
    axis: Array  # (3,) in which the second point is pushed, or about which it is turned
    system: RodSystem  # the ring in the actuator; its load is the push
    start: State  # at load 0
    first: float  # length of a strut at load 0, a; 0 for wrenches
    sense: float  # 1: the load lengthens, or turns to the right about the axis
    load_max: float  # at which the actuator has no more room
    rod: Rod  # of the ring without it

    def released(self, state: State) -> State:
        """A state of the ring in the actuator, without it: no equilibrium in general."""
        n, first = self.rod.n_edges, self.points[0]
        return State(
            np.roll(state.quat[:n], first, axis=0),
            np.roll(state.stretch[:n], first),
            np.zeros(3),
            0.0,
        )

    def shape(self, state: State) -> tuple[Array, Array]:
        """Vertices (N, 3) of the ring in the actuator, and the two points (2, 3) it is put to."""
        free = self.released(state)
        x = vertices(free.quat, self.rod.length * (1.0 + free.stretch))
        return x, _places(self.rod, free, x)[list(self.points)]


def _places(rod: Rod, state: State, x: Array) -> Array:
    """Points (n, 3) at which the frames of a closed ring sit, from its vertices.

    Edge j ends at vertex j, and its frame sits half of the cell before that.
    """
    before = 0.5 * rod.cell * (1.0 + state.stretch)
    return np.asarray(x - before[:, None] * rotation(state.quat)[:, :, 2])


def _renumbered(free: FreeRing, first: int) -> tuple[Rod, State]:
    """The same ring with edge ``first`` for edge 0."""
    rod, state = free.rod, free.state
    rolled = rod._replace(**{name: np.roll(getattr(rod, name), -first, axis=0) for name in _ROLLED})
    return rolled, state.but(
        quat=np.roll(state.quat, -first, axis=0), stretch=np.roll(state.stretch, -first)
    )


_ROLLED = ("cell", "length", "mass", "rest")


# --- Struts ----------------------------------------------------------------------------------


def struts(free: FreeRing, points: tuple[int, int]) -> list[Actuator]:
    """A strut between two points, made longer, and made shorter where there is any length.

    Where the points lie in each other a strut may start in the three directions in which the ring
    yields in the direction of the push: eigenvectors of its compliance.
    """
    rod, state = _renumbered(free, points[0])
    far = (points[1] - points[0]) % rod.n_edges
    weight = _way(rod, far)
    length = rod.length * (1.0 + state.stretch)
    chord = (weight * length) @ rotation(state.quat)[:, :, 2]
    first = float(np.linalg.norm(chord))
    around = float(rod.length.sum())
    along = np.cumsum(rod.cell)[far - 1]
    taut = _TAUT * float(min(along, around - along))
    if first > _ONE_PLACE * around:
        longer = _strutted(free, points, chord / first, first, 1.0, taut - first, APART)
        shorter = _strutted(
            free, points, chord / first, first, -1.0, (1.0 - _MET) * first, TOGETHER
        )
        return [longer, shorter] if taut > first else [shorter]
    first = LIFTED * around
    normal = _normal(free.state)
    return [
        _strutted(
            free,
            points,
            axis,
            first,
            1.0,
            taut - first,
            OUT if abs(float(axis @ normal)) > 0.9 else APART,
        )
        for axis in _yielding(free, points)
    ]


def _way(rod: Rod, far: int) -> Array:
    """Weights (n,) of edges whose sum leads from the middle of edge 0 to that of ``far``."""
    weight = np.zeros(rod.n_edges)
    weight[1:far] = 1.0
    weight[0] = 0.5 * rod.cell[0] / rod.length[0]
    weight[far] = 0.5 * rod.cell[far - 1] / rod.length[far]
    return weight


def _strutted(
    free: FreeRing,
    points: tuple[int, int],
    axis: Array,
    first: float,
    sense: float,
    load_max: float,
    direction: str,
) -> Actuator:
    ring, state = _renumbered(free, points[0])
    n, far = ring.n_edges, (points[1] - points[0]) % ring.n_edges
    length = np.concatenate([ring.length, [0.5 * ring.cell[-1], first]])
    length[0] = 0.5 * ring.cell[0]
    mass = length / length[:-1].sum()
    mass[-1] = 0.0  # how a strut turns is no distance along a path
    rod = ring._replace(length=length, mass=mass[:, None], closed=False)
    closing, placed = np.ones(n + 2), np.zeros(n + 2)
    closing[-1] = 0.0
    placed[:n] = _way(ring, far)
    placed[0], placed[-1] = 1.0, -1.0
    conditions = [(weight, e, 0.0) for weight in (closing, placed) for e in (E1, E2, E3)]
    supports = supported(rod, clamped=(0, n), held=tuple(conditions), reach={n + 1: sense})
    supports.free[[0, n], 3:] = True
    supports.free[-1] = [True, True, False, False][: rod.block]  # nor has it a spin, or a strain
    quat = np.vstack([state.quat, state.quat[:1], _with_tangent(axis)])
    stretch = np.concatenate([state.stretch, [state.stretch[0], 0.0]])
    start = State(quat, stretch, np.zeros(6), 0.0)
    return Actuator(
        "force",
        points,
        direction,
        sense * axis,
        RodSystem(rod, supports, parameter_name="push"),
        start,
        first,
        sense,
        load_max,
        free.rod,
    )


def _with_tangent(axis: Array) -> Array:
    """A frame (4,) whose tangent is ``axis``."""
    half = np.array([1.0 + axis[2], -axis[1], axis[0], 0.0])
    size = float(np.linalg.norm(half))
    return half / size if size > 1e-8 else np.array([0.0, 1.0, 0.0, 0.0])


def _yielding(free: FreeRing, points: tuple[int, int]) -> Array:
    """Directions (3, 3), the softest first, in which a pair of forces moves its points apart."""
    rod, state = _renumbered(free, points[0])
    far = (points[1] - points[0]) % rod.n_edges
    supports = free_supports(rod)
    weight = np.tile(_way(rod, far), (3, 1))
    measured = supports._replace(weight=weight, axis=np.eye(3), target=np.zeros(3))
    border = assemble(rod, measured, state.quat, state.stretch, np.zeros(3), 0.0).border
    compliance = np.empty((3, 3))
    for k in range(3):
        loaded = supports._replace(pull=weight[0][:, None] * np.eye(3)[k])
        t = split(loaded, RodSystem(rod, loaded).correct(state).tangent)
        compliance[:, k] = np.einsum("jbi,jb->i", border, t.q) / t.load
    _, axes = np.linalg.eigh(0.5 * (compliance + compliance.T))
    return np.ascontiguousarray(axes.T[::-1])


# --- Wrenches --------------------------------------------------------------------------------


def wrenches(free: FreeRing, points: tuple[int, int]) -> list[Actuator]:
    """Two wrenches at two points of the planar folded ring, that turn about each of three axes.

    Along the line between the points, across it in the plane, and normal to it. The mirror image
    in its plane maps a folded ring to itself, so that both senses are alike about the first two.
    """
    first, second = (rotation(free.state.quat[j]) for j in points)
    normal = _normal(free.state)
    x = vertices(free.state.quat, free.rod.length * (1.0 + free.state.stretch))
    place = _places(free.rod, free.state, x)
    line = place[points[1]] - place[points[0]]
    if float(np.linalg.norm(line)) < _ONE_PLACE * float(free.rod.length.sum()):
        line = first[:, 2] + second[:, 2]
    line = line - (line @ normal) * normal
    line /= np.linalg.norm(line)
    axes = (
        ("about the line", line),
        ("across the line", np.cross(normal, line)),
        ("about the normal", normal),
    )
    return [
        _wrenched(free, points, axis, sense, name)
        for name, axis in axes
        for sense in ((1.0, -1.0) if axis is normal else (1.0,))
    ]


def _wrenched(
    free: FreeRing, points: tuple[int, int], axis: Array, sense: float, direction: str
) -> Actuator:
    rod, state = _renumbered(free, points[0])
    far = (points[1] - points[0]) % rod.n_edges
    one = np.ones(rod.n_edges)
    supports = supported(
        rod,
        clamped=(0, far),
        held=tuple((one, e, 0.0) for e in (E1, E2, E3)),
        turn={far: sense},
        turn_axis=tuple(axis),
    )
    supports.free[[0, far], 3:] = True
    start = state.but(force=np.zeros(3), load=0.0)
    named = direction if sense > 0.0 else f"{direction}, reversed"
    return Actuator(
        "couple",
        points,
        named,
        sense * axis,
        RodSystem(rod, supports, parameter_name="push"),
        start,
        0.0,
        sense,
        _ROUND,
        free.rod,
    )


def _normal(state: State) -> Array:
    """Normal (3,) of the plane of a planar ring: that of the tangents."""
    return np.asarray(np.linalg.svd(rotation(state.quat)[:, :, 2])[2][2])
