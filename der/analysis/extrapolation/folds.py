"""States asked for that lie between a fold on N edges and the extrapolated fold.

                      . . . .           . extrapolated
    gamma asked   ---o-------o---       o its states, of which N edges have none
                    . * * * * .         * on N edges
                   . *       * .

If the extrapolated fold lies further out, the curve reaches values of gamma that N edges do not
reach, each twice. If it lies further in, some values are no longer reached. The record has the
states of the extrapolated curve.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

import numpy as np

from der.analysis.extrapolation.curve import FARTHEST, GAMMA, Family, Place, SoughtPoint, placed
from der.analysis.request import Request
from der.continuation.richardson import romberg
from der.kernels.quaternions import Array
from der.problem import Point
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing


def arc_lengths(ring: GrippedRing, points: Sequence[Point[Equilibrium]]) -> Array:
    """Distances (n,) of the points from the first, along chords, in the norm of the path."""
    steps = [0.0] * bool(points)
    for a, b in pairwise(one.solution.state for one in points):
        jump = ring.difference(a, b)
        steps.append(math.sqrt(ring.inner(jump, jump)))
    return np.cumsum(steps)


def all_asked(
    family: Family, request: Request, points: Sequence[Point[Equilibrium]], asked: Collection[float]
) -> list[Point[Equilibrium]]:
    """Return the points in path order, with those added and removed that moved folds pass.

    Parameters
    ----------
    points : the path on the finest mesh, from `Request.follow`.
    asked : values of gamma that states were solved for [rad]. The ends of a path, and pi, are
        left unchanged.
    """
    asked = [load for load in asked if abs(load) not in (math.pi, request.gamma_max)]
    lengths = arc_lengths(family.rings[0], points).tolist()
    line = dict(enumerate(zip(lengths, points, strict=True)))
    folds = [k for k, one in enumerate(points) if one.kind == "fold"]
    for before, k, after in zip([-1, *folds], folds, [*folds[1:], len(points)], strict=False):
        (place,) = placed(family, [points[k]], asked)
        if place is None:
            continue
        bend = float(romberg(place.bend[:, GAMMA])[-1])
        old, new = points[k].solution.parameter, float(place.values[GAMMA])
        passed = [load for load in asked if min(old, new) < load < max(old, new)]
        if (new - old) * bend < 0.0:
            for load in passed:
                for s, one in _reached(family, request, points[k], place, bend, load):
                    line[len(line)] = (lengths[k] + s, one)
            continue
        for j in range(before + 1, after):
            if points[j].kind == "" and points[j].solution.parameter in passed:
                del line[j]
    return [one for _, one in sorted(line.values(), key=lambda entry: entry[0])]


def _reached(
    family: Family,
    request: Request,
    fold: Point[Equilibrium],
    place: Place,
    bend: float,
    load: float,
) -> Iterator[tuple[float, Point[Equilibrium]]]:
    """Distances from a fold, and states on N edges, of the two at ``load`` beside the moved fold.

    ``bend`` is d2gamma/ds2 of the extrapolated curve there; a state is left out if a mesh has none.
    """
    away = math.sqrt(2.0 * (load - float(place.values[GAMMA])) / bend)
    for side in (-1.0, 1.0):
        s = place.s + side * away
        at = family.beside(fold.solution, s) if abs(s) < FARTHEST else None
        if at is not None:
            regular = request.point(family.rings[0], at)
            found = SoughtPoint(
                at, "", regular.index, regular.stiffness, sought=(load, side * bend)
            )
            (there,) = placed(family, [found], ())
            if there is not None:
                yield s, found
