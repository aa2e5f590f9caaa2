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

from validation.collocation import Collocation, Direction, Error, Failure, Solution
from validation.meshes import Mesh, fitted

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
REFIT = 4  # steps after which the mesh is fitted again
IN_VAIN = 4.0  # times the intervals, which at order 8 leave 2e-5 of an error: where they leave
REMAINS = 0.5  # half of it or more, what is left is rounding
SAFETY = 0.25  # of the tolerance: the error aimed at
ROOT = 1e-10  # of s: gamma at a fold, M at a limit are quadratic in it
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
    rate: float = field(init=False)  # of the tangent at the end, for s measured at the start

    def __post_init__(self) -> None:
        a, b = self.start, self.end
        jump = Direction(b.frames - a.frames, b.p - a.p, b.gamma - a.gamma)
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "rate", 1.0 / dot(a.mesh, a.tangent, b.tangent))

    def guess(self, s: float) -> Direction:
        """The cubic's value."""
        u = s / self.length
        h10 = self.length * u * (1.0 - u) ** 2
        h01 = u * u * (3.0 - 2.0 * u)
        h11 = self.length * u * u * (u - 1.0) * self.rate
        a, j, b = self.start.tangent, self.jump, self.end.tangent
        return Direction(
            self.start.frames + h10 * a.frames + h01 * j.frames + h11 * b.frames,
            self.start.p + h10 * a.p + h01 * j.p + h11 * b.p,
            self.start.gamma + h10 * a.gamma + h01 * j.gamma + h11 * b.gamma,
        )

    @property
    def bulge(self) -> float:
        """How far the end lies beside the tangent at the start, over the length."""
        square = dot(self.start.mesh, self.jump, self.jump)
        return float(max(square / self.length**2 - 1.0, 0.0) ** 0.5)

    def at(self, s: float) -> Solution:
        """The solution at ``s``."""
        if s == 0.0:
            return self.start
        if s == self.length:
            return self.end
        return self._solved(self.guess(s), by_gamma=False)

    def at_gamma(self, gamma: float, low: float, high: float) -> tuple[float, Solution]:
        """The solution at ``gamma`` between s = low and high, where gamma is monotonic."""

        def cubic(s: float) -> float:
            return self.guess(s).gamma - gamma

        if cubic(low) * cubic(high) < 0.0:
            s = root(cubic, low, high)
            try:
                found = self._solved(self.guess(s)._replace(gamma=gamma), by_gamma=True)
            except Stuck:
                found = None
            if found is not None and self._near(found, s):
                return self._place(found), found
        # close to a fold: gamma is a bad coordinate there, s is not
        s = root(lambda t: self.at(t).gamma - gamma, low, high)
        return s, self.at(s)._replace(gamma=gamma)

    def _place(self, found: Solution) -> float:
        """The s of a solution: its distance along the tangent at the start."""
        a = self.start
        away = Direction(found.frames - a.frames, found.p - a.p, found.gamma - a.gamma)
        return dot(a.mesh, a.tangent, away)

    def _near(self, found: Solution, s: float) -> bool:
        """Whether a solution found at given gamma lies where the cubic expects it."""
        there = self.guess(s)
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
    return float(np.einsum("ij,ijk,ijk", mesh.weights, a.frames, b.frames)) + a.gamma * b.gamma


def root(f: Callable[[float], float], low: float, high: float) -> float:
    """Root of ``f`` between two places where its signs differ (Brent)."""
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=ROOT * max(high, 1e-3), rtol=8.9e-16))


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
    bend: Direction | None = None  # rate of change of the tangent over the last step
    length, age = FIRST_STEP, 0
    first: tuple[int, float] | None = None  # intervals and error that did not do for this step
    while True:
        if tally.steps >= MOST_STEPS or tally.work >= MOST_WORK:
            raise Stuck(f"the path has not ended after {tally.steps} steps")
        tally.work += len(here.mesh.h)
        step = _advance(system, tally, here, bend, length)
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
            bend, length, age = None, step.length, 0
            continue
        tally.steps += 1
        scales.take(found)
        yield from found
        if ended:
            return
        angle = _between(step.start, step.end)
        ease = math.sqrt(ANGLE / max(angle, 1e-3))
        if step.end.iterations > 4:
            ease = min(ease, 0.7)
        length = min(step.length * min(max(ease, 0.5), 2.0), LARGEST_STEP)
        a, b = step.start.tangent, step.end.tangent
        bend = Direction(
            (b.frames - a.frames) / step.length,
            (b.p - a.p) / step.length,
            (b.gamma - a.gamma) / step.length,
        )
        here, age, first = step.end, age + 1, None
        if age >= REFIT:
            n = _refined(len(here.mesh.h), size, wanted.tolerance)
            here, bend, age = _refitted(system, tally, here, here, n), None, 0


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


def _between(a: Solution, b: Solution) -> float:
    """Angle between the tangents at two solutions on one mesh [rad]."""
    return math.acos(min(1.0, max(-1.0, dot(a.mesh, a.tangent, b.tangent))))


def _advance(
    system: Collocation, tally: Tally, start: Solution, bend: Direction | None, length: float
) -> Step:
    """One accepted step of at most ``length``, shortened until Newton's method follows."""
    t = start.tangent
    reason = ""
    while length > SMALLEST_STEP:
        one, two = length, 0.5 * length * length
        if bend is None:
            guess = Direction(
                start.frames + one * t.frames, start.p + one * t.p, start.gamma + one * t.gamma
            )
        else:
            # s is the projection on the tangent, which the second-order term must not change
            one -= two * dot(start.mesh, t, bend)
            guess = Direction(
                start.frames + one * t.frames + two * bend.frames,
                start.p + one * t.p + two * bend.p,
                start.gamma + one * t.gamma + two * bend.gamma,
            )
        end = system.solved(start.mesh, guess, t, iterations=7)
        tally.newton_iterations += end.iterations
        if isinstance(end, Failure):
            reason = end.reason
        elif _between(start, end) < SHARPEST:
            step = Step(system, start, end, length, tally)
            if start.orientation == end.orientation or step.bulge < STRAIGHT:
                return step
            reason = "the path changes its orientation"
        else:
            reason = "the path turns too sharply"
        length *= 0.5
    raise Stuck(f"no step forward from gamma = {start.gamma:.8f}: {reason}")


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
    rates = (step.start.tangent.gamma, step.end.tangent.gamma * step.rate)
    cuts = [0.0, *_slowest(step.length, step.jump.gamma, *rates), step.length]
    return [
        Mark(*_root_of(step, lambda at: at.tangent.gamma, s0, s1), "fold")
        for s0, s1 in pairwise(cuts)
        if step.at(s0).tangent.gamma * step.at(s1).tangent.gamma < 0.0
    ]


def _limits(step: Step, line: list[Mark]) -> list[Mark]:
    """Limits of the moment between the marks of a line."""
    found = []
    for a, b in pairwise(line):
        rates = (_rate(step, a.at), _rate(step, b.at))
        inside = _slowest(b.s - a.s, b.at.moment - a.at.moment, *rates)
        for s0, s1 in pairwise([a.s, *(a.s + u for u in inside), b.s]):
            first = a.at if s0 == a.s else step.at(s0)
            last = b.at if s1 == b.s else step.at(s1)
            if first.moment_rate * last.moment_rate < 0.0:
                found.append(Mark(*_root_of(step, lambda at: at.moment_rate, s0, s1), "limit"))
    return found


def _rate(step: Step, at: Solution) -> float:
    """dM/ds, s measured along the tangent at the start."""
    return at.moment_rate / dot(at.mesh, step.start.tangent, at.tangent)


def _root_of(
    step: Step, value: Callable[[Solution], float], s0: float, s1: float
) -> tuple[float, Solution]:
    """Place and solution where a function of the solutions vanishes.

    A solution found at a given gamma differs from that at its s by rounding: where the function
    vanishes within that of one end, the end it is.
    """
    first, last = value(step.at(s0)), value(step.at(s1))
    if first * last > 0.0:
        s = s0 if abs(first) < abs(last) else s1
    else:
        s = root(lambda t: value(step.at(t)), s0, s1)
    return s, step.at(s)


def _slowest(length: float, jump: float, first: float, last: float) -> list[float]:
    """Where a cubic's rate is smallest between two equal signs, if it may change sign there.

    Two turns that lie close together show at the ends of an interval only by this.
    """
    if first * last <= 0.0 or length <= 0.0:
        return []
    c2 = 3.0 * jump / length - 2.0 * first - last
    c3 = first + last - 2.0 * jump / length
    u = -c2 / (3.0 * c3) if c3 != 0.0 else -1.0
    if not 0.0 < u < 1.0:
        return []
    rate = first + (2.0 * c2 + 3.0 * c3 * u) * u
    return [u * length] if rate * first < 0.1 * first * first else []


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
