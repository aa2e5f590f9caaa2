"""Transfer of equilibria to coarser meshes, for Richardson extrapolation.

Error bars compare the same equilibrium on N, N/2 and N/4 edges. The meshes are nested: every second
frame of the fine mesh is a frame of the coarse one. A fine equilibrium, restricted, is a good
initial guess on the coarse mesh, and Newton's method finishes it in the plane normal to the path,
so that the states correspond.

If the restricted guess is too far away, Newton's method starts from an extrapolated correction
instead: the correction of the previous state on the path, or four times that of the next finer
mesh, because the discretisation is second order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from der.kernels.quaternions import Array
from der.problem import PLANE, Increment
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.manifold import Direction, split
from der.rod.rod import State


class Level(NamedTuple):
    """The state of a coarser mesh that belongs to one on a mesh of twice the edges."""

    solution: Equilibrium
    correction: Direction  # what leads to it from every second frame
    speed: float  # lengths along its own tangent, per length of the path of the finest mesh
    beyond: float  # its distance behind the plane, along that path


class Restricted(NamedTuple):
    """The states on half and on a quarter of the edges that belong to a state."""

    half: Level
    quarter: Level


def restricted(
    rings: Sequence[GrippedRing], fine: Equilibrium, near: Restricted | None, tolerance: float
) -> Restricted | None:
    """Return the states of two coarser meshes in the plane normal to the path at a fine state.

    Parameters
    ----------
    rings : the sector on N, N/2 and N/4 edges.
    near : the same of a state nearby; None: not known.
    tolerance : of the residual of an equilibrium, GJ/a.

    Returns
    -------
    Restricted or None
        None: a level has no such state.
    """
    finest, on_half, on_quarter = rings
    q, _, load = split(finest.supports, fine.tangent)
    advance = finest.inner(_normal(finest, q, load), fine.tangent)
    plane = _Plane(np.ascontiguousarray(q[::2]), load, advance, tolerance)
    given = None if near is None else near.half.correction
    half = plane.level(on_half, fine.state, lambda: given, 0.0)
    if half is None:
        return None
    plane = replace(plane, q=np.ascontiguousarray(plane.q[::2]))
    expected = partial(_twice_as_coarse, on_quarter, half.correction, near)
    quarter = plane.level(on_quarter, half.solution.state, expected, half.beyond)
    return None if quarter is None else Restricted(half, quarter)


def _twice_as_coarse(ring: GrippedRing, finer: Direction, near: Restricted | None) -> Direction:
    """The correction expected on the coarsest mesh, ``ring``; ``finer``: that before it."""
    # second order: four times that of the finer mesh; plus the error of this estimate nearby
    correction = _coarser(finer, 4.0)
    if near is not None:
        less = _coarser(near.half.correction, 4.0)
        correction = _sum(_sum(correction, near.quarter.correction, 1.0), less, -1.0)
    correction.q[~ring.supports.free] = 0.0
    return correction


@dataclass(frozen=True)
class _Plane:
    """The plane normal to the path of the finest mesh, as a coarser mesh sees it."""

    q: Array  # (n, b) rates of the frames along the path
    load: float  # and of gamma
    advance: float  # product of the path's tangent with its own normal
    tolerance: float  # of the residual, GJ/a

    def level(
        self,
        ring: GrippedRing,
        finer: State,
        expected: Callable[[], Direction | None],
        beyond: float,
    ) -> Level | None:
        """The state of ``ring`` in the plane; None: there is none.

        Newton's method starts from bare frames, then from the correction ``expected``, which is
        computed only if needed and may lie beside the plane. ``beyond`` is that of the finer mesh.
        """
        own = State(
            np.ascontiguousarray(finer.quat[::2]),
            np.ascontiguousarray(finer.stretch[::2]),
            finer.force,
            finer.load,
        )
        row = _normal(ring, self.q, self.load)
        for start in self._starts(ring, own, expected):
            at = ring.correct(start, along=row, hold=PLANE, tolerance=self.tolerance)
            if at.converged and (speed := ring.inner(row, at.tangent)) != 0.0:
                break
        else:
            return None
        away = ring.difference(own, at.state)
        # each correction is orthogonal, but rotations do not commute: a state lies beside the plane
        # by the second order of its correction, which depends on its start
        beyond += ring.inner(row, away) / self.advance
        return Level(at, split(ring.supports, away), self.advance / speed, beyond)

    def _starts(
        self, ring: GrippedRing, own: State, expected: Callable[[], Direction | None]
    ) -> Iterator[State]:
        """Initial guesses: bare frames, then these moved by the correction."""
        yield own
        correction = expected()
        if correction is not None:
            row = _normal(ring, self.q, self.load)
            rates = ring.increment(self.q, self.load)
            # corrections of another state may lie beside this plane by a little
            away = ring.inner(row, correction.flat) / ring.inner(row, rates)
            yield ring.retract(own, correction.flat - away * rates)


def _normal(ring: GrippedRing, q: Array, load: float) -> Increment:
    """The direction of rates ``q`` (n, b) of the frames and ``load`` of gamma, as a normal (m,).

    Notes
    -----
    Its product with another direction is the trapezoidal rule for the integral of the product of
    both rotations, the grips' included: they turn with gamma and are no entries of q. Without them
    an end of the integral would be missing, and the series in h would have odd powers.
    """
    return ring.increment(q, ring.turning * load)


def _coarser(correction: Direction, factor: float) -> Direction:
    """Every second entry of a correction, times a factor."""
    return Direction(
        factor * correction.q[::2], factor * correction.force, factor * correction.load
    )


def _sum(a: Direction, b: Direction, factor: float) -> Direction:
    """The sum a + factor b."""
    return Direction(a.q + factor * b.q, a.force + factor * b.force, a.load + factor * b.load)
