"""The ring as a ribbon on paper: quadrilaterals, the far ones first, with their colours."""

from __future__ import annotations

import numpy as np

from der.checks import Array

ACROSS = 240  # quadrilaterals along a ribbon
FRONT, BACK, GRIP = (0.40, 0.67, 0.88), (0.96, 0.76, 0.46), (0.16, 0.16, 0.16)
LIGHT = np.array([0.75, -0.30, 0.60])


def projected(
    x: Array,
    d1: Array,
    width: float,
    camera: tuple[Array, Array, Array],
    *,
    grips: bool,
    light: Array = LIGHT,
) -> tuple[Array, Array]:
    """Quadrilaterals (m, 4, 2) of a ribbon, far ones first, and their colours (m, 3).

    Parameters
    ----------
    x : (N, 3) vertices; vertex j joins edges j and j + 1.
    d1 : (N, 3) of the edges: the ribbon lies across.
    width : half of the ribbon's.
    camera : directions to it, to its right and up.
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

    towards, right, up = camera
    normal = np.cross(np.diff(centre, axis=0), across[1:] + across[:-1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    shade = 0.62 + 0.38 * np.abs(normal @ (light / np.linalg.norm(light)))
    colour = np.where((normal @ towards > 0)[:, None], FRONT, BACK)
    if grips:
        from_grip = np.abs((np.arange(ACROSS) + 0.5 + ACROSS / 4) % (ACROSS / 2) - ACROSS / 4)
        colour = np.where((from_grip < ACROSS / 80)[:, None], GRIP, colour)
    colour = colour * shade[:, None]
    colours = np.stack([0.55 * colour, colour, 0.55 * colour])  # darker along the two rims

    corners, colours = corners.reshape(-1, 4, 3), colours.reshape(-1, 3)
    order = np.argsort(corners.mean(axis=1) @ towards)
    return (corners @ np.stack([right, up], axis=1))[order], colours[order]
