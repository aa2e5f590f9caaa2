"""Strains and energy of a vertex: those of Bergou et al., and their derivatives."""

import classical
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rods import turned_all
from scipy.spatial.transform import Rotation
from scipy.special import hyp2f1, zeta

from der.kernels.quaternions import turned
from der.kernels.strain import _arc_coefficient, arctangent_quotient, vertex_energy
from der.rod.rod import Rod, State, discrete_rod, strains

MEASURES = ("logarithm", "angle", "tangent")
NEGLIGIBLE = 1e-30  # a stiffness that leaves the other terms alone

EVERY_MEASURE = pytest.mark.parametrize("measure", MEASURES)
SEEDS = pytest.mark.parametrize("seed", range(4))
OPEN_AND_CLOSED = pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])
TERMS = pytest.mark.parametrize(
    "stiffness",
    [
        (1.3, NEGLIGIBLE, NEGLIGIBLE),
        (NEGLIGIBLE, 4.1, NEGLIGIBLE),
        (NEGLIGIBLE, NEGLIGIBLE, 0.9),
        (1.3, 4.1, 0.9),
    ],
    ids=["EI1", "EI2", "GJ", "all"],
)


def engine(
    seed: int, frames: classical.Classical, measure: str, stiffness: tuple = (1.0, 1.0, 1.0)
) -> tuple[Rod, State]:
    """Rod and state of the engine with random cells and natural strains, in given frames."""
    rng = np.random.default_rng(seed + 100)
    n_s = len(frames.ref_twist)
    rod = discrete_rod(
        rng.uniform(0.5, 1.5, size=n_s),
        rng.uniform(-0.4, 0.4, size=(n_s, 3)),
        stiffness,
        measure=measure,
        closed=frames.closed,
    )
    quat = classical.quaternions(frames)
    return rod, State(quat, np.zeros(len(quat)), np.zeros(0), 0.0)


def relative_rotation(seed: int, angle: float | None = None) -> np.ndarray:
    """Random p with p0 > 0, bent and twisted by ``angle``; 1.5 if none is given."""
    w = np.random.default_rng(seed).normal(size=3)
    w *= (1.5 if angle is None else angle) / np.linalg.norm(w)
    out = np.empty(4)
    turned(np.array([1.0, 0.0, 0.0, 0.0]), w, out)
    return out


def at_vertex(p, measure, rest, stiffness) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Energy, strains, gradient and Hessian."""
    kappa, g, H = np.empty(3), np.empty(3), np.empty((3, 3))
    number = discrete_rod([1.0], [0.0], (1.0, 1.0, 1.0), measure=measure).measure
    energy = vertex_energy(p, number, rest, stiffness, kappa, g, H)
    return energy, kappa, g, H


REST = np.array([0.3, -0.2, 0.4])
STIFFNESS = np.array([1.3, 4.1, 0.9])


@EVERY_MEASURE
@OPEN_AND_CLOSED
@SEEDS
def test_strains_are_those_of_positions_and_material_angles(seed, closed, measure):
    """Frames as quaternions are the discrete elastic rod of Bergou et al. 2008/2010.

    The same strains from vertices, angles and reference frames; bends up to 100 degrees, where a
    few roundings of the frames are multiplied by less than ten: hence 2e-14.
    """
    frames = classical.bent_and_twisted(np.random.default_rng(seed), 7, closed=closed)
    kappa, _ = strains(*engine(seed, frames, measure))
    assert_allclose(kappa, classical.strains(frames, measure), rtol=0, atol=2e-14)


@TERMS
@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_energy_is_that_of_positions_and_material_angles(closed, measure, stiffness):
    """Each energy term alone, vertex by vertex, to the rounding of the strains: 2e-13 relative."""
    frames = classical.bent_and_twisted(np.random.default_rng(7), 7, closed=closed)
    rod, state = engine(7, frames, measure, stiffness)
    expected = classical.energies(frames, measure, rod.rest, stiffness, rod.cell)
    assert_allclose(strains(rod, state)[1], expected, rtol=2e-13, atol=1e-14 * expected.max())


@EVERY_MEASURE
@OPEN_AND_CLOSED
@SEEDS
def test_time_parallel_motion_is_turning_frames(seed, closed, measure):
    """After six moves of all vertices and angles, strains still agree (Bergou 2010, section 4).

    Classical: reference frames carried in time, reference twist updated. Engine: frames turned by
    (w1, w2, 0), which brings the tangents where they are, then by (0, 0, dtheta). Six times the
    rounding of one comparison: 1e-13.
    """
    rng = np.random.default_rng(seed)
    frames = classical.bent_and_twisted(rng, 6, closed=closed)
    rod, state = engine(seed, frames, measure)
    quat = state.quat
    for _ in range(6):
        d1, d2, d3 = classical.material_frames(frames)
        dtheta = rng.uniform(-0.2, 0.2, size=len(quat))
        frames = classical.moved(frames, rng.uniform(-0.05, 0.05, size=frames.x.shape), dtheta)
        new = classical.material_frames(frames)[2]
        axis = np.cross(d3, new)
        sine = np.linalg.norm(axis, axis=1)
        axis *= (np.arctan2(sine, np.sum(d3 * new, axis=1)) / sine)[:, None]
        w1, w2 = np.sum(axis * d1, axis=1), np.sum(axis * d2, axis=1)
        quat = turned_all(quat, np.column_stack([w1, w2, 0.0 * w1]))
        quat = turned_all(quat, np.column_stack([0.0 * w1, 0.0 * w1, dtheta]))
    kappa, _ = strains(rod, state.but(quat=quat))
    assert_allclose(kappa, classical.strains(frames, measure), rtol=0, atol=1e-13)


@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_reference_frames_are_a_gauge(closed, measure):
    """Other reference frames, same material frames: same strains; angles up to 20 cost 1e-14."""
    rng = np.random.default_rng(5)
    frames = classical.bent_and_twisted(rng, 7, closed=closed)
    other = classical.regauged(frames, rng.uniform(-6.0, 6.0, size=7))
    rod, state = engine(5, other, measure)
    kappa, _ = strains(rod, state)
    assert_allclose(kappa, classical.strains(frames, measure), rtol=0, atol=4e-14)


@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_sign_of_a_quaternion_says_nothing(closed, measure):
    """q and -q are one frame: strains and energies agree to the last digit."""
    rng = np.random.default_rng(6)
    rod, state = engine(6, classical.bent_and_twisted(rng, 7, closed=closed), measure)
    sign = np.where(np.arange(7) % 3 == 0, -1.0, 1.0)[:, None]
    for one, other in zip(
        strains(rod, state), strains(rod, state.but(quat=sign * state.quat)), strict=True
    ):
        assert np.array_equal(one, other)


@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_rigid_rotation_leaves_strains(closed, measure):
    """Objectivity: strains see relative rotations only; a few roundings, as above."""
    frames = classical.bent_and_twisted(np.random.default_rng(8), 7, closed=closed)
    rod, state = engine(8, frames, measure)
    turned_rod = state.but(quat=classical.spun(state.quat, np.array([1.0, -2.0, 0.5])))
    kappa, _ = strains(rod, turned_rod)
    assert_allclose(kappa, strains(rod, state)[0], rtol=0, atol=2e-14)


@EVERY_MEASURE
@SEEDS
def test_strains_are_odd_under_exchange_of_the_two_frames(seed, measure):
    """Seen from the other side, conj(p), a vertex bends and twists by the opposite, exactly."""
    p = relative_rotation(seed)
    _, kappa, _, _ = at_vertex(p, measure, REST, STIFFNESS)
    _, back, _, _ = at_vertex(p * [1.0, -1.0, -1.0, -1.0], measure, REST, STIFFNESS)
    assert np.array_equal(back, -kappa)


@pytest.mark.parametrize(
    ("measure", "factor"), [("logarithm", 1.0), ("angle", 1.0), ("tangent", np.tan(0.4) / 0.4)]
)
def test_plane_bend(measure, factor):
    """Turning by 0.8 about d1: kappa1 = 0.8, or 2 tan 0.4; nothing else. A few roundings."""
    p = np.array([np.cos(0.4), np.sin(0.4), 0.0, 0.0])
    _, kappa, _, _ = at_vertex(p, measure, REST, STIFFNESS)
    assert_allclose(kappa, [0.8 * factor, 0.0, 0.0], rtol=0, atol=5e-16)


@EVERY_MEASURE
def test_pure_twist(measure):
    """Turning by 2 about d3 is a twist of 2 in every measure; a few roundings."""
    p = np.array([np.cos(1.0), 0.0, 0.0, np.sin(1.0)])
    _, kappa, _, _ = at_vertex(p, measure, REST, STIFFNESS)
    assert_allclose(kappa, [0.0, 0.0, 2.0], rtol=0, atol=1e-15)


@EVERY_MEASURE
@SEEDS
def test_norm_of_p_does_not_matter(seed, measure):
    """Energy, strains, gradient and Hessian are homogeneous of degree 0 in p: to rounding."""
    p = relative_rotation(seed)
    for one, other in zip(
        at_vertex(p, measure, REST, STIFFNESS),
        at_vertex(3.7 * p, measure, REST, STIFFNESS),
        strict=True,
    ):
        assert_allclose(other, one, rtol=1e-13, atol=1e-14)


@TERMS
@EVERY_MEASURE
@SEEDS
def test_gradient_of_a_vertex(seed, measure, stiffness):
    """G = dE/dw along p o exp(w/2), against a stencil of fourth order with h = 1e-3.

    Its error is h^4/30 and 1e-16/h, some 1e-13 of the energy's size: 1e-9 of the largest entry
    leaves room for small gradients.
    """
    p, stiffness = relative_rotation(seed), np.array(stiffness)
    _, _, g, _ = at_vertex(p, measure, REST, stiffness)

    def energy(w: np.ndarray) -> float:
        out = np.empty(4)
        turned(p, w, out)
        return at_vertex(out, measure, REST, stiffness)[0]

    expected = [classical.difference(lambda h, e=e: energy(h * e)) for e in np.eye(3)]
    assert_allclose(g, expected, rtol=0, atol=1e-9 * np.abs(g).max())


@TERMS
@EVERY_MEASURE
@SEEDS
def test_hessian_of_a_vertex(seed, measure, stiffness):
    """H = d2E/dw2 along p o exp(w/2), against differences of the gradient; 1e-9, as for it.

    The gradient at p o exp(w/2) is taken in the turned frame; the transposed right Jacobian of w
    brings it to the coordinates w.
    """
    p, stiffness = relative_rotation(seed), np.array(stiffness)
    _, _, _, H = at_vertex(p, measure, REST, stiffness)

    def gradient(w: np.ndarray) -> np.ndarray:
        out = np.empty(4)
        turned(p, w, out)
        return classical.right_jacobian(w).T @ at_vertex(out, measure, REST, stiffness)[2]

    expected = [classical.difference(lambda h, e=e: gradient(h * e)) for e in np.eye(3)]
    assert_allclose(H, expected, rtol=0, atol=1e-9 * np.abs(H).max())


@EVERY_MEASURE
@SEEDS
def test_hessian_of_a_vertex_is_exactly_symmetric(seed, measure):
    """The index reads its signs, so it is symmetric by construction: not a digit of difference."""
    _, _, _, H = at_vertex(relative_rotation(seed), measure, REST, STIFFNESS)
    assert np.array_equal(H, H.T)


@EVERY_MEASURE
def test_straight_vertex_has_the_stiffness_for_its_hessian(measure):
    """Phi -> 0: E = sum K_k w_k^2/2 + O(w^3), so H = diag K, to a few roundings."""
    p = np.array([1.0, 0.0, 0.0, 0.0])
    energy, kappa, g, H = at_vertex(p, measure, np.zeros(3), STIFFNESS)
    assert energy == 0.0
    assert np.array_equal(kappa, np.zeros(3))
    assert np.array_equal(g, np.zeros(3))
    assert_allclose(H, np.diag(STIFFNESS), rtol=0, atol=2e-15)


@EVERY_MEASURE
@pytest.mark.parametrize("angle", [1e-300, 1e-160, 1e-20, 1e-9, 1e-5])
def test_nearly_straight_vertex(measure, angle):
    """Phi -> 0 with natural strains: no NaN, and derivatives that tend to those at phi = 0.

    They are smooth: the difference is less than ten times the angle, or a few roundings.
    """
    straight = at_vertex(np.array([1.0, 0.0, 0.0, 0.0]), measure, REST, STIFFNESS)
    bent = at_vertex(relative_rotation(0, angle), measure, REST, STIFFNESS)
    for one, other in zip(bent, straight, strict=True):
        assert_allclose(one, other, rtol=0, atol=10.0 * angle + 4e-15)


@pytest.mark.parametrize("r", [0.0, 1e-300, 1e-8, 0.01, 0.0299, 0.0301, 0.1, 1.0, 30.0])
def test_arctangent_quotient_is_a_hypergeometric_function(r):
    """F = 2 arctan(x)/x = 2 F(1/2, 1; 3/2; -x^2) and its derivatives (DLMF 15.4.3, 15.5.1).

    Cancellation above the switch takes three digits from f'': 1e-12.
    """
    expected = [
        2.0 * hyp2f1(0.5, 1.0, 1.5, -r),
        -2.0 / 3.0 * hyp2f1(1.5, 2.0, 2.5, -r),
        4.0 / 5.0 * hyp2f1(2.5, 3.0, 3.5, -r),
    ]
    assert_allclose(arctangent_quotient(r), expected, rtol=1e-12, atol=0)


def test_arctangent_quotient_across_the_switch():
    """Series and closed form meet at r = 0.03 to 1e-12, what cancellation leaves of f''."""
    below, above = arctangent_quotient(0.03 * (1.0 - 1e-15)), arctangent_quotient(0.03)
    assert_allclose(below, above, rtol=1e-12, atol=0)


@pytest.mark.parametrize("t", [0.0, 1e-300, 1e-8, 0.1, 0.499, 0.501, 2.0, 6.0, 9.5])
def test_arc_coefficient_is_its_bernoulli_series(t):
    """C = sum |B_2k| t^(k-1)/(2k)! and dc/dt; 60 terms are plenty for t < pi^2.

    |B_2k|/(2k)! = 2 zeta(2k)/(2 pi)^2k (DLMF 25.6.2): converges for t < 4 pi^2.
    Cancellation above the switch takes three digits from dc/dt: 1e-12.
    """
    k = np.arange(1, 61)
    terms = 2.0 * zeta(2 * k) / (2.0 * np.pi) ** (2 * k)
    rate = terms[1:] * k[:-1] @ t ** (k[:-1] - 1.0)
    assert_allclose(_arc_coefficient(t), [terms @ t ** (k - 1.0), rate], rtol=1e-12, atol=0)


def test_arc_coefficient_across_the_switch():
    """Series and closed form meet at t = 0.5 to 1e-12, what cancellation leaves of dc/dt."""
    assert_allclose(_arc_coefficient(0.5 * (1.0 - 1e-15)), _arc_coefficient(0.5), rtol=1e-12)


def test_logarithm_is_the_rotation_vector_up_to_a_half_turn():
    """|W| < pi, against SciPy; the arctangent of a quotient near infinity keeps 1e-14."""
    for angle in (0.1, 1.0, 2.0, 3.0, 3.14):
        p = relative_rotation(9, angle)
        _, kappa, _, _ = at_vertex(p, "logarithm", REST, STIFFNESS)
        expected = Rotation.from_quat(np.roll(p, -1)).as_rotvec()
        assert_allclose(kappa, expected, rtol=0, atol=1e-14)
