"""Rows of `der bench` on whole paths, relaxation, snaps, recordings and commands."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

import der
from der.analysis.loading import follow_angle
from der.analysis.loading_by_relaxation import follow_relaxed
from der.analysis.snap import Landing, snap
from der.bvp.solve import solve_bvp
from der.continuation.events import Visit, Wanted
from der.continuation.step import Tally
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import Sector, sector
from validation.benchmark.rings import RINGS, BenchRing
from validation.benchmark.rows import Row, cpu_time

Follower = Callable[[Sector, Wanted, Tally], Iterator[Visit]]
GOALS = {"circle, h/t 4": 10.0, "rectangle 0.6, r/a 0.3": 15.0, "triangle 90, r/a 1/30": 100.0}


def circle(h_over_t: float, **wants: object) -> der.Scene:
    """A circle, and what is wanted of its path."""
    return der.Scene(der.circle(), der.rectangular_section(h_over_t), **wants)  # type: ignore[arg-type]


def paths(repeats: int) -> Iterator[Row]:
    """The paths that the project sets itself goals for, and what else the rod can be asked for."""
    cases = [
        ("h/t 4, N 64, quarter, no stability", circle(4.0, stability=False), 15.0),
        ("h/t 4, N 64, full ring, index at every state", circle(4.0, sector="full"), 60.0),
        ("h/t 4, N 64, quarter, index at every state", circle(4.0), None),
        ("h/t 1.6, N 64, quarter, index, two folds", circle(1.6), None),
        ("h/t 1, N 64, until folded, index", circle(1.0, until="folded"), None),
        (
            "h/t 4, N 128, quarter, error bars",
            circle(4.0, n_edges=128, stability=False, error_bars=True),
            60.0,
        ),
        (
            "h/t 1.6, N 64, quarter, angle up and down, 2 snaps",
            circle(1.6, control="angle", unload=True),
            None,
        ),
        (
            "h/t 4, N 64, quarter, by relaxation alone",
            circle(4.0, control="angle", solver="relaxation"),
            None,
        ),
    ]
    for case, scene, goal in cases:
        path = der.fold(scene)
        seconds = cpu_time(lambda scene=scene: der.fold(scene), repeats)  # type: ignore[misc]
        yield Row("path", case, 1e3 * seconds, "ms", goal, _counts(path))


def bvp_paths(repeats: int, rings: tuple[BenchRing, ...] = RINGS) -> Iterator[Row]:
    """The boundary-value problem's paths at 1e-6 and at 1e-8."""
    for case in rings:
        for tolerance in (1e-6, 1e-8):
            path = solve_bvp(case.scene(), tolerance=tolerance)
            seconds = cpu_time(
                lambda case=case, tolerance=tolerance: solve_bvp(case.scene(), tolerance=tolerance),  # type: ignore[misc]
                repeats,
            )
            goal = GOALS.get(case.name) if tolerance == 1e-6 else None
            name = f"{case.name}, {tolerance:.0e}"
            yield Row("bvp path", name, 1e3 * seconds, "ms", goal, _counts(path))


def _counts(path: der.Path) -> str:
    return f"{path.timing.steps} steps, {path.timing.newton_iterations} Newton iterations"


def relaxation(sizes: tuple[int, ...], repeats: int) -> Iterator[Row]:
    """The march of the angle by dynamic relaxation alone against the same by Newton, over N."""
    wanted = Wanted(stability=False, contacts=False)
    for n in sizes:
        piece = sector(der.circle(), der.rectangular_section(4.0), n)

        def march(follow: Follower, tally: Tally, piece: Sector = piece) -> int:
            return len(list(follow(piece, wanted, tally)))

        newton, relaxed = Tally(), Tally()
        states = march(follow_relaxed, relaxed), march(follow_angle, newton)
        times = [
            cpu_time(lambda follow=follow, march=march: march(follow, Tally()), repeats)  # type: ignore[misc]
            for follow in (follow_relaxed, follow_angle)
        ]
        per_state = [1e3 * t / k for t, k in zip(times, states, strict=True)]
        case = f"h/t 4, N {n}, quarter"
        note = f"{relaxed.force_evaluations} force evaluations, {1e3 * times[0]:.0f} ms"
        yield Row("relaxation", f"{case}, a state", per_state[0], "ms", None, note)
        note = f"{newton.newton_iterations} Newton iterations, {1e3 * times[1]:.0f} ms"
        yield Row("relaxation", f"{case}, a state by Newton", per_state[1], "ms", None, note)


def snaps(repeats: int) -> Iterator[Row]:
    """One snap: dynamic relaxation past the fold, and the polish by Newton."""
    wanted = Wanted(stability=False, contacts=False)
    for name in ("quarter", "full"):
        piece = sector(der.circle(), der.rectangular_section(1.6), 64, name=name)
        before = next(v.at for v in follow_angle(piece, wanted, Tally()) if v.kind == "fold")

        def fall(piece: Sector = piece, before: Equilibrium = before) -> Landing:
            return snap(piece, wanted, Tally(), before, before.tangent)

        seconds = cpu_time(fall, repeats)
        note = f"{fall().details['force_evaluations']} force evaluations"
        yield Row("snap", f"h/t 1.6, N 64, {name}", 1e3 * seconds, "ms", 100.0, note)


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


def start_up(repeats: int) -> Iterator[Row]:
    """Wall time of whole commands, compiled before."""
    for words, goal in (
        (["--help"], 0.5),
        (["fold", "circle", "--h-over-t", "4", "--quiet"], 3.0),
    ):
        times = []
        for _ in range(repeats):
            start = time.perf_counter()
            subprocess.run([sys.executable, "-m", "der", *words], check=True, capture_output=True)
            times.append(time.perf_counter() - start)
        yield Row("start-up", "der " + " ".join(words), statistics.median(times), "s", goal)
