"""Dynamic relaxation: forces without a Hessian, and rest where Newton's method finds it."""

import math

import numpy as np
import pytest
from rods import E1, E3, MEASURES, solved, straight, unloaded

import der
from der.kernels.assembly import assemble
from der.kernels.forces import Motion, Pull, gradient, no_pull
from der.rod.equilibrium import Control, Direction, Equilibrium, equilibrium, moved
from der.rod.gripped_ring import Sector, sector
from der.rod.relaxation import Relaxed, Rest, relax
from der.rod.rod import Rod, State
from der.rod.supports import Supports, supports


def circle(n_edges: int = 64, h_over_t: float = 4.0, **options: object) -> Sector:
    """Return a sector of a circle."""
    return sector(der.circle(), der.rectangular_section(h_over_t), n_edges, **options)


def step(piece: Sector, *, q: np.ndarray | None = None, load: float = 0.0) -> Direction:
    """Return an increment of rotations and load."""
    q = np.zeros(piece.held.free.shape) if q is None else q
    return Direction(q, np.zeros(len(piece.held.target)), load)


def twisted(piece: Sector, gamma: float) -> Equilibrium:
    """Return the equilibrium at ``gamma``, by Newton's method in small steps from flat."""
    at = solved(piece.body, piece.held, piece.start)
    for load in np.linspace(0.0, gamma, max(2, int(gamma / 0.05) + 2))[1:]:
        rise = load - at.state.load
        q = at.tangent.q * (rise / at.tangent.load)
        at = solved(
            piece.body, piece.held, moved(piece.held, at.state, step(piece, q=q, load=rise))
        )
    return at


def turned_on(piece: Sector, gamma: float, rise: float) -> State:
    """Return the equilibrium at ``gamma`` with its grips alone turned by ``rise`` more."""
    return moved(piece.held, twisted(piece, gamma).state, step(piece, load=rise))


def pull_on(body: Rod, held: Supports, state: State) -> tuple[float, Pull]:
    """Return energy and forces of a state at rest."""
    rest = np.zeros(held.free.shape), np.zeros(1)
    motion = Motion(state.quat, state.stretch, np.array([state.load]), *rest, *rest)
    pull = no_pull(held)
    energy, _ = gradient(body, held, motion, pull)
    return energy, pull


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("name", ["full", "quarter"])
@pytest.mark.parametrize("stretching", [0.0, 50.0])
def test_forces_are_those_of_the_assembly(measure, name, stretching):
    """The gradient without a Hessian is the one with it, at a bent, twisted, pulled state.

    Two ways to the same sums, of entries up to 1e3: 1e-11 is a hundred roundings.
    """
    piece = circle(16, measure=measure, name=name, stretching=stretching)
    held = piece.held._replace(pull=np.full((piece.body.n_edges, 3), [0.3, -0.2, 0.5]))
    q = np.random.default_rng(1).normal(size=held.free.shape) * 0.1 * held.free
    state = moved(held, piece.start, step(piece, q=q, load=0.4))
    energy, pull = pull_on(piece.body, held, state)
    system = assemble(piece.body, held, state.quat, state.stretch, 0.0 * state.force, state.load)
    assert energy == pytest.approx(system.energy, rel=1e-13)
    assert np.abs(pull.grad - system.grad).max() < 1e-11
    assert np.abs(pull.gap - system.gap).max() < 1e-13
    assert np.abs(pull.load_border - system.load_border).max() < 1e-13
    assert abs(pull.load_grad[0] - system.load_grad) < 1e-11


@pytest.mark.parametrize(
    "options",
    [
        {"name": "quarter"},
        {"name": "half"},
        {"name": "full"},
        {"measure": "angle"},
        {"measure": "tangent"},
        {"stretching": 1e3},
    ],
)
def test_comes_to_rest_where_newton_does(options):
    """Moment and multipliers of the state of rest are those of Newton's, to the tolerance.

    Residuals of 1e-9 and compliances of order 1 leave 1e-8; the goal is 1e-6 in M.
    """
    piece = circle(32, **options)
    end = relax(piece.body, piece.held, turned_on(piece, 0.6, 0.05))
    newton = twisted(piece, 0.65)
    assert end.outcome is Rest.AT_REST
    assert end.residual <= 1e-9
    assert end.kinetic <= 1e-18
    assert abs(piece.moment(end.moment - newton.moment)) < 1e-7
    assert np.abs(end.state.force - newton.state.force).max() < 1e-7


def test_energy_only_falls():
    """From rest, no configuration has more energy than the first: motion only spends it."""
    piece = circle()
    end = relax(piece.body, piece.held, turned_on(piece, 1.0, 0.05), every=1)
    assert end.energies.max() <= end.energies[0] * (1.0 + 1e-12)
    assert end.energy < end.energy_start
    assert end.restarts > 3


def test_a_long_film_is_thinned_out(monkeypatch):
    """It has every k-th, then every 2k-th, ... of the configurations, the first one always."""
    piece = circle()
    start = turned_on(piece, 1.0, 0.05)
    whole = relax(piece.body, piece.held, start, every=1)
    monkeypatch.setattr("der.rod.relaxation._SLOTS", 50)
    thin = relax(piece.body, piece.held, start, every=1)
    stride = 2 ** math.ceil(math.log2(len(whole.history) / 50))
    assert stride > 2
    np.testing.assert_array_equal(thin.energies, whole.energies[::stride])
    for few, many in zip(thin.history, whole.history[::stride], strict=True):
        np.testing.assert_array_equal(few.quat, many.quat)


@pytest.mark.parametrize("name", ["quarter", "full"])
def test_evaluations_grow_like_the_number_of_edges(name):
    """Forces of second order in arc length: the exponent of N is 1, not 2 as in positions.

    Fitted over N = 16 to 256; measured 0.8. 1.3 tells the two apart.
    """
    edges = np.array([16, 32, 64, 128, 256])
    counts = []
    for n in edges:
        piece = circle(int(n), name=name)
        end = relax(piece.body, piece.held, turned_on(piece, 1.0, 0.05))
        assert end.rests
        counts.append(end.evaluations)
    assert np.polyfit(np.log(edges), np.log(counts), 1)[0] < 1.3


def test_dead_moment_turns_the_grips_to_its_equilibrium():
    """Under a dead moment gamma comes to where the ring's moment is that one."""
    piece = circle(32)
    start = twisted(piece, 0.3)
    end = relax(piece.body, piece.held, start.state, moment=1.05 * start.moment)
    newton = equilibrium(
        piece.body, piece.held, start.state, control=Control.MOMENT, moment=1.05 * start.moment
    )
    assert end.rests
    assert newton.converged
    assert abs(end.state.load - newton.state.load) < 1e-8
    assert abs(end.moment - 1.05 * start.moment) < 1e-9


def test_dead_moment_stops_at_the_stop():
    """A moment above the peak of M(gamma), 1.483 at h/t = 4, drives gamma to its stop."""
    piece = circle(32)
    end = relax(piece.body, piece.held, piece.start, moment=2.0, stops=(-1.0, 2.5))
    assert end.outcome is Rest.AT_STOP
    assert end.state.load >= 2.5


def test_cantilever_under_a_dead_force():
    """Bisshopp and Drucker: P L^2/EI = 1 deflects the tip by 0.3017208 L.

    Second order in the cell: 64 cells leave 1e-4.
    """
    body = straight(64, (1.0, 1.0, 1.0))
    held = supports(body, clamped=(0,), pull=E1)
    start = unloaded(body, np.tile([1.0, 0.0, 0.0, 0.0], (body.n_edges, 1)), 0, load=1.0)
    end = relax(body, held, start)
    tip = (der.rod.rod.edges(body, end.state)).sum(axis=0)
    assert end.rests
    assert tip @ E1 == pytest.approx(0.3017208, abs=1e-4)
    assert tip @ E3 == pytest.approx(0.9435668, abs=1e-4)


def test_a_start_off_its_conditions_is_put_on_them():
    """Random rotations of 0.1 rad break the closure; the relaxed state is closed, the same one."""
    piece = circle(32)
    at = twisted(piece, 0.5)
    q = np.random.default_rng(2).normal(size=piece.held.free.shape) * 0.1 * piece.held.free
    end = relax(piece.body, piece.held, at.state, kick=step(piece, q=q))
    assert end.rests
    assert abs(der.rod.rod.edges(piece.body, end.state).sum(axis=0)[0]) < 1e-9
    assert abs(end.energy - at.energy) < 1e-9


def test_history_is_kept_on_request():
    """Every 10th configuration, the first one included; none unless asked for."""
    piece = circle(16)
    start = turned_on(piece, 0.5, 0.05)
    silent = relax(piece.body, piece.held, start)
    told = relax(piece.body, piece.held, start, every=10)
    assert silent.history == ()
    assert len(told.history) == (told.evaluations + 9) // 10 == len(told.energies)
    assert np.array_equal(told.state.quat, silent.state.quat)
    assert told.energies[0] == told.energy_start


def failing(most: int, kick: float) -> Relaxed:
    """Return a relaxation that cannot succeed."""
    piece = circle(16)
    q = np.zeros(piece.held.free.shape)
    q[1, 1] = kick
    start = turned_on(piece, 0.5, 0.05)
    return relax(piece.body, piece.held, start, kick=step(piece, q=q), most=most)


def test_too_few_evaluations_are_a_value():
    """A relaxation that is cut short says so and hands out where it is."""
    end = failing(10, 0.0)
    assert end.outcome is Rest.TOO_MANY_EVALUATIONS
    assert end.evaluations == 10


def test_a_rod_bent_too_far_is_named_with_its_vertex():
    """An edge turned by nearly 180 degrees cannot be relaxed: its vertex is named."""
    end = failing(1000, 3.1)
    assert end.outcome is Rest.BENT_TOO_FAR
    assert end.where in (0, 1)
