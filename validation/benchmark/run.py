"""Run time against error, on this machine, in one run: `der bench`.

Every number is measured here and now: CPU time of this process, wall time, and the most memory held
at once, medians of several runs, warm unless a row says otherwise, so that ratios between rows mean
something on a noisy machine. Errors are normal distances, in (gamma/pi, M/max|M|) and in
(gamma/pi, U/max U), from the converged solution of the boundary-value problem (`bench_rings`).
What others measured elsewhere stands in a table of its own, with its source.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.metadata import version
from itertools import chain
from pathlib import Path

from der.utils.checks import shown
from der.utils.files import write_whole
from validation.benchmark import cold as bench_cold
from validation.benchmark import elastica as bench_elastica
from validation.benchmark import needs as bench_needs
from validation.benchmark import orders as bench_orders
from validation.benchmark import paths as bench_paths
from validation.benchmark import rings as bench_rings
from validation.benchmark import state as bench_state
from validation.benchmark import sweep as bench_sweep
from validation.benchmark.cited import CITED, cited
from validation.benchmark.methods import (
    SIZES,
    TOLERANCES,
    bvp_trials,
    relaxation_trials,
    rod_trials,
    stepping_trials,
)
from validation.benchmark.rows import Row, Trial, machine
from validation.benchmark.scaling import SIZES as SCALES
from validation.benchmark.scaling import Scale, scale

PARTS = ("paths", "needs", "orders", "error", "state", "scaling", "sweep", "start")


@dataclass(frozen=True)
class Extent:
    """How much is measured."""

    repeats: int = 5
    rings: tuple[bench_rings.BenchRing, ...] = bench_rings.RINGS
    states: int = bench_rings.STATES  # of the reference
    edges: tuple[int, ...] = SIZES
    tolerances: tuple[float, ...] = TOLERANCES
    relaxed: tuple[int, ...] = (32, 64, 128)
    stepping: tuple[float, ...] = (1e-3, 1e-5, 1e-6)
    slow_repeats: int = 3  # of what takes seconds
    elements: tuple[int, ...] = (16, 32, 64, 128, 256)  # of PyElastica
    orders: tuple[int, ...] = bench_orders.SIZES
    scales: tuple[int, ...] = SCALES
    swept: int = 1000
    sample: int = 40
    commands: int = 5
    cold: bool = True  # also what compiling takes


FULL = Extent()
QUICK = Extent(
    repeats=3,
    rings=tuple(case for case in bench_rings.RINGS if case.name != "rectangle 0.6, r/a 0.3"),
    edges=(32, 128),
    tolerances=(1e-4, 1e-7, 1e-10),
    relaxed=(32,),
    stepping=(1e-3,),
    slow_repeats=1,
    elements=(16, 32),
    orders=(64, 128, 256),
    scales=(64, 1024, 16384),
    swept=50,
    sample=4,
    commands=2,
    cold=False,
)


@dataclass
class Found:
    """All that was measured."""

    rows: list[Row] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
    scales: list[Scale] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    def to_json(self) -> str:
        """JSON text, with the machine, and what is cited set apart."""
        entries = {
            "machine": machine(),
            "version": version("ring-origami"),
            "rows": [asdict(row) for row in self.rows],
            "trials": [asdict(trial) for trial in self.trials],
            "scales": [asdict(scale) for scale in self.scales],
            "skipped": self.skipped,
            "cited": CITED,
        }
        return json.dumps(entries, indent=1, allow_nan=False) + "\n"


def run(
    file: Path | None = None,
    *,
    out: Path | None = None,
    quick: bool = False,
    only: tuple[str, ...] = PARTS,
) -> Found:
    """Measure, print tables as they grow, and write what is asked for.

    Parameters
    ----------
    file : where the JSON goes.
    out : folder for bench.json, bench_error.png and bench_cost.png.
    quick : whether to take fewer sizes and repetitions.
    only : which of `PARTS`.

    Raises
    ------
    ValueError
        For a part that there is not.
    """
    wrong = [part for part in only if part not in PARTS]
    if wrong or not only:
        raise ValueError(f"only must be some of {', '.join(PARTS)}, got {shown(', '.join(wrong))}")
    print(f"der {version('ring-origami')}, {machine()}")
    found = Found()
    try:
        for one in measure(QUICK if quick else FULL, only):
            kept(found, one)
            print(one, flush=True)
    finally:  # Ctrl-C keeps what there is
        for target in [file, *([] if out is None else [out / "bench.json"])]:
            if target is not None:
                content = found.to_json().encode()
                write_whole(target, lambda opened, content=content: opened.write(content))  # type: ignore[misc]
        if out is not None:
            _draw(found, out)
    print(cited())
    return found


def kept(found: Found, one: Row | Trial | Scale | str) -> None:
    """Put one thing measured where it belongs."""
    if isinstance(one, Row):
        found.rows.append(one)
    elif isinstance(one, Trial):
        found.trials.append(one)
    elif isinstance(one, Scale):
        found.scales.append(one)
    elif one.endswith("skipped"):
        found.skipped.append(one)


def measure(
    extent: Extent = FULL, only: tuple[str, ...] = PARTS
) -> Iterator[Row | Trial | Scale | str]:
    """All that is measured, one thing after the other; words are for the reader alone."""
    parts: Mapping[str, Callable[[Extent], Iterator[Row | Trial | Scale | str]]] = {
        "paths": _paths,
        "needs": lambda e: bench_needs.rows(e.repeats),
        "orders": _orders,
        "error": _errors,
        "state": _state,
        "scaling": _scaling,
        "sweep": lambda e: bench_sweep.rows(e.swept, e.sample),
        "start": _start,
    }
    for part in PARTS:
        if part in only:
            yield f"\n{part}"
            start = time.perf_counter()
            yield from parts[part](extent)
            yield f"{part} took {time.perf_counter() - start:.0f} s"


def _paths(extent: Extent) -> Iterator[Row]:
    repeats = extent.repeats
    yield from bench_paths.paths(repeats)
    yield from bench_paths.bvp_paths(repeats, extent.rings)
    yield from bench_paths.relaxation(extent.relaxed, min(repeats, 5))
    yield from bench_paths.snaps(repeats)
    yield from bench_paths.recording(min(repeats, 5))


def _orders(extent: Extent) -> Iterator[Row]:
    """How well the truth is known, and how errors fall towards it."""
    for case in extent.rings:
        truth = _known(case, extent.states)
        yield from bench_rings.rows(truth)
        yield from bench_orders.rows(truth, extent.orders)


def _errors(extent: Extent) -> Iterator[Row | Trial | str]:
    """Errors over time of each ring's whole path."""
    for case in extent.rings:
        truth = _known(case, extent.states)
        trials = []
        for trial in chain(
            rod_trials(truth, extent.edges, extent.repeats),
            relaxation_trials(truth, extent.relaxed, extent.slow_repeats),
            bvp_trials(truth, extent.tolerances, extent.repeats),
            stepping_trials(truth, extent.stepping, extent.slow_repeats),
        ):
            trials.append(trial)
            yield trial
        if case.folds:
            yield f"{case.name}: solve_bvp cannot step past a fold, skipped"
        yield from _front(case.name, trials)


_known = cache(bench_rings.known)  # by two parts


def _state(extent: Extent) -> Iterator[Trial | str]:
    """One state, by everyone."""
    edges, relaxed = extent.edges, extent.relaxed
    sizes = {
        "rod, sector": edges,
        "rod, full ring": edges,
        "rod, extrapolated": tuple(n for n in edges if n >= 32),
        "dynamic relaxation": relaxed,
    }
    trials = []
    for trial in bench_state.trials(
        sizes, extent.tolerances, extent.stepping, extent.elements, extent.repeats
    ):
        trials.append(trial)
        yield trial
    if not bench_elastica.installed():
        yield "PyElastica: not installed, skipped"
    yield from _front(bench_state.NAME, trials)


def _front(name: str, trials: list[Trial]) -> Iterator[str]:
    """The methods that none beats, in words."""
    from validation.benchmark.plot import front

    best = "; ".join(
        f"{1e3 * t.cpu:.1f} ms {t.error:.1e} {t.method} {t.setting}" for t in front(trials)
    )
    yield f"{name}: none is faster and better than {best}"


def _scaling(extent: Extent) -> Iterator[Scale | Row]:
    for n in extent.scales:
        measured = scale(n, min(extent.repeats, 5))
        yield measured
        yield from measured.rows()


def _start(extent: Extent) -> Iterator[Row]:
    yield from bench_paths.start_up(extent.commands)
    if extent.cold:
        yield from bench_cold.rows()


def _draw(found: Found, out: Path) -> None:
    """The pictures of what there is."""
    from validation.benchmark.plot import draw_costs, draw_errors

    if any(trial.error is not None for trial in found.trials):
        print(f"wrote {draw_errors(found.trials, out / 'bench_error.png')}")
    if found.scales:
        print(f"wrote {draw_costs(found.scales, out / 'bench_cost.png')}")
