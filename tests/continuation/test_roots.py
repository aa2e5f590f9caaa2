"""Roots of functions that are expensive to evaluate, found with few evaluations; cubics."""

import math

import numpy as np
import pytest

from der.continuation.roots import (
    brent,
    find_root,
    least_rate,
    rate_of_cubic,
    root_of_rate,
    smooth_root,
)

FUNCTIONS = {
    "cubic": (lambda s: (s - 0.3) * (s * s + 1.0), 0.3),
    "falling": (lambda s: 1.0 - math.exp(5.0 * (s - 0.7)), 0.7),
    "steep at one end": (lambda s: (s - 1e-6) / (s + 1e-6), 1e-6),
    "infinitely steep": (lambda s: math.copysign(abs(s - 0.3) ** 0.3, s - 0.3), 0.3),
    "jump": (lambda s: 1.0 if s > 0.123456789 else -1.0, 0.123456789),
    "jump beside the root": (lambda s: s - 0.3 if s <= 0.3 else 0.5, 0.3),
    "root at an end": (lambda s: s - 1.0, 1.0),
}


def counted(f):
    """``f``, and the list of places at which it was evaluated."""
    places = []

    def g(s):
        places.append(s)
        return f(s)

    return g, places


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("guess", [None, 0.5, -3.0])
def test_root_is_found_between_unequal_signs(name, guess):
    """Known roots, to 1e-11, whatever the guess; bisection alone would take 42 evaluations.

    Brent's method takes over where interpolation does not gain, and bisects at most every other
    time.
    """
    f, expected = FUNCTIONS[name]
    g, places = counted(f)
    found = find_root(g, 0.0, 1.0, guess=guess)
    assert found == pytest.approx(expected, abs=1e-11)
    assert found in places
    assert len(places) == len(set(places)) <= 90


def test_root_of_higher_order_is_found_to_its_rounding():
    """(s - 0.6)^3 is below 1e-300 only within 1e-100, but 1e-15 of its slopes within 1e-5."""
    assert find_root(lambda s: (s - 0.6) ** 3, 0.0, 1.0) == pytest.approx(0.6, abs=1e-4)


def test_brent_agrees_with_scipy():
    """The same method: an independent implementation finds the same roots, as fast but for two."""
    from scipy.optimize import brentq

    for name, (f, expected) in FUNCTIONS.items():
        g, places = counted(f)
        found = brent(g, 0.0, 1.0)
        theirs, report = brentq(f, 0.0, 1.0, xtol=1e-12, rtol=8.9e-16, full_output=True)
        assert found == pytest.approx(theirs, abs=2e-12), name
        assert found == pytest.approx(expected, abs=1e-12), name
        assert len(places) <= report.function_calls + 2, name


def test_root_needs_unequal_signs():
    """The message names both values and their places."""
    with pytest.raises(ValueError, match="unequal signs, got 1 at 0 and 2 at 1"):
        find_root(lambda s: 1.0 + s, 0.0, 1.0)


@pytest.mark.parametrize("guess", [None, 0.5, 0.7, 3.0])
def test_root_of_a_smooth_function(guess):
    """cos x = x at 0.739085133215..., from wherever in between it begins, in few places.

    A guess outside is refused, and Brent's method takes over.
    """
    f, places = counted(lambda x: math.cos(x) - x)
    found = smooth_root(f, 0.0, 1.0, guess=guess)
    assert len(places) <= 10
    assert found == (None if guess == 3.0 else pytest.approx(0.7390851332151607, abs=1e-12))
    assert find_root(f, 0.0, 1.0, guess=guess) == pytest.approx(0.7390851332151607, abs=1e-12)


def test_good_guess_saves_evaluations():
    """Two at the ends, and inverse interpolation's 1e-2, 1e-4, 1e-8, 1e-16 from a good guess."""
    f, places = counted(lambda s: math.sin(s - 0.4) + 0.1 * (s - 0.4) ** 2)
    find_root(f, 0.0, 1.0, guess=0.41)
    assert len(places) <= 6


def test_rounding_in_the_values_costs_no_evaluation_more():
    """Errors of 1e-13 in the values, whatever they are, do not make a function look rough.

    Sixteen roundings of e^x = 2; the root is good to their size.
    """
    for seed in range(16):
        random = np.random.default_rng(seed)
        f, places = counted(
            lambda x, random=random: math.expm1(x) - 1.0 + 1e-13 * random.uniform(-1.0, 1.0)
        )
        assert smooth_root(f, 0.0, 1.0) == pytest.approx(math.log(2.0), abs=1e-12)
        assert len(places) <= 8


@pytest.mark.parametrize("coefficients", [(1.0, -3.0, 1.0), (-0.2, 0.1, 1.5), (1.0, -2.0, 0.0)])
def test_cubic_turns_where_its_rate_is_zero(coefficients):
    """The rate at both ends and the jump give back the rate, whose root in (0, 1) numpy knows."""
    c0, c1, c2 = coefficients
    jump = c0 + c1 / 2.0 + c2 / 3.0
    assert rate_of_cubic(jump, c0, c0 + c1 + c2) == pytest.approx(coefficients, abs=1e-14)
    inside = [r.real for r in np.roots([c2, c1, c0]) if abs(r.imag) < 1e-12 and 0.0 < r.real < 1.0]
    assert root_of_rate(c0, c1, c2) == pytest.approx(inside[0], abs=1e-14)


def test_least_rate_lies_between_ends_of_equal_sign():
    """Of rates (u - 1/2)^2 + c, and of what is largest there, or smallest at an end."""
    assert least_rate(0.25 - 0.01, -1.0, 1.0) == pytest.approx((0.5, -0.01))
    assert least_rate(-0.25 - 0.1, 1.0, -1.0) == pytest.approx((0.5, -0.1))
    assert least_rate(1.0, -3.0, 1.0) is None  # unequal signs at the ends
    assert least_rate(1.0, 0.0, 0.0) is None
    assert least_rate(1.0, 1.0, -1.0) is None
    assert least_rate(1.0, 1.0, 1.0) is None
