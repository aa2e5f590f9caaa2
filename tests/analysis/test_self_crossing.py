"""Self-crossings: the signed gap of two strands, and where it vanishes on a step of a path."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

import der
import der.analysis.self_crossing
from der.analysis.request import Request
from der.continuation.step import Step, between
from der.kernels.quaternions import rotation_vector
from der.kernels.strands import gap, nearest_strands
from der.problem import PLANE, Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.rod import State


def eight(height: float, n: int = 40) -> np.ndarray:
    """Figure of eight whose strands cross at a right angle, 2 height apart, at t = 0 and pi."""
    t = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    return np.stack([np.sin(t), 0.5 * np.sin(2.0 * t), height * np.cos(t)], axis=1)


@functools.cache
def crossings() -> tuple[GrippedRing, tuple[Point[Equilibrium], ...]]:
    """Quarter of the circle with h/t = 4, 32 edges, and the self-crossings on its path."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32)
    found = Request(stability=False, targets=()).follow(ring)
    return ring, tuple(one for one in found if one.kind == "contact")


@functools.cache
def a_step() -> Step[State]:
    """A long step of that ring, between gamma = 1 and 1.5."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32)
    found = Request(stability=False, self_crossings=False, targets=(1.0, 1.5)).follow(ring)
    a, b = (one.solution for one in found if one.solution.parameter in (1.0, 1.5))
    return between(ring, a, b, tolerance=1e-10, statistics=Statistics())


@pytest.mark.parametrize("height", [0.1, 1e-3, -1e-3, -0.1])
def test_gap_is_the_distance_of_the_strands(height):
    """2 |height| between the middles of edges that cross there; the sign tells which is above."""
    x = eight(height)
    distance = 2.0 * height * math.cos(math.pi / 40)  # of chords, not of the curve
    assert gap(x, 2, 23) == pytest.approx(distance * np.sign(gap(eight(0.1), 0, 20)), rel=1e-9)


def test_nearest_strands_are_those_that_cross_on_the_way():
    """From one side to the other: vertices beside t = 0 and t = pi, half the curve apart."""
    i, k = nearest_strands(eight(0.1), eight(-0.1))
    near_zero, near_pi = {0, 39}, {19, 20}
    assert (i in near_zero and k in near_pi) or (i in near_pi and k in near_zero)


def test_a_plane_convex_curve_has_no_strands_but_opposite_ones():
    """An arc has to turn by pi to meet itself: of a square no two vertices next to each other."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    i, k = nearest_strands(square, 0.1 * square)
    assert k - i == 2


def test_the_link_changes_at_a_self_crossing():
    """It is `linking_before` at the state given, and `linking_after` 1e-5 further along s."""
    ring, found = crossings()
    assert len(found) >= 2
    for one in found:
        here = one.solution
        start = ring.retract(here.state, 1e-5 * here.tangent)
        beyond = ring.correct(start, along=here.tangent, hold=PLANE)
        assert ring.link(here.state) == one.details["linking_before"]
        assert ring.link(beyond.state) == one.details["linking_after"]


def test_bisection_finds_the_same_self_crossings(monkeypatch):
    """Where crossings are not seen the link is bisected, to 1e-5 of s."""
    _, found = crossings()
    monkeypatch.setattr(der.analysis.self_crossing, "crossing", lambda *_: None)
    bisected = crossings.__wrapped__()[1]
    assert [one.details for one in bisected] == [one.details for one in found]
    gammas = [one.solution.parameter for one in found]
    assert [one.solution.parameter for one in bisected] == pytest.approx(gammas, abs=1e-5)


def test_no_self_crossing_is_made_up_where_a_ring_ends_in_its_plane():
    """A stadium that turns back ends inside out, covering itself five times: Lk is not defined.

    What rounding made of Tw + Wr there could show as a self-crossing 1e-6 rad before the end.
    """
    section = der.rectangular_section(3.006756668718511, nu=0.0)
    stadium = der.rectangle(0.4824982358095524, 0.3494169915718395, twist_axis="y")
    ring = gripped_ring(stadium, section, 64)
    *_, before, last = Request(stability=False, targets=(-3.1,)).follow(ring)
    assert last.solution.parameter == -math.pi
    assert ring.turning_number(last.solution.state) == -5
    assert ring.overlaps(last.solution.state)
    assert before.kind == ""
    assert ring.turning_number(before.solution.state) is None
    assert not ring.overlaps(before.solution.state)


def test_a_wrong_place_does_no_harm(monkeypatch):
    """What is no crossing splits the step like any other place."""
    _, found = crossings()
    monkeypatch.setattr(
        der.analysis.self_crossing,
        "crossing",
        lambda ring, step, low, high: low + 0.3 * (high - low),
    )
    misled = crossings.__wrapped__()[1]
    assert [one.details for one in misled] == [one.details for one in found]
    gammas = [one.solution.parameter for one in found]
    assert [one.solution.parameter for one in misled] == pytest.approx(gammas, abs=1e-5)


# --- steps and roots --------------------------------------------------------------------------


def test_states_found_in_a_step_improve_its_curve():
    """One state takes most of the cubic's error away, three nearly all; measured 4.7 and 770."""
    step = a_step()
    s = 0.45 * step.length
    exact = step.polished(s, step.expected(s)).state

    def error(*known: float) -> float:
        fresh = replace(step, statistics=Statistics())
        for u in known:
            fresh.at(u * step.length)
        return float(np.linalg.norm(rotation_vector(fresh.expected(s).quat, exact.quat)))

    assert error(0.7) < error() / 3.0
    assert error(0.2, 0.5, 0.8) < error() / 200.0


def test_a_state_is_solved_for_once():
    """The same s gives the same state, and costs nothing the second time."""
    step = a_step()
    fresh = replace(step, statistics=Statistics())
    first, spent = fresh.at(0.1), fresh.statistics.newton_iterations
    assert fresh.at(0.1) is first
    assert fresh.statistics.newton_iterations == spent > 0


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_classes_together_give_what_they_give_alone(name):
    """One kernel assembles a state once for all classes: to the last bit the same."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32, name=name)
    together = ring.indices(ring.start)
    alone = [ring.indices(ring.start, label) for label in ring.classes]
    assert together == tuple(tuple(one[k][0] for one in alone) for k in (0, 1))
