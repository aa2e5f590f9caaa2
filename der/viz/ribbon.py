"""The ring as a ribbon: a mesh of boxes about the centreline, and the colours of its energies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from der.utils.checks import Array
from der.viz.animation import Drawn

CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])  # along d1, d2
VIRIDIS = np.array(  # every eighth of matplotlib's viridis: even steps for all colour vision
    [
        (68, 1, 84),
        (71, 44, 122),
        (59, 81, 139),
        (44, 113, 142),
        (33, 144, 141),
        (39, 173, 129),
        (92, 200, 99),
        (170, 220, 50),
        (253, 231, 37),
    ]
)


def ribbon(x: Array, frames: Array, section: Drawn) -> tuple[Array, Array]:
    """Vertices and normals (n, 8 N, 3): each corner of a section once for either of its faces."""
    d1, d3 = (frames[..., k, :] + np.roll(frames[..., k, :], -1, axis=-2) for k in (0, 2))
    d2 = _unit(np.cross(d3, d1))
    d1 = _unit(np.cross(d2, d3))
    along = np.stack([d1, d2], axis=-2)
    corners = x[..., None, :] + (0.5 * CORNERS * (section.h, section.t)) @ along
    positions = np.repeat(corners, 2, axis=-2)
    # neighbours in memory alike: the file is compressed
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
    return (red << 24) | (green << 16) | (blue << 8) | np.uint32(255)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
