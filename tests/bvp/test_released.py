"""Whether a folded ring stays folded when released: `der.bvp.released`, without a rod."""

import math
from functools import cache

import numpy as np
import pytest
from boundary_value import path
from scipy.optimize import brentq
from shapes import scene

import der
from der.bvp.collocation import collocation
from der.bvp.released import classes, index_free, planar, planar_shape, stiffnesses
from der.bvp.sectors import sector
from der.bvp.solve import solve_with_points

OBTUSE = der.triangle(2 * math.pi / 3, 1 / 15)
QUARTER, HALF = "quarter", "half"


@cache
def folded(ring, h_over_t, nu=0.3, part="auto"):
    """The folded state of a ring, on a mesh for an error of 1e-10."""
    asked = scene(ring, h_over_t, nu, sector=part, save_at=())
    _, points = solve_with_points(asked, tolerance=1e-10)
    state = next(one.solution for one in points if one.solution.gamma == math.pi)
    return planar(collocation(sector(asked)), state)


def threshold(ring, low, high, nu=0.3, part="auto"):
    """The h/t between two at which the softest class of motions loses its stiffness."""

    def least(h_over_t):
        return min(stiffnesses(folded(ring, h_over_t, nu, part)))

    return brentq(least, low, high, xtol=1e-10)


def of_circle(h_over_t, nu):
    """Zero where the released three-covered circle loses its stability (truth.md)."""
    section = der.rectangular_section(h_over_t, nu)
    alpha, beta = section.alpha, section.beta
    return 4 * alpha**2 - 6 * alpha + 5 * beta - 6 * alpha * beta


@pytest.mark.parametrize("nu", [0.0, 0.2, 0.3])
@pytest.mark.parametrize("part", [QUARTER, HALF])
def test_threshold_of_the_circle_is_the_closed_form(nu, part):
    """To 1e-8; h/t = 2.09629, 2.82236, 3.46993. Both classes that meet there vanish."""
    exact = brentq(of_circle, 2.0, 4.0, args=(nu,), xtol=1e-12)
    assert threshold(der.circle(), exact - 0.03, exact + 0.04, nu, part) == pytest.approx(
        exact, abs=1e-8
    )
    assert np.sum(np.abs(stiffnesses(folded(der.circle(), exact, nu, part))) < 1e-8) == 2


@pytest.mark.parametrize(("h_over_t", "index"), [(1.6, 2), (3.4, 2), (3.5, 0), (8.0, 0)])
def test_index_of_the_folded_circle(h_over_t, index):
    """2 up to 3.469928, 0 above, by the determinant of each Fourier mode (truth.md)."""
    for part in (QUARTER, HALF):
        assert index_free(folded(der.circle(), h_over_t, part=part)) == index


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("part", [QUARTER, HALF])
def test_threshold_of_an_ellipse_is_that_of_its_bending(axis, part):
    """h/t = 3.636062227: where the slope of a bent ring vanishes at pi (truth_next.md)."""
    if axis == "y":
        ring = der.ellipse(0.9, "y")  # one of 0.6 is not folded by twisting about y
        assert threshold(ring, 3.4, 3.6, part=part) == pytest.approx(3.477113, abs=1e-6)
    else:
        ring = der.ellipse(0.6)
        assert threshold(ring, 3.5, 3.8, part=part) == pytest.approx(3.636062227, abs=1e-8)


@pytest.mark.parametrize(
    ("ring", "low", "high", "exact"),
    [
        (OBTUSE, 6.0, 6.2, 6.0782),
        (der.triangle(math.pi / 3, 0.9 * math.sqrt(3) / 6), 5.0, 5.2, 5.1005),
        (der.rectangle(0.2, 0.2), 2.6, 2.8, 2.7316),
        (der.rectangle(0.6, 0.3), 3.2, 3.4, 3.2834),
    ],
)
def test_thresholds_are_those_of_the_rod(ring, low, high, exact):
    """Those of `scenarios.folded_stability`, extrapolated from 128 and 256 edges, or 64 and 128."""
    assert threshold(ring, low, high) == pytest.approx(exact, abs=2e-4)


@pytest.mark.parametrize(
    ("ring", "h_over_t", "index"),
    [
        (der.ellipse(0.6), 3.0, 1),
        (der.ellipse(0.6), 3.7, 0),
        (OBTUSE, 4.0, 1),
        (der.rectangle(0.2, 0.2), 1.5, 2),
        (der.triangle(math.radians(51.0), 0.1), 4.0, 2),
    ],
)
def test_index_of_released_rings(ring, h_over_t, index):
    """As `der.fold` counts it, and scenarios/stability_beyond_symmetry.py; see FINDINGS.md."""
    record = path(ring, h_over_t)
    assert record.at_pi.index_free == index
    assert record.mode.stable_free is (index == 0)


def test_index_changes_where_the_stiffness_of_its_class_vanishes():
    """1e-6 below the threshold the released ellipse opens, 1e-6 above it does not."""
    ring = der.ellipse(0.6)
    at = threshold(ring, 3.5, 3.8)
    assert [index_free(folded(ring, at + d)) for d in (-1e-6, 1e-6)] == [1, 0]


@pytest.mark.parametrize("part", [QUARTER, HALF])
@pytest.mark.parametrize("h_over_t", [2.0, 3.2833, 3.2835, 3.5])
def test_the_first_class_has_the_slope_for_its_stiffness(h_over_t, part):
    """Against turning the grips, all else relaxed; below h/t = 3.2834 its index has that turning.

    A quarter's energy has the derivative M by gamma, the turning of its grip; a half's by 2 gamma,
    that of its one grip against the other. The matrix is that of the second derivatives, twice.
    """
    ring = der.rectangle(0.6, 0.3)
    state, slope = folded(ring, h_over_t, part=part), path(ring, h_over_t).at_pi.slope
    first, *others = classes(state)
    turning = len(state.h) - (part == HALF)  # w2 at the last grip; a half's first one is held
    left = np.delete(np.arange(len(first.matrix)), turning)
    held = first.matrix[np.ix_(left, left)]
    (sign, size), (own, reference) = map(np.linalg.slogdet, (first.matrix, held))
    stiffness = sign * own * math.exp(size - reference)
    assert stiffness == pytest.approx((1 if part == HALF else 2) * slope, abs=1e-6)
    assert first.index == (slope < 0.0)
    if h_over_t > 3.0:  # the slope's threshold is the only one nearby
        assert [one.index for one in others] == [0] * len(others)
        assert index_free(state) == (slope < 0.0)


def test_index_of_random_rings_is_that_of_the_rod():
    """Rings of every family: the two second variations share no line.

    So is that of the planar rod, without a path.
    """
    draw = np.random.default_rng(3)
    for ring in rings(draw):
        record = path(ring, 2.0 + 4.0 * draw.random())
        section = der.Section(**record.section)
        at_pi = der.fold(der.Scene(ring, section, n_edges=96, self_crossings=False)).at_pi
        assert record.mode.foldable
        assert record.at_pi.index_free == at_pi.index_free
        assert index_free(planar_shape(ring, section)) == at_pi.index_free


def rings(draw):
    """Rings that fold into one shape alone, two of each family."""
    for _ in range(2):
        yield der.ellipse(0.5 + 0.5 * draw.random())
        yield der.ellipse(0.85 + 0.15 * draw.random(), "y")
        b = 0.3 + 0.7 * draw.random()
        yield der.rectangle(b, b * (0.4 + 0.6 * draw.random()))
        yield der.rectangle(1.0, 0.1 + 0.9 * draw.random())
        yield der.triangle(math.radians(57.0 + 63.0 * draw.random()), 0.05 + 0.08 * draw.random())


def test_the_planar_rod_leads_to_the_same_threshold():
    """Without a path: squares stay folded at h/t = 4 from r/a = 0.8967 on (FINDINGS.md, 7).

    And a triangle, which is bent by a force, from the h/t of the path's folded state.
    """

    def least(ring, h_over_t):
        return min(stiffnesses(planar_shape(ring, der.rectangular_section(h_over_t))))

    square = brentq(lambda r: least(der.rectangle(1.0, r), 4.0), 0.85, 0.95, xtol=1e-6)
    assert square == pytest.approx(0.8967, abs=1e-4)
    obtuse = brentq(lambda h_over_t: least(OBTUSE, h_over_t), 6.0, 6.2, xtol=1e-10)
    assert obtuse == pytest.approx(threshold(OBTUSE, 6.0, 6.2), abs=1e-7)
