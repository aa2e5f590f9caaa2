"""Falls in time, overdamped and inertial: rates, frequencies, energy, and where they end."""

import functools
import math
from itertools import pairwise

import numpy as np
import pytest
from rods import solved

import der
from der.analysis.loading import follow_angle, follow_moment
from der.analysis.snap import KICK, Landing
from der.continuation.events import Visit, Wanted
from der.continuation.step import Tally
from der.kernels.assembly import assemble
from der.kernels.quaternions import rotation_vector
from der.rod.equilibrium import Direction, Equilibrium, Outcome, moved
from der.rod.gradient_flow import flow
from der.rod.gripped_ring import Sector, sector
from der.rod.implicit_step import on_the_conditions, step, weights
from der.rod.motion import move
from der.rod.relaxation import Rest, relax
from der.rod.rod import State
from der.rod.stability import all_modes, softest_modes

WAYS = {"relaxed": relax, "flowing": flow, "moving": move}
IN_TIME = pytest.mark.parametrize("way", [flow, move])


@functools.cache
def folded(
    h_over_t: float, control: str, name: str = "quarter", **options: float
) -> tuple[Sector, tuple[Visit, ...]]:
    """Return a circle of 32 edges and what a march up to pi hands out."""
    piece = sector(der.circle(), der.rectangular_section(h_over_t), 32, name=name, **options)
    follower = {"angle": follow_angle, "moment": follow_moment}[control]
    wanted = Wanted(contacts=False, stability=False)
    return piece, tuple(follower(piece, wanted, Tally()))


def fall_from(visits: tuple[Visit, ...]) -> tuple[Equilibrium, Landing]:
    """Return the state before the first snap, and its landing."""
    k = next(k for k, visit in enumerate(visits) if visit.kind == "snap")
    assert isinstance(visits[k], Landing)
    return visits[k - 1].at, visits[k]


def kick(at: Equilibrium, load: bool) -> Direction:
    """Return the displacement along the tangent with which a snap begins."""
    t = at.tangent
    return Direction(KICK * t.q, 0.0 * t.force, KICK * t.load if load else 0.0)


def softest(piece: Sector, at: Equilibrium) -> tuple[float, np.ndarray]:
    """Return the lowest eigenvalue and its mode."""
    (value,), (mode,) = softest_modes(piece.body, piece.held, all_modes(piece.held), at.state)
    return float(value), mode


def amplitude(piece: Sector, at: Equilibrium, mode: np.ndarray, state: State) -> float:
    """Return how much of a mode there is in a state beside an equilibrium."""
    w = rotation_vector(at.state.quat, state.quat)
    return float(np.sum(piece.body.length[:, None] * mode[:, :3] * w))


def at_rest(h_over_t: float, name: str = "quarter") -> tuple[Sector, Equilibrium]:
    """Return a stable equilibrium half way to pi."""
    piece, visits = folded(h_over_t, "angle", name)
    at = next(v.at for v in visits if v.at.state.load == 0.25 * math.pi)
    return piece, solved(piece.body, piece.held, at.state)


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_a_soft_mode_decays_at_the_rate_of_its_eigenvalue(name):
    """Overdamped, amplitudes go as exp(-mu t), mu from the eigenproblem: to 1 %.

    Implicit Euler, with errors of 3e-8 rad a step, of a displacement of 1e-3 at first.
    """
    piece, at = at_rest(4.0, name)
    mu, mode = softest(piece, at)
    push = Direction(1e-3 * mode, 0.0 * at.state.force, 0.0)
    found = flow(
        piece.body, piece.held, at.state, kick=push, accuracy=3e-8, tolerance=1e-5, every=1
    )
    sizes = np.array([amplitude(piece, at, mode, state) for state in found.history])
    span = (sizes > 0.2 * sizes[0]) & (sizes < 0.9 * sizes[0])
    rate = -np.polyfit(found.times[span], np.log(sizes[span]), 1)[0]
    assert rate == pytest.approx(mu, rel=0.01)


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_a_soft_mode_swings_at_the_root_of_its_eigenvalue(name):
    """Undamped, the ring swings as cos(sqrt(mu) t): half a period between its turns, to 1 %."""
    piece, at = at_rest(4.0, name)
    mu, mode = softest(piece, at)
    push = Direction(1e-2 * mode, 0.0 * at.state.force, 0.0)
    found = move(
        piece.body,
        piece.held,
        at.state,
        kick=push,
        damping=0.0,
        accuracy=1e-6,
        duration=4.0 * math.pi / math.sqrt(mu),
        every=1,
    )
    assert found.outcome is Rest.TOO_MANY_EVALUATIONS
    sizes = np.array([amplitude(piece, at, mode, state) for state in found.history])
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
    piece, at = at_rest(4.0)
    mu, mode = softest(piece, at)
    push = Direction(0.1 * mode, 0.0 * at.state.force, 0.0)
    duration = 4.0 * math.pi / math.sqrt(mu)
    left = []
    for damping in (0.0, 0.3):
        found = move(
            piece.body,
            piece.held,
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
    piece, visits = folded(1.6, "angle")
    before, _ = fall_from(visits)
    found = flow(piece.body, piece.held, before.state, kick=kick(before, load=False), every=1)
    assert np.diff(found.energies).max() < 1e-12
    assert np.diff(found.times).min() > 0.0
    assert len(found.history) == found.steps + 1
    for state in found.history:
        at = (state.quat, state.stretch, state.force, float(state.load))
        assert np.abs(assemble(piece.body, piece.held, *at).gap).max() < 1e-6
        assert state.load == before.state.load


@pytest.mark.parametrize("name", ["quarter", "full"])
@pytest.mark.parametrize("way", WAYS)
def test_three_ways_to_fall_from_a_fold_end_in_one_state(way, name):
    """At h/t = 1.6: the landing of the snap, in every frame, to 1e-5 rad before any polish."""
    piece, visits = folded(1.6, "angle", name)
    before, landing = fall_from(visits)
    found = WAYS[way](
        piece.body, piece.held, before.state, kick=kick(before, load=False), tolerance=1e-6
    )
    assert found.outcome is Rest.AT_REST
    after = solved(piece.body, piece.held, found.state)
    assert after.energy == pytest.approx(landing.at.energy, abs=1e-10)
    assert np.abs(np.abs((after.state.quat * landing.at.state.quat).sum(axis=1)) - 1).max() < 1e-10


@pytest.mark.parametrize("way", [relax, flow])
def test_a_push_that_breaks_the_symmetry_changes_nothing(way):
    """The full rectangle about y, h/t = 4, pushed at random by 0.03 rad in every edge at its fold.

    It lands in the symmetric state all the same, to 1e-9 in energy.
    """
    piece = sector(der.rectangle(0.6, 0.3, "y"), der.rectangular_section(4.0), 64, name="full")
    visits = tuple(follow_angle(piece, Wanted(contacts=False, stability=False), Tally()))
    before, landing = fall_from(visits)
    push = kick(before, load=False)
    noise = np.random.default_rng(0).normal(size=push.q.shape) * piece.held.free
    found = way(
        piece.body,
        piece.held,
        before.state,
        kick=push._replace(q=push.q + 0.03 * noise),
        tolerance=1e-6,
    )
    assert found.rests
    after = solved(piece.body, piece.held, found.state)
    assert after.energy == pytest.approx(landing.at.energy, abs=1e-9)


def test_a_stretchable_ring_falls_the_same_ways():
    """With finite EA, four unknowns an edge: overdamped and inertial falls end as relaxed ones."""
    piece, visits = folded(1.6, "angle", stretching=1e4)
    before, landing = fall_from(visits)
    for way in (flow, move):
        found = way(
            piece.body, piece.held, before.state, kick=kick(before, load=False), tolerance=1e-6
        )
        assert found.rests
        assert found.energy == pytest.approx(landing.at.energy, abs=1e-7)


@IN_TIME
def test_a_dead_moment_carries_the_load_to_where_the_snap_lands(way):
    """Under the limit's moment at h/t = 1.6 the ring rests before its stop: gamma to 1e-4 rad."""
    piece, visits = folded(1.6, "moment")
    before, landing = fall_from(visits)
    found = way(
        piece.body,
        piece.held,
        before.state,
        kick=kick(before, load=True),
        moment=before.moment,
        stops=(0.0, math.pi),
        tolerance=1e-6,
    )
    assert found.rests
    assert found.moment == pytest.approx(before.moment, abs=1e-5)
    assert found.state.load == pytest.approx(landing.at.state.load, abs=1e-4)


@IN_TIME
def test_a_dead_moment_ends_at_its_stop(way):
    """At h/t = 4 nothing holds the ring before pi."""
    piece, visits = folded(4.0, "moment")
    before, _ = fall_from(visits)
    push = kick(before, load=True)
    stops = (0.0, math.pi)
    found = way(piece.body, piece.held, before.state, kick=push, moment=before.moment, stops=stops)
    assert found.outcome is Rest.AT_STOP
    assert found.state.load >= math.pi


def test_inertia_can_carry_a_ring_over_a_state_of_rest():
    """An ellipse, b/a = 0.85, about y, h/t = 4, at its first limit: overdamped it comes to rest.

    Swinging with little damping it passes gamma = 1.98 and reaches the stop, where its own moment,
    0, is less than the dead one: it stays folded.
    """
    piece = sector(der.ellipse(0.85, "y"), der.rectangular_section(4.0), 64)
    visits = tuple(follow_moment(piece, Wanted(contacts=False, stability=False), Tally()))
    before, landing = fall_from(visits)
    options = {
        "kick": kick(before, load=True),
        "moment": before.moment,
        "stops": (-np.inf, math.pi),
        "tolerance": 1e-6,
    }
    slow = flow(piece.body, piece.held, before.state, **options)
    swinging = move(piece.body, piece.held, before.state, damping=0.1, **options)
    assert slow.rests
    assert slow.state.load == pytest.approx(landing.at.state.load, abs=1e-4)
    assert slow.state.load < 2.0
    assert swinging.outcome is Rest.AT_STOP


@IN_TIME
def test_too_few_steps_are_a_result(way):
    """With the state that was reached, and a name."""
    piece, visits = folded(1.6, "angle")
    before, _ = fall_from(visits)
    found = way(piece.body, piece.held, before.state, kick=kick(before, load=False), most=3)
    assert found.outcome is Rest.TOO_MANY_EVALUATIONS
    assert found.steps == 3
    assert not found.rests
    assert found.history == ()


@IN_TIME
def test_a_start_that_is_bent_too_far_is_a_result(way):
    """It says at which vertex."""
    piece = sector(der.circle(), der.rectangular_section(4.0), 32)
    q = np.zeros(piece.held.free.shape)
    q[3, 0] = 3.0
    bent = moved(piece.held, piece.start, Direction(q, 0.0 * piece.start.force, 0.0))
    found = way(piece.body, piece.held, bent)
    assert found.outcome is Rest.BENT_TOO_FAR
    assert found.where in (2, 3)


def test_a_step_is_not_taken_to_a_saddle():
    """Without masses to speak of a step is Newton's method; from a saddle it is refused."""
    piece, visits = folded(1.6, "angle")
    before, _ = fall_from(visits)
    tilted = moved(piece.held, before.state, kick(before, load=False))
    on = on_the_conditions(piece.body, piece.held, tilted).state
    mass = weights(piece.body, piece.held)
    options = {"known": 0.0 * mass, "moment": None, "tolerance": 1e-9}
    long = step(piece.body, piece.held, on, on, mass=mass, shift=1e-9, **options)
    short = step(piece.body, piece.held, on, on, mass=mass, shift=1e3, **options)
    assert long.outcome is Outcome.SINGULAR
    assert short.outcome is Outcome.CONVERGED


@IN_TIME
def test_falls_take_fewer_factorisations_where_little_happens(way):
    """A ring that rests falls nowhere: a few steps."""
    piece, at = at_rest(4.0)
    found = way(piece.body, piece.held, at.state, tolerance=1e-7)
    assert found.rests
    assert found.steps <= 3
