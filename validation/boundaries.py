"""How far the boundaries of one phase diagram lie from those of another.

A boundary is known to 1e-8, at worst 4e-6, but in points only, and these may shift along it. So
points are compared with the splines through the others. Those from cells twice as wide, other
points of the same curves, are at most 5e-6 off (figs. 3a, 5c, 8c).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
PLACE = ("b_over_a", "r_over_a", "vertex_angle", "natural_curvature", "h_over_t")
FINE = 32  # pieces of an interval: a chord is then 1/1024 as far off as that of the interval
Row = Mapping[str, str]
Lines = Mapping[str, list[Array]]  # points (n, 5) of curves, in units of the sides, by kind


def case_of(row: Row) -> str:
    """The parameters of a case as text."""
    return " ".join(row[name] for name in ("shape", "twist_axis", *PLACE, "nu"))


def place_of(row: Row) -> list[float]:
    """The place of a row in the diagram; 0 for parameters that its shape does not have."""
    return [float(row[name] or 0.0) for name in PLACE]


def lines_of(rows: Sequence[Row], sides: Array) -> Lines:
    """The curves of a table; corners are curves of one point."""
    found: dict[tuple[str, str], list[list[float]]] = defaultdict(list)
    for k, row in enumerate(rows):
        kind = " ".join([row["boundary"], row.get("other", ""), row["twist_axis"]])
        found[kind, row.get("curve", str(k))].append(place_of(row))
    lines: dict[str, list[Array]] = defaultdict(list)
    for (kind, _), points in found.items():
        lines[kind].append(np.array(points) / sides)
    return lines


def off_lines(ours: Lines, theirs: Lines) -> Iterator[tuple[str, float]]:
    """The points of curves, and how far they are from the smooth curves of their kind."""
    for kind, lines in ours.items():
        points = np.concatenate(lines)
        others = [spline(line) for line in theirs.get(kind, [])]
        owner = np.repeat(np.arange(len(others)), [len(line) for line in others])
        nearest = cKDTree(np.concatenate(others)).query(points)[1] if others else []
        sizes = [off(point, others[owner[k]]) for point, k in zip(points, nearest, strict=False)]
        for point, size in zip(points, sizes or [math.inf] * len(points), strict=True):
            yield f"{kind} at {point.round(6).tolist()} of the sides", size


def spline(line: Array) -> Array:
    """Polyline of `FINE` pieces an interval, close to the cubic spline through a curve's points."""
    step = np.linalg.norm(np.diff(line, axis=0), axis=1)
    line = line[np.append(True, step > 0.0)]
    along = np.append(0.0, np.cumsum(step[step > 0.0]))
    if len(line) < 3:
        return line
    places = np.interp(np.arange(FINE * (len(line) - 1) + 1) / FINE, np.arange(len(line)), along)
    points: Array = CubicSpline(along, line)(places)
    return points


def off(point: Array, line: Array) -> float:
    """Least distance of a point from a polyline."""
    step = np.diff(line, axis=0, append=line[-1:])
    along = ((point - line) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-300)
    nearest = line + np.clip(along, 0.0, 1.0)[:, None] * step
    return float(np.linalg.norm(nearest - point, axis=1).min())
