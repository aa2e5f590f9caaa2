"""The seam between mechanics and continuation: the operations of a system that can be followed.

A `System` has equilibria, where a residual vanishes, and one parameter: a rod in space or in a
plane, a ring in its grips or in an actuator, a scalar equation. It offers five operations:

    correct      an equilibrium near a guess, under one condition that closes the equations
    retract      the state that an increment leads to
    difference   the increment that leads from one state to another
    transport    rates at the end of an increment, expressed where it starts
    inner        product of two increments

An increment is a flat array: unknowns, multipliers, and the parameter last. `Stability` adds the
index by symmetry class. `Differentiable` adds further parameters and derivatives; only curves in
two parameters, adjoints and design need it. `der.continuation` knows nothing else of a system.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from der.errors import Reason

Array: TypeAlias = NDArray[np.float64]
Increment: TypeAlias = Array  # (m,) unknowns, multipliers, and the parameter last
Indices: TypeAlias = tuple[int | None, ...]  # one a symmetry class, multiplicities not yet applied
Softest: TypeAlias = tuple[tuple[float, ...], ...]  # for each class, stiffnesses of soft modes

S = TypeVar("S")  # a configuration: frames, angles, numbers, ...
A = TypeVar("A", bound="Solution[Any]")

# Conditions that close the equations of equilibrium; any other is the name of an observable.
PARAMETER = "parameter"  # it has a given value
PLANE = "plane"  # the correction is orthogonal to a direction


@dataclass(frozen=True, slots=True)
class Solution(Generic[S]):
    """An equilibrium, or, where ``reason`` is not CONVERGED, the last iterate."""

    state: S
    parameter: float
    tangent: Increment  # of the path, of unit length in `System.inner`
    observables: Mapping[str, tuple[float, float]]  # value, and rate along the tangent
    index: int | None  # negative eigenvalues with the parameter held, not certified; None: unknown
    reason: Reason
    detail: str  # what the system adds to the reason, such as the vertex; nothing parses it
    iterations: int
    residual: float

    @property
    def converged(self) -> bool:
        """Whether this is an equilibrium."""
        return self.reason is Reason.CONVERGED

    @property
    def parameter_rate(self) -> float:
        """Rate of the parameter along the tangent; it vanishes at a fold."""
        return float(self.tangent[-1])

    @property
    def advice(self) -> str:
        """Why the solve ended, as a sentence."""
        return f"{self.detail} {self.reason.value}".strip()


@dataclass(frozen=True, slots=True)
class LoadedSolution(Solution[S]):
    """A solution with the observables "moment", conjugate to the load, and "energy"."""

    @property
    def moment(self) -> float:
        """DL/dload, work-conjugate to the load."""
        return self.observables["moment"][0]

    @property
    def energy(self) -> float:
        """Elastic energy."""
        return self.observables["energy"][0]


class System(Protocol[S]):
    """A system with one parameter; it is in equilibrium where its residual vanishes."""

    @property
    def parameter_name(self) -> str:
        """What the parameter is called in messages."""

    @property
    def conjugate(self) -> str:
        """Observable that is the derivative of the Lagrangian by the parameter."""

    def correct(
        self,
        guess: S,
        *,
        along: Increment | None = None,
        hold: str = PARAMETER,
        value: float | None = None,
        tolerance: float = 1e-10,
        iterations: int = 12,
    ) -> Solution[S]:
        """Return the equilibrium near ``guess``.

        Parameters
        ----------
        along : direction that orients the tangent (default: a growing parameter), and to which
            corrections are orthogonal where ``hold`` is PLANE.
        hold : PARAMETER, PLANE, or the observable that has a given value.
        value : of the parameter, which is set to it exactly (None: that of the guess), or of the
            observable.
        """

    def retract(self, state: S, increment: Increment) -> S:
        """Return the state to which an increment leads."""

    def difference(self, a: S, b: S) -> Increment:
        """Return the increment that leads from ``a`` to ``b``."""

    def transport(self, along: Increment, rates: Increment) -> Increment:
        """Return rates at the end of an increment in the chart of its start (flat: as given)."""

    def inner(self, a: Increment, b: Increment) -> float:
        """Return the inner product of two increments, independent of the mesh."""


class Stability(System[S], Protocol[S]):
    """A system whose index can be counted; the first class keeps the symmetry of the path."""

    @property
    def classes(self) -> Mapping[str, int]:
        """Symmetry classes of modes, with how often each counts."""

    @property
    def soft(self) -> float:
        """Stiffness of a mode below which two changes of sign are looked for within one step."""

    def indices(self, state: S, symmetry: str | None = None) -> tuple[Indices, Softest]:
        """Return certified index and lowest stiffness of every class, or of one.

        A class may give several stiffnesses, one for each further symmetry of its modes.
        """

    def count(self, state: S, symmetry: str) -> int:
        """Return the negative eigenvalues of one class as the factors show them, not certified."""


class Differentiable(System[S], Protocol[S]):
    """A system with further parameters and exact derivatives."""

    @property
    def names(self) -> Sequence[str]:
        """Further parameters, such as h/t, nu, or a Fourier coefficient of natural curvature."""

    def with_value(self, name: str, value: float) -> Differentiable[S]:
        """Return the same system with another value of a further parameter."""

    def rate(self, state: S, name: str) -> Array:
        """Return d residual/d name at a state."""

    def solve(self, state: S, rhs: Array, *, adjoint: bool = False) -> Array:
        """Solve with the tangent matrix at a state, or its transpose."""

    def second(self, state: S, a: Increment, b: Increment) -> Array:
        """Return the second derivative of the residual along two increments."""


@dataclass(frozen=True)
class Options:
    """How a path is followed."""

    first_step: float = 0.05  # lengths in `System.inner`
    largest_step: float = 0.6
    smallest_step: float = 1e-7
    aimed_turn: float = 0.12  # rad, between tangents of neighbouring states
    sharpest_turn: float = 0.6  # rad; a step that turns more is repeated shorter
    tolerance: float = 1e-10  # of the residual
    max_steps: int = 2000


@dataclass
class Statistics:
    """What a solve has cost so far."""

    newton_iterations: int = 0
    steps: int = 0
    force_evaluations: int = 0  # of dynamic relaxation


@dataclass(frozen=True)
class Point(Generic[A]):
    """A solution on the path, with its kind and index."""

    solution: A
    kind: str = ""  # "", "fold", "limit", "branch", or the kind of a further event
    index: Indices | None = None
    stiffness: Softest = ()  # where index is known
    sides: tuple[Indices, Indices] | None = None  # index before and after a singular solution
    details: Mapping[str, object] = field(default_factory=dict)


def total_index(system: Stability[S], index: Indices | None) -> int | None:
    """Return the sum over the symmetry classes, each as often as it counts; None: not known."""
    if index is None or None in index:
        return None
    counts = zip(system.classes.values(), index, strict=True)
    return sum(multiplicity * (count or 0) for multiplicity, count in counts)
