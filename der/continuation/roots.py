"""Roots of a function of one variable that is expensive to evaluate, and cubics between two values.

Inverse interpolation through the last four values takes half as many evaluations as Brent's method,
and starts from a guess if one is known. It is used as long as every value is at most half of the
one before. A root is accepted if its value is below 1e-12 of the slopes of two chords: the chord of
the first two values fails for a function that is flat at its root, the last chord for one that
jumps. If interpolation converges too slowly, Brent's method is used.

Everything here is a function of scalars.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache

Function = Callable[[float], float]

ROOT = 1e-12  # of s; a fold is a double root of gamma - gamma*, so far below 1e-10 in gamma
_LAST = 1e-9  # of s: a correction this small leaves the next one, its square, below `ROOT`
_GAIN = 0.5  # of a value: if the next one is larger, Brent's method is better
_RELATIVE = 8.9e-16  # four times the rounding of a place


def find_root(
    f: Function, low: float, high: float, within: float = ROOT, *, guess: float | None = None
) -> float:
    """Root of ``f`` between two places where its signs differ, to ``within``.

    Each place is evaluated once; the root is one of them.

    Parameters
    ----------
    guess : the first place to evaluate, if one close to the root is known.

    Raises
    ------
    ValueError
        Where the signs do not differ.
    """
    f = cache(f)
    s = smooth_root(f, low, high, within, guess=guess)
    return brent(f, low, high, within) if s is None else s


def smooth_root(
    f: Function, low: float, high: float, within: float = ROOT, *, guess: float | None = None
) -> float | None:
    """`find_root` by inverse interpolation alone; None where ``f`` is not smooth enough for it.

    The root is the last place that was evaluated.
    """
    known = [(low, f(low)), (high, f(high))]
    for s, value in known:
        if value == 0.0:
            return s
    ends = {value > 0.0: s for s, value in known}  # the root lies between these two
    following, last, least = guess, math.inf, math.inf
    while True:
        s = _interpolated(known[-4:]) if following is None else following
        if not min(ends.values()) < s < max(ends.values()):
            return None
        value = f(s)
        if value == 0.0 or (abs(s - last) < max(within, _LAST) and abs(value) <= least):
            return s  # a value that grows there is one beyond a jump
        if abs(value) <= ROOT * min(_slope(*known[:2]), _slope(known[-1], (s, value))):
            return s  # no closer: rounding may make the next value grow
        ends[value > 0.0] = s
        if not abs(value) <= _GAIN * least:
            return None
        known.append((s, value))
        following, last, least = None, s, abs(value)


def brent(f: Function, low: float, high: float, within: float = ROOT) -> float:
    """`find_root` by Brent's method (1973): interpolation that falls back on bisection.

    Raises
    ------
    ValueError
        Where the signs at both ends do not differ.
    """
    before, best = (low, f(low)), (high, f(high))  # places and values
    if before[1] == 0.0:
        return low
    if best[1] != 0.0 and (before[1] > 0.0) == (best[1] > 0.0):
        raise ValueError(
            f"a root needs values of unequal signs, got {before[1]:g} at {low:g}"
            f" and {best[1]:g} at {high:g}"
        )
    other, step, last_step = before, 0.0, 0.0  # the root lies between the best and the other
    while True:
        if (before[1] > 0.0) != (best[1] > 0.0):
            other, step, last_step = before, best[0] - before[0], best[0] - before[0]
        if abs(other[1]) < abs(best[1]):
            before, best, other = best, other, best
        close = 0.5 * (within + _RELATIVE * abs(best[0]))
        half = 0.5 * (other[0] - best[0])
        if best[1] == 0.0 or abs(half) < close:
            return best[0]
        trial = math.inf
        if abs(last_step) > close and abs(best[1]) < abs(before[1]):
            known = [before, best] if before[0] == other[0] else [other, before, best]
            trial = _interpolated(known) - best[0]
        if 2.0 * abs(trial) < min(abs(last_step), 3.0 * abs(half) - close):
            last_step, step = step, trial
        else:
            last_step = step = half
        s = best[0] + (step if abs(step) > close else math.copysign(close, half))
        before, best = best, (s, f(s))


def _slope(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Size of the slope of the chord through two places and values."""
    return abs((b[1] - a[1]) / (b[0] - a[0]))


def _interpolated(known: Sequence[tuple[float, float]]) -> float:
    """Where the polynomial s(value) through some places and values is at 0; NaN if there is none.

    Neville's scheme.
    """
    column = [s for s, _ in known]
    for k in range(1, len(known)):
        for j in range(len(known) - k):
            low, high = known[j][1], known[j + k][1]
            if low == high:
                return math.nan
            column[j] = (high * column[j] - low * column[j + 1]) / (high - low)
    return column[0]


# --- The cubic through two values and their rates ---------------------------------------------


def rate_of_cubic(jump: float, first: float, last: float) -> tuple[float, float, float]:
    """Coefficients of 1, u, u^2 of a cubic's rate on [0, 1], from its jump and its end rates."""
    return first, 6.0 * jump - 4.0 * first - 2.0 * last, 3.0 * (first + last - 2.0 * jump)


def root_of_rate(c0: float, c1: float, c2: float) -> float | None:
    """Where in (0, 1) a cubic's rate is zero if its signs at the ends differ.

    None where rounding hides it.
    """
    larger = -0.5 * (c1 + math.copysign(math.sqrt(max(c1 * c1 - 4.0 * c0 * c2, 0.0)), c1))
    for over, under in ((larger, c2), (c0, larger)):
        if under != 0.0 and 0.0 < over / under < 1.0:
            return over / under
    return None


def least_rate(c0: float, c1: float, c2: float) -> tuple[float, float] | None:
    """Where in (0, 1) a cubic's rate of equal signs at the ends is smallest, and that rate.

    None where it is smallest at an end.
    """
    if c0 * (c0 + c1 + c2) <= 0.0 or c2 == 0.0:
        return None
    u = -c1 / (2.0 * c2)
    return (u, c0 + (c1 + c2 * u) * u) if 0.0 < u < 1.0 and c0 * c2 > 0.0 else None
