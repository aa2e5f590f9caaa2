"""Points on a step of a boundary-value path: solutions that were asked for, folds and limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from der.bvp.collocation import Error, Solution
from der.bvp.step import Step, dot
from der.continuation.roots import least_rate, rate_of_cubic, root_of_rate

ASLANT = 0.4  # of a rate at the ends of an interval: by how much that of its cubic may be wrong
HALVED = 0.25  # of what it was wrong by: on a part of the interval
NARROW = 1e-6  # of a step: places that lie closer are one
EIGHTH = math.pi / 8.0


class Point(NamedTuple):
    """A point on the path, as it is handed out."""

    solution: Solution
    error: Error
    kind: str = ""  # "", "fold" or "limit"


@dataclass(frozen=True)
class Wanted:
    """What is looked for on a path, and where it stops."""

    gamma_max: float = math.pi
    until: Callable[[Solution], bool] | None = None  # end at a state at gamma = pi
    targets: tuple[float, ...] | None = None  # gammas to solve at; None: multiples of pi/8
    tolerance: float = 1e-8  # of gamma/pi, M and U, relative to their largest


class Mark(NamedTuple):
    """A state and its place within a step."""

    s: float
    at: Solution
    kind: str = ""


def located(wanted: Wanted, step: Step, end: Point) -> tuple[list[Point], bool]:
    """Points after the start up to the end of ``step``, and whether the path ends there."""
    folds = _folds(step)
    marks, ended = _at_targets(wanted, step, folds)
    if not ended:
        marks.append(Mark(step.length, step.end))
    last = marks[-1].s
    marks += [m for m in folds if m.s < last]
    line = sorted([Mark(0.0, step.start), *marks], key=lambda m: m.s)
    line = sorted([*line, *_limits(step, line)], key=lambda m: m.s)
    return [
        Point(m.at, end.error if m.at is step.end else step.system.error(m.at), m.kind)
        for m in line[1:]
    ], ended


def _folds(step: Step) -> list[Mark]:
    """Folds of gamma within a step, also a pair of them between tangents of equal sign."""
    ends = Mark(0.0, step.start), Mark(step.length, step.end)
    return [Mark(s, step.at(s), "fold") for s in _extrema(step, _of_gamma, *ends)]


def _limits(step: Step, line: list[Mark]) -> list[Mark]:
    """Limits of the moment between the marks of a line."""
    places = [s for a, b in pairwise(line) for s in _extrema(step, _of_moment, a, b)]
    return [Mark(s, step.at(s), "limit") for s in places]


def _of_gamma(at: Solution) -> tuple[float, float]:
    """A solution's gamma, and its rate along the tangent."""
    return at.gamma, at.tangent.gamma


def _of_moment(at: Solution) -> tuple[float, float]:
    """A solution's moment, and its rate along the tangent."""
    return at.moment, at.moment_rate


def _extrema(
    step: Step,
    value: Callable[[Solution], tuple[float, float]],
    a: Mark,
    b: Mark,
    off: float | None = None,
) -> Iterator[float]:
    """Places between two marks where a value turns back.

    Two of them that lie close together show at the marks only by the cubic through these. Where it
    is slowest is looked at, and the two halves again.

    Parameters
    ----------
    off : by how much the rate of the cubic may be wrong; None: not known.
    """
    (low, first), (high, last) = value(a.at), value(b.at)
    length = b.s - a.s
    first, last = (rate / _cosine(step, m.at) for rate, m in ((first, a), (last, b)))
    cubic = rate_of_cubic(high - low, length * first, length * last)
    if first * last < 0.0:
        turn = root_of_rate(*cubic)
        guess = None if turn is None else a.s + length * turn
        yield step.change(lambda at: value(at)[1], a[:2], b[:2], guess)[0]
    elif length > NARROW * step.length and (place := least_rate(*cubic)) is not None:
        expected = place[1] / length
        off = ASLANT * abs(first) if off is None else off
        if math.copysign(1.0, first) * expected < off:
            s = a.s + length * place[0]
            middle = Mark(s, step.at(s))
            found = value(middle.at)[1] / _cosine(step, middle.at)
            off = HALVED * abs(found - expected)
            yield from _extrema(step, value, a, middle, off)
            yield from _extrema(step, value, middle, b, off)


def _cosine(step: Step, at: Solution) -> float:
    """Cosine of the angle between the tangents at the start of a step and at a solution."""
    if at is step.start:
        return 1.0
    return step.cosine if at is step.end else dot(at.mesh, step.start.tangent, at.tangent)


def _at_targets(wanted: Wanted, step: Step, folds: list[Mark]) -> tuple[list[Mark], bool]:
    """States at the wanted gammas, in order, up to the end of the path if it lies in this step."""
    cuts = [Mark(0.0, step.start), *folds, Mark(step.length, step.end)]
    marks: list[Mark] = []
    for a, b in pairwise(cuts):
        low, high = a.at.gamma, b.at.gamma
        for gamma in sorted(set(_between_targets(wanted, low, high)), reverse=high < low):
            if gamma == low:
                continue
            s, at = (b.s, b.at) if gamma == high else step.at_parameter(gamma, a.s, b.s)
            marks.append(Mark(s, at))
            if abs(gamma) == wanted.gamma_max:  # also of a path that has turned back for good
                return marks, True
            if wanted.until is not None and gamma == math.pi and wanted.until(at):
                return marks, True
    return [m for m in marks if m.s < step.length], False


def _between_targets(wanted: Wanted, low: float, high: float) -> Iterator[float]:
    """Gammas to solve for between two values, the end of the path among them."""
    low, high = min(low, high), max(low, high)
    targets = wanted.targets
    if targets is None:
        first, last = math.floor(low / EIGHTH), math.ceil(high / EIGHTH)
        targets = tuple(k * EIGHTH for k in range(first, last + 1))
    for gamma in (*targets, math.pi, wanted.gamma_max, -wanted.gamma_max):
        if low <= gamma <= high:
            yield gamma
