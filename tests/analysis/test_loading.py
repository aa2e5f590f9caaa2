"""Marching by angle, dead moment, relaxation: minima all the way, and snaps where they end."""

import functools
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rods import solved

import der
from der.analysis.loading import follow_angle, follow_moment
from der.analysis.loading_by_relaxation import RESOLUTION, RISE, _Relaxation, follow_relaxed
from der.analysis.request import Request
from der.analysis.secant import ahead, is_work, longer, rested, went_on
from der.analysis.snap import Landing
from der.errors import ContinuationFailed, Reason
from der.problem import Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring

FOLLOWERS = {"angle": follow_angle, "moment": follow_moment, "relaxed": follow_relaxed}


@functools.cache
def marched(
    follower: str, h_over_t: float, name: str = "quarter", gamma_max: float = math.pi, **options
) -> tuple[GrippedRing, tuple[Point[Equilibrium], ...]]:
    """Return a gripped circle of 64 edges and the points of a march without self-crossings."""
    ring = gripped_ring(der.circle(), der.rectangular_section(h_over_t), 64, name=name)
    request = Request(self_crossings=False, gamma_max=gamma_max)
    return ring, tuple(FOLLOWERS[follower](ring, request, Statistics(), **options))


@functools.cache
def path(h_over_t: float, *targets: float) -> tuple[Point[Equilibrium], ...]:
    """States of the arclength path of the quarter of 64 edges, at ``targets`` and in between."""
    ring = gripped_ring(der.circle(), der.rectangular_section(h_over_t), 64)
    request = Request(self_crossings=False, targets=targets or None)
    return tuple(request.follow(ring))


def of_kind(points: tuple[Point[Equilibrium], ...], kind: str) -> list[Point[Equilibrium]]:
    return [point for point in points if point.kind == kind]


def loads(points: tuple[Point[Equilibrium], ...]) -> list[float]:
    return [point.solution.parameter for point in points]


# --- angle ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["quarter", "half", "full"])
def test_the_ring_snaps_at_the_fold_of_the_path(name):
    """Stability ends where arclength following finds the fold, on the way there and back.

    The goal is 1e-6 rad; both solve dgamma/ds = 0, measured 1e-12 apart.
    """
    _, points = marched("angle", 1.6, name, unload=True)
    ends = loads(of_kind(points, "fold"))
    folds = loads(of_kind(path(1.6), "fold"))
    assert len(ends) == len(folds) == 2
    assert np.abs(np.subtract(ends, folds)).max() < 1e-9


@pytest.mark.parametrize("name", ["quarter", "full"])
def test_every_state_between_snaps_is_a_minimum(name):
    """Index 0 in every class at every state, but where it is about to snap (unknown there)."""
    _, points = marched("angle", 1.6, name, unload=True)
    assert all(set(point.index or (0,)) == {0} for point in points)
    assert sum(point.index is None for point in points) == 2


def test_a_ring_without_folds_is_followed_as_by_arclength():
    """At h/t = 4 all ways to march give the same states at the multiples of pi/8, to 1e-9."""
    ring, points = marched("angle", 4.0)
    here = {point.solution.parameter: point.solution for point in points}
    there = {point.solution.parameter: point.solution for point in path(4.0)}
    for k in range(9):
        gamma = k * math.pi / 8
        assert abs(ring.arm_moment(here[gamma].moment - there[gamma].moment)) < 1e-9
    assert not of_kind(points, "snap")


def test_gamma_grows_and_ends_at_its_last_value_and_unloading_at_zero():
    """Loading never turns back, not even in a snap; it ends at pi exactly, unloading at 0."""
    _, points = marched("angle", 1.6, unload=True)
    gamma = np.array(loads(points))
    top = int(np.argmax(gamma))
    assert gamma[top] == math.pi
    assert gamma[-1] == 0.0
    assert np.diff(gamma[: top + 1]).min() >= 0.0
    assert np.diff(gamma[top:]).max() <= 0.0


@pytest.mark.parametrize("h_over_t", [1.83, 16.0])
def test_small_snaps_end_and_are_not_repeated(h_over_t):
    """Close to a cusp two folds lie 5e-4 (1.83) and 5e-5 rad (16) apart: one snap each way.

    There the valley from the fold to the landing is nearly level, and steep across where stiff.
    """
    _, points = marched("angle", h_over_t, unload=True)
    landings = of_kind(points, "snap")
    assert len(landings) == 2
    assert all(landing.details["energy_released"] > 0.0 for landing in landings)


def test_unloading_from_the_folded_ring_begins_without_a_contact():
    """Three strands that lie in each other have no linking number to change from."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 64)
    points = tuple(follow_angle(ring, Request(stability=False), Statistics(), unload=True))
    assert max(loads(of_kind(points, "contact"))) < math.pi - 0.01


def test_states_asked_for_are_solved_for():
    """`targets` are met to the last bit, before and after a snap."""
    ring = gripped_ring(der.circle(), der.rectangular_section(1.6), 32)
    request = Request(self_crossings=False, stability=False, targets=(0.1, 2.3, 3.0))
    gamma = loads(tuple(follow_angle(ring, request, Statistics())))
    assert {0.1, 2.3, 3.0, math.pi} <= set(gamma)


def test_a_sector_says_when_its_symmetry_breaks():
    """At h/t = 0.6 an odd mode goes soft before the quarter's own fold: it cannot follow it."""
    ring = gripped_ring(der.circle(), der.rectangular_section(0.6), 64)
    found = []
    with pytest.raises(ContinuationFailed, match=r"breaks the symmetry of its quarter.*'full'"):
        found.extend(follow_angle(ring, Request(self_crossings=False, gamma_max=6.0), Statistics()))


@pytest.mark.parametrize("stability", [True, False])
def test_the_full_ring_falls_off_a_branch_point(stability):
    """The full ring leaves its symmetric path there, for a minimum, asked for stability or not."""
    ring = gripped_ring(der.circle(), der.rectangular_section(0.6), 64, name="full")
    request = Request(self_crossings=False, gamma_max=5.0, stability=stability)
    points = tuple(follow_angle(ring, request, Statistics()))
    (branch,), (landing,) = of_kind(points, "branch"), of_kind(points, "snap")
    assert landing.details["gamma_fold"] == branch.solution.parameter
    assert landing.details["energy_released"] > 1e-6
    assert ring.index(landing.solution.state) == 0
    assert (points[-1].index is None) is not stability


def test_the_full_ring_leaves_a_branch_point_along_its_mode_of_negative_stiffness():
    """An ellipse, b/a = 0.54 about x, h/t = 1.33: an odd mode turns soft at gamma = 3.005.

    Past it a mode of small positive stiffness is nearer to zero than the unstable one.
    """
    shape, section = der.ellipse(0.5425345743524903), der.rectangular_section(1.3259928102023317)
    ring = gripped_ring(shape, section, 128, name="full")
    points = tuple(follow_angle(ring, Request(self_crossings=False, stability=False), Statistics()))
    (branch,), (landing,) = of_kind(points, "branch"), of_kind(points, "snap")
    assert branch.solution.parameter == pytest.approx(3.0052, abs=1e-3)
    assert landing.details["energy_released"] == pytest.approx(0.554, abs=0.01)
    assert ring.index(landing.solution.state) == 0


def test_a_branch_that_returns_to_its_symmetric_path_is_followed_back():
    """An ellipse, b/a = 0.74 about x, h/t = 1.36: past gamma = 3.089 its arms differ.

    Coming back, the branch ends where it began: a branch point, no fold, and the ring goes on
    without a snap, to the flat ring, as it came.
    """
    ring = gripped_ring(der.ellipse(0.7419), der.rectangular_section(1.36064), 64, name="full")
    request = Request(self_crossings=False, stability=False)
    points = tuple(follow_angle(ring, request, Statistics(), unload=True))
    up, down = of_kind(points, "branch")
    assert down.solution.parameter == pytest.approx(up.solution.parameter, abs=1e-6)
    assert down.solution.moment == pytest.approx(up.solution.moment, abs=1e-4)
    assert len(of_kind(points, "snap")) == 1
    assert not of_kind(points, "fold")
    assert points[-1].solution.parameter == 0.0


def test_a_march_that_starts_from_a_saddle_snaps_at_once():
    """At the same gamma, onto the path of the minima, and goes on from there."""
    between = next(point for point in path(1.6) if point.index == (1, 0, 0) and not point.kind)
    ring = gripped_ring(der.circle(), der.rectangular_section(1.6), 64)
    request = Request(self_crossings=False)
    march = follow_angle(ring, request, Statistics(), start=between.solution.state)
    start, landing, *rest = march
    assert start.index == (1, 0, 0)
    assert landing.kind == "snap"
    assert landing.solution.parameter == start.solution.parameter
    assert landing.details["energy_released"] > 0.0
    assert all(set(point.index or (0,)) == {0} for point in (landing, *rest))


# --- rings of other natural curvature, alpha = beta = 1.3 -----------------------------------------


def curved(natural_curvature: float, name: str = "quarter", n_edges: int = 64) -> GrippedRing:
    """Return a gripped ring of another natural curvature than its own."""
    ring, section = der.circle(natural_curvature=natural_curvature), der.section(1.3, 1.3)
    return gripped_ring(ring, section, n_edges, name=name)


def least_slope(points: list[Point[Equilibrium]]) -> float:
    """Smallest dM/dgamma of the regular states, those of snaps and at limits left out."""
    return min(one.solution.slope for one in points if not one.kind)


@pytest.mark.parametrize("name", ["quarter", "full"])
def test_a_flat_ring_that_no_dead_moment_holds_snaps_at_once(name):
    """Natural curvature 2: index 0 at gamma = 0 with the angle held, but dM/dgamma < 0 there.

    It opens to gamma = 1.556243, U = 3.562936 (64 edges), and back there from pi: the folded ring
    is its mirror image. What is released is what the flat ring has more.
    """
    ring = curved(2.0, name)
    flat, first, *rest = follow_moment(ring, Request(), Statistics(), unload=True)
    assert flat.solution.slope < 0.0
    assert first.kind == "snap"
    gamma, moment, energy = ring.values(first.solution)
    assert gamma == pytest.approx(1.556243, abs=1e-6)
    assert moment == pytest.approx(0.0, abs=1e-9)
    assert energy == pytest.approx(3.562936, abs=1e-6)
    released = ring.copies * flat.solution.energy - energy
    assert first.details["energy_released"] == pytest.approx(released, abs=1e-9)
    assert least_slope(rest) > 0.0


def test_the_end_state_of_that_snap_converges():
    """To gamma = 1.5544815, U = 3.5514888, by Romberg's scheme from 64, 128, 256 edges."""
    values = []
    for n_edges in (64, 128, 256):
        ring = curved(2.0, n_edges=n_edges)
        _, first, *_ = follow_moment(ring, Request(), Statistics())
        gamma, _, energy = ring.values(first.solution)
        values.append(np.array([gamma, energy]))
    a, b, c = values
    once = (4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0
    assert (16.0 * once[1] - once[0]) / 15.0 == pytest.approx([1.5544815, 3.5514888], abs=2e-7)


@pytest.mark.parametrize(("name", "modes"), [("quarter", "odd"), ("half", "out of phase")])
@pytest.mark.parametrize("follower", ["angle", "moment", "relaxed"])
def test_a_start_that_its_sector_cannot_leave_is_refused(follower, name, modes):
    """Natural curvature -1: the flat ring has index 2, by modes that break the symmetry."""
    ring, found = curved(-1.0, name), []
    with pytest.raises(ContinuationFailed, match=rf"gamma = 0.0+ is unstable to modes \({modes}\)"):
        found.extend(FOLLOWERS[follower](ring, Request(stability=False), Statistics()))
    assert len(found) <= 1


@pytest.mark.parametrize("follower", ["angle", "moment"])
def test_the_full_ring_leaves_its_unstable_flat_state(follower):
    """It snaps at once, at gamma = 0, and is a minimum under its control from then on."""
    ring = curved(-1.0, "full")
    flat, first, *rest = FOLLOWERS[follower](
        ring, Request(self_crossings=False), Statistics(), unload=True
    )
    assert flat.index == (2,)
    assert first.kind == "snap"
    assert first.details["energy_released"] == pytest.approx(2.111276, abs=1e-6)
    assert all(set(point.index or (0,)) == {0} for point in (first, *rest))
    assert follower == "angle" or least_slope(rest) > 0.0


def test_relaxation_does_not_call_a_saddle_its_rest():
    """The flat full ring of natural curvature -1 is at rest by symmetry, with index 2."""
    with pytest.raises(ContinuationFailed, match="in no minimum"):
        next(follow_relaxed(curved(-1.0, "full"), Request(), Statistics()))


def test_states_before_a_refused_one_are_handed_out(monkeypatch):
    """Two states wait for the limit of the moment that may lie between them."""
    relaxed, reached = _Relaxation.relaxed, []

    def refused(self, start, every=0):
        if start.load > 3.5 * RISE:
            raise ContinuationFailed("refused", Reason.NOT_AT_REST)
        reached.append(start.load)
        return relaxed(self, start, every)

    monkeypatch.setattr(_Relaxation, "relaxed", refused)
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32)
    found = []
    with pytest.raises(ContinuationFailed, match="refused"):
        found.extend(follow_relaxed(ring, Request(targets=()), Statistics()))
    assert len(found) > 3
    assert loads(tuple(found)) == sorted(set(reached))  # the first step is tried twice


# --- dead moment ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["quarter", "full"])
@pytest.mark.parametrize("h_over_t", [1.0, 4.0])
def test_a_dead_moment_snaps_at_the_limit_of_the_path(h_over_t, name):
    """Stability ends where dM/ds = 0 on the arclength path, to 1e-9 rad."""
    _, points = marched("moment", h_over_t, name)
    limit = of_kind(path(h_over_t), "limit")[0]
    assert abs(loads(of_kind(points, "limit"))[0] - limit.solution.parameter) < 1e-9


def test_a_snap_through_lands_at_the_same_moment():
    """At h/t = 1.6 the first snap-through comes to rest before the stop: M as before it.

    And on the path: a state of the arclength path at that gamma has that moment.
    """
    ring, points = marched("moment", 1.6)
    landing = of_kind(points, "snap")[0]
    gamma = landing.solution.parameter
    assert gamma < math.pi
    assert abs(landing.details["moment_after"] - landing.details["moment_before"]) < 1e-9
    met = [v.solution for v in path(1.6, gamma) if v.solution.parameter == gamma]
    assert min(abs(ring.arm_moment(at.moment - landing.solution.moment)) for at in met) < 1e-9


def test_a_snap_through_is_stopped_at_gamma_max():
    """At h/t = 4 nothing below pi holds the moment of the peak: gamma ends at pi, M there 0."""
    ring, points = marched("moment", 4.0)
    assert points[-1].kind == "snap"
    assert points[-1].solution.parameter == math.pi
    assert abs(ring.arm_moment(points[-1].solution.moment)) < 1e-9


def test_a_stop_that_is_only_overrun_does_not_hold_the_ring():
    """A stop at 2.43, just past the landing at 2.4206: the motion hits it, and comes back."""
    _, (*_, free) = marched("moment", 1.6, gamma_max=2.42)
    assert free.solution.parameter == 2.42
    landing = of_kind(marched("moment", 1.6)[1], "snap")[0]
    stopped = of_kind(marched("moment", 1.6, gamma_max=2.43)[1], "snap")[0]
    assert abs(stopped.solution.parameter - landing.solution.parameter) < 1e-8


def test_a_ring_that_rests_shortly_before_its_stop_is_found_there():
    """A triangle whose state of rest lies 5e-4 rad before the stop that its motion runs into."""
    shape = der.triangle(math.radians(75.075517148597), 0.052288041382129474)
    ring = gripped_ring(shape, der.rectangular_section(1.1323602434456281), 128)
    points = tuple(
        follow_moment(ring, Request(self_crossings=False, stability=False), Statistics())
    )
    (landing,) = of_kind(points, "snap")
    assert 1e-4 < math.pi - landing.solution.parameter < 1e-3
    assert landing.details["moment_after"] == pytest.approx(landing.details["moment_before"])
    assert loads(points)[-1] == math.pi


def test_the_dead_moment_only_grows():
    """Between snaps every state is at a higher moment than the last, at stable equilibrium."""
    _, points = marched("moment", 1.6)
    rises = [
        b.solution.moment - a.solution.moment
        for a, b in pairwise(points)
        if b.solution.parameter < math.pi and b.kind != "snap"
    ]
    assert min(rises) > 0.0
    assert all(point.solution.slope > 0.0 for point in points if not point.kind)


@pytest.mark.parametrize(("h_over_t", "name"), [(4.0, "quarter"), (4.0, "full"), (1.6, "quarter")])
def test_a_dead_moment_comes_back_to_the_flat_ring(h_over_t, name):
    """Loading ends at gamma = pi, unloading at gamma = 0 exactly, where the ring is flat, M = 0."""
    ring, points = marched("moment", h_over_t, name, unload=True)
    gamma = np.array(loads(points))
    top = int(np.argmax(gamma))
    assert gamma[top] == math.pi
    assert gamma[-1] == 0.0
    assert np.diff(gamma[top:]).max() <= 0.0
    assert abs(ring.arm_moment(points[-1].solution.moment)) < 1e-9
    assert abs(points[-1].solution.energy) < 1e-12


def test_the_folded_ring_pops_open_at_its_lower_limit():
    """At h/t = 4 the moment passes 0 at pi and the ring leaves at dM/ds = 0, where M < 0.

    The same limit as the arclength path's second, to 1e-9 rad; it lands at the stop at 0.
    """
    ring, points = marched("moment", 4.0, unload=True)
    _, lower = of_kind(points, "limit")
    _, landing = of_kind(points, "snap")
    assert abs(lower.solution.parameter - of_kind(path(4.0), "limit")[1].solution.parameter) < 1e-9
    assert ring.arm_moment(lower.solution.moment) < -0.01
    assert landing.details["gamma_fold"] == lower.solution.parameter
    assert landing.solution.parameter == 0.0


def test_a_ring_that_is_not_stable_folded_snaps_as_soon_as_it_is_let_go():
    """At h/t = 2 dM/dgamma < 0 at pi: at M = 0 the ring falls from there to flat."""
    ring, points = marched("moment", 2.0, unload=True)
    folded, opened = of_kind(points, "snap")
    assert folded.solution.parameter == math.pi
    assert folded.solution.slope < 0.0
    assert opened.details["gamma_fold"] == math.pi
    assert opened.solution is points[-1].solution
    assert opened.details["energy_released"] == pytest.approx(ring.copies * folded.solution.energy)


def test_a_ring_that_is_not_folded_at_pi_unloads_from_the_moment_it_has_there():
    """At h/t = 1 M(pi) > 0: down from it, one snap back at a limit of M > 0, and on to flat."""
    ring, points = marched("moment", 1.0, unload=True)
    top = next(point for point in points if point.solution.parameter == math.pi)
    _, back = of_kind(points, "snap")
    assert ring.arm_moment(top.solution.moment) > back.details["moment_before"] > 0.0
    assert abs(back.details["moment_after"] - back.details["moment_before"]) < 1e-9
    assert back.solution.parameter < back.details["gamma_fold"]


def test_the_dead_moment_only_falls_on_the_way_back():
    """Between the snaps of unloading M falls from state to state, at stable equilibrium."""
    _, points = marched("moment", 1.0, unload=True)
    top = int(np.argmax(loads(points)))
    back = points[top:]
    falls = [b.solution.moment - a.solution.moment for a, b in pairwise(back) if b.kind != "snap"]
    assert max(falls) < 0.0
    assert all(point.solution.slope > 0.0 for point in back if not point.kind)


def test_a_stop_at_zero_that_is_only_overrun_does_not_hold_the_ring():
    """A motion that would come to rest at gamma > 0 under M > 0 is no landing at 0."""
    _, points = marched("moment", 1.0, unload=True)
    _, back = of_kind(points, "snap")
    assert back.solution.parameter > 0.1
    assert points[-1].kind != "snap"


def test_a_ring_that_comes_to_rest_at_its_stop_is_on_it():
    """A triangle released at M = 0 rests at gamma = 0 to rounding: it ends there exactly."""
    shape = der.triangle(math.radians(75.459472779033), 0.18701066520775167)
    ring = gripped_ring(shape, der.rectangular_section(3.6130411355236483), 128)
    request = Request(self_crossings=False, stability=False)
    *_, last = follow_moment(ring, request, Statistics(), unload=True)
    assert last.kind == "snap"
    assert last.solution.parameter == 0.0


# --- relaxation alone ---------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["quarter", "full"])
@pytest.mark.parametrize("h_over_t", [1.6, 4.0])
def test_relaxed_states_agree_with_newton(h_over_t, name):
    """M of every state of a march without Hessian, within 1e-6 of Newton's at that gamma.

    Measured 2e-8 at h/t = 4, 4e-7 next to the fold at 1.6, where the ring is softest.
    """
    ring, points = marched("relaxed", h_over_t, name)
    worst = max(
        abs(ring.arm_moment(solved(ring, one.solution.state).moment - one.solution.moment))
        for one in points
    )
    assert worst < 1e-6
    assert points[-1].solution.parameter == math.pi


def test_relaxation_brackets_the_fold():
    """Both snaps at h/t = 1.6 lie past the fold of the path, by no more than the resolution."""
    _, points = marched("relaxed", 1.6, unload=True)
    up, down = of_kind(points, "snap")
    first, second = loads(of_kind(path(1.6), "fold"))
    assert 0.0 <= up.solution.parameter - first <= RESOLUTION
    assert 0.0 <= second - down.solution.parameter <= RESOLUTION
    assert isinstance(up, Landing)


def test_relaxation_finds_the_limits_of_the_moment():
    """Limits by parabolas: M to 1e-7 and gamma to 1e-4 of those of the path, all of them."""
    ring, points = marched("relaxed", 4.0)
    here, there = of_kind(points, "limit"), of_kind(path(4.0), "limit")
    assert len(here) == len(there) == 2
    for a, b in zip(here, there, strict=True):
        assert abs(ring.arm_moment(a.solution.moment - b.solution.moment)) < 1e-7
        assert abs(a.solution.parameter - b.solution.parameter) < 1e-4


@pytest.mark.parametrize(
    ("shape", "n_edges", "h_over_t", "nu", "curvature"),
    [
        (der.circle(), 16, 1.839582, 0.5, "logarithm"),
        (der.circle(), 32, 1.6, 0.3, "logarithm"),
        (der.rectangle(1.0, 0.005, "y"), 16, 1.8255877666514193, 0.2903264319264113, "angle"),
    ],
    ids=["circle 16", "circle 32", "square 16"],
)
def test_relaxation_on_few_edges_finds_what_newton_does(shape, n_edges, h_over_t, nu, curvature):
    """Limits 1e-3 rad before a fold, and the snap past it, in steps of 0.05 rad.

    Once a parabola through the steps put the limit beyond the fold, on another branch. At 2.92 the
    square becomes unstable to odd modes, which its quarter cannot follow.
    """
    ring = gripped_ring(shape, der.rectangular_section(h_over_t, nu), n_edges, measure=curvature)
    request = Request(gamma_max=2.9, stability=False, self_crossings=False)
    here, there = (
        [v for v in follower(ring, request, Statistics()) if v.kind in ("limit", "snap")]
        for follower in (follow_relaxed, follow_angle)
    )
    assert [v.kind for v in here] == [v.kind for v in there]
    assert "snap" in [v.kind for v in here]
    for a, b in zip(here, there, strict=True):
        assert a.solution.parameter == pytest.approx(b.solution.parameter, abs=5e-6)
        assert a.solution.moment == pytest.approx(b.solution.moment, abs=1e-5)


def test_a_jump_shorter_than_what_is_noticed_shows_in_its_energy():
    """A state that is near enough, whose energy is not that of the last and the work in between."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32)
    loading = _Relaxation(ring, Request(stability=False), Statistics(), RISE, 1e-9, 0)
    trail = [rested(ring, [], loading.relaxed(ring.start))]
    for load in (0.02, 0.04, 0.06):
        found = loading.relaxed(ahead(ring, trail, load))
        assert went_on(ring, trail, found)
        assert is_work(trail, found, abs(found.moment))
        trail = longer(ring, trail, found)
    fallen = replace(found, energy=found.energy - 3e-3 * found.moment * 0.02)
    assert went_on(ring, trail[:-1], fallen)
    assert not is_work(trail[:-1], fallen, abs(found.moment))


def test_a_state_all_but_beside_the_last_one_does_not_lead_the_way():
    """Differences over 1e-7 rad would magnify the residual to what a step of 0.05 turns."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 32)
    loading = _Relaxation(ring, Request(stability=False), Statistics(), RISE, 1e-9, 0)
    trail = [rested(ring, [], loading.relaxed(ring.start))]
    for load in (0.05, 0.1, 0.1 + 1e-7):
        trail = longer(ring, trail, loading.relaxed(ahead(ring, trail, load)))
    assert [at.state.load for at in trail] == [0.0, 0.05, 0.1 + 1e-7]
    assert abs(loading.relaxed(ahead(ring, trail, 0.15)).state.load - 0.15) < 1e-15
    assert went_on(ring, trail, loading.relaxed(ahead(ring, trail, 0.15)))


def test_slope_without_a_hessian_is_of_second_order():
    """DM/dgamma at pi, by differences: within 1e-2 of the path's, relative to that at 0."""
    _, points = marched("relaxed", 4.0)
    exact = path(4.0)[-1].solution.slope
    assert abs(points[-1].solution.slope - exact) < 1e-2 * path(4.0)[0].solution.slope
