"""Rings in still pictures: as lines seen from the side, and as ribbons placed in a row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from der.utils.checks import Array
from der.viz.ribbon import Camera, projected, unit

TILT = math.radians(42.0)  # of the view off the normal of the plane closest to a shape
LARGER = 2.0  # small shapes are drawn, at most, over the scale of the largest


def closed_curve(x: Array, points: int = 200) -> Array:
    """A smooth closed curve (points + 1, ...) through vertices."""
    from scipy.interpolate import CubicSpline

    n = len(x)
    curve = CubicSpline(np.arange(n + 1), np.append(x, x[:1], axis=0), bc_type="periodic")
    return np.asarray(curve(np.linspace(0.0, n, points + 1)))


def oblique(x: Array, level: Array | None = None) -> Camera:
    """The camera whose view of a shape is inclined to the normal of the plane closest to it.

    The longest axis is level, or the direction ``level`` (3,) if that is given. The camera sees the
    side of +E1, or else of +E3.
    """
    right, up, normal = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2]
    if level is not None:
        right = unit(level - (level @ normal) * normal)
    elif np.ptp(x @ right) < 1.02 * np.ptp(x @ up):  # a circle: no axis is the longest
        right = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
        size = float(np.linalg.norm(right))
        right = right / size if size > 0.1 else up
    normal = normal * (1.0 if normal @ (1.0, 0.3, 0.1) >= 0.0 else -1.0)
    up = np.cross(normal, right)
    towards = math.cos(TILT) * normal - math.sin(TILT) * up
    return Camera(towards, right, np.cross(towards, right))


def strands_apart(x: Array, share: float) -> Array:
    """Vertices of a ring with coincident strands, moved apart by a share of its size."""
    middle = x.mean(axis=0)
    turn = 2.0 * math.pi * np.arange(len(x))[:, None] / len(x)
    return middle + (x - middle) * (1.0 + share * np.cos(turn))


class View(NamedTuple):
    """A ring as a line, seen from the side."""

    line: Array  # (n, 2) in the picture
    depth: Array  # (n,) towards the reader
    camera: Camera

    @property
    def middle(self) -> Array:
        """Middle (2,) of its box."""
        return box_middle(self.line)

    def draw(self, axes: Axes, scale: float, at: Array, colour: str) -> None:
        """Draw it with the middle of its box at a place, near parts over far parts."""
        line = scale * (self.line - self.middle) + at
        for k in np.argsort(self.depth[:-1]):
            near = slice(max(int(k) - 1, 0), int(k) + 3)
            axes.plot(*line[k : k + 2].T, color="white", linewidth=3.4, solid_capstyle="butt")
            axes.plot(*line[near].T, color=colour, linewidth=1.5, solid_capstyle="round")


def seen(x: Array, level: Array | None = None) -> View:
    """A ring with vertices x (N, 3) as a line, seen from the side; ``level`` as in `oblique`."""
    curve, camera = closed_curve(x), oblique(x, level)
    return View(projected(curve, camera), curve @ camera.towards, camera)


def box_middle(points: Array) -> Array:
    """Middle (2,) of the box around points (..., 2)."""
    flat = points.reshape(-1, 2)
    return (flat.min(axis=0) + flat.max(axis=0)) / 2.0


def place_ribbon(
    axes: Axes, ribbon: tuple[Array, Array], at: tuple[float, float], scale: float = 1.0
) -> None:
    """Draw a ribbon (`ribbon.quadrilaterals`) with the middle of its box at a place."""
    corners, colours = ribbon
    placed = scale * (corners - box_middle(corners)) + np.array(at)
    place_quadrilaterals(axes, placed, colours)


def place_quadrilaterals(axes: Axes, corners: Array, colours: Array, **look: Any) -> None:
    """Draw quadrilaterals (m, 4, 2) in their colours (m, 3), without gaps between them."""
    look |= {"facecolors": colours, "edgecolors": colours, "linewidths": 0.25}
    axes.add_collection(PolyCollection(list(corners), **look))


def bare(axes: Axes, low: Sequence[float] | Array, high: Sequence[float] | Array) -> None:
    """Axes without lines and ticks, with equal scales, which show the box from low to high."""
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()


def draw_closed(axes: Axes, x: Array, colour: str, half: float) -> None:
    """Draw a closed curve (n, 2) in the middle of axes that reach ``half`` to its sides."""
    axes.plot(*x.T, color=colour, linewidth=1.6, solid_joinstyle="round")
    middle = box_middle(x)
    bare(axes, middle - half, middle + half)
