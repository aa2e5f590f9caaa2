"""Roots of functions that are dear to evaluate, and where cubics turn."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

CLOSE = 1e-10  # of s: gamma at a fold, M at a limit are quadratic in it
SMALL = 1e-6  # of the values at the ends: so near a root, interpolation tells how near


def root(f: Callable[[float], float], low: float, high: float, guess: float = math.nan) -> float:
    """Root of ``f`` between two places where its signs differ, one at which it was evaluated.

    Places are interpolated over the last four values; where that leads out of the interval that is
    left, or has not halved it in three steps, it is cut in two.
    """
    close = CLOSE * max(high, 1e-3)
    places, values = [low, high], [f(low), f(high)]
    largest, rising = max(map(abs, values)), values[0] < values[1]
    s = _at_zero(places, values) if math.isnan(guess) else guess
    widths = [high - low]
    while high - low > close:
        if not low < s < high or (len(widths) > 3 and widths[-1] > 0.5 * widths[-4]):
            s, widths = 0.5 * (low + high), []
        value = f(s)
        low, high = (low, s) if (value > 0.0) == rising else (s, high)
        widths.append(high - low)
        places, values = [*places[-3:], s], [*values[-3:], value]
        last, s = s, _at_zero(places, values)
        if value == 0.0 or (abs(value) < SMALL * largest and abs(s - last) < close):
            return last
    return places[min(range(len(values)), key=lambda k: abs(values[k]))]


def _at_zero(places: Sequence[float], values: Sequence[float]) -> float:
    """Place of the value 0, interpolated by Neville's scheme; NaN where two values are equal."""
    p = list(places)
    for width in range(1, len(p)):
        for i in range(len(p) - width):
            rise = values[i + width] - values[i]
            if rise == 0.0:
                return math.nan
            p[i] = (values[i + width] * p[i] - values[i] * p[i + 1]) / rise
    return p[0]


def rate_of_cubic(jump: float, first: float, last: float) -> tuple[float, float, float]:
    """Coefficients of 1, u, u^2 of a cubic's rate, u from 0 to 1, from its jump and end rates."""
    return first, 6.0 * jump - 4.0 * first - 2.0 * last, 3.0 * (first + last - 2.0 * jump)


def slowest(c0: float, c1: float, c2: float) -> tuple[float, float] | None:
    """Where a cubic's rate is smallest between two equal signs, and that rate; None at an end."""
    if c0 * (c0 + c1 + c2) <= 0.0 or c2 == 0.0:
        return None
    u = -c1 / (2.0 * c2)
    return (u, c0 + (c1 + c2 * u) * u) if 0.0 < u < 1.0 and c0 * c2 > 0.0 else None


def turn_of(c0: float, c1: float, c2: float) -> float:
    """Where a cubic's rate is zero between two unequal signs."""
    larger = -0.5 * (c1 + math.copysign(math.sqrt(max(c1 * c1 - 4.0 * c0 * c2, 0.0)), c1))
    for over, under in ((larger, c2), (c0, larger)):
        if under != 0.0 and 0.0 < over / under < 1.0:
            return over / under
    return 0.5
