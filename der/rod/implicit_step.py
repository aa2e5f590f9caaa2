"""One implicit step in time of a rod with masses, by the Newton's method of its equilibria.

The step from frames q0 looks for q = q0 o exp(w/2) at which

    grad U(q) + B force + M (known + shift w) = 0,   conditions met,

with one mass for each edge, its length: eigenvalues of the softest modes are then squared
frequencies, or rates of decay. Time integrators differ in ``known`` and ``shift`` alone: 0 and 1/dt
for the implicit Euler step of a gradient flow, the terms of earlier steps and about 1/dt^2 for a
motion with inertia. The matrix is that of the equilibrium with shift M on its diagonal.

The step is taken only where that matrix is positive on the conditions. The result is then the
minimum of the step's potential next to q0, and no saddle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from der.errors import REASONS, Reason
from der.kernels.quaternions import Array
from der.rod.equilibrium import LOAD_HELD, MOMENT_HELD, newton
from der.rod.rod import State
from der.rod.supports import check_cut
from der.rod.system import RodSystem

_ITERATIONS = 6  # a step that needs more is too long


@dataclass(frozen=True, slots=True)
class Stepped:
    """An implicit step; where ``reason`` is not CONVERGED, its last iterate."""

    state: State
    reason: Reason
    where: int  # vertex that is bent too far; -1: none
    iterations: int
    w: Array  # (n b + 1,) the step: rotation vectors and stretches, flat, and the load
    energy: float  # elastic
    moment: float  # dL/dload
    residual: float  # of the forces without those of inertia: 0 at rest


class Inertia(NamedTuple):
    """Forces of inertia, M (known + shift w); the last entries are the load's."""

    mass: Array  # (n b + 1,) as from `weights`
    known: Array  # (n b + 1,)
    shift: float


def weights(system: RodSystem) -> Array:
    """Masses (n b + 1,) of all unknowns, 0 for those held; the load's is the length of the rod."""
    own = system.rod.length[:, None] * system.supports.free
    return np.append(own.ravel(), system.rod.length.sum())


def step(
    system: RodSystem,
    begin: State,
    guess: State,
    inertial: Inertia,
    *,
    moment: float | None = None,
    tolerance: float,
) -> Stepped:
    """Return the implicit step from ``begin``, by Newton's method from ``guess``.

    Parameters
    ----------
    inertial : forces of inertia or of viscosity.
    moment : dead moment under which the load moves, too; None: the load is given.
    tolerance : of the residual, GJ/a.

    Raises
    ------
    ValueError
        For a closed rod whose edge 0 is free (`supports.check_cut`).

    Notes
    -----
    Failure to converge is a value: see `Stepped.reason`; a matrix that is singular or not positive
    on the conditions is `Reason.SINGULAR`. A shorter step helps.
    """
    check_cut(system.rod, system.supports.free)
    control = LOAD_HELD if moment is None else MOMENT_HELD
    quat, stretch, force = guess.quat.copy(), guess.stretch.copy(), guess.force.copy()
    along, w = system.increment(), np.empty(len(inertial.mass))
    load, energy, conjugate, _, outcome, where, iterations, _, _, rest = newton(
        *system.rod, *system.supports, float(guess.load),
        control, along, moment or 0.0, tolerance, _ITERATIONS,
        begin.quat, begin.stretch, float(begin.load), *inertial,
        system.work, quat, stretch, force, np.empty(len(along)), w,
    )  # fmt: skip
    state = State(quat, stretch, force, load)
    return Stepped(state, REASONS[outcome], where, iterations, w, energy, conjugate, rest)


def on_the_conditions(system: RodSystem, start: State) -> Stepped:
    """Return the state on the conditions nearest to ``start``, in the metric of the masses.

    The multipliers stay those of the start: those of so short a step are no internal forces.
    """
    mass = weights(system)
    inertial = Inertia(mass, np.zeros(len(mass)), 1e9)
    found = step(system, start, start, inertial, tolerance=1e-6)
    return replace(found, state=found.state.but(force=start.force))
