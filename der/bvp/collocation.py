"""Solutions of a sector's boundary-value problem: solver, change of mesh, error estimate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from der.bvp.corrector import CONVERGED, DIVERGED, SINGULAR, SLOW, correct
from der.bvp.gauss import Array, Rule, rule
from der.bvp.march import ERROR, NUMBERS, States, errors
from der.bvp.meshes import Mesh, first_mesh, moved_to
from der.bvp.sectors import Sector
from der.errors import ContinuationFailed, Reason

REASONS = {
    CONVERGED: Reason.CONVERGED,
    DIVERGED: Reason.DIVERGED,
    SLOW: Reason.TOO_MANY_ITERATIONS,
    SINGULAR: Reason.SINGULAR,
}
CLOSE = 1e-9  # last increment; rates and positions are those before it


class Direction(NamedTuple):
    """Unknowns of a solution, or a change of them: frames at the stages, constants p and gamma."""

    frames: Array  # (n, m, 4)
    p: Array  # (n_p,)
    gamma: float

    def plus(self, share: float, other: Direction) -> Direction:
        """These unknowns and a share of others."""
        pairs: Iterable[tuple[Any, Any]] = zip(self, other, strict=True)
        return Direction._make(a + share * b for a, b in pairs)


class Solution(NamedTuple):
    """An equilibrium and the path's tangent there, of unit length."""

    mesh: Mesh
    frames: Array  # (n, m, 4) at the stages
    p: Array  # (n_p,) see `sectors`
    gamma: float
    moment: float  # M of one arm, GJ/a
    energy: float  # U of the full ring, GJ/a
    tangent: Direction
    moment_rate: float  # dM along the tangent
    orientation: int  # sign of the determinant, constant along a path
    nodes: Array  # (n + 1, 4) frames and
    places: Array  # (n + 1, 3) positions less the first, at the mesh points
    iterations: int

    @property
    def unknowns(self) -> Direction:
        """What Newton's method solves for."""
        return Direction(self.frames, self.p, self.gamma)

    @property
    def parameter(self) -> float:
        """Gamma, as continuation calls it."""
        return self.gamma

    @property
    def parameter_rate(self) -> float:
        """Rate of gamma along the tangent; it vanishes at a fold."""
        return self.tangent.gamma

    @property
    def observables(self) -> dict[str, tuple[float, float]]:
        """The moment, and its rate along the tangent."""
        return {"moment": (self.moment, self.moment_rate)}

    @property
    def slope(self) -> float:
        """dM/dgamma, from the linearised problem."""
        return self.moment_rate / self.tangent.gamma


class Failure(NamedTuple):
    """No solution, and why."""

    reason: Reason
    iterations: int


def required(found: Solution | Failure, message: str) -> Solution:
    """Return what was found if it is a solution.

    Raises
    ------
    ContinuationFailed
        If it is none; ``message`` says where one was sought.
    """
    if isinstance(found, Failure):
        raise ContinuationFailed(f"{message}: {found.reason.value}", found.reason)
    return found


class Error(NamedTuple):
    """The change of a solution on a mesh with halved intervals."""

    gamma: float
    moment: float
    energy: float


@dataclass(frozen=True, eq=False)
class Collocation:
    """The collocation equations of a sector."""

    sector: Sector
    rule: Rule

    def solved(
        self,
        mesh: Mesh,
        guess: Direction,
        along: Direction,
        *,
        by_gamma: bool = False,
        iterations: int = 12,
        tolerance: float = CLOSE,
    ) -> Solution | Failure:
        """The solution beside ``guess``: at its gamma, or in the plane across ``along``."""
        frames, p = guess.frames.copy(), guess.p.copy()
        n, m = mesh.rest.shape
        nodes, places = np.empty((n + 1, 4)), np.empty((n + 1, 3))
        tangent, tangent_p = np.empty((n, m, 4)), np.empty(len(p))
        problem = (*self.sector.piece, mesh.h, mesh.rest, frames, p, guess.gamma)
        wanted = (along.frames, along.gamma, by_gamma, iterations, tolerance)
        status, done, gamma, tangent_gamma, rate, orientation, moment, energy = correct(
            *problem, *wanted, nodes, places, tangent, tangent_p
        )
        if status != CONVERGED and not (status == SLOW and tolerance == 0.0):
            return Failure(REASONS[status], done)
        energy *= self.sector.copies
        rates = Direction(tangent, tangent_p, tangent_gamma)
        return Solution(
            mesh, frames, p, gamma, moment, energy, rates, rate, orientation, nodes, places, done
        )

    def flat(self, n: int) -> Solution | Failure:
        """The flat ring on about n intervals, the tangent towards larger gamma."""
        mesh = first_mesh(self.sector, self.rule, n)
        guess = Direction(self.sector.flat(mesh.stages), self.sector.flat_constants(), 0.0)
        along = Direction(np.zeros_like(guess.frames), np.zeros_like(guess.p), 1.0)
        return self.solved(mesh, guess, along, by_gamma=True)

    def on(self, mesh: Mesh, at: Solution) -> Solution | Failure:
        """The same solution on another mesh."""
        frames = moved_to(at.mesh, at.nodes[:-1], at.frames, mesh.stages)
        t = at.tangent
        along = Direction(moved_to(at.mesh, None, t.frames, mesh.stages), t.p, t.gamma)
        return self.solved(mesh, Direction(frames, at.p, at.gamma), along)

    def error(self, at: Solution) -> Error:
        """Change of (gamma, M, U) across the path by one iteration on halved intervals."""
        fine, t = at.mesh.halved, at.tangent
        state = at.nodes, at.frames, at.p, t.frames, _numbers(at)
        return Error(*errors(*self.sector.piece, fine.h, fine.rest, *state))


def room(mesh: Mesh, n_p: int, *count: int) -> States:
    """Room for one state on a mesh, or for as many as asked."""
    n, m = mesh.rest.shape
    shapes = ((n, m, 4), (n_p,), (n, m, 4), (n_p,), (n + 1, 4), (n + 1, 3), (NUMBERS,))
    return States._make(np.empty((*count, *shape)) for shape in shapes)


def states_from(at: Solution, count: int) -> States:
    """Room for states, of which the first is a solution."""
    states, t = room(at.mesh, len(at.p), count), at.tangent
    values = (at.frames, at.p, t.frames, t.p, at.nodes, at.places)
    for part, value in zip(states[:-1], values, strict=True):
        part[0] = value
    states.numbers[0, :ERROR] = _numbers(at)
    return states


def _numbers(at: Solution) -> Array:
    """The numbers of a state."""
    rates = at.tangent.gamma, at.moment_rate
    return np.array([at.gamma, at.moment, at.energy, *rates, at.orientation, at.iterations])


def solution_of(mesh: Mesh, state: States) -> Solution:
    """One state as a solution on its mesh."""
    frames, p, tangent, tangent_p, nodes, places, numbers = state
    gamma, moment, energy, gamma_rate, rate, sign, done = numbers[:ERROR].tolist()
    along = Direction(tangent, tangent_p, gamma_rate)
    rest = (rate, int(sign), nodes, places, int(done))
    return Solution(mesh, frames, p, gamma, moment, energy, along, *rest)


def collocation(sector: Sector) -> Collocation:
    """The collocation equations of a sector."""
    return Collocation(sector, rule())
