"""Gauss collocation on one interval: the tables.

Stages at the m Gauss points of [0, 1]; the collocation polynomial has degree m, the values at the
ends of intervals are accurate to h^(2m) (de Boor & Swartz 1973; Ascher, Mattheij & Russell 1995,
section 5.4). The tables are exact to rounding: computed from Legendre polynomials.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

STAGES = 4


class Rule(NamedTuple):
    """Runge-Kutta form of Gauss collocation, m stages."""

    points: Array  # (m,) in (0, 1)
    weights: Array  # (m,) b: integrals over the interval
    partial: Array  # (m, m) A: integrals of the Lagrange polynomials up to each point
    slope: Array  # (m, m) A^-1: derivatives at the points, of values less that at the left end
    slope_sum: Array  # (m,) its row sums
    last: Array  # (m,) b A^-1: the right end from the stages
    first: float  # and from the left end, 1 - sum(last)
    halves: Array  # (2 m, m + 1) left end and stages -> stages of the two halves
    halves_inner: Array  # (2 m, m) the same from the stages only, one order less
    top: Array  # (m + 1,) left end and stages -> m-th derivative of the polynomial


@cache
def rule(stages: int = STAGES) -> Rule:
    """Tables for ``stages`` Gauss points."""
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    points, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    powers = np.vander(points, stages, increasing=True)
    rows = points[:, None] ** np.arange(1, stages + 1) / np.arange(1, stages + 1)
    partial = np.asarray(np.linalg.solve(powers.T, rows.T).T, dtype=np.float64)
    slope = np.asarray(np.linalg.inv(partial), dtype=np.float64)
    last = weights @ slope
    first = 1.0 - float(last.sum())
    places = np.append(0.5 * points, 0.5 + 0.5 * points)
    halves = interpolation(np.append(0.0, points), places), interpolation(points, places)
    sums, top = slope.sum(axis=1), top_derivative(points)
    return Rule(points, weights, partial, slope, sums, last, first, *halves, top)


def interpolation(sites: Array, places: Array) -> Array:
    """Matrix (n, k) from values at ``sites``, (k,), to those of their polynomial at ``places``."""
    apart = places[:, None, None] - sites  # (n, 1, k)
    own = np.eye(len(sites), dtype=bool)
    across = sites[:, None] - sites
    factors = np.where(own, 1.0, apart / np.where(own, 1.0, across))
    return np.asarray(factors.prod(axis=2))


def top_derivative(points: Array) -> Array:
    """Weights (m + 1,) of the m-th derivative on the unit interval: divided differences."""
    sites = np.append(0.0, points)
    across = sites[:, None] - sites
    np.fill_diagonal(across, 1.0)
    return np.asarray(np.prod(np.arange(1.0, len(sites))) / across.prod(axis=1))
