"""The ring as a picture in the plane: its ribbon, seen from one side, far pieces first."""

from __future__ import annotations

import math

import numpy as np

from der.checks import Array

ACROSS = 240  # quadrilaterals along a ribbon
HALF_WIDTH = 0.085  # of a ribbon, over the flat ring's mean radius: exaggerated, to be seen
FRONT, BACK, GRIP = (0.40, 0.67, 0.88), (0.96, 0.76, 0.46), (0.16, 0.16, 0.16)
CAMERA = np.array([0.80, 0.45, 0.40])  # the ring lies in the plane of the last two axes
LIGHT = np.array([0.75, -0.30, 0.60])


def seen(x: Array, d1: Array, width: float) -> tuple[Array, Array]:
    """Projected quadrilaterals (m, 4, 2), far ones first, and their colours (m, 3).

    Vertex j joins edges j and j + 1; the grips sit on the middles of the edges 0 and N/2.

    Parameters
    ----------
    x : (N, 3) vertices, a.
    d1 : (N, 3) first directors of the edges, along the height of the section.
    width : half of the ribbon's, a.
    """
    from scipy.interpolate import CubicSpline

    n = len(x)
    nodes = np.concatenate([x, d1 + np.roll(d1, -1, axis=0)], axis=1)
    curve = CubicSpline(np.arange(n + 1), np.append(nodes, nodes[:1], axis=0), bc_type="periodic")
    points = curve(np.arange(ACROSS + 1) * n / ACROSS - 0.5)
    centre, across = points[:, :3], points[:, 3:]
    across = width * across / np.linalg.norm(across, axis=1, keepdims=True)
    lines = centre + np.multiply.outer([-1.0, -0.84, 0.84, 1.0], across)  # (4, ACROSS + 1, 3)
    corners = np.stack([lines[:-1, :-1], lines[:-1, 1:], lines[1:, 1:], lines[1:, :-1]], axis=2)

    towards, _, _ = _camera()
    normal = np.cross(np.diff(centre, axis=0), across[1:] + across[:-1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shade = 0.62 + 0.38 * np.abs(normal @ (LIGHT / np.linalg.norm(LIGHT)))
    colour = np.where((normal @ towards > 0)[:, None], FRONT, BACK)
    from_grip = np.abs((np.arange(ACROSS) + 0.5 + ACROSS / 4) % (ACROSS / 2) - ACROSS / 4)
    colour = np.where((from_grip < ACROSS / 80)[:, None], GRIP, colour) * shade[:, None]
    colours = np.stack([0.55 * colour, colour, 0.55 * colour])  # darker along the two rims

    corners, colours = corners.reshape(-1, 4, 3), colours.reshape(-1, 3)
    order = np.argsort(corners.mean(axis=1) @ towards)
    return flat(corners)[order], colours[order]


def flat(points: Array) -> Array:
    """Points (..., 2) of the picture, right and up, where points (..., 3) are seen."""
    _, right, up = _camera()
    return points @ np.stack([right, up], axis=1)


def _camera() -> tuple[Array, Array, Array]:
    """Return the directions to the camera, to its right and up; the twisting axis is upright."""
    towards = CAMERA / math.sqrt(CAMERA @ CAMERA)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return towards, right, np.cross(towards, right)
