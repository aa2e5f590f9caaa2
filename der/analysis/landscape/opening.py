"""The push that opens a folded ring with the least work: a pair of forces, or of couples.

Pairs of points on a grid are tried, each with all its tools (`landscape_tools`); of pairs that a
symmetry of the folded ring maps onto each other one. Between the points of the grid the search goes
on around the best of each kind. A slow push of prescribed length or angle cannot take less than
the barrier of the ring left free (`landscape_march`): one that takes just that is the best there
can be, whatever else was tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from der.analysis.landscape.barrier import barrier, twisted_rests
from der.analysis.landscape.opening_search import Search, refine, scan
from der.analysis.path_record import mesh_numerics
from der.analysis.request import ring_of
from der.continuation.richardson import Extrapolated, limits
from der.records.landscape import Pass
from der.records.opening import LeastPush
from der.records.record import SolveTime
from der.scene import Scene, meshes
from der.utils.checks import Array
from der.utils.run import Run

_GRIDS = (24, 16, 12, 8)  # points on the ring: the first that divides the edges
_NOT_WORTH = (3.0, 1.1)  # times the free barrier, or that of twisting: more is not followed


def least_push(
    scene: Scene,
    *,
    points: int | None = None,
    between: bool = True,
    progress: Callable[[float], object] | None = None,
) -> LeastPush:
    """The pairs of forces and of couples that push a folded ring open with the least work.

    Parameters
    ----------
    scene : ring, section and mesh; how it is controlled does not matter.
    points : on the ring, of the grid of pairs; a divisor of the edges, at least 3. None: 24, 16, 12
        or 8.
    between : whether to go on between the points of the grid, around the best of each kind.
    progress : called with the share of the grid's pairs that were tried.

    Raises
    ------
    ValueError
        For a grid that the mesh does not have.

    Notes
    -----
    Where the folded ring is no well there is nothing to push: ``why`` says so, and ``status`` where
    not even the flat ring is at rest. With the scene's
    ``error_bars`` works are extrapolated, too; the search then stays on points of the coarsest
    mesh. Ctrl-C keeps the pushes found so far.
    """
    grid = _grid(scene, points)
    with Run() as run:
        free = barrier(replace(scene, error_bars=False))
        search, why = _begun(scene, free)
        status = free.status
        if search is not None and not run.pressed:
            scan(search, grid, run, progress)
            if between:
                refine(search, scene.n_edges // grid, free.open, run)
        sure: Extrapolated = {}
        if search is not None and scene.error_bars and not run.pressed:
            sure = _without_mesh(search, free)
    if search is not None and not why and not any(push.opens for push, _ in search.all):
        why = "no push was found that opens the ring"
    if run.pressed:
        why = "stopped by the user before all pairs of points were tried"
    return LeastPush(
        status="interrupted" if run.pressed else status,
        why=why,
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=mesh_numerics(scene, ring_of(scene, "full")) | {"points": grid},
        barrier=free.open,
        twisting=free.twisting.open,
        least=search.least(dead=False) if search is not None else {},
        least_dead=search.least(dead=True) if search is not None else {},
        extrapolated=sure,
        pushes=tuple(push for push, _ in search.all) if search is not None else (),
        timing=SolveTime(run.seconds),
        shapes=_shapes(search) if search is not None else {},
    )


def _grid(scene: Scene, points: int | None) -> int:
    n = scene.n_edges
    if points is None:
        return next((grid for grid in _GRIDS if n % grid == 0), n // 2)
    if isinstance(points, bool) or not isinstance(points, int) or points < 3 or n % points:
        raise ValueError(f"points must be a divisor of n_edges = {n}, at least 3, got {points!r}")
    return points


def _begun(scene: Scene, free: Pass) -> tuple[Search | None, str]:
    """The folded ring to be pushed; None and a sentence where it is no well."""
    rests, states, _, why = twisted_rests(scene)
    if why:
        return None, why
    end = rests[-1]
    if end.index_free != 0:
        index = "unknown" if end.index_free is None else str(end.index_free)
        return None, f"the free folded ring is no well; its index is {index}"
    heights = zip(_NOT_WORTH, (free.open, free.twisting.open), strict=True)
    known = [times * height for times, height in heights if height]
    most = max(known, default=np.inf)
    ends = {"flat": rests[0].energy, "folded": end.energy}
    return Search(scene, states[-1], ends, most), ""


# --- What is written -------------------------------------------------------------------------


def _shapes(search: Search) -> dict[str, tuple[Array, Array]]:
    """The ring at the moments that matter, and where it is pushed."""
    found = {}
    for dead in (False, True):
        for kind, k in search.least(dead=dead).items():
            _, done = search.all[k]
            moment = done.dead if dead else done.last
            if moment is not None:
                found[f"{kind} dead" if dead else kind] = done.actuator.shape(moment.state)
    return found


def _without_mesh(search: Search, free: Pass) -> Extrapolated:
    """Works and loads of the best pushes, extrapolated from the same ones on coarser meshes."""
    levels = [_works(search, search, 1)]
    for times, n in zip((2, 4), meshes(search.scene.n_edges, "full")[1:], strict=True):
        coarse, _ = _begun(replace(search.scene, n_edges=n, error_bars=False), free)
        if coarse is None:
            return {}
        coarse.most = np.inf
        levels.append(_works(search, coarse, times))
    return limits(levels)


def _works(search: Search, level: Search, times: int) -> dict[str, float | None]:
    """Works and loads of the best pushes of ``search``, on a mesh that is coarser by ``times``."""
    found: dict[str, float | None] = {}
    for dead in (False, True):
        for kind, k in search.least(dead=dead).items():
            best = search.all[k][0]
            name = f"{kind} dead" if dead else kind
            pair = (best.edges[0] // times, best.edges[1] // times)
            same = [
                one
                for one, _ in (level.at(pair) if not any(e % times for e in best.edges) else [])
                if (one.kind, one.direction) == (best.kind, best.direction)
            ]
            instant = (same[0].dead if dead else same[0].held) if same else None
            wanted = best.dead if dead else best.held
            alike = instant is not None and wanted is not None and instant.event == wanted.event
            found[name] = instant.work if instant is not None and alike else None
            if dead:
                found[f"{name} load"] = instant.load if instant is not None and alike else None
    return found
