"""Stability in three dimensions of rings that fold on a symmetric path.

Truth: dense Hessians of the full ring, finite stretch as the other treatment of the constraint,
dynamic relaxation from perturbed states, and closed forms of the n-covered circle.
"""

import functools
import itertools
import math

import numpy as np
import pytest
from rods import dense, lifted, on_conditions, richardson
from shapes import scene

import der
from der.analysis.request import Request
from der.problem import total_index
from der.rod.gripped_ring import free_supports, gripped_ring
from der.rod.relaxation import relax
from der.rod.rod import State
from der.rod.system import RodSystem
from scenarios.folded_stability import Folded, threshold, thresholds

SIXTY = der.triangle(math.radians(60), 1 / 30)
OBTUSE = der.triangle(math.radians(120), 1 / 15)
STADIUM = der.rectangle(0.2, 0.2)
SHAPES = [
    (der.circle(), 1.6),
    (der.ellipse(0.6), 2.0),
    (der.ellipse(0.85, "y"), 4.0),
    (der.rectangle(0.6, 0.3, "y"), 3.0),
    (STADIUM, 1.5),
    (SIXTY, 4.0),
    (OBTUSE, 1.0),
]


@functools.cache
def folded(ring, h_over_t, **numerics):
    return der.fold(scene(ring, h_over_t, self_crossings=False, **numerics))


# --- the index identity -------------------------------------------------------------------------


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_index_with_the_moment_held(ring, h_over_t):
    """Index with M held = index with gamma held + [dM/dgamma < 0], at every state of a path.

    Truth: the dense Hessian of the full ring, on 32 edges, gamma an unknown in one of the two.
    """
    section = der.rectangular_section(h_over_t)
    sector, full = (gripped_ring(ring, section, 32, name=name) for name in ("auto", "full"))
    seen = 0
    for one in Request(self_crossings=False).follow(sector):
        if one.kind:  # singular
            continue
        at = lifted(sector, one.solution.state, full)
        held, free = (
            int(np.sum(on_conditions(*dense(full, at.state, load_free=free)) < 0))
            for free in (False, True)
        )
        assert total_index(sector, one.index) == held
        assert free == held + (one.solution.slope < 0.0)
        seen += 1
    assert seen > 15


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_indices_do_not_depend_on_the_mesh(ring, h_over_t):
    """At pi the three indices of 64, 128 and 256 edges are one, and so is their way there.

    The order in which the index changes, fold by fold and branch by branch.
    """
    ways = set()
    for n_edges in (64, 128, 256):
        path = folded(ring, h_over_t, n_edges=n_edges)
        at = path.at_pi
        way = tuple(
            (p.kind, p.index_before, p.index_after) for p in path.points if p.kind != "limit"
        )
        ways.add((at.index, at.index_moment, at.index_free, way))
    assert len(ways) == 1


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_the_index_changes_by_one_at_a_fold(ring, h_over_t):
    """At a fold one in-phase mode loses its stiffness, at a branch of a half one, of a pair two."""
    path = folded(ring, h_over_t)
    for point in (*path.folds, *path.branches):
        by = 2 if point.details.get("symmetry") == "odd" else 1
        assert abs(point.index_after - point.index_before) == by


# --- folded rings, released ---------------------------------------------------------------------


def test_thresholds_of_the_free_three_covered_circle():
    """Index 4 below h/t = 1.298935, 2 up to 3.469928, then 0 (Fourier modes of n-covered circles).

    From 64 and 128 edges 4e-4 is left at the upper and 1e-4 at the lower one.
    """
    found = []
    for n_edges in (64, 128):
        ring = Folded.of(der.circle(), n_edges)
        upper = threshold(lambda h, ring=ring: ring.index_free(h) == 0)
        lower = threshold(lambda h, ring=ring: ring.index_free(h) <= 2)
        assert [ring.index_free(h) for h in (1.2, 2.0, 4.0)] == [4, 2, 0]
        found.append((lower, upper))
    lower, upper = (richardson(*pair) for pair in zip(*found, strict=True))
    assert lower == pytest.approx(1.298935, abs=3e-4)
    assert upper == pytest.approx(3.469928, abs=3e-4)


def free_spectrum(b, h_over_t, n=81):
    """Eigenvalues of the second variation of an ellipse's folded ring, by Fourier collocation.

    The continuum, free of this package's rod: turning the frames by w2 about d2 and w3 about d3
    changes the strains by k2 = w2' - k w3 and k3 = w3' + k w2, and k1 to second order, against the
    moment c = 4 pi alpha/L that is constant (no force, Eq. B.1). Twice the energy per length is

        beta k2^2 + k3^2 - c (w2 w3' - w2' w3 + k w2^2 + k w3^2),    k = k1u + 4 pi/L,

    on what keeps the ring closed, the integral of w2 being 0; in-plane motions cost energy always.
    Two eigenvalues are rigid rotations' zeros.
    """
    ring, bar = der.ellipse(b), der.rectangular_section(h_over_t)
    uniform = 4 * np.pi / ring.length
    k = np.diag(ring.curvature(np.arange(n) * ring.length / n) + uniform)
    apart = np.subtract.outer(np.arange(n), np.arange(n))
    with np.errstate(divide="ignore"):
        rate = 0.5 * (-1.0) ** apart / np.sin(np.pi * apart / n)
    np.fill_diagonal(rate, 0.0)
    rate *= 2 * np.pi / ring.length
    k2, k3 = np.hstack([rate, -k]), np.hstack([k, rate])
    w2, w3 = np.eye(2 * n)[:n], np.eye(2 * n)[n:]
    couple = w2.T @ (rate @ w3) - (rate @ w2).T @ w3
    pushed = 0.5 * (couple + couple.T) + w2.T @ k @ w2 + w3.T @ k @ w3
    form = bar.beta * k2.T @ k2 + k3.T @ k3 - bar.alpha * uniform * pushed
    return on_conditions(form, np.append(np.ones(n), np.zeros(n))[:, None])


@pytest.mark.parametrize("b", [0.5, 0.7, 0.95])
def test_free_index_of_folded_ellipses_against_the_continuum(b):
    """Index 2, 1, 0: the upper threshold is that of index_free, the lower one that of the slope.

    Truth: Fourier collocation of the second variation, converged to 1e-6 of h/t. The rod's, from 64
    and 128 edges, is 5e-4 off.
    """

    def last(most):
        """The h/t above which at most so many eigenvalues are negative."""
        low, high = 1.5, 6.0
        while high - low > 1e-6:
            middle = 0.5 * (low + high)
            few = int(np.sum(free_spectrum(b, middle) < -1e-7)) <= most
            low, high = (low, middle) if few else (middle, high)
        return high

    coarse, fine = (thresholds(der.ellipse(b), n) for n in (64, 128))
    assert np.sort(np.abs(free_spectrum(b, 3.0)))[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert richardson(coarse["slope"], fine["slope"]) == pytest.approx(last(1), abs=5e-4)
    assert richardson(coarse["index_free"], fine["index_free"]) == pytest.approx(last(0), abs=5e-4)


@pytest.mark.parametrize("b", [0.5, 0.8])
@pytest.mark.parametrize("shape", ["ellipse", "stadium"])
def test_slopes_about_both_axes_vanish_together(shape, b):
    """dM/dgamma = 0 at one h/t about x and y: then a mode of full symmetry has no stiffness.

    At M = 0 and slope 0 the grips push in no way, to first order, so the neighbouring state is one
    of the free ring; twisted about either axis it has the same symmetry. To the bisection.
    """
    at = []
    for axis in "xy":
        ring = der.ellipse(b, axis) if shape == "ellipse" else der.rectangle(b, b, axis)
        state = Folded.of(ring, 64)
        at.append(threshold(lambda h, state=state: state.slope(h) > 0.0))
    assert at[0] == pytest.approx(at[1], rel=1e-6)


def test_an_ellipse_that_the_slope_calls_stable_is_not_when_released():
    """b/a = 0.6: the slope is positive above h/t = 2.195, the free ring a minimum above 3.63 only.

    The order is 2. Under a moment the index follows the slope.
    """
    coarse, fine = (thresholds(der.ellipse(0.6), n) for n in (64, 128))
    exact = {name: richardson(coarse[name], fine[name]) for name in coarse}
    assert exact["slope"] == pytest.approx(2.196574, abs=2e-4)
    assert exact["index_moment"] == pytest.approx(exact["slope"], abs=1e-6)
    assert exact["index_free"] == pytest.approx(3.636062, abs=3e-4)


@pytest.mark.parametrize(
    ("ring", "h_over_t", "softest"),
    [(der.ellipse(0.6), 3.0, -0.10951), (OBTUSE, 4.0, -1.7905)],
    ids=str,
)
def test_the_unstable_mode_converges(ring, h_over_t, softest):
    """The stiffness of the mode that unfolds a free ring, from 64, 128 and 256 edges.

    Of order 2; extrapolated to 2e-4 of what the next pair gives.
    """
    found = []
    for n_edges in (64, 128, 256):
        stiffness = Folded.of(ring, n_edges, h_over_t).softest_free(h_over_t)
        assert sum(value < 0.0 for value in stiffness) == 1
        found.append(min(stiffness))
    order = math.log2((found[0] - found[1]) / (found[1] - found[2]))
    assert order == pytest.approx(2.0, abs=0.1)
    assert richardson(*found) == pytest.approx(softest, rel=3e-4)


@pytest.mark.parametrize(("ring", "h_over_t"), [(der.ellipse(0.6), 3.0), (OBTUSE, 4.0)], ids=str)
@pytest.mark.parametrize("a_over_t", [50.0, 200.0])
def test_stretch_leaves_the_unstable_mode(ring, h_over_t, a_over_t):
    """With edges that stretch, one more unknown each and no constraint, the free index is 1, too.

    The state is solved for anew, free of grips.
    """
    section = der.rectangular_section(h_over_t)
    stretching = 12.0 * section.alpha * a_over_t**2
    full = gripped_ring(ring, section, 64, name="full", stretching=stretching)
    stiff, start = Folded.of(ring, 64, h_over_t).released(h_over_t)
    assert stiff.index(start) == 1
    free = RodSystem(full.rod, free_supports(full.rod))
    at = free.correct(start)
    assert at.converged
    assert free.index(at.state) == 1


@pytest.mark.parametrize(("ring", "h_over_t"), [(der.ellipse(0.6), 3.0), (OBTUSE, 4.0)], ids=str)
def test_a_ring_left_alone_unfolds_to_flat(ring, h_over_t):
    """Kicked by 0.02 rad along either sign of the unstable mode it comes to rest flat, U = 0.

    Dynamic relaxation knows no Hessian. Above the free threshold a kick along the softest mode
    decays instead.
    """
    for above in (False, True):
        h = 8.0 if above else h_over_t
        free, state = Folded.of(ring, 64).released(h)
        at = free.correct(state)
        stiffness, modes = free.softest_modes(state, 3)
        mode = modes[int(np.argmin(stiffness))]
        for sign in (1.0, -1.0):
            kick = free.increment(sign * 0.02 * mode * math.sqrt(ring.length))
            rest = relax(free, state, kick=kick)
            assert rest.rests
            assert rest.energy == pytest.approx(at.energy if above else 0.0, abs=1e-5)


# --- in the grips -------------------------------------------------------------------------------


def test_a_narrow_stadium_loses_its_symmetry_before_it_is_folded():
    """b/a = r/a = 0.2, h/t = 1.5 about x: a pair of modes at gamma = 2.967, and index 2 at pi.

    Truth: finite stretch (a/t = 200) moves the branch by 2e-6; its place is of order 2 in N; and
    the folded full ring, kicked along the mode with its grips held at pi, goes to a state of less
    energy that is a minimum.
    """
    places = [folded(STADIUM, 1.5, n_edges=n).branches[0].gamma for n in (64, 128, 256)]
    (stretched,) = folded(STADIUM, 1.5, stretch="finite").branches
    assert stretched.gamma == pytest.approx(places[0], abs=5e-6)
    order = math.log2((places[0] - places[1]) / (places[1] - places[2]))
    assert order == pytest.approx(2.0, abs=0.05)
    assert richardson(*places) == pytest.approx(2.96705, abs=2e-5)
    full, at = Folded.of(STADIUM, 64).gripped(1.5, "full")
    stiffness, modes = full.softest_modes(at.state, 2)
    assert stiffness[0] == pytest.approx(stiffness[1], rel=1e-6)
    assert stiffness[0] < 0.0
    kick = full.increment(0.05 * modes[0] * math.sqrt(STADIUM.length))
    rest = relax(full, at.state, kick=kick)
    assert rest.rests
    assert rest.energy < at.energy - 0.01
    after = full.correct(rest.state)
    assert full.index(after.state) == 0


@pytest.mark.parametrize(
    ("ring", "section", "control"),
    [
        (der.rectangle(0.35, 0.1, "y"), der.rectangular_section(8.0), "arclength"),
        (
            der.rectangle(0.42837218, 0.34569396, "y"),
            der.section(0.59594050, 9.13315875),
            "angle",
        ),
    ],
    ids=["on the path", "after a snap"],
)
def test_a_ring_without_moment_at_pi_can_be_inside_out(ring, section, control):
    """Twisted about y, narrow rectangles turn inside out: M(pi) = 0, and yet they are not folded.

    The curvature is the natural one less 4 pi/L, a total turning of -2 pi and the energy of the
    three-covered ring, 8 pi^2 alpha/L; a minimum with and without the grips. To rounding.
    """
    path = der.fold(der.Scene(ring, section, self_crossings=False, control=control, shapes=True))
    at = path.at_pi
    assert not path.mode.foldable
    assert abs(at.moment) < 1e-10
    assert at.slope > 0.0
    assert (at.index, at.index_moment, at.index_free) == (0, 0, 0)
    assert at.energy == pytest.approx(8 * math.pi**2 * section.alpha / ring.length, rel=1e-12)
    k = len(path.gamma) - 1
    assert path.gamma[k] == math.pi
    d1, _, d3 = path.shapes.frames[k].swapaxes(0, 1)
    turn = np.cross(d3, np.roll(d3, -1, axis=0))
    angle = np.arctan2(np.sum(turn * d1, axis=1), np.sum(d3 * np.roll(d3, -1, axis=0), axis=1))
    assert angle.sum() == pytest.approx(-2 * math.pi, abs=1e-9)
    assert np.ptp(path.shapes.x[k][:, 0]) < 1e-9


@pytest.mark.parametrize(
    ("ring", "h_over_t", "folded_energy", "broken"),
    [(STADIUM, 1.5, 19.608711, 19.2708), (der.ellipse(0.5), 1.3, 19.945232, 18.6248)],
    ids=str,
)
def test_where_a_ring_goes_that_loses_its_symmetry(ring, h_over_t, folded_energy, broken):
    """At pi each arm bends to one side: the folded planar state is a maximum between the two.

    Kicks along the sum and the difference of the pair of modes lead to one energy, with arms alike
    and opposed: clamped grips decouple the arms. From 64 and 128 edges.
    """
    energies = []
    for n_edges in (64, 128):
        full, at = Folded.of(ring, n_edges).gripped(h_over_t, "full")
        assert at.energy == pytest.approx(folded_energy, abs=1e-5)
        stiffness, modes = full.softest_modes(at.state, 2)
        assert stiffness[0] == pytest.approx(stiffness[1], rel=1e-6)
        ends = []
        for sign in (1.0, -1.0):
            mode = (modes[0] + sign * modes[1]) * math.sqrt(0.5 * ring.length)
            rest = relax(full, at.state, kick=full.increment(0.05 * mode))
            after = full.correct(rest.state)
            assert rest.rests
            if full.index(after.state) == 0:
                ends.append(after.energy)
        assert len(ends) > 0
        assert ends == pytest.approx([ends[0]] * len(ends), abs=1e-8)
        energies.append(ends[0])
    assert richardson(*energies) == pytest.approx(broken, abs=1e-3)


# --- triangles with several planar shapes -------------------------------------------------------


def planar_least(ring, section, n_edges):
    """The planar three-covered shape of least bending energy, as an equilibrium in the grips."""
    from der.bvp.planar.folded_half import bent_by_force

    gripped = gripped_ring(ring, section, n_edges)
    a = 0.5 * (bent_by_force(ring).angle(gripped.arc_length) - 0.5 * np.pi)
    quat = np.stack([0.0 * a, 0.0 * a, np.sin(a), np.cos(a)], axis=1)
    start = State(quat, np.zeros(len(a)), np.zeros(len(gripped.supports.target)), math.pi)
    at = gripped.correct(start, iterations=30)
    assert at.converged
    return Folded(ring, n_edges, section.alpha, at.state), gripped.copies * at.energy


@pytest.mark.parametrize(
    ("degrees", "reached", "least"), [(51.0, 29.665222, 28.388242), (56.0, 30.597502, 30.597502)]
)
def test_the_folded_triangle_is_not_always_the_planar_one_of_least_energy(degrees, reached, least):
    """r/a = 0.1, h/t = 4: the least shape is reached above 54.987 degrees, not from 49 up to there.

    Energies by Romberg's scheme from 64, 128, 256 edges, against the boundary-value problem and the
    planar rod. Either shape is unstable: index 1 under a moment, 2 or 3 when released.
    """
    ring, section = der.triangle(math.radians(degrees), 0.1), der.rectangular_section(4.0)
    energies, least_energies = [], []
    for n_edges in (64, 128, 256):
        at = folded(ring, 4.0, n_edges=n_edges).at_pi
        energies.append(at.energy)
        assert (at.index, at.index_moment, at.index_free) == (0, 1, 2)
        state, energy = planar_least(ring, section, n_edges)
        least_energies.append(energy)
        assert state.index_moment(4.0) == 1
        assert state.index_free(4.0) == (3 if degrees < 54.9 else 2)
    assert richardson(*energies) == pytest.approx(reached, abs=5e-4)
    assert richardson(*least_energies) == pytest.approx(least, abs=5e-4)


# --- scenarios ----------------------------------------------------------------------------------


def test_survey_of_an_ellipse(tmp_path):
    """b/a = 0.6 about x, h/t = 1, 2, 3, 4: not folded, unstable, unstable when released, stable."""
    from scenarios.stability_beyond_symmetry import survey, write

    verdicts = survey(quick=True)
    names = ["not folded", "slope < 0", "slope > 0, unstable released", "stable"]
    assert [one.colour for one in verdicts] == names
    assert [one.wrong for one in verdicts] == ["", "", "c", ""]
    assert verdicts[2].slope == pytest.approx(0.5954817, abs=1e-6)
    write(verdicts, tmp_path)
    assert len((tmp_path / "survey.csv").read_text().splitlines()) == 5
    assert (tmp_path / "survey.png").stat().st_size > 10_000


def test_random_rings_fold():
    """Ten rings in every way at 64 edges: no stop that is not what the ring itself does."""
    from scenarios.random_folds import tried

    found = tried(10, seed=3)
    assert [stop for stop in found.stops if not stop.explained] == []
    assert found.folded > 0


def test_removing_the_grips_never_stabilises_a_ring():
    """index_free >= index_moment >= index: each sets free what the last one held."""
    for (ring, h_over_t), n_edges in itertools.product(SHAPES, (64,)):
        at = folded(ring, h_over_t, n_edges=n_edges).at_pi
        assert at.index_moment >= at.index
        assert at.index_free is None or at.index_free >= at.index_moment
