"""The areal packing ratio: how much room the folded ring takes of that of the flat one.

The envelope of the folded ring is the area inside its outer boundary, holes filled: the sum of all
the faces into which the centreline divides what it encloses (paper, section 3 and Appendix B).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from der.bvp.planar.folded_shape import Folded, folded
from der.geometry.ring import Ring

Array = NDArray[np.float64]

POINTS = 3600  # on the ring; a multiple of 12, so that the strands of a circle have equal vertices
LARGEST_TURN = 2.0  # rad, of an edge in place of an arc; sharper corners are cut short
GRID = 1e-13  # of the extent: coordinates are rounded to it, so that such strands are one


def packing_ratio(ring: Ring, n: int = POINTS) -> float:
    """Return the area inside the folded ring's outer boundary over the area of the flat ring.

    Parameters
    ----------
    ring : der.Ring
        Any; the ratio does not depend on the cross-section.
    n : int
        Number of points on the ring, even, at least 12.

    Returns
    -------
    float
        1/9 for the circle, exactly to rounding where `n` is a multiple of 12; else with an error
        that falls like 1/n^3, about 1e-8 at the default (less for smoother rings).

    Raises
    ------
    ValueError
        If `ring` is no ring or `n` no such number.
    NotFolded
        If the folded shape is not found.
    """
    return envelope_area(folded(ring, n)) / natural_area(ring)


def envelope_area(shape: Folded) -> float:
    """Return the area inside the outer boundary of a folded ring, holes filled, units of a^2.

    Notes
    -----
    Every edge of the polygon in place of the centreline has, on average, the curve's area under
    it (`equal_area_vertices`). What is left is of third order in the edge: the parts of edges
    beside a crossing, and jumps of the curvature.
    """
    from shapely import area, linestrings, polygonize, union_all  # type: ignore[import-untyped]

    vertices = equal_area_vertices(shape)
    extent = float(np.max(np.ptp(vertices, axis=0)))
    line = linestrings(np.append(vertices, vertices[:1], axis=0))
    noded = union_all([line], grid_size=GRID * extent)
    return float(area(polygonize([*getattr(noded, "geoms", [noded])])))


def equal_area_vertices(shape: Folded) -> Array:
    """Return the points moved off the curve, to its outside, so that no area is lost to chords.

    A circular arc of radius R in edges that turn by theta has the area of the polygon through
    points at R sqrt(theta / sin theta) from its centre; theta/12 times the edge is the first term.
    """
    length = shape.s[1]  # of every edge
    turn = np.diff(shape.angle, append=shape.angle[0] + shape.turning)
    theta = np.clip((turn + np.roll(turn, 1)) / 2, -LARGEST_TURN, LARGEST_TURN)
    growth = np.expm1(-np.log(np.sinc(theta / np.pi)) / 2)
    curved = theta != 0
    shift = length * np.divide(growth, theta, out=np.zeros_like(theta), where=curved)
    outward = np.column_stack([np.sin(shape.angle), -np.cos(shape.angle)])
    moved: Array = shape.points + shift[:, None] * outward
    return moved


def natural_area(ring: Ring) -> float:
    """Return the area of the flat ring, units of a^2: closed forms, else Green's theorem."""
    size = ring.parameters
    if ring.shape == "circle":
        return math.pi
    if ring.shape == "ellipse":
        return math.pi * float(size["b_over_a"])
    if ring.shape == "rectangle":
        return 4 * float(size["b_over_a"]) - (4 - math.pi) * float(size["r_over_a"]) ** 2
    if ring.shape == "triangle":
        return _triangle_area(math.radians(size["vertex_angle"]), size["r_over_a"])
    return _enclosed_area(ring)


def _triangle_area(apex: float, r: float) -> float:
    """Return the sharp triangle's area less its three corners: r^2 (cot(angle/2) - ...) each.

    A corner of angle A loses the kite r^2 cot(A/2) but for the fillet's sector r^2 (pi - A)/2.
    """
    base = (math.pi - apex) / 2
    kites = 1 / math.tan(apex / 2) + 2 / math.tan(base / 2)
    return 1 / (4 * math.tan(apex / 2)) - r**2 * (kites - math.pi)


def _enclosed_area(ring: Ring) -> float:
    """Return half the integral of r x r' over the ring, by Gauss sums between its knots."""
    arc_length = np.unique(ring.parameters["arc_length"])
    node, weight = np.polynomial.legendre.leggauss(24)
    step = np.diff(arc_length)
    s = arc_length[:-1, None] + np.multiply.outer(step, (1 + node) / 2)
    place, angle = ring.position(s), ring.angle(s)
    cross = place[..., 1] * np.sin(angle) - place[..., 2] * np.cos(angle)
    return float(step @ (cross @ weight)) / 4
