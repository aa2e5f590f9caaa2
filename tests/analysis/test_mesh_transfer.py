"""States of coarser meshes that belong to one, and the offsets from which they start."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import der
from der.analysis.matching import RATE, Family
from der.analysis.mesh_transfer import Restricted, restricted
from der.continuation.arclength import follow
from der.continuation.events import Visit, Wanted
from der.continuation.step import Step, Tally
from der.rod.equilibrium import Control, Direction, dot, equilibrium, moved
from der.rod.gripped_ring import Sector, sector
from der.rod.rod import State
from der.scene import meshes

TOLERANCE = 1e-12
NOISE = 1e-9  # of a state solved to 1e-10


@functools.cache
def path(
    h_over_t: float, n_edges: int, nu: float = 0.3
) -> tuple[tuple[Sector, Sector, Sector], list[Visit]]:
    """Sectors of a circle at the three levels, and its path on the finest."""
    section = der.rectangular_section(h_over_t, nu)
    finest, half, quarter = (sector(der.circle(), section, n) for n in meshes(n_edges, "quarter"))
    wanted = Wanted(stability=False, contacts=False)
    return (finest, half, quarter), list(follow(finest, wanted, Tally()))


def coarse(h_over_t: float, n_edges: int, nu: float = 0.3) -> list[Restricted | None]:
    """What belongs to each state of a path, each from the one before."""
    pieces, visits = path(h_over_t, n_edges, nu)
    found: list[Restricted | None] = []
    for visit in visits:
        found.append(restricted(pieces, visit.at, found[-1] if found else None, TOLERANCE))
    return found


def bare(visit: Visit) -> State:
    """Every second frame of a state."""
    start = visit.at.state
    quat = np.ascontiguousarray(start.quat[::2])
    return start.but(quat=quat, stretch=start.stretch[::2].copy())


def normal(piece: Sector, visit: Visit) -> Direction:
    """The plane of the coarser mesh: the path's tangent, grips' turn included."""
    t = visit.at.tangent
    grips = float(np.sum(piece.body.mass[:, 0] * piece.held.turn**2))
    q = np.ascontiguousarray(t.q[::2])
    return Direction(q, np.zeros(len(piece.held.target)), grips * t.load)


def test_states_are_equilibria_in_the_plane_normal_to_the_path():
    """Every second frame of the state, moved by its offset, is one on N/2 edges to 1e-11.

    It lies in the plane but for the second order of the offset: rotations do not commute.
    """
    (_, half, _), visits = path(4.0, 64)
    for visit, found in zip(visits, coarse(4.0, 64), strict=True):
        offset = found.half.offset
        state = moved(half.held, bare(visit), offset)
        assert equilibrium(half.body, half.held, state, iterations=0).residual < 1e-11
        size = np.abs(offset.q).max() + abs(offset.load)
        assert abs(dot(half.body, normal(half, visit), offset)) <= size**2 + NOISE


def test_where_it_starts_from_does_not_change_the_state():
    """From the state before, or from bare frames: values agree to 1e-9, rates to 1e-5.

    A state lies beside the plane by h^4 times something that depends on the start; its values are
    taken back to the plane, to the square of that. Rates are not: measured 2e-6.
    """
    pieces, visits = path(4.0, 128)
    family = Family(pieces, TOLERANCE)
    near = None
    for visit in visits:
        found, plain = family.matched(visit.at, near), family.matched(visit.at)
        assert found.table[:, :RATE] == pytest.approx(plain.table[:, :RATE], abs=1e-9)
        assert found.table[:, RATE:] == pytest.approx(plain.table[:, RATE:], abs=1e-5)
        near = found.coarse


def test_states_that_bare_frames_are_too_far_from_are_found():
    """A strip, h/t = 16.6, on 64 edges: from bare frames Newton's method fails on 16 edges.

    From the offset expected it does not, at any state.
    """
    (_, half, quarter), visits = path(16.6, 64)
    lost = 0
    for visit in visits:
        at = equilibrium(
            half.body,
            half.held,
            bare(visit),
            along=normal(half, visit),
            control=Control.DIRECTION,
        )
        on_half = Visit(replace(at, tangent=visit.at.tangent._replace(q=visit.at.tangent.q[::2])))
        at = equilibrium(
            quarter.body,
            quarter.held,
            bare(on_half),
            along=normal(quarter, on_half),
            control=Control.DIRECTION,
        )
        lost += not at.converged
    assert lost
    assert None not in coarse(16.6, 64)


def test_a_mesh_without_such_a_state_is_none():
    """Beyond a loop that 8 edges do not have there is nothing to be found (h/t = 1, 32 edges)."""
    section = der.rectangular_section(1.0)
    finest, half, quarter = (sector(der.circle(), section, n) for n in meshes(32, "quarter"))
    wanted = Wanted(stability=False, contacts=False, load_max=np.inf, until_folded=True)
    visits = follow(finest, wanted, Tally())
    found = [restricted((finest, half, quarter), visit.at, None, 1e-10) for visit in visits]
    assert None in found


def test_a_chord_and_its_rates_lead_along_the_path():
    """The cubic of a step, and the one beyond it, meet the path to the fourth order of the step.

    The state beyond is sought from it orthogonally to the tangent: what Newton's method adds falls
    16-fold and more where a step is halved (measured 17).
    """
    (piece, _, _), visits = path(4.0, 64)
    at = visits[6].at

    def onward(length: float) -> float:
        states = [at]
        for _ in range(2):
            t = states[-1].tangent
            guess = Direction(length * t.q, length * t.force, length * t.load)
            if len(states) == 2:
                guess = Step(piece, states[0], states[1], length, 1e-12, Tally()).beyond(length)
            start = moved(piece.held, states[-1].state, guess)
            states.append(
                equilibrium(
                    piece.body,
                    piece.held,
                    start,
                    along=t,
                    control=Control.DIRECTION,
                    tolerance=1e-12,
                )
            )
        step = Step(piece, states[1], states[2], length, 1e-12, Tally())
        return float(np.abs(step.between(start, states[2].state).q).max())

    assert onward(0.2) / onward(0.1) > 12.0
