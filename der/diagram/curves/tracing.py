"""Following the curve on which a function of two parameters vanishes, across the unit square.

Predictor along the tangent, corrector along the gradient; the function carries a state of its own
from point to point (`conditions`). Where the curve turns back in one of the parameters nothing
special happens. It ends at the edges of the square, where it closes, or where the function is lost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from der.bvp.gauss import Array
from der.diagram.curves.conditions import NotFound
from der.errors import ContinuationFailed

T = TypeVar("T")
Function = Callable[[Array, T], tuple[float, T]]

LARGEST, SMALLEST = 0.04, 2e-6  # steps, of the square's side
DIFFERENCE = 1e-5  # for the gradient
EXACT = 1e-9  # distance from the curve, of the square's side
SHARPEST = 0.35  # rad, between tangents of neighbouring points
BENT = (
    0.05  # of the change of a state between neighbours: midway, what it is off their mean at most
)
STILL = 1e-3  # of a state: a change that is not looked at
MOST = 2000


class At(NamedTuple, Generic[T]):
    """A point of the curve."""

    u: Array  # (2,) in the unit square
    state: T
    distance: float  # from the curve, estimated: |f|/|grad f|
    gradient: Array  # (2,) of f


def corrected(f: Function[T], u: Array, state: T, *, near: float = 0.1) -> At[T]:
    """The point of the curve near ``u``, along the gradient.

    Raises
    ------
    ContinuationFailed
        Where there is none within ``near``, or f cannot be evaluated.
    """
    start = u
    value, state = f(u, state)
    gradient = _gradient(f, u, value, state)
    for _ in range(12):
        square = float(gradient @ gradient)
        if not square > 0.0:
            raise NotFound("the condition does not depend on the parameters")
        change = -value * gradient / square
        size = float(np.linalg.norm(change))
        if size < EXACT:
            return At(u, state, size, gradient)
        if np.linalg.norm(u + change - start) > near:
            raise NotFound("no point of the curve nearby")
        before = value
        u = u + change
        value, state = f(u, state)
        # secant update along the last change (Broyden)
        gradient = gradient + (value - before - gradient @ change) / (size * size) * change
    raise NotFound("no point of the curve found")


def by_differences(
    f: Callable[[Array], Array | float],
    u: Array,
    value: Array | float,
    size: Array | float = DIFFERENCE,
) -> Array:
    """Derivatives of ``f`` by ``u``, its last dimension, from differences towards the middle."""
    steps = np.diag(np.where(u < 0.5, size, -size))
    return np.array([(f(u + step) - value) / step.sum() for step in steps]).T


def _gradient(f: Function[T], u: Array, value: float, state: T) -> Array:
    return by_differences(lambda u: f(u, state)[0], u, value)


@dataclass(frozen=True)
class States(Generic[T]):
    """How states are carried along a curve.

    Parameters
    ----------
    fresh : called with the state of every point; returns it, or a better one to continue with
    numbers : the numbers of a state, which change smoothly along a curve
    """

    fresh: Callable[[T], T] = lambda state: state
    numbers: Callable[[T], Array] = lambda state: np.empty(0)


def trace(f: Function[T], u: Array, state: T, *, states: States[T] | None = None) -> list[At[T]]:
    """The curve through (or near) ``u``, from one end to the other.

    Parameters
    ----------
    f : value and state at a place, from a state nearby.
    states : how states are carried along; None: as they are

    Raises
    ------
    ContinuationFailed
        Where there is no point of the curve near ``u``.
    """
    states = states or States()
    first = corrected(f, np.asarray(u, dtype=float), states.fresh(state))
    gradient = first.gradient
    ahead, closed = _half(f, states, first, np.array([-gradient[1], gradient[0]]))
    if closed:
        return [first, *ahead]
    behind, _ = _half(f, states, first, np.array([gradient[1], -gradient[0]]))
    return [*reversed(behind), first, *ahead]


def _half(
    f: Function[T], states: States[T], first: At[T], direction: Array
) -> tuple[list[At[T]], bool]:
    """The curve from a point on in one direction, and whether it came back to it."""
    found: list[At[T]] = []
    here, tangent = first, direction / np.linalg.norm(direction)
    step = 0.25 * LARGEST
    while len(found) < MOST and step >= SMALLEST:
        u = here.u + step * tangent
        if _outside(u):
            if end := _at_edge(f, here, u):
                found.append(end)
                return found, False
            step *= 0.5
            continue
        try:
            new = corrected(f, u, here.state, near=0.7 * step)
        except ContinuationFailed:
            step *= 0.5
            continue
        way = np.array([-new.gradient[1], new.gradient[0]]) / np.linalg.norm(new.gradient)
        if way @ tangent < 0.0:
            way = -way
        angle = float(np.arccos(np.clip(way @ tangent, -1.0, 1.0)))
        if (
            angle > SHARPEST
            or (new.u - here.u) @ tangent <= 0.0
            or not _smooth(f, states, here, new)
        ):
            step *= 0.5
            continue
        if _outside(new.u):
            if end := _at_edge(f, here, new.u):
                found.append(end)
            return found, False
        found.append(new)
        if len(found) > 3 and np.linalg.norm(new.u - first.u) < 0.75 * step:
            return found, True
        here, tangent = new._replace(state=states.fresh(new.state)), way
        step = min(step * (1.3 if angle < 0.5 * SHARPEST else 0.8), LARGEST)
    return found, False


def _smooth(f: Function[T], states: States[T], here: At[T], new: At[T]) -> bool:
    """Whether the state midway is between those of two points: else they are on two curves."""
    a, b = states.numbers(here.state), states.numbers(new.state)
    change = float(np.linalg.norm(b - a))
    if change <= STILL * (1.0 + float(np.linalg.norm(a))):
        return True
    try:
        _, state = f(0.5 * (here.u + new.u), here.state)
    except ContinuationFailed:
        return False
    return float(np.linalg.norm(states.numbers(state) - 0.5 * (a + b))) <= BENT * change


def _outside(u: Array) -> bool:
    """Whether a place is not in the square."""
    return bool(((u < 0.0) | (u > 1.0)).any())


def _at_edge(f: Function[T], inside: At[T], outside: Array) -> At[T] | None:
    """The point where the curve first crosses the edge of the square; None where none is near."""
    way = outside - inside.u
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(way > 0.0, (1.0 - inside.u) / way, -inside.u / way)
    reach[way == 0.0] = np.inf
    k = int(np.argmin(reach))
    if not 0.0 < reach[k] <= 1.0:
        return None
    other = 1 - k
    u = inside.u + reach[k] * way
    u[k] = round(float(u[k]))
    start, farthest = u[other], float(np.linalg.norm(way))
    state, h = inside.state, 1e-4 if u[other] < 0.5 else -1e-4
    try:
        value, state = f(u, state)
        for _ in range(12):
            if abs(h) < EXACT:
                return At(u, state, abs(h), _gradient(f, u, value, state))
            ahead = u.copy()
            ahead[other] += h
            after, state = f(ahead, state)
            if after == value:
                break
            h = -after * h / (after - value)
            u, value = ahead, after
            if not abs(u[other] + h - start) <= farthest or _outside(u):
                break
    except ContinuationFailed:
        pass
    return None
