"""The states of two coarser meshes that belong to one on the finest.

Frames sit on the same material points at every resolution, so every second frame of a state is
nearly a state on half the edges. What is missing is called its *offset*. Offsets change little from
one state of a path to the next, and are about four times as large from mesh to mesh: where bare
frames are too far from their state, Newton's method starts from the offset expected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from der.continuation.interpolant import between
from der.kernels.quaternions import Array
from der.rod.equilibrium import Control, Direction, Equilibrium, dot, equilibrium, moved
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State


class Level(NamedTuple):
    """The state of a coarser mesh that belongs to one on a mesh of twice the edges."""

    at: Equilibrium
    offset: Direction  # what leads to it from every second frame
    speed: float  # lengths along its own tangent, per length of the path of the finest mesh
    beyond: float  # how far beyond the plane it lies, along that path


class Restricted(NamedTuple):
    """What belongs to a state on half and on a quarter of its edges."""

    half: Level
    quarter: Level


def restricted(
    rings: Sequence[GrippedRing],
    fine: Equilibrium,
    near: Restricted | None,
    tolerance: float,
) -> Restricted | None:
    """The states of two coarser meshes in the planes normal to the path at a state on the finest.

    Parameters
    ----------
    rings : the sector on N, N/2 and N/4 edges.
    near : the same of a state nearby; None: not known.
    tolerance : of the residual of an equilibrium, GJ/a.

    Returns
    -------
    Restricted or None
        None where a level has no such state.
    """
    finest, on_half, on_quarter = rings
    q, load = fine.tangent.q, fine.parameter_rate
    advance = dot(finest.rod, _normal(finest, q, load), fine.tangent)
    q = np.ascontiguousarray(q[::2])
    given = None if near is None else near.half.offset
    half = _level(on_half, fine.state, q, load, lambda: given, advance, 0.0, tolerance)
    if half is None:
        return None
    expected = partial(_twice_as_coarse, on_quarter, half.offset, near)
    q = np.ascontiguousarray(q[::2])
    quarter = _level(on_quarter, half.solution.state, q, load, expected, advance, half.beyond, tolerance)
    return None if quarter is None else Restricted(half, quarter)


def _twice_as_coarse(ring: GrippedRing, finer: Direction, near: Restricted | None) -> Direction:
    """The offset expected on the coarsest mesh, ``ring``, where ``finer`` is that before it."""
    # second order: four times that of the finer mesh; and what that was short of nearby
    offset = _coarser(finer, 4.0)
    if near is not None:
        less = _coarser(near.half.offset, 4.0)
        offset = _sum(_sum(offset, near.quarter.offset, 1.0), less, -1.0)
    offset.q[~ring.supports.free] = 0.0
    return offset


def _level(
    ring: GrippedRing,
    finer: State,
    q: Array,
    load: float,
    expected: Callable[[], Direction | None],
    advance: float,
    beyond: float,
    tolerance: float,
) -> Level | None:
    """The state of ``ring`` in the plane normal to rates ``q`` (n, b) and ``load``.

    Tried from bare frames, then from the offset ``expected``, which may lead beside the plane and
    is not worked out before it is needed. ``beyond`` is that of the finer mesh.
    """
    own = State(
        np.ascontiguousarray(finer.quat[::2]),
        np.ascontiguousarray(finer.stretch[::2]),
        finer.force,
        finer.load,
    )
    row = _normal(ring, q, load)
    for start in _starts(ring, own, row, load, expected):
        at = ring.correct(start,
            along=row,
            hold=PLANE,
            tolerance=tolerance,
        )
        if at.converged and (speed := ring.inner(row, at.tangent)) != 0.0:
            break
    else:
        return None
    offset = ring.difference(own, at.state)
    # corrections are orthogonal one by one, and rotations do not commute: a state lies beside the
    # plane to the second order of its offset, by as much as its start would have it
    beyond += ring.inner(row, offset) / advance
    return Level(at, offset, advance / speed, beyond)


def _starts(
    ring: GrippedRing, own: State, row: Direction, load: float, expected: Callable[[], Direction | None]
) -> Iterator[State]:
    """Where Newton's method starts: bare frames, then these moved by the offset ``expected``."""
    yield own
    offset = expected()
    if offset is not None:
        rates = row._replace(load=load)
        # offsets of another state may lie beside this plane by a little
        away = ring.inner(row, offset) / ring.inner(row, rates)
        yield ring.retract(own, _sum(offset, rates, -away))


def _normal(ring: GrippedRing, q: Array, load: float) -> Direction:
    """The direction of rates ``q`` (n, b) of the frames and ``load`` of gamma, as a normal.

    Notes
    -----
    Its product with another direction is the trapezoidal rule for the integral of the product of
    both rotations, the grips' included: they turn with gamma and are no entries of q. Without them
    an end of the integral would be missing, and the series in h would have odd powers.
    """
    return Direction(q, np.zeros(len(ring.supports.target)), ring.turning * load)


def _coarser(offset: Direction, factor: float) -> Direction:
    """Every second of an offset, times a factor."""
    return Direction(factor * offset.q[::2], factor * offset.force, factor * offset.load)


def _sum(a: Direction, b: Direction, factor: float) -> Direction:
    """The sum a + factor b."""
    return Direction(a.q + factor * b.q, a.force + factor * b.force, a.load + factor * b.load)
