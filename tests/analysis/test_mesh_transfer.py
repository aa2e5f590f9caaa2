"""States of coarser meshes that belong to one, and the corrections from which they start."""

import functools

import numpy as np
import pytest

import der
from der.analysis.extrapolation.curve import RATE, Family
from der.analysis.extrapolation.mesh_transfer import Restricted, restricted
from der.analysis.request import Request
from der.continuation.step import Step
from der.problem import PLANE, Increment, Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.manifold import split
from der.rod.rod import State
from der.scene import meshes

TOLERANCE = 1e-12
NOISE = 1e-9  # of a state solved to 1e-10
REQUEST = Request(stability=False, self_crossings=False)


def three(h_over_t: float, n_edges: int, nu: float = 0.3) -> tuple[GrippedRing, ...]:
    """A circle's quarter at the three levels, finest first."""
    section = der.rectangular_section(h_over_t, nu)
    return tuple(gripped_ring(der.circle(), section, n) for n in meshes(n_edges, "quarter"))


@functools.cache
def path(
    h_over_t: float, n_edges: int, nu: float = 0.3
) -> tuple[tuple[GrippedRing, ...], list[Point[Equilibrium]]]:
    """A circle at the three levels, and its path on the finest."""
    rings = three(h_over_t, n_edges, nu)
    return rings, list(REQUEST.follow(rings[0]))


def coarse(h_over_t: float, n_edges: int, nu: float = 0.3) -> list[Restricted | None]:
    """What belongs to each state of a path, each from the one before."""
    rings, points = path(h_over_t, n_edges, nu)
    found: list[Restricted | None] = []
    for point in points:
        found.append(restricted(rings, point.solution, found[-1] if found else None, TOLERANCE))
    return found


def bare(state: State) -> State:
    """Every second frame of a state."""
    quat = np.ascontiguousarray(state.quat[::2])
    return state.but(quat=quat, stretch=state.stretch[::2].copy())


def normal(ring: GrippedRing, rates: np.ndarray, load: float) -> Increment:
    """The plane of the coarser mesh: the path's tangent, grips' turn included."""
    grips = float(np.sum(ring.rod.mass[:, 0] * ring.supports.turn**2))
    return ring.increment(rates, grips * load)


def test_states_are_equilibria_in_the_plane_normal_to_the_path():
    """Every second frame of the state, moved by its correction, is one on N/2 edges to 1e-11.

    It lies in the plane but for the second order of the correction: rotations do not commute.
    """
    (finest, half, _), points = path(4.0, 64)
    for point, found in zip(points, coarse(4.0, 64), strict=True):
        at, correction = point.solution, found.half.correction
        state = half.retract(bare(at.state), correction.flat)
        assert half.correct(state, iterations=0).residual < 1e-11
        t = split(finest.supports, at.tangent)
        size = np.abs(correction.q).max() + abs(correction.load)
        plane = normal(half, t.q[::2], t.load)
        assert abs(half.inner(plane, correction.flat)) <= size**2 + NOISE


def test_where_it_starts_from_does_not_change_the_state():
    """From the state before, or from bare frames: values agree to 1e-9, rates to 1e-5.

    A state lies beside the plane by h^4 times something that depends on the start; its values are
    taken back to the plane, to the square of that. Rates are not: measured 2e-6.
    """
    rings, points = path(4.0, 128)
    family = Family(rings, TOLERANCE)
    near = None
    for point in points:
        found, plain = family.matched(point.solution, near), family.matched(point.solution)
        assert found.table[:, :RATE] == pytest.approx(plain.table[:, :RATE], abs=1e-9)
        assert found.table[:, RATE:] == pytest.approx(plain.table[:, RATE:], abs=1e-5)
        near = found.coarse


def test_states_that_bare_frames_are_too_far_from_are_found():
    """A strip, h/t = 16.6, on 64 edges: from bare frames Newton's method fails on 16 edges.

    From the correction expected it does not, at any state.
    """
    (finest, half, quarter), points = path(16.6, 64)
    lost = 0
    for point in points:
        t = split(finest.supports, point.solution.tangent)
        start = bare(point.solution.state)
        at = half.correct(start, along=normal(half, t.q[::2], t.load), hold=PLANE)
        start = bare(at.state)
        at = quarter.correct(start, along=normal(quarter, t.q[::4], t.load), hold=PLANE)
        lost += not at.converged
    assert lost
    assert None not in coarse(16.6, 64)


def test_a_mesh_without_such_a_state_is_none():
    """Beyond a loop that 8 edges do not have there is nothing to be found (h/t = 1, 32 edges)."""
    rings = three(1.0, 32)
    request = Request(np.inf, until_folded=True, stability=False, self_crossings=False)
    points = request.follow(rings[0])
    assert None in [restricted(rings, point.solution, None, 1e-10) for point in points]


def test_an_interpolant_and_its_rates_lead_along_the_path():
    """The cubic of a step, and the one beyond it, meet the path to the fourth order of the step.

    The state beyond is sought from it orthogonally to the tangent: what Newton's method adds falls
    16-fold and more where a step is halved (measured 17).
    """
    (ring, _, _), points = path(4.0, 64)
    at = points[6].solution

    def onward(length: float) -> float:
        states = [at]
        for _ in range(2):
            t = states[-1].tangent
            guess = length * t
            if len(states) == 2:
                step = Step(ring, states[0], states[1], length, 1e-12, Statistics())
                guess = step.beyond(length)
            start = ring.retract(states[-1].state, guess)
            states.append(ring.correct(start, along=t, hold=PLANE, tolerance=1e-12))
        away = ring.difference(start, states[2].state)
        return float(np.abs(split(ring.supports, away).q).max())

    assert onward(0.2) / onward(0.1) > 12.0
