"""Area of a planar shape inside its outer boundary, holes filled.

Between the frames of the mesh the curve is interpolated: its tangent angle less the natural one is
smooth, even where the natural curvature jumps, and is taken as a spline. A polygon of points along
the curve, with one at every jump, has an error of area of order h^2, which extrapolation removes.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from der.kernels.planar import Array
from der.rod.planar_ring import PlanarRing

_POINTS = 1500  # of the finest polygon, at least
_STRANDS = 3  # its points are a multiple of this for each cell: the folded circle's then coincide
_GRID = 1e-11  # of the extent: coordinates are rounded to it, so that such strands coincide
_NODE, _WEIGHT = np.polynomial.legendre.leggauss(4)


def packing_ratio(mesh: PlanarRing, phi: Array, turning: int) -> tuple[float, float]:
    """Area inside the outer boundary of a shape over that of the flat ring, and its error.

    The error is that of the polygons, without that of the mesh.
    """
    flat, _ = _without_chords(enclosed_area, mesh.ring.position(_along(mesh)[1:])[:, 1:])
    area, error = _without_chords(envelope_area, curve(mesh, phi, turning))
    return area / flat, error / flat


def curve(mesh: PlanarRing, phi: Array, turning: int) -> Array:
    """Points (n, 2) along the curve whose tangents at the frames are ``phi`` (N,)."""
    length = mesh.ring.length
    uniform = (2.0 * np.pi * turning - float(mesh.rest.sum())) / length
    change = phi - mesh.natural - uniform * mesh.places[:-1]
    spline = CubicSpline(mesh.places, np.append(change, change[0]), bc_type="periodic")
    s = _along(mesh)
    step = np.diff(s)[:, None]
    node = s[:-1, None] + 0.5 * step * (1.0 + _NODE)
    natural = mesh.ring.natural_angle(node) - mesh.ring.natural_angle(0.0)
    angle = natural + uniform * node + spline(node)
    tangents = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.cumsum(0.5 * step * (tangents @ _WEIGHT), axis=0)
    return np.asarray(points - s[1:, None] / length * points[-1])  # closes the gap of the mesh


def _along(mesh: PlanarRing) -> Array:
    """Arc lengths (n + 1,) of points, equally many and equally spaced in every cell."""
    times = _STRANDS * math.ceil(_POINTS / (_STRANDS * mesh.n_edges))
    places = np.arange(times * mesh.n_edges + 1) / times
    return np.interp(places, np.arange(mesh.n_edges + 1), mesh.places)


def enclosed_area(points: Array) -> float:
    """Area of a polygon that does not cross itself."""
    x, y = points.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def envelope_area(points: Array) -> float:
    """Area inside the outer boundary of a closed polygon (n, 2), holes filled."""
    from shapely import area, linestrings, polygonize, union_all  # type: ignore[import-untyped]

    extent = float(np.ptp(points, axis=0).max())
    line = linestrings(np.append(points, points[:1], axis=0))
    noded = union_all([line], grid_size=_GRID * extent)
    return float(area(polygonize([*getattr(noded, "geoms", [noded])])).sum())


def _without_chords(area: Callable[[Array], float], points: Array) -> tuple[float, float]:
    """Area of the curve from those of three polygons, and its error."""
    fine, middle, coarse = (area(points[k - 1 :: k]) for k in (1, 2, 4))
    value = (4.0 * fine - middle) / 3.0
    return value, abs(value - (4.0 * middle - coarse) / 3.0)
