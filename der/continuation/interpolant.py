"""The interpolant of a step: a cubic, corrected to pass through the solutions within the step.

Increments from the start of a step are flat arrays, which keeps the number of calls small on paths
with few unknowns.
"""

from __future__ import annotations

import numpy as np

from der.packs.kernel import kernel
from der.problem import Increment

_APART = 0.1  # of a step: closer solutions would add rounding errors
_MOST = 3  # solutions kept to interpolate between


@kernel
def _weight(row, u, length, places):
    """Weight of a row of an interpolant, at ``u`` of a ``length``.

    Hermite's for the first three, Lagrange's for the others.
    """
    if row == 0:
        return length * u * (1.0 - u) ** 2
    if row == 1:
        return u * u * (3.0 - 2.0 * u)
    if row == 2:
        return length * u * u * (u - 1.0)
    weight = (u * (1.0 - u)) ** 2
    for j in range(places.shape[0]):
        if j != row - 3:
            weight *= (u - places[j]) / (places[row - 3] - places[j])
    return weight


@kernel
def on_curve(u, length, places, rows, out_increment):
    """Increment (m,) to ``u`` of the ``length`` of a step; see `Interpolant`.

    Parameters
    ----------
    places : (k,). rows : (3 + k, m).
    """
    for i in range(out_increment.shape[0]):
        out_increment[i] = 0.0
    for k in range(3 + places.shape[0]):
        weight = _weight(k, u, length, places)
        for i in range(out_increment.shape[0]):
            out_increment[i] += weight * rows[k, i]


@kernel
def combined(a, x, b, y, c, z, out_increment):
    """Sum a x + b y + c z of three increments (m,)."""
    for i in range(x.shape[0]):
        out_increment[i] = a * x[i] + b * y[i] + c * z[i]


class Interpolant:
    """The polynomial of a step: a cubic, and the distances of solutions within it from the cubic.

    A solution's distance from the cubic is kept over u^2 (1 - u)^2, u = s/length, which vanishes
    with its rate at both ends.
    """

    def __init__(self, length: float, rate: Increment, jump: Increment, end_rate: Increment):
        self.length = length
        self._places: list[float] = []  # u of the solutions
        # rate at the start, jump, rate at the end, and distances of solutions from the cubic
        self._rows = np.empty((3 + _MOST, len(jump)))
        self._rows[0], self._rows[1], self._rows[2] = rate, jump, end_rate

    def _at(self, s: float, known: int) -> Increment:
        """Increment to ``s`` by the cubic and the first ``known`` solutions, (m,)."""
        places = np.array(self._places[:known])
        increment = np.empty(self._rows.shape[1])
        on_curve(s / self.length, self.length, places, self._rows, increment)
        return increment

    def at(self, s: float) -> Increment:
        """Increment from the start to ``s``."""
        return self._at(s, len(self._places))

    def keep(self, s: float, found: Increment) -> None:
        """Pass through a solution ``found`` at ``s``, unless it is too close to others."""
        u, k = s / self.length, len(self._places)
        if k < _MOST and min(abs(u - place) for place in (0.0, *self._places, 1.0)) >= _APART:
            self._rows[3 + k] = (found - self._at(s, 0)) / (u * (1.0 - u)) ** 2
            self._places.append(u)
