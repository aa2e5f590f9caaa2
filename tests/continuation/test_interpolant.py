"""What leads from state to state: increments, the cubic of a step, and the solutions it keeps.

Against plain numpy formulas, differences, and the states that they have to lead through.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import der
from der.continuation.interpolant import Interpolant, on_curve
from der.continuation.step import Step
from der.errors import Reason
from der.kernels.quaternions import chart_rate
from der.problem import Increment, Solution, Statistics
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.manifold import Direction, split
from der.rod.rod import State

TINY = 1e-5  # of s, for central differences: good to its square


def half(stretch: float = 0.0) -> GrippedRing:
    """Half of a triangle: it is graded, so that its edges have unequal masses."""
    return gripped_ring(
        der.triangle(1.0, 0.1), der.rectangular_section(4.0), 16, stretching=stretch
    )


def increment(ring: GrippedRing, seed: int, size: float = 0.1) -> Increment:
    """A random increment that the supports allow."""
    random = np.random.default_rng(seed)
    free = ring.supports.free
    q = size * random.normal(size=free.shape) * free
    force = size * random.normal(size=len(ring.supports.target))
    return Direction(q, force, float(size * random.normal())).flat


def test_product_of_increments_is_weighted_by_mass():
    """Sum over edges of mass a . b, and the product of the loads; forces do not enter."""
    ring = half()
    a, b = increment(ring, 1), increment(ring, 2)
    p, q = split(ring.supports, a), split(ring.supports, b)
    expected = np.sum(ring.rod.mass * p.q * q.q) + p.load * q.load
    assert ring.inner(a, b) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("stretch", [0.0, 50.0])
def test_increment_between_states_leads_from_one_to_the_other(stretch):
    """`retract` by `difference` is the other state, and the increment the one that had led there.

    Grips' turns included, which are no entries of it.
    """
    ring = half(stretch)
    step = increment(ring, 3)
    there = ring.retract(ring.start, step)
    found = ring.difference(ring.start, there)
    assert_allclose(found, step, rtol=0, atol=1e-14)
    back = ring.retract(ring.start, found)
    for a, b in zip(back, there, strict=True):
        assert_allclose(a, b, rtol=0, atol=1e-14)


def test_moving_a_state_leaves_it_as_it_was():
    """The arrays of a state are never written to."""
    ring = half()
    before = State(*(np.copy(entry) for entry in ring.start[:3]), ring.start.load)
    ring.retract(ring.start, increment(ring, 4))
    for a, b in zip(before, ring.start, strict=True):
        assert_allclose(a, b, rtol=0, atol=0)


@pytest.mark.parametrize("kept", range(4))
def test_interpolant_has_values_and_rates_of_its_cubic_and_leads_through_solutions(kept):
    """Zero, the jump and both rates at its ends whatever is kept, and every solution kept."""
    ring, length = half(), 0.4
    rate, jump, end_rate = (increment(ring, seed) for seed in (5, 6, 7))
    curve = Interpolant(length, rate, jump, end_rate)
    found = {s * length: increment(ring, 8 + k) for k, s in enumerate((0.5, 0.3, 0.8)[:kept])}
    for s, away in found.items():
        curve.keep(s, away)
    assert_allclose(curve.at(0.0), 0.0, atol=0)
    assert_allclose(curve.at(length), jump, rtol=0, atol=1e-16)
    for s, expected in ((0.0, rate), (length, end_rate)):
        slope = (curve.at(s + TINY) - curve.at(s - TINY)) / (2.0 * TINY)
        assert_allclose(slope, expected, rtol=0, atol=1e-5)
    for s, away in found.items():
        assert_allclose(curve.at(s), away, rtol=0, atol=1e-14)


def test_interpolant_keeps_no_solutions_that_lie_close_to_others():
    """They would tell more of rounding than of the path: within a tenth of the length, or a 4th."""
    ring = half()
    rate, jump, end_rate = (increment(ring, seed) for seed in (5, 6, 7))
    curve = Interpolant(1.0, rate, jump, end_rate)
    other = increment(ring, 9)
    for s in (0.5, 0.55, 0.05, 0.95, 0.2, 0.8, 0.35):
        curve.keep(s, other)
    followed = [
        s
        for s in (0.5, 0.55, 0.05, 0.95, 0.2, 0.8, 0.35)
        if np.allclose(curve.at(s), other, rtol=0, atol=1e-12)
    ]
    assert followed == [0.5, 0.2, 0.8]


def test_polynomials_of_degree_six_are_followed_exactly():
    """A cubic and three solutions determine it: what is added, and its rate, vanish at the ends."""
    length, places = 2.0, np.array([0.25, 0.5, 0.75])
    p = np.polynomial.Polynomial([0.0, 1.0, -2.0, 0.5, 3.0, -1.0, 0.7])
    cubic = [p.deriv()(0.0), p(length), p.deriv()(length)]
    found = np.empty(1)
    rows = np.array([*cubic, 0.0, 0.0, 0.0])[:, None]
    for k, u in enumerate(places):
        on_curve(u, length, np.empty(0), rows, found)
        rows[3 + k] = (p(u * length) - found) / (u * (1.0 - u)) ** 2
    for u in (0.1, 0.4, 0.6, 0.9):
        on_curve(u, length, places, rows, found)
        assert found[0] == pytest.approx(p(u * length), abs=1e-12)


def solution(state: State, tangent: Increment) -> Solution[State]:
    """A state that is taken for an equilibrium, with any tangent."""
    return Solution(state, state.load, tangent, {}, None, Reason.CONVERGED, "", 0, 0.0)


def test_cubic_beyond_a_step_goes_through_both_of_its_ends():
    """At 0 the rates at the end; back at the start minus the jump, and the rates there over s'.

    s' is the rate at which the first tangent advances along the second.
    """
    ring = half()
    jump, rates, t = (increment(ring, seed) for seed in (10, 11, 12))
    start = solution(ring.start, rates)
    end = solution(ring.retract(ring.start, jump), t)
    step = Step(ring, start, end, 0.1, 1e-10, Statistics())
    back = ring.inner(t, jump)

    def slope(s: float) -> np.ndarray:
        return (step.beyond(s + TINY * back) - step.beyond(s - TINY * back)) / (2.0 * TINY * back)

    assert_allclose(step.beyond(0.0), 0.0, atol=0)
    assert_allclose(step.beyond(-back), -jump, rtol=0, atol=1e-14)
    assert_allclose(slope(0.0), t, rtol=0, atol=1e-6)
    p = split(ring.supports, rates)
    q = np.empty_like(p.q)
    for turn, rate, there in zip(-split(ring.supports, jump).q, p.q, q, strict=True):
        chart_rate(turn, rate, there)  # in the frames of the end
    first = Direction(q, p.force, p.load).flat
    assert_allclose(slope(-back), first / ring.inner(t, first), rtol=0, atol=1e-6)
