"""The planar rod as a system for continuation; see `kernels.planar`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from der.errors import REASONS
from der.kernels.planar import Array, PlanarRod, correct_planar, negative_planar
from der.problem import PARAMETER, PLANE, Increment, Indices, LoadedSolution, Softest


class PlanarConfiguration(NamedTuple):
    """One configuration of a planar rod."""

    phi: Array  # (n,) angles of the edges, rad
    force: Array  # (m,) multipliers of the position conditions
    load: float


@dataclass(frozen=True, slots=True)
class PlanarEquilibrium(LoadedSolution[PlanarConfiguration]):
    """An equilibrium of a planar rod, in units of EI1."""

    @property
    def phi(self) -> Array:
        """Angles (n,) of the edges [rad]."""
        return self.state.phi

    @property
    def force(self) -> Array:
        """Multipliers (m,) of the position conditions."""
        return self.state.force


@dataclass(frozen=True, eq=False)
class PlanarRodSystem:
    """A planar rod under a load that is the parameter.

    Parameters
    ----------
    pin : (n,) direction of a motion without energy, along which nothing is corrected.
    """

    rod: PlanarRod
    pin: Array | None = None
    parameter_name: str = "load"
    conjugate: str = field(default="moment", init=False)
    classes: Mapping[str, int] = field(default_factory=lambda: {"planar": 1}, init=False)
    soft: float = field(default=0.0, init=False)

    @cached_property
    def _weight(self) -> Array:
        """Weights (m,) of an increment: mass, 0 for forces, 1 for the load."""
        forces = np.zeros(2 * len(self.rod.weight))
        return np.concatenate([np.where(self.rod.free, self.rod.mass, 0.0), forces, [1.0]])

    def increment(self, *, load: float) -> Increment:
        """Return the increment of the load alone."""
        increment = np.zeros(len(self._weight))
        increment[-1] = load
        return increment

    def correct(
        self,
        guess: PlanarConfiguration,
        *,
        along: Increment | None = None,
        hold: str = PARAMETER,
        value: float | None = None,
        tolerance: float = 1e-10,
        iterations: int = 12,
    ) -> PlanarEquilibrium:
        """Return the equilibrium near ``guess``; ``hold`` is PARAMETER or PLANE."""
        if hold not in (PARAMETER, PLANE):
            raise ValueError(f"hold must be {PARAMETER!r} or {PLANE!r} in a plane, got {hold!r}")
        n, load = len(self.rod.length), guess.load if value is None else value
        rod = self._rod_at(load) if hold == PARAMETER else self.rod
        along = self.increment(load=1.0) if along is None else along
        row = (self._weight * along)[:n, None]
        pin = np.zeros((n, 1, 0))
        if self.pin is not None:
            pin = np.ascontiguousarray(self.pin[:, None, None])
        phi, force = guess.phi.copy(), guess.force.copy()
        x, y = np.empty((n, 1, 1)), np.empty((len(force) + pin.shape[2], 1))
        outcome, taken, residual, load, energy, moment, rate, moment_rate, negative, bent = (
            correct_planar(
                rod, float(load), hold == PLANE, row, float(along[-1]), pin, tolerance, iterations,
                phi, force, x, y,
            )
        )  # fmt: skip
        return PlanarEquilibrium(
            state=PlanarConfiguration(phi, force, load),
            parameter=load,
            tangent=np.concatenate([x[:, 0, 0], y[: len(force), 0], [rate]]),
            observables={"moment": (moment, moment_rate), "energy": (energy, moment * rate)},
            index=negative - len(y) if negative >= 0 else None,
            reason=REASONS[outcome],
            detail=f"vertex {bent}" if bent >= 0 else "",
            iterations=taken,
            residual=residual,
        )

    def _rod_at(self, load: float) -> PlanarRod:
        """The rod at a load; the direction of a strut of length 0 is held."""
        if load != 0.0 or not self.rod.reach.any():
            return self.rod
        return self.rod._replace(free=self.rod.free & (self.rod.reach == 0.0))

    def retract(self, state: PlanarConfiguration, increment: Increment) -> PlanarConfiguration:
        """Return a configuration moved by an increment."""
        n = len(state.phi)
        phi, force = state.phi + increment[:n], state.force + increment[n:-1]
        return PlanarConfiguration(phi, force, state.load + float(increment[-1]))

    def difference(self, a: PlanarConfiguration, b: PlanarConfiguration) -> Increment:
        """Return the increment that leads from one configuration to another.

        The part along the pin is removed: nothing corrects its rounding, which extrapolation from
        step to step would make grow.
        """
        turn = b.phi - a.phi
        if self.pin is not None:
            turn = turn - self.pin * np.sum(self.pin * turn) / np.sum(self.pin**2)
        return np.concatenate([turn, b.force - a.force, [b.load - a.load]])

    def transport(self, along: Increment, rates: Increment) -> Increment:
        """Return the rates as they are: angles are a flat space."""
        return rates.copy()

    def inner(self, a: Increment, b: Increment) -> float:
        """Return the inner product, weighted by the lengths of the edges."""
        # no product of BLAS: its threads wait for each other where other processes run
        return float(np.sum(self._weight * a * b))

    def indices(
        self, state: PlanarConfiguration, symmetry: str | None = None
    ) -> tuple[Indices, Softest]:
        """Return the index in the plane; no stiffness is estimated."""
        count = self.count(state, symmetry or "planar")
        return (count if count >= 0 else None,), ((np.inf,),)

    def count(self, state: PlanarConfiguration, symmetry: str) -> int:
        """Return the negative eigenvalues in the plane; below 0: not known."""
        return self.negative(state, 0.0) - len(state.force)

    def negative(self, state: PlanarConfiguration, shift: float) -> int:
        """Return the negative eigenvalues of the bordered Hessian, its stiffnesses shifted."""
        return int(negative_planar(self._rod_at(state.load), *state, shift))


def solved(
    rod: PlanarRod,
    phi: Array,
    force: Array,
    load: float = 0.0,
    *,
    pin: Array | None = None,
    tolerance: float = 1e-10,
) -> PlanarEquilibrium:
    """Return the equilibrium next to a configuration, the load given."""
    return PlanarRodSystem(rod, pin).correct(
        PlanarConfiguration(phi, force, load), tolerance=tolerance
    )
