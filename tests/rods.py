"""Rods, states and small numerics that the physics tests share."""

from collections import namedtuple
from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np

from der.kernels.assembly import System
from der.kernels.assembly import derivatives as assembled
from der.kernels.linking import unfold
from der.kernels.quaternions import Array, rotation, turned
from der.problem import PLANE
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import Rod, State, discrete_rod
from der.rod.stability import all_modes, raw_index, stack
from der.rod.supports import Supports
from der.rod.system import RodSystem

E1, E2, E3 = np.eye(3)
MEASURES = ("logarithm", "angle", "tangent")


def turned_all(quat: Array, w: Array) -> Array:
    """Frames ``quat`` (n, 4), each turned by its own rotation vector ``w`` (n, 3) [rad]."""
    out = np.empty_like(quat)
    for q, v, o in zip(quat, w, out, strict=True):
        turned(q, v, o)
    return out


# --- rods and states ------------------------------------------------------------------------


def turned_about(axis: int, angle: Array | float) -> Array:
    """Quaternions (..., 4) of rotations by ``angle`` about the basis vector ``axis`` (1, 2, 3)."""
    half = 0.5 * np.asarray(angle, dtype=float)
    q = np.zeros((*half.shape, 4))
    q[..., 0], q[..., axis] = np.cos(half), np.sin(half)
    return q


def turned_rigidly(quat: Array, w: Array) -> Array:
    """Frames ``quat`` (n, 4), all turned by the rotation vector ``w`` (3,) in the global basis."""
    return turned_all(quat, w @ rotation(quat))


def unloaded(rod: Rod, quat: Array, conditions: int, load: float = 0.0) -> State:
    """State with the given frames, no stretch and no forces yet."""
    return State(quat, np.zeros(rod.n_edges), np.zeros(conditions), load)


def straight(n_cells: int, stiffness: tuple[float, float, float], **options: object) -> Rod:
    """Open, naturally straight rod of length 1."""
    return discrete_rod(np.full(n_cells, 1 / n_cells), np.zeros(n_cells), stiffness, **options)


def covered_circle(
    n: int, kappa0: float, stiffness: tuple[float, float, float], n_edges: int, **options: object
) -> tuple[Rod, State]:
    """Return the closed rod of length 2 pi, curved by ``kappa0``, and its n-covered circle."""
    cell = np.full(n_edges, 2 * np.pi / n_edges)
    rod = discrete_rod(cell, kappa0 * cell, stiffness, closed=True, **options)
    return rod, unloaded(rod, turned_about(1, n * cell[0] * np.arange(n_edges)), 3)


def solved(system: RodSystem, start: State, **options: object) -> Equilibrium:
    """Return the equilibrium from ``start``; a failed solve fails the test."""
    found = system.correct(start, **options)
    assert found.converged, found.advice
    return found


def walk(
    ring: GrippedRing, length: float, stop: Callable[[Equilibrium], bool]
) -> Iterator[Equilibrium]:
    """States on the path from the flat ring, about ``length`` apart, until ``stop`` says so."""
    here = solved(ring, ring.start)
    while True:
        yield here
        if stop(here):
            return
        ahead, t = length, here.tangent
        while True:
            there = ring.correct(ring.retract(here.state, ahead * t), along=t, hold=PLANE)
            if there.converged:
                break
            ahead *= 0.5
            assert ahead > 1e-6, there.advice
        here = there


def lifted(ring: GrippedRing, state: State, onto: GrippedRing) -> Equilibrium:
    """Return a quarter's state as an equilibrium of a half or of the full ring, at its load."""
    quat = unfold(state.quat, ring.copies)[: onto.rod.n_edges]
    return solved(onto, unloaded(onto.rod, quat, len(onto.supports.target), state.load))


def three_covered(ring: GrippedRing) -> State:
    """Return the folded circle, gamma = pi, of a quarter: curvature 3 from the turned grip on."""
    s = ring.arc_length
    grip = turned_rigidly(ring.start.quat[-1:], -np.pi * E3)
    quat = turned_all(np.repeat(grip, len(s), axis=0), 3 * np.outer(s - s[-1], E1))
    return ring.start.but(quat=quat, load=np.pi)


Derivatives = namedtuple(
    "Derivatives",
    (*System._fields, "energy", "load_grad", "load_hess", "noise", "bent_too_far"),
)


def derivatives(rod: Rod, supports: Supports, state: State) -> Derivatives:
    """Lagrangian's derivatives at a state, and the numbers that come with them."""
    found, numbers = assembled(
        rod, supports, state.quat, state.stretch, state.force, float(state.load)
    )
    return Derivatives(*found, *numbers)


# --- numerics -------------------------------------------------------------------------------


def richardson(*values: float) -> float:
    """Limit of ``values`` from meshes refined by 2 each time, errors in even powers of the cell."""
    row = list(values)
    for order in range(2, 2 * len(values), 2):
        row = [b + (b - a) / (2**order - 1) for a, b in pairwise(row)]
    return row[0]


def index_of(system: RodSystem, state: State) -> int:
    """Index of a state on all that its supports leave free, by the engine's factorisation."""
    alone = stack([all_modes(system.supports)], system.work)
    return raw_index(system.rod, system.supports, alone, state)


def first_change(index: Callable[[float], int], low: float, high: float) -> float:
    """Where ``index`` leaves its value at ``low``, bracketed by bisection to 1e-11."""
    there, beyond = index(low), index(high)
    assert min(there, beyond) >= 0, "the factorisation gave up"
    assert there != beyond, f"index {there} at both ends"
    while abs(high - low) > 1e-11 * (1 + abs(high)):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if index(middle) == there else (low, middle)
    return 0.5 * (low + high)


def dense(system: RodSystem, state: State, *, load_free: bool = False) -> tuple[Array, Array]:
    """Hessian of the Lagrangian (N, N) in the unknowns that move, and their conditions (N, n_c).

    With ``load_free`` the load is one more unknown, the last.
    """
    rod, free = system.rod, system.supports.free
    found = derivatives(rod, system.supports, state)
    n, b = free.shape
    hess = np.zeros((n, b, n, b))
    for j in range(n):
        hess[j, :, j] += found.diag[j]
    for s in range(len(rod.cell)):
        c = (s + 1) % n
        hess[s, :, c] += found.off[s]
        hess[c, :, s] += found.off[s].T
    keep = free.ravel()
    hess = hess.reshape(n * b, n * b)[np.ix_(keep, keep)]
    border = found.border.reshape(n * b, -1)[keep]
    if load_free:
        column = found.load_column.ravel()[keep]
        hess = np.block([[hess, column[:, None]], [column[None, :], found.load_hess]])
        border = np.vstack([border, found.load_border])
    return hess, border


def on_conditions(hess: Array, border: Array) -> Array:
    """Eigenvalues of ``hess`` on the null space of ``border``.T, ascending."""
    q, _ = np.linalg.qr(border, mode="complete")
    z = q[:, border.shape[1] :]
    return np.linalg.eigvalsh(z.T @ hess @ z)
