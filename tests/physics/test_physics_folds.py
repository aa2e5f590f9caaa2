"""Folds of rod paths against their definition: a mode of the path's own symmetry has no stiffness.

Truth: eigenvalues of the dense Hessian on the position conditions, gamma held, by LAPACK. None of
the follower's rates, indices or factors enters.
"""

import functools
import math

import numpy as np
import pytest
from rods import dense, on_conditions, solved

import der
from der.analysis.request import Request
from der.problem import PLANE, Point
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.rod import State

ASIDE = 1e-3  # of s: how far from a fold its two sides are looked at

# ring, h/t, sector, whether it is followed beyond pi; two folds each
PATHS = [
    (der.circle(), 1.6, "auto", False),
    (der.circle(), 1.6, "full", False),
    (der.circle(), 1.0, "auto", True),
    (der.ellipse(0.6), 1.2, "auto", False),
    (der.rectangle(0.6, 0.3, "y"), 3.0, "auto", False),
    (der.triangle(math.radians(60), 1 / 30), 4.0, "auto", False),
    (der.triangle(math.radians(120), 1 / 15), 1.0, "auto", False),
]


@functools.cache
def folds(
    ring: der.Ring, h_over_t: float, name: str, beyond: bool
) -> tuple[GrippedRing, list[Point]]:
    """A gripped ring of 64 edges and the folds of its path."""
    gripped = gripped_ring(ring, der.rectangular_section(h_over_t), 64, name=name)
    gamma_max = 6.0 if beyond else math.pi
    request = Request(gamma_max, until_folded=beyond, self_crossings=False)
    return gripped, [one for one in request.follow(gripped) if one.kind == "fold"]


def eigenvalues(ring: GrippedRing, state: State) -> np.ndarray:
    """Of the Hessian on the conditions, ascending."""
    return on_conditions(*dense(ring, state))


def beside(ring: GrippedRing, fold: Point, s: float) -> State:
    """The equilibrium at a distance from a fold, measured along its tangent."""
    at = fold.solution
    start = ring.retract(at.state, s * at.tangent)
    return solved(ring, start, along=at.tangent, hold=PLANE).state


@pytest.mark.parametrize(("ring", "h_over_t", "name", "beyond"), PATHS, ids=str)
def test_an_eigenvalue_vanishes_and_changes_its_sign_at_a_fold(ring, h_over_t, name, beyond):
    """One is zero to rounding at each of two folds; 0.001 before and behind it has unequal signs.

    It goes like 0.1 to 1.4 of s. All others keep their signs, so that the index changes by one.
    Measured below 1e-15 of the largest, where the next is 1e-5 of it and more.
    """
    gripped, found = folds(ring, h_over_t, name, beyond)
    assert len(found) == 2
    for fold in found:
        values = eigenvalues(gripped, fold.solution.state)
        zero = int(np.argmin(np.abs(values)))
        before, after = (eigenvalues(gripped, beside(gripped, fold, s)) for s in (-ASIDE, ASIDE))
        assert abs(values[zero]) < 1e-14 * values[-1]
        assert before[zero] * after[zero] < 0.0
        assert min(abs(before[zero]), abs(after[zero])) > 0.05 * ASIDE
        assert np.all(np.delete(before * after, zero) > 0.0)
        change = int(np.sum(after < 0.0)) - int(np.sum(before < 0.0))
        classes = [count - was for was, count in zip(*fold.sides, strict=True)]
        assert classes == [change] + [0] * (len(classes) - 1)
