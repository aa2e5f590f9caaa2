"""Self-crossings of the smooth curve through the vertices of a ring.

A polygon crosses itself up to its sagitta away from where the curve does. How much that is depends
on where within their edges two strands meet: it is of order h^2, but no series in h. The curves
x(u; s) of a path, quintic splines through the vertices, cross where

    x(u; s) = x(v; s),

three equations for the places u and v on both strands, and s on the path.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias, cast

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from der.analysis.self_crossing import CONTACT
from der.continuation.step import Step
from der.kernels.quaternions import Array
from der.kernels.strands import nearest_strands
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State

Curve: TypeAlias = Callable[..., Array]  # point (3,) at a fraction of the ring, or its derivative

_SLOPE = 1e-4  # of s: the difference for the rate of the curve along the path
_FAR = 0.1  # of the ring: a crossing farther from where it was looked for is another one
_MOST = 20  # steps of Newton's method
_CLOSE = 1e-9  # of s
_MORE = 24  # vertices; the end of a quintic spline is felt by a factor of 0.43 at each


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
    Newton's method from the middle of the step, with the rate along the path there.
    """
    curve = partial(_curve, ring, step, finest, degree)
    start = at = np.append(where, 0.5 * step.length)
    here, beside = (curve(s) for s in (at[2], at[2] + _SLOPE))
    rate = (_apart(beside, at) - _apart(here, at)) / _SLOPE
    for _ in range(_MOST):
        columns = np.array([here(at[0], 1), -here(at[1], 1), rate])
        change = np.linalg.solve(columns.T, _apart(here, at))
        at = at - change
        elsewhere = np.abs(at - start)[:2].max() > _FAR
        if elsewhere or not 0.0 < at[2] < step.length:
            return None
        if abs(change[2]) < _CLOSE:
            return cast(Equilibrium, step.at(float(at[2])))
        here = curve(at[2])
    return None


def _curve(
    ring: GrippedRing, step: Step[State], finest: Step[State], degree: int, s: float
) -> Curve:
    """The smooth curve at ``s``: that of the finest mesh, and the distance of the vertices from it.

    A quarter of the edges are too few for a spline, but not for that distance, of order h^2.
    """
    x = ring.vertices(step.at(float(s)).state)
    if step is finest:
        return _through(x, degree)
    alike = finest.expected(s / step.length * finest.length)
    fine = _through(cast(GrippedRing, finest.system).vertices(alike), degree)
    away = _through(x - fine(_fractions(len(x))), degree)
    return lambda u, order=0: fine(u, order) + away(u, order)


def _fractions(n: int, more: int = 0) -> Array:
    """Places of ``n`` vertices as fractions of the ring: vertex 0 is half an edge behind a grip."""
    places: Array = (np.arange(-more, n + more) + 0.5) / n
    return places


def _through(x: Array, degree: int) -> BSpline:
    """The curve through vertices, which go on around the ring, where the spline has its ends."""
    n = len(x)
    return make_interp_spline(_fractions(n, _MORE), x[np.arange(-_MORE, n + _MORE) % n], k=degree)


def _apart(curve: Curve, at: Array) -> Array:
    """The vector (3,) between both strands."""
    apart: Array = curve(at[0]) - curve(at[1])
    return apart
