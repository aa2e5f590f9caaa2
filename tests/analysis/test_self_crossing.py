"""Passages of strands: the signed gap, and where it vanishes on a step of a path."""

import functools
import math

import numpy as np
import pytest

import der
import der.continuation.events
from der.analysis.self_crossing import gap, nearest_strands
from der.continuation.arclength import Tally, Visit, Wanted, follow
from der.continuation.step import Step
from der.kernels.quaternions import rotation_vector
from der.rod.equilibrium import Control, Direction, equilibrium, moved
from der.rod.gripped_ring import Sector, sector
from der.rod.stability import indices_and_stiffness, stack


def eight(height: float, n: int = 40) -> np.ndarray:
    """Figure of eight whose strands cross at a right angle, 2 height apart, at t = 0 and pi."""
    t = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    return np.stack([np.sin(t), 0.5 * np.sin(2.0 * t), height * np.cos(t)], axis=1)


@functools.cache
def contacts() -> tuple[Sector, tuple[Visit, ...]]:
    """Quarter of the circle with h/t = 4, 32 edges, and the passages on its path."""
    piece = sector(der.circle(), der.rectangular_section(4.0), 32)
    found = follow(piece, Wanted(stability=False, targets=()), Tally())
    return piece, tuple(one for one in found if one.kind == "contact")


@functools.cache
def a_step() -> Step:
    """A long step of that ring, between gamma = 1 and 1.5."""
    piece = sector(der.circle(), der.rectangular_section(4.0), 32)
    found = follow(piece, Wanted(stability=False, contacts=False, targets=(1.0, 1.5)), Tally())
    a, b = (one.at for one in found if one.at.state.load in (1.0, 1.5))
    trial = Step(piece, a, b, 1.0, 1e-10, Tally())
    length = float(np.vdot(piece.body.mass * a.tangent.q, trial.jump.q))
    length += a.tangent.load * trial.jump.load
    return Step(piece, a, b, length, 1e-10, Tally())


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


def test_the_link_changes_at_a_contact():
    """It is `linking_before` at the state given, and `linking_after` 1e-5 further along s."""
    piece, found = contacts()
    assert len(found) >= 2
    for one in found:
        t, s = one.at.tangent, 1e-5
        step = Direction(s * t.q, s * t.force, s * t.load)
        start = moved(piece.held, one.at.state, step)
        beyond = equilibrium(piece.body, piece.held, start, along=t, control=Control.DIRECTION)
        assert piece.link(one.at.state) == one.details["linking_before"]
        assert piece.link(beyond.state) == one.details["linking_after"]


def test_bisection_finds_the_same_contacts(monkeypatch):
    """Where passages are not seen the link is bisected, to 1e-5 of s."""
    _, found = contacts()
    monkeypatch.setattr(der.continuation.events, "passage", lambda *_: None)
    bisected = contacts.__wrapped__()[1]
    assert [one.details for one in bisected] == [one.details for one in found]
    gammas = [one.at.state.load for one in found]
    assert [one.at.state.load for one in bisected] == pytest.approx(gammas, abs=1e-5)


def test_no_contact_is_made_up_where_a_ring_ends_in_its_plane():
    """A stadium that turns back ends inside out, covering itself five times: Lk is not defined.

    What rounding made of Tw + Wr there could show as a contact 1e-6 rad before the end.
    """
    section = der.rectangular_section(3.006756668718511, nu=0.0)
    ring = der.rectangle(0.4824982358095524, 0.3494169915718395, twist_axis="y")
    piece = sector(ring, section, 64)
    *_, before, last = follow(piece, Wanted(stability=False, targets=(-3.1,)), Tally())
    assert last.at.state.load == -math.pi
    assert der.continuation.events.covering(piece, last.at) == -5
    assert der.continuation.events.touches_itself(piece, last.at)
    assert (before.kind, last.link) == ("", None)
    assert der.continuation.events.covering(piece, before.at) is None
    assert not der.continuation.events.touches_itself(piece, before.at)


def test_a_wrong_passage_does_no_harm(monkeypatch):
    """What is no passage splits the step like any other place."""
    _, found = contacts()
    monkeypatch.setattr(
        der.continuation.events, "passage", lambda step, low, high: low + 0.3 * (high - low)
    )
    misled = contacts.__wrapped__()[1]
    assert [one.details for one in misled] == [one.details for one in found]
    gammas = [one.at.state.load for one in found]
    assert [one.at.state.load for one in misled] == pytest.approx(gammas, abs=1e-5)


# --- steps and roots --------------------------------------------------------------------------


def test_states_found_in_a_step_improve_its_curve():
    """One state takes most of the cubic's error away, three nearly all; measured 4.7 and 770."""
    step = a_step()
    s = 0.45 * step.length
    exact = step.polished(s, step.expected(s)).state

    def error(*known: float) -> float:
        fresh = Step(step.piece, step.start, step.end, step.length, 1e-10, Tally())
        for u in known:
            fresh.at(u * step.length)
        return float(np.linalg.norm(rotation_vector(fresh.expected(s).quat, exact.quat)))

    assert error(0.7) < error() / 3.0
    assert error(0.2, 0.5, 0.8) < error() / 200.0


def test_a_state_is_solved_for_once():
    """The same s gives the same state, and costs nothing the second time."""
    step = a_step()
    fresh = Step(step.piece, step.start, step.end, step.length, 1e-10, Tally())
    first, spent = fresh.at(0.1), fresh.tally.newton_iterations
    assert fresh.at(0.1) is first
    assert fresh.tally.newton_iterations == spent > 0


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_classes_together_give_what_they_give_alone(name):
    """One kernel assembles a state once for all classes: to the last bit the same."""
    piece = sector(der.circle(), der.rectangular_section(4.0), 32, name=name)
    at = (piece.body, piece.held)
    together = indices_and_stiffness(*at, piece.modes, piece.start)
    alone = [
        indices_and_stiffness(*at, stack([modes]), piece.start)
        for _, modes in piece.classes.values()
    ]
    assert together == tuple(tuple(one[k][0] for one in alone) for k in (0, 1))
