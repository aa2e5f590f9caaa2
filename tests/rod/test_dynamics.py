"""Motions in time, overdamped and inertial: rates, frequencies, energy, and where they end."""

import functools
import math
from itertools import pairwise

import numpy as np
import pytest
from rods import derivatives, solved

import der
from der.analysis.loading import follow_angle, follow_moment
from der.analysis.request import Request
from der.analysis.snap import KICK, Landing
from der.errors import Reason
from der.kernels.quaternions import rotation_vector
from der.problem import Increment, Point, Statistics
from der.rod.dynamics import flow, swing
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.implicit_step import Inertia, on_the_conditions, step, weights
from der.rod.relaxation import Rest, relax
from der.rod.rod import State

METHODS = {"relaxed": relax, "flowing": flow, "swinging": swing}
NOTHING_MORE = Request(self_crossings=False, stability=False)
IN_TIME = pytest.mark.parametrize("method", [flow, swing])


@functools.cache
def folded(
    h_over_t: float, control: str, name: str = "quarter", **options: float
) -> tuple[GrippedRing, tuple[Point, ...]]:
    """Return a circle of 32 edges and what loading up to pi hands out."""
    ring = gripped_ring(der.circle(), der.rectangular_section(h_over_t), 32, name=name, **options)
    follower = {"angle": follow_angle, "moment": follow_moment}[control]
    return ring, tuple(follower(ring, NOTHING_MORE, Statistics()))


def first_snap(points: tuple[Point, ...]) -> tuple[Equilibrium, Landing]:
    """Return the state before the first snap, and its landing."""
    k = next(k for k, point in enumerate(points) if point.kind == "snap")
    assert isinstance(points[k], Landing)
    return points[k - 1].solution, points[k]


def kick(ring: GrippedRing, at: Equilibrium, load: bool) -> Increment:
    """Return the displacement along the tangent with which a snap begins."""
    push = ring.displacement(at.tangent, KICK)
    push[-1] *= load
    return push


def softest(ring: GrippedRing, at: Equilibrium) -> tuple[float, np.ndarray]:
    """Return the lowest eigenvalue and its mode."""
    (value,), (mode,) = ring.softest_modes(at.state)
    return float(value), mode


def amplitude(ring: GrippedRing, at: Equilibrium, mode: np.ndarray, state: State) -> float:
    """Return how much of a mode there is in a state beside an equilibrium."""
    w = rotation_vector(at.state.quat, state.quat)
    return float(np.sum(ring.rod.length[:, None] * mode[:, :3] * w))


def at_rest(h_over_t: float, name: str = "quarter") -> tuple[GrippedRing, Equilibrium]:
    """Return a stable equilibrium half way to pi."""
    ring, points = folded(h_over_t, "angle", name)
    at = next(one.solution for one in points if one.solution.parameter == 0.25 * math.pi)
    return ring, solved(ring, at.state)


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_a_soft_mode_decays_at_the_rate_of_its_eigenvalue(name):
    """Overdamped, amplitudes go as exp(-mu t), mu from the eigenproblem: to 1 %.

    Implicit Euler, with errors of 3e-8 rad a step, of a displacement of 1e-3 at first.
    """
    ring, at = at_rest(4.0, name)
    mu, mode = softest(ring, at)
    push = ring.increment(1e-3 * mode)
    found = flow(ring, at.state, kick=push, accuracy=3e-8, tolerance=1e-5, every=1)
    sizes = np.array([amplitude(ring, at, mode, state) for state in found.history])
    span = (sizes > 0.2 * sizes[0]) & (sizes < 0.9 * sizes[0])
    rate = -np.polyfit(found.times[span], np.log(sizes[span]), 1)[0]
    assert rate == pytest.approx(mu, rel=0.01)


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_a_soft_mode_swings_at_the_root_of_its_eigenvalue(name):
    """Undamped, the ring swings as cos(sqrt(mu) t): half a period between its turns, to 1 %."""
    ring, at = at_rest(4.0, name)
    mu, mode = softest(ring, at)
    push = ring.increment(1e-2 * mode)
    found = swing(
        ring,
        at.state,
        kick=push,
        damping=0.0,
        accuracy=1e-6,
        duration=4.0 * math.pi / math.sqrt(mu),
        every=1,
    )
    assert found.outcome is Rest.TOO_MANY_EVALUATIONS
    sizes = np.array([amplitude(ring, at, mode, state) for state in found.history])
    crossings = [
        a + (b - a) * p / (p - q)
        for (a, p), (b, q) in pairwise(zip(found.times, sizes, strict=True))
        if p * q < 0.0
    ]
    assert len(crossings) == 4
    assert np.diff(crossings).mean() == pytest.approx(math.pi / math.sqrt(mu), rel=0.01)


def test_a_motion_keeps_its_energy_but_for_what_damping_takes():
    """Undamped, elastic and kinetic energy together stay, to 1 % of what is exchanged.

    The method's own damping, of second order in the step, takes the rest; with damping 0.3 nine
    tenths and more are gone after the same time.
    """
    ring, at = at_rest(4.0)
    mu, mode = softest(ring, at)
    push = ring.increment(0.1 * mode)
    duration = 4.0 * math.pi / math.sqrt(mu)
    left = []
    for damping in (0.0, 0.3):
        found = swing(
            ring,
            at.state,
            kick=push,
            damping=damping,
            accuracy=1e-5,
            duration=duration,
        )
        spent = found.energy + found.kinetic - at.energy
        left.append(spent / (found.energy_start - at.energy))
    assert left[0] == pytest.approx(1.0, abs=0.01)
    assert left[1] < 0.1


def test_a_flow_only_goes_down_and_keeps_to_its_conditions():
    """Each implicit step lowers the energy; position conditions are met all the way, to 1e-6."""
    ring, points = folded(1.6, "angle")
    before, _ = first_snap(points)
    found = flow(ring, before.state, kick=kick(ring, before, load=False), every=1)
    assert np.diff(found.energies).max() < 1e-12
    assert np.diff(found.times).min() > 0.0
    assert len(found.history) == found.steps + 1
    for state in found.history:
        at = (state.quat, state.stretch, state.force, float(state.load))
        assert np.abs(derivatives(ring.rod, ring.supports, State(*at)).gap).max() < 1e-6
        assert state.load == before.state.load


@pytest.mark.parametrize("name", ["quarter", "full"])
@pytest.mark.parametrize("method", METHODS)
def test_three_motions_from_a_fold_end_in_one_state(method, name):
    """At h/t = 1.6: the landing of the snap, in every frame, to 1e-5 rad before any polish."""
    ring, points = folded(1.6, "angle", name)
    before, landing = first_snap(points)
    found = METHODS[method](ring, before.state, kick=kick(ring, before, load=False), tolerance=1e-6)
    assert found.outcome is Rest.AT_REST
    after = solved(ring, found.state)
    assert after.energy == pytest.approx(landing.solution.energy, abs=1e-10)
    assert (
        np.abs(np.abs((after.state.quat * landing.solution.state.quat).sum(axis=1)) - 1).max()
        < 1e-10
    )


@pytest.mark.parametrize("method", [relax, flow])
def test_a_push_that_breaks_the_symmetry_changes_nothing(method):
    """The full rectangle about y, h/t = 4, pushed at random by 0.03 rad in every edge at its fold.

    It lands in the symmetric state all the same, to 1e-9 in energy.
    """
    section = der.rectangular_section(4.0)
    ring = gripped_ring(der.rectangle(0.6, 0.3, "y"), section, 64, name="full")
    points = tuple(follow_angle(ring, NOTHING_MORE, Statistics()))
    before, landing = first_snap(points)
    push = kick(ring, before, load=False)
    noise = np.random.default_rng(0).normal(size=ring.supports.free.shape) * ring.supports.free
    found = method(
        ring,
        before.state,
        kick=push + ring.increment(0.03 * noise),
        tolerance=1e-6,
    )
    assert found.rests
    after = solved(ring, found.state)
    assert after.energy == pytest.approx(landing.solution.energy, abs=1e-9)


def test_a_stretchable_ring_moves_to_the_same_state():
    """With finite EA, four unknowns an edge: flowing and swinging end as relaxation does."""
    ring, points = folded(1.6, "angle", stretching=1e4)
    before, landing = first_snap(points)
    for method in (flow, swing):
        found = method(ring, before.state, kick=kick(ring, before, load=False), tolerance=1e-6)
        assert found.rests
        assert found.energy == pytest.approx(landing.solution.energy, abs=1e-7)


@IN_TIME
def test_a_dead_moment_carries_the_load_to_where_the_snap_lands(method):
    """Under the limit's moment at h/t = 1.6 the ring rests before its stop: gamma to 1e-4 rad."""
    ring, points = folded(1.6, "moment")
    before, landing = first_snap(points)
    found = method(
        ring,
        before.state,
        kick=kick(ring, before, load=True),
        moment=before.moment,
        stops=(0.0, math.pi),
        tolerance=1e-6,
    )
    assert found.rests
    assert found.moment == pytest.approx(before.moment, abs=1e-5)
    assert found.state.load == pytest.approx(landing.solution.state.load, abs=1e-4)


@IN_TIME
def test_a_dead_moment_ends_at_its_stop(method):
    """At h/t = 4 nothing holds the ring before pi."""
    ring, points = folded(4.0, "moment")
    before, _ = first_snap(points)
    push = kick(ring, before, load=True)
    stops = (0.0, math.pi)
    found = method(ring, before.state, kick=push, moment=before.moment, stops=stops)
    assert found.outcome is Rest.AT_STOP
    assert found.state.load >= math.pi


def test_inertia_can_carry_a_ring_over_a_state_of_rest():
    """An ellipse, b/a = 0.85, about y, h/t = 4, at its first limit: overdamped it comes to rest.

    Swinging with little damping it passes gamma = 1.98 and reaches the stop, where its own moment,
    0, is less than the dead one: it stays folded.
    """
    ring = gripped_ring(der.ellipse(0.85, "y"), der.rectangular_section(4.0), 64)
    points = tuple(follow_moment(ring, NOTHING_MORE, Statistics()))
    before, landing = first_snap(points)
    options = {
        "kick": kick(ring, before, load=True),
        "moment": before.moment,
        "stops": (-np.inf, math.pi),
        "tolerance": 1e-6,
    }
    slow = flow(ring, before.state, **options)
    swinging = swing(ring, before.state, damping=0.1, **options)
    assert slow.rests
    assert slow.state.load == pytest.approx(landing.solution.state.load, abs=1e-4)
    assert slow.state.load < 2.0
    assert swinging.outcome is Rest.AT_STOP


@IN_TIME
def test_too_few_steps_are_a_result(method):
    """With the state that was reached, and a name."""
    ring, points = folded(1.6, "angle")
    before, _ = first_snap(points)
    found = method(ring, before.state, kick=kick(ring, before, load=False), most=3)
    assert found.outcome is Rest.TOO_MANY_EVALUATIONS
    assert found.steps == 3
    assert not found.rests
    assert found.history == ()


@IN_TIME
def test_a_start_that_is_bent_too_far_is_a_result(method):
    """It says at which vertex."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32)
    q = np.zeros(ring.supports.free.shape)
    q[3, 0] = 3.0
    bent = ring.retract(ring.start, ring.increment(q))
    found = method(ring, bent)
    assert found.outcome is Rest.BENT_TOO_FAR
    assert found.where in (2, 3)


def test_a_step_is_not_taken_to_a_saddle():
    """Without masses to speak of a step is Newton's method; from a saddle it is refused."""
    ring, points = folded(1.6, "angle")
    before, _ = first_snap(points)
    tilted = ring.retract(before.state, kick(ring, before, load=False))
    on = on_the_conditions(ring, tilted).state
    mass = weights(ring)
    long, short = (
        step(ring, on, on, Inertia(mass, 0.0 * mass, shift), tolerance=1e-9)
        for shift in (1e-9, 1e3)
    )
    assert long.reason is Reason.SINGULAR
    assert short.reason is Reason.CONVERGED


@IN_TIME
def test_motions_take_fewer_factorisations_where_little_happens(method):
    """A ring at rest stays there: a few steps."""
    ring, at = at_rest(4.0)
    found = method(ring, at.state, tolerance=1e-7)
    assert found.rests
    assert found.steps <= 3
