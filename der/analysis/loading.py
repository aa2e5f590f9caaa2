"""Loading and unloading by the angle or by a dead moment.

The ring follows its path of equilibria from minimum to minimum until stability is lost:

    angle   at a fold, dgamma/ds = 0, or where the index changes (a branch point)
    moment  at a limit of the moment, dM/ds = 0, or at a branch point

Then it snaps (`snap`), and loading continues from the end state of the snap.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace

from der.analysis.request import Request
from der.analysis.snap import Snap, downhill
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
    loading = _Loading(ring, request, statistics, PARAMETER, every)
    last = yield from loading.from_state(ring.start if start is None else start)
    if unload:
        back = replace(loading, request=replace(request, gamma_max=0.0)).from_state(last)
        next(back)  # the state at which loading has ended
        yield from back


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
    loading = _Loading(ring, request, statistics, "moment", every)
    last = yield from loading.from_state(ring.start)
    if not unload:
        return
    down = replace(loading, request=replace(request, gamma_max=0.0))
    at = down.begun(last)
    if at.slope < 0.0:
        # M grows as gamma decreases: no dead moment holds the ring once it has left the stop
        landed = down.snap(at, -1.0).landing(at.tangent, dead_moment=True)
        yield landed
        down.check_other_classes(landed)
        if landed.solution.parameter == 0.0:
            return
        last = landed.solution.state
    back = down.from_state(last)
    next(back)  # the state that was yielded last
    yield from back


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
    def own_class(self) -> str:
        """Name of the modes that the sector itself can follow."""
        return next(iter(self.ring.classes))

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
        """The minimum from which loading starts, its tangent in the direction of loading.

        Raises
        ------
        ContinuationFailed
            If there is none.
        """
        at = self.corrected(state, self.sense(state))
        place = f"gamma = {state.load:.8f}"
        if not at.converged:
            raise ContinuationFailed(f"{place} is no equilibrium: {at.advice}", Reason.NO_START)
        if at.index != 0:
            raise ContinuationFailed(
                f"the state at {place} is no minimum: loading cannot start from it", Reason.NO_START
            )
        return at

    def from_state(self, start: State) -> Generator[Point[Equilibrium], None, State]:
        """Yield the minima from a state to the end, with snaps; return the last state."""
        here: Point[Equilibrium] | None = None
        while True:
            at = self.begun(start if here is None else here.solution.state)
            sense = self.sense(at.state)
            path = self._path(at.state, sense)
            regular = point = next(path)
            if here is None:
                yield point
            for one in path:
                point = self._named(one)
                yield point
                if point.kind in (self.ends_at, "branch"):
                    break
                regular = point if not point.kind else regular
            else:
                return point.solution.state
            here = self._after(point, self._past(regular, point, path, sense), sense)
            yield here
            self.check_other_classes(here)
            if here.solution.parameter == self.request.gamma_max:
                return here.solution.state

    def _path(self, start: State, sense: float) -> Iterator[Point[Equilibrium]]:
        """The path of equilibria from a minimum.

        The index in the sector's own class is always counted, because it tells where the ring
        snaps. The points have it only if it was asked for.
        """
        along = self.ring.increment(load=sense)
        if self.request.stability:
            yield from self.request.follow(self.ring, self.statistics, start=start, along=along)
            return
        asked = replace(self.request, stability=True)
        for one in asked.follow(self.ring.own_class(), self.statistics, start=start, along=along):
            yield replace(one, index=None, sides=None)

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

    def _after(
        self, lost: Point[Equilibrium], past: Callable[[], Equilibrium], sense: float
    ) -> Point[Equilibrium]:
        """The point at which loading continues after stability is lost."""
        at, symmetry = lost.solution, lost.details.get("symmetry")
        if lost.kind == self.ends_at:
            # the tangent is the softest mode itself, and past the fold is downhill
            dead = self.hold != PARAMETER
            return self.snap(at, sense).landing(at.tangent, dead_moment=dead)
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
        return self.snap(before, sense).landing(mode, gamma_lost=at.parameter)

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

    def check_other_classes(self, landed: Point[Equilibrium]) -> None:
        """Raise an error if a state is unstable in a class that the sector cannot follow."""
        for label, count in zip(self.ring.classes, landed.index or (), strict=False):
            if count:
                raise ContinuationFailed(
                    f"the ring comes to rest at gamma = {landed.solution.parameter:.8f} in a state"
                    f" that is unstable to modes ({label}) that break the symmetry of its"
                    f" {self.ring.name}; the sector 'full' follows it",
                    Reason.BREAKS_SYMMETRY,
                )
