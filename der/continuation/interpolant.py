"""What leads from one state to a neighbour, in between and on beyond: the arithmetic of `step`.

A path takes some thirty steps, of a few dozen edges: in numpy, calls would cost more than work.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from der.kernels.quaternions import Array, chart_rate, rotation_vector
from der.rod.equilibrium import Direction, product
from der.rod.rod import State
from der.rod.supports import Supports

_APART = 0.1  # of a step: states that lie closer would tell more of rounding than of the path
_MOST = 3  # states kept to interpolate between


@njit(cache=True)
def chord(free, quat, stretch, next_quat, next_stretch):
    """Rotation vectors, and stretch, (n, b) that lead from one state to the next."""
    n, b = free.shape
    jump = np.zeros((n, b))
    turn = rotation_vector(quat, next_quat)
    for j in range(n):
        for i in range(b):
            if free[j, i]:
                jump[j, i] = turn[j, i] if i < 3 else next_stretch[j] - stretch[j]
    return jump


def between(held: Supports, a: State, b: State) -> Direction:
    """The increment that leads from one state to another."""
    q = chord(held.free, a.quat, a.stretch, b.quat, b.stretch)
    return Direction(q, b.force - a.force, b.load - a.load)


@njit(cache=True)
def _in_frames(jump, rates):
    """Rates (n, b) of a chord whose end moves at ``rates``, in the frames of its start."""
    own = rates.copy()
    turn = chart_rate(jump, rates)
    for j in range(own.shape[0]):
        for i in range(3):
            own[j, i] = turn[j, i]
    return own


@njit(cache=True)
def end_rates(mass, jump, rates, load_rate, next_rates, next_load_rate):
    """Rates (n, b) at the end of a chord per length along the tangent at its start, and a factor.

    The factor does the same to those of load and forces. All in the frames of the start.
    """
    own = _in_frames(jump, next_rates)
    factor = 1.0 / (product(mass, rates, own) + load_rate * next_load_rate)
    return own * factor, factor


@njit(cache=True)
def onward(mass, s, jump, jump_force, jump_load, rates, force_rates, load_rate, t, force_t, load_t):
    """Increment (n, b), (n_c,) and of the load from the end of a chord to ``s`` beyond.

    By the cubic through both ends, where the rates are ``rates`` and ``t``. All in the frames of
    the end.
    """
    first = _in_frames(-jump, rates)
    u = s / (product(mass, t, jump) + load_t * jump_load)
    along = product(mass, t, first) + load_t * load_rate
    of_start = s * u * (1.0 + u) / along
    of_end, of_jump = s * (1.0 + u) ** 2, -u * u * (3.0 + 2.0 * u)
    increment, force = np.empty(jump.shape), np.empty(jump_force.shape)
    for j in range(jump.shape[0]):
        for i in range(jump.shape[1]):
            increment[j, i] = of_end * t[j, i] + of_start * first[j, i] + of_jump * jump[j, i]
    for k in range(force.shape[0]):
        force[k] = of_end * force_t[k] + of_start * force_rates[k] + of_jump * jump_force[k]
    return increment, force, of_end * load_t + of_start * load_rate + of_jump * jump_load


@njit(cache=True)
def _weights(u, length, places):
    """Weights (3 + k,), at ``u`` of a ``length``, of the rows of a `Curve` (Hermite, Lagrange)."""
    k = places.shape[0]
    weights = np.empty(3 + k)
    weights[0] = length * u * (1.0 - u) ** 2
    weights[1] = u * u * (3.0 - 2.0 * u)
    weights[2] = length * u * u * (u - 1.0)
    for i in range(k):
        weights[3 + i] = (u * (1.0 - u)) ** 2
        for j in range(k):
            if j != i:
                weights[3 + i] *= (u - places[j]) / (places[i] - places[j])
    return weights


@njit(cache=True)
def on_curve(u, length, places, rows):
    """Increment (m,) to ``u`` of the ``length`` of a curve; see `Curve`.

    Parameters
    ----------
    places : (k,). rows : (3 + k, m).
    """
    m = rows.shape[1]
    away = np.zeros(m)
    weights = _weights(u, length, places)
    for k in range(weights.shape[0]):
        for i in range(m):
            away[i] += weights[k] * rows[k, i]
    return away


class Curve:
    """The polynomial through a step: a cubic, and what states within it were found to lie off that.

    Increments from its start are rows (m,): frames and stretch, forces and load, one behind
    another. What a state lies off the cubic is kept over u^2 (1 - u)^2, u = s/length, which
    vanishes with its rate at both ends.
    """

    def __init__(self, length: float, rate: Direction, jump: Direction, end_rate: Direction):
        self.length = length
        self._shape, self._size = rate.q.shape, rate.q.size
        self._places: list[float] = []  # u of the states
        # rate at the start, jump, rate at the end, and what the states lie off these
        self._rows = np.empty((3 + _MOST, self._size + len(rate.force) + 1))
        for k, d in enumerate((rate, jump, end_rate)):
            self._set(k, d)

    def _set(self, k: int, d: Direction) -> None:
        row = self._rows[k]
        row[: self._size], row[self._size : -1], row[-1] = d.q.ravel(), d.force, d.load

    def _row(self, s: float, known: int) -> Array:
        """The increment to ``s`` by the cubic and the first ``known`` states, (m,)."""
        places = np.array(self._places[:known])
        row: Array = on_curve(s / self.length, self.length, places, self._rows[: 3 + known])
        return row

    def at(self, s: float) -> Direction:
        """Increment from the start to ``s``."""
        row, q = self._row(s, len(self._places)), self._size
        return Direction(row[:q].reshape(self._shape), row[q:-1], float(row[-1]))

    def load(self, s: float) -> float:
        """The load of that increment."""
        return float(self._row(s, len(self._places))[-1])

    def keep(self, s: float, found: Direction) -> None:
        """Lead through a state ``found`` at ``s``, where that says something new."""
        u, k = s / self.length, len(self._places)
        if k < _MOST and min(abs(u - place) for place in (0.0, *self._places, 1.0)) >= _APART:
            self._set(3 + k, found)
            self._rows[3 + k] -= self._row(s, 0)
            self._rows[3 + k] /= (u * (1.0 - u)) ** 2
            self._places.append(u)
