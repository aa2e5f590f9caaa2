"""The rod engine against closed forms of circular rings, free and gripped.

Units: radius of the ring and GJ are 1; alpha = EI1/GJ, beta = EI2/GJ, Poisson's ratio 0.3.
"""

import numpy as np
import pytest
from rods import (
    covered_circle,
    dense,
    first_change,
    index_of,
    lifted,
    on_conditions,
    richardson,
    solved,
    three_covered,
    walk,
)
from scipy.optimize import brentq

from der import circle, rectangular_section
from der.rod.gripped_ring import free_ring, sector
from der.rod.stability import raw_index

MESHES = (64, 128, 256)


# --- free of grips --------------------------------------------------------------------------


def covered_index(n, alpha, beta, kappa0):
    """Index of the n-covered circle with natural curvature ``kappa0``, free of grips.

    Turning the frames by w2 about d2 and w3 about d3 costs, to second order and per length,

        [beta (w2' - n w3)^2 + (w3' + n w2)^2 - c (w2 w3' - w2' w3 + n w2^2 + n w3^2)]/2

    with c = alpha (n - kappa0) the moment. w2 = A sin ms, w3 = -B cos ms and their shifts by a
    quarter wave give each eigenvalue of one 2 x 2 matrix twice. One of m = n is zero, a rigid
    rotation; the other is its trace 2 n ((1 + beta) n - c). For m = 0 closure rules out w2, and w3
    flips the ring: once. In-plane modes cost alpha w1'^2 and are never negative.
    """
    c = alpha * (n - kappa0)
    index = int(c > beta * n)
    for m in range(1, 40):
        w2, w3 = beta * m * m + n * n - c * n, beta * n * n + m * m - c * n
        both = (beta + 1) * m * n - c * m
        eigenvalues = np.linalg.eigvalsh([[w2, both], [both, w3]])
        if m == n:
            eigenvalues = w2 + w3
        index += 2 * int(np.sum(eigenvalues < 0))
    return index


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("kappa0", [-1.0, 0.5, 1.0, 2.0, 3.0])
def test_index_of_covered_circles(n, kappa0):
    """The index is an integer: at 96 edges it is that of the continuum, away from thresholds.

    Fourier modes of the second variation, see `covered_index`. The indices reach from 0 to 19.
    """
    for h_over_t in (0.7, 1.3, 1.7, 2.5, 4.0, 7.0):
        bar = rectangular_section(h_over_t)
        body, state = covered_circle(n, kappa0, (bar.alpha, bar.beta, 1.0), 96)
        held = free_ring(body)
        expected = covered_index(n, bar.alpha, bar.beta, kappa0)
        assert index_of(body, held, state) == expected, f"h/t = {h_over_t}"


def three_covered_threshold(n_edges, kappa0=1.0, **measure):
    """Find the h/t at which the softest mode of the three-covered circle has no stiffness.

    Eigenvalues of the dense matrix, so this does not rest on the factorisation.
    """

    def softest(h_over_t):
        bar = rectangular_section(h_over_t)
        stiffness = (bar.alpha, bar.beta, 1.0)
        body, state = covered_circle(3, kappa0, stiffness, n_edges, **measure)
        return on_conditions(*dense(body, free_ring(body), state))[0]

    return brentq(softest, 3.0, 4.5, xtol=1e-9)


def test_threshold_of_the_three_covered_ring():
    """Stable above 4 alpha^2 - 6 alpha + 5 beta - 6 alpha beta = 0: h/t = 3.469928.

    Mode 2 of `covered_index` at n = 3. From 48 and 96 edges 3.2e-4 is left.
    """

    def flexible(h_over_t):
        bar = rectangular_section(h_over_t)
        a, b = bar.alpha, bar.beta
        return 4 * a * a - 6 * a + 5 * b - 6 * a * b

    exact = brentq(flexible, 3.0, 4.0, xtol=1e-12)
    assert exact == pytest.approx(3.469928, abs=5e-7)
    found = richardson(*(three_covered_threshold(n) for n in (48, 96)))
    assert found == pytest.approx(exact, abs=1e-3)


@pytest.mark.parametrize(("n_edges", "threshold"), [(48, 4.2045), (96, 3.6223)])
def test_threshold_with_the_tangent_measure(n_edges, threshold):
    """A stranger's polygon with curvature 2 tan(phi/2) (Bergou et al. 2008), to all its digits.

    Its natural curvature is the same measure of the regular polygon of n edges, phi = 2 pi/n.
    """
    kappa0 = n_edges / np.pi * np.tan(np.pi / n_edges)
    found = three_covered_threshold(n_edges, kappa0, measure="tangent")
    assert found == pytest.approx(threshold, abs=5e-5)


def flat_ring_threshold(stable, unstable):
    """kappa0 at which the flat ring of alpha = 0.9, beta = 2.5 loses its stability."""

    def critical(n_edges):
        def index(kappa0):
            body, state = covered_circle(1, kappa0, (0.9, 2.5, 1.0), n_edges)
            return index_of(body, free_ring(body), state)

        assert index(stable) == 0
        return first_change(index, stable, unstable)

    return richardson(*map(critical, (32, 64, 128)))


def test_overcurved_ring_buckles():
    """A flat ring buckles to a saddle where (1 + y)(beta + y) = 4 beta, y = alpha (kappa0 - 1).

    p^2 = 4 at n = 1, mode 2 (see `covered_index`); kappa0 = 8/3 at alpha = 0.9, beta = 2.5. What is
    left after Romberg's scheme is 4e-8.
    """
    assert flat_ring_threshold(1.0, 3.5) == pytest.approx(8 / 3, abs=1.2e-7)


def test_reversely_curved_ring_flips():
    """A flat ring turns inside out where alpha (1 - kappa0) = beta: kappa0 = 1 - 2.5/0.9.

    Mode 0 turns all frames by one angle, in which the discrete energy is that of the continuum: the
    tolerance is the bisection's.
    """
    assert flat_ring_threshold(1.0, -2.0) == pytest.approx(1 - 2.5 / 0.9, abs=1e-9)


# --- gripped --------------------------------------------------------------------------------


def folded_slope(alpha, beta):
    """dM/dgamma at the folded state gamma = pi: the linearised rod about three covers.

    The two modes of wave number p and n = 3 that meet the conditions of a quarter; p may be
    imaginary, and every term is even in it.
    """
    n = 3
    A, B = (alpha * (n - 1) - n) / beta, alpha * (n - 1) - beta * n
    p = np.sqrt(complex(A * B))
    d = p * (1 - n / A) / (n * n - p * p)
    slope = beta / (d / np.tan(0.5 * np.pi * p) + 2 / np.pi * ((d * p + 1) / n**2 - d / p))
    assert abs(slope.imag) < 1e-12
    return slope.real


def flat_slope(alpha, beta):
    """dM/dgamma of the flat ring: bending out of plane and twisting of a quarter circle."""
    return 1 / (np.pi / (4 * beta) + np.pi / 4 - 2 / np.pi)


def slopes(h_over_t, folded):
    """Slopes dM/dgamma on three meshes, at gamma = pi (folded) or 0."""
    for n_edges in MESHES:
        piece = sector(circle(), rectangular_section(h_over_t), n_edges)
        start = three_covered(piece) if folded else piece.start
        yield piece.moment(solved(piece.body, piece.held, start).slope)


@pytest.mark.parametrize(
    ("h_over_t", "value"), [(1, 1.518930), (2, 2.808860), (4, 4.708129), (8, 6.017905)]
)
def test_stiffness_of_the_flat_ring(h_over_t, value):
    """1/[pi/(4 beta) + pi/4 - 2/pi], from the linear theory of a curved bar.

    Romberg's scheme leaves 8e-10 of it at h/t = 8.
    """
    bar = rectangular_section(h_over_t)
    exact = flat_slope(bar.alpha, bar.beta)
    assert exact == pytest.approx(value, abs=6e-7)
    assert richardson(*slopes(h_over_t, folded=False)) == pytest.approx(exact, rel=2.5e-9)


@pytest.mark.parametrize(
    ("h_over_t", "value"), [(1, None), (2, -0.647448), (4, 0.0814673), (8, 0.296934)]
)
def test_slope_at_the_folded_state(h_over_t, value):
    """The formula of `folded_slope`; h/t = 1 has an imaginary p.

    Romberg's scheme leaves 7e-9 of it at h/t = 4, where the slope is small.
    """
    bar = rectangular_section(h_over_t)
    exact = folded_slope(bar.alpha, bar.beta)
    if value is not None:
        assert exact == pytest.approx(value, abs=6e-7)
    assert richardson(*slopes(h_over_t, folded=True)) == pytest.approx(exact, rel=2e-8)


@pytest.mark.parametrize("folded", [False, True])
@pytest.mark.parametrize("h_over_t", [1, 2, 4, 8])
def test_slopes_converge_with_the_square_of_the_cell(h_over_t, folded):
    """Order 2, to the 0.004 that the next term makes at 64 edges."""
    bar = rectangular_section(h_over_t)
    exact = (folded_slope if folded else flat_slope)(bar.alpha, bar.beta)
    coarse, fine, _ = slopes(h_over_t, folded)
    assert np.log2((coarse - exact) / (fine - exact)) == pytest.approx(2.0, abs=0.012)


def test_the_folded_circle_is_an_equilibrium_without_moment():
    """Three covers, curvature 3 everywhere: M = 0 and U = 4 pi alpha, on any mesh, to rounding."""
    bar = rectangular_section(4)
    piece = sector(circle(), bar, 32)
    at = solved(piece.body, piece.held, three_covered(piece))
    assert piece.moment(at.moment) == pytest.approx(0.0, abs=1e-13)
    assert piece.copies * at.energy == pytest.approx(4 * np.pi * bar.alpha, rel=1e-14)


def test_holding_the_moment_adds_one_where_the_slope_is_negative():
    """Index with M held = index with gamma held + [dM/dgamma < 0].

    A Schur complement: the load as one more unknown adds an eigenvalue of the sign of dM/dgamma.
    Along h/t = 1.6 and around both its folds, where gamma runs back; integers, from dense
    matrices of the full ring.
    """
    bar = rectangular_section(1.6)
    quarter, full = (sector(circle(), bar, 32, name=name) for name in ("quarter", "full"))
    seen = set()
    for on_path in walk(quarter, 0.25, lambda at: at.state.load > 3.3):
        at = lifted(quarter, on_path.state, full)
        with_angle, with_moment = (
            int(np.sum(on_conditions(*dense(full.body, full.held, at.state, load_free=free)) < 0))
            for free in (False, True)
        )
        assert with_moment == with_angle + (at.slope < 0)
        seen.add((with_angle, with_moment))
    assert seen == {(0, 0), (0, 1), (1, 1)}


def test_the_index_of_the_ring_is_the_sum_over_its_classes():
    """Clamped grips join the arms by the slide alone, and half-turns sort the modes.

    Index of the full ring = that of an arm with the slide free + with the slide held; of a quarter,
    even modes likewise + twice the odd ones. Along h/t = 1 to gamma = 5.4 and back, with indices 0,
    1 and 3; the full ring's from a dense matrix.
    """
    bar = rectangular_section(1.0)
    quarter, half, full = (sector(circle(), bar, 32, name=s) for s in ("quarter", "half", "full"))

    def total(piece, state):
        return sum(
            times * raw_index(piece.body, piece.held, modes, state)
            for times, modes in piece.classes.values()
        )

    loads, seen = [], []

    def came_back(at):
        loads.append(at.state.load)
        return max(loads) > 5.4 and at.state.load < 3.2

    for at in walk(quarter, 0.3, came_back):
        whole = lifted(quarter, at.state, full).state
        expected = int(np.sum(on_conditions(*dense(full.body, full.held, whole)) < 0))
        arm = lifted(quarter, at.state, half).state
        counted = [total(quarter, at.state), total(half, arm), total(full, whole)]
        assert counted == [expected] * 3, f"gamma = {at.state.load}"
        seen.append(expected)
    assert set(seen) == {0, 1, 3}
