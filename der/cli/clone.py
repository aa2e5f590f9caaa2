"""The commands `bench` and `stress`, which need a clone of the repository.

In the folder of a clone they do what `python -m validation` does; the wheel has no such module.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path as File
from typing import Any

import typer

from der.cli.parsing import file_option, folder_option, option

_CLONE = ("der/__init__.py", "validation/__main__.py", "validation/benchmark/run.py")


@dataclass(frozen=True)
class BenchOptions:
    """What is measured, and where it is written."""

    json: str | None = file_option("Write what is measured.")
    out: str | None = folder_option("Write bench.json, bench_error.png and bench_cost.png.")
    quick: bool = option("Fewer repetitions and sizes.", False)
    only: str | None = option(
        "Of paths, needs, orders, error, state, scaling, sweep, start; commas between.",
        metavar="PARTS",
    )


@dataclass(frozen=True)
class StressOptions:
    """Which cases are tried."""

    quick: bool = option("120 cases, under a minute.", False)
    long: bool = option("10,000 cases, ten minutes on 2 cores.", False)
    workers: int | None = option("Processes; with --long one a core, else one.")
    seed: int = option("Of the cases.", 0)
    json: str | None = file_option("Write the summary here.")


def bench(wanted: BenchOptions) -> int:
    """Measure time, memory and error of this package and its peers, on this machine, in one run."""
    return int(_validation("bench").benchmark(wanted))


def stress(wanted: StressOptions) -> int:
    """Try to break both solvers, and count what has no named reason."""
    return int(_validation("stress").stress(wanted))


def _validation(name: str) -> Any:
    """The module behind `python -m validation` of the clone that is the current folder."""
    if not all(File(file).is_file() for file in _CLONE):
        raise typer.TyperException(
            f"'{name}' runs in a clone of the repository of der only: clone it, change into its "
            f"folder, and repeat the command"
        )
    sys.path.insert(0, os.getcwd())
    return import_module("validation.__main__")
