"""What holds on a boundary between folding modes, as a function of the ring and its section.

    stability     the folded state at gamma = pi has dM/dgamma = 0
    foldability   the fold at which the path turns back lies at gamma = pi
    snap-back     two folds merge: dgamma/ds has an extremum that is zero (a cusp)

Each is the value of a function of two parameters, evaluated by a few corrections from a solution
nearby: no path is followed. Solutions are carried from ring to ring on meshes that scale segment by
segment.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from der.scene import Scene
from validation.collocation import Collocation, Direction, Failure, Solution, collocation
from validation.meshes import fitted, mesh_at
from validation.sectors import sector

ACCURATE = 1e-9  # of gamma/pi and M: beyond, a mesh is fitted again
TIGHT = 1e-11  # increments of a solution from which a condition is judged
PROBE = 1e-3  # of s: first step of a secant
SMALL = 1e-10  # of s: a secant step that has converged
FARTHEST = 0.5  # of s: what lies farther is another state
MOST = 20


class Lost(RuntimeError):
    """A condition that cannot be evaluated: its state has ceased to exist."""


class Value(NamedTuple):
    """A condition at a ring and section."""

    value: float
    at: Solution
    system: Collocation


Condition = Callable[[Scene, Value], Value]


def carried(scene: Scene, seed: Value) -> tuple[Collocation, Solution]:
    """The seed's solution as a guess for another ring, corrected there across its tangent.

    Raises
    ------
    Lost
        Where the rings have other segments, or no solution is near.
    """
    system = collocation(sector(scene))
    old, new = seed.system.sector, system.sector
    if len(old.joints) != len(new.joints):
        raise Lost(f"the ring has {len(new.joints) - 1} segments, not {len(old.joints) - 1}")
    nodes = np.interp(seed.at.mesh.nodes, old.joints, new.joints)
    nodes[-1] = new.joints[-1]
    mesh = mesh_at(new, system.rule, nodes)
    at = seed.at
    found = system.solved(
        mesh, Direction(at.frames, at.p, at.gamma), at.tangent, tolerance=TIGHT, iterations=15
    )
    if isinstance(found, Failure):
        raise Lost(found.reason)
    return system, found


def fresh(seed: Value) -> Value:
    """The same solution on a mesh fitted to it, where its own has become too coarse."""
    system, at = seed.system, seed.at
    error = system.error(at)
    size = max(error.gamma / math.pi, error.moment / max(abs(at.moment), 1.0))
    if size <= ACCURATE:
        return seed
    factor = min((size / (0.1 * ACCURATE)) ** 0.125, 2.0)
    n = math.ceil(factor * len(at.mesh.h))
    found = system.on(fitted(at.mesh, at.nodes[:-1], at.frames, n), at)
    return seed if isinstance(found, Failure) else seed._replace(at=found)


def stability(scene: Scene, seed: Value) -> Value:
    """DM/ds at gamma = pi; the seed is a folded state."""
    system, near = carried(scene, seed)
    found = system.solved(
        near.mesh,
        Direction(near.frames, near.p, math.pi),
        near.tangent,
        by_gamma=True,
        tolerance=TIGHT,
        iterations=15,
    )
    if isinstance(found, Failure):
        raise Lost(found.reason)
    return Value(found.moment_rate, found, system)


def foldability(scene: Scene, seed: Value) -> Value:
    """Gamma less pi at a fold; the seed is one."""
    system, near = carried(scene, seed)
    fold = _root(system, near, lambda at: at.tangent.gamma)
    return Value(fold.gamma - math.pi, fold, system)


def snap_back(scene: Scene, seed: Value) -> Value:
    """The extremum of dgamma/ds, where gamma bends from one way to the other; the seed has it."""
    system, near = carried(scene, seed)
    bend = _root(system, near, lambda at: _bend(system, at))
    return Value(bend.tangent.gamma, bend, system)


def _moved(system: Collocation, at: Solution, s: float) -> Solution:
    """The solution at a small distance along the path."""
    t = at.tangent
    guess = Direction(at.frames + s * t.frames, at.p + s * t.p, at.gamma + s * t.gamma)
    found = system.solved(at.mesh, guess, t, tolerance=TIGHT, iterations=15)
    if isinstance(found, Failure):
        raise Lost(found.reason)
    return found


def _bend(system: Collocation, at: Solution) -> float:
    """d2 gamma/ds2, by central differences."""
    ahead, behind = (_moved(system, at, s) for s in (PROBE, -PROBE))
    return (ahead.tangent.gamma - behind.tangent.gamma) / (2.0 * PROBE)


def _root(system: Collocation, at: Solution, value: Callable[[Solution], float]) -> Solution:
    """The solution along the path at which ``value`` vanishes (secant method)."""
    now, step, way = value(at), PROBE, 0.0
    for _ in range(MOST):
        new = _moved(system, at, step)
        way += step
        after = value(new)
        if after == now or abs(way) > FARTHEST:
            break
        step = -after * step / (after - now)
        at, now = new, after
        if abs(step) < SMALL:
            return at
        step = max(-0.1, min(0.1, step))
    raise Lost("no such state nearby on the path")


@dataclass(frozen=True)
class Kind:
    """A kind of boundary with its condition."""

    name: str
    condition: Condition


KINDS = {
    name: Kind(name, condition)
    for name, condition in (
        ("stability", stability),
        ("foldability", foldability),
        ("snap-back", snap_back),
    )
}
