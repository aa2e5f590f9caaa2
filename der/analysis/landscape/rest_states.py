"""Equilibria without load on a path, M = 0. All are solved for, none is interpolated.

Limits of the moment are points of the path, so M is monotonic between neighbours: where it changes
sign there is one root.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from der.analysis.request import Request
from der.continuation.roots import find_root
from der.continuation.step import between
from der.problem import Point, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.system import RodSystem

_NO_MOMENT = 1e-8  # of the largest |M|: rounding, at the flat and the folded ring


def with_rests(
    ring: GrippedRing,
    request: Request,
    points: Sequence[Point[Equilibrium]],
    statistics: Statistics,
) -> tuple[list[Point[Equilibrium]], list[int]]:
    """Return the points of a path together with those at M = 0, and the positions of the latter.

    Raises
    ------
    ContinuationFailed
        If an equilibrium cannot be solved for within a step of the path.
    """
    rounding = _NO_MOMENT * max((abs(one.solution.moment) for one in points), default=0.0)
    line: list[Point[Equilibrium]] = []
    rests: list[int] = []
    for one in points:
        here = _without_load(one, rounding)
        if line and not here and (not rests or rests[-1] != len(line) - 1):
            before = line[-1].solution
            if before.moment * one.solution.moment < 0.0:
                rests.append(len(line))
                at = without_moment(ring, before, one.solution, request.tolerance, statistics)
                line.append(request.point(ring, at))
        if here:
            rests.append(len(line))
        line.append(one)
    return line, rests


def _without_load(one: Point[Equilibrium], rounding: float) -> bool:
    """Whether a point is the flat or the folded ring, whose moment is 0 to rounding."""
    return one.solution.parameter in (0.0, math.pi) and abs(one.solution.moment) <= rounding


def without_moment(
    system: RodSystem, a: Equilibrium, b: Equilibrium, tolerance: float, statistics: Statistics
) -> Equilibrium:
    """Return the equilibrium with M = 0 between two neighbouring states of a path.

    Raises
    ------
    ContinuationFailed
        If it cannot be solved for.
    """
    step = between(system, a, b, tolerance=tolerance, statistics=statistics)

    def moment(s: float) -> float:
        return step.at(s).observables["moment"][0]

    return step.at(find_root(moment, 0.0, step.length))  # type: ignore[return-value]
