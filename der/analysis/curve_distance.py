"""Reference curves, and the distance of a computed path from one.

The error is a normal distance in scaled planes, not a difference at equal gamma: such a difference
grows without bound on steep parts and has no meaning at folds.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import make_interp_spline

Array = NDArray[np.float64]

GAMMA, MOMENT, ENERGY = 0, 1, 2  # columns of the scaled curve; further columns help to interpolate
DEGREE = 7  # measured: 5 is up to 6 times worse, 9 oscillates on coarse tables
THIN = 0.25  # of the median interval; rounding of U would dominate the area under shorter ones
SAMPLES = 8  # per interval, to bracket the nearest points
MODELS = {"quarter model": 4.0, "half model": 2.0}  # header's words -> full ring's U per U there
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(12)


class Interpolant(NamedTuple):
    """Spline through a reference curve, scaled to gamma/pi, M/max|M|, U/max|U|."""

    parameter: Array  # (m,) increasing; the spline's data sites
    spline: Any  # (k,) -> (k, columns), scipy BSpline


@dataclass(frozen=True, eq=False)
class ReferenceCurve:
    """A path of equilibria from another program.

    Parameters
    ----------
    gamma : (n,) array
        Rotation of one grip, rad, in path order.
    moment : (n,) array
        Moment of one arm, GJ/a.
    energy : (n,) array
        Energy of the FULL ring, GJ/a.
    others : (n, m) array
        Other smooth components of the same solutions, any unit; m = 0 is allowed. They improve the
        interpolant where the curve (gamma, M) turns sharply.
    folds : tuple of float
        gamma at the folds, rad, in path order.
    header : str
        The table's comment lines.

    Raises
    ------
    ValueError
        If lengths differ, a value is not finite, fewer than DEGREE + 1 points are given, or M or U
        is zero throughout.
    """

    gamma: Array
    moment: Array
    energy: Array
    others: Array = field(repr=False)
    folds: tuple[float, ...] = ()
    header: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        for name in ("gamma", "moment", "energy", "others"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if len(array) != len(self.gamma):
                raise ValueError(f"{name} has {len(array)} rows, gamma has {len(self.gamma)}")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} of the reference holds a value that is not finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if len(self.gamma) <= DEGREE:
            raise ValueError(f"a reference needs more than {DEGREE} points, got {len(self.gamma)}")
        if not (self.moment.any() and self.energy.any()):
            raise ValueError("moment and energy of a reference cannot be zero throughout")

    @property
    def scales(self) -> Array:
        """What (gamma, M, U) are divided by: pi, max|M|, max|U|."""
        return np.array([np.pi, np.abs(self.moment).max(), np.abs(self.energy).max()])

    @cached_property
    def interpolant(self) -> Interpolant:
        """Smooth curve through the points that also obeys dU = 4 M dgamma (see `_interpolate`)."""
        largest = np.abs(self.others).max(axis=0, initial=0.0)
        others = self.others / np.where(largest > 0.0, largest, 1.0)
        points = np.column_stack([self.gamma, self.moment, self.energy]) / self.scales
        pi, moment, energy = self.scales
        return _interpolate(np.hstack([points, others]), work_factor=4.0 * pi * moment / energy)


def read_reference(path: str | os.PathLike[str]) -> ReferenceCurve:
    """Table by AUTO-07p as a reference curve.

    Parameters
    ----------
    path : path
        Lines that start with # are the header, which says "quarter model" or "half model"; then
        the columns idx, type, gamma, M, U and any number of further ones.

    Returns
    -------
    ReferenceCurve
        With the energy of the full ring.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is not such a table; the message names the file.
    """
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    header = "\n".join(line.lstrip("# ") for line in lines if line.startswith("#"))
    factors = [factor for words, factor in MODELS.items() if words in header]
    if len(factors) != 1:
        raise ValueError(f"{path}: the header must say one of {sorted(MODELS)}")
    names, *rows = [line.split(",") for line in lines if line and not line.startswith("#")] or [[]]
    if names[:5] != ["idx", "type", "gamma", "M", "U"]:
        raise ValueError(f"{path}: columns are {names[:5]}, not idx, type, gamma, M, U")
    try:
        table = np.array([[float(entry) for entry in row[2:]] for row in rows])
        return ReferenceCurve(
            gamma=table[:, GAMMA],
            moment=table[:, MOMENT],
            energy=factors[0] * table[:, ENERGY],
            others=table[:, ENERGY + 1 :],
            folds=tuple(float(row[2]) for row in rows if row[1] == "LP"),
            header=header,
        )
    except (ValueError, IndexError) as problem:
        raise ValueError(f"{path}: not a table of numbers: {problem}") from problem


def curve_error(
    gamma: ArrayLike, moment: ArrayLike, energy: ArrayLike, reference: ReferenceCurve
) -> tuple[float, float]:
    """Largest normal distances of a path's states from a reference curve.

    Parameters
    ----------
    gamma, moment, energy : (n,) arrays
        States, in any order: rad, GJ/a, and GJ/a of the full ring.
    reference : ReferenceCurve
        Its ends are not extended: a state beyond them is measured from the end point.

    Returns
    -------
    moment_error, energy_error : float
        In the planes (gamma/pi, M/max|M|) and (gamma/pi, U/max|U|), scaled by the reference.

    Raises
    ------
    ValueError
        If the arrays differ in length, are empty or hold a value that is not finite.
    """
    arrays = [np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (gamma, moment, energy)]
    if len({array.shape for array in arrays}) != 1 or arrays[0].ndim != 1 or not arrays[0].size:
        raise ValueError(f"gamma, moment, energy have shapes {[a.shape for a in arrays]}")
    states = np.column_stack(arrays) / reference.scales
    if not np.isfinite(states).all():
        raise ValueError("gamma, moment or energy holds a value that is not finite")
    curve = reference.interpolant
    return (
        float(_distances(states[:, [GAMMA, MOMENT]], curve, [GAMMA, MOMENT]).max()),
        float(_distances(states[:, [GAMMA, ENERGY]], curve, [GAMMA, ENERGY]).max()),
    )


def fold_error(folds: Sequence[float], reference: ReferenceCurve) -> float:
    """Largest |difference in gamma|, rad, of folds matched in path order; inf if counts differ.

    A missing or surplus fold is a wrong answer, not bad input: infinity fails any tolerance.
    """
    if len(folds) != len(reference.folds):
        return math.inf
    return max((abs(a - b) for a, b in zip(folds, reference.folds, strict=True)), default=0.0)


def _interpolate(points: Array, work_factor: float) -> Interpolant:
    """Spline that passes through the points and has the known work between each two of them.

    Parameters
    ----------
    points : (n, 3 + m) array
        Scaled gamma, M, U and other components.
    work_factor : float
        c in dU = c M dgamma, in scaled quantities.

    Raises
    ------
    ValueError
        If the energy is not the work of the moment.

    Notes
    -----
    1. Spline by chord length of all columns, once more by its own arc length: a chord length alone
       limits the order to four (Floater and Surazhsky 2006, "Parameterization for curve
       interpolation").
    2. A point is added in the middle of each interval and moved along the curve's normal in
       (gamma, M) until the area under the interval is the known difference of U: twice the data,
       and U then follows by integration.
    """
    s = _running(np.linalg.norm(np.diff(points, axis=0), axis=1))
    s = _arc_lengths(_spline(s, points), s)
    spline = _spline(s, points)
    missing = points[-1, ENERGY] - points[0, ENERGY] - work_factor * _work(spline, s).sum()
    if abs(missing) > 0.01:
        raise ValueError(
            f"U is off by {missing:.2g} max|U| from the integral of 4 M dgamma: "
            "is it the energy of the full ring?"
        )
    length = np.diff(s)
    split = np.flatnonzero(length > THIN * np.median(length))
    at = split + 1 + np.arange(len(split))  # where the added points end up
    middle = s[split] + 0.5 * length[split]
    sites = np.insert(s, split + 1, middle)
    guess = np.insert(points, split + 1, spline(middle), axis=0)
    return Interpolant(sites, _fit_work(sites, guess, at, work_factor))


def _fit_work(sites: Array, guess: Array, at: NDArray[np.int64], work_factor: float) -> Any:
    """Spline whose added points `at` lie where each split interval does the work of its ends.

    Parameters
    ----------
    sites : (m,) array
        Increasing parameter.
    guess : (m, columns) array
        Scaled points; those not in `at` stay.
    at : (k,) array of int
        Added points, no two adjacent.
    work_factor : float
        As in `_interpolate`.

    Raises
    ------
    ValueError
        If the iteration, which gains a factor of 2.5 each time, has not settled after 60. It stops
        at an area of 1e-14, far below the rounding of an 11-digit table.
    """
    points = guess.copy()
    width = sites[at + 1] - sites[at - 1]
    known = (points[at + 1, ENERGY] - points[at - 1, ENERGY]) / work_factor
    for _ in range(60):
        spline = _spline(sites, points)
        work = _work(spline, sites)
        excess = known - work[at - 1] - work[at]
        tangent = spline(sites[at], 1)[:, [GAMMA, MOMENT]]
        # a bubble of unit height over an interval has an area of two thirds to 0.8 of its width
        offset = 1.2 * excess / (width * np.sum(tangent**2, axis=1))
        points[at, GAMMA] -= offset * tangent[:, 1]
        points[at, MOMENT] += offset * tangent[:, 0]
        points[at, ENERGY] = points[at - 1, ENERGY] + work_factor * (work[at - 1] + excess / 2)
        if np.abs(excess).max() < 1e-14:
            return _spline(sites, points)
    raise ValueError("the reference is too coarse: the energy between its points cannot be matched")


def _spline(sites: Array, points: Array) -> Any:
    """Interpolating spline of DEGREE, not-a-knot at the ends."""
    return make_interp_spline(sites, points, k=DEGREE)


def _running(steps: Array) -> Array:
    """Cumulative sum from zero, one entry longer than its steps."""
    return np.concatenate([[0.0], np.cumsum(steps)])


def _integrals(density: Callable[[Array], Array], s: Array) -> Array:
    """Integrals of a density over each interval of s, by Gauss's rule."""
    half = 0.5 * np.diff(s)[:, None]
    return (density(s[:-1, None] + half * (1.0 + GAUSS_NODES)) * half) @ GAUSS_WEIGHTS


def _arc_lengths(spline: Any, s: Array) -> Array:
    """Arc length from the first site to each."""
    return _running(_integrals(lambda t: np.linalg.norm(spline(t, 1), axis=-1), s))


def _work(spline: Any, s: Array) -> Array:
    """Integral of M dgamma over each interval."""
    return _integrals(lambda t: spline(t)[..., MOMENT] * spline(t, 1)[..., GAMMA], s)


def _distances(states: Array, curve: Interpolant, plane: list[int]) -> Array:
    """Distance of each state, (n, 2), from the curve's projection on two of its columns.

    Every local minimum among the samples is refined, not only the smallest: where branches cross,
    the nearest sample may lie on the wrong one.
    """
    sites = curve.parameter
    inner = np.arange(SAMPLES) / SAMPLES
    t = np.append((sites[:-1, None] + np.diff(sites)[:, None] * inner).ravel(), sites[-1])
    samples = curve.spline(t)[:, plane]
    minima = [_local_minima(np.linalg.norm(samples - state, axis=1)) for state in states]
    owner = np.repeat(np.arange(len(states)), [len(found) for found in minima])
    middle = np.concatenate(minima)
    low, high = t[np.maximum(middle - 1, 0)], t[np.minimum(middle + 1, len(t) - 1)]
    for _ in range(50):  # bisection on the sign of (curve - state) . tangent
        centre = 0.5 * (low + high)
        gap = curve.spline(centre)[:, plane] - states[owner]
        recedes = np.sum(gap * curve.spline(centre, 1)[:, plane], axis=1) > 0.0
        low, high = np.where(recedes, low, centre), np.where(recedes, centre, high)
    gap = curve.spline(0.5 * (low + high))[:, plane] - states[owner]
    nearest = np.full(len(states), np.inf)
    np.minimum.at(nearest, owner, np.linalg.norm(gap, axis=1))
    return nearest


def _local_minima(values: Array) -> NDArray[np.int64]:
    """Positions where a value exceeds neither neighbour; ends count."""
    padded = np.concatenate([[np.inf], values, [np.inf]])
    return np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
