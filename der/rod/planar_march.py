"""Equilibria of a rod in a plane, and the path of them while the load goes to a goal.

Pseudo-arclength: a step goes along the tangent and bends as the last one did, and is corrected
at right angles to it, so that folds are no obstacle. Special points are roots along the chord of
one step: a fold where the load turns back, a limit where what does work on it does, a branch point
where the index changes without either.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from der.continuation.roots import find_root
from der.kernels.planar import (
    BENT,
    CONVERGED,
    DIVERGED,
    SINGULAR,
    TOO_MANY,
    Array,
    PlanarRod,
    correct_planar,
)

FOLD, LIMIT, BRANCH = "fold", "limit", "branch"
WHY = {
    CONVERGED: "converged",
    TOO_MANY: "Newton's method did not converge",
    DIVERGED: "Newton's method left the neighbourhood of its start",
    BENT: "the ring turns by more than 160 degrees between two edges; use more edges",
    SINGULAR: "the tangent matrix is singular to the last digit",
}
_ITERATIONS = 12
_FIRST, _LONGEST, _SHORTEST = 0.02, 0.08, 1e-7  # lengths of steps
_EASY = 4  # iterations of a step after which the next is longer
_TURNED = 0.9  # cosine between the tangents at the two ends of a step that is not repeated
_MOST_STEPS = 2000
_ROOT = 1e-10  # of a step, where a special point is


@dataclass(frozen=True, eq=False)
class Solved:
    """An equilibrium, or, where ``outcome`` is not CONVERGED, the last iterate."""

    outcome: int
    iterations: int
    residual: float
    phi: Array  # (n,) rad
    force: Array  # (m,) multipliers
    load: float
    energy: float
    moment: float  # dL/dload, which does work on the load
    phi_rate: Array  # (n,) of the tangent, of unit length
    force_rate: Array  # (m,)
    load_rate: float
    moment_rate: float
    negative: int  # negative eigenvalues of the bordered Hessian; -1: not known
    bent: int

    @property
    def converged(self) -> bool:
        """Whether it is an equilibrium."""
        return self.outcome == CONVERGED

    @property
    def index(self) -> int | None:
        """Ways down in the plane, the load held; None: not known."""
        return None if self.negative < 0 else self.negative - len(self.force)


@dataclass(frozen=True, eq=False)
class Stop:
    """A state on the path, and what is special about it; at a branch point its tangent is any."""

    at: Solved
    kind: str = ""  # "fold", "limit", "branch"
    before: int | None = None  # index before a special point
    after: int | None = None


class Lost(RuntimeError):
    """The path could not be followed any further."""


def solved(
    rod: PlanarRod,
    phi: Array,
    force: Array,
    load: float = 0.0,
    *,
    along: tuple[Array, float] | None = None,
    pin: Array | None = None,
    tolerance: float = 1e-10,
) -> Solved:
    """The equilibrium next to a configuration, by Newton's method.

    Parameters
    ----------
    along : direction (angles (n,), load) to which corrections stay orthogonal; None: the load is
        given, and the tangent points to larger ones.
    pin : (n,) direction in which nothing is corrected: a motion that costs nothing.
    """
    n = len(rod.length)
    row, row_load = (np.zeros((n, 1)), 1.0) if along is None else (_row(rod, along[0]), along[1])
    pins = np.zeros((n, 1, 0)) if pin is None else pin[:, None, None]
    found = list(
        correct_planar(
            rod, phi, force, load, along is not None, row, row_load, pins, tolerance, _ITERATIONS
        )
    )
    found[8], found[9] = found[8][:, 0, 0], found[9][: len(force), 0]
    return Solved(*found)


def _row(rod: PlanarRod, direction: Array) -> Array:
    """A direction weighted by the lengths of the edges, without held ones (n, 1)."""
    return np.where(rod.free, rod.mass * direction, 0.0)[:, None]


def march(
    rod: PlanarRod,
    start: Solved,
    goal: float,
    *,
    pin: Array | None = None,
    special: bool = False,
    tolerance: float = 1e-10,
) -> Iterator[Stop]:
    """States on the path from ``start`` until its load is first at ``goal``.

    Parameters
    ----------
    special : whether special points are looked for; they come in their place.

    Raises
    ------
    Lost
        Where the path cannot be followed; states up to there were handed over.
    """
    sense = math.copysign(1.0, goal - start.load) * math.copysign(1.0, start.load_rate)
    here, last, length = _turned(start, sense), None, _FIRST
    yield Stop(here)
    for _ in range(_MOST_STEPS):
        there = _step(rod, here, last, length, pin, tolerance)
        if not there.converged or _cosine(rod, here, there) < _TURNED:
            length *= 0.5
            if length < _SHORTEST:
                raise Lost(f"{WHY[there.outcome]} at {here.load:.8g}")
            continue
        if (there.load - goal) * (here.load - goal) <= 0.0:
            end = _at_goal(rod, here, there, goal, pin, tolerance)
            if end is not None:
                if special:
                    yield from _between(rod, here, end, pin, tolerance)
                yield Stop(end)
                return
            length *= 0.5
            continue
        if special:
            yield from _between(rod, here, there, pin, tolerance)
        yield Stop(there)
        last, here = (here, length), there
        if there.iterations <= _EASY:
            length = min(1.4 * length, _LONGEST)
        elif there.iterations > 2 * _EASY:
            length *= 0.5
    raise Lost(f"the path did not get there in {_MOST_STEPS} steps, at {here.load:.8g}")


def _turned(at: Solved, sense: float) -> Solved:
    """A state with its tangent forward (1) or backward (-1)."""
    entries = dict(vars(at))
    for name in ("phi_rate", "force_rate", "load_rate", "moment_rate"):
        entries[name] = sense * entries[name]
    return Solved(**entries)


def _step(
    rod: PlanarRod,
    here: Solved,
    last: tuple[Solved, float] | None,
    length: float,
    pin: Array | None,
    tolerance: float,
) -> Solved:
    """The state a step further, which bends as the last one did."""
    bend = (0.0 * here.phi, 0.0 * here.force, 0.0)
    if last is not None:
        before, step = last
        half = 0.5 * length * length / step
        bend = (
            half * (here.phi_rate - before.phi_rate),
            half * (here.force_rate - before.force_rate),
            half * (here.load_rate - before.load_rate),
        )
    return solved(
        rod,
        here.phi + length * here.phi_rate + bend[0],
        here.force + length * here.force_rate + bend[1],
        here.load + length * here.load_rate + bend[2],
        along=(here.phi_rate, here.load_rate),
        pin=pin,
        tolerance=tolerance,
    )


def _cosine(rod: PlanarRod, a: Solved, b: Solved) -> float:
    """Of the angle between two tangents."""
    return float(np.sum(rod.mass * a.phi_rate * b.phi_rate)) + a.load_rate * b.load_rate


def _at_goal(
    rod: PlanarRod, a: Solved, b: Solved, goal: float, pin: Array | None, tolerance: float
) -> Solved | None:
    """The state between two at which the load is at the goal; None: not reached."""
    share = (goal - a.load) / (b.load - a.load) if b.load != a.load else 1.0
    held = rod
    if goal == 0.0 and rod.reach.any():  # a strut of no length has no direction
        held = rod._replace(free=rod.free & (rod.reach == 0.0))
    end = solved(held, *_chord(a, b, share)[:2], goal, pin=pin, tolerance=tolerance)
    if not end.converged or _cosine(rod, a, b) <= 0.0:
        return None
    return _turned(end, math.copysign(1.0, _cosine(rod, a, end) or 1.0))


def _chord(a: Solved, b: Solved, share: float) -> tuple[Array, Array, float]:
    """Angles, forces and load a share of the way from a state to the next, on a straight line."""
    return (
        a.phi + share * (b.phi - a.phi),
        a.force + share * (b.force - a.force),
        a.load + share * (b.load - a.load),
    )


# --- Special points --------------------------------------------------------------------------


def _between(
    rod: PlanarRod, a: Solved, b: Solved, pin: Array | None, tolerance: float
) -> Iterator[Stop]:
    """Special points between two states, in their order."""

    def at(share: float) -> Solved:
        found = solved(
            rod,
            *_chord(a, b, share),
            along=(b.phi - a.phi, b.load - a.load),
            pin=pin,
            tolerance=tolerance,
        )
        return found

    found: list[tuple[float, Stop]] = []
    folds = a.load_rate * b.load_rate < 0.0
    if folds:
        share = _root(lambda s: at(s).load_rate, a.load_rate, b.load_rate)
        found.append((share, Stop(at(share), FOLD, a.index, b.index)))
    if a.moment_rate * b.moment_rate < 0.0:
        share = _root(lambda s: at(s).moment_rate, a.moment_rate, b.moment_rate)
        found.append((share, Stop(at(share), LIMIT, a.index, b.index)))
    if a.index is not None and b.index is not None and not folds and a.index != b.index:
        share = _change(at, a.index)
        found.append((share, Stop(at(share), BRANCH, a.index, b.index)))
    yield from (one for _, one in sorted(found, key=lambda one: one[0]) if one.at.converged)


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    """Share of the chord at which ``f`` is zero; its values at the ends are known."""
    ends = {0.0: low, 1.0: high}
    return find_root(lambda s: ends[s] if s in ends else f(s), 0.0, 1.0, _ROOT)


def _change(at: Callable[[float], Solved], before: int) -> float:
    """Share of the chord at which the index ceases to be ``before``, by bisection."""
    low, high = 0.0, 1.0
    while high - low > _ROOT:
        middle = 0.5 * (low + high)
        one = at(middle)
        if not one.converged:
            break  # as singular as it gets
        low, high = (middle, high) if one.index == before else (low, middle)
    return high


def kinds(stops: Sequence[Stop]) -> list[str]:
    """What is special on a path, in its order."""
    return [one.kind for one in stops if one.kind]
