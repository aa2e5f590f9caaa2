"""Folded shapes of the reduced planar rod: closed forms, equilibrium, and the twisted ring's end.

Equations (B.x) are those of the paper's Appendix B.
"""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

import der
from der.bvp.planar.folded_half import bent_by_force, uniform_bending
from der.bvp.planar.folded_shape import folded

RECTANGLES = [(0.2, 0.1), (0.6, 0.3), (1.0, 0.1), (0.5, 0.5)]
TRIANGLES = [(30, 0.033), (45, 0.2), (60, 0.05), (60, 0.2), (75, 0.033), (120, 1 / 30)]


def triangle(degrees, r):
    return der.triangle(np.radians(degrees), r)


def inscribed(degrees):
    return np.tan(np.pi / 4 - np.radians(degrees) / 4) / 2


def b8(s, b, r):
    """(r2, r3) by Eq. (B.8) at arc lengths s of the first quarter; a = 1 is the first straight."""
    x, c1, c2 = s / r, 1 / r - 1, b / r - 1
    k = np.pi / (c1 + np.pi / 2 + c2)
    end = k * (c1 + np.pi / 2) + np.pi / 2
    both = k * (k + 1)
    branch = [x < c1, x < c1 + np.pi / 2]
    r2 = [
        np.cos(k * x) / k + (np.cos(end) - np.cos(k * c1)) / both,
        np.cos(k * x + x - c1) / (k + 1) + np.cos(end) / both,
    ]
    r3 = [
        -np.sin(k * x) / k,
        -np.sin(k * x + x - c1) / (k + 1) - np.sin(k * c1) / both,
    ]
    last = np.cos(k * x + np.pi / 2) / k
    last3 = -np.sin(k * x + np.pi / 2) / k + (np.sin(end) - np.sin(k * c1)) / both
    return r * np.select(branch, r2, last), r * np.select(branch, r3, last3)


# --- Rings of D2 symmetry --------------------------------------------------------------------


def test_circle_folds_into_a_circle_of_a_third():
    """k = 3 everywhere, three times around; to rounding."""
    shape = folded(der.circle(), 120)
    assert_allclose(shape.curvature, 3.0, atol=1e-13)
    assert_allclose(shape.points[:40], shape.points[40:80], atol=1e-14)
    assert_allclose(np.ptp(shape.points, axis=0), 2 / 3, atol=1e-14)


def test_circle_of_any_natural_curvature_folds_into_the_same():
    """k_d makes up for what the natural curvature lacks."""
    assert_allclose(folded(der.circle(-0.5)).points, folded(der.circle()).points, atol=1e-14)


@pytest.mark.parametrize(("b", "r"), RECTANGLES)
def test_rectangle_is_the_closed_form(b, r):
    """Eq. (B.8), all three branches, to rounding.

    There the ring starts at q2 = 1, r3' = -1, at the middle of a side of half-length a, and r2 = 0
    at the quarter's end; ours at r2' = 1 in the middle of that side.
    """
    ring = der.rectangle(b, r)
    n = 2000
    s = np.arange(n // 4 + 1) * ring.length / n
    ours = folded(ring, n).points[: n // 4 + 1]
    r2, r3 = b8(s, b, r)
    assert s[1] < 1 - r
    assert s[-2] > 1 - r + r * np.pi / 2 or b == r
    assert_allclose(ours[:, 0], -r3, atol=1e-13)
    assert_allclose(np.abs(ours[:, 1] - ours[0, 1]), np.abs(r2 - r2[0]), atol=1e-13)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_ellipse_solves_the_initial_value_problem(axis):
    """Eqs. (B.2)-(B.4) by a Runge-Kutta method at its tightest tolerance."""
    b = 0.6
    ring = der.ellipse(b, axis)
    across, along = (1.0, b) if axis == "x" else (b, 1.0)
    k_d = 4 * np.pi / ring.length

    def slope(tau, state):
        speed = np.hypot(across * np.cos(tau), along * np.sin(tau))
        k = across * along / speed**3 + k_d
        return speed * np.array([k, np.cos(state[0]), np.sin(state[0])])

    shape = folded(ring, 400)
    quarter = solve_ivp(slope, (0, np.pi / 2), np.zeros(3), "DOP853", rtol=3e-14, atol=1e-14)
    assert_allclose(quarter.y[0, -1], shape.angle[100], rtol=1e-12)
    assert_allclose(quarter.y[1:, -1], shape.points[100] - shape.points[0], atol=1e-12)


@pytest.mark.parametrize(
    "ring",
    [der.ellipse(0.5), der.rectangle(0.2, 0.1), der.rectangle(1.0, 0.1), der.circle()],
    ids=str,
)
def test_d2_rings_need_no_force(ring):
    """The half-ring problem, solved with its force, finds f = 0 and k_d = 4 pi/L."""
    general, special = bent_by_force(ring), uniform_bending(ring)
    assert general.force == pytest.approx(0.0, abs=1e-10)
    assert general.bending_start == pytest.approx(special.bending_start, rel=1e-12)
    assert special.bending_start == pytest.approx(4 * np.pi / ring.length, rel=1e-14)
    assert_allclose(general.knot_place[-1], special.knot_place[-1], atol=1e-12)


def test_folding_does_not_know_the_twisting_axis():
    """About y the folded ellipse is that about x, turned and started elsewhere."""
    x, y = folded(der.ellipse(0.7), 400).points, folded(der.ellipse(0.7, "y"), 400).points
    turned = np.column_stack([y[:, 1], -y[:, 0]])
    assert_allclose(np.roll(turned, 100, axis=0), x, atol=1e-13)


# --- Rings of C2 symmetry --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degrees", "r", "k_start", "k_end", "height"),
    [
        (60, np.sqrt(3) / 12, 9.3105813453, 6.5277828347, 0.47900900682),
        (90, 1 / 30, 9.3307630095, 31.033529160, 0.64060949460),
    ],
)
def test_twisted_triangles_end_in_the_planar_shape(degrees, r, k_start, k_end, height):
    """Curvature at both grips and their distance at gamma = pi, M = 0, h/t = 4.

    From the three-dimensional boundary-value problem followed from gamma = 0 by AUTO-07p; its
    meshes agree to 7e-10 and 4e-8.
    """
    n = 960
    shape = folded(triangle(degrees, r), n)
    assert shape.curvature[0] == pytest.approx(k_start, rel=2e-8)
    assert shape.curvature[n // 2] == pytest.approx(k_end, rel=2e-8)
    assert np.ptp(shape.points[[0, n // 2], 1]) == pytest.approx(height, rel=2e-8)


@pytest.mark.parametrize(("degrees", "r"), TRIANGLES)
def test_triangle_solves_the_boundary_value_problem(degrees, r):
    """Runge-Kutta integration of (*) arrives at 3 pi, on the axis."""
    ring = triangle(degrees, r)
    half = bent_by_force(ring)
    ends = [0.0, *[s for s in ring.breaks if s < ring.length / 2 - 1e-12], ring.length / 2]
    state = np.array([0.0, half.bending_start, 0.0, 0.0])
    for first, last in pairwise(ends):
        natural = float(ring.curvature((first + last) / 2))

        def slope(s, y, natural=natural):
            return [natural + y[1], half.force * np.sin(y[0]), np.cos(y[0]), np.sin(y[0])]

        state = solve_ivp(slope, (first, last), state, "DOP853", rtol=3e-14, atol=1e-14).y[:, -1]
    assert state[0] == pytest.approx(3 * np.pi, abs=1e-10)
    assert state[2] == pytest.approx(0.0, abs=1e-10)
    assert state[3] == pytest.approx(half.knot_place[-1].imag, abs=1e-10)


def test_triangle_that_is_a_circle_needs_no_force():
    """r = R_C: the natural curvature is 1/r, the folded 3/r."""
    r = inscribed(75)
    shape = folded(triangle(75, r))
    assert shape.force == pytest.approx(0.0, abs=1e-9)
    assert_allclose(shape.curvature, 3 / r, rtol=1e-11)


def test_force_of_nearly_circular_triangles_grows_with_their_distance_from_the_circle():
    """A small departure from the circle is a linear problem: twice as far, twice the force."""
    r = inscribed(90)
    far, near = (folded(triangle(90, share * r)).force for share in (1 - 2e-4, 1 - 1e-4))
    assert far / near == pytest.approx(2.0, rel=1e-3)


@pytest.mark.parametrize("degrees", [30, 52, 60, 85, 120])
@pytest.mark.parametrize("share", [0.0, 0.4, 0.8, 1.0])
def test_every_triangle_closes(degrees, share):
    """Over the whole of figure 9: net turning 6 pi, both grips on the axis, to 1e-12."""
    shape = folded(triangle(degrees, 0.033 + share * (inscribed(degrees) - 0.033)), 240)
    assert shape.closure_error < 1e-12
    assert shape.turning == pytest.approx(6 * np.pi, abs=1e-11)
    assert_allclose(shape.points[1:, 0], -shape.points[:0:-1, 0], atol=1e-12)


def test_profile_folds_like_the_shape_it_describes():
    """A triangle given by its curvature along the arc."""
    ring = triangle(80, 0.1)
    s, k = (np.array(v) for v in zip(*_knots(ring), strict=True))
    shape, same = folded(der.profile(s, k), 240), folded(ring, 240)
    assert_allclose(shape.points, same.points, atol=1e-10)
    assert shape.force == pytest.approx(same.force, rel=1e-9)


def _knots(ring):
    outline = ring.outline
    for i, (start, end) in enumerate(
        zip(outline.curvature_start, outline.curvature_end, strict=True)
    ):
        yield outline.knots[i], start
        yield outline.knots[i + 1], end


# --- Bad input -------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [0, 10, 13, 24.0, True, "24", None])
def test_n_is_an_even_whole_number(n):
    with pytest.raises(ValueError, match="n must be an even integer >= 12"):
        folded(der.circle(), n)


def test_ring_is_a_ring():
    with pytest.raises(ValueError, match=r"ring must be a der\.Ring, got 'circle'"):
        folded("circle")
