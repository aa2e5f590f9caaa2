"""The path follower on small systems with exact answers: nothing here knows of rods or rings.

Residuals are below 1e-13; a fold is located to 1e-12 of s, and so to rounding in the parameter.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rods import richardson
from textbook import (
    Configuration,
    Potential,
    branch_beside_fold,
    bratu,
    cusp,
    graph,
    hyperbola,
    isola,
    pitchfork,
    scalar,
    transcritical,
)

from der.continuation.arclength import follow
from der.continuation.events import Events
from der.errors import ContinuationFailed, Reason
from der.problem import Options, Point, Statistics, total_index

EXACT = Options(tolerance=1e-13)
EPS = 1e-12


def until(*targets: float, **wants: object) -> Events:
    """What is looked for on a path that ends at the first of these targets."""
    wants = {"stability": True, "targets": targets, **wants}
    return Events(stop=lambda at: at.parameter in targets, **wants)


def path(
    system: Potential,
    x: float | np.ndarray,
    p: float,
    events: Events,
    *,
    sense: float = 1.0,
    options: Options = EXACT,
) -> list[Point]:
    """Points of the path from a configuration on, to growing or (``sense``) falling p."""
    start = Configuration(np.atleast_1d(np.asarray(x, dtype=float)), p)
    along = sense * np.eye(len(start.x) + 1)[-1]
    return list(follow(system, start, events, along=along, options=options))


def of_kind(points: list[Point], kind: str) -> list[Point]:
    """Points of one kind."""
    return [one for one in points if one.kind == kind]


def parameters(points: list[Point]) -> list[float]:
    """Where points lie."""
    return [one.solution.parameter for one in points]


def first(point: Point) -> float:
    """The first unknown of a point."""
    return float(point.solution.state.x[0])


# --- folds --------------------------------------------------------------------------------------


def across_a_cusp(u: float, options: Options = EXACT) -> list[Point]:
    """The path of x^3 - u x = p from x = -2 to x = 2."""
    return path(cusp(u), -2.0, 2.0 * u - 8.0, until(8.0 - 2.0 * u), options=options)


@pytest.mark.parametrize("u", [3.0, 1.0, 0.3, 0.01, 1e-4])
def test_folds_of_a_cusp(u):
    """At p = +-2 (u/3)^(3/2), x = -+sqrt(u/3), also both within one step; index 0, 1, 0."""
    points = across_a_cusp(u)
    folds = of_kind(points, "fold")
    p, x = 2.0 * (u / 3.0) ** 1.5, math.sqrt(u / 3.0)
    assert parameters(folds) == pytest.approx([p, -p], abs=EPS)
    assert [first(one) for one in folds] == pytest.approx([-x, x], abs=1e-9)
    assert [one.sides for one in folds] == [((0,), (1,)), ((1,), (0,))]
    assert [one.kind for one in points if one.kind] == ["fold", "fold"]
    for one in folds:
        assert abs(one.solution.parameter_rate) < 1e-9


@pytest.mark.parametrize("u", [0.0, -1e-4, -1.0])
def test_no_fold_beyond_a_cusp(u):
    """x^3 + |u| x grows with x: no point of any kind, and index 0 wherever it is certain."""
    points = across_a_cusp(u)
    assert [one.kind for one in points if one.kind] == []
    assert {one.index for one in points} <= {(0,), (None,)}


@pytest.mark.parametrize("u", [1.0, 1e-2])
@pytest.mark.parametrize(
    "options", [{"largest_step": 0.05}, {"aimed_turn": 0.02}, {"first_step": 0.4}], ids=str
)
def test_folds_do_not_depend_on_the_steps(u, options):
    """Short steps, gentle turns or a long first step lead to the same two folds."""
    usual, other = (
        parameters(of_kind(across_a_cusp(u, one), "fold"))
        for one in (EXACT, replace(EXACT, **options))
    )
    assert len(other) == 2
    assert other == pytest.approx(usual, abs=EPS)


class Uncounted(Potential):
    """A system whose index nobody may ask for: the operations of `System` alone."""

    def eigenvalues(self, *_: object) -> np.ndarray:
        """Fail."""
        raise AssertionError("the index is counted though it is not wanted")


def test_folds_need_no_index():
    """Without stability the same folds are found by the operations of `System`."""
    system = Uncounted(**vars(cusp(1.0)))
    points = path(system, -2.0, -6.0, until(6.0, stability=False))
    folds = of_kind(points, "fold")
    assert parameters(folds) == pytest.approx([2.0 / 3.0**1.5, -2.0 / 3.0**1.5], abs=EPS)
    assert {one.index for one in points} == {one.sides for one in points} == {None}


def test_a_pair_of_folds_within_one_step():
    """From x = -0.3 to 0.3 by a single step, over two folds that are 0.012 apart in x."""
    u = 1e-4
    options = replace(EXACT, first_step=0.6)
    points = path(cusp(u), -0.3, 0.3 * u - 0.027, until(1.0), options=options)
    assert [one.kind for one in points[:4]] == ["", "fold", "fold", ""]
    assert first(points[3]) > 0.2
    p = 2.0 * (u / 3.0) ** 1.5
    assert parameters(points[1:3]) == pytest.approx([p, -p], abs=EPS)


@pytest.mark.parametrize("e", [0.3, 0.05, 0.01, 1e-3])
def test_a_path_does_not_leave_its_branch_for_one_close_by(e):
    """x^2 = p^2 - e^2 turns back at p = -e; another path, of other orientation, is 2 e away.

    Steps are up to 0.6 long, and both paths are all but straight.
    """
    points = path(hyperbola(e), math.sqrt(9.0 - e * e), -3.0, until(-3.0, 3.0))
    (fold,) = of_kind(points, "fold")
    assert fold.solution.parameter == pytest.approx(-e, abs=EPS)
    assert fold.sides == ((0,), (1,))
    assert points[-1].solution.parameter == -3.0
    assert first(points[-1]) == pytest.approx(-math.sqrt(9.0 - e * e), abs=EPS)


# --- a closed curve -----------------------------------------------------------------------------


def round_an_isola(r: float, options: Options = EXACT, **wants: object) -> list[Point]:
    """The path of x^2 + p^2 = r^2 from p = 0, x = r round to the same point."""
    events = Events(
        targets=(0.0,),
        stop=lambda at: at.parameter == 0.0 and at.state.x[0] > 0.0,
        stability=True,
        **wants,
    )
    return path(isola(r), r, 0.0, events, options=options)


@pytest.mark.parametrize("r", [2.0, 0.1, 1e-3])
def test_an_isola_has_two_folds_and_closes(r):
    """A circle: folds at p = r and -r, x = 0; the stop ends the path where it began."""
    points = round_an_isola(r, replace(EXACT, first_step=0.05 * r))
    folds = of_kind(points, "fold")
    assert parameters(folds) == pytest.approx([r, -r], rel=EPS)
    assert [one.sides for one in folds] == [((0,), (1,)), ((1,), (0,))]
    assert first(points[-1]) == pytest.approx(r, rel=EPS)
    assert points[-1].solution.tangent == pytest.approx(points[0].solution.tangent, abs=1e-9)
    at = np.array([[first(one), one.solution.parameter] for one in points])
    assert np.linalg.norm(at, axis=1) == pytest.approx(np.full(len(at), r), rel=1e-8)
    turns = np.diff(np.unwrap(np.arctan2(at[:, 1], at[:, 0])))
    assert np.all(turns > 0.0)
    assert turns.sum() == pytest.approx(2.0 * math.pi, abs=1e-9)


def test_steps_follow_the_curvature():
    """Steps turn by what is aimed at: a circle takes 2 pi/0.12 of them, within a quarter."""
    statistics = Statistics()
    start = Configuration(np.array([1.0]), 0.0)
    events = until(0.0, stability=False)
    for _ in follow(isola(1.0), start, events, options=EXACT, statistics=statistics):
        pass
    # half of the circle: the first arrival at p = 0 is x = -1
    assert statistics.steps == pytest.approx(math.pi / EXACT.aimed_turn, rel=0.25)
    assert statistics.newton_iterations < 4 * statistics.steps


def test_a_path_without_end_stops_after_the_steps_allowed():
    """An isola that nothing stops is followed round and round; what was found is handed out."""
    found: list[Point] = []
    start = Configuration(np.array([1.0]), 0.0)
    points = follow(isola(1.0), start, options=replace(EXACT, max_steps=100))
    with pytest.raises(ContinuationFailed, match="not ended after 100 steps") as caught:
        found.extend(points)
    assert caught.value.reason is Reason.TOO_MANY_STEPS
    folds = parameters(of_kind(found, "fold"))
    assert len(folds) >= 3
    assert folds == pytest.approx([(-1.0) ** k for k in range(len(folds))], abs=EPS)


# --- branch points ------------------------------------------------------------------------------


@pytest.mark.parametrize("system", [pitchfork(), transcritical()], ids=["pitchfork", "crossing"])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_trivial_path_loses_its_stability_at_zero(system, sense):
    """x = 0 is a minimum for p < 0 and none for p > 0: a branch point at 0, from either side."""
    points = path(system, 0.0, -sense, until(sense), sense=sense)
    (branch,) = [one for one in points if one.kind]
    assert branch.kind == "branch"
    assert branch.solution.parameter == pytest.approx(0.0, abs=EPS)
    assert branch.details == {"symmetry": "all"}
    assert branch.sides == (((0,), (1,)) if sense > 0.0 else ((1,), (0,)))
    for one in points:
        if not one.kind:
            assert one.index == (int(one.solution.parameter > 0.0),)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_crossing_paths_exchange_their_stability(sense):
    """x = p is unstable for p < 0 and stable for p > 0; there dV/dp is stationary, and no fold."""
    points = path(transcritical(), -sense, -sense, until(sense), sense=sense)
    (branch,) = [one for one in points if one.kind]
    assert branch.kind == "branch"
    assert branch.solution.parameter == pytest.approx(0.0, abs=1e-11)
    assert branch.sides == (((1,), (0,)) if sense > 0.0 else ((0,), (1,)))


def test_bifurcated_path_turns_back_on_its_mirror_image():
    """x^2 = p from x = 1 to x = -1: dp/ds vanishes at 0, the stiffness 2 p just touches zero."""
    points = path(pitchfork(), 1.0, 1.0, until(1.2), sense=-1.0)
    (turn,) = [one for one in points if one.kind]
    assert turn.kind == "fold"
    assert turn.solution.parameter == pytest.approx(0.0, abs=1e-9)
    assert turn.sides == ((0,), (0,))
    assert abs(turn.solution.observables["work"][1]) < 1e-6
    assert first(points[-1]) == pytest.approx(-math.sqrt(1.2), abs=EPS)


@pytest.mark.parametrize("b", [0.1, -0.1, 1e-3, -1e-3, 1e-5, -1e-5])
@pytest.mark.parametrize("apart", [True, False], ids=["two classes", "one class"])
def test_branch_point_beside_a_fold(b, apart):
    """p = 1 - y^2: a fold at y = 0 and, 1e-10 of p and more before or after it, a branch at y = b.

    Each of the two changes the index by one, in its own class where there are two.
    """
    system = branch_beside_fold(b, apart=apart)
    points = path(system, np.array([math.sqrt(2.5), 0.0]), -1.5, until(-2.0))
    singular = [one for one in points if one.kind]
    order = ["branch", "fold"] if b > 0.0 else ["fold", "branch"]
    assert [one.kind for one in singular] == order
    (branch,), (fold,) = (of_kind(singular, kind) for kind in ("branch", "fold"))
    assert fold.solution.parameter == pytest.approx(1.0, abs=EPS)
    assert branch.solution.parameter == pytest.approx(1.0 - b * b, abs=1e-11)
    assert first(branch) == pytest.approx(b, abs=1e-8)
    assert branch.details == {"symmetry": "asymmetric" if apart else "all"}
    totals = [tuple(total_index(system, side) for side in one.sides) for one in singular]
    assert totals == [(0, 1), (1, 2)]
    if apart:
        changes = {one.kind: np.subtract(*one.sides[::-1]).tolist() for one in singular}
        assert changes == {"fold": [1, 0], "branch": [0, 1]}


# --- Bratu's problem ----------------------------------------------------------------------------


def bratu_fold(n: int) -> Point:
    """The fold of Bratu's problem on n points, on the path from p = 0.5 on and back to it."""
    points = path(bratu(n), np.zeros(n), 0.5, until(0.5))
    (fold,) = [one for one in points if one.kind]
    assert fold.kind == "fold"
    assert points[-1].solution.state.x.max() > 2.0
    return fold


def test_fold_of_bratus_problem_on_one_point():
    """8 u exp(-u) = p has its maximum 8/e at u = 1."""
    fold = bratu_fold(1)
    assert fold.solution.parameter == pytest.approx(8.0 / math.e, abs=EPS)
    assert first(fold) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("n", [3, 15, 31])
def test_smallest_eigenvalue_vanishes_at_the_fold_of_bratus_problem(n):
    """It is zero there to rounding, and changes its sign; the next one is 20 and more."""
    system, fold = bratu(n), bratu_fold(n)
    lowest, second = system.eigenvalues(fold.solution.state)[:2]
    assert abs(lowest) < 1e-7
    assert second > 20.0
    assert fold.sides == ((0,), (1,))
    tangent = fold.solution.tangent
    before, after = (
        system.eigenvalues(system.retract(fold.solution.state, s * tangent))[0]
        for s in (-1e-3, 1e-3)
    )
    assert before > 1e-4
    assert after < -1e-4


def test_fold_of_bratus_problem_converges_with_the_square_of_the_mesh():
    """To 3.513830719, from h = 1/8, 1/16, 1/32: 1.83 h^2 away; extrapolated, 1e-6 is left.

    Truth: p = 8 (x/cosh x)^2 with x tanh x = 1.
    """
    exact = 3.513830719125161
    values = [bratu_fold(n).solution.parameter for n in (7, 15, 31)]
    errors = [abs(value - exact) for value in values]
    for coarse, fine in pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.02)
    assert errors[-1] == pytest.approx(1.83 / 32.0**2, rel=0.01)
    assert richardson(*values) == pytest.approx(exact, abs=1e-6)


# --- targets, limits, stops ---------------------------------------------------------------------


def test_every_crossing_of_a_target_is_solved_for():
    """x^3 - x = p at p = 0 and 0.1, three times each, exactly and in path order."""
    points = path(cusp(1.0), -2.0, -6.0, until(6.0, targets=(0.0, 0.1, 6.0)))
    for p in (0.0, 0.1):
        roots = np.sort(np.roots([1.0, 0.0, -1.0, -p]).real)
        found = [first(one) for one in points if one.solution.parameter == p]
        assert found == pytest.approx(roots.tolist(), abs=EPS)


def test_targets_at_all_multiples_of_a_spacing():
    """Every k/4 between the ends, bit for bit; gamma between the folds three times."""
    points = path(cusp(1.0), -2.0, -6.0, until(6.0, spacing=0.25))
    counts = [parameters(points).count(0.25 * k) for k in range(-23, 25)]
    assert counts == [3 if abs(k) <= 1 else 1 for k in range(-23, 25)]


def test_a_target_at_a_fold_is_one_point_beside_it():
    """A target equal to the p that was located; before, the path ends there, or goes on."""
    p = parameters(of_kind(across_a_cusp(1.0), "fold"))[0]
    points = path(cusp(1.0), -2.0, -6.0, until(6.0, targets=(p, 6.0), limits=("x",)))
    assert p in parameters([one for one in points if not one.kind])
    assert len(of_kind(points, "fold")) == 2
    assert points[-1].solution.parameter == 6.0


def test_a_path_ends_at_the_first_target_at_which_it_stops():
    """Of three crossings of p = 0 the third, x = 1, and no point after it."""
    events = Events(targets=(0.0,), stop=lambda at: at.parameter == 0.0 and at.state.x[0] > 0.5)
    points = path(cusp(1.0), -2.0, -6.0, events)
    assert points[-1].solution.parameter == 0.0
    assert first(points[-1]) == pytest.approx(1.0, abs=EPS)
    assert len([one for one in points if one.solution.parameter == 0.0]) == 3


def test_limits_of_an_observable():
    """x = sin p is stationary at pi/2 + k pi, where it is 1 and -1 in turn; p has no fold."""
    system = graph(math.sin, math.cos)
    points = path(system, 0.0, 0.0, until(20.0, limits=("x",)))
    limits = of_kind(points, "limit")
    expected = [(k + 0.5) * math.pi for k in range(6)]
    assert parameters(limits) == pytest.approx(expected, abs=1e-9)
    assert [first(one) for one in limits] == pytest.approx([1.0, -1.0] * 3, abs=EPS)
    assert {one.index for one in limits} == {(0,)}
    assert [one.kind for one in points if one.kind] == ["limit"] * 6


def test_limits_and_folds_of_a_circle_alternate():
    """x is extreme at p = 0, and p at x = 0; from p = -r/2 on."""
    events = until(-0.25, stability=False, limits=("x",))
    points = path(isola(0.5), math.sqrt(0.1875), -0.25, events)
    special = [(one.kind, one.solution.parameter, first(one)) for one in points if one.kind]
    assert [kind for kind, _, _ in special] == ["limit", "fold", "limit"]
    found = np.array([place for _, *place in special])
    np.testing.assert_allclose(found, [[0.0, 0.5], [0.5, 0.0], [0.0, -0.5]], rtol=0, atol=1e-9)


@pytest.mark.parametrize("d", [0.2, 0.05, 0.01, 1e-3])
def test_two_limits_within_one_step(d):
    """x = p^3 - 3 d^2 p has limits at p = -+d, 4 d^3 apart in x."""
    system = graph(lambda p: p**3 - 3.0 * d * d * p, lambda p: 3.0 * (p * p - d * d))
    points = path(system, -1.0 + 3.0 * d * d, -1.0, until(1.0, limits=("x",)))
    assert parameters(of_kind(points, "limit")) == pytest.approx([-d, d], abs=1e-9)


def test_points_come_in_path_order():
    """Along a curve on which everything happens, each is ahead of the one before."""
    events = until(6.0, spacing=0.125, limits=("x", "work"))
    points = path(cusp(1.0), -2.0, -6.0, events)
    assert np.all(np.diff([first(one) for one in points]) > -1e-9)  # x grows along the path


# --- failures -----------------------------------------------------------------------------------


def failure(system: Potential, x: float, p: float, **options: float) -> ContinuationFailed:
    """How the path from a configuration to p = 1 fails."""
    with pytest.raises(ContinuationFailed) as caught:
        path(system, x, p, until(1.0), options=replace(EXACT, **options))
    return caught.value


def test_a_start_without_equilibrium_is_named():
    """x^2 + p^2 = 1 has no x at p = 2; the message has the parameter's name and value."""
    failed = failure(isola(1.0), 0.3, 2.0)
    assert failed.reason is Reason.NO_START
    assert "p = 2.00000000" in str(failed)


def test_a_start_at_a_branch_point_is_refused():
    """There the tangent matrix is singular, and two directions would do."""
    failed = failure(pitchfork(), 0.0, 0.0)
    assert failed.reason is Reason.NO_START
    assert Reason.SINGULAR.value in str(failed)


def test_a_corner_cannot_be_followed():
    """x = |p|/2: however short the step, the tangent turns by 53 degrees."""
    corner = graph(lambda p: 0.5 * abs(p), lambda p: math.copysign(0.5, p))
    failed = failure(corner, 0.5, -1.0)
    assert failed.reason is Reason.TOO_SHARP
    assert "p = -0.0" in str(failed)


def test_a_path_ends_where_its_system_does():
    """x = p where only x < 0.5 is allowed: the reason, and what the system adds to it."""
    system = graph(lambda p: p, lambda p: 1.0, inside=lambda x, p: bool(x[0] < 0.5))
    failed = failure(system, 0.0, 0.0)
    assert failed.reason is Reason.OUT_OF_RANGE
    assert "x = [0.5" in str(failed)
    assert "p = 0.50000000" in str(failed)


def test_what_was_found_before_a_failure_is_handed_out():
    """All points of the cusp up to a wall at x = 0.3, both sides of its first fold included."""
    system = replace(cusp(1.0), inside=lambda x, p: bool(x[0] < 0.3))
    found: list[Point] = []
    points = follow(system, Configuration(np.array([-2.0]), -6.0), options=EXACT)
    with pytest.raises(ContinuationFailed):
        found.extend(points)
    assert len(of_kind(found, "fold")) == 1
    assert first(found[-1]) == pytest.approx(0.3, abs=1e-4)


def test_a_residual_without_derivative_fails_and_does_not_loop():
    """A wrong slope keeps Newton's method from converging at once: a reason, in finite time."""
    system = scalar(lambda x, p: x - p, lambda x, p: -1.0, lambda x, p: -1.0)
    failed = failure(system, 0.1, 0.0)
    assert failed.reason is Reason.NO_START
