r"""Deflated Newton's method: several states from one initial guess.

Newton's method finds the same equilibrium again and again. Deflation (Brown and Gearhart 1971;
Farrell, Birkisson and Funke 2015) multiplies the residual F by a factor that is infinite at every
known state y_k and tends to a constant far from all of them,

    G(x) = eta(x) F(x),    eta = prod_k (1/d(x, y_k)^2 + 1).

G has the roots of F except the known ones. Its Jacobian is eta J, with J that of F, plus a matrix
of rank one. With Newton's step D = -J^-1 F of F, the step of G is (Sherman and Morrison; Farrell et
al. 2.4)

    tau D,    tau = 1/(1 - slope),    slope = d(log eta)/dt along D,

and needs only one more number, the slope. Near a state that is not known D is small, tau is 1 and
convergence is quadratic. Near a known state the slope is 2 and tau is -1: the iteration moves away.
The distance d is that of `symmetry_images`, which no rigid motion, reflection or material shift
changes: a state is deflated together with all its images. The slope is a difference quotient; its
error changes the iterates, but not their limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from der.analysis.landscape.saddle_search import displaced, newton_step
from der.analysis.multistability.symmetry_images import SAME, Images, Signal, curvatures
from der.kernels.quaternions import Array
from der.rod.free_ring import FreeRing, balance
from der.rod.system import RodSystem

LONGEST = 0.25  # rad, root mean square, of a step
TOLERANCE = 1e-10  # GJ/a, of an equilibrium
_STEPS = 60
_NEARLY = 1e-5  # GJ/a, largest force: Newton's method takes over
_NEARLY_RIGID = 0.01  # of a shift near a circle: its difference from a rigid rotation
_SHORT = 1e-4  # rad, root mean square: a step below is Newton's own, tau = 1
_PART = 1e-3  # of a step, over which its slope is taken
_NO_DISTANCE = 1e-12


@dataclass(frozen=True)
class Known:
    """A state that was found."""

    free: FreeRing
    images: Signal  # (m, h, 3) signatures of all its images, its own first
    energy: float


def factor(distances: Callable[[float], Array], *, power: float = 2.0, shift: float = 1.0) -> float:
    """Return the factor tau by which deflation changes Newton's step.

    Parameters
    ----------
    distances : from the known states, as a function of the part of the step that is done.
    power, shift : of eta = prod (1/d^power + shift).
    """

    def log_eta(t: float) -> float:
        return float(np.sum(np.log(np.maximum(distances(t), _NO_DISTANCE) ** -power + shift)))

    slope = (log_eta(_PART) - log_eta(0.0)) / _PART
    return math.inf if slope == 1.0 else 1.0 / (1.0 - slope)


def deflated(start: FreeRing, known: Sequence[Known], images: Images) -> Known | None:
    """Return a state not yet known, from a configuration; None: none was found."""
    here = start
    for _ in range(_STEPS):
        if not math.isfinite(here.residual):
            return None
        found = newton_step(here.system, here)
        if found is None:
            return None
        step, grad = found
        if float(np.abs(grad).max()) < _NEARLY:
            return settled(here, known, images)
        size = float(np.sqrt(np.sum(here.rod.mass * step**2)))
        tau = _lengthened(here, step, known, images) if size > _SHORT else 1.0
        tau = math.copysign(min(abs(tau), LONGEST / max(size, 1e-300)), tau)
        here = displaced(here, tau * step)
    return None


def _lengthened(here: FreeRing, step: Array, known: Sequence[Known], images: Images) -> float:
    """Factor of the step at a configuration."""
    system = here.unpinned

    def distances(t: float) -> Array:
        state = system.retract(here.state, system.increment(t * step))
        return nearest(images.signature(curvatures(here.rod, state)), known, images)

    return factor(distances) if known else 1.0


def nearest(k: Signal, known: Sequence[Known], images: Images) -> Array:
    """Distances (len(known),) of one signature from the nearest image of each known state."""
    sizes = [len(one.images) for one in known]
    apart = images.distances(k, np.concatenate([one.images for one in known]))
    return np.minimum.reduceat(apart, np.cumsum([0, *sizes[:-1]]))


def settled(here: FreeRing, known: Sequence[Known], images: Images) -> Known | None:
    """Return the equilibrium next to a configuration; None: there is none, or it is known."""
    one = solved(here, images)
    return None if one is None or recognised(one, known, images) is not None else one


def solved(here: FreeRing, images: Images) -> Known | None:
    """Return the equilibrium next to a configuration, verified on its own supports.

    In a planar circle the shift of material is a rigid rotation; near a circle it is almost one,
    and needs almost no energy. Holding an unknown against it may then prevent convergence, so both
    supports are tried.
    """
    for supports in (here.pinned(), here.pinned(_NEARLY_RIGID)):
        at = RodSystem(here.rod, supports).correct(here.state, tolerance=TOLERANCE)
        state = at.state
        free = balance(here.rod, state.quat, state.stretch, here.supports, state.load)
        if at.converged and free.balanced:
            return Known(free, images.all_of(curvatures(here.rod, state)), at.energy)
    return None


def recognised(one: Known, known: Sequence[Known], images: Images) -> int | None:
    """Return the position of the known state that it is, or an image of; None: it is new."""
    if not known:
        return None
    apart = nearest(one.images[0], known, images)
    best = int(np.argmin(apart))
    return best if apart[best] < SAME else None
