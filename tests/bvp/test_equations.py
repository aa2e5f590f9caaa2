"""The rod equations' kernels against the paper's printed forms and central differences."""

import numpy as np
import pytest
from boundary_value import directors as printed_directors
from boundary_value import system

import der
from der.bvp.equations import directors, product, stage

STIFFNESS = np.array([0.77, 12.3, 1.0])
REST = 1.7


def draw(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A quaternion that is not a unit one, as Newton's iterates are not, and a moment."""
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, 4), random.uniform(-3, 3, 3)


def evaluated(q: np.ndarray, moment: np.ndarray, rest: float = REST) -> tuple[np.ndarray, ...]:
    """q', dq'/dq, dq'/dm, d(d3)/dq."""
    d, turn = np.empty((3, 3)), np.empty((3, 4))
    out = np.empty(4), np.empty((4, 4)), np.empty((4, 3)), np.empty((3, 4))
    directors(q, d)
    stage(q, moment, rest, STIFFNESS, d, turn, *out)
    return out


def rows(q: np.ndarray) -> np.ndarray:
    """The kernel's directors."""
    d = np.empty((3, 3))
    directors(q, d)
    return d


def differences(f, x: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Central differences of a function of a vector, last axis by its components."""
    unit = np.eye(len(x))
    return np.stack([(f(x + step * e) - f(x - step * e)) / (2 * step) for e in unit], axis=-1)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_by_the_frame(seed):
    """dq'/dq is that of q', for any q: central differences of a cubic, 1e-5 squared is rounding."""
    q, moment = draw(seed)
    expected = differences(lambda x: evaluated(x, moment)[0], q)
    np.testing.assert_allclose(evaluated(q, moment)[1], expected, atol=2e-9)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_by_the_moment(seed):
    """dq'/dm, exact to rounding: q' is linear in m."""
    q, moment = draw(seed)
    expected = differences(lambda x: evaluated(q, x)[0], moment)
    np.testing.assert_allclose(evaluated(q, moment)[2], expected, atol=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_of_the_tangent(seed):
    """d(d3)/dq, exact to rounding: d3 is quadratic in q."""
    q, moment = draw(seed)
    np.testing.assert_allclose(
        evaluated(q, moment)[3], differences(lambda x: rows(x)[2], q), atol=1e-10
    )


@pytest.mark.parametrize("seed", range(4))
def test_frames_turn_as_printed(seed):
    """q' is (A.13) with k = k1u d1 + d_i . m / B_i (A.7), to rounding."""
    q, moment = draw(seed)
    q /= np.linalg.norm(q)
    k1, k2, k3 = printed_directors(q) @ moment / STIFFNESS + [REST, 0.0, 0.0]
    q0, q1, q2, q3 = q
    expected = 0.5 * np.array(
        [
            -q1 * k1 - q2 * k2 - q3 * k3,
            q0 * k1 - q3 * k2 + q2 * k3,
            q3 * k1 + q0 * k2 - q1 * k3,
            -q2 * k1 + q1 * k2 + q0 * k3,
        ]
    )
    np.testing.assert_allclose(evaluated(q, moment)[0], expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(4))
def test_directors_as_printed(seed):
    """Directors are those of (A.10) for unit q, right-handed and orthonormal, to rounding."""
    q = draw(seed)[0]
    q /= np.linalg.norm(q)
    np.testing.assert_allclose(rows(q), printed_directors(q), atol=1e-14)
    np.testing.assert_allclose(np.cross(rows(q)[0], rows(q)[1]), rows(q)[2], atol=1e-14)


@pytest.mark.parametrize("seed", range(4))
def test_directors_turn_by_the_darboux_vector(seed):
    """d_i' = k x d_i (A.2): differences along q' of an independent step, 1e-5 squared."""
    q, moment = draw(seed)
    q /= np.linalg.norm(q)
    d = rows(q)
    k = (d @ moment / STIFFNESS + [REST, 0.0, 0.0]) @ d
    rate = evaluated(q, moment)[0]
    step = 1e-5
    change = (rows(q + step * rate) - rows(q - step * rate)) / (2 * step)
    np.testing.assert_allclose(change, np.cross(k, d), atol=1e-8)


def test_product_of_quaternions_composes_rotations():
    """Directors of p o q are those of q turned by p: D(p o q) = D(q) D(p), to rounding."""
    p, q = draw(1)[0], draw(2)[0]
    p, q = p / np.linalg.norm(p), q / np.linalg.norm(q)
    both = np.empty(4)
    product(p, q, both)
    np.testing.assert_allclose(rows(both), rows(q) @ rows(p), atol=1e-14)


@pytest.mark.parametrize(
    "ring",
    [der.circle(), der.ellipse(0.6, "y"), der.rectangle(0.6, 0.3), der.triangle(1.2, 0.1)],
    ids=lambda ring: ring.shape,
)
def test_natural_ring_is_a_solution_without_moment(ring):
    """q' of the flat ring's frames is their slope where m = 0; differences of 1e-5, squared."""
    sector = system(ring, 4.0).sector
    s = np.linspace(0.03, sector.length - 0.03, 17)
    step = 1e-5
    slope = (sector.flat(s + step) - sector.flat(s - step)) / (2 * step)
    joints = np.array(sector.joints)
    for place, q, expected in zip(s, sector.flat(s), slope, strict=True):
        assert np.abs(place - joints).min() > step
        rest = float(sector.curvature(np.array(place)))
        np.testing.assert_allclose(evaluated(q, np.zeros(3), rest)[0], expected, atol=1e-6)
