"""What `der bench` hands out: rows, trials, and how time and memory are taken."""

from __future__ import annotations

import math
import platform
import statistics
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Generic, TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class Row:
    """One measured quantity."""

    group: str
    case: str
    value: float
    unit: str
    goal: float | None = None
    note: str = ""

    def __str__(self) -> str:
        goal = "" if self.goal is None else f"goal {self.goal:g}"
        value = f"{self.value:11.4g} {self.unit:7}"
        return f"{self.group:12}{self.case:52}{value} {goal:11} {self.note}".rstrip()


@dataclass(frozen=True)
class Trial:
    """What one method cost on one ring, and how far off it was; None: it has no such answer."""

    ring: str
    method: str
    setting: str  # number of edges, or tolerance
    cpu: float  # s, median
    wall: float  # s, median
    memory: int | None  # B, largest held at once; None: not taken
    moment: float | None  # error of M, as a fraction of the largest
    energy: float | None  # error of U, likewise
    folds: float | None  # largest error of a fold's gamma, rad
    note: str = ""

    @property
    def error(self) -> float | None:
        """The larger of the errors in M and U."""
        known = [e for e in (self.moment, self.energy) if e is not None]
        return max(known) if known else None

    def __str__(self) -> str:
        memory = "" if self.memory is None else f"{1e-3 * self.memory:.0f} kB"
        errors = f"M {_short(self.moment)} U {_short(self.energy)} folds {_short(self.folds)}"
        return (
            f"{self.ring:28}{self.method:26}{self.setting:8}{1e3 * self.cpu:10.2f} ms "
            f"{1e3 * self.wall:10.2f} ms {memory:>9}  {errors}  {self.note}"
        ).rstrip()


def failed(ring: str, method: str, setting: str, why: object) -> Trial:
    """A trial that came to nothing, and why."""
    return Trial(ring, method, setting, 0.0, 0.0, None, None, None, None, str(why))


def _short(value: float | None) -> str:
    return f"{'-':8}" if value is None else f"{value:8.1e}"


@dataclass(frozen=True)
class Measured(Generic[Result]):
    """A result, and what it cost."""

    result: Result
    cpu: float  # s, median
    wall: float  # s, median
    memory: int | None  # B


def measured(
    work: Callable[[], Result], repeats: int, *, memory: bool = True, warm: bool = True
) -> Measured[Result]:
    """Median CPU and wall time of ``work`` over ``repeats`` runs, and the memory it takes.

    Parameters
    ----------
    memory : whether to run it once more under `tracemalloc`, uncounted: the most that Python and
        numpy hold at once. What C libraries allocate for themselves is not in it.
    warm : whether to run it once before the clock starts.
    """
    if warm:  # compiles or loads kernels, which is not what a run takes
        work()
    peak = peak_memory(work) if memory else None
    cpu, wall = [], []
    for _ in range(repeats):
        cpu_start, wall_start = time.process_time(), time.perf_counter()
        result = work()
        cpu.append(time.process_time() - cpu_start)
        wall.append(time.perf_counter() - wall_start)
    return Measured(result, statistics.median(cpu), statistics.median(wall), peak)


def peak_memory(work: Callable[[], object]) -> int:
    """The most that Python and numpy hold at once during ``work`` [B], above what there was."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        work()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


def cpu_time(work: Callable[[], object], repeats: int) -> float:
    """Median CPU time of ``work`` [s], after one run that is not counted."""
    return measured(work, repeats, memory=False).cpu


def finite(value: float) -> float | None:
    """The value, or None for infinity: an answer that is not there, such as a missing fold."""
    return value if math.isfinite(value) else None


def machine() -> str:
    """Processor, Python and the libraries that matter for speed."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    return f"{_processor()}, Python {platform.python_version()}, {libraries}"


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:  # not Linux
        pass
    return platform.processor() or platform.machine()
