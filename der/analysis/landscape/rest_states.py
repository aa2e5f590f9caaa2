"""States of rest on a path, M = 0, each solved for as an equilibrium: none is interpolated.

Limits of the moment are states of the path, so that M is monotonic between neighbours and one that
changes its sign there has one root.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from der.continuation.events import Point, Wanted, point
from der.continuation.roots import find_root
from der.continuation.step import Step, Statistics
from der.rod.equilibrium import Equilibrium, dot
from der.rod.gripped_ring import GrippedRing

_NO_MOMENT = 1e-8  # of the largest |M|: rounding, at the flat and the folded ring


def with_rests(
    ring: GrippedRing, wanted: Wanted, points: Sequence[Point], statistics: Statistics
) -> tuple[list[Point], list[int]]:
    """The states of a path with those of rest put in, and the positions of these.

    Raises
    ------
    ContinuationFailed
        Where an equilibrium cannot be solved for within a step of the path.
    """
    rounding = _NO_MOMENT * max((abs(one.solution.moment) for one in points), default=0.0)
    line: list[Point] = []
    rests: list[int] = []
    for one in points:
        here = _is_at_rest(one, rounding)
        if line and not here and (not rests or rests[-1] != len(line) - 1):
            before = line[-1].solution
            if before.moment * one.solution.moment < 0.0:
                rests.append(len(line))
                line.append(
                    visit(
                        ring, wanted, without_moment(ring, wanted, statistics, before, one.solution)
                    )
                )
        if here:
            rests.append(len(line))
        line.append(one)
    return line, rests


def _is_at_rest(one: Point, rounding: float) -> bool:
    """Whether a state is the flat or the folded ring, where no moment is left but rounding."""
    return one.solution.parameter in (0.0, math.pi) and abs(one.solution.moment) <= rounding


def without_moment(
    ring: GrippedRing, wanted: Wanted, statistics: Statistics, a: Equilibrium, b: Equilibrium
) -> Equilibrium:
    """The equilibrium with M = 0 between two neighbouring states of a path.

    Raises
    ------
    ContinuationFailed
        Where it cannot be solved for.
    """
    step = Step(ring, a, b, 1.0, wanted.tolerance, statistics)
    step = replace(step, length=ring.inner(a.tangent, step.jump))
    return step.at(find_root(lambda s: step.at(s).moment, 0.0, step.length))
