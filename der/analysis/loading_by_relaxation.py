"""Loading by dynamic relaxation alone: states are found without Hessian and factorisation.

The grips turn in steps. After each step the ring relaxes from the extrapolation of the last states.
If the end state is far from the extrapolation, the ring has snapped. It has also snapped if its
energy is not that of the last state plus the work of the grips: a long step may reach another
branch close by.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain

from der.analysis.request import EIGHTH, Request
from der.analysis.secant import CLOSE, ahead, is_work, longer, rested, went_on
from der.analysis.snap import Landing, check_symmetry, snap_details
from der.errors import ContinuationFailed, Reason
from der.problem import Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.relaxation import Relaxed, relax
from der.rod.rod import State

RISE = math.pi / 64.0  # rad, step of loading by dynamic relaxation alone
RESOLUTION = 1e-6  # rad, of the place of a snap
_LONGER = 4.0  # times the last step: longest step for which extrapolation is useful
_NARROW = 0.01  # of the distance of two states: width of a parabola through a limit of M


def follow_relaxed(
    ring: GrippedRing,
    request: Request,
    statistics: Statistics,
    *,
    start: Equilibrium | None = None,
    unload: bool = False,
    rise: float = RISE,
    tolerance: float = 1e-9,
    every: int = 0,
) -> Iterator[Point[Equilibrium]]:
    """Yield the minima at given gamma, each by dynamic relaxation, without any Hessian.

    Gamma grows in steps of ``rise`` [rad], and every load asked for is one of them. Limits of the
    moment are located by parabolas through relaxed states. A state far from the extrapolation of
    the last ones has snapped; the gamma of the snap is bracketed by bisection to `RESOLUTION`
    ("gamma_uncertainty" of the landing). Self-crossings are not looked for. Tangents and slopes are
    differences of second order. ``tolerance`` is that of `relaxation.relax`.

    Raises
    ------
    ContinuationFailed
        If the ring does not come to rest, or rests in no minimum.
    """
    loading = _Relaxation(ring, request, statistics, rise, tolerance, every)
    last = start
    for one in _with_limits(loading, _relaxed_states(loading, start)):
        last = one.solution
        yield one
    if unload:
        back = replace(loading, request=replace(request, gamma_max=0.0))
        states = _with_limits(back, _relaxed_states(back, last))
        next(states)  # the state at which loading has ended
        yield from states


@dataclass(frozen=True)
class _Relaxation:
    """The settings of one loading by relaxation."""

    ring: GrippedRing
    request: Request
    statistics: Statistics
    rise: float
    tolerance: float
    every: int

    def relaxed(self, start: State, every: int = 0) -> Relaxed:
        """The relaxed state at the load of ``start``.

        Raises
        ------
        ContinuationFailed
            If there is none.
        """
        found = relax(self.ring, start, tolerance=self.tolerance, every=every)
        self.statistics.force_evaluations += found.evaluations
        if not found.rests:
            subject = "" if found.where >= 0 else "the ring "
            place = f"at gamma = {start.load:.8f} {subject}{found.advice}"
            raise ContinuationFailed(place, Reason.NOT_AT_REST)
        return found

    def minimum(self, at: Equilibrium) -> Point[Equilibrium]:
        """The point of a relaxed state.

        Raises
        ------
        ContinuationFailed
            If it is no minimum of the full ring.
        """
        index, _ = self.ring.indices(at.state)
        check_symmetry(self.ring, at, index)
        if index[0]:
            raise ContinuationFailed(
                f"the ring rests at gamma = {at.parameter:.8f} in no minimum: relaxation keeps the"
                " symmetry that it would have to lose",
                Reason.NO_MINIMUM,
            )
        return Point(at)

    def loads(self, first: float) -> list[float]:
        """Loads to relax at, in order from ``first``."""
        last, most = self.request.gamma_max, self.request.options.max_steps
        low, high = min(first, last), max(first, last)
        if high - low > most * self.rise:
            raise ContinuationFailed(
                f"loading would not end within {most} steps", Reason.TOO_MANY_STEPS
            )

        def multiples(step: float) -> list[float]:
            return [k * step for k in range(math.ceil(low / step), int(high / step) + 1)]

        grid, asked = multiples(self.rise), self.request.targets
        asked = (*(multiples(EIGHTH) if asked is None else asked), math.pi)
        asked = (*(load for load in asked if low <= load <= high), last)
        # a step of the grid very close to a load that is asked for is left out
        near = 0.1 * self.rise
        grid = [load for load in grid if min(abs(load - one) for one in asked) > near]
        return sorted({*grid, *asked} - {first}, reverse=last < first)


def _relaxed_states(
    loading: _Relaxation, start: Equilibrium | None
) -> Iterator[Point[Equilibrium]]:
    """Relaxed states at the loads, and landings after snaps."""
    ring = loading.ring
    first = loading.relaxed(ring.start if start is None else start.state)
    recent = [rested(ring, [], first)]
    yield loading.minimum(recent[-1])
    largest = 0.0  # moment so far
    loads = loading.loads(first.state.load)[::-1]
    while loads:
        here = recent[-1].parameter
        if len(recent) > 1:
            longest = _LONGER * (here - recent[-2].parameter)
            if abs(loads[-1] - here) > abs(longest):
                loads.append(here + 0.5 * longest)
        found = loading.relaxed(ahead(ring, recent, loads[-1]))
        loading.statistics.steps += 1
        largest = max(largest, abs(found.moment))
        if went_on(ring, recent, found) and is_work(recent, found, largest):
            loads.pop()
            at = rested(ring, recent, found)
            recent = longer(ring, recent, found)
            yield loading.minimum(at)
        elif abs(loads[-1] - here) > RESOLUTION:
            loads.append(0.5 * (here + loads[-1]))
        else:
            landing = _landed(loading, recent, loads.pop())
            recent = [landing.solution]
            loading.minimum(landing.solution)
            yield landing


def _landed(loading: _Relaxation, recent: list[Equilibrium], load: float) -> Landing:
    """The end state of a snap between the last state of some and ``load``."""
    ring, before = loading.ring, recent[-1]
    found = loading.relaxed(ahead(ring, recent, load), loading.every)
    rise = load - before.parameter
    states = (before.energy + before.moment * rise, before.moment), (found.energy, found.moment)
    details = snap_details(ring, load, *states, found.evaluations)
    details["gamma_uncertainty"] = abs(rise)
    energies = tuple(ring.copies * float(e) for e in found.energies)
    at = rested(ring, [], found)
    return Landing(at, "snap", details=details, history=found.history, energies=energies)


def _with_limits(
    loading: _Relaxation, states: Iterator[Point[Equilibrium]]
) -> Iterator[Point[Equilibrium]]:
    """The points together with the limits of the moment, each state one step later."""
    window: list[list[Point[Equilibrium]]] = []  # three places, each with its equal states
    try:
        for one in states:
            if one.kind == "snap":
                yield from chain(*window[1:])
                window = []
            if window and abs(one.solution.parameter - window[-1][0].solution.parameter) <= CLOSE:
                window[-1].append(one)
            else:
                window.append([one])
            if len(window) == 1:
                yield one
            if len(window) == 3 and len(window[-1]) == 1:
                yield from _with_limit(loading, window)
                window.pop(0)
    except ContinuationFailed:
        yield from chain(*window[1:])  # the states before it are good
        raise
    yield from chain(*window[1:])


def _with_limit(
    loading: _Relaxation, window: list[list[Point[Equilibrium]]]
) -> list[Point[Equilibrium]]:
    """The middle of three places, in order with the limit of the moment among them."""
    a, b, c = (same[0].solution for same in window)
    turn = list(window[1])
    if (b.moment - a.moment) * (c.moment - b.moment) < 0.0:
        turn.append(_turning(loading, a, b, c))
    return sorted(turn, key=lambda v: v.solution.parameter, reverse=c.parameter < b.parameter)


def _turning(
    loading: _Relaxation, a: Equilibrium, b: Equilibrium, c: Equilibrium
) -> Point[Equilibrium]:
    """The limit of the moment among three relaxed states, by Brent's method and then a parabola.

    All states computed lie between the three: just beyond there may be a snap. Near a fold the
    moment is no parabola, and a wide one would miss the limit.
    """
    from scipy.optimize import minimize_scalar

    low, high = sorted((a.parameter, c.parameter))
    h = _NARROW * (high - low)
    sign = 1.0 if b.moment < a.moment else -1.0

    def moment(load: float) -> float:
        return sign * _between(loading, a, c, load).moment

    found = minimize_scalar(moment, bounds=(low, high), method="bounded", options={"xatol": h})
    load = min(max(float(found.x), low + h), high - h)
    load = _vertex([_between(loading, a, c, x) for x in (load - h, load, load + h)])
    return Point(_between(loading, a, c, min(max(load, low), high)), "limit")


def _vertex(recent: list[Equilibrium]) -> float:
    """Load at which a parabola through three moments is stationary."""
    x, y, z = (at.parameter for at in recent)
    p, q, r = (at.moment for at in recent)
    first, second = (q - p) / (y - x), (r - q) / (z - y)
    return y if first == second else 0.5 * (x + y) - 0.5 * first * (z - x) / (second - first)


def _between(loading: _Relaxation, a: Equilibrium, c: Equilibrium, load: float) -> Equilibrium:
    """The relaxed state at a load between those of two others."""
    part = (load - a.parameter) / (c.parameter - a.parameter)
    step = loading.ring.difference(a.state, c.state)
    guess = loading.ring.displacement(step, part)
    guess[-1] = load - a.parameter
    found = loading.relaxed(loading.ring.retract(a.state, guess).but(load=load))
    return rested(loading.ring, [a], found)
