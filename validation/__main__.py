"""The benchmark, the stress test and two surveys over random rings, from a clone.

    python -m validation benchmark [--quick] [--only PARTS] [--json F] [--out DIR]
    python -m validation stress [--quick | --long] [--workers N] [--seed N] [--json F]
    python -m validation error-bars [--count N] [--seed N] [--edges N,...] [--json F]
    python -m validation sectors [--count N] [--seed N] [--edges N,...] [--json F]

`der bench` and `der stress` do the same in the folder of a clone.
"""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path as File

from der.cli.clone import BenchOptions, StressOptions
from der.cli.commands import leave
from der.cli.files import check_named, check_writable, made_folder
from der.cli.output import show
from der.cli.parsing import add_command, application, file_option, numbers, option, options_named

app = application("The evidence: benchmark, stress test and surveys over random rings.")


@dataclass(frozen=True)
class ErrorBarOptions:
    """Which rings are judged."""

    count: int = option("Random rings, two of five of them profiles.", 500)
    seed: int = option("Of the rings.", 0)
    edges: str = option("Edges of the rods, commas between.", "64,128")
    json: str | None = file_option("Write everything judged, with the rings of what is outside.")


@dataclass(frozen=True)
class SectorOptions:
    """Which rings are compared."""

    count: int = option("Random circles.", 300)
    seed: int = option("Of the rings.", 0)
    edges: str = option("Edges of the rods, commas between.", "64,128")
    json: str | None = file_option("Write every change of the index that was found.")


def benchmark(wanted: BenchOptions) -> int:
    """Measure time, memory and error of this package and its peers, on this machine, in one run."""
    with options_named():
        check_named(json=wanted.json, out=wanted.out)
        file = _writable(wanted.json)
        from validation.benchmark.run import PARTS, run

        only = wanted.only
        parts = PARTS if only is None else tuple(part.strip() for part in only.split(","))
        with nullcontext() if wanted.out is None else made_folder(wanted.out) as folder:
            if folder is not None:
                check_writable("json", folder / "bench.json")
            run(file, out=folder, quick=wanted.quick, only=parts)
    return 0


def stress(wanted: StressOptions) -> int:
    """Try to break both solvers, and count what has no named reason."""
    with options_named():
        if wanted.quick and wanted.long:
            raise ValueError("quick cannot be given together with --long, got both")
        check_named(json=wanted.json)
        file = _writable(wanted.json)
        from validation.stress.run import stress as run

        workers = 1 if wanted.workers is None and not wanted.long else wanted.workers
        level = "long" if wanted.long else "quick"
        summary = run(level, file, seed=wanted.seed, workers=workers)
    show(str(summary))
    return 130 if summary.interrupted else 0


def error_bars(wanted: ErrorBarOptions) -> int:
    """Count the error bars that hold the boundary-value problem's values, over random rings."""
    with options_named():
        edges = [int(n) for n in numbers("edges", wanted.edges) or ()]
        file = _writable(wanted.json)
    from validation.error_bars import saved, survey

    found = survey(wanted.count, wanted.seed, edges)
    if file is not None:
        file.write_text(saved(found))
    show(str(found))
    return 130 if found.interrupted else 0


def sectors(wanted: SectorOptions) -> int:
    """Compare the index and its changes between sectors, meshes and steps, over random circles."""
    with options_named():
        edges = [int(n) for n in numbers("edges", wanted.edges) or ()]
        file = _writable(wanted.json)
    from validation.sectors import saved, survey

    found = survey(wanted.count, wanted.seed, edges)
    if file is not None:
        file.write_text(saved(found))
    show(str(found))
    return 130 if found.interrupted else 0


def _writable(json: str | None) -> File | None:
    """The file of --json, after making sure that it can be written."""
    if json is None:
        return None
    check_writable("json", File(json))
    return File(json)


for _command in (benchmark, stress, error_bars, sectors):
    add_command(app, _command)

if __name__ == "__main__":
    leave(app, "python -m validation", sys.argv[1:])
