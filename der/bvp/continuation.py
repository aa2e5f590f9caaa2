"""Follow the path of a boundary-value problem through its folds, by pseudo-arclength (Keller 1977).

A kernel goes ahead by several steps (`ahead`). Each is a cubic between two solutions (`step`), on
which folds, limits of the moment and solutions that were asked for are located (`events`). The mesh
follows the solution; its number of intervals follows the estimated error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from der.bvp.ahead import Ahead
from der.bvp.collocation import Collocation, Solution, required
from der.bvp.events import Point, Wanted, located
from der.bvp.march import SMALLEST_STEP
from der.bvp.meshes import fitted
from der.bvp.step import Statistics, Step
from der.errors import ContinuationFailed, Reason

FIRST_STEP = 0.05
FIRST_TURN, LEAST_TURN = 0.02, 2e-4  # rad
MOST_STEPS = 2000
MOST_WORK = 200_000  # intervals of all steps together: a ring that winds up needs more and more
FEWEST_INTERVALS, MOST_INTERVALS = 3, 4000
# Four times the intervals leave 2e-5 of an error of order 8. If half of it remains, it is rounding.
MORE, REMAINS = 4.0, 0.5
SAFETY = 0.25  # of the tolerance: the error aimed at


class Scales:
    """The largest |M| and U so far, at least those of a first small turn."""

    def __init__(self, start: Solution, turn: float = FIRST_TURN) -> None:
        self.moment = turn * abs(start.slope)
        self.energy = 2.0 * turn**2 * abs(start.slope)

    def largest(self, points: Sequence[Point]) -> float:
        """The largest error of points not yet handed out, relative.

        Points that are not handed out are not in the record, and do not set its scale: a solution
        on too coarse a mesh may have any energy, and one beyond the end may have the largest.
        """
        moment, energy = self._with(points)
        return max(max(g / math.pi, m / moment, u / energy) for _, (g, m, u), _ in points)

    def take(self, points: Sequence[Point]) -> None:
        """Take note of points that are handed out."""
        self.moment, self.energy = self._with(points)

    def _with(self, points: Sequence[Point]) -> tuple[float, float]:
        moment, energy = self.moment, self.energy
        for point in points:
            moment = max(moment, abs(point.solution.moment))
            energy = max(energy, abs(point.solution.energy))
        return moment, energy


def follow(system: Collocation, wanted: Wanted, statistics: Statistics) -> Iterator[Point]:
    """Hand out the points of the path from the flat ring on, events in their places.

    ``statistics`` are counted up.

    Raises
    ------
    ContinuationFailed
        Where the path cannot be continued, after everything that was found has been handed out.
    """
    refinement = _Refinement(system, wanted.tolerance)
    path = _Path(system, wanted, statistics, refinement, *refinement.flat(statistics))
    yield path.start
    yield from path.steps()


class _Refinement:
    """How many intervals a mesh needs."""

    def __init__(self, system: Collocation, tolerance: float) -> None:
        self.system = system
        self.tolerance = tolerance
        self.most = max(MOST_INTERVALS, 4 * len(system.sector.joints))
        self._first: tuple[int, float] | None = None  # intervals and error of the first bad mesh

    def flat(self, statistics: Statistics) -> tuple[Point, int]:
        """The flat ring on a mesh fine enough, and about how many intervals that has."""
        n = max(FEWEST_INTERVALS, len(self.system.sector.joints) - 1)
        while True:
            found = required(self.system.flat(n), "the flat ring is no solution")
            point = Point(found, self.system.error(found))
            size = Scales(found).largest([point])
            if size <= self.tolerance:
                statistics.newton_iterations += found.iterations
                self.done()
                return point, n
            self.check(n, size, 0.0)
            n = min(2 * n, self.most)

    def done(self) -> None:
        """Begin anew: the last mesh was fine enough."""
        self._first = None

    def check(self, n: int, size: float, gamma: float) -> None:
        """Stop where more intervals do not help, after the error that n intervals leave.

        Raises
        ------
        ContinuationFailed
            Where rounding leaves the error, or the mesh has as many intervals as it may.
        """
        if self._first is None or not math.isfinite(self._first[1]):
            self._first = n, size
        fewest, largest = self._first
        if n >= MORE * fewest and size > REMAINS * largest:
            raise ContinuationFailed(
                f"rounding leaves an error of {size:.2g} on {n} intervals, as on fewer,"
                f" at gamma = {gamma:.6f}",
                Reason.INACCURATE,
            )
        if n >= self.most:
            raise ContinuationFailed(
                f"an error of {size:.2g} is left on {n} intervals at gamma = {gamma:.6f}",
                Reason.INACCURATE,
            )

    def refined(self, n: int, size: float) -> int:
        """Intervals that bring an error of order h^8 to the one aimed at."""
        factor = 1.5
        if math.isfinite(size):
            factor = (max(size, 1e-300) / (SAFETY * self.tolerance)) ** 0.125
        return max(math.ceil(n * min(max(factor, 0.8), 1.6)), FEWEST_INTERVALS)


@dataclass
class _Path:
    """A path being followed, and what its next step needs."""

    system: Collocation
    wanted: Wanted
    statistics: Statistics
    refinement: _Refinement
    start: Point
    intervals: int  # asked for last

    def __post_init__(self) -> None:
        self.ahead = Ahead(self.system, self.start.solution, FIRST_STEP)
        # the moment of a stiff ring is largest long before FIRST_TURN
        self.scales = Scales(self.start.solution, LEAST_TURN)

    def steps(self) -> Iterator[Point]:
        """Hand out the points after the first."""
        ended = False
        while not ended:
            counts = self.statistics
            if counts.steps >= MOST_STEPS or counts.intervals >= MOST_WORK:
                raise ContinuationFailed(
                    f"the path has not ended after {counts.steps} steps", Reason.TOO_MANY_STEPS
                )
            counts.intervals += len(self.ahead.here.mesh.h)
            scale = self.scales.moment, self.scales.energy
            step, end = self.ahead.step(self.wanted, scale, counts)
            if (found := self._searched(step, end)) is None:
                continue
            points, ended, size = found
            counts.steps += 1
            self.scales.take(points)
            yield from points
            self.refinement.done()
            self.ahead.move(step.end)
            if self.ahead.full and not ended:
                n = self.refinement.refined(len(step.end.mesh.h), size)
                self._refit(step.end, n, self.ahead.length)

    def _searched(self, step: Step, end: Point) -> tuple[list[Point], bool, float] | None:
        """The points of a step, whether the path ends there, and the error relative to tolerance.

        None where the step is to be repeated, shorter or on a finer mesh.
        """
        tolerance = self.wanted.tolerance
        size = self.scales.largest([end])
        if size <= tolerance:
            try:
                points, ended = located(self.wanted, step, end)
            except ContinuationFailed:
                # both ends are solutions, but not of one smooth curve: repeat with a shorter step
                if step.length < 4.0 * SMALLEST_STEP:
                    raise
                self.ahead.repeat(0.25 * step.length)
                return None
            # where a path ends in its first step, errors are relative to that step's values
            size = self.scales.largest(points if self.statistics.steps else [*points, end])
        if size <= tolerance:
            return points, ended, size
        n = len(step.start.mesh.h)
        self.refinement.check(n, size, step.start.gamma)
        # at least one more than asked for last: joints may round the number down
        more = max(self.intervals + 1, self.refinement.refined(n, size))
        self._refit(step.end, min(more, self.refinement.most), step.length)
        return None

    def _refit(self, fit: Solution, n: int, length: float) -> None:
        """Continue from the same solution on a mesh of about ``n`` intervals fitted to ``fit``."""
        mesh = fitted(fit.mesh, fit.nodes[:-1], fit.frames, n)
        here = self.ahead.here
        found = self.system.on(mesh, here)
        self.statistics.newton_iterations += found.iterations
        message = f"no solution on {n} intervals at gamma = {here.gamma:.6f}"
        self.ahead = Ahead(self.system, required(found, message), length)
        self.intervals = n
