"""The rod engine against closed forms of elastic rods.

Critical loads are bisected on the index and taken to the continuum by Romberg's scheme from three
meshes; what is left is the error in h^6, or the bisection. Tolerances are three times what was
measured.
"""

import numpy as np
import pytest
from rods import (
    E1,
    E2,
    E3,
    MEASURES,
    covered_circle,
    dense,
    derivatives,
    first_change,
    index_of,
    on_conditions,
    richardson,
    solved,
    straight,
    turned_about,
    turned_all,
    turned_rigidly,
    unloaded,
)
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc, jv

from der.kernels.quaternions import rotation
from der.rod.gripped_ring import free_supports
from der.rod.rod import State, discrete_rod, edges
from der.rod.supports import supported
from der.rod.system import RodSystem

COARSE = (16, 32, 64)
FINE = (32, 64, 128)


def by_measure(logarithm, angle, tangent):
    """Parametrisation over the measures of curvature, each with its tolerance."""
    return pytest.mark.parametrize(
        ("measure", "tolerance"), list(zip(MEASURES, (logarithm, angle, tangent), strict=True))
    )


def along_e3(n_cells):
    return turned_about(3, np.zeros(n_cells + 1))


def clamped(rod, **load):
    """A rod clamped at its first edge."""
    return RodSystem(rod, supported(rod, clamped=(0,), **load))


def clamped_clamped(rod, **load):
    """A rod clamped at both ends, the far one sliding along E3."""
    one = np.ones(rod.n_edges)
    conditions = ((one, E1, 0.0), (one, E2, 0.0))
    return RodSystem(rod, supported(rod, clamped=(0, rod.n_edges - 1), held=conditions, **load))


# --- critical loads -------------------------------------------------------------------------


@by_measure(3e-8, 1e-7, 4e-7)
def test_twisted_ring_buckles_at_michells_twist(measure, tolerance):
    """A naturally straight isotropic rod closed to a circle: total twist 2 pi sqrt(3) EI/GJ.

    Michell 1889; Zajac 1962. Two modes, cosine and sine of 2 s, at once: index 0 to 2. The twist is
    put in as natural twist, since for an isotropic rod only the difference of the two counts. One
    more material angle is held, opposite the held frame, to take out the spin of the section.
    """
    GJ = 0.7

    def critical(n):
        def index(total):
            cell = np.full(n, 2 * np.pi / n)
            rest = np.outer(np.full(n, -total / n), E3)
            rod = discrete_rod(cell, rest, (1.0, 1.0, GJ), measure=measure, closed=True)
            ring = RodSystem(rod, free_supports(rod))
            ring.supports.free[n // 2, 2] = False
            circle = unloaded(rod, turned_about(1, cell[0] * np.arange(n)), 3)
            return index_of(ring, solved(ring, circle).state)

        assert (index(15.0), index(16.5)) == (0, 2)
        return first_change(index, 15.0, 16.5)

    exact = 2 * np.pi * np.sqrt(3) / GJ
    assert richardson(*map(critical, FINE)) == pytest.approx(exact, rel=tolerance)


@by_measure(2e-9, 8e-6, 8e-6)
def test_twisted_rod_buckles_at_greenhills_moment(measure, tolerance):
    """Straight, clamped at both ends, no tension: M L = 2 x EI with tan x = x, 8.986819 EI.

    Greenhill 1883; the far end slides along the axis. The mode may be turned about the axis, so the
    index goes from 0 to 2. GJ matters for the angle only. Averaged frames (not "logarithm") weaken
    the bending of a twisted cell by cos(tau/2), which leaves 2.5e-6 after extrapolation.
    """
    GJ = 0.77

    def critical(n):
        rod = straight(n, (1.0, 1.0, GJ), measure=measure)
        shaft = clamped_clamped(rod, turn={n: 1.0})

        def index(moment):
            twist = moment / GJ
            state = unloaded(rod, turned_about(3, twist * np.arange(n + 1) / n), 2, twist)
            at = solved(shaft, state)
            assert at.moment == pytest.approx(moment, rel=1e-12)
            return index_of(shaft, at.state)

        assert (index(8.5), index(9.5)) == (0, 2)
        return first_change(index, 8.5, 9.5)

    exact = 2 * brentq(lambda x: np.sin(x) - x * np.cos(x), 4.0, 4.7, xtol=1e-14)
    assert exact == pytest.approx(8.986819, abs=5e-7)
    assert richardson(*map(critical, FINE)) == pytest.approx(exact, rel=tolerance)


@pytest.mark.parametrize("measure", MEASURES)
def test_clamped_column_buckles_at_eulers_load(measure):
    """Clamped at both ends: P L^2 = 4 pi^2 EI of the softer axis (Euler 1744).

    On a straight rod the measures agree to second order, so that one tolerance serves them all.
    """

    def critical(n):
        rod = straight(n, (1.0, 3.0, 0.5), measure=measure)
        column = clamped_clamped(rod, pull=-E3)

        def index(load):
            return index_of(column, unloaded(rod, along_e3(n), 2, load))

        assert (index(39.0), index(40.0)) == (0, 1)
        return first_change(index, 39.0, 40.0)

    assert richardson(*map(critical, FINE)) == pytest.approx(4 * np.pi**2, rel=2e-10)


@pytest.mark.parametrize("measure", MEASURES)
def test_cantilever_buckles_sideways_at_prandtls_load(measure):
    """Tip load across the strong axis: P L^2 = 4.01260 sqrt(EI_weak GJ) for EI_strong >> EI_weak.

    Prandtl 1899, Michell 1899: J_{-1/4}(P/2) = 0 (in units of the root). The deflection before
    buckling raises the load by a series in EI_weak/EI_strong, here 1/250, 1/500 and 1/1000, whose
    first two terms are taken out by polynomial extrapolation; 3e-8 is left.
    """
    GJ = 0.6

    def critical(ratio, n):
        rod = straight(n, (ratio, 1.0, GJ), measure=measure)
        beam = clamped(rod, pull=E2)

        def index(load):
            at = solved(beam, unloaded(rod, along_e3(n), 0, load))
            return index_of(beam, at.state)

        assert (index(3.0), index(3.2)) == (0, 1)
        return first_change(index, 3.0, 3.2)

    a, b, c = (
        richardson(*(critical(ratio, n) for n in COARSE)) for ratio in (250.0, 500.0, 1000.0)
    )
    exact = 2 * brentq(lambda x: jv(-0.25, x), 1.9, 2.1, xtol=1e-14) * np.sqrt(GJ)
    assert exact == pytest.approx(4.01260 * np.sqrt(GJ), abs=5e-6)
    assert (8 * c - 6 * b + a) / 3 == pytest.approx(exact, rel=8e-8)


# --- large deflections ----------------------------------------------------------------------


def post_buckled(n, measure, load):
    rod = straight(n, (1.0, 3.0, 0.5), measure=measure)
    column = clamped_clamped(rod, pull=-E3)
    s = np.arange(n + 1) / n
    wave = turned_about(1, 0.5 * np.pi * np.sin(2 * np.pi * s))
    return column, unloaded(rod, wave, 2, load)


@by_measure(1e-8, 1e-8, 1e-5)
def test_post_buckled_column_is_shortened_as_the_elastica(measure, tolerance):
    """P L^2 = 16 K^2 EI shortens a clamped column by (2 - 2 E/K) L; m = 1/2: 55.00149, 0.5430534.

    Euler's elastica, four equal quarter waves, m = sin^2 of half the steepest slope (Love 1927,
    art. 263); K, E with parameter m.
    """
    K, E = ellipk(0.5), ellipe(0.5)
    load, shortened = 16 * K**2, 2 - 2 * E / K
    assert load == pytest.approx(55.00149, abs=5e-6)
    assert shortened == pytest.approx(0.5430534, abs=6e-8)

    def shortening(n):
        column, start = post_buckled(n, measure, load)
        return 1 - edges(column.rod, solved(column, start).state).sum(axis=0)[2]

    assert richardson(*map(shortening, FINE)) == pytest.approx(shortened, abs=tolerance)


def cantilever(n, load, **options):
    """Cantilever under the tip load ``load`` along E2, and its tip (3,)."""
    rod = straight(n, (1.0, 3.0, 0.5), **options)
    beam = clamped(rod, pull=E2)
    beam.supports.free[0, 3:] = True  # the clamp holds the frame, not the length
    s = np.arange(n + 1) / n
    start = unloaded(rod, turned_about(1, -np.arctan(0.5 * load) * s * (2 - s)), 0, load)
    at = solved(beam, start)
    return rod, at, edges(rod, at.state).sum(axis=0)


def bisshopp_drucker(load):
    """Position (z, y) of the tip under P L^2/EI = ``load``: Bisshopp & Drucker 1945, Eqs. 8-10."""
    a = np.sqrt(load)

    def phi(k):
        return np.arcsin(1 / (k * np.sqrt(2)))

    k = brentq(
        lambda k: ellipk(k * k) - ellipkinc(phi(k), k * k) - a,
        np.sqrt(0.5) * (1 + 1e-12),
        1 - 1e-12,
        xtol=1e-15,
    )
    deflection = 1 - 2 / a * (ellipe(k * k) - ellipeinc(phi(k), k * k))
    return np.sqrt(2 * (2 * k * k - 1)) / a, deflection


@pytest.mark.parametrize(
    ("load", "z", "y", "tolerances"),
    [
        (1.0, 0.9435668, 0.3017208, (1e-11, 1e-11, 2e-10)),
        (10.0, 0.4450044, 0.8106090, (3e-9, 3e-9, 2e-7)),
    ],
)
@pytest.mark.parametrize("measure", MEASURES)
def test_tip_of_a_loaded_cantilever(measure, load, z, y, tolerances):
    """The elastica of a tip-loaded cantilever (Bisshopp & Drucker 1945)."""
    exact = bisshopp_drucker(load)
    assert exact == pytest.approx((z, y), abs=5e-7)
    tips = [cantilever(n, load, measure=measure)[2] for n in COARSE]
    tolerance = tolerances[MEASURES.index(measure)]
    np.testing.assert_allclose(richardson(*tips), [0.0, exact[1], exact[0]], rtol=0, atol=tolerance)


@pytest.mark.parametrize("load", [1.0, 10.0])
def test_a_stiff_rod_stretches_by_castiglianos_theorem(load):
    """The deflection grows by d/dP of the integral of N^2/(2 EA), to first order in 1/EA.

    N is the tension of the inextensible rod. The next order is P/EA = 1e-6 to 1e-5 smaller.
    """
    EA = 1e6

    def tension_energy(force):
        rod, at, _ = cantilever(32, force)
        tension = force * rotation(at.state.quat)[:, 1, 2]
        return 0.5 * np.sum(rod.length * tension**2) / EA

    grown = cantilever(32, load, stretching=EA)[2][1] - cantilever(32, load)[2][1]
    h = 1e-3 * load
    expected = (tension_energy(load + h) - tension_energy(load - h)) / (2 * h)
    assert grown == pytest.approx(expected, rel=3e-5)


# --- balance and invariance -----------------------------------------------------------------


def crumpled(measure, stretching):
    """Return an open rod with uneven cells and natural strains, bent and twisted at random."""
    rng = np.random.default_rng(1)
    n = 20
    rod = discrete_rod(
        rng.uniform(0.05, 0.1, n),
        0.3 * rng.normal(size=(n, 3)),
        (1.0, 3.0, 0.7),
        measure=measure,
        stretching=stretching,
    )
    quat = np.tile([1.0, 0.0, 0.0, 0.0], (n + 1, 1))
    for j, turn in enumerate(0.4 * rng.normal(size=(n, 3))):
        quat[j + 1 : j + 2] = turned_all(quat[j : j + 1], turn[None])
    stretch = 0.1 * rng.normal(size=n + 1) * (stretching > 0)
    return rod, State(quat, stretch, np.zeros(0), 0.0)


@pytest.mark.parametrize("stretching", [0.0, 50.0])
@pytest.mark.parametrize("measure", MEASURES)
def test_a_free_rod_has_no_net_moment(measure, stretching):
    """Elastic moments are internal: sum_j R_j g_j = 0, g_j the gradient in frame j.

    Positions are no unknowns (edges are lengths times tangents), so there is no net force to ask
    for. Rounding of entries near 50.
    """
    rod, state = crumpled(measure, stretching)
    grad = derivatives(rod, supported(rod), state).grad[:, :3]
    assert np.abs(grad).max() > 10
    moment = np.einsum("jab,jb->a", rotation(state.quat), grad)
    np.testing.assert_allclose(moment, 0.0, rtol=0, atol=2e-13)


@pytest.mark.parametrize("stretching", [0.0, 50.0])
@pytest.mark.parametrize("measure", MEASURES)
def test_energy_does_not_change_under_a_rigid_rotation(measure, stretching):
    """Frame indifference, at a rotation too large to be linear; to rounding."""
    rod, state = crumpled(measure, stretching)
    turned = state.but(quat=turned_rigidly(state.quat, np.array([0.9, -1.4, 0.6])))
    free = RodSystem(rod, supported(rod))
    before, after = (derivatives(free.rod, free.supports, at) for at in (state, turned))
    assert after.energy == pytest.approx(before.energy, rel=2e-15)


def test_a_clamp_carries_the_moment_of_a_dead_load():
    """The gradient left on the clamped frame is the clamp's reaction, -(tip x P).

    Exact on any mesh, up to the residual of the solve, 1e-10 on each of 24 free frames.
    """
    pull = np.array([0.3, 1.0, -0.2])
    rod = straight(24, (1.0, 3.0, 0.5))
    beam = clamped(rod, pull=pull)
    at = solved(beam, unloaded(rod, along_e3(24), 0, 1.0))
    tip = edges(rod, at.state).sum(axis=0)
    reaction = rotation(at.state.quat)[0] @ derivatives(beam.rod, beam.supports, at.state).grad[0]
    np.testing.assert_allclose(reaction, -np.cross(tip, pull), rtol=0, atol=3e-9)


def null_modes(eigenvalues):
    """Count the eigenvalues that are zero to rounding; none may be near that."""
    size = np.abs(eigenvalues) / eigenvalues.max()
    assert not np.any((size > 1e-14) & (size < 1e-5)), "zeros do not stand apart"
    return int(np.sum(size < 1e-14))


@pytest.mark.parametrize("stretching", [0.0, 50.0])
def test_a_straight_free_rod_has_three_null_modes(stretching):
    """The rigid rotations, exactly; translations are no unknowns here."""
    rod = straight(20, (1.0, 3.0, 0.7), stretching=stretching)
    free = RodSystem(rod, supported(rod))
    hess, border = dense(free, unloaded(rod, along_e3(20), 0))
    eigenvalues = on_conditions(hess, border)
    assert null_modes(eigenvalues) == 3
    assert eigenvalues[3] > 0


@pytest.mark.parametrize(
    ("EI2", "kappa0", "expected"), [(1.0, 0.0, 4), (1.0, 1.0, 3), (1.5, 0.0, 3), (1.5, 1.0, 3)]
)
def test_an_isotropic_naturally_straight_ring_may_spin(EI2, kappa0, expected):
    """Three null modes of a closed ring are rotations; a fourth rolls it inside out.

    Only where neither the section nor the natural shape prefers a direction.
    """
    rod, state = covered_circle(1, kappa0, (1.0, EI2, 0.7), 24)
    ring = RodSystem(rod, free_supports(rod))
    ring.supports.free[0] = True
    eigenvalues = on_conditions(*dense(ring, state))
    assert null_modes(eigenvalues) == expected
    assert eigenvalues[expected] > 0
