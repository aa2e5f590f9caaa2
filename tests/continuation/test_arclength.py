"""The path follower: what it locates is where it says, and does not depend on its steps."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from rods import solved

import der
from der.analysis.request import Request
from der.continuation.step import Step
from der.errors import ContinuationFailed, Reason
from der.kernels.quaternions import rotation_vector
from der.problem import PLANE, Options, Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring

FINE = Options(aimed_turn=0.05)


def circle(h_over_t: float) -> GrippedRing:
    """Return the quarter of a circle of 64 edges."""
    return gripped_ring(der.circle(), der.rectangular_section(h_over_t), 64)


def asked_of(h_over_t: float) -> Request:
    """Return what the path is asked for; h/t = 1 is followed beyond pi until it is folded."""
    return Request(6.0 if h_over_t == 1.0 else math.pi, until_folded=h_over_t == 1.0)


@functools.cache
def points(h_over_t: float) -> tuple[GrippedRing, tuple[Point, ...]]:
    """Quarter and states of its path."""
    ring = circle(h_over_t)
    return ring, tuple(asked_of(h_over_t).follow(ring))


def of_kind(h_over_t: float, kind: str) -> tuple[GrippedRing, list[Point]]:
    """Quarter and special points of one kind."""
    ring, found = points(h_over_t)
    return ring, [point for point in found if point.kind == kind]


def along(ring: GrippedRing, at: Equilibrium, s: float) -> Equilibrium:
    """Return the equilibrium at a distance s from another, measured along its tangent."""
    start = ring.retract(at.state, s * at.tangent)
    return solved(ring, start, along=at.tangent, hold=PLANE)


def at_load(ring: GrippedRing, at: Equilibrium, load: float) -> Equilibrium:
    """Return the equilibrium at a load near that of another."""
    rise = (load - at.parameter) / at.parameter_rate
    return solved(ring, ring.retract(at.state, rise * at.tangent), value=load)


def folded(h_over_t: float, **wants: object) -> der.Path:
    """Path of a circle of 64 edges."""
    return der.fold(der.Scene(der.circle(), der.rectangular_section(h_over_t), **wants))


def test_cubic_prediction_is_of_fourth_order():
    """Halving the steps divides the error of `Step.beyond` by 2^4; measured 16.2.

    The cubic through two states and tangents, 4 h^4/24 times the fourth derivative off.
    """
    ring, found = points(4.0)
    middle = next(one.solution for one in found if one.solution.parameter > 0.5)
    errors = []
    for h in (0.04, 0.02):
        behind, ahead = along(ring, middle, -h), along(ring, middle, h)
        guess = Step(ring, behind, middle, h, 1e-10, Statistics()).beyond(h)
        start = ring.retract(middle.state, guess)
        exact = solved(ring, start, along=middle.tangent, hold=PLANE)
        errors.append(np.linalg.norm(rotation_vector(start.quat, exact.state.quat)))
        assert exact.parameter == pytest.approx(ahead.parameter, abs=1e-6)
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.1)


# --- special points ---------------------------------------------------------------------------


@pytest.mark.parametrize("h_over_t", [1.6, 1.0])
def test_gamma_is_stationary_at_a_fold(h_over_t):
    """dgamma/ds = 0 at a fold, to the 1e-12 of s at which it is sought times d2gamma/ds2, 2 to 8.

    Measured 4e-14.
    """
    _, folds = of_kind(h_over_t, "fold")
    assert len(folds) == 2
    assert max(abs(fold.solution.parameter_rate) for fold in folds) < 3e-11


@pytest.mark.parametrize("h_over_t", [1.6, 1.0])
def test_fold_is_located_to_1e_10(h_over_t):
    """gamma at a fold is the extremum of the parabola through solved states 1e-4 on either side.

    An independent location: it uses no rate. Its own error is of order 1e-16, and measured; a fold
    that is off by 1e-5 along the path is off by 1e-10 in gamma.
    """
    ring, folds = of_kind(h_over_t, "fold")
    for fold in folds:
        s = np.array([-1e-4, 0.0, 1e-4])
        gamma = np.array([along(ring, fold.solution, x).parameter for x in s])
        curvature = (gamma[0] - 2 * gamma[1] + gamma[2]) / s[2] ** 2
        slope = (gamma[2] - gamma[0]) / (2 * s[2])
        assert gamma[1] - slope**2 / (2 * curvature) == pytest.approx(
            fold.solution.parameter, abs=1e-10
        )
        assert abs(curvature) > 0.1


@pytest.mark.parametrize("h_over_t", [4.0, 1.6, 1.0])
def test_moment_is_stationary_at_a_limit(h_over_t):
    """dM/dgamma = 0 at a limit, by differences of solved states 2e-5 and 4e-5 to either side.

    The five-point formula, of fourth order, since the corner by the fold at h/t = 1.6 has a third
    derivative of 5e4. Measured 6e-10, rounding; d2M/dgamma2 is 0.14 to 180, so that 2e-9 means
    gamma within 2e-8 at the flattest limit.
    """
    ring, limits = of_kind(h_over_t, "limit")
    assert limits
    for limit in limits:
        at = limit.solution
        d = 2e-5
        m = [at_load(ring, at, at.parameter + k * d).moment for k in (-2, -1, 1, 2)]
        slope = ring.arm_moment(8 * (m[2] - m[1]) - (m[3] - m[0])) / (12 * d)
        assert abs(slope) < 2e-9
        assert (m[1] - at.moment) * (m[2] - at.moment) > 0.0


def test_index_differs_across_folds_and_branches():
    """The bracket of every fold and branch point holds different indices."""
    for h_over_t, until, count in ((1.6, None, 2), (1.0, "folded", 5)):
        path = folded(h_over_t, until=until, self_crossings=False)
        points = [point for point in path.points if point.kind in ("fold", "branch")]
        assert len(points) == count
        assert all(point.index_before != point.index_after for point in points)


# --- states that were asked for -----------------------------------------------------------------


def test_states_that_were_asked_for_have_exactly_that_gamma():
    """gamma of a state asked for is that float, bit for bit, in path order; pi ends the path."""
    asked = (0.3, 1.0, 2.0, 2.3, 3.0)
    path = folded(4.0, save_at=asked)
    assert [gamma for gamma in path.gamma if gamma in asked] == list(asked)
    assert path.gamma[-1] == math.pi


def test_every_crossing_of_a_gamma_is_solved_for():
    """At h/t = 1.6, gamma passes 2.7 three times: up, back between the folds, and up again.

    Folds at 2.767 and 2.611 for 64 edges. Three different states, as their moments tell.
    """
    path = folded(1.6, save_at=(2.7,))
    crossings = np.flatnonzero(path.gamma == 2.7)
    assert len(crossings) == 3
    first, second = (point.position for point in path.folds)
    assert crossings[0] < first < crossings[1] < second < crossings[2]
    assert np.abs(np.diff(path.moment[crossings])).min() > 0.1


@pytest.mark.parametrize("h_over_t", [4.0, 1.6])
def test_multiples_of_an_eighth_of_pi_are_solved_for(h_over_t):
    """Without a list every crossing of k pi/8 is a state; their number follows from the folds.

    h/t = 1.6: gamma turns at 2.767 and 2.611 and so passes 7 pi/8 = 2.749 three times.
    """
    path = folded(h_over_t)
    counts = [int(np.sum(path.gamma == k * (math.pi / 8))) for k in range(9)]
    assert counts == [1, 1, 1, 1, 1, 1, 1, 3 if h_over_t == 1.6 else 1, 1]


@pytest.mark.parametrize("gamma_max", [0.01, 1.234, 2.7, 4.0])
def test_path_ends_at_its_first_arrival_at_gamma_max(gamma_max):
    """The last state has gamma_max exactly, and no state before it."""
    path = folded(1.6, gamma_max=gamma_max)
    assert path.gamma[-1] == gamma_max
    assert path.gamma[:-1].max() < gamma_max


def test_states_asked_for_lie_on_the_path():
    """M at a given gamma, down to 1e-6 from a fold, does not depend on the steps that led there.

    Folds of h/t = 1.6 at 2.7671699 and 2.6109781. gamma is exact, but M errs by a residual of 1e-10
    over dgamma/ds, 4e-3 at the closest: measured 4e-10. Crossings differ by 5e-4 and more in M.
    """
    asked = (2.610979, 2.62, 2.7, 2.767169)
    ring = circle(1.6)
    usual, short = (
        [one.solution for one in Request(targets=asked, options=options).follow(ring)]
        for options in (Options(), FINE)
    )
    for gamma in asked:
        a, b = (
            [ring.arm_moment(at.moment) for at in found if at.parameter == gamma]
            for found in (usual, short)
        )
        assert len(a) == 3
        assert np.abs(np.diff(a)).min() > 2e-4
        assert a == pytest.approx(b, abs=1.5e-9)


# --- steps --------------------------------------------------------------------------------------


def special(found: list[Point]) -> list[Point]:
    """Special points, but for contacts near the folded state.

    There the loops are closer to each other than the sides of the polygon to its circle, and
    polygons pass through each other: an artefact, not looked for in the last step.
    """
    return [
        one
        for one in found
        if one.kind and (one.kind != "contact" or abs(one.solution.parameter - math.pi) > 0.25)
    ]


@pytest.mark.parametrize("h_over_t", [4.0, 1.6, 1.0])
def test_points_do_not_depend_on_the_steps(h_over_t):
    """Steps of 0.05 instead of 0.12 rad give the same points: kinds, gamma, indices.

    Limits agree to 4e-11, folds and branch points to 4e-12; 1e-9 is asked for. Contacts to 1e-4,
    since they are sought to 1e-5 of s.
    """
    ring, found, steps = circle(h_over_t), [], []
    for options in (Options(), FINE):
        count = Statistics()
        request = replace(asked_of(h_over_t), options=options)
        found.append(special(list(request.follow(ring, count))))
        steps.append(count.steps)
    usual, short = found
    assert steps[1] > 1.3 * steps[0]
    assert [one.kind for one in short] == [one.kind for one in usual]
    for a, b in zip(usual, short, strict=True):
        assert a.sides == b.sides
        within = 1e-4 if a.kind == "contact" else 1e-9
        assert a.solution.parameter == pytest.approx(b.solution.parameter, abs=within)


@pytest.mark.parametrize("h_over_t", [4.0, 1.6, 1.0])
def test_path_keeps_its_orientation(h_over_t):
    """The extended system's determinant keeps its sign along a path without simple branch points.

    Truth: Keller 1977; its sign is that of dgamma/ds times (-1)^index. A jump to
    another branch, or a turn back, changes it. Odd pairs are not seen on the quarter.
    """
    _, found = points(h_over_t)
    regular = [one.solution for one in found if one.kind in ("", "contact")]
    signs = {(-1) ** at.index * math.copysign(1.0, at.parameter_rate) for at in regular}
    assert len(signs) == 1


def test_a_full_ring_takes_no_more_steps_than_its_half():
    """A branch point of the arms, which only the full ring's determinant notices, costs no step.

    Once each shortened a dozen steps, and this triangle's path did not end within 2,000 of them:
    the half's takes 1,831. After 200 both are at the same place, with 7 branch points behind them.
    """
    shape = der.triangle(math.radians(121.761629066841), 0.020491592795655343)
    section = der.rectangular_section(0.3662891228368407, 0.055596116920723415)
    options = Options(max_steps=200)
    request = Request(stability=False, self_crossings=False, limits=False, options=options)
    at = []
    for name in ("half", "full"):
        found = []
        with pytest.raises(ContinuationFailed, match="not ended after 200 steps"):
            found.extend(request.follow(gripped_ring(shape, section, 64, name=name)))
        at.append([one.solution.parameter for one in found[-20:]])
    assert at[0] == pytest.approx(at[1], abs=1e-8)


def test_path_that_does_not_end_says_so():
    """A path of too few steps hands out its states and then ends in its named result."""
    count = Statistics()
    path = Request(options=Options(max_steps=3)).follow(circle(4.0), count)
    found = [next(path) for _ in range(4)]
    assert found[-1].solution.parameter > found[0].solution.parameter == 0.0
    with pytest.raises(ContinuationFailed, match="not ended after 3 steps") as caught:
        list(path)
    assert caught.value.reason is Reason.TOO_MANY_STEPS
    assert count.steps == 3


def test_path_that_bends_too_far_keeps_what_was_found():
    """A ring almost without torsional stiffness kinks; the error holds the states before that.

    alpha = 100, beta = 0.001: vertices near the grip bend by more than 160 degrees, beyond which
    the energy is not defined. Failure is a value with a sentence.
    """
    scene = der.Scene(der.circle(), der.section(alpha=100.0, beta=0.001), self_crossings=False)
    with pytest.raises(der.NotConverged, match=r"vertex 15 .* use more edges") as caught:
        der.fold(scene)
    assert caught.value.path.status == "not converged"
    assert 3.0 < caught.value.path.gamma[-1] < math.pi


# --- strands that lie close together ------------------------------------------------------------


def test_path_does_not_leap_over_a_sharp_turn():
    """Folds keep sign(dgamma/ds) (-1)^index, so a step may not change it: it would change strands.

    At h/t = 0.86 the path turns so sharply beyond pi that a step of 0.6 can leap over the turn. The
    folds found are those of steps five times finer, to rounding.
    """
    ring = circle(0.86)
    request = Request(math.inf, until_folded=True, stability=False, self_crossings=False)
    coarse, fine = (
        [
            one.solution.parameter
            for one in replace(request, options=options).follow(ring)
            if one.kind == "fold"
        ]
        for options in (Options(), Options(largest_step=0.12))
    )
    assert coarse == pytest.approx(fine, abs=1e-9)
    assert len(coarse) > 0


def test_branch_beside_a_fold_is_told_from_it():
    """At kappa0 = 2, h/t = 0.3 a branch point lies 1e-6 rad beside the first fold.

    One change of the index belongs to each: 16 to 15 out of phase, then 15 to 14 at the fold.
    """
    path = der.fold(der.Scene(der.circle(natural_curvature=2.0), der.rectangular_section(0.3)))
    first = [p for p in path.points if p.kind in ("fold", "branch")][:2]
    assert [p.kind for p in first] == ["branch", "fold"]
    assert [(p.index_before, p.index_after) for p in first] == [(16, 15), (15, 14)]


def test_index_changes_only_at_points():
    """Over every segment between special points the index is constant, also on a wild path."""
    scene = der.Scene(
        der.circle(natural_curvature=2.0), der.rectangular_section(0.3), self_crossings=False
    )
    path = der.fold(scene)
    singular = {p.position: p for p in path.points if p.kind in ("fold", "branch")}
    now = path.index[0]
    for k, index in enumerate(path.index):
        if k in singular:
            assert singular[k].index_before == now
            now = singular[k].index_after
        else:
            assert index == now
