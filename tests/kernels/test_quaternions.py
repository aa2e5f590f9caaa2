"""Operators on frames against rotation matrices; the frame rule against parallel transport."""

import math

import classical
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rods import turned_all
from scipy.spatial.transform import Rotation

from der.kernels.quaternions import (
    chart_rate,
    into_frame,
    relative,
    rotation,
    rotation_vector,
    tangent,
    turned,
)

SEEDS = pytest.mark.parametrize("seed", range(5))


def unit_quaternions(seed: int, n: int) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def matrix(quat: np.ndarray) -> np.ndarray:
    """Rotation matrices by SciPy, whose quaternions have the scalar last."""
    return Rotation.from_quat(np.roll(quat, -1, axis=-1)).as_matrix()


def turned_by(q: np.ndarray, w: np.ndarray) -> np.ndarray:
    out = np.empty(4)
    turned(q, w, out)
    return out


@SEEDS
def test_rotation_is_the_matrix_of_the_quaternion(seed):
    """Columns d1, d2, d3 (paper, Eq. A.10), against SciPy; a few roundings of numbers below 1."""
    q = unit_quaternions(seed, 20)
    assert_allclose(rotation(q), matrix(q), rtol=0, atol=1e-15)


@SEEDS
def test_relative_is_the_second_frame_seen_in_the_first(seed):
    """Matrix of conj(qa) o qb = Ra' Rb; a few roundings."""
    qa, qb = unit_quaternions(seed, 2)
    p = np.empty(4)
    relative(qa, qb, p)
    assert_allclose(matrix(p), matrix(qa).T @ matrix(qb), rtol=0, atol=2e-15)


@SEEDS
def test_into_frame_takes_components_along_the_directors(seed):
    """b = R' a; a few roundings of |a| < 5."""
    (q,), a, b = unit_quaternions(seed, 1), np.array([1.0, -2.0, 3.0]), np.empty(3)
    into_frame(q, a, b)
    assert_allclose(b, matrix(q).T @ a, rtol=0, atol=5e-15)


@SEEDS
def test_tangent_is_the_third_director(seed):
    """d3 = R E3; a few roundings."""
    (q,), d3 = unit_quaternions(seed, 1), np.empty(3)
    tangent(q, d3)
    assert_allclose(d3, matrix(q)[:, 2], rtol=0, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.99e-4, 1.01e-4, 0.1, 2.0, 3.1, 6.0])
def test_turned_is_a_rotation_about_an_axis_in_the_frame(angle):
    """R exp([w]), on both sides of the switch to the series at 1e-4; a few roundings."""
    (q,) = unit_quaternions(1, 1)
    w = angle * np.array([2.0, -3.0, 6.0]) / 7.0
    expected = matrix(q) @ Rotation.from_rotvec(w).as_matrix()
    assert_allclose(matrix(turned_by(q, w)), expected, rtol=0, atol=2e-15)


def test_turned_keeps_the_norm_over_many_turns():
    """Quaternions stay of unit length, without drift: two roundings after 1000 turns."""
    (q,), rng = unit_quaternions(2, 1), np.random.default_rng(2)
    for w in rng.normal(size=(1000, 3)):
        q = turned_by(q, w)
    assert abs(np.linalg.norm(q) - 1.0) < 4e-16


def test_turned_may_write_over_its_argument():
    """The solver turns frames in place; not a digit may differ."""
    (q,), w = unit_quaternions(3, 1), np.array([0.3, -0.2, 0.9])
    expected = turned_by(q, w)
    turned(q, w, q)
    assert np.array_equal(q, expected)


@SEEDS
def test_rotation_vector_undoes_turned_all(seed):
    """w -> turned -> w for |w| < pi, whatever the signs of the quaternions.

    A rounding of p is 1e-16 in w, and up to 3 times that near |w| = pi: hence 1e-14.
    """
    rng = np.random.default_rng(seed)
    q = unit_quaternions(seed, 20)
    w = classical.unit(rng.normal(size=(20, 3))) * rng.uniform(0.0, 3.1, size=(20, 1))
    sign = rng.choice([-1.0, 1.0], size=(20, 1))
    assert_allclose(rotation_vector(q, sign * turned_all(q, w)), w, rtol=0, atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-160, 1e-9])
def test_rotation_vector_of_nearly_equal_frames(angle):
    """No division by zero, and w itself to rounding, as the angle goes to zero."""
    q, w = np.array([[1.0, 0.0, 0.0, 0.0]]), angle * np.array([[0.6, 0.0, 0.8]])
    assert_allclose(rotation_vector(q, turned_all(q, w)), w, rtol=1e-14, atol=0)


@SEEDS
def test_moving_a_vertex_turns_a_frame_without_third_component(seed):
    """Time-parallel transport at fixed theta (Bergou 2010, 4) is `turned` with w3 = 0.

    One edge, its end moved by more than a radian: the material frame, carried along with the
    reference frame, is turned by the angle between the tangents about d3 x d3', whose components
    in the frame are (w1, w2, 0). The same rotation twice: a few roundings.
    """
    rng = np.random.default_rng(seed)
    (frame,) = matrix(unit_quaternions(seed, 1))
    x = np.array([[0.0, 0.0, 0.0], frame[:, 2]])
    before = classical.Classical(x, frame[None, :, 0], np.array([0.7]), np.empty(0), closed=False)
    dx = np.array([[0.0, 0.0, 0.0], rng.normal(size=3)])
    after = classical.moved(before, dx, np.zeros(1))

    d1, d2, d3 = (d[0] for d in classical.material_frames(before))
    new = classical.material_frames(after)[2][0]
    axis = classical.unit(np.cross(d3, new))
    angle = math.atan2(np.linalg.norm(np.cross(d3, new)), d3 @ new)
    w = angle * np.array([axis @ d1, axis @ d2, 0.0])
    q = turned_by(classical.quaternions(before)[0], w)
    expected = np.stack(classical.material_frames(after), axis=-1)[0]
    assert_allclose(rotation(q), expected, rtol=0, atol=3e-15)


def test_third_component_is_the_increment_of_theta():
    """At rest vertices, theta + w3 is `turned` with (0, 0, w3); a few roundings."""
    rod = classical.bent_and_twisted(np.random.default_rng(0), 4, closed=False)
    dtheta = np.array([0.1, -2.0, 3.0, 1e-5])
    after = classical.moved(rod, 0.0 * rod.x, dtheta)
    w = np.column_stack([0.0 * dtheta, 0.0 * dtheta, dtheta])
    frames = rotation(turned_all(classical.quaternions(rod), w))
    expected = np.stack(classical.material_frames(after), axis=-1)
    assert_allclose(frames, expected, rtol=0, atol=3e-15)


def test_a_tangent_round_an_octant_brings_the_frame_back_by_a_right_angle():
    """Holonomy: a frame carried round a loop turns by the area the tangent encloses, here pi/2.

    The tangent goes d3 -> d1 -> d2 -> d3 of the start, three quarter turns with w3 = 0, leaving
    the area on its left: the frame turns by +pi/2 about it. A few roundings.
    """
    (q,) = unit_quaternions(4, 1)
    start = rotation(q)
    for target in (start[:, 0], start[:, 1], start[:, 2]):
        d = rotation(q)
        w = 0.5 * np.pi * d.T @ np.cross(d[:, 2], target)
        assert abs(w[2]) < 1e-14
        q = turned_by(q, w)
    expected = start @ Rotation.from_rotvec([0.0, 0.0, 0.5 * np.pi]).as_matrix()
    assert_allclose(rotation(q), expected, rtol=0, atol=3e-15)


@SEEDS
def test_rates_of_rotation_vectors(seed):
    """d log(conj(qa) o qb)/dt where qb turns at omega, against central differences.

    The series ends with w^2: its next term is w^4/720 at most, 1e-6 here; differences err by 1e-9.
    """
    qa, rng = unit_quaternions(seed, 20), np.random.default_rng(seed)
    w, omega = 0.1 * rng.uniform(-1, 1, (20, 3)), rng.uniform(-1, 1, (20, 3))
    qb = np.array([turned_by(*pair) for pair in zip(qa, w, strict=True)])
    there, back = (
        rotation_vector(qa, np.array([turned_by(q, t * o) for q, o in zip(qb, omega, strict=True)]))
        for t in (1e-5, -1e-5)
    )
    found = np.empty((20, 3))
    for j in range(20):
        chart_rate(w[j], omega[j], found[j])
    assert_allclose(found, (there - back) / 2e-5, rtol=0, atol=2e-6)
