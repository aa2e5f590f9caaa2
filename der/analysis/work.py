"""Work done on a ring along a path, which its energy must account for."""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline

from der.records.path import Path
from der.utils.checks import Array

SAME_STATE = 1e-9  # of the length of the path: two states closer than this are one
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)  # exact for the product of two cubics


def work(gamma: Array, moment: Array) -> Array:
    """Work 4 times the integral of M dgamma, from the first state to each, GJ/a.

    The integral is that along the cubic spline through the states, over the chord length in
    (gamma/pi, M/max|M|), so that folds do no harm; the path must have no snap in it.

    Parameters
    ----------
    gamma : (n,) rotation of one grip, rad
    moment : (n,) of one arm, GJ/a
    """
    scaled = np.column_stack([gamma / math.pi, moment / np.abs(moment).max()])
    chord = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(scaled, axis=0), axis=1)))
    first = np.append(True, np.diff(chord) > SAME_STATE * chord[-1])
    s = chord[first]
    path = CubicSpline(s, np.column_stack([gamma, moment])[first])
    half = 0.5 * np.diff(s)[:, None]
    at = s[:-1, None] + half * (1.0 + _NODES)
    done = 4.0 * (path(at)[..., 1] * path(at, 1)[..., 0] * half) @ _WEIGHTS
    total: Array = np.append(0.0, np.cumsum(done))[np.cumsum(first) - 1]
    return total


def work_missing(path: Path) -> float:
    """Largest difference of a path's energy U from the work done, over its largest U.

    A continuation that jumps to another branch gives itself away by a large one.
    """
    missing = work(path.gamma, path.moment) - (path.energy - path.energy[0])
    return float(np.abs(missing).max() / path.energy.max())
