"""What a snap releases, and where it ends: against paths followed by arclength."""

import functools
import math
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import der
from der.analysis.loading import follow_angle, follow_moment
from der.analysis.request import Request
from der.analysis.snap import Landing
from der.problem import Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring

BARE = Request(self_crossings=False, stability=False)
GAUSS = np.polynomial.legendre.leggauss(4)


def circle(h_over_t: float, name: str = "quarter", n_edges: int = 64) -> GrippedRing:
    """Return a sector of a circle."""
    return gripped_ring(der.circle(), der.rectangular_section(h_over_t), n_edges, name=name)


@functools.cache
def there_and_back(name: str = "quarter", n_targets: int = 8) -> tuple[Point, ...]:
    """Return the points of angle control, up to pi and down to 0, at h/t = 1.6."""
    targets = tuple(math.pi * k / n_targets for k in range(n_targets + 1))
    request = Request(self_crossings=False, targets=targets)
    return tuple(follow_angle(circle(1.6, name), request, Statistics(), unload=True))


def landings(points: tuple[Point, ...]) -> list[Landing]:
    return [one for one in points if isinstance(one, Landing)]


@functools.cache
def on_the_path(h_over_t: float, gamma: float) -> tuple[Equilibrium, ...]:
    """Return every state of the arclength path at one gamma."""
    points = replace(BARE, targets=(gamma,)).follow(circle(h_over_t))
    return tuple(one.solution for one in points if one.solution.parameter == gamma)


def work(ring: GrippedRing, a: Equilibrium, b: Equilibrium) -> float:
    """Integral of M dgamma between two neighbouring states of a path, cubics of s for both."""
    jump = ring.difference(a.state, b.state)
    norm = math.sqrt(ring.inner(jump, jump))
    u = 0.5 + 0.5 * GAUSS[0]
    h00, h01 = (1.0 + 2.0 * u) * (1.0 - u) ** 2, u * u * (3.0 - 2.0 * u)
    h10, h11 = norm * u * (1.0 - u) ** 2, norm * u * u * (u - 1.0)
    moment = h00 * a.moment + h01 * b.moment + h10 * a.moment_rate + h11 * b.moment_rate
    rate = (
        6.0 * u * (1.0 - u) * (b.parameter - a.parameter)
        + norm * (1.0 - u) * (1.0 - 3.0 * u) * a.parameter_rate
        + norm * u * (3.0 * u - 2.0) * b.parameter_rate
    )
    return float(0.5 * GAUSS[1] @ (ring.arm_moment(1.0) * moment * rate))


@pytest.mark.parametrize("which", [0, 1])
def test_energy_released_is_that_between_two_states_of_the_path(which):
    """U of the path's own states at the gamma of the fold, before less after, to 1e-8 and > 0.

    The arclength path passes that gamma at the fold and once more: an independent solve of both.
    Squared errors of the state at the fold are below 1e-11, measured 1e-12.
    """
    ring = circle(1.6)
    landing = landings(there_and_back())[which]
    folds = [one.solution for one in BARE.follow(ring) if one.kind == "fold"]
    after = min(on_the_path(1.6, landing.solution.parameter), key=lambda at: at.energy)
    released = ring.copies * (folds[which].energy - after.energy)
    assert landing.details["energy_released"] > 0.0
    assert abs(landing.details["energy_released"] - released) < 1e-8


@pytest.mark.parametrize("which", [0, 1])
def test_a_snap_lands_on_the_path(which):
    """Frames of the landing state are those of a state of the path at that gamma, to 1e-8."""
    landing = landings(there_and_back())[which]
    away = [
        np.abs(np.abs((at.state.quat * landing.solution.state.quat).sum(axis=1)) - 1.0).max()
        for at in on_the_path(1.6, landing.solution.parameter)
    ]
    assert min(away) < 1e-14  # of a cosine: 1e-7 rad
    assert landing.index == (0, 0, 0)


def test_quarter_and_full_ring_snap_alike():
    """At h/t = 1.6 nothing breaks the symmetry: same folds, same releases, same landings."""
    for a, b in zip(landings(there_and_back()), landings(there_and_back("full")), strict=True):
        for key in ("gamma_fold", "energy_released", "moment_after"):
            assert abs(a.details[key] - b.details[key]) < 1e-8


def loop_defect(n_targets: int) -> float:
    """4 times the loop integral of M dgamma, up and down, less what the snaps release."""
    ring = circle(1.6)
    points = there_and_back(n_targets=n_targets)
    loop = sum(
        work(ring, a.solution, b.solution)
        for a, b in pairwise(points)
        if b.kind != "snap" and a.solution.parameter != b.solution.parameter
    )
    return 4.0 * loop - sum(one.details["energy_released"] for one in landings(points))


def test_the_hysteresis_loop_is_what_the_snaps_release():
    """4 times the loop integral of M dgamma, up and down, is the sum of the two releases, 0.6562.

    Energy is conserved between snaps (dU = 4 M dgamma), so this holds to quadrature: cubics in s
    between states, measured 1.3e-7 with 256 loads a sweep.
    """
    assert len(landings(there_and_back())) == 2
    assert abs(loop_defect(256)) < 1e-6


def test_what_the_loop_lacks_is_quadrature():
    """The defect falls by 10 or more for 4 times as many states."""
    assert abs(loop_defect(64)) < 0.1 * abs(loop_defect(16))


def test_a_dead_moment_releases_the_area_above_the_path():
    """Snap-through at h/t = 1.6: 4 times the integral of (M_limit - M) dgamma along the path.

    Work of the dead moment less what the ring stores, from the limit to where M is again M_limit.
    """
    ring = circle(1.6)
    landing = landings(tuple(follow_moment(ring, BARE, Statistics())))[0]
    first, last = landing.details["gamma_fold"], landing.solution.parameter
    targets = tuple(np.linspace(first, last, 40))
    states = [one.solution for one in replace(BARE, targets=targets).follow(ring)]
    start = next(k for k, at in enumerate(states) if at.parameter == first)
    end = next(k for k, at in enumerate(states) if at.parameter == last)
    spent = sum(work(ring, a, b) for a, b in pairwise(states[start : end + 1]))
    area = landing.details["moment_before"] * (last - first) - spent
    assert landing.details["energy_released"] == pytest.approx(4.0 * area, abs=1e-6)


def test_limits_of_a_circle_under_a_dead_moment():
    """h/t = 4: 1.4787 going up and -0.0160 coming down, by the boundary-value problem.

    64, 128, 256 edges extrapolated by even powers of 1/N; both to the four digits given.
    """
    moments = []
    for n_edges in (64, 128, 256):
        ring = circle(4.0, n_edges=n_edges)
        points = follow_moment(ring, BARE, Statistics(), unload=True)
        moments.append([ring.arm_moment(v.solution.moment) for v in points if v.kind == "limit"])
    coarse, middle, fine = np.array(moments)
    once, twice = middle + (middle - coarse) / 3.0, fine + (fine - middle) / 3.0
    np.testing.assert_allclose(twice + (twice - once) / 15.0, [1.4787, -0.0160], atol=5.1e-5)


@pytest.mark.parametrize("h_over_t", [2.0, 4.0])
def test_a_cycle_of_the_dead_moment_spends_what_its_snaps_release(h_over_t):
    """4 times the loop integral of the dead moment is the sum of the releases, work included.

    The loop is closed by the level parts of the snaps; cubics between states elsewhere. At the
    stops gamma rests, and no work is done. 200 loads: measured 2e-8.
    """
    ring = circle(h_over_t)
    targets = tuple(np.linspace(0.0, math.pi, 201))
    request = replace(BARE, targets=targets)
    points = tuple(follow_moment(ring, request, Statistics(), unload=True))
    loop = 0.0
    for a, b in pairwise(points):
        rise = b.solution.parameter - a.solution.parameter
        if b.kind == "snap":
            loop += ring.arm_moment(a.solution.moment) * rise
        elif rise != 0.0:
            loop += work(ring, a.solution, b.solution)
    released = [landing.details["energy_released"] for landing in landings(points)]
    assert len(released) == 2
    assert min(released) > 0.0
    assert sum(released) == pytest.approx(4.0 * loop, abs=1e-6)


def test_a_branch_releases_energy_of_second_order():
    """Past a pitchfork the ring falls by O(delta^2), delta = 1e-3 rad past the branch point.

    The full circle at h/t = 0.6; measured 7.2e-5, slopes of branches of order 100.
    """
    request = replace(BARE, gamma_max=5.0)
    (landing,) = landings(tuple(follow_angle(circle(0.6, "full"), request, Statistics())))
    assert landing.solution.parameter - landing.details["gamma_fold"] == pytest.approx(1e-3)
    assert 0.0 < landing.details["energy_released"] < 1e-3


def test_history_leads_downhill_from_the_fold_to_the_landing():
    """The configurations kept of a snap, for slow motion; none unless asked for."""
    ring = circle(1.6)
    (told,) = landings(tuple(follow_angle(ring, BARE, Statistics(), every=5)))
    before, after = told.details["energy_before"], told.details["energy_after"]
    assert len(told.history) == len(told.energies) > 20
    assert max(told.energies) < before
    assert told.energies[-1] == pytest.approx(after, abs=1e-3 * (before - after))
    assert landings(there_and_back())[0].history == ()


def test_a_snap_is_quick():
    """Relaxation and polish at 64 edges: the goal is 100 ms of CPU, warm; measured 5 ms."""
    ring = circle(1.6)
    loading = follow_angle(ring, BARE, Statistics())
    for one in loading:
        if one.kind == "fold":
            break
    started = time.process_time()
    landing = next(loading)
    assert landing.kind == "snap"
    assert time.process_time() - started < 0.1
