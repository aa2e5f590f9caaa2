"""The energy landscape along the path of twisting: wells, saddles, and the barriers between them.

Without a moment on the grips, U over gamma is the landscape of the ring in one dimension: dU/dgamma
is 4 M, so equilibria are where M = 0. The barrier to fold the ring is the energy of the highest
saddle between flat and folded above the flat ring. The barrier to open it is its energy above the
folded ring.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from der.analysis.landscape.rest_states import with_rests
from der.analysis.path_record import full_shapes, mesh_numerics, path_record
from der.analysis.request import Request, ring_of
from der.continuation.richardson import Extrapolated, limits
from der.problem import Options, Point, Statistics, total_index
from der.records.landscape import Barriers, Landscape, Rest
from der.records.path import Path
from der.rod.equilibrium import Equilibrium
from der.rod.free_ring import released
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import edges
from der.scene import Scene, meshes
from der.utils.run import Run

FARTHEST = 2.0 * math.pi  # rad; a path that arrives here not folded, or at -2 pi, does not fold
_MOST_STEPS = 600  # rings that fold do so in less than 150
_NO_WELL = "the folded ring is no well: it opens by itself when its grips turn freely"


def landscape(
    scene: Scene, *, progress: Callable[[float], object] | None = None, index_free: bool = True
) -> Landscape:
    """Return energy, M = 0 states and barriers along the path of twisting, from flat to folded.

    Parameters
    ----------
    scene : ring, section, mesh, ``save_at``, ``stability``, ``shapes`` and ``modes``; the path ends
        where the ring is folded.
    progress : called with gamma [rad] after every state.
    index_free : whether to compute the index of every M = 0 state with the grips removed.

    Notes
    -----
    If the path cannot be followed to its end, or Ctrl-C stops it, the landscape has the path so
    far: see ``path.status`` and ``path.message``. With the scene's ``error_bars`` the barriers are
    also extrapolated.
    """
    ring = ring_of(scene)
    targets = None if scene.save_at is None else tuple(scene.save_at)
    request = replace(bare_request(scene), targets=targets, stability=scene.stability)
    statistics = Statistics()

    def tell(one: Point[Equilibrium]) -> None:
        if progress is not None:
            progress(one.solution.parameter)

    with Run() as run:
        points = run.collect(request.follow(ring, statistics), tell)
        found = _found(scene, ring, request, points, run, statistics, index_free=index_free)
        extrapolates = scene.error_bars and found.folded
        coarser = meshes(scene.n_edges, ring.name)[1:] if extrapolates else ()
        bare = replace(scene, error_bars=False, stability=False, shapes=False, modes=False)
        each = (replace(bare, n_edges=n, finest=scene.n_edges) for n in coarser if not run.pressed)
        coarse = [landscape(one, index_free=False) for one in each]
    if run.status == "interrupted":
        return replace(found, path=run.marked(found.path))
    if not extrapolates:
        return found
    every = [_heights(one) | _beside(one.path) for one in (found, *coarse)]
    sure = limits(every, even=not ring.kinks_in_cells)
    return _without_mesh(found, {name: sure[name] for name in _heights(found) if name in sure})


def bare_request(scene: Scene) -> Request:
    """Return the request of the path of twisting until the ring is folded, without indices."""
    return Request(
        gamma_max=FARTHEST,
        until_folded=True,
        stability=False,
        self_crossings=False,
        options=Options(tolerance=scene.tolerance, max_steps=_MOST_STEPS),
    )


def _found(
    scene: Scene,
    ring: GrippedRing,
    request: Request,
    points: list[Point[Equilibrium]],
    run: Run,
    statistics: Statistics,
    *,
    index_free: bool,
) -> Landscape:
    """The landscape on the scene's own mesh."""
    exact = replace(request, stability=True)  # these states are few: their index is always wanted
    points, at = run.attempt(lambda: with_rests(ring, exact, points, statistics)) or (points, [])
    full = ring_of(scene, "full") if index_free else None
    for k in at:
        if points[k].index is None:
            points[k] = exact.point(ring, points[k].solution, kind=points[k].kind)
    rests = tuple(rest_of(ring, full, points[k], k) for k in at)
    done = bool(points) and run.status == "done"
    folded = done and ring.folded(points[-1].solution.state)
    path = path_record(
        scene,
        ring,
        points,
        run,
        statistics,
        numerics=mesh_numerics(scene, ring),
        shapes=full_shapes(scene, ring, points, modes=scene.modes) if scene.shapes else None,
    )
    return Landscape(path, rests, folded, barriers(rests, folded=folded, message=run.message))


def _heights(one: Landscape) -> dict[str, float | None]:
    """The values of a landscape that are extrapolated."""
    found, flat, end = one.barriers, one.rests[0], one.rests[-1]
    gamma = None if found.saddle is None else one.rests[found.saddle].gamma
    return {
        "fold": found.fold,
        "open": found.open,
        "gamma": gamma,
        "folded": end.energy - flat.energy if one.folded else None,
        "slope": end.slope if one.folded else None,
    }


def _beside(path: Path) -> dict[str, float | None]:
    """Folds and limits of the path: how well meshes resolve it, where others vanish by chance."""
    special = enumerate(point for point in path.points if point.kind in ("fold", "limit"))
    return {
        f"{k} {point.kind} {name}": getattr(point, name)
        for k, point in special
        for name in ("gamma", "moment", "energy")
    }


def _without_mesh(one: Landscape, sure: Extrapolated) -> Landscape:
    """A landscape with its extrapolated values.

    The threshold of stability rises with the number of edges. Close to it the folded ring is a well
    on the mesh, but not in the limit.
    """
    values = dict(sure)
    if "open" in values and values.get("slope", (1.0, 0.0))[0] <= 0.0:
        del values["open"]
        values |= {"gamma": (one.rests[-1].gamma, 0.0), "fold": values["folded"]}
        said = {**one.barriers.why, "open": f"{_NO_WELL}, but for the mesh"}
        one = replace(one, barriers=replace(one.barriers, why=said))
    return replace(one, extrapolated=values)


def barriers(rests: Sequence[Rest], *, folded: bool, message: str = "") -> Barriers:
    """Return the barriers between the first M = 0 state, flat, and the last, if ``folded``."""
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
            f"the saddle has {saddle.index_moment} unstable modes, and at least one of them breaks"
            " the symmetry: there is a lower saddle beside it"
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


def rest_of(
    ring: GrippedRing, full: GrippedRing | None, one: Point[Equilibrium], position: int
) -> Rest:
    """Return the record of an equilibrium without load; ``full``: the full ring."""
    at, index = one.solution, total_index(ring, one.index)
    slope = ring.arm_moment(at.slope)
    return Rest(
        gamma=at.parameter,
        energy=ring.copies * at.energy,
        index_moment=None if index is None else index + (slope < 0.0),
        index_free=None if full is None else released(ring, full, at.state).index(),
        slope=slope,
        distance=distance(ring, at),
        position=position,
    )
