"""Loading and unloading by the angle or by a dead moment.

The ring follows its path of equilibria from minimum to minimum until stability is lost:

    angle   at a fold, dgamma/ds = 0, or where the index changes (a branch point)
    moment  at a limit of the moment, dM/ds = 0, or at a branch point

Then it snaps (`snap`), and loading continues from the end state of the snap. A start that is no
minimum snaps at once. What decides is the index of the full ring, under the control in use: with
the moment held there is one more unstable mode, which keeps the symmetry, where dM/dgamma < 0.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, replace

from der.analysis.request import Request
from der.analysis.snap import Landing, Snap, check_symmetry, downhill
from der.continuation.step import between
from der.errors import ContinuationFailed, Reason
from der.problem import PARAMETER, Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State

_PAST = 1e-3  # rad: distance behind a branch point at which the ring snaps
_LEVEL = 1e-2  # of the rate of the moment where a branch returns to its symmetric path, GJ/a


def follow_angle(
    ring: GrippedRing,
    request: Request,
    statistics: Statistics,
    *,
    start: State | None = None,
    unload: bool = False,
    every: int = 0,
) -> Iterator[Point[Equilibrium]]:
    """Yield the minima at given gamma, from the flat ring (or ``start``) to ``gamma_max``.

    A snap is yielded as the state before it (a point of kind "fold" or "branch") and a
    `snap.Landing`. ``unload`` returns to 0; ``every`` keeps every k-th configuration of snaps.

    Raises
    ------
    ContinuationFailed
        If loading cannot continue, after all points found have been yielded.
    """
    loading = _Loading(ring, replace(request, stability=True), statistics, PARAMETER, every)
    points = loading.there_and_back(ring.start if start is None else start, unload=unload)
    yield from _as_asked(points, request)


def follow_moment(
    ring: GrippedRing,
    request: Request,
    statistics: Statistics,
    *,
    unload: bool = False,
    every: int = 0,
) -> Iterator[Point[Equilibrium]]:
    """Yield the minima under a growing dead moment, until gamma reaches ``gamma_max``.

    Past a limit of the moment the ring snaps, to an equilibrium or to the stop at ``gamma_max``.
    ``unload`` lowers the moment again. The ring leaves the stop when the dead moment equals its
    own. If it is unstable there, it snaps at once, else at the limits on its path. It ends at a
    stop at gamma = 0.

    Raises
    ------
    ContinuationFailed
        If loading cannot continue, after all points found have been yielded.
    """
    asked = replace(request, stability=True, limits=True)
    loading = _Loading(ring, asked, statistics, "moment", every)
    yield from _as_asked(loading.there_and_back(ring.start, unload=unload), request)


def _as_asked(
    points: Iterable[Point[Equilibrium]], request: Request
) -> Iterator[Point[Equilibrium]]:
    """The points, with the index only if that is wanted."""
    for one in points:
        yield one if request.stability else replace(one, index=None, sides=None, stiffness=())


@dataclass(frozen=True)
class _Loading:
    """A ring that is loaded towards ``request.gamma_max``, by gamma (PARAMETER) or its moment."""

    ring: GrippedRing
    request: Request
    statistics: Statistics
    hold: str
    every: int

    @property
    def ends_at(self) -> str:
        """Kind of the point at which a minimum ceases to exist."""
        return "fold" if self.hold == PARAMETER else "limit"

    @property
    def dead_moment(self) -> bool:
        """Whether gamma moves in a snap."""
        return self.hold != PARAMETER

    @property
    def own_class(self) -> str:
        """Name of the modes that the sector itself can follow."""
        return next(iter(self.ring.classes))

    def there_and_back(self, start: State, *, unload: bool) -> Iterator[Point[Equilibrium]]:
        """Yield the minima from a state to the end, and back to gamma = 0 if asked for."""
        last = yield from self.from_state(start)
        if unload:
            back = replace(self, request=replace(self.request, gamma_max=0.0)).from_state(last)
            next(back)  # the state at which loading has ended
            yield from back

    def sense(self, state: State) -> float:
        """1 for loading from a state, -1 for unloading."""
        return 1.0 if self.request.gamma_max >= state.load else -1.0

    def corrected(self, state: State, sense: float, gamma: float | None = None) -> Equilibrium:
        """The equilibrium near a state, at its own gamma or another."""
        along, tolerance = self.ring.increment(load=sense), self.request.tolerance
        at = self.ring.correct(state, along=along, value=gamma, tolerance=tolerance)
        self.statistics.newton_iterations += at.iterations
        return at

    def begun(self, state: State) -> Equilibrium:
        """The equilibrium from which loading starts, its tangent in the direction of loading.

        Raises
        ------
        ContinuationFailed
            If there is none.
        """
        at = self.corrected(state, self.sense(state))
        if not at.converged:
            place = f"gamma = {state.load:.8f}"
            raise ContinuationFailed(f"{place} is no equilibrium: {at.advice}", Reason.NO_START)
        return at

    def from_state(self, start: State) -> Generator[Point[Equilibrium], None, State]:
        """Yield the minima from a state to the end, with snaps; return the last state."""
        here: Point[Equilibrium] | None = None
        while True:
            at = self.begun(start if here is None else here.solution.state)
            sense = self.sense(at.state)
            along = self.ring.increment(load=sense)
            path = self.request.follow(self.ring, self.statistics, start=at.state, along=along)
            regular = point = next(path)
            if here is None:
                yield point
            check_symmetry(self.ring, point.solution, point.index)
            here = None if self.is_minimum(point) else self._at_once(point, sense)
            for one in path if here is None else ():
                point = self._named(one)
                yield point
                if point.kind in (self.ends_at, "branch"):
                    here = self._after(point, self._past(regular, point, path, sense), sense)
                    break
                if not point.kind:
                    self.check_minimum(point)
                    regular = point
            if here is None:
                return point.solution.state
            yield here
            check_symmetry(self.ring, here.solution, here.index)
            if here.solution.parameter == self.request.gamma_max:
                return here.solution.state

    def _named(self, one: Point[Equilibrium]) -> Point[Equilibrium]:
        """A point; a fold of a branch that returns to its symmetric path is a branch point.

        There the moment is stationary, too: the branch continues as its own mirror image.
        """
        level = abs(one.solution.moment_rate) < _LEVEL
        if self.hold == PARAMETER and one.kind == "fold" and level:
            return replace(one, kind="branch", details={"symmetry": self.own_class})
        return one

    def snap(self, before: Equilibrium, sense: float) -> Snap:
        """The snap from a state."""
        return Snap(self.ring, self.request, self.statistics, before, sense, self.every)

    def _at_once(self, start: Point[Equilibrium], sense: float) -> Landing:
        """The end state of the snap from a start that is no minimum."""
        at = start.solution
        own = start.index is not None and start.index[0]
        mode = downhill(self.ring, at) if own else at.tangent
        return self.snap(at, sense).landing(mode, dead_moment=self.dead_moment)

    def _after(
        self, lost: Point[Equilibrium], past: Callable[[], Equilibrium], sense: float
    ) -> Point[Equilibrium]:
        """The point at which loading continues after stability is lost."""
        at, symmetry = lost.solution, lost.details.get("symmetry")
        if lost.kind == self.ends_at:
            # the tangent is the softest mode itself, and past the fold is downhill
            return self.snap(at, sense).landing(at.tangent, dead_moment=self.dead_moment)
        if symmetry != self.own_class:
            raise ContinuationFailed(
                f"the ring loses stability at gamma = {at.parameter:.8f} by a mode ({symmetry})"
                f" that breaks the symmetry of its {self.ring.name}; the sector 'full' follows it",
                Reason.BREAKS_SYMMETRY,
            )
        if abs(at.moment_rate) < _LEVEL and abs(at.parameter_rate) < _LEVEL:
            kept = self._kept(at, sense)
            if kept is not None:
                return kept
        before = past()
        mode = downhill(self.ring, before)
        return self.snap(before, sense).landing(
            mode, dead_moment=self.dead_moment, gamma_lost=at.parameter
        )

    def _past(
        self,
        before: Point[Equilibrium],
        lost: Point[Equilibrium],
        path: Iterator[Point[Equilibrium]],
        sense: float,
    ) -> Callable[[], Equilibrium]:
        """Return what solves for the unstable state a little past a branch point, on its path.

        Not from the tangent at the branch point: two of them meet there, and the solver finds
        neither. ``before``: a regular point before it; ``path``: what comes after.
        """

        def solved() -> Equilibrium:
            after = next((one for one in path if not one.kind), lost).solution
            gamma = lost.solution.parameter + sense * _PAST
            if (after.parameter - gamma) * sense <= 0.0:
                return after
            step = between(
                self.ring,
                before.solution,
                after,
                tolerance=self.request.tolerance,
                statistics=self.statistics,
            )
            return step.at_parameter(gamma, 0.0, step.length)[1]  # type: ignore[return-value]

        return solved

    def _kept(self, at: Equilibrium, sense: float) -> Point[Equilibrium] | None:
        """The minimum past the end of a branch, on its symmetric path: there is no snap.

        None: there is none so close.
        """
        end, gamma = self.request.gamma_max, at.parameter + sense * _PAST
        if (end - gamma) * sense < 0.0:
            gamma = end
        found = self.corrected(at.state, sense, gamma)
        return (
            self.request.point(self.ring, found) if found.converged and found.index == 0 else None
        )

    def is_minimum(self, point: Point[Equilibrium]) -> bool:
        """Whether a state is stable under the control, as far as its index is known."""
        falls = self.dead_moment and point.solution.slope < 0.0
        return not falls and not any(point.index or ())

    def check_minimum(self, point: Point[Equilibrium]) -> None:
        """Raise an error if a state is unstable though no loss of stability was found before it."""
        if not self.is_minimum(point):
            raise ContinuationFailed(
                f"the state at gamma = {point.solution.parameter:.8f} is no minimum, and where"
                " stability was lost is not known",
                Reason.NO_MINIMUM,
            )
