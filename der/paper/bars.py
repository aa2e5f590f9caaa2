"""Rings as shaded bars: the quadrilaterals of a bar's surface, in parallel projection.

The bar has the section's h/t but is drawn thicker, so that its rotation can be seen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from der.utils.checks import Array
from der.viz.ribbon import Camera, unit

HEIGHT = 0.0125  # of the bar with h/t = 4 over the ring's length; all bars have the same h * t
GRIPPED = 0.008  # part of the length that is dark at a grip, to either side
OUTSIDE, INSIDE = (0.36, 0.64, 0.87), (0.97, 0.74, 0.42)  # faces across d2
EDGE, GRIP = (0.80, 0.80, 0.83), (0.15, 0.15, 0.15)  # faces across d1
LIGHT = (0.35, 0.45, 0.82)  # on the screen: right, up, towards the eye


class Picture(NamedTuple):
    """What is drawn: quadrilaterals (m, 4, 2), far ones first, and their colours (m, 3)."""

    corners: Array
    colours: Array
    axis: Array  # (2, 2) the twisting axis, from beyond one grip to beyond the other

    @property
    def box(self) -> Array:
        """Lower left and upper right corner, (2, 2), of ring and axis."""
        flat = np.concatenate([self.corners.reshape(-1, 2), self.axis])
        return np.array([flat.min(axis=0), flat.max(axis=0)])


def camera(axis: str, azimuth: float = 0.0, elevation: float = 0.0) -> Camera:
    """A camera that looks at the flat ring's face, rotated about the ring.

    Parameters
    ----------
    axis : direction of the twisting axis E3 on the screen: "upright" or "level".
    azimuth, elevation : rotation to the right and up, degrees.
    """
    right, up = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if axis == "level":
        right, up = (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)
    basis = np.array([right, up, (1.0, 0.0, 0.0)])
    about_up = Rotation.from_euler("y", -azimuth, degrees=True).as_matrix()
    about_right = Rotation.from_euler("x", elevation, degrees=True).as_matrix()
    turn = about_up @ about_right if axis == "level" else about_right @ about_up
    right, up, towards = turn @ basis
    return Camera(towards, right, up)


def bar(
    x: Array,
    d1: Array,
    h_over_t: float,
    view: Camera,
    colour: tuple[float, float, float] | None = None,
    thick: float = 1.0,
) -> Picture:
    """The picture of a closed bar.

    Parameters
    ----------
    x : (N, 3) vertices; the grips are half an edge before the vertices 0 and N/2
    d1 : (N, 3) unit vectors there, along the section's height
    colour : of all faces, RGB; None: outside, inside and edges differ, and the grips are dark
    thick : factor on height and thickness
    """
    n = len(x)
    edges = np.linalg.norm(np.roll(x, -1, axis=0) - x, axis=1)  # each to the next vertex
    length = float(edges.sum())
    corners, normal = _faces(x, d1, thick * HEIGHT * length * math.sqrt(h_over_t / 4), h_over_t)
    if colour is None:
        # faces in turn: +d1, -d2, -d1, +d2
        base = np.repeat(np.array([EDGE, INSIDE, EDGE, OUTSIDE])[:, None], n, axis=1)
        s = np.cumsum(edges) - (edges - edges[-1]) / 2  # middles of edges from the first grip on
        from_grip = np.abs((s + length / 4) % (length / 2) - length / 4)
        base[:, from_grip < GRIPPED * length] = GRIP
    else:
        base = np.broadcast_to(np.array(colour), (4, n, 3))
    on_screen = np.array([view.right, view.up]).T
    light = unit(np.array(LIGHT)) @ np.array([view.right, view.up, view.towards])
    lit = np.clip(normal @ light, 0.0, 1.0)
    shaded = base * (0.60 + 0.40 * lit)[..., None]

    seen = normal @ view.towards > 0.0
    corners, shaded = corners[seen], shaded[seen]
    order = np.argsort(corners.mean(axis=1) @ view.towards)
    grips = np.array([x[-1] + x[0], x[n // 2 - 1] + x[n // 2]]) / 2
    along = np.array([0.0, 0.0, 0.033 * length])
    return Picture(
        (corners @ on_screen)[order],
        shaded[order],
        np.array([grips[0] - along, grips[1] + along]) @ on_screen,
    )


def _faces(x: Array, d1: Array, height: float, h_over_t: float) -> tuple[Array, Array]:
    """Corners (4, N, 4, 3) of a bar's faces, four around every edge, and their normals."""
    tangent = np.roll(x, -1, axis=0) - np.roll(x, 1, axis=0)
    d2 = unit(np.cross(tangent, d1))
    up, out = height / 2 * d1, height / h_over_t / 2 * d2
    lines = np.array([x + up + out, x + up - out, x - up - out, x - up + out])  # (4, N, 3)
    after = np.roll(lines, -1, axis=1)
    beside = np.roll(lines, -1, axis=0)
    corners = np.stack([lines, after, np.roll(after, -1, axis=0), beside], axis=2)
    across = corners[:, :, 2:] - corners[:, :, :2]  # both diagonals
    normal = unit(np.cross(across[:, :, 0], across[:, :, 1]))
    outward = corners.mean(axis=2) - (x + np.roll(x, -1, axis=0)) / 2
    normal *= np.sign(np.einsum("fnk,fnk->fn", normal, outward))[..., None]
    return corners, normal
