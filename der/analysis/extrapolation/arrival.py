"""Whether the first arrival at pi is the same state on N edges and on the extrapolated curve.

                 . . .
    pi     ----.-------o---       o the first arrival on N edges
              .  *  *             . extrapolated: it arrives earlier, at another state
             . *      *           * on N edges

The same the other way round: N edges arrive, and the extrapolated curve turns back before. A fold
is known to lie between its place on N edges and the far end of its error bar. If pi does, too, no
one can say which state comes first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from der.analysis.extrapolation.curve import GAMMA, RATE, Family, Goal, Place, sought
from der.analysis.extrapolation.remaining_error import Corrections
from der.continuation.richardson import romberg
from der.problem import Point
from der.rod.equilibrium import Equilibrium

_FOLD = Goal(RATE + GAMMA, 0.0, 0.0)


def first_arrival(points: Iterable[Point[Equilibrium]]) -> int | None:
    """Position of the first state at pi on N edges; None: there is none."""
    arrived = (k for k, v in enumerate(points) if not v.kind and v.solution.parameter == math.pi)
    return next(arrived, None)


def fold_near_pi(
    family: Family,
    points: Sequence[Point[Equilibrium]],
    places: Sequence[Place | None],
    corrections: Corrections,
) -> bool:
    """Whether a fold lies so close to pi that the first arrival there depends on the mesh."""
    end = first_arrival(points)
    folds = [k for k, one in enumerate(points) if one.kind == "fold"]
    last = next((k for k in folds if end is not None and k > end), len(points))
    if any(_at_pi(corrections, points[k], k) for k in folds if k <= last):
        return True
    if end is None:
        return False
    place = places[end]
    return _turns_back(family, points[end]) if place is None else _folds_at(corrections, end, place)


def _at_pi(corrections: Corrections, fold: Point[Equilibrium], k: int) -> bool:
    """Whether pi lies between a fold on N edges and the far end of its error bar."""
    place, bound = corrections.places[k], corrections.bound(k)
    if place is None or bound is None:
        return False
    away, raw = (g - math.pi for g in (place.values[GAMMA], fold.solution.parameter))
    return bool(abs(away) <= bound[GAMMA] or away * raw < 0.0)


def _turns_back(family: Family, point: Point[Equilibrium]) -> bool:
    """Whether the extrapolated curve has a fold beside a state, but not the state's gamma."""
    here = family.matched(point.solution)
    return here is not None and sought(family, point.solution, here, _FOLD) is not None


def _folds_at(corrections: Corrections, k: int, place: Place) -> bool:
    """Whether gamma rises beyond a state by less than its error: by gamma'^2 / (2 |gamma''|)."""
    rate = float(romberg(place.table)[-1][RATE + GAMMA])
    bend = float(romberg(place.bend)[-1][GAMMA])
    error = corrections.errors(k, np.eye(1, 2 * RATE), alone=bool(corrections.exact[k]))
    return bend < 0.0 and rate**2 <= -2.0 * bend * float(error[GAMMA])
