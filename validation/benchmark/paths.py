"""Rows of the benchmark on complete paths, relaxation, snaps and recordings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import der
from der.analysis.loading import follow_angle
from der.analysis.loading_by_relaxation import follow_relaxed
from der.analysis.request import Request
from der.analysis.snap import Snap
from der.problem import Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from validation.benchmark.extent import Extent
from validation.benchmark.replay import kernel_time
from validation.benchmark.rings import RINGS, BenchRing, circle
from validation.benchmark.rows import Row, cpu_time, path_row

Follower = Callable[[GrippedRing, Request, Statistics], Iterator[Point[Equilibrium]]]
REQUEST = Request(stability=False, self_crossings=False)
PATHS = {
    "h/t 4, N 64, quarter, no stability": circle(4.0, stability=False),
    "h/t 4, N 64, full ring, index at every state": circle(4.0, sector="full"),
    "h/t 4, N 64, quarter, index at every state": circle(4.0),
    "h/t 1.6, N 64, quarter, index, two folds": circle(1.6),
    "h/t 1, N 64, until folded, index": circle(1.0, until="folded"),
    "h/t 4, N 128, error bars, index, self-crossings": circle(4.0, n_edges=128, error_bars=True),
    "h/t 4, N 128, quarter, error bars": circle(4.0, n_edges=128, stability=False, error_bars=True),
    "h/t 1.6, N 64, quarter, angle up and down, 2 snaps": circle(1.6, control="angle", unload=True),
    "h/t 4, N 64, quarter, by relaxation alone": circle(4.0, control="angle", solver="relaxation"),
}
GOALS = {  # ms, by path, and by ring of the boundary-value problem
    "h/t 4, N 64, quarter, no stability": 15.0,
    "h/t 4, N 64, full ring, index at every state": 60.0,
    "h/t 4, N 128, quarter, error bars": 60.0,
    "circle, h/t 4": 10.0,
    "rectangle 0.6, r/a 0.3": 15.0,
    "triangle 90, r/a 1/30": 100.0,
}


def rows(extent: Extent) -> Iterator[Row]:
    """Rows of all paths."""
    for case, scene in PATHS.items():
        work = partial(der.fold, scene)
        yield path_row("path", case, work, extent.repeats, GOALS.get(case))
        yield kernel_row("path", case, work, extent.repeats)
    yield from bvp_paths(extent.repeats, extent.rings)
    few = min(extent.repeats, 5)
    yield from relaxation(extent.relaxed, few)
    yield from snaps(extent.repeats)
    yield from recording(few)


def bvp_paths(repeats: int, rings: tuple[BenchRing, ...] = RINGS) -> Iterator[Row]:
    """The boundary-value problem's paths at 1e-6 and at 1e-8, and their kernels."""
    for case in rings:
        for tolerance, goal in ((1e-6, GOALS.get(case.name)), (1e-8, None)):
            work = partial(der.solve_bvp, case.scene(), tolerance=tolerance)
            words = f"{case.name}, {tolerance:.0e}"
            yield path_row("bvp path", words, work, repeats, goal)
            yield kernel_row("bvp path", words, work, repeats)


def kernel_row(group: str, case: str, work: Callable[[], object], repeats: int) -> Row:
    """The kernels of a path by themselves [ms]."""
    seconds, calls = kernel_time(work, repeats)
    return Row(group, f"{case}, kernels", 1e3 * seconds, "ms", note=f"{calls} calls")


def relaxation(sizes: tuple[int, ...], repeats: int) -> Iterator[Row]:
    """Control of the angle by dynamic relaxation, and by Newton's method, over N."""
    for n in sizes:
        ring = gripped_ring(der.circle(), der.rectangular_section(4.0), n)
        for follow, words in ((follow_relaxed, ""), (follow_angle, " by Newton")):
            states, statistics = _marched(follow, ring)
            milliseconds = 1e3 * cpu_time(partial(_marched, follow, ring), repeats)
            cost = f"{statistics.newton_iterations} Newton iterations"
            if follow is follow_relaxed:
                cost = f"{statistics.force_evaluations} force evaluations"
            note = f"{cost}, {milliseconds:.0f} ms"
            case = f"h/t 4, N {n}, quarter, a state{words}"
            yield Row("relaxation", case, milliseconds / states, "ms", note=note)


def _marched(follow: Follower, ring: GrippedRing) -> tuple[int, Statistics]:
    """The number of states of a march, and what it has cost."""
    statistics = Statistics()
    return len(list(follow(ring, REQUEST, statistics))), statistics


def snaps(repeats: int) -> Iterator[Row]:
    """One snap: dynamic relaxation past the fold, and the polish by Newton."""
    for name in ("quarter", "full"):
        ring = gripped_ring(der.circle(), der.rectangular_section(1.6), 64, name=name)
        marched = follow_angle(ring, REQUEST, Statistics())
        before = next(one.solution for one in marched if one.kind == "fold")
        snapping = partial(Snap(ring, REQUEST, Statistics(), before).landing, before.tangent)
        milliseconds = 1e3 * cpu_time(snapping, repeats)
        note = f"{snapping().details['force_evaluations']} force evaluations"
        yield Row("snap", f"h/t 1.6, N 64, {name}", milliseconds, "ms", 100.0, note)


def recording(repeats: int) -> Iterator[Row]:
    """A recording for playback: 400 equilibria of 128 edges, scaled from what the path has."""
    from der.viz.rerun.recording import recording_bytes

    gammas = tuple(np.linspace(0.0, np.pi, 361)[1:])
    path = der.fold(circle(1.6, n_edges=128, shapes=True, stability=False, save_at=gammas))
    share = 400.0 / len(path)
    size = len(recording_bytes(path)) * share
    seconds = cpu_time(lambda: recording_bytes(path), repeats) * share
    case = "400 steps, 128 edges"
    yield Row("recording", f"{case}, file", 1e-6 * size, "MB", 10.0)
    yield Row("recording", f"{case}, made", seconds, "s", 1.0)
