"""The loading of least work that opens a folded ring: a pair of forces, or of couples.

All actuators (`actuators`) are tried at the pairs of points on a grid. Of pairs that a symmetry of
the folded ring maps onto each other, one is tried. Then the search continues between the points of
the grid, around the best of each kind. Slow loading by a prescribed length or angle cannot take
less work than the barrier of the free ring (`opening_path`). A loading that takes just this work is
therefore the best possible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from der.analysis.landscape.barrier import barrier, twisted_states
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
_NOT_WORTH = (3.0, 1.1)  # times the free barrier, or that of twisting: largest work followed


def least_push(
    scene: Scene,
    *,
    points: int | None = None,
    between: bool = True,
    progress: Callable[[float], object] | None = None,
) -> LeastPush:
    """Return the pairs of forces and of couples that open a folded ring with the least work.

    Parameters
    ----------
    scene : ring, section and mesh; its control does not matter.
    points : number of grid points on the ring; a divisor of the edges, at least 3. None: 24, 16, 12
        or 8.
    between : whether to search between the points of the grid, around the best of each kind.
    progress : called with the share of the grid's pairs that were tried.

    Raises
    ------
    ValueError
        If ``points`` does not divide the edges.

    Notes
    -----
    If the folded ring is no well, nothing is tried: ``why`` says so, and ``status`` if not even the
    flat ring is an equilibrium. With the scene's ``error_bars`` the works are also extrapolated;
    the search then uses points of the coarsest mesh only. Ctrl-C keeps the results found so far.
    """
    grid = _grid(scene, points)
    extrapolated: Extrapolated = {}
    with Run() as run:
        free = barrier(replace(scene, error_bars=False))
        search, why = _begun(scene, free)
        if not why and not run.pressed:
            scan(search, grid, run, progress)
            if between:
                refine(search, scene.n_edges // grid, free.open, run)
        if not why and scene.error_bars and not run.pressed:
            extrapolated = _extrapolated(search, free)
    if not why and not any(push.opens for push, _ in search.all):
        why = "no push was found that opens the ring"
    if run.pressed:
        why = "stopped by the user before all pairs of points were tried"
    return LeastPush(
        status="interrupted" if run.pressed else free.status,
        why=why,
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        scale=scene.scale,
        numerics=mesh_numerics(scene, ring_of(scene, "full")) | {"points": grid},
        barrier=free.open,
        twisting=free.twisting.open,
        least=search.least(dead=False),
        least_dead=search.least(dead=True),
        extrapolated=extrapolated,
        pushes=tuple(push for push, _ in search.all),
        timing=SolveTime(run.seconds),
        shapes=_shapes(search),
    )


def _grid(scene: Scene, points: int | None) -> int:
    n = scene.n_edges
    if points is None:
        return next((grid for grid in _GRIDS if n % grid == 0), n // 2)
    if isinstance(points, bool) or not isinstance(points, int) or points < 3 or n % points:
        raise ValueError(f"points must be a divisor of n_edges = {n}, at least 3, got {points!r}")
    return points


def _begun(scene: Scene, free: Pass) -> tuple[Search, str]:
    """The search on a folded ring, and why there is none: the ring is no well."""
    twisted = twisted_states(scene)
    if twisted.no_well:
        return Search(scene, None, {}, 0.0), twisted.no_well
    heights = zip(_NOT_WORTH, (free.open, free.twisting.open), strict=True)
    most = max((times * height for times, height in heights if height), default=np.inf)
    return Search(scene, twisted.free[-1], twisted.ends, most), ""


# --- The record ------------------------------------------------------------------------------


def _shapes(search: Search) -> dict[str, tuple[Array, Array]]:
    """The ring where each best loading ends, and the two points where it is loaded."""
    found = {}
    for name, k, dead in search.best():
        _, done = search.all[k]
        instant = done.dead if dead else done.last
        if instant is not None:
            found[name] = done.actuator.shape(instant.state)
    return found


def _extrapolated(search: Search, free: Pass) -> Extrapolated:
    """Works and loads of the best loadings, extrapolated from the same ones on coarser meshes."""
    levels = [_works(search, search, 1)]
    for times, n in zip((2, 4), meshes(search.scene.n_edges, "full")[1:], strict=True):
        bare = replace(search.scene, error_bars=False, finest=search.scene.n_edges)
        coarse, why = _begun(replace(bare, n_edges=n), free)
        if why:
            return {}
        coarse.most = np.inf
        levels.append(_works(search, coarse, times))
    return limits(levels, even=not ring_of(search.scene, "full").kinks_in_cells)


def _works(search: Search, level: Search, times: int) -> dict[str, float | None]:
    """Works and loads of the best loadings of ``search``, on a mesh coarser by ``times``."""
    found: dict[str, float | None] = {}
    for name, k, dead in search.best():
        best = search.all[k][0]
        pair = (best.edges[0] // times, best.edges[1] // times)
        tried = [] if any(edge % times for edge in best.edges) else level.at(pair)
        kind = (best.kind, best.direction)
        same = next((one for one, _ in tried if (one.kind, one.direction) == kind), None)
        instants = [one.dead if dead else one.held for one in (best, same) if one is not None]
        wanted, instant = instants[0], instants[1] if same is not None else None
        alike = instant is not None and wanted is not None and instant.event == wanted.event
        found[name] = instant.work if instant and alike else None
        if dead:
            found[f"{name} load"] = instant.load if instant and alike else None
    return found
