"""One implicit step in time of a rod with masses, by the Newton's method of its equilibria.

The step from frames q0 looks for q = q0 o exp(w/2) at which

    grad U(q) + B force + M (known + shift w) = 0,   conditions met,

with one mass for each edge, its length: eigenvalues of the softest modes are then squared
frequencies, or rates of decay. Time integrators differ in ``known`` and ``shift`` alone: 0 and 1/dt
for the implicit Euler step of a gradient flow, what is left of the past and about 1/dt^2 for one of
motion. The matrix is that of the equilibrium with shift M on its diagonal.

The step is taken only where that matrix is positive on the conditions, so that what it finds is the
minimum of its potential next to q0 and no saddle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from der.errors import REASONS, Reason
from der.kernels.quaternions import Array
from der.rod.equilibrium import LOAD_HELD, MOMENT_HELD, newton
from der.rod.rod import Rod, State
from der.rod.supports import Supports, check_cut

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


def weights(rod: Rod, supports: Supports) -> Array:
    """Masses (n b + 1,) of all unknowns, held ones 0; the load's is the rod's whole length."""
    own = rod.length[:, None] * supports.free
    return np.append(own.ravel(), rod.length.sum())


def step(
    rod: Rod,
    supports: Supports,
    begin: State,
    guess: State,
    *,
    mass: Array,
    known: Array,
    shift: float,
    moment: float | None,
    tolerance: float,
) -> Stepped:
    """The implicit step from ``begin``, by Newton's method from ``guess``.

    Parameters
    ----------
    mass, known : (n b + 1,) as from `weights`; the last entries are the load's.
    moment : dead moment under which the load moves, too; None: it is given.
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
    check_cut(rod, supports.free)
    along = np.zeros(supports.free.size + len(supports.target) + 1)
    control = LOAD_HELD if moment is None else MOMENT_HELD
    state, _, values, ends, (w, rest) = newton(
        *rod, *supports, *guess.but(load=float(guess.load)),
        control, along, moment or 0.0, tolerance, _ITERATIONS,
        begin.quat, begin.stretch, float(begin.load), mass, known, shift,
    )  # fmt: skip
    energy, conjugate, _ = values
    outcome, where, iterations, _, _ = ends
    return Stepped(State(*state), REASONS[outcome], where, iterations, w, energy, conjugate, rest)


def on_the_conditions(rod: Rod, supports: Supports, start: State) -> Stepped:
    """``start`` moved onto its conditions by the shortest way, in the metric of the masses.

    Its multipliers stay those of the start: the ones of so short a step are no internal forces.
    """
    mass = weights(rod, supports)
    still = np.zeros(len(mass))
    found = step(
        rod,
        supports,
        start,
        start,
        mass=mass,
        known=still,
        shift=1e9,
        moment=None,
        tolerance=1e-6,
    )
    return replace(found, state=found.state.but(force=start.force))
