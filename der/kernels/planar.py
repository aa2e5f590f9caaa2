r"""A rod that stays in a plane: one unknown an edge, the angle phi of its tangent.

The energy is that of the rod in space (measure "logarithm"), which in a plane is quadratic:

    U = sum_s EI1 (phi_{s+1} - phi_s - rest_s)^2 / (2 cell_s),

with a tridiagonal Hessian that is the same in every state. The nonlinearity is in the edge vectors,
e_j = length_j (cos phi_j, sin phi_j). Conditions on their weighted sums, two for each row of
``weight`` (the ring is closed; a strut lies between two points), add the forces

    L = U + sum_g F_g . sum_j weight_gj e_j,

edge by edge, to the gradient and to the diagonal. Angles are not reduced to a turn: a ring of
turning number T closes with phi_n = phi_0 + 2 pi T, and the frame of edge 0 is held, which removes
the rotation in the plane and cuts the cycle, as in space. Every edge may lengthen with the load (a
strut), and every natural angle may change with it (a path from one ring to another).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from der.kernels.block_ldl import factor, inertia, solve_refined
from der.kernels.workspace import MAX_DELAYED
from der.packs.kernel import kernel

Array = NDArray[np.float64]

_CLOSE = 1e-2  # of the tolerance, for the start and the first iterate: see `equilibrium`
_LARGEST_TURN = 1.0  # rad; a correction that turns an edge further has left the path
BENT_TOO_FAR = 8.0 / 9.0 * np.pi  # rad, at a vertex: 160 degrees, as in space

CONVERGED, TOO_MANY, DIVERGED, BENT, SINGULAR = range(5)  # the positions in `errors.REASONS`


class PlanarRod(NamedTuple):
    """A closed rod in a plane, how it is held and what the load does (kernels take it).

    N vertices between the edges of the ring, the last of them between edge N - 1 and edge 0; edges
    from N on belong to struts, which nothing bends.
    """

    stiffness: Array  # (N,) EI1/cell
    rest: Array  # (N,) natural turning, rad
    rest_rate: Array  # (N,) its change per unit of load
    closing: float  # 2 pi T: phi_0 + closing follows phi_{N-1}
    length: Array  # (n,)
    reach: Array  # (n,) more length per unit of load
    mass: Array  # (n,) weights of the edges in norms
    weight: Array  # (n_g, n) conditions: weighted sums of edge vectors are 0
    free: NDArray[np.bool_]  # (n,)


class PlanarSystem(NamedTuple):
    """Derivatives of the Lagrangian; unknowns that are held are taken out."""

    energy: float
    grad: Array  # (n,)
    diag: Array  # (n, 1, 1)
    off: Array  # (n, 1, 1) entries (j, j + 1)
    gap: Array  # (2 n_g,)
    border: Array  # (n, 1, 2 n_g)
    load_column: Array  # (n, 1)
    load_border: Array  # (2 n_g,)
    load_grad: float
    load_hess: float
    noise: float  # rounding error of an entry of grad, estimated
    bent: int  # first vertex bent too far; -1: none


@kernel
def assemble_planar(rod, phi, force, load):
    """Derivatives of the Lagrangian at the angles ``phi`` (n,), ``force`` (2 n_g,) and ``load``."""
    n, n_s = rod.length.shape[0], rod.rest.shape[0]
    n_g = rod.weight.shape[0]
    grad, column = np.zeros(n), np.zeros((n, 1))
    diag, off = np.zeros((n, 1, 1)), np.zeros((n, 1, 1))
    gap, load_border = np.zeros(2 * n_g), np.zeros(2 * n_g)
    border = np.zeros((n, 1, 2 * n_g))
    energy, load_grad, load_hess, noise, bent = 0.0, 0.0, 0.0, 0.0, -1
    for s in range(n_s):
        c = s + 1 if s + 1 < n_s else 0
        turn = phi[c] - phi[s]
        if c == 0:
            turn += rod.closing
        elif rod.free[s] and rod.free[c]:
            off[s, 0, 0] = -rod.stiffness[s]
        if bent < 0 and not abs(turn) <= BENT_TOO_FAR:  # true for NaN, too
            bent = s
        rate = rod.rest_rate[s]
        more = turn - rod.rest[s] - load * rate
        m = rod.stiffness[s] * more
        energy += 0.5 * m * more
        grad[s] -= m
        grad[c] += m
        diag[s, 0, 0] += rod.stiffness[s]
        diag[c, 0, 0] += rod.stiffness[s]
        column[s, 0] += rod.stiffness[s] * rate
        column[c, 0] -= rod.stiffness[s] * rate
        load_grad -= m * rate
        load_hess += rod.stiffness[s] * rate * rate
        noise = max(noise, 2e-16 * rod.stiffness[s] * (1.0 + abs(phi[s])))
    for j in range(n):
        cosine, sine = np.cos(phi[j]), np.sin(phi[j])
        now = rod.length[j] + load * rod.reach[j]
        fx, fy = 0.0, 0.0
        for g in range(n_g):
            w = rod.weight[g, j]
            if w != 0.0:
                fx += w * force[2 * g]
                fy += w * force[2 * g + 1]
                gap[2 * g] += w * now * cosine
                gap[2 * g + 1] += w * now * sine
                border[j, 0, 2 * g] = -w * now * sine
                border[j, 0, 2 * g + 1] = w * now * cosine
                load_border[2 * g] += w * rod.reach[j] * cosine
                load_border[2 * g + 1] += w * rod.reach[j] * sine
        along, across = cosine * fx + sine * fy, cosine * fy - sine * fx
        grad[j] += now * across
        diag[j, 0, 0] -= now * along
        column[j, 0] += rod.reach[j] * across
        load_grad += rod.reach[j] * along
        if not rod.free[j]:
            grad[j], diag[j, 0, 0], column[j, 0] = 0.0, 1.0, 0.0
            for k in range(2 * n_g):
                border[j, 0, k] = 0.0
    return PlanarSystem(
        energy,
        grad,
        diag,
        off,
        gap,
        border,
        column,
        load_border,
        load_grad,
        load_hess,
        noise,
        bent,
    )


@kernel
def _largest(values):
    """Largest entry, in size, or NaN."""
    largest = 0.0
    for value in values:
        if not abs(value) <= largest:
            largest = abs(value)
    return largest


@kernel
def _work(n, m):
    """Memory for the factors of ``n`` entries with ``m`` columns, and one solution."""
    return np.empty(n * (3 + 2 * (m + MAX_DELAYED) + 4))


@kernel
def correct_planar(
    rod, load, directed, row, row_load, pin, tolerance, most, out_phi, out_force, out_x, out_y
):
    """Newton's method, the load given, or, ``directed``, corrections orthogonal to a direction.

    Parameters
    ----------
    row, row_load : (n, 1), mass-weighted; they orient the tangent, too.
    pin : (n, 1, p) directions in which nothing is corrected: motions that cost nothing.
    out_phi, out_force : (n,), (m,) the start, moved to the end.
    out_x, out_y : (n, 1, 1), (m + p, 1) the tangent there.

    Returns
    -------
    tuple : position in `REASONS`, iterations, residual; load, energy, dL/dload, and the rates of
        load and of dL/dload along the tangent; negative eigenvalues of the bordered matrix, vertex
        bent too far.
    """
    phi, force, x, y, z = out_phi, out_force, out_x, out_y, np.zeros(1)
    n, m, p = phi.shape[0], force.shape[0], pin.shape[2]
    no_row, no_border = np.zeros((n, 1)), np.zeros(m + p)
    load_border = np.zeros(m + p)
    border = np.zeros((n, 1, m + p))
    work = _work(n, m + p)
    for j in range(n):
        x[j, 0, 0] = 0.0
        for k in range(p):
            border[j, 0, m + k] = pin[j, 0, k]
    for k in range(m + p):
        y[k, 0] = 0.0
    negative, rate, first = -1, 0.0, 0.0
    outcome, iteration = TOO_MANY, 0
    while True:
        system = assemble_planar(rod, phi, force, load)
        residual = max(_largest(system.grad), _largest(system.gap))
        first = residual if iteration == 0 else first
        if system.bent >= 0:
            outcome = BENT
            break
        if not np.isfinite(residual) or (iteration > 1 and residual > 1e3 * max(first, 1.0)):
            outcome = DIVERGED
            break
        wanted = tolerance if iteration > 1 or iteration == most else _CLOSE * tolerance
        done = residual <= max(wanted, 10.0 * system.noise)
        if not done and iteration >= most:
            break
        for k in range(m):
            load_border[k] = system.load_border[k]
            for j in range(n):
                border[j, 0, k] = system.border[j, 0, k]
        factors, left = factor(system.diag, system.off, border, work)
        last, corner = row, row_load
        if done:
            negative, _ = inertia(factors)
        z[0] = 1.0 if done else 0.0
        for j in range(n):
            x[j, 0, 0] = 0.0 if done else -system.grad[j]
        for k in range(m + p):
            y[k, 0] = 0.0 if done or k >= m else -system.gap[k]
        if not (done or directed):
            last, corner = no_row, 1.0
        if factors.negative < 0 or not solve_refined(
            system.diag,
            system.off,
            factors,
            m + p,
            system.load_column,
            load_border,
            last,
            no_border,
            corner,
            x,
            y,
            z,
            left,
        ):
            outcome = SINGULAR
            break
        if done:
            norm = z[0] * z[0]
            for j in range(n):
                norm += rod.mass[j] * x[j, 0, 0] ** 2
            scale = 1.0 / np.sqrt(norm)
            z[0] *= scale
            rate = system.load_hess * z[0]
            for j in range(n):
                x[j, 0, 0] *= scale
                rate += system.load_column[j, 0] * x[j, 0, 0]
            for k in range(m):
                y[k, 0] *= scale
                rate += system.load_border[k] * y[k, 0]
            outcome = CONVERGED
            break
        if not directed:
            z[0] = 0.0  # the load is given: not even rounding moves it
        largest = abs(z[0])
        for j in range(n):
            if not abs(x[j, 0, 0]) <= largest:  # true for NaN, too
                largest = abs(x[j, 0, 0])
        if not largest < _LARGEST_TURN:
            outcome = DIVERGED
            break
        for j in range(n):
            phi[j] += x[j, 0, 0]
        for k in range(m):
            force[k] += y[k, 0]
        load += z[0]
        iteration += 1
    # a plain tuple: to make a named one runs Python, in which Ctrl-C would end the process
    values = (system.energy, system.load_grad, z[0], rate)
    return (outcome, iteration, residual, load, *values, negative, system.bent)


@kernel
def negative_planar(rod, phi, force, load, shift):
    """Negative eigenvalues of the bordered Hessian with ``shift`` length_j added; -1: unknown."""
    system = assemble_planar(rod, phi, force, load)
    for j in range(rod.rest.shape[0]):
        if rod.free[j]:
            system.diag[j, 0, 0] += shift * rod.length[j]
    n, _, m = system.border.shape
    factors, _ = factor(system.diag, system.off, system.border, _work(n, m))
    return inertia(factors)[0]
