"""Tables of Gauss collocation: exact on the polynomials they are made for."""

import math

import numpy as np
import pytest

from der.bvp.gauss import interpolation, rule, top_derivative

STAGES = (1, 2, 3, 4, 5, 6)
ROUNDING = 1e-13


def polynomial(degree: int) -> np.polynomial.Polynomial:
    """A polynomial with coefficients of order one."""
    return np.polynomial.Polynomial(np.random.default_rng(degree).uniform(-1, 1, degree + 1))


@pytest.mark.parametrize("m", STAGES)
def test_weights_are_exact_up_to_degree_2m_minus_1(m):
    """Gauss quadrature of x^k on [0, 1] is 1/(k+1) up to k = 2m - 1, to rounding."""
    table = rule(m)
    k = np.arange(2 * m)
    integrals = table.weights @ table.points[:, None] ** k
    np.testing.assert_allclose(integrals, 1 / (k + 1), rtol=ROUNDING)


@pytest.mark.parametrize("m", STAGES)
def test_weights_are_not_exact_at_degree_2m(m):
    """The error at x^(2m) is (m!)^4 / ((2m+1) (2m)!^2): no rule of m points has a higher degree."""
    table = rule(m)
    error = 1 / (2 * m + 1) - table.weights @ table.points ** (2 * m)
    expected = math.factorial(m) ** 4 / ((2 * m + 1) * math.factorial(2 * m) ** 2)
    assert error == pytest.approx(expected, rel=1e-6, abs=1e-16)


@pytest.mark.parametrize("m", STAGES)
def test_partial_weights_integrate_up_to_the_stages(m):
    """A integrates polynomials of degree m - 1 from 0 to each stage, to rounding."""
    table, p = rule(m), polynomial(m - 1)
    np.testing.assert_allclose(
        table.partial @ p(table.points), p.integ()(table.points), atol=ROUNDING
    )


@pytest.mark.parametrize("m", STAGES)
def test_slopes_invert_the_partial_weights(m):
    """A^-1 gives the slopes at the stages of a polynomial of degree m that is 0 at the left end."""
    table, p = rule(m), polynomial(m)
    rise = p(table.points) - p(0.0)
    np.testing.assert_allclose(table.slope @ rise, p.deriv()(table.points), atol=1e-11)
    np.testing.assert_allclose(table.slope_sum, table.slope.sum(axis=1), atol=ROUNDING)


@pytest.mark.parametrize("m", STAGES)
def test_right_end_follows_from_left_end_and_stages(m):
    """The collocation polynomial, of degree m, at 1 from its values at 0 and at the stages."""
    table, p = rule(m), polynomial(m)
    end = table.first * p(0.0) + table.last @ p(table.points)
    assert end == pytest.approx(p(1.0), abs=1e-12)


@pytest.mark.parametrize("m", STAGES)
def test_halving_keeps_the_polynomial(m):
    """The stages of both halves lie on one polynomial: degree m with the end, m - 1 without."""
    table = rule(m)
    places = np.append(0.5 * table.points, 0.5 + 0.5 * table.points)
    p = polynomial(m)
    values = np.append(p(0.0), p(table.points))
    np.testing.assert_allclose(table.halves @ values, p(places), atol=1e-12)
    p = polynomial(m - 1)
    np.testing.assert_allclose(table.halves_inner @ p(table.points), p(places), atol=1e-12)


def test_interpolation_is_exact_on_polynomials_also_at_its_sites():
    """Lagrange interpolation through k sites reproduces degree k - 1, its own sites included."""
    sites = np.array([0.0, 0.3, 0.35, 0.8, 1.0])
    places = np.append(sites, [-0.2, 0.5, 1.3])
    p = polynomial(4)
    np.testing.assert_allclose(interpolation(sites, places) @ p(sites), p(places), atol=1e-12)


@pytest.mark.parametrize("m", STAGES)
def test_top_derivative_is_that_of_the_highest_power(m):
    """The m-th derivative of a polynomial of degree m is m! times its leading coefficient."""
    points, p = rule(m).points, polynomial(m)
    values = np.append(p(0.0), p(points))
    expected = math.factorial(m) * p.coef[-1]
    assert top_derivative(points) @ values == pytest.approx(expected, rel=1e-9)
