"""The record of a path of a gripped ring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from der.geometry.mesh import sites
from der.kernels.quaternions import Array
from der.problem import Point, Statistics, total_index
from der.records.configurations import Shapes
from der.records.forces import Forces
from der.records.path import AtPi, Path, Timing, counts
from der.records.path import Point as RecordedPoint
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.scene import Scene
from der.utils.run import Run

COLUMNS = ("gamma", "moment", "energy")


def columns(ring: GrippedRing, points: Sequence[Point[Equilibrium]]) -> dict[str, Array]:
    """Return gamma [rad], M of one arm and U of the full ring [GJ/a] at every point, (n,) each."""
    table = np.array([ring.values(one.solution) for one in points]).reshape(-1, len(COLUMNS))
    return dict(zip(COLUMNS, np.ascontiguousarray(table.T), strict=True))


def moment_index(one: Point[Equilibrium], index: int | None) -> int | None:
    """Return the index at given moment: one more if dM/dgamma < 0; None where it vanishes."""
    if index is None or one.kind == "limit":
        return None
    return index + (one.solution.slope < 0.0)


def recorded_points(
    ring: GrippedRing, points: Sequence[Point[Equilibrium]], values: Mapping[str, Array]
) -> tuple[RecordedPoint, ...]:
    """Return the special points, with the index on their two sides."""
    return tuple(
        RecordedPoint(
            one.kind,
            **{name: float(values[name][k]) for name in COLUMNS},
            index_before=total_index(ring, before),
            index_after=total_index(ring, after),
            position=k,
            details=one.details,
        )
        for k, one in enumerate(points)
        for before, after in (one.sides or (one.index, one.index),)
        if one.kind
    )


def path_record(
    scene: Scene,
    ring: GrippedRing,
    points: Sequence[Point[Equilibrium]],
    run: Run,
    statistics: Statistics,
    *,
    numerics: Mapping[str, object],
    values: Mapping[str, Array] | None = None,
    **entries: Any,
) -> Path:
    """Return the record of a path.

    Parameters
    ----------
    values : of every point; None: those of the points' own mesh.
    entries : further entries of `Path`.
    """
    values = columns(ring, points) if values is None else values
    indices = [total_index(ring, one.index) for one in points]
    timing = Timing(run.seconds, statistics.newton_iterations, statistics.steps)
    found: dict[str, Any] = {"at_pi": None, "mode": None, "error": None, **values, **entries}
    return Path(
        solver="der",
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        scale=scene.scale,
        numerics=numerics,
        index=counts(indices),
        index_moment=counts(map(moment_index, points, indices)),
        points=recorded_points(ring, points, values),
        timing=timing,
        status=run.status,
        message=run.message,
        reason="" if run.reason is None else run.reason.word,
        **found,
    )


def full_shapes(
    scene: Scene, ring: GrippedRing, points: Sequence[Point[Equilibrium]], *, modes: bool
) -> Shapes | None:
    """Return the full ring at every point, with snaps and modes if asked for; None: no points."""
    if not points:
        return None
    from der.analysis.full_ring import shapes

    arc_length = sites(scene.ring, scene.n_edges, "full")[:-1]
    found = shapes(ring, points, arc_length, history=scene.history, modes=modes)
    if not scene.forces:
        return found
    from der.rod.forces import internal

    return replace(found, internal=internal(ring, points))


def kept_forces(
    scene: Scene, ring: GrippedRing, points: Sequence[Point[Equilibrium]]
) -> Forces | None:
    """Return the forces and moments of grips and arms if they were asked for."""
    if not scene.forces or not points:
        return None
    from der.rod.forces import forces

    return forces(ring, points)


def state_at_pi(ring: GrippedRing, one: Point[Equilibrium], index_free: int | None) -> AtPi:
    """Return the record of the state at gamma = pi."""
    _, moment, energy = ring.values(one.solution)
    index = total_index(ring, one.index)
    slope = ring.arm_moment(one.solution.slope)
    return AtPi(moment, slope, energy, index, moment_index(one, index), index_free)


def mesh_numerics(scene: Scene, ring: GrippedRing) -> dict[str, object]:
    """Return the numerical choices behind an answer, as they are recorded."""
    names = ("curvature", "stretch", "a_over_t", "tolerance")
    own = {name: getattr(scene, name) for name in names}
    return {"n_edges": scene.n_edges, "sector": ring.name, **own}
