"""Cross-sections: the torsion series and its limits."""

import math

import pytest

from der.geometry.section import Section, rectangular_section, section


def torsion_series(h_over_t: float, n_terms: int = 20_000) -> float:
    """Lambda of Eq. (A.16), summed as it stands; the tail is below 1e-18."""
    terms = (math.tanh(math.pi * odd / 2 * h_over_t) / odd**5 for odd in range(1, 2 * n_terms, 2))
    return 1 - 192 / math.pi**5 / h_over_t * math.fsum(terms)


@pytest.mark.parametrize(("h_over_t", "alpha"), [(4, 0.7715693320), (1, 1.5412666625)])
def test_alpha_is_that_of_truth_md(h_over_t, alpha):
    """Alpha of the circular ring to the ten decimals given."""
    assert rectangular_section(h_over_t).alpha == pytest.approx(alpha, abs=5e-11)


def test_beta_is_alpha_times_the_ratio_squared():
    """Eq. (A.16): EI2/EI1 = (h/t)^2."""
    bar = rectangular_section(4)
    assert bar.beta == pytest.approx(16 * bar.alpha, rel=1e-15)


@pytest.mark.parametrize("h_over_t", [1.0, 1.5076, 3.47, 20.0, 100.0])
def test_series_is_converged(h_over_t):
    """Eq. (A.16) by brute force, 20,000 terms; 1e-14 is the rounding of 1 - 0.58 at h = t."""
    alpha = 1.3 / 2 / torsion_series(h_over_t)
    assert rectangular_section(h_over_t).alpha == pytest.approx(alpha, rel=1e-14)


def test_flat_bar_agrees_with_the_series():
    """Eq. (A.16) at h/t = 0.05, where the series cancels to lambda = 0.0024: hence 1e-11."""
    bar = rectangular_section(0.05)
    assert bar.alpha == pytest.approx(1.3 / 2 / torsion_series(0.05), rel=1e-11)


@pytest.mark.parametrize("h_over_t", [0.05, 0.5, 0.99])
def test_turning_the_bar_on_its_side_exchanges_the_ratios(h_over_t):
    """J is the same for (h, t) and (t, h), so EI1 and EI2 change places."""
    bar, turned = rectangular_section(h_over_t), rectangular_section(1 / h_over_t)
    assert (bar.alpha, bar.beta) == pytest.approx((turned.beta, turned.alpha), rel=1e-14)


def test_thin_strip_has_a_torsion_constant_of_a_third():
    """J -> h t^3/3 (1 - 0.630249 t/h) for a thin strip (Timoshenko and Goodier)."""
    alpha = rectangular_section(100).alpha
    assert 1.3 / 2 / alpha == pytest.approx(1 - 0.630249 / 100, abs=1e-8)


def test_poisson_ratio_enters_as_one_plus_nu():
    """E = 2 G (1 + nu) in Eq. (A.16)."""
    ratio = rectangular_section(3, nu=0.5).alpha / rectangular_section(3, nu=0.0).alpha
    assert ratio == pytest.approx(1.5, rel=1e-15)


def test_rectangular_section_remembers_its_shape():
    """The record names h_over_t and nu beside alpha and beta."""
    bar = rectangular_section(2, nu=0.2)
    assert (bar.h_over_t, bar.nu) == (2.0, 0.2)


def test_section_of_given_ratios_has_no_shape():
    """`section` takes alpha and beta as they are."""
    assert section(0.9, 2.5) == Section(0.9, 2.5, h_over_t=None, nu=None)


def test_section_is_frozen():
    """The statement of a problem does not change."""
    with pytest.raises(AttributeError):
        section(1, 2).alpha = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rectangular_section(math.nan), "h_over_t must be a finite number > 0, got nan"),
        (lambda: rectangular_section(-1), "h_over_t must be a finite number > 0, got -1"),
        (lambda: rectangular_section(math.inf), "h_over_t must be a finite number > 0, got inf"),
        (lambda: rectangular_section("4"), "h_over_t must be a finite number > 0, got '4'"),
        (lambda: rectangular_section(True), "h_over_t must be a finite number > 0, got True"),
        (lambda: rectangular_section(10**400), "h_over_t must be a finite number > 0, got 1000"),
        (lambda: rectangular_section(1e-200), "alpha must be a finite number > 0, got inf"),
        (lambda: rectangular_section(4, nu=0.51), "nu must be a number in (-1, 0.5], got 0.51"),
        (lambda: rectangular_section(4, nu=-1), "nu must be a number in (-1, 0.5], got -1"),
        (
            lambda: section(1e-6, 2e4),
            "alpha must be such that alpha, beta and 1 are within a factor",
        ),
        (
            lambda: section(1.0, 1e-11),
            "beta must be such that alpha, beta and 1 are within a factor",
        ),
        (lambda: section(0, 1), "alpha must be a finite number > 0, got 0"),
        (lambda: section(1, None), "beta must be a finite number > 0, got None"),
        (lambda: Section(1, 1, nu=2), "nu must be a number in (-1, 0.5], got 2"),
    ],
)
def test_bad_input_is_named(make, message):
    """A ValueError names the argument, what is allowed and the value."""
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make()
    assert str(error.value).startswith(message)
