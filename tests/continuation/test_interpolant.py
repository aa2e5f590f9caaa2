"""What leads from state to state: chords, the cubics through their ends, and what is kept of them.

Against plain numpy formulas, differences, and the states that they have to lead through.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import der
from der.continuation.interpolant import Curve, between, on_curve, onward
from der.kernels.quaternions import chart_rate
from der.rod.equilibrium import Direction, dot, moved
from der.rod.gripped_ring import Sector, sector
from der.rod.rod import State

TINY = 1e-5  # of s, for central differences: good to its square


def piece(stretch: float = 0.0) -> Sector:
    """Half of a triangle: it is graded, so that its edges have unequal masses."""
    ring = der.triangle(1.0, 0.1)
    return sector(ring, der.rectangular_section(4.0), 16, stretching=stretch)


def direction(on: Sector, seed: int, size: float = 0.1) -> Direction:
    """A random direction that the supports allow."""
    random = np.random.default_rng(seed)
    q = size * random.normal(size=on.held.free.shape) * on.held.free
    force = size * random.normal(size=len(on.held.target))
    return Direction(q, force, float(size * random.normal()))


def flat(d: Direction) -> np.ndarray:
    return np.concatenate([d.q.ravel(), d.force, [d.load]])


def test_product_of_directions_is_weighted_by_mass():
    """Sum over edges of mass a . b, and the product of the loads; forces do not enter."""
    on = piece()
    a, b = direction(on, 1), direction(on, 2)
    expected = np.sum(on.body.mass * a.q * b.q) + a.load * b.load
    assert dot(on.body, a, b) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("stretch", [0.0, 50.0])
def test_increment_between_states_leads_from_one_to_the_other(stretch):
    """`moved` by `between` is the other state, and the increment the one that had led there.

    Grips' turns included, which are no entries of it.
    """
    on = piece(stretch)
    step = direction(on, 3)
    there = moved(on.held, on.start, step)
    found = between(on.held, on.start, there)
    assert_allclose(flat(found), flat(step), rtol=0, atol=1e-14)
    back = moved(on.held, on.start, found)
    for a, b in zip(back, there, strict=True):
        assert_allclose(a, b, rtol=0, atol=1e-14)


def test_moving_a_state_leaves_it_as_it_was():
    """The arrays of a state are never written to."""
    on = piece()
    before = State(*(np.copy(entry) for entry in on.start[:3]), on.start.load)
    moved(on.held, on.start, direction(on, 4))
    for a, b in zip(before, on.start, strict=True):
        assert_allclose(a, b, rtol=0, atol=0)


@pytest.mark.parametrize("kept", range(4))
def test_curve_has_the_values_and_rates_of_its_cubic_and_leads_through_states(kept):
    """Zero, the jump and both rates at its ends whatever is kept, and every state that is kept."""
    on, length = piece(), 0.4
    rate, jump, end_rate = (direction(on, seed) for seed in (5, 6, 7))
    curve = Curve(length, rate, jump, end_rate)
    states = {s * length: direction(on, 8 + k) for k, s in enumerate((0.5, 0.3, 0.8)[:kept])}
    for s, state in states.items():
        curve.keep(s, state)

    def value(s: float) -> np.ndarray:
        return flat(curve.at(s))

    assert_allclose(value(0.0), 0.0, atol=0)
    assert_allclose(value(length), flat(jump), rtol=0, atol=1e-16)
    for s, expected in ((0.0, rate), (length, end_rate)):
        slope = (value(s + TINY) - value(s - TINY)) / (2.0 * TINY)
        assert_allclose(slope, flat(expected), rtol=0, atol=1e-5)
    for s, state in states.items():
        assert_allclose(value(s), flat(state), rtol=0, atol=1e-14)


def test_curve_keeps_no_states_that_lie_close_to_others():
    """They would tell more of rounding than of the path: within a tenth of the length, or a 4th."""
    on = piece()
    rate, jump, end_rate = (direction(on, seed) for seed in (5, 6, 7))
    curve = Curve(1.0, rate, jump, end_rate)
    other = direction(on, 9)
    for s in (0.5, 0.55, 0.05, 0.95, 0.2, 0.8, 0.35):
        curve.keep(s, other)
    followed = [
        s
        for s in (0.5, 0.55, 0.05, 0.95, 0.2, 0.8, 0.35)
        if np.allclose(flat(curve.at(s)), flat(other), rtol=0, atol=1e-12)
    ]
    assert followed == [0.5, 0.2, 0.8]


def test_polynomials_of_degree_six_are_followed_exactly():
    """A cubic and three states determine it: what is added vanishes with its rate at both ends."""
    length, places = 2.0, np.array([0.25, 0.5, 0.75])
    p = np.polynomial.Polynomial([0.0, 1.0, -2.0, 0.5, 3.0, -1.0, 0.7])
    cubic = [p.deriv()(0.0), p(length), p.deriv()(length)]
    rows = np.array([*cubic, 0.0, 0.0, 0.0])[:, None]
    for k, u in enumerate(places):
        off = p(u * length) - on_curve(u, length, np.empty(0), rows[:3])[0]
        rows[3 + k] = off / (u * (1.0 - u)) ** 2
    for u in (0.1, 0.4, 0.6, 0.9):
        assert on_curve(u, length, places, rows)[0] == pytest.approx(p(u * length), abs=1e-12)


def test_cubic_beyond_a_chord_goes_through_both_of_its_ends():
    """At 0 the rates at the end; back at the start minus the chord, and the rates there over s'.

    s' is the rate at which the first state's tangent goes along that of the second.
    """
    on = piece()
    mass = on.body.mass
    jump, rates, t = (direction(on, seed) for seed in (10, 11, 12))
    back = dot(on.body, t, jump)

    def value(s: float) -> np.ndarray:
        return flat(Direction(*onward(mass, s, *jump, *rates, *t)))

    def slope(s: float) -> np.ndarray:
        return (value(s + TINY * back) - value(s - TINY * back)) / (2.0 * TINY * back)

    assert_allclose(value(0.0), 0.0, atol=0)
    assert_allclose(value(-back), -flat(jump), rtol=0, atol=1e-14)
    assert_allclose(slope(0.0), flat(t), rtol=0, atol=1e-6)
    first = rates._replace(q=np.array(chart_rate(-jump.q, rates.q)))  # in the frames of the end
    along = dot(on.body, t, first)
    assert_allclose(slope(-back), flat(first) / along, rtol=0, atol=1e-6)
