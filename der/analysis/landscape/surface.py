"""The energy landscape over two coordinates: twist, and distance of the grips.

On the path of twisting the grips slide as they like. Here their distance is prescribed, too: one
more position condition, whose multiplier is the axial force. From the path on, minima spread over
a grid (`landscape_flood`).

Minima are those of the sector: of shapes with the symmetry of a ring in its grips. The index of
the full ring, distance held, says where one of them can be left by breaking the symmetry.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from der.analysis.landscape.flood import Cell, Flood, shaken, spread
from der.analysis.landscape.landscape import FARTHEST, distance, numerics, scene_sector
from der.analysis.landscape.rest_states import with_rests
from der.analysis.loading import follow_angle
from der.analysis.snap import Landing
from der.continuation.arclength import follow
from der.continuation.events import Visit, Wanted
from der.continuation.step import Stuck, Tally
from der.errors import STOPPED
from der.kernels.quaternions import Array
from der.records.energy_surface import NoMinimum, Surface
from der.records.record import SolveTime
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import E3, Sector
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
    piece = scene_sector(scene, scene.sector)
    if piece.name == "full":
        raise ValueError("sector must be auto, half or quarter for a surface, got 'full'")
    angles = np.linspace(0.0, math.pi, shape[0]) if gamma is None else np.array(gamma, dtype=float)
    tally = Tally()
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
        visits, message = _path(piece, wanted, tally, pressed)
        visits, at_rest = with_rests(piece, wanted, visits, tally)
        line = np.array([_place(piece, one.at) for one in visits])
        low, high = _range(scene, line[:, 1]) if distance_range is None else distance_range
        if not low < high <= 0.5 * scene.ring.length:
            raise ValueError(
                f"distance_range must rise to at most half the ring's length, "
                f"{0.5 * scene.ring.length:g}, got {(low, high)}"
            )
        flood = Flood(
            piece,
            _with_distance(piece),
            0.5 if piece.name == "quarter" else 1.0,
            angles,
            np.linspace(low, high, shape[1]),
            scene.tolerance,
            _CEILING * float(line[:, 2].max()),
        )
        spread(flood, _seeds(flood, visits), pressed, progress)
        spread(flood, shaken(flood, _SHAKES), pressed, progress)
        fallen = _snaps(piece, wanted, angles, pressed) if snaps else ()
    status = "interrupted" if pressed else "done"
    message = STOPPED if pressed else message
    folds = line[[k for k, one in enumerate(visits) if one.kind == "fold"]]
    return Surface(
        status=status,
        message=message,
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=numerics(scene, piece) | {"shape": list(shape), "ceiling": flood.ceiling},
        gamma=angles,
        distance=flood.distance,
        **_maps(flood),
        reasons=_reasons(flood, status),
        path=line,
        folds=folds,
        rests=line[at_rest],
        snaps=fallen,
        timing=SolveTime(time.perf_counter() - started),
    )


def _with_distance(piece: Sector) -> Supports:
    """The sector's supports with the distance of its ends as their last condition."""
    held = piece.held
    return held._replace(
        weight=np.vstack([held.weight, np.ones(piece.body.n_edges)]),
        axis=np.vstack([held.axis, E3]),
        target=np.append(held.target, 0.0),
    )


def _path(
    piece: Sector, wanted: Wanted, tally: Tally, pressed: list[int]
) -> tuple[list[Visit], str]:
    """States of the path, as far as it goes, and a sentence where that is not to its end."""
    visits: list[Visit] = []
    try:
        for one in follow(piece, wanted, tally):
            visits.append(one)
            if pressed:
                break
    except Stuck as stuck:
        return visits, f"the path of twisting: {stuck}"
    return visits, ""


def _place(piece: Sector, at: Equilibrium) -> tuple[float, float, float]:
    return at.state.load, distance(piece, at), piece.copies * at.energy


def _range(scene: Scene, along_path: Array) -> tuple[float, float]:
    """Distances to be looked at: those of the path with a margin, short of full stretch."""
    low, high = float(along_path.min()), float(along_path.max())
    margin = _MARGIN * max(high - low, 0.2 * scene.ring.length / math.pi)
    return low - margin, min(high + margin, STRETCHED * 0.5 * scene.ring.length)


def _seeds(flood: Flood, visits: Sequence[Visit]) -> Iterator[tuple[Cell, State]]:
    """States of the path at the angles of the grid, each in the cell of the nearest distance."""
    for i, turn in enumerate(flood.gamma):
        for one in visits:
            if one.at.state.load == turn and one.kind == "":
                away = np.abs(flood.distance - distance(flood.piece, one.at))
                state = one.at.state  # no axial force acts on it
                yield (i, int(np.argmin(away))), state.but(force=np.append(state.force, 0.0))


def _maps(flood: Flood) -> dict[str, Any]:
    """Energy, moment, force and index of the lowest minimum in each cell, and all energies."""
    n, m = len(flood.gamma), len(flood.distance)
    energy, moment, force = (np.full((n, m), np.nan) for _ in range(3))
    ways = np.full((n, m), -1, dtype=np.int64)
    piece = flood.piece
    for i, j in flood.minima:
        best = flood.among((i, j))[0]
        energy[i, j] = best.energy
        moment[i, j] = piece.moment(best.at.moment)
        # L holds + F (span - share d): dU/dd = -F share for each of the copies
        force[i, j] = -flood.share * piece.copies * best.at.state.force[-1]
        ways[i, j] = _index(piece, flood.supports(flood.distance[j]), best.at.state)
    levels = tuple(
        tuple(tuple(one.energy for one in flood.among((i, j))) for j in range(m)) for i in range(n)
    )
    return {"energy": energy, "moment": moment, "force": force, "index": ways, "minima": levels}


def _index(piece: Sector, held: Supports, state: State) -> int:
    """Index of the full ring with twist and distance held; -1 where it is not known.

    The arms no longer know of each other: modes in phase and out of phase are alike.
    """
    total = 0
    for label, (multiplicity, modes) in piece.classes.items():
        if label == "in phase":
            continue
        count = index(piece.body, held, modes, state)
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


def _snaps(piece: Sector, wanted: Wanted, angles: Array, pressed: list[int]) -> tuple[Array, ...]:
    """Gamma, distance and energy along every snap on the way to the last angle and back."""
    asked = replace(wanted, load_max=float(angles[-1]), until_folded=False, targets=())
    found: list[Array] = []
    before: Visit | None = None
    try:
        for one in follow_angle(piece, asked, Tally(), unload=True, every=_KEPT):
            if isinstance(one, Landing) and one.history and before is not None:
                found.append(_fall(piece, before.at, one))
            before = one
            if pressed:
                break
    except Stuck:
        pass  # what snapped before it is kept
    return tuple(found)


def _fall(piece: Sector, before: Equilibrium, landing: Landing) -> Array:
    """Gamma, distance and energy on the way down."""
    at = landing.at
    rows = [
        (state.load, distance(piece, replace(at, state=state)), energy)
        for state, energy in zip(landing.history, landing.energies, strict=True)
    ]
    return np.array([_place(piece, before), *rows, _place(piece, at)])
