"""`der.fold`: the path of a scene, and its record."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from der.analysis.path_record import (
    columns,
    full_shapes,
    kept_forces,
    mesh_numerics,
    path_record,
    recorded_points,
    state_at_pi,
)
from der.analysis.request import LOOSE_TURN, Request, ring_of
from der.errors import Reason
from der.geometry.section import section
from der.geometry.shapes import circle
from der.kernels.quaternions import Array
from der.kernels.strands import gap, nearest_strands
from der.problem import Options, Point, Statistics
from der.records.path import AtPi, Mode, Path, folding_mode, release
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.scene import Scene, meshes
from der.utils.checks import shown
from der.utils.run import Run

if TYPE_CHECKING:
    from der.analysis.error_bars import ErrorBars

_NO_MOMENT = 1e-6  # of the largest |M|: a state without load
_KEPT = 64  # configurations of a snap for N gradients; it takes about 5 N


def fold(
    scene: Scene,
    *,
    progress: Callable[[float], object] | None = None,
    watch: Callable[[Array], object] | None = None,
) -> Path:
    """Return the path of equilibria of a ring from flat (gamma = 0) on, with its special points.

    Parameters
    ----------
    scene : the ring, its section and what is wanted.
    progress : called with gamma [rad] after every state.
    watch : called with the vertices (N, 3) of the ring after every state.

    Returns
    -------
    Path
        Moments of one arm and energies of the full ring, in units of GJ/a.

    Raises
    ------
    NotConverged
        Where the path cannot be followed to its end; has the path so far.
    Interrupted
        At Ctrl-C; has the path so far.
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a der.Scene, got {shown(scene)}")
    ring, request, statistics = ring_of(scene), _request(scene), Statistics()

    def tell(one: Point[Equilibrium]) -> None:
        if progress is not None:
            progress(one.solution.parameter)
        if watch is not None:
            watch(ring.vertices(one.solution.state))

    with Run() as run:
        counted = (request.stability, request.self_crossings)
        run.prepare(lambda: use_kernels(*counted, snaps=scene.control != "arclength"))
        points = run.collect(_points(scene, ring, request, statistics), tell)
        if run.done and points[-1].solution.parameter == -scene.gamma_max:
            run.note(Reason.TURNED_BACK)
        if run.done and scene.control == "arclength" and points[-1].solution.parameter == 0.0:
            run.note(Reason.CLOSED)
        if run.done and scene.unfolded(points[-1].solution.parameter):
            run.stop(Reason.UNFOLDED)
        found = _Found(scene, ring, points)
        if run.done and scene.error_bars:
            found = run.attempt(partial(found.extrapolated, request)) or found
            if run.done and found.bars is not None and found.bars.note is not None:
                run.note(found.bars.note)
        path = found.record(run, statistics)
    return run.answer(path)


def _request(scene: Scene) -> Request:
    """The request of a scene."""
    counting = scene.stability or scene.looks_for_self_crossings
    # if only listed states are wanted, steps may be longer
    turn = Options.aimed_turn if counting or scene.save_at is None else LOOSE_TURN
    return Request(
        gamma_max=scene.last_gamma,
        until_folded=scene.until == "folded",
        targets=None if scene.save_at is None else tuple(scene.save_at),
        stability=scene.stability,
        self_crossings=scene.looks_for_self_crossings,
        options=Options(aimed_turn=turn, tolerance=scene.tolerance),
    )


def _points(
    scene: Scene, ring: GrippedRing, request: Request, statistics: Statistics
) -> Iterator[Point[Equilibrium]]:
    """The points of the path, by the control and the solver of the scene.

    Modules are imported only if the scene needs them.
    """
    every = math.ceil(scene.n_edges / _KEPT) if scene.history else 0
    if scene.solver == "relaxation":
        from der.analysis.loading_by_relaxation import follow_relaxed

        # no Hessian between states: neither branch points nor links are looked for
        bare = replace(request, stability=False, self_crossings=False)
        return follow_relaxed(ring, bare, statistics, unload=scene.unload, every=every)
    if scene.control == "arclength":
        return request.follow(ring, statistics)
    from der.analysis.loading import follow_angle, follow_moment

    load = follow_angle if scene.control == "angle" else follow_moment
    return load(ring, request, statistics, unload=scene.unload, every=every)


@cache
def use_kernels(stability: bool, self_crossings: bool, *, snaps: bool) -> None:
    """Load or compile the kernels that a path needs, once in a process."""
    ring = gripped_ring(circle(), section(1.0, 1.0), 8)
    if snaps:
        from der.rod.relaxation import relax

        relax(ring, ring.start)
    request = Request(gamma_max=0.1, stability=stability, self_crossings=self_crossings)
    for _ in request.follow(ring):
        pass
    if stability:
        from der.rod.free_ring import released

        released(ring, gripped_ring(circle(), section(1.0, 1.0), 8, name="full"), ring.start)
    if self_crossings:
        x = ring.vertices(ring.start)
        gap(x, *nearest_strands(x, x))


@dataclass(frozen=True)
class _Found:
    """The points found on a path, and their error bars, if any."""

    scene: Scene
    ring: GrippedRing
    points: list[Point[Equilibrium]]
    bars: ErrorBars | None = None

    def extrapolated(self, request: Request) -> _Found:
        """The same with error bars; some points are left out, see `error_bars`."""
        from der.analysis.error_bars import error_bars

        coarser = meshes(self.scene.n_edges, self.ring.name)[1:]
        rings = (self.ring, *(ring_of(self.scene, self.ring.name, n) for n in coarser))
        bars = error_bars(rings, request, self.points)
        return replace(self, points=list(bars.points), bars=bars)

    def record(self, run: Run, statistics: Statistics) -> Path:
        """The record."""
        scene, bars = self.scene, self.bars
        raw = columns(self.ring, self.points)
        at_pi, mode = self._at_pi(raw)
        if run.reason in (Reason.TURNED_BACK, Reason.CLOSED) and at_pi is None:
            mode = Mode(foldable=False, stable=None, snapping="snap-back", stable_3d=None)
        if scene.control == "moment":
            mode = None  # a ring that snaps under its moment passes its folds unseen
        keeps = scene.shapes or run.status != "done"  # shapes of an unfinished path are kept
        modes = scene.modes and run.status != "interrupted"  # they take long: not after Ctrl-C
        entries: dict[str, Any] = {"at_pi": at_pi, "mode": mode}
        if bars is not None:
            entries = {"error": bars.error, "raw": bars.raw, **bars.at_pi(at_pi, mode)}
        return path_record(
            scene,
            self.ring,
            self.points,
            run,
            statistics,
            numerics=_numerics(scene, self.ring),
            values=raw if bars is None else bars.values,
            shapes=full_shapes(scene, self.ring, self.points, modes=modes) if keeps else None,
            forces=kept_forces(scene, self.ring, self.points),
            **entries,
        )

    def _at_pi(self, raw: dict[str, Array]) -> tuple[AtPi | None, Mode | None]:
        """The state at the first arrival at pi, and how the ring folds, on the scene's mesh."""
        arrived = (k for k, one in enumerate(self.points) if one.solution.parameter == math.pi)
        k = next(arrived, None)
        if k is None:
            return None, None
        one, gamma, moment = self.points[k], raw["gamma"][: k + 1], raw["moment"][: k + 1]
        without_load = abs(moment[k]) <= _NO_MOMENT * float(np.abs(raw["moment"]).max())
        index_free = self._index_free(one) if without_load and one.index else None
        at_pi = state_at_pi(self.ring, one, index_free)
        before = recorded_points(self.ring, self.points[: k + 1], raw)
        folded = self.ring.folded(one.solution.state)
        return at_pi, folding_mode(gamma, moment, before, at_pi, three_covered=folded)

    def _index_free(self, one: Point[Equilibrium]) -> int | None:
        """Index of the ring with its grips removed."""
        from der.rod.free_ring import index_without_grips

        full = ring_of(self.scene, "full")
        return index_without_grips(
            self.ring, full, one.solution.state, tolerance=self.scene.tolerance
        )


def _numerics(scene: Scene, ring: GrippedRing) -> dict[str, object]:
    names = ("gamma_max", "until", "control", "unload", "solver", "error_bars")
    return {
        **mesh_numerics(scene, ring),
        **{name: getattr(scene, name) for name in names},
        "save_at": None if scene.save_at is None else list(scene.save_at),
        "stability": scene.stability,
        "version": release(),
    }
