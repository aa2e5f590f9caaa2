"""An attempt to break both solvers, and an account of what happened: `der stress`.

    summary = validation.stress.run.stress("quick")
    validation.stress.run.repeat(summary.failed[0].case)   # one of them again

A failure that says what it is in a sentence that the documentation knows is explained: a ValueError
about an argument, a `NotConverged`. Anything else is not, whatever the scene: another exception, no
answer within the time limit, a warning, a number that is not finite, a record that contradicts
itself, a residual above the tolerance, energy that is not work.
"""

from __future__ import annotations

import re
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
from der.analysis.snap import TO_AND_FRO
from der.bvp import collocation
from der.bvp.solve import solve_bvp
from der.diagram.jobs import Jobs
from der.diagram.workers import processes
from der.diagram.workers import workers as started
from der.errors import NotConverged
from der.geometry.ring import circle
from der.geometry.section import section
from der.rod import equilibrium as newton
from der.rod import relaxation
from der.scene import Scene
from der.utils import checks
from der.utils.files import FilePath
from der.utils.interrupts import put_off
from validation.stress.cases import Case, case_from_json, cases
from validation.stress.checks import Fault
from validation.stress.kinds import RUN, Refused
from validation.stress.summary import Failure, Summary

LEVELS = {"quick": (120, 128), "long": (10_000, 2048)}  # number of cases, edges at most
BATCH = 8  # cases that a worker gets at a time
TIME_LIMIT = 120.0  # s of CPU time, of one case: what takes longer hangs

_NUMBER = re.compile(r"-?\b\d[\d.]*(e[-+]?\d+)?")
_REASON = "|".join(  # with # for every number, as everywhere below
    re.escape(_NUMBER.sub("#", words))
    for advice in (newton.ADVICE, relaxation.ADVICE, collocation.ADVICE)
    for words in advice.values()
)
# Sentences of NotConverged that the documentation explains, from the first word to the last.
EXPLAINED = re.compile(
    rf"no step forward from gamma = #: ((vertex # )?({_REASON})|the path turns too sharply"
    r"|the path changes its orientation)"
    r"|the (path|march) has not ended after # steps|the march would not end within # steps"
    rf"|the flat ring is no (equilibrium|solution): ({_REASON})"
    r"|the ring loses stability at gamma = # by a mode \([a-z ]+\) that breaks the symmetry of its"
    r" [a-z]+; the sector 'full' follows it"
    r"|the ring lands at gamma = # in a state that is unstable to modes \([a-z ]+\) that break the"
    r" symmetry of its [a-z]+; the sector 'full' follows it"
    rf"|the snap at gamma = # came to rest in no minimum: (index (#|None)|{TO_AND_FRO}|{_REASON})"
    rf"|(the snap at gamma = # came to no rest:|at gamma = # the ring) (vertex # )?({_REASON})"
    rf"|gamma = # is no equilibrium: ({_REASON})"
    r"|the state at gamma = # is no minimum: it cannot be marched on"
    rf"|no equilibrium within a step, at gamma = # \(s = # of #\): ({_REASON})"
    rf"|no solution within a step, at gamma = #: ({_REASON})"
    r"|an error of # is left on # intervals at gamma = #"
    r"|rounding leaves an error of # on # intervals, as on fewer, at gamma = #"
    rf"|no solution on # intervals at gamma = #: ({_REASON})"
)


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
        Of what was done until Ctrl-C, where it was pressed.

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
    summary = Summary(level, seed)
    show = _shown if progress is None else progress
    tried = cases(number, seed, most_edges=most_edges)
    started = saved = time.monotonic()
    try:
        for case, found, seconds in _done(tried, processes(workers)):
            now = time.monotonic()
            summary.add(case, found, seconds)
            summary.seconds = now - started
            show(
                f"{summary.cases} of {number} cases, {summary.failures} failures, "
                f"{summary.unexplained} unexplained, {summary.seconds:.0f} s"
            )
            if file is not None and now - saved > 30.0:
                summary.save(file)
                saved = now
    except KeyboardInterrupt:  # what there is is kept
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
    told = 0
    with started(width) as crew:
        for batch, results in Jobs(crew, _repeated, batches).done():
            for thing, result in zip(batch, results or map(_died, batch), strict=True):
                ready[thing.place] = result
            while told in ready:
                yield things[told].case, *ready.pop(told)
                told += 1


def _repeated(batch: tuple[_Numbered, ...]) -> list[_Done]:
    """What a worker does."""
    _load_kernels()
    results = []
    for thing in batch:
        begun = time.monotonic()
        found = repeat(thing.case)
        results.append((found, time.monotonic() - begun))
    return results


def _died(thing: _Numbered) -> _Done:
    """Of a case that has ended its worker, time and again."""
    text = "the process that worked on it died [unexpected]"
    failure = Failure(thing.case, _reason("Died", text), text, explained=False, seconds=0.0)
    return (failure,), 0.0


@cache
def _load_kernels() -> None:
    """Compile or load what is timed, so that no case waits for it."""
    scene = Scene(circle(), section(1.0, 1.0), n_edges=8, gamma_max=0.1)
    for wants in ({}, {"control": "angle", "unload": True, "solver": "relaxation"}):
        der.fold(replace(scene, **wants))  # type: ignore[arg-type]
    der.fold(replace(scene, control="angle"))
    solve_bvp(scene, tolerance=1e-6)


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
    started = time.monotonic()
    found: list[Fault] = []
    try:
        with _time_limit(TIME_LIMIT), warnings.catch_warnings():
            warnings.simplefilter("error")
            with np.errstate(divide="raise", over="raise", invalid="raise"):
                found.extend(RUN[known.kind](known.parameters))
    except Refused as refused:
        found.append(("ValueError", str(refused)))
    except NotConverged as failure:
        found.append(("NotConverged", str(failure)))
    except KeyboardInterrupt:
        raise
    except BaseException as wrong:  # whatever it is, it is what is looked for
        found.append((type(wrong).__name__, f"{wrong} [unexpected]"))
    seconds = time.monotonic() - started
    return tuple(
        Failure(known, _reason(name, text), text, _explained(name, text), seconds)
        for name, text in found
    )


def _reason(name: str, text: str) -> str:
    """A reason by which failures are counted: without the numbers and values of one case."""
    plain = re.sub(r"\(s = .*?\)", "(s)", _NUMBER.sub("#", text))
    plain = re.sub(r"(, )?got .*|arc length #.*", "", plain)
    return f"{name}: {plain}"[:160]


def _explained(name: str, text: str) -> bool:
    if name == "ValueError":
        return "[unexpected]" not in text
    return name == "NotConverged" and EXPLAINED.fullmatch(_NUMBER.sub("#", text)) is not None


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """A TimeoutError after so many seconds of the processor, whatever else the machine does.

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
            raise  # else it is what a clause in between has made of the alarm
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, usual)
    if rang:
        raise TimeoutError(f"no answer within {seconds:g} s")
