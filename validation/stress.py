"""An attempt to break both solvers, and an account of what happened: `der stress`.

    summary = validation.stress.stress("quick")
    validation.stress.repeat(summary.failed[0].case)   # one of them again

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
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from types import FrameType
from typing import Any, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

import der
import der.path
from der import equilibrium as newton
from der import relaxation
from der.assembly import assemble
from der.checks import Array
from der.files import FilePath
from der.linking import link
from der.record import Path
from der.ring import circle
from der.scene import CONTACTS_UP_TO, Scene
from der.sections import Scale, section
from der.sector import sector
from der.shapes import Shapes
from der.snap import TO_AND_FRO
from der.unfinished import NotConverged, put_off
from validation import collocation
from validation.jobs import Jobs
from validation.random_rings import LOOSE
from validation.solving import solve
from validation.stress_cases import Case, case_from_json, cases, ring_of, scene_of, section_of
from validation.stress_checks import (
    Fault,
    asymmetry,
    denser,
    faults,
    outside_error_bars,
    too_uncertain,
    unlike,
    work_lost,
)
from validation.stress_inputs import PERHAPS, arguments, refusal
from validation.stress_summary import Failure, Summary
from validation.workers import processes
from validation.workers import workers as started

LEVELS = {"quick": (120, 128), "long": (10_000, 2048)}  # number of cases, edges at most
BATCH = 8  # cases that a worker gets at a time
TIME_LIMIT = 120.0  # s of CPU time, of one case: what takes longer hangs
SYMMETRIC = 1e-6  # a: a path that was followed on the full ring without leaving the symmetric one
RETURNED = 1e-6  # a: a ring that has come back
TIMES = 10.0  # an extrapolated value may be off by so many times its estimated error
LOOSEST = 1e-9  # tolerance beyond which states of two solves are not compared

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
        If there is no such level, or for a number of workers below 1.
    OSError
        If the file cannot be written.
    RuntimeError
        If workers cannot work.
    """
    if level not in LEVELS:
        raise ValueError(f"level must be one of {', '.join(LEVELS)}, got {level!r}")
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
    solve(scene, tolerance=1e-6)


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
                found.extend(_RUN[known.kind](known.parameters))
    except _Refused as refused:
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


class _Refused(ValueError):
    """What was asked for is refused by the statement, in a sentence."""


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


# --- One path and all that must hold of it ---------------------------------------------------


def _scene(parameters: Mapping[str, Any], **more: Any) -> Scene:
    """The scene, whose refusal is the statement's affair and not the solver's."""
    try:
        return scene_of(parameters, **more)
    except ValueError as wrong:
        raise _Refused(str(wrong)) from None


def _folded(scene: Scene) -> Path:
    """The path, finished or not."""
    try:
        return der.fold(scene)
    except NotConverged as failure:
        if failure.path.status != "not converged" or failure.path.message != str(failure):
            raise AssertionError("the path that is left does not say why it is") from None
        return failure.path


def _unfinished(path: Path) -> Iterator[Fault]:
    if path.status != "done":
        yield "NotConverged", path.message


def _path(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path, and every test that a single one can be put to."""
    scene = _scene(parameters, shapes=True)
    path = _folded(scene)
    yield from _unfinished(path)
    yield from _judged(scene, path)
    if scene.unload and path.status == "done" and not any(p.kind == "snap" for p in path.points):
        yield from _returned(scene, path)


def _judged(scene: Scene, path: Path) -> Iterator[Fault]:
    if not len(path):
        return
    yield from faults(scene, path)
    if path.shapes is not None:
        yield from _balance(scene, path, path.shapes)
        symmetric = scene.control == "arclength" or scene.sector == "auto"
        if symmetric and scene.tolerance <= LOOSEST and scene.ring.shape != "profile":
            off = asymmetry(scene, path.shapes)
            # at a branch point the ring is free to move along what branches off
            off[[point.position for point in path.branches]] = 0.0
            if (worst := float(off.max(initial=0.0))) > SYMMETRIC:
                yield "asymmetric", f"a state is {worst:.2g} a off its ring's symmetry"
    if scene.tolerance <= 1e-7:
        yield from _work(scene, path, der.fold)


def _work(scene: Scene, path: Path, solver: Callable[[Scene], Path]) -> Iterator[Fault]:
    """Energy is work; where the states are too few to tell, they are asked for again, densely."""
    lost = work_lost(path)
    if lost > LOOSE and path.status == "done":
        wants = {name: getattr(scene, name) for name in _WANTS} | {
            "save_at": denser(path, scene.gamma_max)
        }
        lost = work_lost(solver(Scene(scene.ring, scene.section, **wants)), asked=True)
    if lost > LOOSE and path.status == "done":
        yield "energy is not work", f"U and the integral of 4 M dgamma differ by {lost:.2g} of U"


_WANTS = (
    "n_edges",
    "sector",
    "stability",
    "control",
    "unload",
    "solver",
    "gamma_max",
    "until",
    "curvature",
    "stretch",
    "a_over_t",
    "tolerance",
)


def _returned(scene: Scene, path: Path, steps: float = RETURNED) -> Iterator[Fault]:
    """After a loop without a snap the ring is where it was."""
    if path.shapes is None or scene.tolerance > LOOSEST or path.gamma[-1] != path.gamma[0]:
        return
    off = float(np.abs(path.shapes.x[-1] - path.shapes.x[0]).max())
    limit = 1e-3 if scene.solver == "relaxation" else steps
    if off > limit:
        yield "no return", f"the ring comes back {off:.2g} a away from where it was"


def _balance(scene: Scene, path: Path, shapes: Shapes) -> Iterator[Fault]:
    """Every state, whatever sector it was found on, is an equilibrium of the full ring.

    Its frames are taken from the record; the internal forces, which are not in it, are fitted. So
    residual, energy and moment are computed anew, and Tw + Wr.
    """
    piece = sector(
        scene.ring,
        scene.section,
        scene.n_edges,
        name="full",
        measure=scene.curvature,
        stretching=scene.stretching,
    )
    raw = path.raw or {}
    body = piece.body
    # arc lengths are rounded, and so are cells, which are their differences
    rounding = 1e-15 * scene.ring.length * float(body.stiffness.max() / body.cell.min() ** 2)
    columns = [np.asarray(raw.get(name, getattr(path, name))) for name in _COLUMNS]
    scales = [max(float(np.abs(column).max(initial=0.0)), 1e-3) for column in columns]
    tolerance = max(scene.tolerance, 1e-8 if scene.solver == "relaxation" else 0.0)
    if scene.stretching and tolerance > LOOSEST:  # a gap, all in one edge, would be stretch
        return
    links = scene.n_edges <= min(256, CONTACTS_UP_TO)
    worst = dict.fromkeys(("residual", "energy", "moment", "link"), 0.0)
    for k, (gamma, moment, energy) in enumerate(zip(*columns, strict=True)):
        quat = _quaternions(shapes.frames[k])
        edge = shapes.x[k] - np.roll(shapes.x[k], 1, axis=0)
        length = np.sum(edge * shapes.frames[k, :, 2], axis=1)
        stretch = length / piece.body.length - 1.0 if scene.stretching else np.zeros(len(quat))
        residual, noise, found_energy, found_moment = _residual(piece, quat, stretch, float(gamma))
        allowed = 20.0 * max(tolerance, 10.0 * noise) + 1e-14 * scene.stretching + rounding
        worst["residual"] = max(worst["residual"], residual / allowed)
        off = abs(found_energy - energy) / (1e-8 * scales[2] + allowed)
        worst["energy"] = max(worst["energy"], off)
        off = abs(found_moment - moment) / (1e-7 * scales[1] + scene.n_edges * allowed)
        worst["moment"] = max(worst["moment"], off)
        flat = gamma != 0.0 and float(np.ptp(shapes.x[k, :, 0])) < 1e-3
        if links and not flat and k % 4 == 0:
            worst["link"] = max(worst["link"], link(quat, length)[1] / (1e-8 + 100.0 * tolerance))
    for name, size in worst.items():
        if not size <= 1.0:
            yield f"{name} of the full ring", f"{size:.3g} times what rounding allows"


_COLUMNS = ("gamma", "moment", "energy")


def _quaternions(frames: Array) -> Array:
    """Quaternions (N, 4), scalar first, of frames (N, 3, 3) whose rows are d1, d2, d3."""
    found = Rotation.from_matrix(frames.swapaxes(1, 2)).as_quat()
    return np.ascontiguousarray(np.roll(found, 1, axis=1))


def _residual(
    piece: Any, quat: Array, stretch: Array, gamma: float
) -> tuple[float, float, float, float]:
    """Residual, its rounding error, energy and M of a state of the full ring."""
    held = piece.held
    force = np.zeros(len(held.target))
    system = assemble(piece.body, held, quat, stretch, force, gamma)
    free = held.free.reshape(-1)
    gradient = system.grad.reshape(-1)[free]
    border = system.border.reshape(-1, len(force))[free]
    force = -np.linalg.lstsq(border, gradient, rcond=None)[0]
    system = assemble(piece.body, held, quat, stretch, force, gamma)
    residual = max(
        float(np.abs(system.grad.reshape(-1)[free]).max()), float(np.abs(system.gap).max())
    )
    return residual, system.noise, system.energy, piece.moment(system.load_grad)


# --- The other kinds -------------------------------------------------------------------------


def _bvp(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path of the boundary-value problem."""
    scene = _scene(parameters, shapes=True)
    tolerance = parameters["bvp"]["tolerance"]

    def solver(scene: Scene) -> Path:
        return solve(scene, tolerance=tolerance)

    try:
        path = solver(scene)
    except NotConverged as failure:
        path = failure.path
    yield from _unfinished(path)
    yield from (fault for fault in faults(scene, path) if tolerance < 1e-5 or fault[0] != "start")
    yield from too_uncertain(path, tolerance)
    if tolerance <= 1e-5 and len(path):
        yield from _work(scene, path, solver)


def _compare(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """The rod's error bars hold the values of the boundary-value problem.

    Next to a boundary of folding modes a coarse mesh may lie on its other side, where the path is
    another: finer ones are tried before the two are said to differ.
    """
    scene = _scene(parameters)
    reference = solve(scene, tolerance=1e-9)
    found: list[Fault] = []
    for finer in (1, 2, 4):
        path = der.fold(replace(scene, n_edges=finer * scene.n_edges))
        found = list(outside_error_bars(path, reference, TIMES))
        if len(path.folds) == len(reference.folds):
            break
    yield from found


def _symmetry(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path on the sector is that on the full ring."""
    found = [_folded(_scene(parameters, sector=name)) for name in ("auto", "full")]
    for path in found:
        yield from _unfinished(path)
    if all(path.status == "done" for path in found):
        yield from unlike(found[0], found[1], 1e-7)


def _steps(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A path does not depend on the steps in which it is followed."""
    scene = _scene(parameters)
    usual = _folded(scene)
    with _stepping(**parameters["steps"]):
        other = _folded(scene)
    yield from _unfinished(other)
    if usual.status == other.status == "done":
        yield from unlike(usual, other, 1e-7)


@contextmanager
def _stepping(first: float, longest: float) -> Iterator[None]:
    """Other lengths of steps along a path than the follower's own."""
    usual = der.path.FIRST_STEP, der.path.LARGEST_STEP
    der.path.FIRST_STEP, der.path.LARGEST_STEP = first, longest
    try:
        yield
    finally:
        der.path.FIRST_STEP, der.path.LARGEST_STEP = usual


def _again(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """The same scene gives the same record to the last bit."""
    first, second = (_without_time(_folded(_scene(parameters))) for _ in range(2))
    if first != second:
        yield "not repeatable", "two runs of one scene differ"


def _threads(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """Rings folded at once in threads come out as they do one after the other."""
    scenes = [_scene(one) for one in parameters["rings"]]
    alone = [_without_time(_folded(scene)) for scene in scenes]
    with ThreadPoolExecutor(len(scenes)) as pool:
        together = [_without_time(path) for path in pool.map(_folded, scenes)]
    if alone != together:
        yield "threads", "a ring folded beside others differs from the same folded alone"


def _without_time(path: Path) -> str:
    return re.sub(r'"solve_s": [^,}]*', '"solve_s": 0', path.to_json())


def _points(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A ring through noisy points: refused in a sentence, or folded like any other."""
    try:
        ring = ring_of(parameters["ring"])
    except ValueError as wrong:
        raise _Refused(str(wrong)) from None
    try:
        scene = Scene(ring, section_of(parameters), shapes=True, **parameters["wants"])
    except ValueError as wrong:
        raise _Refused(str(wrong)) from None
    path = _folded(scene)
    yield from _unfinished(path)
    yield from _judged(scene, path)


def _scale(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """Units grow with the size as GJ/a, of a^3, and with E; h and t may be exchanged."""
    given = dict(parameters)
    times = given.pop("times")
    one = Scale.of(**given)
    larger = Scale.of(**given | {name: times * given[name] for name in ("h", "t", "a")})
    stiffer = Scale.of(**given | {"young_modulus": times * given["young_modulus"]})
    turned = Scale.of(**given | {"h": given["t"], "t": given["h"]})
    powers = {"moment": 3, "energy": 3, "length": 1, "force": 2}
    for name, power in powers.items():
        unit = getattr(one, name)
        for what, other, factor in (
            ("size", larger, times**power),
            ("E", stiffer, 1.0 if name == "length" else times),
            ("turning h and t", turned, 1.0),
        ):
            ratio = getattr(other, name) / unit / factor
            if not abs(ratio - 1.0) < 1e-12:
                yield "units", f"the unit of {name} changes with {what} by {ratio} of what it must"


def _input(parameters: Mapping[str, Any]) -> Iterator[Fault]:
    """A value that an argument must not take is refused in a sentence that names the argument."""
    known = arguments()
    argument = known[parameters["argument"] % len(known)]
    names = list(argument.refused if len(argument.refused) < 9 else {**argument.refused, **PERHAPS})
    if argument.where not in _TAKES_NUMBERS:
        names = list(argument.refused)
    if not names:
        return
    wrong = refusal(argument, names[parameters["value"] % len(names)])
    if wrong is not None:
        yield "input", wrong


_TAKES_NUMBERS = ("circle", "section", "rectangular_section", "Scale", "Scale.of", "Section")

_Runner = Callable[[Mapping[str, Any]], Iterator[Fault]]
_RUN: dict[str, _Runner] = {
    "path": _path,
    "beyond": _path,
    "close folds": _path,
    "natural curvature": _path,
    "error bars": _path,
    "angle": _path,
    "moment": _path,
    "relaxation": _path,
    "bvp": _bvp,
    "compare": _compare,
    "symmetry": _symmetry,
    "steps": _steps,
    "again": _again,
    "threads": _threads,
    "points": _points,
    "extreme": _path,
    "scale": _scale,
    "input": _input,
}
