"""Self-crossings of the smooth curve through the vertices of a ring.

A polygon crosses itself up to its sagitta away from where the curve does. How much that is depends
on where within their edges two strands meet: it is of order h^2, but no series in h. The curves
x(u; s) of a path, quintic splines through the vertices, cross where

    x(u; s) = x(v; s),

three equations for the places u and v on both strands, and s on the path. At grips and
jumps of the natural curvature the second derivative of x jumps, and may the size of the cells: each
strand is the spline through the vertices between two of these.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.sparse.linalg import SuperLU, splu

from der.analysis.self_crossing import CONTACT
from der.continuation.step import Step
from der.kernels.quaternions import Array
from der.kernels.strands import nearest_strands
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State

Curve: TypeAlias = Callable[..., Array]  # point (3,) at a fraction of the ring, or its derivative
Piece: TypeAlias = tuple[float, float]  # a part of the ring, its ends as fractions

_SLOPE = 1e-4  # of s: the difference for the rate of the curve along the path
_FAR = 0.1  # of the ring: a crossing farther from where it was looked for is another one
_MOST = 20  # steps of Newton's method
_CLOSE = 1e-9  # of s


def strands(ring: GrippedRing, step: Step[State]) -> Array | None:
    """Return where two strands meet in the middle of a step, as fractions (2,) of the ring."""
    middle = 0.5 * step.length
    low, high = (ring.vertices(step.expected(s)) for s in (middle - CONTACT, middle + CONTACT))
    found = np.array(nearest_strands(low, high))
    return None if found[0] < 0 else (found + 0.5) / ring.n_edges


def smooth_crossing(
    ring: GrippedRing, step: Step[State], finest: Step[State], where: Array, degree: int = 5
) -> Equilibrium | None:
    """Return the state of a step at which two strands of the smooth curve cross, or None.

    Parameters
    ----------
    finest : the same step on the finest mesh.
    where : fractions (2,) of the ring close to which they do.
    degree : of the splines.

    Notes
    -----
    Newton's method from the middle of the step; the rate along the path is that between the last
    two iterates.
    """
    pieces = [_piece(ring.breaks, float(u)) for u in where]
    apart = partial(_apart, ring, step, finest, pieces, degree)
    start = at = np.append(where, 0.5 * step.length)
    here, beside = (apart(s) for s in (at[2], at[2] + _SLOPE))
    rate = (_between(beside, at) - _between(here, at)) / _SLOPE
    for _ in range(_MOST):
        columns = np.array([here[0](at[0], 1), -here[1](at[1], 1), rate])
        change = np.linalg.solve(columns.T, _between(here, at))
        at = at - change
        elsewhere = np.abs(at - start)[:2].max() > _FAR
        if elsewhere or not 0.0 < at[2] < step.length:
            return None
        if abs(change[2]) < _CLOSE:
            inside = all(map(partial(_inside, 1.0 / ring.n_edges), pieces, at[:2]))
            return cast(Equilibrium, step.at(float(at[2]))) if inside else None
        before, here = here, apart(at[2])
        rate = (_between(before, at) - _between(here, at)) / change[2]
    return None


def _apart(
    ring: GrippedRing,
    step: Step[State],
    finest: Step[State],
    pieces: Sequence[Piece],
    degree: int,
    s: float,
) -> list[Curve]:
    """Both strands at ``s``: those of the finest mesh, and the distance of the vertices from them.

    A quarter of the edges are too few for a spline, but not for that distance, of order h^2.
    """
    x = ring.vertices(step.at(float(s)).state)
    if step is finest:
        return [_through(x, degree, piece) for piece in pieces]
    alike = finest.expected(s / step.length * finest.length)
    y = cast(GrippedRing, finest.system).vertices(alike)
    return [_corrected(x, _through(y, degree, piece), degree, piece) for piece in pieces]


def _corrected(x: Array, fine: BSpline, degree: int, piece: Piece) -> Curve:
    """A strand of the finest mesh, moved to vertices of another."""
    k, n = _vertices(piece, len(x)), len(x)
    away = _spline(x[k % n] - fine((k + 0.5) / n), piece, n, degree)
    return lambda u, order=0: fine(u, order) + away(u, order)


def _piece(breaks: Array, u: float) -> Piece:
    """The part of the ring around a fraction of it in which the curvature has no jump."""
    around = np.concatenate([breaks - 1.0, breaks, breaks + 1.0])
    return float(around[around <= u].max()), float(around[around > u].min())


def _inside(margin: float, piece: Piece, u: float) -> bool:
    """Whether a fraction of the ring lies in a part, but for a ``margin``."""
    return piece[0] - margin <= u <= piece[1] + margin


def _vertices(piece: Piece, n: int) -> NDArray[np.int_]:
    """Numbers of the vertices of a part: vertex k is at (k + 1/2)/n, the breaks at edges k/n."""
    return np.arange(*(round(end * n) for end in piece))


def _through(x: Array, degree: int, piece: Piece) -> BSpline:
    """The curve through the vertices of a part; the ring goes on around."""
    k, n = _vertices(piece, len(x)), len(x)
    return _spline(x[k % n], piece, n, degree)


@lru_cache(maxsize=64)
def _interpolation(piece: Piece, n: int, degree: int) -> tuple[Array, int, SuperLU]:
    """Knots and degree, lower if vertices are few, of a part's splines, and factors for them."""
    u = (_vertices(piece, n) + 0.5) / n
    degree = min(degree, len(u) - 1)
    knots = make_interp_spline(u, u, k=degree).t
    return knots, degree, splu(BSpline.design_matrix(u, knots, degree).tocsc())


def _spline(x: Array, piece: Piece, n: int, degree: int) -> BSpline:
    """The spline through the vertices ``x`` of a part, of ``n`` of the ring."""
    knots, degree, factors = _interpolation(piece, n, degree)
    return BSpline.construct_fast(knots, np.ascontiguousarray(factors.solve(x)), degree)


def _between(strands: Sequence[Curve], at: Array) -> Array:
    """The vector (3,) between both strands."""
    between: Array = strands[0](at[0]) - strands[1](at[1])
    return between
