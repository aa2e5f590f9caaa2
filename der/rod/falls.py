"""What a fall in time leaves behind: where it ended, how, and the configurations on its way.

Of `gradient_flow` and `motion`, which take implicit steps whose length follows from their error.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from der.kernels.quaternions import Array
from der.rod.equilibrium import Direction, Outcome, moved
from der.rod.implicit_step import Stepped
from der.rod.relaxation import Rest
from der.rod.rod import State
from der.rod.supports import Supports

SHORTEST = 1e-12  # of time; a step this short that fails will fail at any length
LONGEST = 1e9  # beyond, a step is Newton's method
_GROWTH = (0.2, 3.0)  # of a step's length from one to the next
_SAFE = 0.9  # of the length that the error allows


@dataclass(frozen=True, slots=True)
class Fallen:
    """A fall; where ``outcome`` is not AT_REST (or AT_STOP), its last configuration."""

    state: State
    outcome: Rest
    where: int  # vertex that is bent too far; -1: none
    steps: int
    factorisations: int  # of rejected steps, too
    time: (
        float  # in units in which a mode of eigenvalue mu decays as exp(-mu t), or has mu = omega^2
    )
    residual: float  # largest entry of gradient and position gap, GJ/a and a
    kinetic: float  # kinetic energy at the end, GJ/a; 0 where there is no inertia
    energy_start: float  # elastic energy of the rod where it starts to move
    energy: float  # and where it ends
    moment: float  # dL/dload
    history: tuple[State, ...]  # every k-th configuration
    energies: Array  # (len(history),) elastic energies
    times: Array  # (len(history),)

    @property
    def rests(self) -> bool:
        """Whether the end is an equilibrium, under given load or moment."""
        return self.outcome is Rest.AT_REST


@dataclass
class Trail:
    """A fall so far."""

    every: int  # k of the history; 0: none
    last: Stepped
    energy_start: float
    steps: int = 0
    factorisations: int = 0
    time: float = 0.0
    kept: list[tuple[State, float, float]] = field(default_factory=list)

    def add(self, found: Stepped, duration: float) -> None:
        """Go on by an accepted step."""
        if self.every and self.steps % self.every == 0:
            self.kept.append((self.last.state, self.last.energy, self.time))
        self.last = found
        self.steps += 1
        self.time += duration

    def ended(self, outcome: Rest, kinetic: float = 0.0) -> Fallen:
        """The record of the fall."""
        if self.every:
            self.kept.append((self.last.state, self.last.energy, self.time))
        return Fallen(
            self.last.state,
            outcome,
            self.last.where,
            self.steps,
            self.factorisations,
            self.time,
            self.last.residual,
            kinetic,
            self.energy_start,
            self.last.energy,
            self.last.moment,
            tuple(state for state, _, _ in self.kept),
            np.array([energy for _, energy, _ in self.kept]),
            np.array([time for _, _, time in self.kept]),
        )


def rms(mass: Array, w: Array) -> float:
    """Root mean square of a displacement (n b + 1,), weighted by masses [rad]."""
    return float(np.sqrt(np.sum(mass * w * w) / mass[-1]))


def advanced(held: Supports, state: State, w: Array) -> State:
    """``state`` displaced by ``w`` (n b + 1,), its multipliers kept."""
    q = w[:-1].reshape(held.free.shape)
    return moved(held, state, Direction(q, np.zeros(len(held.target)), float(w[-1])))


def factor_of_step(error: float, accuracy: float, order: int) -> float:
    """By how much the next step may be longer, for an error that grows with a power of it."""
    ease = _SAFE * (accuracy / max(error, 1e-300)) ** (1.0 / order)
    return min(max(ease, _GROWTH[0]), _GROWTH[1])


def hopeless(found: Stepped) -> Rest:
    """Why a step fails at any length."""
    return Rest.BENT_TOO_FAR if found.outcome is Outcome.BENT_TOO_FAR else Rest.DIVERGED


def kicked(held: Supports, start: State, kick: Direction | None) -> State:
    """Where a fall begins."""
    return start if kick is None else moved(held, start, kick)
