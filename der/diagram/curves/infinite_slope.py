r"""The folded state of a half ring, and the boundary at which its slope is infinite.

The folded ring is planar: of p = (m1, m2, m3, F1, F2) only m1 and F2 are not zero, and its shape
does not depend on the section. At gamma = pi the conditions G at the far end fall into those of the
plane, 0 and 4, which m1 and F2 satisfy, and those out of it, 1, 2 and 3. The slope dM/dgamma is
infinite where m2, m3 and F1 can change at gamma = pi:

    G_0 = G_4 = 0,     det d(G_1, G_2, G_3)/d(m2, m3, F1) = 0.

These are three equations for m1, F2 and two parameters of the ring and its section: a curve, smooth
also where two folded states merge and cease to exist. As a function of the parameters alone the
folded state has a square root there; so a place beside the curve is moved onto it along a direction
that crosses the curve, and the value is the distance moved.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from der.bvp.collocation import Direction, required
from der.bvp.gauss import Array
from der.diagram.curves.branch_exchange import Shot, shot
from der.diagram.curves.conditions import NotFound, Value, scaled
from der.diagram.curves.tracing import by_differences
from der.errors import ContinuationFailed
from der.scene import Scene

IN_PLANE, OUT_OF_PLANE = [0, 4], [1, 2, 3]  # of p = (m1, m2, m3, F1, F2), and of G
DIFFERENCE = 1e-6  # of m1, F2 and the parameters
CLOSE = 1e-3  # last change from which derivatives of before do
CONVERGED = 1e-11
ROUNDED = 1e-10  # where states merge, rounding leaves changes of 3e-11: it does not lessen them
LOOSE = 1e-6  # of a state that is exact already: where two merge its tangent is all but free
FARTHEST = 0.1  # of the square's side: a place farther away is another one
MOST = 15
WAYS = np.array([[0.0, 1.0], [1.0, 0.0]])  # to begin with

SceneAt = Callable[[Array], Scene]


def is_half(seed: Value) -> bool:
    """Whether a solution is one of a half ring; on a quarter the folded state is unique."""
    return not seed.system.sector.piece.quarter


def infinite_slope_near(scene_at: SceneAt, u: Array, seed: Value) -> Value:
    """Distance of a place from the boundary along the seed's direction; the seed is folded.

    Parameters
    ----------
    scene_at : the scene at a place of the diagram
    u : (2,) the place
    seed : without a direction, those of the two parameters are tried

    Raises
    ------
    ContinuationFailed
        Where there is none nearby.
    """
    if seed.way is not None:
        return _moved_onto(scene_at, u, seed, seed.way)
    try:
        return _moved_onto(scene_at, u, seed, WAYS[0])
    except ContinuationFailed:
        return _moved_onto(scene_at, u, seed, WAYS[1])


def across(scene_at: SceneAt, seed: Value) -> Value:
    """The same state with the direction that crosses the boundary at a right angle."""
    if seed.place is None or seed.way is None:
        return seed
    z = np.concatenate([seed.at.p[IN_PLANE], seed.place])

    def left(z: Array) -> Array:
        return _left(scene_at, z[2:], seed, z[:2])[0]

    rates = _rates(left, z, left(z))
    along = np.linalg.svd(rates)[2][-1, 2:]
    way = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    return seed._replace(way=way if way @ seed.way > 0.0 else -way)


def _moved_onto(scene_at: SceneAt, u: Array, seed: Value, way: Array) -> Value:
    """Newton's method for m1, F2 and the distance along the direction."""

    def left(z: Array) -> Array:
        return _left(scene_at, u + z[2] * way, seed, z[:2])[0]

    z = np.append(seed.at.p[IN_PLANE], 0.0)
    rates, size = None, math.inf
    for _ in range(MOST):
        now = left(z)
        if rates is None or size > CLOSE:
            rates = _rates(left, z, now)
        try:
            change = np.linalg.solve(rates, -now)
        except np.linalg.LinAlgError:
            break
        before, size = size, float(np.abs(change / (1.0 + np.abs(z))).max())
        z = z + change
        if not abs(z[2]) < FARTHEST:
            break
        if size < CONVERGED or 0.5 * before < size < ROUNDED:
            return _value(scene_at, u, seed, way, z)
    raise NotFound("no folded state of infinite slope nearby")


def _value(scene_at: SceneAt, u: Array, seed: Value, way: Array, z: Array) -> Value:
    """The boundary's state, as a solution with its tangent."""
    place = u + z[2] * way
    _, folded = _left(scene_at, place, seed, z[:2])
    system, mesh = scaled(scene_at(place), seed)
    p = np.zeros_like(seed.at.p)
    p[IN_PLANE] = z[:2]
    found = system.solved(
        mesh, Direction(folded.frames, p, math.pi), seed.at.tangent, tolerance=LOOSE
    )
    at = required(found, "no folded state of infinite slope nearby")
    return Value(-float(z[2]), at, system, way=way, place=place)


def _left(scene_at: SceneAt, place: Array, seed: Value, planar: Array) -> tuple[Array, Shot]:
    """Residual of the three equations, and the rod shot."""
    system, mesh = scaled(scene_at(place), seed)
    x = np.append(np.zeros_like(seed.at.p), math.pi)
    x[IN_PLANE] = planar
    found = shot(system, mesh, seed.at.frames, x)
    if not found.ok:
        raise NotFound("the folded ring cannot be shot")
    block = found.rates[np.ix_(OUT_OF_PLANE, OUT_OF_PLANE)]
    return np.append(found.missed[IN_PLANE], np.linalg.det(block)), found


def _rates(left: Callable[[Array], Array], z: Array, now: Array) -> Array:
    """Derivatives, by differences."""
    return by_differences(left, z, now, DIFFERENCE * (1.0 + np.abs(z)))
