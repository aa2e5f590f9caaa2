"""The ring as a ribbon: a mesh in space for viewers, or quadrilaterals in a picture plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from der.utils.checks import Array
from der.viz.animation import Section

CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])  # along d1, d2
# every eighth of matplotlib's viridis: even steps for all colour vision
VIRIDIS = np.frombuffer(
    bytes.fromhex("440154 472c7a 3b518b 2c718e 21908d 27ad81 5cc863 aadc32 fde725"), np.uint8
).reshape(-1, 3)


def ribbon(x: Array, frames: Array, section: Section) -> tuple[Array, Array]:
    """Vertices and normals (n, 8 N, 3): each corner of a section once for either of its faces."""
    d1, d3 = (frames[..., k, :] + np.roll(frames[..., k, :], -1, axis=-2) for k in (0, 2))
    d2 = unit(np.cross(d3, d1))
    d1 = unit(np.cross(d2, d3))
    along = np.stack([d1, d2], axis=-2)
    corners = x[..., None, :] + (0.5 * CORNERS * (section.h, section.t)) @ along
    positions = np.repeat(corners, 2, axis=-2)
    # in this order, equal numbers are neighbours: the file compresses better
    normals = (np.array([(s, 0.0) if k else (0.0, c) for s, c in CORNERS for k in (0, 1)])) @ along
    shape = (len(x), -1, 3)
    return positions.reshape(shape), normals.reshape(shape)


def triangles(n_v: int) -> NDArray[np.uint32]:
    """Triangles (8 N, 3) of a closed ribbon, whose outer sides are on the left."""
    sides = ((0, 2), (3, 5), (4, 6), (7, 1))  # pairs of the 8 vertices of a section
    here = 8 * np.arange(n_v)[:, None]
    there = np.roll(here, -1, axis=0)
    pieces = [
        np.concatenate(triangle, axis=1)
        for a, b in sides
        for triangle in ((here + a, here + b, there + b), (here + a, there + b, there + a))
    ]
    return np.concatenate(pieces).astype(np.uint32)


def viridis(share: Array) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of shares 0 to 1 of the largest density."""
    at = np.clip(share, 0.0, 1.0) * (len(VIRIDIS) - 1)
    nodes = np.arange(len(VIRIDIS))
    red, green, blue = (np.interp(at, nodes, v).round().astype(np.uint32) for v in VIRIDIS.T)
    return np.asarray((red << 24) | (green << 16) | (blue << 8) | np.uint32(255), dtype=np.uint32)


def unit(vectors: Array) -> Array:
    """Vectors (..., 3) scaled to unit length."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


# --- In a picture plane ----------------------------------------------------------------------

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
    """The camera whose pictures have the twisting axis upright."""
    towards = unit(towards)
    right = unit(np.cross([0.0, 0.0, 1.0], towards))
    return Camera(towards, right, np.cross(towards, right))


CAMERA = looking_from(np.array([0.80, 0.45, 0.40]))  # the flat ring lies across the first axis


def quadrilaterals(
    x: Array,
    d1: Array,
    width: float,
    camera: Camera = CAMERA,
    *,
    grips: bool = True,
    light: Array = LIGHT,
) -> tuple[Array, Array]:
    """The ribbon as projected quadrilaterals (m, 4, 2), far ones first, and their colours (m, 3).

    Parameters
    ----------
    x : (N, 3) vertices, a; vertex j joins edges j and j + 1.
    d1 : (N, 3) first directors of the edges, along the height of the section.
    width : half of the ribbon's, a.
    camera : from where it is seen.
    grips : whether the grips are marked, in the middles of the edges 0 and N/2.
    light : (3,) towards the light.
    """
    from scipy.interpolate import CubicSpline

    n = len(x)
    nodes = np.concatenate([x, d1 + np.roll(d1, -1, axis=0)], axis=1)
    curve = CubicSpline(np.arange(n + 1), np.append(nodes, nodes[:1], axis=0), bc_type="periodic")
    points = curve(np.arange(ACROSS + 1) * n / ACROSS - 0.5)
    centre, across = points[:, :3], points[:, 3:]
    across = width * unit(across)
    lines = centre + np.multiply.outer([-1.0, -0.84, 0.84, 1.0], across)  # (4, ACROSS + 1, 3)
    corners = np.stack([lines[:-1, :-1], lines[:-1, 1:], lines[1:, 1:], lines[1:, :-1]], axis=2)

    normal = unit(np.cross(np.diff(centre, axis=0), across[1:] + across[:-1]))
    shade = 0.62 + 0.38 * np.abs(normal @ unit(light))
    colour = np.where((normal @ camera.towards > 0)[:, None], FRONT, BACK)
    if grips:
        from_grip = np.abs((np.arange(ACROSS) + 0.5 + ACROSS / 4) % (ACROSS / 2) - ACROSS / 4)
        colour = np.where((from_grip < ACROSS / 80)[:, None], GRIP, colour)
    colour = colour * shade[:, None]
    colours = np.stack([0.55 * colour, colour, 0.55 * colour])  # darker along the two rims

    corners, colours = corners.reshape(-1, 4, 3), colours.reshape(-1, 3)
    order = np.argsort(corners.mean(axis=1) @ camera.towards)
    return projected(corners, camera)[order], colours[order]


def projected(points: Array, camera: Camera = CAMERA) -> Array:
    """Points (..., 3) in the picture plane: (..., 2), right and up."""
    return points @ np.stack([camera.right, camera.up], axis=1)
