"""A thousand rings of the paper's range on one process and on two, M to 1e-4, by either solver.

The rod starts on a mesh whose error bars are mostly small enough. If an error bar of M is too
large, the ring is folded again, on as many edges as the order of the error, 4, asks for. The error
bars are then checked on a sample of the rings, by the boundary-value problem, whose own errors are
estimates.
"""

from __future__ import annotations

import math
import statistics
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

import der
from der.diagram.workers import Workers, workers
from validation.benchmark.rings import BARE
from validation.benchmark.rows import Row
from validation.stress.random_rings import largest_error, random_rings

ASKED = 1e-4  # of the largest |M|
SMOOTH, JOINTED = 128, 152  # edges, of rings without and with jumps of curvature
MOST = 1024
LEAST, DOUBLED = 1.25, 2.0  # by how much edges grow at a time
BATCH = 10  # rings handed to a worker at a time
SEED = 1
NUMBERS = (1, 2)  # of processes
GOALS = {"rod": 5e-3, "boundary value": 1.2e-3}  # s a ring, on two processes


Drawn = tuple[der.Ring, der.Section]


@dataclass(frozen=True)
class Swept:
    """One ring of a sweep."""

    n: int  # edges that were enough, or the most that were tried; intervals of collocation
    error: float | None  # largest error estimated for M, over the largest |M|; None: not known
    seconds: float  # CPU
    reason: str  # why there is no path, or no error estimate; empty: there is


Method = Callable[[der.Ring, der.Section], Swept]


def scene(ring: der.Ring, section: der.Section, n: int) -> der.Scene:
    """The scene of a sweep: the path with error bars, and nothing else."""
    return der.Scene(ring, section, n_edges=n, error_bars=True, save_at=(math.pi,), **BARE)  # type: ignore[arg-type]


def swept(ring: der.Ring, section: der.Section, asked: float = ASKED) -> Swept:
    """Fold a ring on as many edges as its error bars ask for."""
    start = time.process_time()
    n = _divisible(ring, JOINTED if ring.breaks else SMOOTH)
    error, reason = _estimated(ring, section, n)
    while (error is None or error > asked) and n < MOST:
        n = min(_finer(ring, n, error, asked), MOST)
        error, reason = _estimated(ring, section, n)
    return Swept(n, error, time.process_time() - start, reason)


def _finer(ring: der.Ring, n: int, error: float | None, asked: float) -> int:
    """Edges that should be enough, after an error too large on ``n``, or not known there."""
    more = DOUBLED if error is None else min(max((error / asked) ** 0.25, LEAST), DOUBLED)
    return _divisible(ring, more * n)


def _divisible(ring: der.Ring, n: float) -> int:
    """The next number of edges from ``n`` on that can be halved twice, on the ring's sector.

    The number is not divisible once more: the mesh is then laid out on the coarsest of the three,
    which resolves fillets best (`der.geometry.mesh`).
    """
    unit = 16 if ring.symmetry == "D2" else 8
    return unit * (math.ceil(n / unit) // 2 * 2 + 1)


def solved(ring: der.Ring, section: der.Section, asked: float = ASKED) -> Swept:
    """Solve a ring's boundary-value problem to the tolerance asked for."""
    start = time.process_time()
    try:
        path = der.solve_bvp(der.Scene(ring, section, save_at=(math.pi,)), tolerance=asked)
    except der.NotConverged as failure:
        return Swept(0, None, time.process_time() - start, failure.path.reason)
    intervals = int(str(path.numerics["intervals"]))
    return Swept(intervals, largest_error(path), time.process_time() - start, "")


METHODS: dict[str, Method] = {"rod": swept, "boundary value": solved}


def _estimated(ring: der.Ring, section: der.Section, n: int) -> tuple[float | None, str]:
    """The largest error on ``n`` edges, or None and why."""
    try:
        error = largest_error_bar(der.fold(scene(ring, section, n)))
    except der.NotConverged as failure:
        return None, failure.path.reason
    return error, "" if error is not None else "a coarser mesh has no such states"


def largest_error_bar(path: der.Path) -> float | None:
    """Largest error bar of M, across the curve, over the largest |M|; None where one is missing.

    Notes
    -----
    A state's error in gamma shows as one in M where the curve is steep: error bars are taken as the
    normal distance that they allow for, in (gamma/pi, M/max|M|), as all errors of the bench are.
    """
    errors: dict[str, Any] = dict(path.error or {})
    special = {point.position for point in path.points if point.kind in ("branch", "contact")}
    kept = [k for k in range(len(path)) if k not in special]
    columns = [[errors[name][k] for k in kept] for name in ("gamma", "moment")]
    if any(error is None for column in columns for error in column):
        return None
    gamma, moment = (np.array(column, dtype=float) for column in columns)
    return float(np.hypot(gamma / np.pi, moment / np.abs(path.moment).max()).max())


def rows(
    count: int = 1000, sample: int = 40, *, numbers: Sequence[int] = NUMBERS, seed: int = SEED
) -> Iterator[Row]:
    """Times of the sweep by the rod and by the boundary-value problem, and their errors."""
    rings = list(islice(random_rings(count, seed), count))
    for number in numbers:
        with workers(number) as crew:
            yield _started(crew, rings[:2], number)
            for method in METHODS:
                row, found = _timed(crew, rings, method, number)
                yield row
                if number == numbers[-1]:
                    yield from _reached(method, found)
                    yield from _in_truth(method, rings, found, sample)


def _started(crew: Workers, rings: list[Drawn], number: int) -> Row:
    """Start the processes, and load the kernels in each."""
    start = time.perf_counter()
    for work in METHODS.values():
        for task in [crew.executor.submit(_batch, rings, work) for _ in range(number)]:
            task.result()
    note = "with compiled kernels; not counted below"
    return Row("sweep", _processes(number), time.perf_counter() - start, "s", note=note)


def _timed(crew: Workers, rings: list[Drawn], method: str, number: int) -> tuple[Row, list[Swept]]:
    """Wall time of a sweep, and what it found."""
    start, before = time.perf_counter(), time.process_time()
    found = _sweep(crew, rings, METHODS[method])
    wall, here = time.perf_counter() - start, time.process_time() - before
    cpu = sum(one.seconds for one in found)
    case = f"{method}, {len(rings)} rings, {_processes(number)}, wall"
    note = f"{cpu:.1f} s of CPU time, {cpu / wall:.2f} cores had; main process {here:.2f} s"
    goal = GOALS[method] * len(rings) if number == 2 else None
    return Row("sweep", case, wall, "s", goal, note), found


def _processes(number: int) -> str:
    return f"{number} processes" if number > 1 else "1 process"


def _sweep(crew: Workers, rings: list[Drawn], work: Method) -> list[Swept]:
    """All rings, in their order."""
    batches = [rings[k : k + BATCH] for k in range(0, len(rings), BATCH)]
    tasks: list[Future[list[Swept]]] = [crew.executor.submit(_batch, b, work) for b in batches]
    return [one for task in tasks for one in task.result()]


def _batch(rings: list[Drawn], work: Method) -> list[Swept]:
    return [work(ring, section) for ring, section in rings]


def _reached(method: str, found: list[Swept]) -> Iterator[Row]:
    """Time for a ring, the meshes that were enough, and the estimated errors."""
    each = 1e3 * statistics.median(one.seconds for one in found)
    counts = sorted(Counter(one.n for one in found).items())
    note = ", ".join(f"{times} on {n} edges" for n, times in counts) if method == "rod" else ""
    yield Row("sweep", f"{method}, median CPU time a ring", each, "ms", note=note)
    errors = [one.error for one in found if one.error is not None]
    reasons = Counter(one.reason for one in found if one.error is None)
    note = "; ".join(f"{times}: {reason}" for reason, times in reasons.items())
    within = sum(error <= ASKED for error in errors)
    yield Row("sweep", f"{method}, rings with M to {ASKED:g}", within, "", note=note)
    yield from _quantiles(f"{method}, error of M as estimated", errors)


def _in_truth(method: str, rings: list[Drawn], found: list[Swept], sample: int) -> Iterator[Row]:
    """Errors of the rod's first rings by the boundary-value problem."""
    if METHODS[method] is swept:
        errors = _true(rings, found, sample)
        yield from _quantiles(f"{method}, error of M in truth, {len(errors)} rings", errors)


def _true(rings: list[Drawn], found: list[Swept], sample: int) -> list[float]:
    """Largest normal distance in M from the boundary-value problem, of the first of the rings."""
    errors = []
    for (ring, section), one in islice(zip(rings, found, strict=True), sample):
        if one.error is None:
            continue
        asked = scene(ring, section, one.n)
        errors.append(der.compare(asked, der.fold(asked)).largest[0])
    return errors


def _quantiles(name: str, values: list[float]) -> Iterator[Row]:
    """Median, 95 % and largest."""
    if values:
        for part, share in (("median", 0.5), ("95 %", 0.95), ("largest", 1.0)):
            yield Row("sweep", f"{name}, {part}", float(np.quantile(values, share)), "")
