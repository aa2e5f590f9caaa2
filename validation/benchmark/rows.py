"""Rows and trials of the benchmark, and how time and memory are measured."""

from __future__ import annotations

import math
import platform
import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Generic, TypeVar

from der.errors import NotConverged

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
    """Cost and error of one method on one ring; None: not taken, or no such answer."""

    ring: str
    method: str
    setting: str  # number of edges, or tolerance
    cpu: float = 0.0  # s, median
    wall: float = 0.0  # s, median
    memory: int | None = None  # B, largest held at once
    moment: float | None = None  # error of M, as a fraction of the largest
    energy: float | None = None  # error of U, likewise
    folds: float | None = None  # largest error of a fold's gamma, rad
    note: str = ""

    @property
    def error(self) -> float | None:
        """The larger of the errors in M and U."""
        return max((e for e in (self.moment, self.energy) if e is not None), default=None)

    def __str__(self) -> str:
        memory = "" if self.memory is None else f"{1e-3 * self.memory:.0f} kB"
        errors = f"M {_short(self.moment)} U {_short(self.energy)} folds {_short(self.folds)}"
        return (
            f"{self.ring:28}{self.method:26}{self.setting:8}{1e3 * self.cpu:10.2f} ms "
            f"{1e3 * self.wall:10.2f} ms {memory:>9}  {errors}  {self.note}"
        ).rstrip()


def _short(value: float | None) -> str:
    return f"{'-':8}" if value is None else f"{value:8.1e}"


def front(trials: Iterable[Trial]) -> list[Trial]:
    """The trials that none beats in both time and error, from fast to exact."""
    best: list[Trial] = []
    for trial in sorted((t for t in trials if t.error is not None), key=lambda t: (t.cpu, t.error)):
        if not best or (trial.error or 0.0) < (best[-1].error or 0.0):
            best.append(trial)
    return best


def front_text(name: str, trials: Iterable[Trial]) -> str:
    """The Pareto front in a sentence."""
    best = (f"{1e3 * t.cpu:.1f} ms {t.error:.1e} {t.method} {t.setting}" for t in front(trials))
    return f"{name}: none is faster and better than {'; '.join(best)}"


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
    """The most that Python and numpy hold at once in ``work``, above what they held before [B]."""
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


def path_row(
    group: str, case: str, work: Callable[[], Any], repeats: int, goal: float | None = None
) -> Row:
    """CPU time of what returns a path [ms]; steps and iterations are in the note."""
    done = measured(work, repeats, memory=False)
    return Row(group, case, 1e3 * done.cpu, "ms", goal, counts(done.result))


def counts(path: Any) -> str:
    """Steps and iterations of a path, in words."""
    return f"{path.timing.steps} steps, {path.timing.newton_iterations} Newton iterations"


@dataclass(frozen=True)
class Attempt:
    """A method at one setting, to be timed.

    Parameters
    ----------
    work : one run; what it raises, `NotConverged` or `ValueError`, is the trial's note.
    memory : whether its memory is measured.
    """

    method: str
    setting: str
    work: Callable[[], Any]
    repeats: int
    memory: bool = True

    def trial(self, ring: str, errors: Callable[[Any], Mapping[str, Any]]) -> Trial:
        """Time it; ``errors`` are a trial's entries from moment to note, of the result."""
        try:
            done = measured(self.work, self.repeats, memory=self.memory, warm=False)
        except (NotConverged, ValueError) as failure:  # refused, or given up: both say why
            return Trial(ring, self.method, self.setting, note=str(failure))
        cost = (done.cpu, done.wall, done.memory)
        return Trial(ring, self.method, self.setting, *cost, **errors(done.result))


def finite(value: float) -> float | None:
    """The value; None if it is infinite, as where a fold is missing."""
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
