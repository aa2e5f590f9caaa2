"""Following a path of solutions through its folds, by pseudo-arclength (Keller 1977).

The norm is the mean square of rotations along the rod, plus gamma's. Each step is a cubic in s, the
projection on the tangent at its start, whose values are corrected to solutions; folds, limits of
the moment and the states that were asked for are roots in s of one step. The mesh follows the
solution, and its number of intervals the estimated error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from der.bvp.collocation import Collocation, Direction, Error, Failure, Solution
from der.bvp.meshes import Mesh, fitted
from der.continuation.roots import find_root, least_rate, rate_of_cubic, root_of_rate

FIRST_STEP = 0.05
FIRST_TURN, LEAST_TURN = 0.02, 2e-4  # rad
LARGEST_STEP = 0.6
SMALLEST_STEP = 1e-8
ANGLE = 0.15  # rad, aimed at between tangents of neighbouring states
SHARPEST = 0.6  # rad, a step that turns more is repeated shorter
STRAIGHT = 0.01  # bulge of a step that is believed although its ends are oriented unequally
MOST_STEPS = 2000
MOST_WORK = 200_000  # intervals of all steps together: a ring that winds up needs ever more of them
FEWEST_INTERVALS, MOST_INTERVALS = 3, 4000
REFIT = 16  # steps after which the mesh is fitted again, unless its error asks for it before
IN_VAIN = 4.0  # times the intervals, which at order 8 leave 2e-5 of an error: where they leave
REMAINS = 0.5  # half of it or more, what is left is rounding
SAFETY = 0.25  # of the tolerance: the error aimed at
NEGLIGIBLE = 1e-3  # of the tolerance: square of a step's last increment, about the error left
ASLANT = 0.4  # of a rate at the ends of an interval: by how much that of its cubic may be wrong
HALVED = 0.25  # of what it was wrong by: on a part of the interval
NARROW = 1e-6  # of a step: places that lie closer are one
EIGHTH = math.pi / 8.0


class Stuck(RuntimeError):
    """A path that cannot go on; everything found so far has been handed out before."""


@dataclass
class Tally:
    """What the solve has cost so far."""

    newton_iterations: int = 0
    steps: int = 0
    work: int = 0  # intervals of all steps, those to be repeated included


class Visit(NamedTuple):
    """A state on the path, as it is handed out."""

    at: Solution
    error: Error
    kind: str = ""  # "", "fold" or "limit"


@dataclass(frozen=True)
class Wanted:
    """What the follower has to look for, and where it stops."""

    gamma_max: float = math.pi
    until: Callable[[Solution], bool] | None = None  # end at a state at gamma = pi
    targets: tuple[float, ...] | None = None  # gammas to solve at; None: multiples of pi/8
    tolerance: float = 1e-8  # of gamma/pi, M and U, relative to their largest


class Scales:
    """The largest |M| and U handed out so far, at least those of a first small turn."""

    def __init__(self, start: Solution, turn: float = FIRST_TURN) -> None:
        self.moment = turn * abs(start.slope)
        self.energy = 2.0 * turn**2 * abs(start.slope)

    def largest(self, visits: Sequence[Visit]) -> float:
        """The largest error of states not yet handed out, relative.

        What is not handed out is not in the record, and no measure of what is: a solution on too
        coarse a mesh may have any energy, and one beyond the end a larger than all before it.
        """
        moment, energy = self._with(visits)
        return max(
            max(v.error.gamma / math.pi, v.error.moment / moment, v.error.energy / energy)
            for v in visits
        )

    def take(self, visits: Sequence[Visit]) -> None:
        """Take note of states that are handed out."""
        self.moment, self.energy = self._with(visits)

    def _with(self, visits: Sequence[Visit]) -> tuple[float, float]:
        moment = max(self.moment, *(abs(visit.at.moment) for visit in visits))
        return moment, max(self.energy, *(abs(visit.at.energy) for visit in visits))


@dataclass(frozen=True, eq=False)
class Step:
    """The curve between two solutions on one mesh, s in [0, length]."""

    system: Collocation
    start: Solution
    end: Solution
    length: float
    tally: Tally
    jump: Direction = field(init=False)
    facing: float = field(init=False)  # cosine of the angle between the tangents at both ends
    found: dict[float, Solution] = field(init=False)  # by s

    def __post_init__(self) -> None:
        a, b = self.start, self.end
        jump = Direction(b.frames - a.frames, b.p - a.p, b.gamma - a.gamma)
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "facing", dot(a.mesh, a.tangent, b.tangent))
        object.__setattr__(self, "found", {0.0: a, self.length: b})

    def _weights(self, s: float) -> tuple[float, float, float]:
        """Of the tangent at the start, the jump and the tangent at the end, in the cubic."""
        u = s / self.length
        h10 = self.length * u * (1.0 - u) ** 2
        h01 = u * u * (3.0 - 2.0 * u)
        h11 = self.length * u * u * (u - 1.0) / self.facing  # s is measured at the start
        return h10, h01, h11

    def gamma(self, s: float) -> float:
        """The cubic's gamma."""
        h10, h01, h11 = self._weights(s)
        bent = h10 * self.start.tangent.gamma + h11 * self.end.tangent.gamma
        return self.start.gamma + h01 * self.jump.gamma + bent

    def guess(self, s: float) -> Direction:
        """The cubic's value."""
        h10, h01, h11 = self._weights(s)
        a, j, b = self.start.tangent, self.jump, self.end.tangent
        return Direction(
            self.start.frames + h10 * a.frames + h01 * j.frames + h11 * b.frames,
            self.start.p + h10 * a.p + h01 * j.p + h11 * b.p,
            self.start.gamma + h10 * a.gamma + h01 * j.gamma + h11 * b.gamma,
        )

    @property
    def angle(self) -> float:
        """Angle between the tangents at both ends [rad]."""
        return math.acos(min(1.0, max(-1.0, self.facing)))

    @property
    def bulge(self) -> float:
        """How far the end lies beside the tangent at the start, over the length."""
        square = dot(self.start.mesh, self.jump, self.jump)
        return float(max(square / self.length**2 - 1.0, 0.0) ** 0.5)

    def at(self, s: float) -> Solution:
        """The solution at ``s``."""
        if s not in self.found:
            self.found[s] = self._solved(self.guess(s), by_gamma=False)
        return self.found[s]

    def cosine(self, at: Solution) -> float:
        """Of the angle between the tangents at the start and at a solution."""
        if at is self.start:
            return 1.0
        return self.facing if at is self.end else dot(at.mesh, self.start.tangent, at.tangent)

    def at_gamma(self, gamma: float, low: float, high: float) -> tuple[float, Solution]:
        """The solution at ``gamma`` between s = low and high, where gamma is monotonic."""
        if (self.gamma(low) - gamma) * (self.gamma(high) - gamma) < 0.0:
            guess = self.guess(find_root(lambda s: self.gamma(s) - gamma, low, high))
            try:
                found = self._solved(guess._replace(gamma=gamma), by_gamma=True)
            except Stuck:
                found = None
            if found is not None and self._near(found, guess):
                s = along(self.start, found)
                return s, self.found.setdefault(s, found)
        # close to a fold: gamma is a bad coordinate there, s is not
        s = find_root(lambda t: self.at(t).gamma - gamma, low, high)
        return s, self.at(s)._replace(gamma=gamma)

    def _near(self, found: Solution, there: Direction) -> bool:
        """Whether a solution found at given gamma lies where the cubic expects it."""
        away = Direction(found.frames - there.frames, found.p - there.p, 0.0)
        return dot(self.start.mesh, away, away) < (0.1 * self.length) ** 2

    def _solved(self, guess: Direction, *, by_gamma: bool) -> Solution:
        found = self.system.solved(self.start.mesh, guess, self.start.tangent, by_gamma=by_gamma)
        self.tally.newton_iterations += found.iterations
        if isinstance(found, Failure):
            raise Stuck(f"no solution within a step, at gamma = {guess.gamma:.6f}: {found.reason}")
        return found


def dot(mesh: Mesh, a: Direction, b: Direction) -> float:
    """Mean over the rod of the product of rotations, plus that of gammas."""
    return float(np.vdot(mesh.weights * a.frames, b.frames)) + a.gamma * b.gamma


def along(start: Solution, there: Solution | Direction) -> float:
    """Distance of a state on the same mesh along the tangent at the start."""
    away = Direction(there.frames - start.frames, there.p - start.p, there.gamma - start.gamma)
    return dot(start.mesh, start.tangent, away)


def follow(system: Collocation, wanted: Wanted, tally: Tally) -> Iterator[Visit]:
    """Hand out the states of the path from the flat ring on, special points in their places.

    Raises
    ------
    Stuck
        Where the path cannot be continued, after all that was found has been handed out.
    """
    here, error, n = _flat(system, wanted)
    tally.newton_iterations += here.iterations
    scales = Scales(here, LEAST_TURN)  # a stiff ring's moment is largest long before FIRST_TURN
    yield Visit(here, error)
    last: Step | None = None  # on the present mesh
    length, age = FIRST_STEP, 0
    first: tuple[int, float] | None = None  # intervals and error that did not do for this step
    while True:
        if tally.steps >= MOST_STEPS or tally.work >= MOST_WORK:
            raise Stuck(f"the path has not ended after {tally.steps} steps")
        tally.work += len(here.mesh.h)
        step = _advance(system, tally, here, last, length, wanted.tolerance)
        error = system.error(step.end)
        size = scales.largest([Visit(step.end, error)])
        if size <= wanted.tolerance:
            try:
                found, ended = _special_points(system, wanted, step, error)
            except Stuck:
                # both ends are solutions, but not of one smooth curve: look again from closer
                if step.length < 4.0 * SMALLEST_STEP:
                    raise
                length = 0.25 * step.length
                continue
            # of a path that ends in its first step, errors are relative to what that step takes
            size = scales.largest(found if tally.steps else [*found, Visit(step.end, error)])
        if size > wanted.tolerance:
            n_here = len(here.mesh.h)
            if first is None or not math.isfinite(first[1]):
                first = n_here, size
            _check_refinable(system, first, (n_here, size), here.gamma)
            # at least one more than asked for last: a mesh rounds to what its joints allow
            n = min(max(n + 1, _refined(n_here, size, wanted.tolerance)), _most(system))
            here = _refitted(system, tally, here, step.end, n)
            last, length, age = None, step.length, 0
            continue
        tally.steps += 1
        scales.take(found)
        yield from found
        if ended:
            return
        ease = math.sqrt(ANGLE / max(step.angle, 1e-3))
        if step.end.iterations > 4:
            ease = min(ease, 0.7)
        length = min(step.length * min(max(ease, 0.5), 2.0), LARGEST_STEP)
        here, last, age, first = step.end, step, age + 1, None
        if age >= REFIT:
            n = _refined(len(here.mesh.h), size, wanted.tolerance)
            here, last, age = _refitted(system, tally, here, here, n), None, 0


def _flat(system: Collocation, wanted: Wanted) -> tuple[Solution, Error, int]:
    """The flat ring on a mesh fine enough, its error, and about how many intervals that has."""
    n = max(FEWEST_INTERVALS, len(system.sector.joints) - 1)
    first: tuple[int, float] | None = None
    while True:
        found = system.flat(n)
        if isinstance(found, Failure):
            raise Stuck(f"the flat ring is no solution: {found.reason}")
        error = system.error(found)
        size = Scales(found).largest([Visit(found, error)])
        if size <= wanted.tolerance:
            return found, error, n
        if first is None or not math.isfinite(first[1]):
            first = n, size
        _check_refinable(system, first, (n, size), 0.0)
        n = min(2 * n, _most(system))


def _check_refinable(
    system: Collocation, first: tuple[int, float], last: tuple[int, float], gamma: float
) -> None:
    """Give up where more intervals are of no use: by intervals and errors of first and last try."""
    n, size = last
    if n >= IN_VAIN * first[0] and size > REMAINS * first[1]:
        raise Stuck(
            f"rounding leaves an error of {size:.2g} on {n} intervals, as on fewer,"
            f" at gamma = {gamma:.6f}"
        )
    if n >= _most(system):
        raise Stuck(f"an error of {size:.2g} is left on {n} intervals at gamma = {gamma:.6f}")


def _most(system: Collocation) -> int:
    """Intervals that a mesh may have."""
    return max(MOST_INTERVALS, 4 * len(system.sector.joints))


def _refined(n: int, size: float, tolerance: float) -> int:
    """Intervals that bring an error of order h^8 to the one aimed at."""
    if not math.isfinite(size):
        factor = 1.5
    else:
        factor = (max(size, 1e-300) / (SAFETY * tolerance)) ** 0.125
    return max(math.ceil(n * min(max(factor, 0.8), 1.6)), FEWEST_INTERVALS)


def _refitted(system: Collocation, tally: Tally, here: Solution, fit: Solution, n: int) -> Solution:
    """``here`` on a mesh of about ``n`` intervals fitted to ``fit``, or as it is if that fails."""
    mesh = fitted(fit.mesh, fit.nodes[:-1], fit.frames, n)
    found = system.on(mesh, here)
    tally.newton_iterations += found.iterations
    if isinstance(found, Failure):
        raise Stuck(f"no solution on {n} intervals at gamma = {here.gamma:.6f}: {found.reason}")
    return found


def _advance(
    system: Collocation,
    tally: Tally,
    start: Solution,
    last: Step | None,
    length: float,
    tolerance: float,
) -> Step:
    """One accepted step of at most ``length``, shortened until Newton's method follows.

    What Newton's method leaves is the square of the last increment, times 13 at most (measured);
    the tangent is that before it.
    """
    close = math.sqrt(NEGLIGIBLE * tolerance)
    reason = ""
    while length > SMALLEST_STEP:
        guess = _predicted(start, last, length)
        end = system.solved(start.mesh, guess, start.tangent, iterations=7, tolerance=close)
        tally.newton_iterations += end.iterations
        if isinstance(end, Failure):
            reason = end.reason
        else:
            step = Step(system, start, end, length, tally)
            if not step.angle < SHARPEST:
                reason = "the path turns too sharply"
            elif start.orientation == end.orientation or step.bulge < STRAIGHT:
                return step
            else:
                reason = "the path changes its orientation"
        length *= 0.5
    raise Stuck(f"no step forward from gamma = {start.gamma:.8f}: {reason}")


def _predicted(start: Solution, last: Step | None, length: float) -> Direction:
    """A guess at distance ``length`` along the tangent, from the curve of the step before."""
    t = start.tangent
    if last is None:
        guess, left = Direction(start.frames, start.p, start.gamma), length
    else:
        guess = last.guess(last.length + length * last.facing)
        left = length - along(start, guess)  # of the distance, which the curve does not know
    return Direction(
        guess.frames + left * t.frames, guess.p + left * t.p, guess.gamma + left * t.gamma
    )


# --- What is special on a step ---------------------------------------------------------------


class Mark(NamedTuple):
    """A state and its place within a step."""

    s: float
    at: Solution
    kind: str


def _special_points(
    system: Collocation, wanted: Wanted, step: Step, end_error: Error
) -> tuple[list[Visit], bool]:
    """Visits after the start up to the end of ``step``, and whether the path ends there."""
    folds = _folds(step)
    marks, ended = _at_targets(wanted, step, folds)
    if not ended:
        marks.append(Mark(step.length, step.end, ""))
    last = marks[-1].s
    marks += [m for m in folds if m.s < last]
    line = sorted([Mark(0.0, step.start, ""), *marks], key=lambda m: m.s)
    line = sorted([*line, *_limits(step, line)], key=lambda m: m.s)
    visits = []
    for m in line[1:]:
        error = end_error if m.at is step.end else system.error(m.at)
        visits.append(Visit(m.at, error, m.kind))
    return visits, ended


def _folds(step: Step) -> list[Mark]:
    """Folds of gamma within a step, also a pair of them between tangents of equal sign."""
    ends = Mark(0.0, step.start, ""), Mark(step.length, step.end, "")
    return [Mark(s, step.at(s), "fold") for s in _turns(step, _of_gamma, *ends)]


def _limits(step: Step, line: list[Mark]) -> list[Mark]:
    """Limits of the moment between the marks of a line."""
    places = [s for a, b in pairwise(line) for s in _turns(step, _of_moment, a, b)]
    return [Mark(s, step.at(s), "limit") for s in places]


def _of_gamma(at: Solution) -> tuple[float, float]:
    """A solution's gamma, and its rate along the tangent."""
    return at.gamma, at.tangent.gamma


def _of_moment(at: Solution) -> tuple[float, float]:
    """A solution's moment, and its rate along the tangent."""
    return at.moment, at.moment_rate


def _turns(
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
    first, last = first / step.cosine(a.at), last / step.cosine(b.at)
    cubic = rate_of_cubic(high - low, length * first, length * last)
    if first * last < 0.0:
        turn = root_of_rate(*cubic)
        guess = None if turn is None else a.s + length * turn
        yield find_root(lambda s: value(step.at(s))[1], a.s, b.s, guess=guess)
    elif length > NARROW * step.length and (place := least_rate(*cubic)) is not None:
        expected = place[1] / length
        off = ASLANT * abs(first) if off is None else off
        if math.copysign(1.0, first) * expected < off:
            s = a.s + length * place[0]
            middle = Mark(s, step.at(s), "")
            found = value(middle.at)[1] / step.cosine(middle.at)
            off = HALVED * abs(found - expected)
            yield from _turns(step, value, a, middle, off)
            yield from _turns(step, value, middle, b, off)


def _at_targets(wanted: Wanted, step: Step, folds: list[Mark]) -> tuple[list[Mark], bool]:
    """States at the wanted gammas, in order, up to the end of the path if it lies in this step."""
    cuts = [Mark(0.0, step.start, ""), *folds, Mark(step.length, step.end, "")]
    marks: list[Mark] = []
    for a, b in pairwise(cuts):
        low, high = a.at.gamma, b.at.gamma
        for gamma in sorted(set(_between_targets(wanted, low, high)), reverse=high < low):
            if gamma == low:
                continue
            s, at = (b.s, b.at) if gamma == high else step.at_gamma(gamma, a.s, b.s)
            marks.append(Mark(s, at, ""))
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
