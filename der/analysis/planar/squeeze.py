"""A ring between two opposite points of its plane, brought together or drawn apart: the elastica.

The points are those of the twisting axis, and the strut between them turns as it likes: it is one
more edge, which nothing bends, and its length is the load. What draws the points apart is its
conjugate, dU/d distance. Strands pass through each other.

Error bars are those of an equal share of the flat ring's distance, which has an error of its own on
a mesh: from states on N/2 and N/4 edges that start at every second and fourth edge of the fine
one's. Special points are found on each mesh and matched in their order.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from der.analysis.planar.planar_states import check_planar, coarser, planar_numerics
from der.continuation.richardson import limit
from der.errors import STOPPED
from der.kernels.planar import Array, PlanarRod
from der.records.planar import Squeeze, SqueezePoint
from der.records.record import SolveTime
from der.rod.planar_march import Lost, Solved, Stop, kinds, march, solved
from der.rod.planar_ring import PlanarRing, covered, planar_ring, shapes
from der.scene import Scene
from der.utils.checks import checked_number
from der.utils.interrupts import interrupts_between_states

_THERE = 1e-9  # of the distance: the flat ring is where it should go
_SAME = 0.3  # rad: a state on another mesh that is further away is another state


def squeeze(scene: Scene, distance: float = 0.0) -> Squeeze:
    """The path of a flat ring whose points on the twisting axis are moved, in its plane.

    Parameters
    ----------
    scene : ring, section and mesh, and whether error bars are wanted; how it is controlled does not
        matter. Points on the ring's other axis are those of the ring with that twisting axis.
    distance : between the points at the end, a: 0 where they touch, below half the ring's length,
        where it would be drawn straight.

    Returns
    -------
    Squeeze
        States, special points and shapes. A path that cannot be followed to its end says so in
        ``status`` and ``message``; Ctrl-C keeps what was found.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed.
    """
    check_planar(scene)
    straight = 0.5 * scene.ring.length
    allowed = f"a number from 0 to less than {straight:.6g} (the ring drawn straight)"
    goal = checked_number("distance", distance, allowed, lambda d: 0.0 <= d < straight)
    began = time.perf_counter()
    track = _Track.of(planar_ring(scene), scene)
    stops: list[Stop] = []
    status, message = "done", ""
    with interrupts_between_states() as pressed:
        try:
            for stop in track.path(goal):
                stops.append(stop)
                if pressed:
                    status, message = "interrupted", STOPPED
                    break
        except Lost as lost:
            status, message = "not converged", f"{lost} a between the points"
        found = _extrapolated(track, stops, goal, scene)
    special = [k for k, stop in enumerate(stops) if stop.kind]
    column = dict(zip(("distance", "force", "energy"), found.values.T, strict=True))
    return Squeeze(
        status=status,
        message=message,
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=planar_numerics(scene),
        goal=goal,
        **column,
        index=tuple(stop.at.index for stop in stops),
        force_error=found.errors[:, 1],
        energy_error=found.errors[:, 2],
        points=tuple(_point(stops[k], found.values[k], found.errors[k]) for k in special),
        timing=SolveTime(time.perf_counter() - began),
        shapes=shapes(track.mesh, [stop.at.phi[:-1] for stop in stops]) if stops else None,
    )


@dataclass(frozen=True, eq=False)
class _Track:
    """A ring on its mesh with a strut in it."""

    mesh: PlanarRing
    rod: PlanarRod
    flat: Solved
    first: float  # distance between the points of the flat ring on this mesh
    scale: float  # that over the distance of the ring itself; 1 without error bars
    alpha: float
    tolerance: float

    @classmethod
    def of(cls, mesh: PlanarRing, scene: Scene) -> _Track:
        """The flat ring at rest."""
        flat = solved(mesh.rod(1), covered(mesh, 1), np.zeros(2), tolerance=scene.tolerance)
        first = float(mesh.way() @ (mesh.length * np.sin(flat.phi)))
        ends = scene.ring.position([0.0, 0.5 * scene.ring.length])
        scale = first / float(ends[1, 2] - ends[0, 2]) if scene.error_bars else 1.0
        alpha = scene.section.alpha
        return cls(mesh, mesh.strutted(), flat, first, scale, alpha, scene.tolerance)

    def path(self, goal: float) -> Iterator[Stop]:
        """States from the flat ring on to a distance, special points in their places."""
        start = self.at(
            self.first, self.flat.phi, 0.5 * math.pi, np.append(self.flat.force, [0, 0])
        )
        if not start.converged:
            raise Lost(f"the flat ring was not found at rest, use more edges: {self.first:.8g}")
        if abs(goal * self.scale - self.first) < _THERE * self.first:
            yield Stop(start)
            return
        goal = goal * self.scale
        yield from march(self.rod, start, goal, special=True, tolerance=self.tolerance)

    def at(self, length: float, phi: Array, turn: float, force: Array) -> Solved:
        """The state with a strut of a length, near a configuration."""
        rod = self.rod
        if length == 0.0:  # such a strut has no direction
            rod = rod._replace(free=rod.free & (rod.reach == 0.0))
        return solved(rod, np.append(phi, turn), force, length, tolerance=self.tolerance)

    def values(self, one: Solved) -> Array:
        """Distance, force and energy (3,), the distance as a share of the ring's own."""
        return np.array([one.load / self.scale, self.alpha * one.moment, self.alpha * one.energy])


@dataclass(frozen=True, eq=False)
class _Columns:
    """What is known about the states of a path."""

    values: Array  # (n, 3) distance, force, energy
    errors: Array  # (n, 3) NaN: not known


def _extrapolated(track: _Track, stops: list[Stop], goal: float, scene: Scene) -> _Columns:
    """Values of the states, with errors where there are coarser meshes."""
    values = np.array([track.values(stop.at) for stop in stops]).reshape(-1, 3)
    errors = np.full_like(values, np.nan)
    levels = [_Track.of(mesh, scene) for mesh in coarser(scene)]
    special = [k for k, stop in enumerate(stops) if stop.kind]
    others = [_special(level, stops, goal) for level in levels] if special else []
    for k, stop in enumerate(stops if levels else ()):
        if stop.kind:
            same = [other[special.index(k)] for other in others if other]
        else:
            same = [found for level in levels for found in _again(level, track, stop.at)]
        if len(same) < len(levels):
            continue
        for c in range(3):
            values[k, c], errors[k, c] = limit(values[k, c], same[0][c], same[1][c])
    return _Columns(values, errors)


def _again(level: _Track, fine: _Track, one: Solved) -> list[Array]:
    """Values of the same state on a coarser mesh; none where there is none."""
    every = fine.mesh.n_edges // level.mesh.n_edges
    length = one.load * level.scale / fine.scale
    at = level.at(length, one.phi[:-1:every], float(one.phi[-1]), one.force)
    near = np.abs(at.phi[:-1] - one.phi[:-1:every]).max() < _SAME if at.converged else False
    return [level.values(at)] if near else []


def _special(level: _Track, stops: list[Stop], goal: float) -> list[Array]:
    """Values of the special points of a coarser mesh; none where they are others."""
    try:
        found = list(level.path(goal))
    except Lost:
        return []
    alike = kinds(found) == kinds(stops)
    return [level.values(stop.at) for stop in found if stop.kind] if alike else []


def _point(stop: Stop, values: Array, errors: Array) -> SqueezePoint:
    distance, force, energy = map(float, values)
    known = [None if np.isnan(error) else float(error) for error in errors]
    return SqueezePoint(
        stop.kind,
        distance,
        force,
        energy,
        stop.before,
        stop.after,
        distance_error=known[0],
        force_error=known[1],
        energy_error=known[2],
    )
