"""Extrema within a step: where the rate of a scalar function of the solution changes sign.

An extremum of the parameter is a fold, one of an observable a limit point. Two that are close
together within one step are not visible at its ends; they are looked for where the rate of the
cubic between two solutions is smallest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any, Protocol, TypeAlias

from der.continuation.roots import ROOT, least_rate, rate_of_cubic, root_of_rate
from der.continuation.step import SAME
from der.problem import Increment, Solution

_AGAINST = 1e-2  # of the change expected from its rates: a change so large in the other direction
_ASLANT = 0.4  # of a rate at the ends of an interval: largest error of the rate of its cubic
_HALVED = 0.25  # of that error: on a part of the interval

Found: TypeAlias = tuple[float, Solution[Any]]  # a place, and the solution there
Value: TypeAlias = Callable[[Solution[Any]], tuple[float, float]]  # and its rate along the path


class Curve(Protocol):
    """A curve of solutions, s in [0, length]: what the search for events needs of a step."""

    @property
    def system(self) -> Any:
        """What the solutions are of."""

    @property
    def start(self) -> Any:
        """Solution at s = 0."""

    @property
    def end(self) -> Any:
        """Solution at s = length."""

    @property
    def end_rate(self) -> Increment:
        """Rate by s at the end, that of the parameter last."""

    @property
    def length(self) -> float:
        """Largest s."""

    def at(self, s: float) -> Any:
        """Return the solution at ``s``."""

    def at_parameter(self, value: float, low: float, high: float) -> tuple[float, Any]:
        """Return place and solution at a parameter that is monotonic between two places."""

    def change(
        self,
        value: Callable[[Any], float],
        low: tuple[float, Any],
        high: tuple[float, Any],
        guess: float | None = None,
    ) -> tuple[float, Any]:
        """Return place and solution, between two, where ``value`` changes its sign."""


def of_parameter(at: Solution[Any]) -> tuple[float, float]:
    """The parameter, and its rate along the path."""
    return at.parameter, at.parameter_rate


def of_observable(name: str) -> Value:
    """Return the function of a solution that gives an observable, and its rate along the path."""
    return lambda at: at.observables[name]


def extrema(
    step: Curve, low: Found, high: Found, value: Value, along: Value | None = None
) -> list[Found]:
    """Return places between two, and their solutions, where a value has an extremum.

    Parameters
    ----------
    along : the same value and its rate by s, where that differs from the rate along the path.
    """
    length, ends = high[0] - low[0], ((along or value)(low[1]), (along or value)(high[1]))
    if not length > 0.0 or keeps_sense(length, *ends):
        return []
    places = _samples(step, low, high, along or value)
    return [
        _extremum(step, a, b, value)
        for a, b in pairwise(_bisected(step, places, value))
        if a[0] < b[0] and value(a[1])[1] * value(b[1])[1] < 0.0
    ]


def keeps_sense(length: float, first: tuple[float, float], last: tuple[float, float]) -> bool:
    """Whether a value only grows, or falls, as far as it and its rates at two places tell."""
    (a, rate), (b, other) = first, last
    if rate * other <= 0.0 or _against(b - a, rate, other, length):
        return False
    least = least_rate(*rate_of_cubic((b - a) / length, rate, other))
    return least is None or math.copysign(1.0, rate) * least[1] >= _ASLANT * abs(rate)


def _against(jump: float, rate: float, other: float, length: float) -> bool:
    """Whether a value changes against its rates of equal signs at both ends of a length."""
    least = _AGAINST * max(abs(rate), abs(other)) * length
    return jump * math.copysign(1.0, rate) < -least


def _extremum(step: Curve, low: Found, high: Found, value: Value) -> Found:
    """The place between two, and its solution, where the rate of a ``value`` changes sign."""
    u = root_of_rate(*_rate(low, high, value))
    guess = None if u is None else low[0] + u * (high[0] - low[0])
    return step.change(lambda at: value(at)[1], low, high, guess)


def _rate(low: Found, high: Found, value: Value) -> tuple[float, float, float]:
    """Coefficients of the rate of the cubic through a value and its rates at two places."""
    (s, a), (t, b) = low, high
    (first, rate), (last, other) = value(a), value(b)
    return rate_of_cubic((last - first) / (t - s), rate, other)


def _samples(
    step: Curve, low: Found, high: Found, value: Value, off: float | None = None
) -> list[Found]:
    """Two places, and places between them that tell whether the rate of a value changes sign.

    Two extrema close together are visible at the ends of an interval only by the cubic between
    them, whose rate is smallest in the middle. If its rate allows them, the solution is computed
    there, and both parts are examined in the same way.

    Parameters
    ----------
    off : largest error of the rate of the cubic; None: not known.
    """
    if high[0] - low[0] < SAME * step.length:
        return [low, high]
    rates = _rate(low, high, value)
    least = least_rate(*rates)
    if least is None:
        return [low, high]
    u, expected = least
    rate = rates[0]
    off = _ASLANT * abs(rate) if off is None else off
    if math.copysign(1.0, rate) * expected >= off:
        return [low, high]
    place = low[0] + u * (high[0] - low[0])
    middle = (place, step.at(place))
    found = value(middle[1])[1]
    if found * rate < 0.0:
        return [low, middle, high]
    # of third order in the length
    off = _HALVED * abs(found - expected)
    before = _samples(step, low, middle, value, off)
    return [*before, *_samples(step, middle, high, value, off)[1:]]


def _bisected(step: Curve, places: list[Found], value: Value) -> list[Found]:
    """Places, with one more between two if a value changes against its rates at both.

    Between them the rate has the other sign, perhaps on a very short interval, which bisection
    finds. In a ring stretched almost straight, M changes in this way across its range.
    """
    cut = places[:1]
    for low, high in pairwise(places):
        end = high
        while high[0] - low[0] > ROOT:
            (first, rate), (last, other) = value(low[1]), value(high[1])
            length = high[0] - low[0]
            if rate * other <= 0.0 or not _against(last - first, rate, other, length):
                break
            s = 0.5 * (low[0] + high[0])
            middle = (s, step.at(s))
            between, turned = value(middle[1])
            if turned * rate < 0.0:
                cut.append(middle)
                break
            # it is against its rates on one of the halves at least
            if (between - first) * rate < 0.0:
                high = middle
            else:
                low = middle
        cut.append(end)
    return cut
