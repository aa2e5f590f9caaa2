"""Tries to break both solvers, and counts the failures: `python -m validation stress`.

    summary = validation.stress.run.stress("quick")
    validation.stress.run.repeat(summary.failed[0].case)   # one of them again

A failure is explained if the scene is refused, or if a solver stops for one of the reasons in
`EXPLAINED`, which the documentation describes. Any other failure is not explained: another
exception, no answer within the time limit, a warning, a number that is not finite, a record that
contradicts itself, a residual above the tolerance, energy that is not work.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from types import FrameType
from typing import Any, TypeAlias

import numpy as np

import der
from der.diagram.jobs import Jobs
from der.diagram.workers import processes
from der.diagram.workers import workers as started
from der.errors import Reason
from der.utils import checks
from der.utils.files import FilePath
from der.utils.interrupts import put_off
from validation.stress.cases import Case, case_from_json, cases
from validation.stress.checks import Fault, not_converged
from validation.stress.kinds import RUN, Refused
from validation.stress.summary import Failure, Summary

LEVELS = {"quick": (120, 128), "long": (10_000, 2048)}  # number of cases, edges at most
BATCH = 8  # cases that a worker gets at a time
TIME_LIMIT = 120.0  # s of CPU time for one case; one that takes longer hangs
SAVE_EVERY = 30.0  # s
REFUSED = "ValueError"

# Reasons of NotConverged that the documentation describes, and those that no failure may have.
EXPLAINED = frozenset(
    {
        Reason.TOO_MANY_ITERATIONS,
        Reason.DIVERGED,
        Reason.OUT_OF_RANGE,
        Reason.SINGULAR,
        Reason.TOO_SHARP,
        Reason.OTHER_BRANCH,
        Reason.NO_START,
        Reason.TOO_MANY_STEPS,
        Reason.BREAKS_SYMMETRY,
        Reason.NOT_AT_REST,
        Reason.NO_MINIMUM,
        Reason.INACCURATE,
        Reason.UNFOLDED,
    }
)
NOT_EXPLAINED = frozenset(
    {
        Reason.CONVERGED,
        Reason.TURNED_BACK,
        Reason.CLOSED,
        Reason.INTERRUPTED,
        Reason.FOLD_NEAR_PI,
    }
)
_EXPLAINED_NAMES = {REFUSED, *(not_converged(reason.word) for reason in EXPLAINED)}


def stress(
    level: str = "quick",
    file: FilePath | None = None,
    *,
    seed: int = 0,
    count: int | None = None,
    workers: int | None = 1,
    progress: Callable[[str], object] | None = None,
) -> Summary:
    """Try to break the solvers.

    Parameters
    ----------
    level : "quick", under a minute, or "long", 10,000 cases.
    file : where the summary is written, now and then and at the end.
    seed : of the cases; those of a seed and level are always the same.
    count : of cases, if not the level's own.
    workers : processes, None: one a core; 1: this one. The summary is the same but for times.
    progress : called with a line after every case; None: it is shown on a terminal.

    Returns
    -------
    Summary
        Of the cases that were done, until Ctrl-C where it was pressed.

    Raises
    ------
    ValueError
        If there is no such level, for a seed below 0, or for a number of workers below 1.
    OSError
        If the file cannot be written.
    RuntimeError
        If workers cannot work.
    """
    if level not in LEVELS:
        raise ValueError(f"level must be one of {', '.join(LEVELS)}, got {level!r}")
    checks.count("seed", seed)
    number, most_edges = LEVELS[level]
    number = number if count is None else count
    width = processes(workers)
    summary = Summary(level, seed)
    show = _shown if progress is None else progress
    began = saved = time.monotonic()
    try:
        for case, found, seconds in _done(cases(number, seed, most_edges=most_edges), width):
            now = time.monotonic()
            summary.add(case, found, seconds)
            summary.seconds = now - began
            show(
                f"{summary.cases} of {number} cases, {summary.failures} failures, "
                f"{summary.unexplained} unexplained, {summary.seconds:.0f} s"
            )
            if file is not None and now - saved > SAVE_EVERY:
                summary.save(file)
                saved = now
    except KeyboardInterrupt:  # the summary so far is kept
        summary.interrupted = True
    if progress is None:
        _shown("")
    if file is not None:
        summary.save(file)
    return summary


_Done: TypeAlias = tuple[tuple[Failure, ...], float]  # what went wrong, and what it took [s]


@dataclass(frozen=True, eq=False)
class _Numbered:
    """A case by its place; no two are equal."""

    place: int
    case: Case


def _done(tried: Iterable[Case], width: int) -> Iterator[tuple[Case, tuple[Failure, ...], float]]:
    """Cases in their order, what went wrong with each, and what it took [s]."""
    if width == 1:
        for case in tried:
            ((found, seconds),) = _repeated((_Numbered(0, case),))
            yield case, found, seconds
        return
    things = [_Numbered(place, case) for place, case in enumerate(tried)]
    batches = [tuple(things[k : k + BATCH]) for k in range(0, len(things), BATCH)]
    ready: dict[int, _Done] = {}
    given = 0
    with started(width) as crew:
        for batch, results in Jobs(crew, _repeated, batches).done():
            for thing, result in zip(batch, results or map(_died, batch), strict=True):
                ready[thing.place] = result
            while given in ready:
                yield things[given].case, *ready.pop(given)
                given += 1


def _repeated(batch: tuple[_Numbered, ...]) -> list[_Done]:
    """Repeat a batch of cases; this is what a worker does."""
    _load_kernels()
    results = []
    for thing in batch:
        began = time.monotonic()
        found = repeat(thing.case)
        results.append((found, time.monotonic() - began))
    return results


def _died(thing: _Numbered) -> _Done:
    """The result of a case that has killed its worker several times."""
    text = "the process that worked on it died"
    return (Failure(thing.case, "worker died", text, explained=False, seconds=0.0),), 0.0


@cache
def _load_kernels() -> None:
    """Compile or load the kernels, so that no case waits for them."""
    scene = der.Scene(der.circle(), der.section(1.0, 1.0), n_edges=8, gamma_max=0.1)
    der.fold(scene)
    der.fold(replace(scene, control="angle"))
    der.fold(replace(scene, control="angle", unload=True, solver="relaxation"))
    der.solve_bvp(scene, tolerance=1e-6)


def _shown(line: str) -> None:
    if sys.stderr.isatty():
        print(f"\r\x1b[K{line}", end="", file=sys.stderr, flush=True)


def repeat(case: Case | Mapping[str, Any]) -> tuple[Failure, ...]:
    """Do one case, or its JSON, and say what went wrong.

    Raises
    ------
    ValueError
        If it is no case.
    """
    known = case if isinstance(case, Case) else case_from_json(case)
    began = time.monotonic()
    found: list[Fault] = []
    try:
        with _time_limit(TIME_LIMIT), warnings.catch_warnings():
            warnings.simplefilter("error")
            with np.errstate(divide="raise", over="raise", invalid="raise"):
                found.extend(RUN[known.kind](known.parameters))
    except Refused as refused:
        found.append((REFUSED, str(refused)))
    except der.NotConverged as failure:
        found.append((not_converged(failure.path.reason), str(failure)))
    except KeyboardInterrupt:
        raise
    except BaseException as wrong:  # any other exception is a failure to be reported
        found.append((f"unexpected {type(wrong).__name__}", str(wrong)))
    seconds = time.monotonic() - began
    return tuple(
        Failure(known, name, text, name in _EXPLAINED_NAMES, seconds) for name, text in found
    )


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeoutError after so many seconds of CPU time.

    In the main thread only, where signals arrive.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    rang: list[int] = []

    def ring(number: int, frame: FrameType | None) -> None:
        if not put_off(number, frame):
            rang.append(number)
            raise TimeoutError

    usual = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    except BaseException:
        if not rang:
            raise  # else another exception has replaced the TimeoutError
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, usual)
    if rang:
        raise TimeoutError(f"no answer within {seconds:g} s")
