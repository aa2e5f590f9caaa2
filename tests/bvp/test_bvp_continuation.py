"""Following a path: what is handed out, in which order, and what stops it."""

import math
from itertools import pairwise

import numpy as np
import pytest
from boundary_value import points, system

import der
from der.bvp import continuation
from der.bvp.collocation import Collocation, Error, collocation
from der.bvp.continuation import follow
from der.bvp.events import Point, Wanted
from der.bvp.sectors import sector
from der.bvp.step import Statistics
from der.errors import ContinuationFailed

EIGHTH = math.pi / 8


def followed(ring: der.Ring, h_over_t: float, **wants) -> list[Point]:
    """All that is met on a path."""
    return list(follow(system(ring, h_over_t), Wanted(**wants), Statistics()))


def test_path_starts_with_the_flat_ring():
    """gamma = 0 without moment or energy, to rounding; the tangent leads to larger gamma."""
    at = followed(der.ellipse(0.8), 4.0, gamma_max=0.2)[0].solution
    assert at.gamma == 0.0
    assert (at.moment, at.energy) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert at.tangent.gamma > 0.0


@pytest.mark.parametrize("gamma_max", [0.01, 0.3, EIGHTH, 2.0, math.pi])
def test_path_ends_at_gamma_max_exactly(gamma_max):
    """At its first arrival: no state before lies there or beyond."""
    gamma = [point.solution.gamma for point in followed(der.circle(), 4.0, gamma_max=gamma_max)]
    assert gamma[-1] == gamma_max
    assert max(gamma[:-1]) < gamma_max


def test_multiples_of_an_eighth_of_pi_are_met_by_themselves():
    """Exactly, each time the path crosses them: seven on the way to pi."""
    gamma = [point.solution.gamma for point in followed(der.circle(), 4.0)]
    assert {k * EIGHTH for k in range(9)} <= set(gamma)


def test_every_crossing_of_a_wanted_gamma_is_met():
    """The circle at h/t = 1.6 passes gamma = 2.7 three times.

    Before, between and after its folds at
    2.772 and 2.614, with three moments that fall along the path.
    """
    path = followed(der.circle(), 1.6, targets=(2.7,))
    crossings = [point.solution for point in path if point.solution.gamma == 2.7]
    assert len(crossings) == 3
    assert crossings[0].moment > crossings[1].moment > crossings[2].moment


def test_neighbouring_states_are_in_path_order():
    """The tangent leads from each state to the next: gamma rises and falls as its sign says."""
    path = points(system(der.circle(), 1.6), math.pi)
    folds = [k for k, point in enumerate(path) if point.kind == "fold"]
    signs = [np.sign(b.solution.gamma - a.solution.gamma) for a, b in pairwise(path)]
    assert signs == [1] * folds[0] + [-1] * (folds[1] - folds[0]) + [1] * (len(path) - 1 - folds[1])


def test_tangent_at_a_fold_has_no_part_in_gamma():
    """dgamma = 0 at every fold; 1e-7 is the increment that ends Newton's method."""
    for point in points(system(der.circle(), 1.6), math.pi):
        if point.kind == "fold":
            assert abs(point.solution.tangent.gamma) < 1e-7


def test_two_folds_in_one_step_are_found():
    """Just below the cusp, h/t = 1.8396, the folds are 2e-7 apart in gamma (and 2e-2 in M)."""
    path = points(system(der.circle(), 1.8395), math.pi)
    first, second = [point.solution for point in path if point.kind == "fold"]
    assert 0.0 < first.gamma - second.gamma < 1e-6
    assert first.moment - second.moment > 1e-3


def test_limits_of_the_moment_have_no_slope():
    """dM = 0 along the tangent, to what 1e-10 of the step leaves."""
    path = points(system(der.circle(), 4.0), math.pi)
    limits = [point.solution for point in path if point.kind == "limit"]
    assert len(limits) >= 2
    for at in limits:
        assert abs(at.slope) < 1e-7


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_errors_stay_below_the_tolerance(tolerance):
    """Estimated errors of gamma/pi, M and U relative to the largest, at every state handed out."""
    path = points(system(der.triangle(math.pi / 2, 1 / 30), 4.0), math.pi, tolerance)
    errors = np.array([point.error for point in path])
    values = np.array([[math.pi, point.solution.moment, point.solution.energy] for point in path])
    assert (errors / np.abs(values).max(axis=0)).max() <= tolerance


def test_errors_are_relative_to_what_is_handed_out():
    """A triangle with sharp corners, of a tall section.

    A solution on too coarse a mesh is not handed out; its moment is three times that of the others.
    """
    ring = der.triangle(math.pi / 2, 0.005)
    path = points(system(ring, 38.331698305621025, 0.0), math.pi, 4.5e-7)
    errors = np.array([point.error for point in path])
    values = np.array([[math.pi, point.solution.moment, point.solution.energy] for point in path])
    assert (errors / np.abs(values).max(axis=0)).max() <= 4.5e-7


def test_a_path_ends_where_it_has_taken_too_much(monkeypatch):
    """Intervals of all steps together are counted, and the path says how many steps they were."""
    monkeypatch.setattr(continuation, "MOST_WORK", 60)
    statistics = Statistics()
    with pytest.raises(ContinuationFailed, match=r"^the path has not ended after \d+ steps$"):
        list(follow(system(der.circle(), 4.0), Wanted(), statistics))
    assert 60 <= statistics.intervals < 100


def test_a_tolerance_between_two_meshes_is_reached():
    """Rounding of intervals to integers between joints must not ask for the same mesh forever.

    A rounded square whose fitted meshes of 4 and of 5 intervals are one and the same.
    """
    ring = der.rectangle(0.869977137438724, 0.14302013569831667, "y")
    section = der.section(1.0206145565088027, 5.753213763629439)
    equations = collocation(sector(der.Scene(ring, section)))
    gammas = []
    for count, point in enumerate(follow(equations, Wanted(), Statistics())):
        gammas.append(point.solution.gamma)
        assert count < 1000
    assert gammas[-1] == math.pi


def test_an_error_that_more_intervals_do_not_lessen_is_called_rounding(monkeypatch):
    floor = 1e-7
    estimate = Collocation.error

    def noisy(self, at):
        error = estimate(self, at)
        return Error(error.gamma + floor, error.moment, error.energy)

    monkeypatch.setattr(Collocation, "error", noisy)
    with pytest.raises(
        ContinuationFailed, match=r"rounding leaves an error of .* on \d+ intervals, as on fewer"
    ):
        followed(der.circle(), 4.0, tolerance=1e-8)


def test_a_path_that_turns_back_ends_at_minus_pi():
    """A rounded rectangle that folds at gamma = 3.106, short of pi.

    The path runs back through the flat ring's angle to -pi; steps thirty times shorter find the
    same folds.
    """
    ring = der.rectangle(0.46090256772792904, 0.3814496387454095, "y")
    found = list(follow(system(ring, 3.3692299828162224, 0.0), Wanted(), Statistics()))
    folds = [point.solution.gamma for point in found if point.kind == "fold"]
    np.testing.assert_allclose(folds, [3.106268, 1.938953, 2.355590], atol=1e-6)
    assert found[-1].solution.gamma == -math.pi
    assert max(point.solution.gamma for point in found) < math.pi


def test_costs_are_counted():
    """Steps and Newton iterations of the path, at least two a step."""
    statistics = Statistics()
    list(follow(system(der.circle(), 4.0), Wanted(targets=()), statistics))
    assert 0 < statistics.steps <= 40
    assert statistics.newton_iterations >= 2 * statistics.steps
