"""A planar ring whose two points on the twisting axis are moved together or apart: the elastica.

The strut between the points is one more edge without bending stiffness, free to turn. Its length is
the load, and the force that parts the points is its conjugate, dU/d distance. Strands may pass
through each other.

Error bars compare states at the same ratio of the distance to that of the flat ring, which has an
error of its own on a mesh. States on N/2 and N/4 edges start from every second and fourth edge of
the fine mesh. Special points are found on each mesh and matched in their order.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from der.analysis.planar.planar_states import OPTIONS, check_planar, coarser, planar_numerics
from der.analysis.run_record import run_entries
from der.continuation.arclength import follow
from der.continuation.events import Events
from der.continuation.richardson import limit
from der.errors import ContinuationFailed, Reason
from der.kernels.planar import Array
from der.problem import Options, Point
from der.records.planar import Squeeze, SqueezePoint
from der.rod.planar_ring import PlanarRing, covered, planar_ring, shapes
from der.rod.planar_system import PlanarConfiguration, PlanarEquilibrium, PlanarRodSystem, solved
from der.scene import Scene
from der.utils.checks import checked_number
from der.utils.run import Run

_THERE = 1e-9  # of the distance: the flat ring is at its goal
_SAME = 0.3  # rad: a state on another mesh that is further away is another state


def squeeze(scene: Scene, distance: float = 0.0) -> Squeeze:
    """Return the path of a planar ring whose points on the twisting axis are moved.

    Parameters
    ----------
    scene : ring, section and mesh, and whether error bars are wanted; its control does not matter.
        Points on the ring's other axis are those of the ring with that twisting axis.
    distance : between the points at the end, a: from 0, where they touch, to less than half the
        ring's length, where the ring would be straight.

    Returns
    -------
    Squeeze
        States, special points and shapes. If the path cannot be followed to its end, ``status``
        and ``message`` say why. Ctrl-C keeps the states found so far.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed.
    """
    check_planar(scene)
    straight = 0.5 * scene.ring.length
    allowed = f"a number from 0 to less than {straight:.6g} (the ring drawn straight)"
    goal = checked_number("distance", distance, allowed, lambda d: 0.0 <= d < straight)
    track = _Track.of(planar_ring(scene), scene)
    with Run() as run:
        points = run.collect(track.path(goal))
        values, errors = _extrapolated(track, points, goal, scene)
    special = [k for k, one in enumerate(points) if one.kind]
    column = dict(zip(("distance", "force", "energy"), values.T, strict=True))
    return Squeeze(
        **run_entries(scene, run),
        numerics=planar_numerics(scene),
        goal=goal,
        **column,
        index=tuple(one.solution.index for one in points),
        force_error=errors[:, 1],
        energy_error=errors[:, 2],
        points=tuple(_point(points[k], values[k], errors[k]) for k in special),
        shapes=shapes(track.mesh, [one.solution.phi[:-1] for one in points]) if points else None,
    )


@dataclass(frozen=True, eq=False)
class _Track:
    """A ring on its mesh with a strut in it."""

    mesh: PlanarRing
    system: PlanarRodSystem
    flat: PlanarEquilibrium
    first: float  # distance between the points of the flat ring on this mesh
    scale: float  # that over the distance of the exact ring; 1 without error bars
    alpha: float
    options: Options

    @classmethod
    def of(cls, mesh: PlanarRing, scene: Scene) -> _Track:
        """The flat ring at rest."""
        flat = solved(mesh.rod(1), covered(mesh, 1), np.zeros(2), tolerance=scene.tolerance)
        first = float(mesh.chord() @ (mesh.length * np.sin(flat.phi)))
        ends = scene.ring.position([0.0, 0.5 * scene.ring.length])
        scale = first / float(ends[1, 2] - ends[0, 2]) if scene.error_bars else 1.0
        system = PlanarRodSystem(mesh.strutted(), parameter_name="distance")
        options = replace(OPTIONS, tolerance=scene.tolerance)
        return cls(mesh, system, flat, first, scale, scene.section.alpha, options)

    def path(self, goal: float) -> Iterator[Point[PlanarEquilibrium]]:
        """Points from the flat ring to a distance, special points included."""
        forces = np.append(self.flat.force, [0, 0])
        start = self.at(self.first, self.flat.phi, 0.5 * math.pi, forces)
        if not start.converged:
            raise ContinuationFailed(
                f"the flat ring was not found at rest, use more edges: {start.advice}",
                Reason.NO_START,
            )
        goal = goal * self.scale
        if abs(goal - self.first) < _THERE * self.first:
            yield Point(start)
            return
        events: Events[PlanarConfiguration] = Events(
            targets=(goal,),
            stop=lambda at: at.parameter == goal,
            limits=("moment",),
            stability=True,
        )
        along = self.system.increment(load=math.copysign(1.0, goal - self.first))
        yield from follow(self.system, start.state, events, along=along, options=self.options)

    def at(self, length: float, phi: Array, turn: float, force: Array) -> PlanarEquilibrium:
        """The state with a strut of given length, near a configuration."""
        start = PlanarConfiguration(np.append(phi, turn), force, length)
        return self.system.correct(start, tolerance=self.options.tolerance)

    def values(self, one: PlanarEquilibrium) -> Array:
        """Distance, force and energy (3,), the distance without the error of the flat ring."""
        return np.array(
            [one.parameter / self.scale, self.alpha * one.moment, self.alpha * one.energy]
        )


def _extrapolated(
    track: _Track, points: list[Point[PlanarEquilibrium]], goal: float, scene: Scene
) -> tuple[Array, Array]:
    """Distance, force and energy (n, 3) of the states, and errors (n, 3); NaN: not known."""
    values = np.array([track.values(one.solution) for one in points]).reshape(-1, 3)
    errors = np.full_like(values, np.nan)
    levels = [_Track.of(mesh, scene) for mesh in coarser(scene)]
    special = [k for k, one in enumerate(points) if one.kind]
    others = [_special(level, points, goal) for level in levels] if special else []
    known = []
    for k, one in enumerate(points if levels else ()):
        if one.kind:
            same = [other[special.index(k)] for other in others if other]
        else:
            same = [found for level in levels for found in _again(level, track, one.solution)]
        if len(same) == len(levels):
            known.append((k, [values[k], *same]))
    if known:
        rows, tables = zip(*known, strict=True)
        even = not any(one.mesh.kinks_in_cells for one in (track, *levels))
        table = np.array(tables).swapaxes(0, 1)
        values[list(rows)], errors[list(rows)] = limit(table, even=even)
    return values, errors


def _again(level: _Track, fine: _Track, one: PlanarEquilibrium) -> list[Array]:
    """Values of the same state on a coarser mesh; empty: there is none."""
    every = fine.mesh.n_edges // level.mesh.n_edges
    length = one.parameter * level.scale / fine.scale
    at = level.at(length, one.phi[:-1:every], float(one.phi[-1]), one.force)
    near = np.abs(at.phi[:-1] - one.phi[:-1:every]).max() < _SAME if at.converged else False
    return [level.values(at)] if near else []


def _special(level: _Track, points: list[Point[PlanarEquilibrium]], goal: float) -> list[Array]:
    """Values of the special points of a coarser mesh; empty: they are of other kinds."""
    try:
        found = list(level.path(goal))
    except ContinuationFailed:
        return []
    alike = [one.kind for one in found if one.kind] == [one.kind for one in points if one.kind]
    return [level.values(one.solution) for one in found if one.kind] if alike else []


def _point(one: Point[PlanarEquilibrium], values: Array, errors: Array) -> SqueezePoint:
    (before,), (after,) = one.sides or (one.index or (None,), one.index or (None,))
    distance, force, energy = map(float, values)
    known = [None if np.isnan(error) else float(error) for error in errors]
    return SqueezePoint(one.kind, distance, force, energy, before, after, *known)
