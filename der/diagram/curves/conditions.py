"""Conditions that hold on boundaries between folding modes, by ring and section.

    stability        the folded state at gamma = pi has dM/dgamma = 0
    stays folded     released, it loses the stiffness of a class of motions
    foldability      the fold at which the path turns back lies at gamma = pi
    infinite slope   the folded state is where the path turns back: dgamma/dM = 0 there
    snap-back        two folds merge: dgamma/ds has an extremum that is zero (a cusp)
    exchange         the path from the flat ring meets another one, and beyond follows that

Each is the value of a function of two parameters, evaluated by a few corrections from a solution
nearby: no path is followed. Solutions are carried from ring to ring on meshes that scale segment by
segment.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from der.bvp.collocation import Collocation, Direction, Solution, collocation, required
from der.bvp.corrector import observe
from der.bvp.gauss import Array
from der.bvp.meshes import Mesh, fitted, mesh_at, moved_to
from der.bvp.released import planar, stiffnesses
from der.bvp.sectors import sector
from der.diagram.curves.branch_exchange import Centre, centre, hysteresis, shot
from der.errors import ContinuationFailed, Reason
from der.scene import Scene

ACCURATE = 1e-9  # of gamma/pi and M: beyond, a mesh is fitted again
TIGHT = 1e-11  # increments of a solution from which a condition is judged
PROBE = 1e-3  # of s: first step of a secant, and for differences of dgamma/ds
LONGEST = 0.1  # of s: a step of a root search
BULGE = 1e-2  # of s: for a third derivative
SMALL = 1e-7  # of s: a secant step that has converged
NEAR = 1e-4  # of s: a Newton step that leaves its square
FOLDED = 0.02  # M of a state that is about the folded one; its gamma less pi is less than the cube
FARTHEST = 0.5  # of s: a state farther away is another one
MOST = 20


class NotFound(ContinuationFailed):
    """A state, or a point of a curve, that a condition needs and that does not exist nearby."""

    def __init__(self, message: str) -> None:
        super().__init__(message, Reason.DIVERGED)


class Value(NamedTuple):
    """A condition at a ring and section."""

    value: float
    at: Solution
    system: Collocation
    psi: Array | None = None  # of an exchange, see `branch_exchange`: its state has no tangent
    bend: Array | None = None  # likewise
    way: Array | None = None  # of an infinite slope, see `infinite_slope`: direction across it
    place: Array | None = None  # of an infinite slope: the place of the state, on the boundary
    motion: int = 0  # of a released ring: which class of motions, see `der.bvp.released`


Condition = Callable[[Scene, Value], Value]


def carried(scene: Scene, seed: Value) -> tuple[Collocation, Solution]:
    """The seed's solution as a guess for another ring, corrected there across its tangent.

    Raises
    ------
    ContinuationFailed
        Where the rings have other segments, or no solution is near.
    """
    system, mesh = scaled(scene, seed)
    at = seed.at
    return system, _solved(system, mesh, at.unknowns, at.tangent)


def scaled(scene: Scene, seed: Value) -> tuple[Collocation, Mesh]:
    """The seed's mesh for another ring, segment by segment.

    Raises
    ------
    ContinuationFailed
        Where the rings have other segments.
    """
    system = collocation(sector(scene))
    old, new = seed.system.sector, system.sector
    if len(old.joints) != len(new.joints):
        raise NotFound(f"the ring has {len(new.joints) - 1} segments, not {len(old.joints) - 1}")
    nodes = np.interp(seed.at.mesh.nodes, old.joints, new.joints)
    nodes[-1] = new.joints[-1]
    return system, mesh_at(new, system.rule, nodes)


def on(mesh: Mesh, seed: Value) -> Value:
    """The same state on another mesh.

    Raises
    ------
    ContinuationFailed
        Where it cannot be solved for there.
    """
    system, at = seed.system, seed.at
    if seed.psi is None:
        return seed._replace(at=required(system.on(mesh, at), "no solution on another mesh"))
    frames = moved_to(at.mesh, at.nodes[:-1], at.frames, mesh.stages)
    return _exchanged(system, mesh, frames, seed)


def fresh(seed: Value) -> Value:
    """The same solution on a mesh fitted to it, where its own has become too coarse."""
    at = seed.at
    try:
        size = _size(seed)
        if size <= ACCURATE:
            return seed
        factor = min((size / (0.1 * ACCURATE)) ** 0.125, 2.0)
        n = math.ceil(factor * len(at.mesh.h))
        return on(fitted(at.mesh, at.nodes[:-1], at.frames, n), seed)
    except ContinuationFailed:
        return seed


def _size(seed: Value) -> float:
    """The error of a state's gamma/pi and M."""
    system, at = seed.system, seed.at
    if seed.psi is None:
        error = system.error(at)
        gamma, moment = error.gamma, error.moment
    else:
        fine = on(at.mesh.halved, seed).at
        gamma, moment = abs(fine.gamma - at.gamma), abs(fine.moment - at.moment)
    return max(gamma / math.pi, moment / max(abs(at.moment), 1.0))


def numbers(state: Value) -> Array:
    """The constants of a state and its gamma."""
    return np.append(state.at.p, state.at.gamma)


def stability(scene: Scene, seed: Value) -> Value:
    """DM/ds at gamma = pi; the seed is a folded state."""
    found = _folded(scene, seed)
    return found._replace(value=found.at.moment_rate)


def stays_folded(scene: Scene, seed: Value) -> Value:
    """Stiffness of a class of motions of the released ring; the seed is a folded state."""
    found = _folded(scene, seed)
    return found._replace(value=stiffnesses(planar(found.system, found.at))[seed.motion])


def _folded(scene: Scene, seed: Value) -> Value:
    """The folded state, without a value yet."""
    system, near = carried(scene, seed)
    guess = near.unknowns._replace(gamma=math.pi)
    found = _solved(system, near.mesh, guess, near.tangent, by_gamma=True)
    return Value(math.nan, found, system, motion=seed.motion)


def infinite_slope(scene: Scene, seed: Value) -> Value:
    """Dgamma/ds where M = 0; the seed is a folded state.

    Gamma less pi is odd in M along the path, by the mirror image of a ring that is turned back.
    Past this boundary the path crosses pi three times, with M = 0 the second time only.
    """
    system, near = carried(scene, seed)
    found = _root(system, near, lambda at: at.moment)
    return Value(found.tangent.gamma, found, system)


def steepening(seed: Value) -> float:
    """Third derivative of gamma along the path at a folded state, where the second is none.

    Differences of the first over two distances, extrapolated: to the fourth power of them.
    """
    here = seed.at.tangent.gamma
    wide, narrow = (
        2.0 * (_moved(seed.system, seed.at, s).tangent.gamma - here) / s**2
        for s in (BULGE, 0.5 * BULGE)
    )
    return (4.0 * narrow - wide) / 3.0


def foldability(scene: Scene, seed: Value) -> Value:
    """Gamma less pi at a fold; the seed is one, and not the folded state of `infinite_slope`."""
    system, near = carried(scene, seed)
    fold = _root(system, near, lambda at: at.tangent.gamma)
    _not_folded(fold)
    return Value(fold.gamma - math.pi, fold, system)


def snap_back(scene: Scene, seed: Value) -> Value:
    """The extremum of dgamma/ds, where d2 gamma/ds2 changes sign; the seed has it.

    The folded state is always one, by symmetry, with `infinite_slope` as its condition: a cusp and
    its mirror image may merge in it, and end there.
    """
    system, near = carried(scene, seed)
    cusp = _extremum(system, near)
    _not_folded(cusp)
    return Value(cusp.tangent.gamma, cusp, system)


def _not_folded(at: Solution) -> None:
    """Refuse a fold or cusp that has merged with its mirror image: it has another condition."""
    if abs(at.moment) < FOLDED and abs(at.gamma - math.pi) < FOLDED**3:
        raise NotFound("it has become the folded state")


def exchange(scene: Scene, seed: Value) -> Value:
    """How far two branches of equilibria are from meeting; the seed lies between them."""
    system, mesh = scaled(scene, seed)
    return _exchanged(system, mesh, seed.at.frames, seed)


def _exchanged(system: Collocation, mesh: Mesh, frames: Array, seed: Value) -> Value:
    """The centre of an exchange, from frames on this mesh."""
    x = np.append(seed.at.p, seed.at.gamma)
    found = centre(system, mesh, frames, x, seed.psi, seed.bend)
    if found is None:
        raise NotFound("no two branches nearby")
    return Value(found.mu, _state(system, mesh, found), system, found.psi, bend=found.bend)


def _state(system: Collocation, mesh: Mesh, found: Centre) -> Solution:
    """The centre of an exchange as a solution, which has no tangent."""
    at, p, gamma = found.shot, found.x[:-1], float(found.x[-1])
    moment, energy = observe(system.sector.piece, mesh.h, mesh.rest, at.frames, p)
    none = Direction(np.zeros_like(at.frames), np.zeros_like(p), 0.0)
    energy *= system.sector.copies
    return Solution(mesh, at.frames, p, gamma, moment, energy, none, 0.0, 0, at.nodes, at.places, 0)


def asymptotic(state: Value) -> float:
    """Zero where an exchange touches a cusp, see `branch_exchange.hysteresis`."""
    at, psi = state.at, state.psi
    if psi is None:
        raise NotFound("not the state of an exchange")
    try:
        return hysteresis(state.system, at.mesh, at.frames, np.append(at.p, at.gamma), psi)
    except ArithmeticError as problem:
        raise NotFound(str(problem)) from problem


def closeness(system: Collocation, at: Solution) -> tuple[float, Array]:
    """How near a state is to an exchange, and its psi.

    The smallest singular value of the derivatives of the conditions at the end over the largest.
    """
    found = shot(system, at.mesh, at.frames, np.append(at.p, at.gamma))
    if not found.ok:
        return math.inf, np.zeros_like(at.p)
    left, values, _ = np.linalg.svd(found.rates)
    return float(values[-1] / values[0]), left[:, -1]


def _moved(system: Collocation, at: Solution, s: float) -> Solution:
    """The solution at a small distance along the path."""
    return _solved(system, at.mesh, at.unknowns.plus(s, at.tangent), at.tangent)


def _solved(
    system: Collocation, mesh: Mesh, guess: Direction, along: Direction, *, by_gamma: bool = False
) -> Solution:
    """The solution beside a guess, to tight increments."""
    found = system.solved(mesh, guess, along, by_gamma=by_gamma, tolerance=TIGHT, iterations=15)
    return required(found, "no such state nearby")


def _extremum(system: Collocation, at: Solution) -> Solution:
    """The solution along the path at which dgamma/ds is stationary (Newton's method).

    Central differences of dgamma/ds are its first and second derivatives.
    """
    total = 0.0
    for _ in range(MOST):
        ahead, behind = (_moved(system, at, s).tangent.gamma for s in (PROBE, -PROBE))
        bend = (ahead - behind) / (2.0 * PROBE)
        change = (ahead - 2.0 * at.tangent.gamma + behind) / PROBE**2
        step = max(-LONGEST, min(LONGEST, -bend / change)) if change != 0.0 else math.inf
        total += step
        if not abs(total) <= FARTHEST:
            break
        at = _moved(system, at, step)
        if abs(step) < NEAR:
            return at
    raise NotFound("no such state nearby on the path")


def _root(system: Collocation, at: Solution, value: Callable[[Solution], float]) -> Solution:
    """The solution along the path at which ``value`` vanishes (secant method)."""
    now, step, total = value(at), PROBE, 0.0
    for _ in range(MOST):
        new = _moved(system, at, step)
        total += step
        after = value(new)
        if after == now or abs(total) > FARTHEST:
            break
        step = -after * step / (after - now)
        at, now = new, after
        if abs(step) < SMALL:
            return at
        step = max(-LONGEST, min(LONGEST, step))
    raise NotFound("no such state nearby on the path")


KINDS: dict[str, Condition] = {
    "stability": stability,
    "stays folded": stays_folded,
    "foldability": foldability,
    "infinite slope": infinite_slope,
    "snap-back": snap_back,
    "exchange": exchange,
}
