"""Roots of functions that are dear to evaluate: found, and found with few evaluations."""

import math

import numpy as np
import pytest

from der.bvp.roots import rate_of_cubic, root, slowest, turn_of

FUNCTIONS = {
    "cubic": (lambda s: (s - 0.3) * (s * s + 1.0), 0.3),
    "falling": (lambda s: 1.0 - math.exp(5.0 * (s - 0.7)), 0.7),
    "steep at one end": (lambda s: (s - 1e-6) / (s + 1e-6), 1e-6),
    "flat at the root": (lambda s: (s - 0.6) ** 3, 0.6),
    "a jump": (lambda s: 1.0 if s > 0.123456789 else -1.0, 0.123456789),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("guess", [math.nan, 0.5, -3.0])
def test_root_is_found_between_unequal_signs(name, guess):
    """Known roots, to 1e-9 of the interval, whatever the guess, in a number of steps that ends.

    Where interpolation is of no use every fourth step halves the interval at the least: 1e-10 is
    34 halvings.
    """
    f, expected = FUNCTIONS[name]
    places = []

    def counted(s):
        places.append(s)
        return f(s)

    found = root(counted, 0.0, 1.0, guess)
    assert found == pytest.approx(expected, abs=1e-9)
    assert found in places
    assert len(places) <= 140


def test_root_of_a_smooth_function_takes_few_evaluations():
    """Two at the ends, and inverse interpolation's 1e-2, 1e-4, 1e-8, 1e-16 from a good guess."""
    places = []

    def f(s):
        places.append(s)
        return math.sin(s - 0.4) + 0.1 * (s - 0.4) ** 2

    root(f, 0.0, 1.0, 0.41)
    assert len(places) <= 6


@pytest.mark.parametrize("coefficients", [(1.0, -3.0, 1.0), (-0.2, 0.1, 1.5), (1.0, -2.0, 0.0)])
def test_turn_of_a_cubic_is_where_its_rate_vanishes(coefficients):
    """The rate at both ends and the jump give back the rate, whose root in (0, 1) numpy knows."""
    c0, c1, c2 = coefficients
    jump = c0 + c1 / 2.0 + c2 / 3.0
    assert rate_of_cubic(jump, c0, c0 + c1 + c2) == pytest.approx(coefficients, abs=1e-14)
    inside = [r.real for r in np.roots([c2, c1, c0]) if abs(r.imag) < 1e-12 and 0.0 < r.real < 1.0]
    assert turn_of(c0, c1, c2) == pytest.approx(inside[0], abs=1e-14)


def test_slowest_place_is_where_the_rate_turns_between_equal_signs():
    """Of rates (u - 1/2)^2 + c, and of what has its largest there, or turns at no place inside."""
    assert slowest(0.25 - 0.01, -1.0, 1.0) == pytest.approx((0.5, -0.01))
    assert slowest(-0.25 - 0.1, 1.0, -1.0) == pytest.approx((0.5, -0.1))
    assert slowest(1.0, -3.0, 1.0) is None  # unequal signs at the ends
    assert slowest(1.0, 0.0, 0.0) is None
    assert slowest(1.0, 1.0, -1.0) is None
    assert slowest(1.0, 1.0, 1.0) is None
