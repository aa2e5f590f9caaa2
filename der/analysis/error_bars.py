"""Error bars: the path on N, N/2 and N/4 edges, extrapolated state by state (Richardson, Romberg).

The states of the three meshes are matched one by one, and put where they belong on the extrapolated
curve (`matching`). An error is the last correction that the extrapolation made.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from der.analysis.matching import (
    ENERGY,
    GAMMA,
    LEVELS,
    MOMENT,
    RATE,
    Family,
    Place,
    placed,
    romberg,
)
from der.analysis.moved_folds import arc_lengths
from der.continuation.events import Point
from der.kernels.quaternions import Array
from der.rod.gripped_ring import GrippedRing

_EXACT = 1e-9  # of the largest values: a state that is the same on every mesh, as the folded one
_REST = 3.0  # see `_Corrections.bound`
_SMALL = 0.01  # of the largest first correction: what is below says nothing of how fast they fall


@dataclass(frozen=True)
class ErrorBars:
    """The states of a path, extrapolated, in path order.

    Where a level has no state, errors are None and the values are those of N edges.
    """

    order: tuple[int, ...]  # (n,) positions among the points; see `error_bars` for what is missing
    gamma: Array  # (n,) rad
    moment: Array  # (n,) GJ/a, of one arm
    energy: Array  # (n,) GJ/a, of the full ring
    gamma_error: list[float | None]  # (n,) rad; 0 where gamma was asked for
    moment_error: list[float | None]  # (n,) GJ/a
    energy_error: list[float | None]  # (n,) GJ/a
    raw: dict[str, list[float]]  # gamma, moment, energy (n,) on N edges
    slope: float | None  # dM/dgamma at the first arrival at pi, GJ/a; None: no such state
    slope_error: float | None
    how: str

    @property
    def error(self) -> dict[str, object]:
        """The record's entry."""
        return {
            "gamma": self.gamma_error,
            "moment": self.moment_error,
            "energy": self.energy_error,
            "slope_at_pi": self.slope_error,
            "how": self.how,
        }


def error_bars(
    rings: Sequence[GrippedRing],
    points: Sequence[Point],
    asked: Collection[float],
    *,
    tolerance: float = 1e-10,
) -> ErrorBars:
    """Extrapolated values and errors of a path that was followed on the finest of three meshes.

    Parameters
    ----------
    rings : the sector at the three levels, finest first (`scene.meshes`).
    points : the path on the finest, from `path.follow`.
    asked : values of gamma that states were solved for [rad]: there gamma stays what it is and
        moment and energy become those at this gamma on the extrapolated curve.
    tolerance : of the residual of an equilibrium, GJ/a.

    Notes
    -----
    Folds and limits move to those of the extrapolated curve, a little forward or backward on the
    path. States that nobody asked for and that they overtake are left out of ``order``: their index
    would be that of the other side. Branch and contact points are placed on N edges only; they have
    values on the extrapolated curve, but no errors.
    """
    family = Family(tuple(rings), tolerance)
    places = list(placed(family, points, asked))
    order = _order(arc_lengths(rings[0], points), places)
    scales = _scales(family, points)
    kept = [places[k] for k in order]
    corrections = _Corrections.of(kept, scales)
    bounds = [corrections.bound(k) for k in range(len(kept))]
    raw = np.array([family.values(0, points[k].solution) for k in order]).reshape(-1, RATE)
    values = np.array(
        [r if p is None else p.values for p, r in zip(kept, raw, strict=True)]
    ).reshape(-1, RATE)
    slope, slope_error = _slope_at_pi(kept, [points[k] for k in order], corrections)
    errors: list[list[float | None]] = [
        [None if b is None else float(b[c]) for b in bounds] for c in range(RATE)
    ]
    return ErrorBars(
        tuple(order),
        values[:, GAMMA],
        values[:, MOMENT],
        values[:, ENERGY],
        errors[GAMMA],
        errors[MOMENT],
        errors[ENERGY],
        dict(zip(("gamma", "moment", "energy"), raw.T.tolist(), strict=True)),
        slope,
        slope_error,
        _how(rings, bounds),
    )


def _order(lengths: Array, places: Sequence[Place | None]) -> list[int]:
    """Positions of the points in their order on the extrapolated curve, without overtaken ones."""
    at = [s + (0.0 if p is None else p.s) for s, p in zip(lengths, places, strict=True)]
    fixed = [p is not None and p.fixed for p in places]
    before = accumulate((a if f else -math.inf for a, f in zip(at, fixed, strict=True)), max)
    backward = zip(reversed(at), reversed(fixed), strict=True)
    after = reversed(list(accumulate((a if f else math.inf for a, f in backward), min)))
    kept = []
    for k, (low, high) in enumerate(zip(before, after, strict=True)):
        if places[k] is None:
            at[k] = min(max(at[k], low), high)  # known on N edges only: among its old neighbours
        if at[k] > at[-1]:
            continue  # a branch or contact point that has moved beyond the end of the path
        if fixed[k] or places[k] is None or low < at[k] < high:
            kept.append(k)
    return sorted(kept, key=lambda k: at[k])


def _scales(family: Family, points: Sequence[Point]) -> Array:
    """What the columns of a table are measured in (6,): pi and the largest |M| and |U|."""
    values = np.array([family.values(0, point.solution) for point in points]).reshape(-1, RATE)
    largest = np.abs(values).max(axis=0, initial=0.0)
    largest[GAMMA] = math.pi
    return np.tile(np.where(largest > 0.0, largest, 1.0), 2)


@dataclass(frozen=True)
class _Corrections:
    """What the two extrapolations change at the states of a path."""

    places: Sequence[Place | None]
    first: Array  # (n, 6) T10 - T00; zero where there is no state
    last: Array  # (n, 6) T20 - T10
    exact: NDArray[np.bool_]  # (n,) the same on every mesh; or no state
    rest: float  # what the corrections left out may add, as a fraction of the first
    remainder: Array  # (n, 6) the same, in the columns of the table

    @classmethod
    def of(cls, places: Sequence[Place | None], scales: Array) -> _Corrections:
        """Corrections at these places."""
        none = np.zeros((LEVELS, 6))
        changes = np.array(
            [np.diff(romberg(none if p is None else p.table), axis=0) for p in places]
        ).reshape(-1, 2, 6)
        first, last = changes[:, 0], changes[:, 1]
        sizes = np.linalg.norm(changes[:, :, :RATE] / scales[:RATE], axis=2)
        exact = sizes[:, 0] < _EXACT
        small = _SMALL * sizes[:, 0].max(initial=0.0)
        ratio = (sizes[~exact, 1] / np.maximum(sizes[~exact, 0], small)).max(initial=0.0)
        rest = float(_REST * ratio * ratio)
        halves = np.linalg.norm((first / scales).reshape(-1, 2, RATE), axis=2)
        return cls(places, first, last, exact, rest, rest * scales * np.repeat(halves, RATE, 1))

    def bound(self, k: int) -> Array | None:
        """Errors (3,) of the values at a place; None where they are not known.

        Notes
        -----
        The last correction, T20 - T10, is several times the error of T20 where the series of h is
        well behaved. It passes through zero where the error does not, so it is the largest of a
        state and its two neighbours, and the corrections to come are added as those of a geometric
        series: the first correction times the square of the largest ratio of the two along the
        path, times `_REST`. States close to the flat one, of next to no correction, do not count
        for that ratio. The residual of the states is the floor.
        """
        place = self.places[k]
        if place is None or not place.sought:
            return None
        floor = 2.0 * place.residual * np.any(place.spread != 0.0, axis=1)
        if self.exact[k]:
            return np.abs(place.spread @ self.last[k]) + floor
        near = [j for j in (k - 1, k, k + 1) if 0 <= j < len(self.places) and not self.exact[j]]
        last = np.abs(self.last[near] @ place.spread.T).max(axis=0)
        return last + np.abs(place.spread) @ self.remainder[k] + floor


def _slope_at_pi(
    places: Sequence[Place | None], points: Sequence[Point], corrections: _Corrections
) -> tuple[float | None, float | None]:
    """dM/dgamma at the first arrival at pi, and its error."""
    found = [k for k, v in enumerate(points) if v.kind == "" and v.solution.parameter == math.pi]
    place = places[found[0]] if found else None
    if place is None:
        return None, None
    k = found[0]
    gamma_rate, moment_rate = place.table[:, RATE + GAMMA], place.table[:, RATE + MOMENT]
    plain, once, twice = romberg(moment_rate / gamma_rate)
    # and by how much it changes if the state lies elsewhere on the curve
    change = romberg(
        (place.bend[:, MOMENT] - moment_rate / gamma_rate * place.bend[:, GAMMA]) / gamma_rate
    )[-1]
    away = (abs(corrections.last[k, GAMMA]) + corrections.remainder[k, GAMMA]) / gamma_rate[0]
    error = abs(twice - once) + corrections.rest * abs(once - plain) + abs(change * away)
    return float(twice), float(error)


def _how(rings: Sequence[GrippedRing], bounds: Sequence[Array | None]) -> str:
    """How the errors were found, in a sentence."""
    sizes = ", ".join(str(_edges(ring)) for ring in rings)
    text = (
        f"Romberg extrapolation from {sizes} edges, states matched in the planes normal to the path"
        " of the finest; an error is the last correction, the largest of a state and its"
        " neighbours, and an estimate of those to come"
    )
    missing = sum(bound is None for bound in bounds)
    if missing:
        text += (
            f"; null at {missing} of {len(bounds)} states: a coarser mesh has no such state, or it"
            f" is a branch or contact point, whose place on the path is that of {_edges(rings[0])}"
            " edges"
        )
    return text


def _edges(ring: GrippedRing) -> int:
    """Edges of the full ring."""
    return len(ring.rod.cell) * ring.copies
