"""Newton's method on the collocation equations: how it converges, and how it says that it did not.

Tangents and rates are held against differences of solutions, which share nothing with them but the
equations.
"""

import numpy as np
import pytest
from boundary_value import points, state_at, system

import der
from der.bvp.collocation import Collocation, Direction, Failure, Solution
from der.bvp.condensing import eliminate
from der.errors import Reason

RINGS = {
    "quarter": (der.ellipse(0.6, "x"), 4.0, 1.9),
    "half": (der.triangle(np.pi / 3, 0.2), 3.0, 1.2),
}


@pytest.fixture(params=RINGS)
def start(request) -> tuple[Collocation, Solution]:
    """A state in the middle of a path, on a quarter or on a half."""
    ring, h_over_t, gamma = RINGS[request.param]
    equations = system(ring, h_over_t)
    return equations, state_at(equations, gamma, 1e-10)


def guess_at(at: Solution, gamma: float) -> Direction:
    """A state's own values for another gamma."""
    return Direction(at.frames, at.p, gamma)


def at_gamma(equations: Collocation, at: Solution, gamma: float) -> Solution:
    """The solution nearby at another gamma."""
    found = equations.solved(at.mesh, guess_at(at, gamma), at.tangent, by_gamma=True)
    assert isinstance(found, Solution)
    return found


def central(equations: Collocation, at: Solution, step: float) -> tuple[Solution, Solution]:
    """Solutions on both sides."""
    return at_gamma(equations, at, at.gamma - step), at_gamma(equations, at, at.gamma + step)


def test_newton_converges_quadratically(start):
    """Each error is the square of the last times one constant; source: Kantorovich.

    The slope of log e(k+1) over log e(k), from three errors above rounding, is 2; measured 1.9 to
    2.2 from a guess 0.2 rad away.
    """
    equations, at = start
    target = at_gamma(equations, at, at.gamma + 0.2)
    errors = []
    for k in (1, 2, 3):
        found = equations.solved(
            at.mesh,
            guess_at(at, target.gamma),
            at.tangent,
            by_gamma=True,
            iterations=k,
            tolerance=0.0,
        )
        assert isinstance(found, Solution)
        errors.append(np.abs(found.frames - target.frames).max())
    order = np.log(errors[2] / errors[1]) / np.log(errors[1] / errors[0])
    assert errors[2] > 1e-13
    assert 1.7 < order < 2.4


def test_tangent_is_the_rate_of_change_of_solutions(start):
    """Differences of solutions at gamma -+ 1e-4: their own error is 1e-8 of a third derivative."""
    equations, at = start
    low, high = central(equations, at, 1e-4)
    t = at.tangent
    for value, change in ((t.frames, high.frames - low.frames), (t.p, high.p - low.p)):
        np.testing.assert_allclose(value / t.gamma, change / 2e-4, atol=1e-6, rtol=1e-6)


def test_tangent_has_unit_length(start):
    """Mean square of the rotations (4 |dq|^2) plus gamma's is one, to rounding."""
    equations, at = start
    rotation = 4 * (at.tangent.frames**2).sum(axis=2) @ equations.rule.weights
    length = rotation @ at.mesh.h / equations.sector.length + at.tangent.gamma**2
    assert length == pytest.approx(1.0, abs=1e-12)


def test_slope_is_that_of_the_moment(start):
    """dM/dgamma of the linearised problem against differences over 2e-4: 1e-8 of the third."""
    equations, at = start
    low, high = central(equations, at, 1e-4)
    difference = (high.moment - low.moment) / 2e-4
    assert at.slope == pytest.approx(difference, abs=1e-6 * max(1.0, abs(at.slope)))


def test_energy_grows_by_the_work_of_the_grips(start):
    """dU/dgamma = 4 M (two grips, two arms), by differences over 2e-4."""
    equations, at = start
    low, high = central(equations, at, 1e-4)
    assert (high.energy - low.energy) / 2e-4 == pytest.approx(4 * at.moment, rel=1e-7)


def test_frames_are_of_unit_length_at_mesh_points(start):
    """Gauss collocation conserves the quadratic invariant |q| whatever the mesh.

    Hairer, Lubich &
    Wanner 2006, theorem IV.2.1); the tolerance is that of Newton's last iterate but one.
    """
    _, at = start
    np.testing.assert_allclose(np.linalg.norm(at.nodes, axis=1), 1.0, atol=1e-7)


def test_orientation_is_kept_through_folds():
    """The determinant with the tangent's row changes sign at branch points only, not at folds.

    The circle at h/t = 1.6 has two folds and no branch point on its path.
    """
    path = points(system(der.circle(), 1.6), np.pi)
    assert sum(point.kind == "fold" for point in path) == 2
    assert {point.solution.orientation for point in path} in ({1}, {-1})


@pytest.mark.parametrize("seed", range(4))
def test_elimination_solves_and_knows_the_sign_of_the_determinant(seed):
    """Solutions and sign as numpy's; pivots are sought: the diagonal begins with a zero.

    The error is rounding times the condition, 17 to 2000 for these matrices, times their size.
    """
    random = np.random.default_rng(seed)
    matrix, right = random.normal(size=(16, 16)), random.normal(size=(16, 7))
    matrix[0, 0] = 0.0
    columns, expected = np.vstack([matrix.T, right.T]), np.linalg.solve(matrix, right)
    assert eliminate(columns) == np.sign(np.linalg.det(matrix))
    rounding = 16 * np.finfo(float).eps * np.linalg.cond(matrix) * np.abs(expected).max()
    np.testing.assert_allclose(columns[16:].T, expected, rtol=0.0, atol=rounding)


def test_elimination_refuses_a_vanishing_pivot():
    """A row of zeros leaves no pivot in the last column but exactly zero."""
    matrix = np.random.default_rng(0).normal(size=(5, 5))
    matrix[2] = 0.0
    assert eliminate(np.vstack([matrix.T, np.ones((1, 5))])) == 0


# --- failure is a value -----------------------------------------------------------------------


def test_too_few_iterations_are_slow(start):
    """One iteration from 0.2 rad away leaves an increment far above the tolerance."""
    equations, at = start
    found = equations.solved(
        at.mesh, guess_at(at, at.gamma + 0.2), at.tangent, by_gamma=True, iterations=1
    )
    assert isinstance(found, Failure)
    assert found.reason is Reason.TOO_MANY_ITERATIONS


def test_a_guess_without_a_tangent_diverges(start):
    """A moment a thousand times too large sends the first increment beyond any rotation."""
    equations, at = start
    guess = Direction(at.frames, 1e3 + at.p, at.gamma)
    found = equations.solved(at.mesh, guess, at.tangent, by_gamma=True)
    assert isinstance(found, Failure)
    assert found.reason is Reason.DIVERGED


def test_a_step_without_direction_is_singular(start):
    """The row of the tangent is zero: the bordered system has no inverse."""
    equations, at = start
    none = Direction(np.zeros_like(at.frames), np.zeros_like(at.p), 0.0)
    found = equations.solved(at.mesh, guess_at(at, at.gamma), none)
    assert isinstance(found, Failure)
    assert found.reason is Reason.SINGULAR


@pytest.mark.parametrize("where", ["first", "last", "p", "gamma"])
@pytest.mark.parametrize("by_gamma", [False, True])
def test_nan_is_never_a_solution(start, where, by_gamma):
    """A number that is not one fails by name, wherever it enters."""
    equations, at = start
    frames, p, gamma = at.frames.copy(), at.p.copy(), at.gamma
    if where in ("first", "last"):
        frames.flat[0 if where == "first" else -1] = np.nan
    elif where == "p":
        p[1] = np.nan
    else:
        gamma = np.nan
    found = equations.solved(at.mesh, Direction(frames, p, gamma), at.tangent, by_gamma=by_gamma)
    assert isinstance(found, Failure)
