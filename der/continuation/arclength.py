"""Following a path of equilibria through its folds, by pseudo-arclength (Riks, Keller).

The norm is mass-weighted, of rotation vectors and load, and does not depend on the mesh. The
predictor is the cubic through the last two states (`Step.beyond`); steps are as long as the angle
between tangents allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from der.continuation.events import Visit, Wanted, special_points, visit
from der.continuation.step import Step, Stuck, Tally
from der.rod.equilibrium import (
    ADVICE,
    Control,
    Direction,
    Equilibrium,
    dot,
    equilibrium,
    moved,
)
from der.rod.gripped_ring import Sector

FIRST_STEP = 0.05
LARGEST_STEP = 0.6
SMALLEST_STEP = 1e-7
_ANGLE = 0.12  # rad, aimed at between tangents of neighbouring states
_SHARPEST = 0.6  # rad, a step that turns more is repeated shorter
_STRAIGHT = 0.01  # bulge of a step that is believed although its ends are oriented unequally


def follow(piece: Sector, wanted: Wanted, tally: Tally) -> Iterator[Visit]:
    """Hand out the states of the path from the flat ring on, special points in their places.

    ``tally`` is counted up on the way.

    Raises
    ------
    Stuck
        Where the path cannot be continued, after all that was found has been handed out.
    """
    at = equilibrium(piece.body, piece.held, piece.start, tolerance=wanted.tolerance)
    tally.newton_iterations += at.iterations
    if not at.converged:
        raise Stuck(f"the flat ring is no equilibrium: {ADVICE[at.outcome]}")
    here = visit(piece, wanted, at)
    yield here
    before: Step | None = None
    length = FIRST_STEP
    while True:
        if tally.steps >= wanted.most_steps:
            raise Stuck(f"the path has not ended after {tally.steps} steps")
        step = _advance(piece, wanted, tally, here.at, before, length)
        try:
            found, ended = special_points(piece, wanted, step, here)
        except Stuck:
            # both ends are equilibria, but not of one smooth curve: look again from closer
            if step.length < 4.0 * SMALLEST_STEP:
                raise
            length = 0.25 * step.length
            continue
        tally.steps += 1
        before = step
        angle = _between(piece, here.at, step.end)
        yield from found
        here = found[-1]
        if ended:
            return
        ease = math.sqrt(wanted.stride * _ANGLE / max(angle, 1e-3))
        if step.end.iterations > 4:
            ease = min(ease, 0.7)
        length = min(step.length * min(max(ease, 0.5), 2.0), LARGEST_STEP)


def _between(piece: Sector, a: Equilibrium, b: Equilibrium) -> float:
    """Angle between the tangents at two states [rad]."""
    return math.acos(min(1.0, max(-1.0, dot(piece.body, a.tangent, b.tangent))))


def _one_way(at: Equilibrium) -> bool:
    """Orientation of a path: a fold changes the sign of dgamma/ds and the index, and so keeps it.

    The determinant of the augmented matrix does not vanish along a path but where another
    branches off (Keller); two states of unequal sign otherwise lie on two strands of it.
    """
    return (at.negative % 2 == 0) == (at.tangent.load > 0.0)


def _advance(
    piece: Sector,
    wanted: Wanted,
    tally: Tally,
    start: Equilibrium,
    before: Step | None,
    length: float,
) -> Step:
    """One accepted step of about ``length``, shortened until Newton's method follows."""
    t = start.tangent
    reason = ""
    length = max(length, 2.0 * SMALLEST_STEP)
    while length > SMALLEST_STEP:
        if before is None:
            guess = Direction(length * t.q, length * t.force, length * t.load)
        else:
            guess = before.beyond(length)
        end = equilibrium(
            piece.body,
            piece.held,
            moved(piece.held, start.state, guess),
            along=t,
            control=Control.DIRECTION,
            tolerance=wanted.tolerance,
            iterations=7,
        )
        tally.newton_iterations += end.iterations
        if end.converged and _between(piece, start, end) < _SHARPEST:
            step = Step(piece, start, end, length, wanted.tolerance, tally)
            if _one_way(start) == _one_way(end) or step.bulge < _STRAIGHT:
                return step
        reason = ADVICE[end.outcome] if not end.converged else "the path turns too sharply"
        if end.where >= 0:
            reason = f"vertex {end.where} {reason}"
        length *= 0.5
    raise Stuck(f"no step forward from gamma = {start.state.load:.8f}: {reason}")
