"""A supported rod as a system for continuation: the rod's side of the seam (`der.problem`).

system = RodSystem(rod, supports)
found = system.correct(state)                 an equilibrium next to a configuration
for point in follow(system, state, events):   its path as the load grows
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from der.kernels.quaternions import Array
from der.kernels.workspace import workspace
from der.problem import PARAMETER, PLANE, Increment, Indices, Softest
from der.rod import stability
from der.rod.equilibrium import DIRECTION_HELD, LOAD_HELD, MOMENT_HELD, Equilibrium, correct
from der.rod.manifold import difference, product, retract, transport
from der.rod.rod import Rod, State, edges
from der.rod.stability import Stack, SymmetryClass, all_modes, stack
from der.rod.supports import Supports, check_cut

# of the softest torsion of a rod, GJ (2 pi/L)^2: within a step a mode's stiffness was seen to bulge
# by 0.002 of it at the median, by 0.06 in one of a hundred, and by 0.8 at most, from ends of -0.54
_SOFT = 0.6


@dataclass(frozen=True)
class RodSystem:
    """A rod on its supports, under a load that is the parameter."""

    rod: Rod
    supports: Supports
    parameter_name: str = field(default="load", kw_only=True)
    conjugate: str = field(default="moment", init=False)

    @cached_property
    def modes(self) -> Mapping[str, SymmetryClass]:
        """Modes by symmetry class."""
        return {"all": all_modes(self.supports)}

    @property
    def classes(self) -> Mapping[str, int]:
        """How often the modes of each class count."""
        return dict.fromkeys(self.modes, 1)

    @property
    def length(self) -> float:
        """Length of the rod, symmetry images included."""
        return float(self.rod.length.sum())

    @cached_property
    def soft(self) -> float:
        """Stiffness of a mode below which it may change its sign twice within a step."""
        return _SOFT * (2.0 * np.pi / self.length) ** 2 * float(self.rod.stiffness.min())

    @cached_property
    def _weight(self) -> Array:
        """Weights (m,) of an increment in the inner product: mass, 0 for forces, 1 for the load."""
        mass = np.repeat(self.rod.mass[:, 0], self.rod.block)
        return np.concatenate([mass, np.zeros(len(self.supports.target)), [1.0]])

    @cached_property
    def work(self) -> Array:
        """Memory for kernels, which they use again in each call."""
        most = max(len(modes.axis) for modes in (all_modes(self.supports), *self.modes.values()))
        n, b = self.supports.free.shape
        return workspace(n, b, most)

    @cached_property
    def _stacks(self) -> dict[str | None, Stack]:
        return {}

    def _stack(self, symmetry: str | None) -> Stack:
        """One class, or all of them (None)."""
        if symmetry not in self._stacks:
            own = self.modes.values() if symmetry is None else [self.modes[symmetry]]
            self._stacks[symmetry] = stack(list(own), self.work, looks=True)
        return self._stacks[symmetry]

    def increment(self, q: Array | None = None, load: float = 0.0) -> Increment:
        """Return the increment (m,) of rotations and stretches ``q`` (n, b), and of the load."""
        increment = np.zeros(len(self._weight))
        if q is not None:
            increment[: q.size] = q.ravel()
        increment[-1] = load
        return increment

    def displacement(self, along: Increment, size: float = 1.0) -> Increment:
        """Return ``size`` times an increment, with the multipliers left as they are."""
        moved = size * along
        moved[self.supports.free.size : -1] = 0.0
        return moved

    def correct(
        self,
        guess: State,
        *,
        along: Increment | None = None,
        hold: str = PARAMETER,
        value: float | None = None,
        tolerance: float = 1e-10,
        iterations: int = 12,
    ) -> Equilibrium:
        """Return the equilibrium next to a configuration, or the last iterate, with the reason.

        Parameters
        ----------
        along : (m,) direction that orients the tangent; default: a growing load. Corrections are
            orthogonal to it where ``hold`` is PLANE.
        hold : PARAMETER, PLANE or "moment".
        value : of the load (default: that of the configuration) or of the moment.
        tolerance : of the residual, GJ/a; rounding sets a floor of ten times its estimate.

        Raises
        ------
        ValueError
            For a closed rod whose edge 0 is free (`supports.check_cut`), a configuration of another
            rod, or another ``hold``.
        """
        check_cut(self.rod, self.supports.free)
        if hold not in _CLOSING:
            raise ValueError(f"hold must be one of {', '.join(_CLOSING)}, got {hold!r}")
        sizes = self.rod.n_edges, len(self.supports.target)
        if (len(guess.quat), len(guess.force)) != sizes:
            raise ValueError(
                f"guess must have {sizes[0]} edges and {sizes[1]} multipliers of position"
                f" conditions, got {len(guess.quat)} and {len(guess.force)}"
            )
        if value is not None and hold == PARAMETER and value != guess.load:
            guess = self.at_load(guess, value)
        return correct(
            self.rod,
            self.supports,
            guess.but(load=float(guess.load)),
            self.increment(load=1.0) if along is None else along,
            (_CLOSING[hold], 0.0 if value is None else float(value)),
            tolerance=tolerance,
            iterations=iterations,
            work=self.work,
        )

    def retract(self, state: State, increment: Increment) -> State:
        """Return a configuration moved by an increment."""
        return retract(self.supports, state, increment)

    def at_load(self, state: State, load: float) -> State:
        """Return a configuration with its supports moved to a load, all else unchanged."""
        moved = self.retract(state, self.increment(load=float(load) - state.load))
        return moved.but(load=float(load))

    def difference(self, a: State, b: State) -> Increment:
        """Return the increment that leads from one configuration to another."""
        increment = np.empty(len(self._weight))
        difference(self.supports.free, *a, *b, increment)
        return increment

    def transport(self, along: Increment, rates: Increment) -> Increment:
        """Return rates at the end of an increment, in the frames of its start."""
        n, b = self.supports.free.shape
        moved = np.empty(len(rates))
        transport(n, b, along, rates, moved)
        return moved

    def inner(self, a: Increment, b: Increment) -> float:
        """Return the inner product, mass-weighted and so independent of the mesh."""
        return float(product(self._weight, a, b))

    def positions(self, state: State) -> Array:
        """Positions (n + 1, 3) of the ends of the edges, the first at the origin [a]."""
        steps = edges(self.rod, state)
        return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])

    def indices(self, state: State, symmetry: str | None = None) -> tuple[Indices, Softest]:
        """Return certified index and lowest stiffnesses [GJ/a^2] of every class, or of one."""
        own = self._stack(symmetry)
        return stability.indices_and_stiffness(self.rod, self.supports, own, state)

    def count(self, state: State, symmetry: str) -> int:
        """Return the negative eigenvalues of one class by the signs of the pivots alone."""
        return stability.raw_index(self.rod, self.supports, self._stack(symmetry), state)

    def index(self, state: State) -> int | None:
        """Return the certified index among all motions that the supports leave free."""
        return stability.index(self.rod, self.supports, all_modes(self.supports), state)

    def softest_modes(
        self, state: State, count: int = 1, symmetry: str | None = None
    ) -> tuple[Array, Array]:
        """Return the eigenvalues nearest to zero (count,) and their modes (count, n, b)."""
        own = all_modes(self.supports) if symmetry is None else self.modes[symmetry]
        return stability.softest_modes(self.rod, self.supports, own, state, count)


_CLOSING = {PARAMETER: LOAD_HELD, PLANE: DIRECTION_HELD, "moment": MOMENT_HELD}
