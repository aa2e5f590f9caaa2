"""What is looked for on a boundary-value path, and the points that are handed out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from der import problem
from der.bvp.collocation import Error, Solution
from der.bvp.gauss import Array
from der.bvp.step import Step
from der.continuation import events


class Point(NamedTuple):
    """A point on the path, as it is handed out."""

    solution: Solution
    error: Error
    kind: str = ""  # "", "fold" or "limit"


@dataclass(frozen=True)
class Wanted:
    """What is looked for on a path, and where it stops."""

    gamma_max: float = math.pi
    until: Callable[[Solution], bool] | None = None  # end at a state at gamma = pi
    targets: tuple[float, ...] | None = None  # gammas to solve at; None: multiples of pi/8
    tolerance: float = 1e-8  # of gamma/pi, M and U, relative to their largest

    @cached_property
    def stops(self) -> Array:
        """Values of gamma where the path may end."""
        return np.array([-self.gamma_max, self.gamma_max] + [math.pi] * (self.until is not None))

    @cached_property
    def events(self) -> events.Events[Solution]:
        """What continuation has to look for."""
        return events.Events(
            targets=(*(self.targets or ()), math.pi, self.gamma_max, -self.gamma_max),
            spacing=math.pi / 8.0 if self.targets is None else 0.0,
            stop=self._ends,
            limits=("moment",),
        )

    def _ends(self, at: Any) -> bool:
        """Whether the path ends at a solution, also one that has turned back for good."""
        if abs(at.gamma) == self.gamma_max:
            return True
        return self.until is not None and at.gamma == math.pi and self.until(at)


def located(wanted: Wanted, step: Step, end: Point) -> tuple[list[Point], bool]:
    """Points after the start up to the end of ``step``, and whether the path ends there."""
    found, ended = events.located(wanted.events, step, problem.Point(step.start))

    def error(at: Solution) -> Error:
        return end.error if at is step.end else step.system.error(at)

    return [Point(p.solution, error(p.solution), p.kind) for p in found], ended
