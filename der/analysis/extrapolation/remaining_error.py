"""Errors that are left after Romberg's extrapolation from three meshes.

A value differs by a h^2 + b h^4 + c h^6 + ... from its limit, and is corrected twice, by its values
on meshes of h, 2h and 4h. If a, b, c are a geometric series of ratio q, then at h = 1

    first correction    T10 - T00 = -a - 5b - 21c  = -a                   to leading order
    last correction     T20 - T10 = 4b + 84c       = 4 q a
    what is left        T20       = 64c            = 64 q^2 a = 4 r^2 a,  r = 4q = last/first

The last correction of one value at one state may vanish by chance, and its error not. So r is that
of functions along the path, not of numbers: the largest correction of each kind anywhere. It is the
largest of those of gamma, M, U and their rates: the meshes resolve all six or none.

Kinks of the natural curvature inside of cells leave w h^4 with a w of either sign on each mesh.
Where |w| is at most one, the last correction has (4 + 5 * 16 + 256)/45 of it and T20 has
(64 + 20 * 16 + 256)/45, 1.9 times as much. The last correction then counts so often, and as large
as anywhere on the path: it is not a smooth function of the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from der.analysis.extrapolation.curve import GAMMA, LEVELS, MOMENT, RATE, Family, Place
from der.continuation.richardson import UNEVEN, romberg
from der.kernels.quaternions import Array
from der.problem import Point
from der.rod.equilibrium import Equilibrium

_EXACT = 1e-9  # of a scale: a smaller first correction is rounding
_LEFT = 4.0  # times r^2: what is left of a geometric series, see above


def scales_of(family: Family, points: Sequence[Point[Equilibrium]]) -> Array:
    """Scales (6,) of the columns of a table: pi and the largest |M| and |U|."""
    values = np.array([family.values(0, point.solution) for point in points]).reshape(-1, RATE)
    largest = np.abs(values).max(axis=0, initial=0.0)
    largest[GAMMA] = np.pi
    return np.tile(np.where(largest > 0.0, largest, 1.0), 2)


@dataclass(frozen=True)
class Corrections:
    """The corrections of the two extrapolations at the states of a path."""

    places: Sequence[Place | None]
    first: Array  # (n, 6) T10 - T00; zero if there is no state
    last: Array  # (n, 6) T20 - T10
    ratio: float  # of the last to the first
    exact: NDArray[np.bool_]  # (n,) the same on every mesh, as a folded ring; or no state
    is_even: bool  # no kinks inside of cells

    @classmethod
    def of(cls, family: Family, places: Sequence[Place | None], scales: Array) -> Corrections:
        """Corrections at these places."""
        none = np.zeros((LEVELS, 2 * RATE))
        tables = [none if p is None else p.table for p in places]
        changes = np.array([np.diff(romberg(table), axis=0) for table in tables])
        first, last = changes.reshape(-1, 2, 2 * RATE).swapaxes(0, 1)
        most, then = (np.abs(one).max(axis=0, initial=0.0) for one in (first, last))
        seen = most > _EXACT * scales
        ratio = float((then[seen] / most[seen]).max(initial=0.0))
        exact = np.all(np.abs(first[:, :RATE]) < _EXACT * scales[:RATE], axis=1)
        is_even = not any(ring.kinks_in_cells for ring in family.rings)
        return cls(places, first, last, ratio, exact, is_even)

    @property
    def left(self) -> float:
        """Estimate of all further corrections, as a fraction of the first."""
        return _LEFT * self.ratio**2

    def bound(self, k: int) -> Array | None:
        """Errors (3,) of the values at a place; None: they are not known.

        An error is at least the residual of the states.
        """
        place = self.places[k]
        if place is None or not place.sought:
            return None
        floor = 2.0 * place.residual * np.any(place.spread != 0.0, axis=1)
        if place.own is not None:
            first, last = np.abs(np.diff(romberg(place.own), axis=0))
            # it has no neighbours: its last correction counts as large as along the path
            bound: Array = np.maximum(last, self.ratio * first) + self.left * first
            return bound + place.unsure + floor
        return self.errors(k, place.spread, alone=bool(self.exact[k])) + floor

    def errors(self, k: int, spread: Array, *, alone: bool) -> Array:
        """Return errors of values whose ``spread`` (m, 6) by corrections at a place is known.

        The last correction may pass through zero where the error does not: the largest of a state
        and its two neighbours counts, unless the state stands ``alone``.
        """
        if alone:
            near = slice(k, k + 1)
        else:
            near = slice(max(k - 1, 0), k + 2) if self.is_even else slice(None)
        last = np.abs(self.last[near] @ spread.T).max(axis=0) * (1.0 if self.is_even else UNEVEN)
        errors: Array = last + self.left * np.abs(spread) @ np.abs(self.first[k])
        return errors

    def slope(self, k: int | None) -> tuple[float | None, float | None]:
        """Return dM/dgamma at a place, and its error.

        Notes
        -----
        Both rates are smooth where the slope has a pole; so they are extrapolated, not the slope.
        Its error is not known if that of dgamma/ds reaches dgamma/ds.
        """
        place = None if k is None else self.places[k]
        if k is None or place is None:
            return None, None
        rates, bend = (romberg(table)[-1] for table in (place.table[:, RATE:], place.bend))
        gamma_rate = float(rates[GAMMA])
        slope = float(rates[MOMENT]) / gamma_rate
        spread = np.zeros((2, 2 * RATE))
        # a state that lies elsewhere on the curve has the slope there
        spread[0, GAMMA] = (slope * bend[GAMMA] - bend[MOMENT]) / gamma_rate**2
        spread[0, RATE + GAMMA], spread[0, RATE + MOMENT] = -slope / gamma_rate, 1.0 / gamma_rate
        spread[1, RATE + GAMMA] = 1.0 / gamma_rate
        error, share = self.errors(k, spread, alone=False).tolist()
        return slope, error / (1.0 - share) if share < 1.0 else None
