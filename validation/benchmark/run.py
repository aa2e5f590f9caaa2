"""Run time against error, on this machine, in one run: `python -m validation benchmark`.

Every number is measured in this run: CPU time of this process, wall time, and the largest memory
held. Times are medians of several runs, after a first one unless a row says otherwise. Errors are
normal distances, in (gamma/pi, M/max|M|) and in (gamma/pi, U/max U), from the converged solution of
the boundary-value problem (`rings`). Times of others, measured elsewhere, are in a table of their
own, with the source.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path

from der.utils.checks import shown
from der.utils.files import Saved
from validation.benchmark import methods, needs, orders, paths, rings, scaling, start, state, sweep
from validation.benchmark.cited import CITED, cited
from validation.benchmark.extent import FULL, QUICK, Extent
from validation.benchmark.rows import Row, Trial, machine
from validation.benchmark.scaling import Scale

Measurement = Row | Trial | Scale | str  # a string is for the reader alone


def _orders(extent: Extent) -> Iterator[Row]:
    """How well the reference is known, and how errors fall towards it."""
    for case in extent.rings:
        truth = rings.known(case, extent.states)
        yield from rings.rows(truth)
        yield from orders.rows(truth, extent.orders)


_ROWS: Mapping[str, Callable[[Extent], Iterator[Measurement]]] = {
    "paths": paths.rows,
    "needs": lambda extent: needs.rows(extent.repeats),
    "orders": _orders,
    "error": methods.rows,
    "state": state.rows,
    "scaling": scaling.rows,
    "sweep": lambda extent: sweep.rows(extent.swept, extent.sample),
    "start": start.rows,
}
PARTS = tuple(_ROWS)


@dataclass
class Found(Saved):
    """Everything that was measured."""

    rows: list[Row] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
    scales: list[Scale] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    def add(self, one: Measurement) -> None:
        """Put one thing measured where it belongs."""
        if isinstance(one, Row):
            self.rows.append(one)
        elif isinstance(one, Trial):
            self.trials.append(one)
        elif isinstance(one, Scale):
            self.scales.append(one)
        elif one.endswith("skipped"):
            self.skipped.append(one)

    def to_json(self) -> str:
        """JSON text, with the machine, and the cited times apart."""
        entries = {"machine": machine(), "version": version("ring-origami")}
        entries |= asdict(self) | {"cited": CITED}
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
        For an unknown part.
    """
    wrong = [part for part in only if part not in PARTS]
    if wrong or not only:
        raise ValueError(f"only must be some of {', '.join(PARTS)}, got {shown(', '.join(wrong))}")
    print(f"der {version('ring-origami')}, {machine()}")
    found = Found()
    try:
        for one in measure(QUICK if quick else FULL, only):
            found.add(one)
            print(one, flush=True)
    finally:  # Ctrl-C keeps what was measured
        for target in (file, out and out / "bench.json"):
            if target is not None:
                found.save(target)
        if out is not None:
            _draw(found, out)
    print(cited())
    return found


def measure(extent: Extent, only: tuple[str, ...]) -> Iterator[Measurement]:
    """Everything that is measured, one part after the other."""
    for part in PARTS:
        if part in only:
            yield f"\n{part}"
            began = time.perf_counter()
            yield from _ROWS[part](extent)
            yield f"{part} took {time.perf_counter() - began:.0f} s"


def _draw(found: Found, out: Path) -> None:
    """Draw what was measured."""
    from der.paper.canvas import save
    from validation.benchmark.plot import figure_of_costs, figure_of_errors

    if any(trial.error is not None for trial in found.trials):
        print(f"wrote {save(figure_of_errors(found.trials), out / 'bench_error.png')}")
    if found.scales:
        print(f"wrote {save(figure_of_costs(found.scales), out / 'bench_cost.png')}")
