"""States of rest on a path, M = 0, each solved for as an equilibrium: none is interpolated.

Limits of the moment are states of the path, so that M is monotonic between neighbours and one that
changes its sign there has one root.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from der.continuation.events import Visit, Wanted, visit
from der.continuation.roots import find_root
from der.continuation.step import Step, Tally
from der.rod.equilibrium import Equilibrium, dot
from der.rod.gripped_ring import Sector

_NO_MOMENT = 1e-8  # of the largest |M|: rounding, at the flat and the folded ring


def with_rests(
    piece: Sector, wanted: Wanted, visits: Sequence[Visit], tally: Tally
) -> tuple[list[Visit], list[int]]:
    """The states of a path with those of rest put in, and the positions of these.

    Raises
    ------
    Stuck
        Where an equilibrium cannot be solved for within a step of the path.
    """
    rounding = _NO_MOMENT * max((abs(one.at.moment) for one in visits), default=0.0)
    line: list[Visit] = []
    rests: list[int] = []
    for one in visits:
        here = _is_at_rest(one, rounding)
        if line and not here and (not rests or rests[-1] != len(line) - 1):
            before = line[-1].at
            if before.moment * one.at.moment < 0.0:
                rests.append(len(line))
                line.append(
                    visit(piece, wanted, without_moment(piece, wanted, tally, before, one.at))
                )
        if here:
            rests.append(len(line))
        line.append(one)
    return line, rests


def _is_at_rest(one: Visit, rounding: float) -> bool:
    """Whether a state is the flat or the folded ring, where no moment is left but rounding."""
    return one.at.state.load in (0.0, math.pi) and abs(one.at.moment) <= rounding


def without_moment(
    piece: Sector, wanted: Wanted, tally: Tally, a: Equilibrium, b: Equilibrium
) -> Equilibrium:
    """The equilibrium with M = 0 between two neighbouring states of a path.

    Raises
    ------
    Stuck
        Where it cannot be solved for.
    """
    step = Step(piece, a, b, 1.0, wanted.tolerance, tally)
    step = replace(step, length=dot(piece.body, a.tangent, step.jump))
    return step.at(find_root(lambda s: step.at(s).moment, 0.0, step.length))
