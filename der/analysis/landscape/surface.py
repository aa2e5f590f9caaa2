"""The energy landscape over two coordinates: twist, and distance of the grips.

On the path of twisting the grips slide as they like. Here their distance is prescribed, too: one
more position condition, whose multiplier is the axial force. From the path on, minima spread over
a grid (`landscape_flood`).

Minima are those of the sector: of shapes with the symmetry of a ring in its grips. The index of
the full ring, distance supports, says where one of them can be left by breaking the symmetry.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace

import numpy as np

from der.analysis.landscape.flood import Cell, Flood, shaken, spread
from der.analysis.landscape.landscape import FARTHEST, distance, numerics, scene_sector
from der.analysis.landscape.rest_states import with_rests
from der.analysis.loading import follow_angle
from der.analysis.snap import Landing
from der.continuation.arclength import follow
from der.continuation.events import Point, Wanted
from der.continuation.step import ContinuationFailed, Statistics
from der.errors import STOPPED
from der.kernels.quaternions import Array
from der.records.energy_surface import Surface
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import E3, GrippedRing
from der.rod.rod import State
from der.rod.stability import index
from der.rod.supports import Supports
from der.scene import Scene
from der.utils.interrupts import interrupts_between_states

STRETCHED = 0.97  # of half the ring's length: beyond, closing conditions lose their rank
_CEILING = 1.5  # of the path's largest energy: other minima that lie higher are of no interest
_MARGIN = 0.25  # of the path's range of distances, on both sides of it
_SHAKES = 6  # cells in each direction from which minima apart from the rest are looked for
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
    """Least energy over twist and grip distance.

    Parameters
    ----------
    scene : ring, section and mesh.
    shape : number of values of gamma and of the distance.
    gamma : values of gamma [rad]; None: from 0 to pi.
    distance_range : smallest and largest distance [a]; None: those of the path, and some more.
    snaps : whether to turn the grips up and down and keep the ways in which the ring snaps.
    progress : called with the share of the cells that have a minimum.

    Raises
    ------
    ValueError
        For a scene on the full ring, or a range beyond full stretch.

    Notes
    -----
    Ctrl-C keeps what there is; see ``status``. A cell without a minimum has a sentence in
    ``reasons``.
    """
    started = time.perf_counter()
    ring = scene_sector(scene, scene.sector)
    if ring.name == "full":
        raise ValueError("sector must be auto, half or quarter for a surface, got 'full'")
    angles = np.linspace(0.0, math.pi, shape[0]) if gamma is None else np.array(gamma, dtype=float)
    statistics = Statistics()
    wanted = Wanted(
        load_max=FARTHEST,
        until_folded=True,
        targets=tuple(angles),
        stability=False,
        contacts=False,
        tolerance=scene.tolerance,
        most_steps=600,
    )
    with interrupts_between_states() as pressed:
        points, message = _path(ring, wanted, statistics, pressed)
        points, at_rest = with_rests(ring, wanted, points, statistics)
        line = np.array([_place(ring, one.solution) for one in points])
        low, high = _range(scene, line[:, 1]) if distance_range is None else distance_range
        if not low < high <= 0.5 * scene.ring.length:
            raise ValueError(
                f"distance_range must rise to at most half the ring's length, "
                f"{0.5 * scene.ring.length:g}, got {(low, high)}"
            )
        flood = Flood(
            ring,
            _with_distance(ring),
            0.5 if ring.name == "quarter" else 1.0,
            angles,
            np.linspace(low, high, shape[1]),
            scene.tolerance,
            _CEILING * float(line[:, 2].max()),
        )
        spread(flood, _seeds(flood, points), pressed, progress)
        spread(flood, shaken(flood, _SHAKES), pressed, progress)
        fallen = _snaps(ring, wanted, angles, pressed) if snaps else ()
    status = "interrupted" if pressed else "done"
    message = STOPPED if pressed else message
    folds = line[[k for k, one in enumerate(points) if one.kind == "fold"]]
    return Surface(
        scene.ring.to_json(),
        asdict(scene.section),
        numerics(scene, ring) | {"shape": list(shape), "ceiling": flood.ceiling},
        angles,
        flood.distance,
        *_maps(flood),
        _reasons(flood, status),
        (line[:, 0], line[:, 1], line[:, 2]),
        folds,
        line[at_rest],
        fallen,
        status,
        message,
        time.perf_counter() - started,
    )


def _with_distance(ring: GrippedRing) -> Supports:
    """The sector's supports with the distance of its ends as their last condition."""
    supports = ring.supports
    return supports._replace(
        weight=np.vstack([supports.weight, np.ones(ring.rod.n_edges)]),
        axis=np.vstack([supports.axis, E3]),
        target=np.append(supports.target, 0.0),
    )


def _path(
    ring: GrippedRing, wanted: Wanted, statistics: Statistics, pressed: list[int]
) -> tuple[list[Point], str]:
    """States of the path, as far as it goes, and a sentence where that is not to its end."""
    points: list[Point] = []
    try:
        for one in follow(ring, wanted, statistics):
            points.append(one)
            if pressed:
                break
    except ContinuationFailed as stuck:
        return points, f"the path of twisting: {stuck}"
    return points, ""


def _place(ring: GrippedRing, at: Equilibrium) -> tuple[float, float, float]:
    return at.state.load, distance(ring, at), ring.copies * at.energy


def _range(scene: Scene, along_path: Array) -> tuple[float, float]:
    """Distances to be looked at: those of the path with a margin, short of full stretch."""
    low, high = float(along_path.min()), float(along_path.max())
    margin = _MARGIN * max(high - low, 0.2 * scene.ring.length / math.pi)
    return low - margin, min(high + margin, STRETCHED * 0.5 * scene.ring.length)


def _seeds(flood: Flood, points: Sequence[Point]) -> Iterator[tuple[Cell, State]]:
    """States of the path at the angles of the grid, each in the cell of the nearest distance."""
    for i, turn in enumerate(flood.gamma):
        for one in points:
            if one.solution.parameter == turn and one.kind == "":
                away = np.abs(flood.distance - distance(flood.ring, one.solution))
                state = one.solution.state  # no axial force acts on it
                yield (i, int(np.argmin(away))), state.but(force=np.append(state.force, 0.0))


def _maps(
    flood: Flood,
) -> tuple[Array, Array, Array, np.ndarray, tuple[tuple[tuple[float, ...], ...], ...]]:
    """Energy, moment, force and index of the lowest minimum in each cell, and all energies."""
    n, m = len(flood.gamma), len(flood.distance)
    energy, moment, force = (np.full((n, m), np.nan) for _ in range(3))
    ways = np.full((n, m), -1, dtype=np.int64)
    ring = flood.ring
    for i, j in flood.minima:
        best = flood.among((i, j))[0]
        energy[i, j] = best.energy
        moment[i, j] = ring.moment(best.solution.moment)
        # L holds + F (span - share d): dU/dd = -F share for each of the copies
        force[i, j] = -flood.share * ring.copies * best.solution.state.force[-1]
        ways[i, j] = _index(ring, flood.supports(flood.distance[j]), best.solution.state)
    levels = tuple(
        tuple(tuple(one.energy for one in flood.among((i, j))) for j in range(m)) for i in range(n)
    )
    return energy, moment, force, ways, levels


def _index(ring: GrippedRing, supports: Supports, state: State) -> int:
    """Index of the full ring with twist and distance held; -1 where it is not known.

    The arms no longer know of each other: modes in phase and out of phase are alike.
    """
    total = 0
    for label, (multiplicity, modes) in ring.classes.items():
        if label == "in phase":
            continue
        count = index(ring.rod, supports, modes, state)
        if count is None:
            return -1
        total += count * (2 if label == "out of phase" else multiplicity)
    return total


def _reasons(flood: Flood, status: str) -> dict[Cell, str]:
    """Why cells have no minimum, for all of them."""
    unseen = (
        "not reached before the computation was stopped"
        if status == "interrupted"
        else "no neighbour has a minimum"
    )
    cells = np.ndindex(len(flood.gamma), len(flood.distance))
    return {
        (i, j): flood.reasons.get((i, j), unseen) for i, j in cells if (i, j) not in flood.minima
    }


def _snaps(
    ring: GrippedRing, wanted: Wanted, angles: Array, pressed: list[int]
) -> tuple[Array, ...]:
    """Gamma, distance and energy along every snap on the way to the last angle and back."""
    asked = replace(wanted, load_max=float(angles[-1]), until_folded=False, targets=())
    found: list[Array] = []
    before: Point | None = None
    try:
        for one in follow_angle(ring, asked, Statistics(), unload=True, every=_KEPT):
            if isinstance(one, Landing) and one.history and before is not None:
                found.append(_fall(ring, before.solution, one))
            before = one
            if pressed:
                break
    except ContinuationFailed:
        pass  # what snapped before it is kept
    return tuple(found)


def _fall(ring: GrippedRing, before: Equilibrium, landing: Landing) -> Array:
    """Gamma, distance and energy on the way down."""
    at = landing.solution
    rows = [
        (state.load, distance(ring, replace(at, state=state)), energy)
        for state, energy in zip(landing.history, landing.energies, strict=True)
    ]
    return np.array([_place(ring, before), *rows, _place(ring, at)])
