"""Accuracy per unknown: the errors of plain, once and twice extrapolated states, and their orders.

The states are those of the error bars: matched on N, N/2 and N/4 edges in the planes normal to the
path of N. If gamma, M and U have even error series there, the distance of plain states from the
true curve falls like h^2, Richardson's like h^4, Romberg's like h^6.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from der.analysis.curve_distance import curve_error
from der.analysis.extrapolation.curve import ENERGY, GAMMA, MOMENT, RATE, Family
from der.analysis.request import Request, ring_of
from der.continuation.richardson import romberg
from der.kernels.quaternions import Array
from der.problem import Point
from der.rod.equilibrium import Equilibrium
from der.scene import meshes, sector_name
from validation.benchmark.rings import Known
from validation.benchmark.rows import Row

NAMES = ("plain, h^2", "Richardson, h^4", "Romberg, h^6")
ORDERS = (2.0, 4.0, 6.0)
TRUSTED = 10.0  # times the floor of the reference; errors below that are not fitted
PLACES = 8  # multiples of pi/PLACES are compared, and the folds: the same for every N


class Level(NamedTuple):
    """Errors of the three extrapolations on N edges."""

    n: int
    states: tuple[float, ...]  # normal distances, scaled


def errors(truth: Known, n: int) -> Level:
    """Largest normal distance from the true curve of the states extrapolated from N edges."""
    case = truth.case
    scene = case.scene(n_edges=n)
    name = sector_name(case.ring, "auto", n)
    rings = [ring_of(scene, name, k) for k in meshes(n, name)]
    request = Request(stability=False, self_crossings=False)
    points = [one for one in request.follow(rings[0]) if _is_compared(one)]
    family = Family(tuple(rings), scene.tolerance)
    matched = [family.matched(one.solution) for one in points]
    tables = [found.table for found in matched if found is not None]
    if len(tables) < len(points):  # a coarse mesh has no such state
        return Level(n, (math.nan, math.nan, math.nan))
    states = np.array([romberg(table)[:, :RATE] for table in tables])  # (n, 3 levels, 3)
    return Level(n, tuple(_distance(truth, states[:, level]) for level in range(len(NAMES))))


def _is_compared(one: Point[Equilibrium]) -> bool:
    """Folds, and states at the multiples of pi/PLACES."""
    turns = one.solution.parameter * PLACES / math.pi
    return one.kind == "fold" or (one.kind == "" and abs(turns - round(turns)) < 1e-12)


def _distance(truth: Known, states: Array) -> float:
    columns = (states[:, GAMMA], states[:, MOMENT], states[:, ENERGY])
    return max(curve_error(*columns, truth.curve))


def rows(truth: Known, sizes: Sequence[int]) -> Iterator[Row]:
    """Errors over N, and the fitted order of each extrapolation."""
    levels = [errors(truth, n) for n in sizes]
    for k, (name, expected) in enumerate(zip(NAMES, ORDERS, strict=True)):
        values = np.array([level.states[k] for level in levels])
        for n, value in zip(sizes, values, strict=True):
            if np.isfinite(value):
                yield Row("series", f"{truth.case.name}, {name}, N {n}", float(value), "")
        fit = fitted(np.array(sizes, dtype=float), values, TRUSTED * truth.floor)
        if fit is not None:
            order, first, last = fit
            case = f"{truth.case.name}, {name}"
            yield Row("order", case, order, "", expected, f"N {first:.0f} ... {last:.0f}")


def fitted(sizes: Array, values: Array, floor: float) -> tuple[float, float, float] | None:
    """Order fitted to the last three errors above a floor, and the sizes it is fitted between.

    Coarser meshes have not reached their order. None: fewer than two errors are above it.
    """
    good = np.flatnonzero(np.isfinite(values) & (values > floor))[-3:]
    if len(good) < 2:
        return None
    order = -np.polyfit(np.log(sizes[good]), np.log(values[good]), 1)[0]
    return float(order), float(sizes[good[0]]), float(sizes[good[-1]])
