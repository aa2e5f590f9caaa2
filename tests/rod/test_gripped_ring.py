"""A gripped ring as a quarter, a half or the full ring: one ring, three problems."""

import math
from functools import cache

import classical
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rods import Derivatives, derivatives

from der import Ring, circle, ellipse, rectangle, rectangular_section, triangle
from der.geometry.mesh import sites
from der.kernels.quaternions import rotation
from der.rod.gripped_ring import GrippedRing, free_supports, gripped_ring
from der.rod.rod import State, discrete_rod
from der.rod.supports import supported

SECTORS = ("full", "half", "quarter")
SECTION = rectangular_section(h_over_t=4)
N = 16

EVERY_SECTOR = pytest.mark.parametrize("name", SECTORS)
STRETCHING = pytest.mark.parametrize("stretching", [0.0, 40.0], ids=["inextensible", "EA 40"])
D2 = {
    "circle": circle(),
    "ellipse": ellipse(0.6, "y"),
    "rectangle": rectangle(0.6, 0.3),
}
RINGS = {**D2, "triangle": triangle(1.2, 0.1)}
SECTORS_OF_RINGS = pytest.mark.parametrize(
    ("shape", "name"), [(r, s) for r in RINGS for s in SECTORS if s != "quarter" or r in D2]
)


def at(ring: GrippedRing, state: State) -> Derivatives:
    """The sector's Lagrangian and its derivatives."""
    return derivatives(ring.rod, ring.supports, state)


def start(ring: GrippedRing) -> Derivatives:
    """The same on the flat ring, without forces."""
    return at(ring, ring.start)


@cache
def twisted(
    shape: str, name: str, gamma: float, stretching: float = 0.0
) -> tuple[GrippedRing, State]:
    """Equilibrium of a sector with grips turned by ``gamma``, reached in steps of 0.3."""
    ring = gripped_ring(RINGS[shape], SECTION, N, name=name, stretching=stretching)
    state = ring.start
    axis = np.array([0.0, 0.0, 1.0])
    for load in np.linspace(0.0, gamma, 1 + math.ceil(gamma / 0.3))[1:]:
        # d1 tilts with the grips, which spares Newton's method the first guess
        w = ring.supports.turn[:, None] * (load - state.load) * axis
        quat = classical.spun(state.quat, w)
        found = ring.correct(state.but(quat=quat, load=float(load)))
        assert found.converged, found.advice
        state = found.state
    return ring, state


def on(name: str, shape: str, gamma: float, stretching: float) -> tuple[GrippedRing, State, float]:
    """The state of the smallest sector seen by another, with forces fitted, and what they leave.

    The gradient is linear in the forces of the position conditions.
    """
    small, state = twisted(shape, "quarter" if shape in D2 else "half", gamma, stretching)
    ring = gripped_ring(RINGS[shape], SECTION, N, name=name, stretching=stretching)
    part = {
        "full": slice(None),
        "half": slice(0, N // 2 + 1),
        "quarter": slice(N // 4, N // 2 + 1),
    }[name]
    quat = np.ascontiguousarray(small.full_frames(state)[part])
    rest = gripped_ring(RINGS[shape], SECTION, N, name="full", stretching=stretching).rod.length
    stretch = (small.full_lengths(state) / rest - 1.0)[part]
    seen = State(quat, stretch, np.zeros(len(ring.supports.target)), gamma)
    system, free = at(ring, seen), ring.supports.free
    force, *_ = np.linalg.lstsq(system.border[free], -system.grad[free])
    seen = seen.but(force=force)
    system = at(ring, seen)
    return ring, seen, max(np.abs(system.grad[free]).max(), np.abs(system.gap).max())


# --- layout ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "n"), [("full", 16), ("half", 9), ("quarter", 5)])
def test_number_of_frames(name, n):
    """N, N/2 + 1 and N/4 + 1: grips and free points lie on the middles of edges."""
    ring = gripped_ring(circle(), SECTION, N, name=name)
    assert ring.rod.n_edges == n == len(ring.start.quat) == len(ring.arc_length)


@EVERY_SECTOR
def test_copies_make_the_ring(name):
    """Lengths of edges and cells times the copies are the ring's, to rounding."""
    ring = gripped_ring(ellipse(0.6), SECTION, N, name=name)
    length = ellipse(0.6).length
    assert ring.copies * ring.rod.length.sum() == pytest.approx(length, rel=1e-14)
    assert ring.copies * ring.rod.cell.sum() == pytest.approx(length, rel=1e-14)


@pytest.mark.parametrize(("shape", "name"), [("ellipse", "quarter"), ("triangle", "half")])
def test_auto_is_the_smallest_sector(shape, name):
    """A quarter where the ring has three half-turns (D2), else a half."""
    assert gripped_ring(RINGS[shape], SECTION, N).name == name


@pytest.mark.parametrize(
    ("name", "turn"),
    [("full", {0: 1.0, 8: -1.0}), ("half", {0: 1.0, 8: -1.0}), ("quarter", {4: -1.0})],
)
def test_grips_turn_against_each_other(name, turn):
    """+gamma at s = 0, -gamma at s = L/2, about E3; nothing else turns."""
    supports = gripped_ring(circle(), SECTION, N, name=name).supports
    assert {int(j): supports.turn[j] for j in np.flatnonzero(supports.turn)} == turn
    assert np.array_equal(supports.turn_axis, [0.0, 0.0, 1.0])


@EVERY_SECTOR
@STRETCHING
def test_grips_hold_frame_and_length(name, stretching):
    """A turning edge has no freedom; all others have, but for the free point of a quarter.

    There only the turn about d2 = E2, and the stretch, go with the half-turn about E2.
    """
    ring = gripped_ring(circle(), SECTION, N, name=name, stretching=stretching)
    free = ring.supports.free
    grips = ring.supports.turn != 0.0
    assert not free[grips].any()
    if name == "quarter":
        assert free[0].tolist() == [False, True, False, True][: ring.rod.block]
        grips[0] = True
    assert free[~grips].all()


@EVERY_SECTOR
def test_grips_and_free_points_lie_on_the_axes(name):
    """Middles of edges 0 and N/2 on -E3 and +E3, of N/4 and 3N/4 on E2; rounding of the sum."""
    ring = gripped_ring(ellipse(0.6), SECTION, N, name=name)
    x, _ = ring.shape(ring.start)
    middle = 0.5 * (x + np.roll(x, 1, axis=0))
    off_axis = [middle[0, :2], middle[8, :2], middle[4, ::2], middle[12, ::2]]
    assert_allclose(off_axis, np.zeros((4, 2)), rtol=0, atol=1e-14)
    assert middle[0, 2] < 0.0 < middle[8, 2]


@EVERY_SECTOR
def test_flat_circle_is_a_regular_polygon(name):
    """Sides h = 2 pi/N, tangent directions: circumradius h/(2 sin(h/2)); d1 = E1. Rounding."""
    ring = gripped_ring(circle(), SECTION, N, name=name)
    x, frames = ring.shape(ring.start)
    h = 2.0 * np.pi / N
    s = h * (np.arange(N) + 0.5)
    radius = 0.5 * h / np.sin(0.5 * h)
    expected = radius * np.column_stack([0.0 * s, np.sin(s), -np.cos(s)])
    assert_allclose(x, expected, rtol=0, atol=1e-14)
    assert_allclose(frames[:, 0], np.tile([1.0, 0.0, 0.0], (N, 1)), rtol=0, atol=1e-15)


@SECTORS_OF_RINGS
def test_flat_ring_has_the_shape_of_the_ring(shape, name):
    """Vertices lie where the curve does, to second order: the error falls 3.5 times or more.

    From 64 to 128 edges; 4 in the limit. The curves have corners of finite radius only.
    """
    curve = RINGS[shape]

    def error(n: int) -> float:
        ring = gripped_ring(curve, SECTION, n, name=name)
        x, _ = ring.shape(ring.start)
        s = sites(curve, n, "full")
        s = 0.5 * (s[1:] + s[:-1])
        return float(np.sqrt(np.mean((x - curve.position(s)) ** 2)))

    assert error(128) < error(64) / 3.5


@SECTORS_OF_RINGS
@STRETCHING
def test_modes_of_the_classes_are_those_of_the_ring(shape, name, stretching):
    """Degrees of freedom less conditions, class by class and with multiplicity, miss no mode."""

    def modes(name: str) -> int:
        ring = gripped_ring(RINGS[shape], SECTION, N, name=name, stretching=stretching)
        return sum(
            times * (int(some.free.sum()) - len(some.axis))
            for times, some in ring.symmetry.values()
        )

    assert modes(name) == modes("full")


# --- bad input ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ring", "n_edges", "name", "message"),
    [
        (circle(), 18, "quarter", "n_edges.*divisible by 4.*'quarter', got 18"),
        (circle(), 18, "auto", "n_edges.*divisible by 4.*'quarter', got 18"),
        (circle(), 17, "half", "n_edges.*divisible by 2.*'half', got 17"),
        (circle(), 17, "full", "n_edges.*divisible by 2.*'full', got 17"),
        (circle(), 0, "full", "n_edges.*got 0"),
        (circle(), -16, "full", "n_edges.*got -16"),
        (circle(), 16, "third", "sector must be.*quarter.*got 'third'"),
        (triangle(1.2, 0.1), 16, "quarter", "sector.*triangle.*'quarter'"),
    ],
)
def test_impossible_sectors_are_refused(ring: Ring, n_edges, name, message):
    """A ValueError with the argument, what is allowed and what was given."""
    with pytest.raises(ValueError, match=message):
        gripped_ring(ring, SECTION, n_edges, name=name)


def test_unknown_measure_is_refused():
    """By name, with the ones there are."""
    with pytest.raises(ValueError, match=r"curvature must be one of .*angle.*got 'cosine'"):
        gripped_ring(circle(), SECTION, N, measure="cosine")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rest": [0.0]}, r"rest has shape \(1,\)"),
        ({"cell": [1.0, 0.0]}, r"cell lengths must be .* > 0, got a smallest of 0"),
        ({"cell": [1.0, math.nan]}, r"cell lengths must be finite"),
        ({"stiffness": (1.0, -2.0, 1.0)}, r"stiffness must be three .* > 0, got .*-2"),
        ({"stretching": -1.0}, r"stretching must be .* >= 0, got -1"),
        ({"stretching": math.inf}, r"stretching must be finite"),
    ],
)
def test_impossible_rods_are_refused(change, message):
    """ValueError with the argument and the value."""
    good = {"cell": [1.0, 1.0], "rest": [0.0, 0.0], "stiffness": (1.0, 1.0, 1.0)}
    with pytest.raises(ValueError, match=message):
        discrete_rod(**{**good, **change})


def test_edge_that_turns_must_be_clamped():
    """Else its frame would be both free and prescribed."""
    rod = discrete_rod([1.0, 1.0], [0.0, 0.0], (1.0, 1.0, 1.0))
    with pytest.raises(ValueError, match="edge 2 turns"):
        supported(rod, clamped=(0,), turn={2: 1.0})


# --- the flat ring --------------------------------------------------------------------------


@EVERY_SECTOR
@STRETCHING
@pytest.mark.parametrize("measure", ["logarithm", "angle"])
def test_naturally_circular_ring_is_free_of_stress(measure, stretching, name):
    """Natural curvature 1: no energy, no gradient, no gap; rounding of angles times EI2/h = 80."""
    system = start(
        gripped_ring(circle(), SECTION, N, name=name, measure=measure, stretching=stretching)
    )
    assert system.energy < 1e-28
    assert_allclose(system.grad, np.zeros_like(system.grad), rtol=0, atol=1e-13)
    assert_allclose(system.gap, np.zeros_like(system.gap), rtol=0, atol=1e-14)


@EVERY_SECTOR
@pytest.mark.parametrize("measure", ["logarithm", "angle"])
@pytest.mark.parametrize("curvature", [-1.0, 0.0, 0.5, 2.0])
def test_energy_of_a_flat_ring_of_natural_curvature(curvature, measure, name):
    """U = pi alpha (1 - K)^2 (a = 1, EI1 = alpha), exact for measures of the angle: rounding."""
    ring = gripped_ring(circle(curvature), SECTION, N, name=name, measure=measure)
    expected = math.pi * SECTION.alpha * (1.0 - curvature) ** 2
    assert ring.copies * start(ring).energy == pytest.approx(expected, rel=1e-13)


@EVERY_SECTOR
def test_flat_ring_of_any_natural_curvature_is_an_equilibrium(name):
    """A constant moment balances itself: no gradient where the ring is free to move; rounding."""
    ring = gripped_ring(circle(0.3), SECTION, N, name=name)
    system, free = start(ring), ring.supports.free
    assert_allclose(system.grad[free], 0.0, rtol=0, atol=1e-13)


@SECTORS_OF_RINGS
def test_flat_ring_has_no_moment(shape, name):
    """U is even in gamma, as reflection in the plane changes its sign; rounding."""
    ring = gripped_ring(RINGS[shape], SECTION, N, name=name)
    assert ring.arm_moment(start(ring).load_grad) == pytest.approx(0.0, abs=1e-13)


def test_free_flat_ring_is_in_equilibrium():
    """Closed and without grips: no gradient, no gap; only edge 0's rotation is held."""
    rod = gripped_ring(circle(), SECTION, N, name="full", stretching=40.0).rod
    supports = free_supports(rod)
    flat = gripped_ring(circle(), SECTION, N, name="full").start
    system = derivatives(rod, supports, flat.but(force=np.zeros(3)))
    assert (~supports.free).sum() == 3
    assert_allclose(system.grad, np.zeros((N, 4)), rtol=0, atol=1e-13)
    assert_allclose(system.gap, np.zeros(3), rtol=0, atol=1e-14)


# --- one state, three sectors ---------------------------------------------------------------

BIGGER = pytest.mark.parametrize(
    ("shape", "name"),
    [(r, s) for r in D2 for s in ("full", "half")] + [("triangle", "full")],
)


@BIGGER
@STRETCHING
def test_equilibrium_of_a_sector_is_one_of_the_ring(shape, name, stretching):
    """Principle of symmetric criticality: forces exist that leave no gradient, and no gap.

    The sector is solved to 1e-10; unfolding and fitting the forces cost rounding.
    """
    *_, left = on(name, shape, 0.6, stretching)
    assert left < 5e-10


@BIGGER
@STRETCHING
def test_energy_of_a_sector_times_copies_is_that_of_the_ring(shape, name, stretching):
    """The same vertices and edges, counted once or by copies: rounding."""
    ring, seen, _ = on(name, shape, 0.6, stretching)
    small, state = twisted(shape, "quarter" if shape in D2 else "half", 0.6, stretching)
    expected = small.copies * at(small, state).energy
    assert ring.copies * at(ring, seen).energy == pytest.approx(expected, rel=1e-12)


@BIGGER
@STRETCHING
def test_moment_of_an_arm_is_that_of_the_ring(shape, name, stretching):
    """M = (1/4) dU/dgamma of the full ring from each sector; residuals of 1e-10: 1e-8."""
    ring, seen, _ = on(name, shape, 0.6, stretching)
    small, state = twisted(shape, "quarter" if shape in D2 else "half", 0.6, stretching)
    expected = small.arm_moment(at(small, state).load_grad)
    assert expected > 0.1
    assert ring.arm_moment(at(ring, seen).load_grad) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("shape", RINGS)
@STRETCHING
def test_moment_is_a_quarter_of_the_slope_of_energy(shape, stretching):
    """M = (1/4) dU/dgamma along equilibria; a stencil of fourth order, h = 0.02: 1e-6."""
    name = "quarter" if shape in D2 else "half"
    ring, state = twisted(shape, name, 0.6, stretching)

    def energy(h: float) -> float:
        found, there = twisted(shape, name, 0.6 + h, stretching)
        return found.copies * at(found, there).energy

    slope = classical.difference(energy, 0.02)
    assert ring.arm_moment(at(ring, state).load_grad) == pytest.approx(0.25 * slope, rel=1e-6)


@pytest.mark.parametrize("shape", RINGS)
def test_grips_have_turned_by_gamma(shape):
    """Frames of edges 0 and N/2 are the flat ring's, turned about E3 by +gamma and -gamma."""
    small, state = twisted(shape, "quarter" if shape in D2 else "half", 0.6)
    flat, now = small.full_frames(small.start), small.full_frames(state)
    for j, gamma in ((0, 0.6), (N // 2, -0.6)):
        expected = classical.spun(flat[[j]], np.array([0.0, 0.0, gamma]))
        assert_allclose(rotation(now[j]), rotation(expected[0]), rtol=0, atol=1e-14)


@pytest.mark.parametrize("shape", RINGS)
def test_grips_slide_along_their_axis_only(shape):
    """Middles of edges 0 and N/2 stay on the axis E3; gaps are solved to 1e-10."""
    small, state = twisted(shape, "quarter" if shape in D2 else "half", 0.6)
    x, _ = small.shape(state)
    middle = 0.5 * (x + np.roll(x, 1, axis=0))
    assert_allclose(middle[[0, N // 2], :2], np.zeros((2, 2)), rtol=0, atol=5e-10)


@pytest.mark.parametrize("shape", D2)
def test_free_points_stay_on_their_axis(shape):
    """The half-turn about E2 keeps the middles of edges N/4 and 3N/4, and d2 = E2 or -E2 there."""
    small, state = twisted(shape, "quarter", 0.6)
    x, frames = small.shape(state)
    middle = 0.5 * (x + np.roll(x, 1, axis=0))
    assert_allclose(middle[[N // 4, 3 * N // 4], ::2], np.zeros((2, 2)), rtol=0, atol=5e-10)
    assert_allclose(np.abs(frames[[N // 4, 3 * N // 4], 1, 1]), np.ones(2), rtol=0, atol=1e-14)


@SECTORS_OF_RINGS
def test_untwisted_ring_has_link_zero(shape, name):
    """Flat, d1 = E1 all around; and gamma on one grip is undone by -gamma on the other."""
    ring, state = twisted(shape, name, 0.6)
    assert ring.link(ring.start) == 0
    assert ring.link(state) == 0
