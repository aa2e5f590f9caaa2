"""The energy landscape over two coordinates: twist, and distance of the grips.

On the path of twisting the grips slide freely. Here their distance is prescribed, too: one more
position condition, whose multiplier is the axial force. From the path, minima spread over a grid
(`flood`).

The minima are those of the sector, that is, of shapes with the symmetry of a ring in its grips. The
index of the full ring at given distance tells which of them are unstable to modes that break this
symmetry.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from der.analysis.landscape.flood import Cell, Flood, shaken, spread
from der.analysis.landscape.landscape import bare_request, distance
from der.analysis.landscape.rest_states import with_rests
from der.analysis.loading import follow_angle
from der.analysis.path_record import mesh_numerics
from der.analysis.request import Request, ring_of
from der.analysis.run_record import run_entries
from der.analysis.snap import Landing
from der.errors import ContinuationFailed
from der.kernels.quaternions import Array
from der.problem import Point, Statistics
from der.records.energy_surface import NoMinimum, Surface
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import E3, GrippedRing
from der.rod.rod import State
from der.rod.stability import index
from der.rod.supports import Supports
from der.scene import Scene
from der.utils.run import Run

STRETCHED = 0.97  # of half the ring's length: beyond, the closing conditions lose their rank
_CEILING = 1.5  # of the path's largest energy: only the lowest minimum of a cell may be higher
_MARGIN = 0.25  # of the path's range of distances, on both sides of it
_SHAKES = 6  # cells in each direction from which separate sheets of minima are looked for
_KEPT = 12  # gradients between kept configurations of a snap


def energy_surface(
    scene: Scene,
    *,
    shape: tuple[int, int] = (60, 60),
    gamma: Sequence[float] | None = None,
    distance_range: tuple[float, float] | None = None,
    snaps: bool = True,
    progress: Callable[[float], object] | None = None,
) -> Surface:
    """Return the least energy over twist and grip distance.

    Parameters
    ----------
    scene : ring, section and mesh.
    shape : number of values of gamma and of the distance.
    gamma : values of gamma [rad]; None: from 0 to pi.
    distance_range : smallest and largest distance [a]; None: those of the path with a margin.
    snaps : whether to load and unload the ring by the angle, and keep the paths of its snaps.
    progress : called with the share of the cells that have a minimum.

    Raises
    ------
    ValueError
        For a scene on the full ring, or a range beyond full stretch.

    Notes
    -----
    Ctrl-C keeps the cells found so far; see ``status``. A cell without a minimum has a sentence
    in ``reasons``.
    """
    ring = ring_of(scene)
    if ring.name == "full":
        raise ValueError("sector must be auto, half or quarter for a surface, got 'full'")
    angles = np.linspace(0.0, math.pi, shape[0]) if gamma is None else np.array(gamma, dtype=float)
    request = replace(bare_request(scene), targets=tuple(angles))
    with Run() as run:
        points = run.collect(request.follow(ring))
        if run.status == "not converged":  # a surface around the path found so far
            run.status, run.message = "done", f"the path of twisting: {run.message}"
        points, without_load = with_rests(ring, request, points, Statistics())
        line = np.array([_place(ring, one.solution) for one in points])
        low, high = _range(scene, line[:, 1], distance_range)
        distances = np.linspace(low, high, shape[1])
        ceiling = _CEILING * float(line[:, 2].max())
        flood = Flood(ring, _with_distance(ring), angles, distances, scene.tolerance, ceiling)
        spread(flood, _seeds(flood, points), run, progress)
        spread(flood, shaken(flood, _SHAKES), run, progress)
        snapped = _snaps(ring, request, float(angles[-1]), run) if snaps and run.done else ()
    return Surface(
        **run_entries(scene, run),
        numerics=mesh_numerics(scene, ring) | {"shape": list(shape), "ceiling": flood.ceiling},
        gamma=angles,
        distance=flood.distance,
        **_maps(flood),
        reasons=_reasons(flood, run.status),
        path=line,
        folds=line[[k for k, one in enumerate(points) if one.kind == "fold"]],
        rests=line[without_load],
        snaps=snapped,
    )


def _with_distance(ring: GrippedRing) -> Supports:
    """The sector's supports with the distance of its ends as their last condition."""
    supports = ring.supports
    return supports._replace(
        weight=np.vstack([supports.weight, np.ones(ring.rod.n_edges)]),
        axis=np.vstack([supports.axis, E3]),
        target=np.append(supports.target, 0.0),
    )


def _place(ring: GrippedRing, at: Equilibrium) -> tuple[float, float, float]:
    return at.parameter, distance(ring, at), ring.copies * at.energy


def _range(
    scene: Scene, along_path: Array, given: tuple[float, float] | None
) -> tuple[float, float]:
    """Range of distances: that of the path with a margin, below full stretch."""
    longest = 0.5 * scene.ring.length
    low, high = float(along_path.min()), float(along_path.max())
    margin = _MARGIN * max(high - low, 0.2 * scene.ring.length / math.pi)
    low, high = given or (low - margin, min(high + margin, STRETCHED * longest))
    if not low < high <= longest:
        raise ValueError(
            f"distance_range must rise to at most half the ring's length, {longest:g},"
            f" got {(low, high)}"
        )
    return low, high


def _seeds(flood: Flood, points: Sequence[Point[Equilibrium]]) -> Iterator[tuple[Cell, State]]:
    """States of the path at the angles of the grid, each in the cell of the nearest distance."""
    for i, turn in enumerate(flood.gamma):
        for one in points:
            if one.solution.parameter == turn and one.kind == "":
                away = np.abs(flood.distance - distance(flood.ring, one.solution))
                state = one.solution.state  # no axial force acts on it
                yield (i, int(np.argmin(away))), state.but(force=np.append(state.force, 0.0))


def _maps(flood: Flood) -> dict[str, Any]:
    """Energy, moment, force and index of the lowest minimum in each cell, and all energies."""
    n, m = len(flood.gamma), len(flood.distance)
    energy, moment, force = (np.full((n, m), np.nan) for _ in range(3))
    indices = np.full((n, m), -1, dtype=np.int64)
    ring = flood.ring
    for i, j in flood.minima:
        best = flood.among((i, j))[0]
        energy[i, j] = best.energy
        moment[i, j] = ring.arm_moment(best.solution.moment)
        # L holds + F (span - share d): dU/dd = -F share for each of the copies
        force[i, j] = -flood.share * ring.copies * best.solution.state.force[-1]
        indices[i, j] = _index(ring, flood.system(flood.distance[j]).supports, best.solution.state)
    levels = tuple(
        tuple(tuple(one.energy for one in flood.among((i, j))) for j in range(m)) for i in range(n)
    )
    return {"energy": energy, "moment": moment, "force": force, "index": indices, "minima": levels}


def _index(ring: GrippedRing, supports: Supports, state: State) -> int:
    """Index of the full ring with twist and distance held; -1: not known.

    The arms are then independent: modes in phase and out of phase have the same stiffness.
    """
    total = 0
    for label, (multiplicity, modes) in ring.symmetry.items():
        if label == "in phase":
            continue
        count = index(ring.rod, supports, modes, state)
        if count is None:
            return -1
        total += count * (2 if label == "out of phase" else multiplicity)
    return total


def _reasons(flood: Flood, status: str) -> tuple[NoMinimum, ...]:
    """Why cells have no minimum, for all of them."""
    unseen = (
        "not reached before the computation was stopped"
        if status == "interrupted"
        else "no neighbour has a minimum"
    )
    return tuple(
        NoMinimum(gamma, distance, flood.reasons.get((i, j), unseen))
        for i, gamma in enumerate(flood.gamma)
        for j, distance in enumerate(flood.distance)
        if (i, j) not in flood.minima
    )


def _snaps(ring: GrippedRing, request: Request, last: float, run: Run) -> tuple[Array, ...]:
    """Gamma, distance and energy along every snap of loading to the last angle and back."""
    asked = replace(request, gamma_max=last, until_folded=False, targets=())
    loading = follow_angle(ring, asked, Statistics(), unload=True, every=_KEPT)
    points: list[Point[Equilibrium]] = []
    with suppress(ContinuationFailed):  # what snapped before it is kept
        for point in loading:
            points.append(point)
            if not run.done:
                break
    return tuple(
        _along_snap(ring, before.solution, one)
        for before, one in pairwise(points)
        if isinstance(one, Landing) and one.history
    )


def _along_snap(ring: GrippedRing, before: Equilibrium, landing: Landing) -> Array:
    """Gamma, distance and energy from the state before a snap to the one after it."""
    at = landing.solution
    rows = [
        (state.load, distance(ring, replace(at, state=state)), energy)
        for state, energy in zip(landing.history, landing.energies, strict=True)
    ]
    return np.array([_place(ring, before), *rows, _place(ring, at)])
