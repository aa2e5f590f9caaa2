"""Start of commands: wall times, and the kernels that the first command compiles.

A fresh process folds a ring with an empty cache of kernels. Numba reports the start and the end of
every compilation; those inside another one are subtracted from its time.
"""

from __future__ import annotations

import json
import os
import runpy
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from validation.benchmark.rows import Row

if TYPE_CHECKING:  # a timed process imports this module first
    from validation.benchmark.extent import Extent

COMMAND = ("fold", "circle", "--h-over-t", "4", "--quiet")
BVP = ("bvp", *COMMAND[1:])
COSTLIEST = 10  # kernels that have a row of their own


class Compiled(NamedTuple):
    """The time of compiling a kernel, without the kernels that it calls."""

    kernel: str
    signatures: int
    seconds: float


class Report(NamedTuple):
    """A compilation starts, or ends."""

    kernel: str
    time: float  # s
    starts: bool


def rows(extent: Extent) -> Iterator[Row]:
    """Compiled commands, and where asked for the first command of all."""
    yield from compiled(extent.commands)
    if extent.cold:
        yield from compiling()


def compiled(repeats: int) -> Iterator[Row]:
    """Wall time of complete commands, compiled before."""
    for words, goal in ((("--help",), 0.5), (COMMAND, 0.45), (BVP, 0.4)):
        times = [_wall("der", *words) for _ in range(repeats)]
        yield Row("start-up", " ".join(("der", *words)), statistics.median(times), "s", goal)


def compiling(command: tuple[str, ...] = COMMAND, other: tuple[str, ...] = BVP) -> Iterator[Row]:
    """Commands without anything compiled, then with packs; and what numba compiles without them."""
    with tempfile.TemporaryDirectory() as folder:
        packs, out = Path(folder, "packs"), Path(folder, "compiled.json")
        env = {"NUMBA_CACHE_DIR": str(Path(folder, "cache")), "DER_PACKS": str(packs)}
        yield Row(
            "start-up",
            "first der fold, nothing compiled, wall",
            _wall("der", *command, **env),
            "s",
            13.0,
        )
        yield Row("start-up", "der bvp right after it, wall", _wall("der", *other, **env), "s")
        yield Row("start-up", "der fold from packs, wall", _wall("der", *command, **env), "s", 0.45)
        yield Row("start-up", "der bvp from packs, wall", _wall("der", *other, **env), "s", 0.4)
        size = 1e-6 * sum(file.stat().st_size for file in packs.glob("*.pack"))
        yield Row("start-up", "packs on disk", size, "MB")
        words = ("validation.benchmark.start", str(out), *command)
        alone = _wall(*words, **env | {"DER_PACKS": "off"})
        kernels = [Compiled(*one) for one in json.loads(out.read_text())]
    note = f"{sum(k.signatures for k in kernels)} signatures"
    yield Row("start-up", "first der fold, numba alone, wall", alone, "s", 60.0)
    yield Row("start-up", "kernels compiled by it", len(kernels), "", note=note)
    for one in kernels[:COSTLIEST]:
        yield Row("start-up", f"compiling {one.kernel}", one.seconds, "s")


def _wall(*module: str, **env: str) -> float:
    """Wall time of a module in a process of its own [s]."""
    start = time.perf_counter()
    words = [sys.executable, "-m", *module]
    subprocess.run(words, check=True, capture_output=True, env=os.environ | env)
    return time.perf_counter() - start


def own_times(reports: Iterable[Report]) -> list[Compiled]:
    """Time of each kernel without what it calls, the costliest first."""
    found: dict[str, Compiled] = {}
    open_: list[tuple[float, float]] = []  # start, and what was compiled meanwhile
    for one in reports:
        if one.starts:
            open_.append((one.time, 0.0))
            continue
        start, inside = open_.pop()
        taken = one.time - start
        if open_:
            open_[-1] = open_[-1][0], open_[-1][1] + taken
        _, signatures, seconds = found.get(one.kernel, Compiled(one.kernel, 0, 0.0))
        found[one.kernel] = Compiled(one.kernel, signatures + 1, seconds + taken - inside)
    return sorted(found.values(), key=lambda one: -one.seconds)


def _watched(out: Path, command: list[str]) -> None:
    """Run the command in this process, and write what was compiled for it."""
    from numba.core import event

    recorder = event.RecordingListener()
    event.register("numba:compile", recorder)
    sys.argv = ["der", *command]
    try:
        runpy.run_module("der", run_name="__main__")
    except SystemExit as ended:
        if ended.code:
            raise
    reports = []
    for moment, one in recorder.buffer:
        kernel = one.data["dispatcher"].py_func
        reports.append(Report(f"{kernel.__module__}.{kernel.__qualname__}", moment, one.is_start))
    out.write_text(json.dumps(own_times(reports)))


if __name__ == "__main__":
    _watched(Path(sys.argv[1]), sys.argv[2:])
