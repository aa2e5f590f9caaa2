"""The ring as a picture in the plane: its ribbon, seen from one side, far pieces first."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from der.utils.checks import Array

ACROSS = 240  # quadrilaterals along a ribbon
HALF_WIDTH = 0.085  # of a ribbon, over the flat ring's mean radius: exaggerated, to be seen
FRONT, BACK, GRIP = (0.40, 0.67, 0.88), (0.96, 0.76, 0.46), (0.16, 0.16, 0.16)
LIGHT = np.array([0.75, -0.30, 0.60])


class Camera(NamedTuple):
    """Directions in which a picture is seen."""

    towards: Array  # (3,) to the camera
    right: Array
    up: Array


def looking_from(towards: Array) -> Camera:
    """The camera that has the twisting axis upright."""
    towards = towards / math.sqrt(towards @ towards)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return Camera(towards, right, np.cross(towards, right))


CAMERA = looking_from(np.array([0.80, 0.45, 0.40]))  # the flat ring lies across the first axis


def seen(
    x: Array,
    d1: Array,
    width: float,
    camera: Camera = CAMERA,
    *,
    grips: bool = True,
    light: Array = LIGHT,
) -> tuple[Array, Array]:
    """Projected quadrilaterals (m, 4, 2), far ones first, and their colours (m, 3).

    Parameters
    ----------
    x : (N, 3) vertices, a; vertex j joins edges j and j + 1.
    d1 : (N, 3) first directors of the edges, along the height of the section.
    width : half of the ribbon's, a.
    camera : from where it is seen.
    grips : whether those on the middles of the edges 0 and N/2 are marked.
    light : where it comes from.
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

    normal = np.cross(np.diff(centre, axis=0), across[1:] + across[:-1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shade = 0.62 + 0.38 * np.abs(normal @ (light / np.linalg.norm(light)))
    colour = np.where((normal @ camera.towards > 0)[:, None], FRONT, BACK)
    if grips:
        from_grip = np.abs((np.arange(ACROSS) + 0.5 + ACROSS / 4) % (ACROSS / 2) - ACROSS / 4)
        colour = np.where((from_grip < ACROSS / 80)[:, None], GRIP, colour)
    colour = colour * shade[:, None]
    colours = np.stack([0.55 * colour, colour, 0.55 * colour])  # darker along the two rims

    corners, colours = corners.reshape(-1, 4, 3), colours.reshape(-1, 3)
    order = np.argsort(corners.mean(axis=1) @ camera.towards)
    return flat(corners, camera)[order], colours[order]


def flat(points: Array, camera: Camera = CAMERA) -> Array:
    """Points (..., 2) of the picture, right and up, where points (..., 3) are seen."""
    return points @ np.stack([camera.right, camera.up], axis=1)
