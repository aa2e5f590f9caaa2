"""Rows of the benchmark on phase diagrams: gain of workers, cost of a case, a whole diagram.

    python -m validation.benchmark.phase

Runs of one and of two workers alternate, so that a noisy machine disturbs both alike. If two cores
are not idle, the row says which part of a core's time the cases got.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path as File

from der.diagram.cases import Case, solve_case
from der.diagram.cases import Row as Solved
from der.diagram.diagram import phase_diagram
from der.diagram.families import family
from der.diagram.scan import Solve, solve_all
from der.diagram.store import Store
from der.diagram.workers import Workers, workers
from scenarios.output import Arguments
from validation.benchmark.rows import Row

DIAGRAM = "fig3a"
SIDE = 12  # cases along each side of the diagram, for the gain
TRIVIAL = 400  # cases, for the cost of sending one
FINEST = 8  # cells along each side of the diagram that is drawn
KB = 1 if sys.platform == "darwin" else 1024  # unit of ru_maxrss, in bytes


def rows(repeats: int) -> Iterator[Row]:
    """The gain of a second worker, and the cost of a case."""
    yield _gain(repeats)
    with workers(2) as crew:
        yield _cost("2 processes", crew, repeats)
    yield from _dask(repeats)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as alone:
        yield from alone.submit(drawn, DIAGRAM, FINEST).result()


def timed(case: Case) -> Solved:
    """`solve_case`, with the CPU time that it took."""
    started = time.process_time()
    row = solve_case(case)
    return replace(row, seconds=time.process_time() - started)


def nothing(case: Case) -> Solved:
    """A row without any work."""
    return Solved(case, "unfoldable")


def drawn(name: str, finest: int) -> list[Row]:
    """A diagram from nothing by two workers, in a process that does nothing else."""
    import resource  # not on Windows

    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        phase_diagram(name, folder, workers=2, finest=finest, progress=False)
    wall = time.perf_counter() - started
    own, theirs = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    here, there = (used.ru_utime + used.ru_stime for used in (own, theirs))
    case = f"{name} --finest {finest}"
    note = f"CPU time: {here:.1f} s in the main process, {there:.1f} s in two workers"
    return [
        Row("phase", f"{case}, 2 workers, wall", wall, "s", note=note),
        Row("phase", f"{case}, largest memory", own.ru_maxrss * KB / 1e6, "MB", 400.0),
    ]


def _cases(side: int) -> list[Case]:
    of = family(DIAGRAM)
    parts = [(k + 0.5) / side for k in range(side)]
    return [of.case("x", (u, v)) for u in parts for v in parts]


def _gain(repeats: int) -> Row:
    """Wall time of one worker over that of two, on the same cases by turns."""
    cases = _cases(SIDE)
    one, two = [], []
    with ExitStack() as opened:
        crews = [opened.enter_context(workers(number)) for number in (1, 2)]
        for crew in crews:
            _wall(cases[:: len(cases) // 16], crew, timed)  # kernels are loaded
        for _ in range(repeats):
            one.append(_wall(cases, crews[0], timed))
            two.append(_wall(cases, crews[1], timed))
    ratio = statistics.median(a[0] / b[0] for a, b in zip(one, two, strict=True))
    wall, cpu = (statistics.median(run[k] for run in two) for k in (0, 1))
    alone = statistics.median(run[1] for run in one)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    note = (
        f"{1e3 * alone / len(cases):.1f} ms of CPU a case by one, {1e3 * cpu / len(cases):.1f} by "
        f"two, whose cores were at cases {cpu / wall / 2:.0%} of the time; {cores} cores, "
        f"{os.getloadavg()[0]:.1f} processes ran on them"
    )
    case = f"2 workers vs 1, {len(cases)} cases of {DIAGRAM}"
    return Row("phase", case, ratio, "times", 1.8, note)


def _cost(words: str, crew: Workers, repeats: int) -> Row:
    """Wall time of a case without work: sent, brought back, stored and synced."""
    of = family(DIAGRAM)
    cases = [of.case("x", (k / TRIVIAL, 0.0)) for k in range(TRIVIAL)]
    _wall(cases[:16], crew, nothing)
    before = time.process_time()
    taken = statistics.median(_wall(cases, crew, nothing)[0] for _ in range(repeats))
    here = (time.process_time() - before) / repeats
    note = f"{1e3 * here / TRIVIAL:.2f} ms of CPU in the main process"
    return Row("phase", f"overhead of a case, {words}", 1e3 * taken / TRIVIAL, "ms", 5.0, note)


def _dask(repeats: int) -> Iterator[Row]:
    """The same by a Dask scheduler with two workers of its own, where Dask is installed."""
    try:
        from distributed import LocalCluster
    except ImportError:
        return
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        LocalCluster(**options, silence_logs=50) as cluster,
        workers(scheduler=cluster.scheduler_address) as crew,
    ):
        yield _cost("2 workers by Dask", crew, repeats)


def _wall(cases: Sequence[Case], crew: Workers, solve: Solve) -> tuple[float, float]:
    """Wall time of cases and the sum of what they say that they took [s]."""
    with tempfile.TemporaryDirectory() as folder, Store(File(folder) / "cases.sqlite") as store:
        started = time.perf_counter()
        solve_all(cases, store, crew, solve=solve)
        wall = time.perf_counter() - started
        return wall, sum(row.seconds for row in store.rows.values())


def main() -> None:
    """Print the rows."""
    Arguments(__file__, __doc__).parse_args()
    for row in rows(5):
        print(row, flush=True)


if __name__ == "__main__":
    # workers find what they are sent in the module of this name, not in __main__
    from validation.benchmark.phase import main as run

    run()
