"""The same state on three meshes, and its place on the extrapolated curve.

Frames are at the same material points at every resolution, so every second (fourth) frame of a
state on N edges is almost a state on N/2 (N/4) edges. Newton's method solves for it in two or three
iterations, also at folds, if its corrections stay in the plane normal to the path of N edges:

    N      ----o---->  tangent        the three states of a plane are *matched*: gamma, M, U and
    N/2    ....|.....                 their rates along the tangent have errors in even powers
    N/4    ....|.....                 of h, h^2 first

A gamma that was asked for, a fold or a limit of the extrapolated curve is a root along the path of
N edges.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from der.analysis.extrapolation.mesh_transfer import Restricted, restricted
from der.continuation.richardson import romberg
from der.kernels.quaternions import Array
from der.problem import PLANE, Point
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing

LEVELS = 3
GAMMA, MOMENT, ENERGY = 0, 1, 2  # columns of a table of values
RATE = 3  # added to these: columns of the rates along the path

_PROBE = 1e-3  # of s: the first step towards a fold or limit, whose second derivative is not known
_SMALL = 1e-6  # of s: after so small a step linear prediction is exact to its square
FARTHEST = 0.3  # of s: about two steps of the path; the root is at a distance of order h^2
_MOST = 12  # steps of the secant method


class Matched(NamedTuple):
    """Three matched states."""

    table: Array  # (LEVELS, 6) gamma, M, U and their rates per s, finest level first
    residual: float  # the largest of the three
    coarse: Restricted | None = None  # where those of the coarser meshes lie


@dataclass(frozen=True)
class Family:
    """The curves of equilibria on three meshes, matched along the finest."""

    rings: tuple[GrippedRing, ...]
    tolerance: float

    def values(self, level: int, at: Equilibrium) -> tuple[float, float, float]:
        """Return gamma [rad], M of one arm [GJ/a] and U of the full ring [GJ/a]."""
        return self.rings[level].values(at)

    def matched(self, fine: Equilibrium, near: Restricted | None = None) -> Matched | None:
        """The states matched to one on the finest mesh; None: a level has none.

        ``near`` : those of a state nearby, to start from.
        """
        found = restricted(self.rings, fine, near, self.tolerance)
        if found is None:
            return None
        states = [(fine, 1.0, 0.0), *((x.solution, x.speed, x.beyond) for x in found)]
        table = np.array([self._line(level, *state) for level, state in enumerate(states)])
        return Matched(table, max(at.residual for at, _, _ in states), found)

    def _line(self, level: int, at: Equilibrium, speed: float, beyond: float) -> list[float]:
        """Values and rates at a level; ``speed`` turns the unit tangent to a rate per s.

        The values are those in the plane, at the distance ``beyond`` before the state.
        """
        values = self.values(level, at)
        gamma_rate = speed * at.parameter_rate
        moment_rate = speed * self.rings[level].arm_moment(at.moment_rate)
        rates = (gamma_rate, moment_rate, 4.0 * values[MOMENT] * gamma_rate)
        return [v - beyond * r for v, r in zip(values, rates, strict=True)] + list(rates)

    def near(self, base: Equilibrium, s: float, here: Restricted | None = None) -> Matched | None:
        """The matched states at the distance ``s`` along the path of the finest mesh.

        ``here`` : those of the coarser meshes at ``base``, or near it, to start from.
        """
        at = self.beside(base, s)
        return None if at is None else self.matched(at, here)

    def beside(self, base: Equilibrium, s: float) -> Equilibrium | None:
        """The state on the finest mesh at the distance ``s`` from another; None without one."""
        ring, t = self.rings[0], base.tangent
        start = ring.retract(base.state, s * t)
        at = ring.correct(start, along=t, hold=PLANE, tolerance=self.tolerance)
        return at if at.converged else None


@dataclass(frozen=True)
class SoughtPoint(Point[Equilibrium]):
    """A point that stands for a gamma on the extrapolated curve, on one side of a fold of it."""

    sought: tuple[float, float] = (0.0, 0.0)  # that gamma, and the sign of dgamma/ds there


@dataclass(frozen=True)
class Place:
    """A state of the extrapolated curve, and its sensitivity to errors of the curve.

    Notes
    -----
    The state is a root of F(s), a column of the table less a constant. If the curve has an error
    c(s), the root has the error ds = -c_F/F', and the values there c + rates ds.
    """

    s: float  # distance from the point along the path
    table: Array  # (LEVELS, 6)
    residual: float
    values: Array  # (3,) gamma, M, U
    spread: Array  # (3, 6) error of values = spread . correction of the table's columns
    bend: Array  # (LEVELS, 3) d rates/ds; zero if the state is no root
    fixed: bool  # whether its place on the path is significant
    sought: bool = True  # whether it is a place of the extrapolated curve; else of N edges
    own: Array | None = None  # (LEVELS, 3) values of a point located on each mesh by itself
    unsure: Array | float = 0.0  # (3,) errors of these by other causes than the meshes


class Goal(NamedTuple):
    """The condition of a root on the extrapolated curve."""

    column: int  # of the table
    value: float
    direction: float  # for a root in gamma: sign of dgamma/ds on this side of a fold


def _goal(point: Point[Equilibrium], asked: Collection[float]) -> Goal | None:
    """The condition that defines a point; None: it is any point of the curve."""
    load = point.solution.parameter
    if isinstance(point, SoughtPoint):
        return Goal(GAMMA, *point.sought)
    if point.kind == "fold":
        return Goal(RATE + GAMMA, 0.0, 0.0)
    if point.kind == "limit":
        return Goal(RATE + MOMENT, 0.0, 0.0)
    if point.kind == "" and load in asked:
        return Goal(GAMMA, load, point.solution.parameter_rate)
    return None


def placed(
    family: Family, points: Sequence[Point[Equilibrium]], asked: Collection[float]
) -> Iterator[Place | None]:
    """Yield the places of points on the extrapolated curve; None: a level has no state."""
    near = None
    for point in points:
        here = family.matched(point.solution, near)
        yield None if here is None else _placed(family, point, here, asked)
        near = None if here is None else here.coarse


def _placed(
    family: Family, point: Point[Equilibrium], here: Matched, asked: Collection[float]
) -> Place | None:
    """The place of a point, to which ``here`` is matched."""
    goal = _goal(point, asked)
    if goal is not None:
        return sought(family, point.solution, here, goal)
    values, bend = romberg(here.table)[-1][:RATE], np.zeros((LEVELS, RATE))
    marked = point.kind != ""
    return Place(0.0, here.table, here.residual, values, np.eye(RATE, 6), bend, marked, not marked)


def sought(family: Family, base: Equilibrium, here: Matched, goal: Goal) -> Place | None:
    """The place of a goal, by the secant method from ``base``, to which ``here`` is matched."""
    s, now, bend = 0.0, romberg(here.table)[-1], np.zeros((LEVELS, RATE))
    slope = float(now[RATE + goal.column]) if goal.column < RATE else 0.0
    for _ in range(_MOST):
        step = (goal.value - float(now[goal.column])) / slope if slope else _PROBE
        if slope and abs(step) <= _SMALL:
            return _found(goal, s + step, _advanced(here, step, bend), slope, bend)
        s += step
        new = family.near(base, s, here.coarse) if abs(s) < FARTHEST else None
        if new is None:
            return None
        bend = (new.table[:, RATE:] - here.table[:, RATE:]) / step
        after = romberg(new.table)[-1]
        slope = float(after[goal.column] - now[goal.column]) / step
        here, now = new, after
    return None


def _advanced(here: Matched, step: float, bend: Array) -> Matched:
    """Matched states one small ``step`` further, where the rates change by ``bend`` per s."""
    table = here.table.copy()
    table[:, :RATE] += step * table[:, RATE:]
    table[:, RATE:] += step * bend
    return here._replace(table=table)


def _found(goal: Goal, s: float, here: Matched, slope: float, bend: Array) -> Place | None:
    """The place of a goal; None for a gamma that lies beyond a fold of the extrapolated curve.

    ``slope`` is the rate of the goal's column along s.
    """
    line, spread = romberg(here.table)[-1], np.eye(RATE, 6)
    if goal.column == GAMMA:
        slope = float(line[RATE])
        if slope * goal.direction <= 0.0:
            return None
        line[GAMMA] = goal.value
    spread[:, goal.column] -= line[RATE:] / slope
    if goal.column == GAMMA:
        spread[GAMMA] = 0.0  # given, to the last digit
    return Place(s, here.table, here.residual, line[:RATE], spread, bend, fixed=True)
