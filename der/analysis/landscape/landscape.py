"""The energy landscape along the path of twisting: wells, saddles, and the barriers between them.

With nothing turning the grips, U over gamma is the ring's landscape in one dimension: dU/dgamma is
4 M, so it is level where M = 0. What it costs to fold the ring is the highest saddle between flat
and folded above the flat ring; what it costs to open it, the same above the folded one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace

import numpy as np

from der.analysis.full_ring import shapes
from der.analysis.landscape.rest_states import with_rests
from der.continuation.arclength import follow
from der.continuation.events import Point, Wanted, full_index, three_covered, point
from der.continuation.richardson import Extrapolated, limits
from der.continuation.step import ContinuationFailed, Statistics
from der.errors import STOPPED
from der.geometry.mesh import sites
from der.records.configurations import Shapes
from der.records.landscape import Barriers, Landscape, Rest
from der.records.path import Path, Point, Timing, counts
from der.rod.equilibrium import Equilibrium
from der.rod.free_ring import left_alone
from der.rod.gripped_ring import GrippedRing, sector
from der.rod.rod import edges
from der.scene import Scene, meshes
from der.utils.interrupts import interrupts_between_states

FARTHEST = 2.0 * math.pi  # rad; a path that gets there unfolded, or to its negative, does not fold
_MOST_STEPS = 600  # rings that fold do so in less than 150
_NO_WELL = "the folded ring is no well: it opens by itself when its grips turn freely"
_KINDS = ("fold", "limit", "branch")


def landscape(
    scene: Scene, *, progress: Callable[[float], object] | None = None, index_free: bool = True
) -> Landscape:
    """Energy, rests and barriers along the path of twisting, until the ring is folded.

    Parameters
    ----------
    scene : ring, section, mesh, ``save_at``, ``stability``, ``shapes`` and ``modes``; where the
        path ends is not asked of it but of the ring.
    progress : called with gamma [rad] after every state.
    index_free : whether to compute the index of every rest with the grips removed.

    Notes
    -----
    A path that cannot be followed to its end, or is stopped by Ctrl-C, is a landscape as far as it
    goes: see ``path.status`` and ``path.message``. With the scene's ``error_bars`` the barriers
    are extrapolated, too.
    """
    ring = scene_sector(scene, scene.sector)
    wanted = Wanted(
        load_max=FARTHEST,
        until_folded=True,
        targets=None if scene.save_at is None else tuple(scene.save_at),
        stability=scene.stability,
        contacts=False,
        tolerance=scene.tolerance,
        most_steps=_MOST_STEPS,
    )
    statistics, started = Statistics(), time.perf_counter()
    points, status, message = _followed(ring, wanted, statistics, progress)
    with interrupts_between_states() as pressed:
        exact = replace(wanted, stability=True)  # rests are few: their index is always wanted
        try:
            points, at = with_rests(ring, exact, points, statistics)
        except ContinuationFailed as stuck:
            at, status, message = [], "not converged", str(stuck)
        whole = scene_sector(scene, "full") if index_free else None
        for k in at:
            if points[k].index is None:
                points[k] = visit(ring, exact, points[k].solution, kind=points[k].kind)
        rests = tuple(rest_of(ring, whole, points[k], k) for k in at)
        folded = bool(points) and status == "done" and three_covered(ring, points[-1].solution)
        timing = Timing(
            time.perf_counter() - started, statistics.newton_iterations, statistics.steps
        )
        path = _path(scene, ring, points, timing, status, message)
        found = Landscape(path, rests, folded, barriers(rests, folded=folded, message=message))
        bare = replace(scene, error_bars=False, stability=False, shapes=False, modes=False)
        extrapolates = scene.error_bars and folded
        coarser = meshes(scene.n_edges, ring.name)[1:] if extrapolates else ()
        coarse = [
            landscape(replace(bare, n_edges=n), index_free=False) for n in coarser if not pressed
        ]
    if pressed:
        return replace(found, path=path.interrupted())
    if not extrapolates:
        return found
    return _without_mesh(found, limits([_heights(one) for one in (found, *coarse)]))


def _heights(one: Landscape) -> dict[str, float | None]:
    """What is extrapolated of a landscape."""
    found, flat, end = one.barriers, one.rests[0], one.rests[-1]
    gamma = None if found.saddle is None else one.rests[found.saddle].gamma
    return {
        "fold": found.fold,
        "open": found.open,
        "gamma": gamma,
        "folded": end.energy - flat.energy if one.folded else None,
        "slope": end.slope if one.folded else None,
    }


def _without_mesh(one: Landscape, sure: Extrapolated) -> Landscape:
    """A landscape with what it is on a mesh without end.

    The threshold of stability rises with the number of edges: between two of them the folded ring
    is a well on the mesh and none without it.
    """
    values = dict(sure)
    if "open" in values and values.get("slope", (1.0, 0.0))[0] <= 0.0:
        del values["open"]
        values |= {"gamma": (one.rests[-1].gamma, 0.0), "fold": values["folded"]}
        said = {**one.barriers.why, "open": f"{_NO_WELL}, but for the mesh"}
        one = replace(one, barriers=replace(one.barriers, why=said))
    return replace(one, extrapolated=values)


def scene_sector(scene: Scene, name: str) -> GrippedRing:
    """The sector ``name`` of the scene's ring, on the scene's mesh."""
    return gripped_ring(
        scene.ring,
        scene.section,
        scene.n_edges,
        name=name,
        measure=scene.curvature,
        stretching=scene.stretching,
    )


def barriers(rests: Sequence[Rest], *, folded: bool, message: str = "") -> Barriers:
    """Barriers between the first of the rests, flat, and the last, where that is ``folded``."""
    if not folded:
        reason = message or f"twisted up to {FARTHEST / math.pi:g} pi the ring does not fold"
        return Barriers(None, None, None, {"fold": reason, "open": reason})
    flat, end = rests[0], rests[-1]
    highest = max(range(1, len(rests)), key=lambda k: rests[k].energy)
    saddle = rests[highest]
    why: dict[str, str] = {}
    if end.kind == "saddle":
        why["open"] = _NO_WELL
        if saddle is end:
            why["fold"] = "the saddle is the folded ring itself"
    elif (saddle.index_moment or 0) > 1:
        why["fold"] = why["open"] = (
            f"the saddle has {saddle.index_moment} ways down, one of which at least breaks the "
            f"symmetry: there is a lower one beside it"
        )
    opening = saddle.energy - end.energy if end.kind == "well" else None
    return Barriers(saddle.energy - flat.energy, opening, highest, why)


def distance(ring: GrippedRing, at: Equilibrium) -> float:
    """Distance between the grips along the twisting axis, a; negative where they have passed."""
    span = float(edges(ring.rod, at.state)[:, 2].sum())
    if ring.name == "full":
        n = ring.rod.n_edges
        e = edges(ring.rod, at.state)[:, 2]
        return float(0.5 * (e[0] + e[n // 2]) + e[1 : n // 2].sum())
    return span * (2.0 if ring.name == "quarter" else 1.0)


def _followed(
    ring: GrippedRing,
    wanted: Wanted,
    statistics: Statistics,
    progress: Callable[[float], object] | None,
) -> tuple[list[Point], str, str]:
    """The path as far as it goes, its status and a sentence about it."""
    points: list[Point] = []
    try:
        with interrupts_between_states() as pressed:
            for one in follow(ring, wanted, statistics):
                points.append(one)
                if progress is not None:
                    progress(one.solution.parameter)
                if pressed:
                    return points, "interrupted", STOPPED
    except ContinuationFailed as stuck:
        return points, "not converged", str(stuck)
    return points, "done", ""


def rest_of(ring: GrippedRing, whole: GrippedRing | None, one: Point, position: int) -> Rest:
    """What is known of a rest."""
    supports = total_index(ring, one.index)
    slope = ring.moment(one.solution.slope)
    return Rest(
        gamma=one.solution.parameter,
        energy=ring.copies * one.solution.energy,
        index_moment=None if held is None else held + (slope < 0.0),
        index_free=None if whole is None else left_alone(ring, whole, one.solution.state).index(),
        slope=slope,
        distance=distance(ring, one.solution),
        position=position,
    )


def _path(
    scene: Scene,
    ring: GrippedRing,
    points: Sequence[Point],
    timing: Timing,
    status: str,
    message: str,
) -> Path:
    """The record of what was visited."""
    supports = [total_index(ring, one.index) for one in points]
    under_moment = [
        None if i is None or one.kind == "limit" else i + (one.solution.slope < 0.0)
        for one, i in zip(points, supports, strict=True)
    ]
    points = []
    for k, one in enumerate(points):
        if one.kind in _KINDS:
            before, after = (
                total_index(ring, index) for index in one.sides or (one.index, one.index)
            )
            numbers = (
                one.solution.parameter,
                ring.moment(one.solution.moment),
                ring.copies * one.solution.energy,
            )
            points.append(Point(one.kind, *numbers, before, after, k, one.details))
    return Path(
        solver="der",
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=numerics(scene, ring),
        gamma=np.array([one.solution.parameter for one in points]),
        moment=np.array([ring.moment(one.solution.moment) for one in points]),
        energy=np.array([ring.copies * one.solution.energy for one in points]),
        index=counts(supports),
        index_moment=counts(under_moment),
        points=tuple(points),
        at_pi=None,
        mode=None,
        error=None,
        timing=timing,
        shapes=_shapes(scene, ring, points) if scene.shapes and points else None,
        status=status,
        message=message,
    )


def _shapes(scene: Scene, ring: GrippedRing, points: Sequence[Point]) -> Shapes:
    """The full ring at every state."""
    arc_length = sites(scene.ring, scene.n_edges, "full")[:-1]
    return shapes(ring, points, arc_length, history=False, modes=scene.modes)


def numerics(scene: Scene, ring: GrippedRing) -> dict[str, object]:
    """The numerical choices behind an answer, as they are written."""
    return {
        "n_edges": scene.n_edges,
        "sector": ring.name,
        "curvature": scene.curvature,
        "stretch": scene.stretch,
        "a_over_t": scene.a_over_t,
        "tolerance": scene.tolerance,
    }
