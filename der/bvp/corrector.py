r"""Newton's method for the collocation equations on one sector, and the tangent of the path.

The unknowns are the frames at the stages, the constants p of the rod (below) and gamma. Frames at
the mesh points and all positions follow from them. Each interval gives one dense system of 4 m
unknowns, with the variations of its left end, of p and of gamma as right-hand sides. It is solved
at once with partial pivoting (condensation), and the variations at its right end enter the next
interval. A small system remains for p and gamma: the conditions at the far end and one more, for
the step:

    interval i    G_i dQ_i = dq_i + (terms in dp) - residual,    dq_{i+1} = linear in dq_i, dQ_i
    end           3 rotations (vector part of target^-1 o q: regular at all gamma), 1 or 2 positions
    step          gamma given, or a step orthogonal to the tangent

O(n) in the number of intervals n.
"""

from __future__ import annotations

import numpy as np

from der.bvp.condensing import (
    WEIGHTS,
    Piece,
    constants,
    eliminate,
    forward,
    moment_at,
    stages,
    workspace,
)
from der.packs.kernel import kernel

CONVERGED, DIVERGED, SLOW, SINGULAR = 0, 1, 2, 3
LARGEST = 2.0  # Newton's method has diverged if a frame's increment is larger


@kernel
def total(h):
    """Length of the sector, from those of its intervals."""
    length = 0.0
    for i in range(h.size):
        length += h[i]
    return length


@kernel
def _vector_part(target, q, out):
    """Vector part of conj(target) o q."""
    out[0] = target[0] * q[1] - target[1] * q[0] - target[2] * q[3] + target[3] * q[2]
    out[1] = target[0] * q[2] + target[1] * q[3] - target[2] * q[0] - target[3] * q[1]
    out[2] = target[0] * q[3] - target[1] * q[2] + target[2] * q[1] - target[3] * q[0]


@kernel
def border(h, along, along_gamma, node, place, work):
    """The small system's columns: conditions at the far end, and the row of the tangent.

    Columns p, gamma | increment that removes the residual, orthogonal to the tangent | tangent.
    """
    z, dq, dr, target, out = work.z, work.dq, work.dr, work.target, work.small
    n_p = out.shape[1] - 1
    G, R = n_p, n_p + 1
    n, m = along.shape[:2]
    vec = np.empty(3)
    length = total(h)
    for c in range(R + 2):
        for k in range(n_p + 1):
            out[c, k] = 0.0
    for c in range(R + 1):
        _vector_part(target[0], dq[c], vec)
        for k in range(3):
            out[c, k] = vec[k]
        for k in range(n_p - 3):  # r1, and r2 of a half
            out[c, 3 + k] = dr[c, k]
    _vector_part(target[1], node, vec)
    for k in range(3):
        out[G, k] += vec[k]
    _vector_part(target[0], node, vec)
    for k in range(3):
        out[R, k] += vec[k]
    for k in range(n_p - 3):
        out[R, 3 + k] += place[k]
    for i in range(n):
        for j in range(m):
            weight = 4.0 * h[i] * WEIGHTS[j] / length
            for a in range(4):
                factor = weight * along[i, j, a]
                for c in range(R + 1):
                    out[c, n_p] += factor * z[i, c, 4 * j + a]
    out[G, n_p] += along_gamma
    for k in range(n_p + 1):
        out[R, k] *= -1.0
    out[R + 1, n_p] = 1.0


@kernel
def move(h, z, step, rates, frames, out_tangent):
    """Add the increment to the frames; returns its size and the tangent's square, frames' part."""
    n, m = frames.shape[:2]
    n_q, rows = len(rates), z.shape[2]  # p and gamma; 4 m
    change, along = np.empty(rows), np.empty(rows)
    size, square = 0.0, 0.0
    length = total(h)
    for i in range(n):
        for row in range(rows):
            change[row], along[row] = z[i, n_q, row], 0.0
        for c in range(n_q):
            for row in range(rows):
                change[row] += z[i, c, row] * step[c]
                along[row] += z[i, c, row] * rates[c]
        for j in range(m):
            part = 0.0
            for a in range(4):
                row = 4 * j + a
                frames[i, j, a] += change[row]
                size = max(size, abs(change[row]))
                out_tangent[i, j, a] = along[row]
                part += along[row] * along[row]
            square += 4.0 * h[i] * WEIGHTS[j] / length * part
    return size, square


@kernel
def correct(
    quarter,
    stiffness,
    start,
    end,
    loads,
    h,
    rest,
    frames,
    p,
    gamma,
    along,
    along_gamma,
    by_gamma,
    iterations,
    tolerance,
    out_nodes,
    out_places,
    out_tangent,
    out_tangent_p,
):
    """Newton's method from a guess, in place, and the tangent of the path at the result.

    Parameters
    ----------
    quarter, stiffness, start, end, loads : the parts of a `Piece`, passed faster one by one.
    h : (n,) lengths of the intervals; rest : (n, m) k1u at the stages.
    frames : (n, m, 4), p : (n_p,), gamma : the guess; frames and p are overwritten.
    along : (n, m, 4), along_gamma : the tangent to which the step is orthogonal, and that orients
        the new one.
    by_gamma : whether gamma is given instead.
    iterations : at most; tolerance : of the last increment, whose square is the error left.
    out_nodes : (n + 1, 4) frames and out_places : (n + 1, 3) positions less the first, at the mesh
        points.
    out_tangent : (n, m, 4), out_tangent_p : (n_p,), tangent_gamma; of unit length in the mean
        square of rotations and gamma.

    Returns
    -------
    status : one of CONVERGED, DIVERGED, SLOW, SINGULAR.
    done : iterations.
    gamma : of the result.
    tangent_gamma : see above.
    rate : dM along the tangent, M the moment of one arm.
    orientation : sign of the determinant of the complete system, tangent row included.
    moment, energy : M and the sector's U.
    """
    n, m = rest.shape
    return newton(
        Piece(quarter, stiffness, start, end, loads), h, rest, frames, p, gamma,
        along, along_gamma, by_gamma, iterations, tolerance,
        workspace(n, m, p.size), out_nodes, out_places, out_tangent, out_tangent_p,
    )  # fmt: skip


@kernel
def newton(
    piece, h, rest, frames, p, gamma, along, along_gamma, by_gamma, iterations, tolerance,
    work, out_nodes, out_places, out_tangent, out_tangent_p,
):  # fmt: skip
    """`correct`, with a workspace for at least as many intervals."""
    n, m = rest.shape
    n_p = p.size
    G, R = n_p, n_p + 1  # columns: p, gamma, residual
    small = work.small
    tangent_gamma, rate = 0.0, 0.0
    orientation, status, done = 0, SLOW, 0

    while done < iterations:
        done += 1
        orientation = forward(piece, h, rest, frames, p, gamma, work, out_nodes, out_places)
        if orientation != 0:
            border(h, along, along_gamma, out_nodes[n], out_places[n], work)
            orientation *= eliminate(small)
        if orientation == 0 or (by_gamma and small[R + 1, G] == 0.0):
            status = SINGULAR
            break
        step, rates = small[R], small[R + 1]
        if by_gamma:  # less what the tangent adds to gamma
            share = step[G] / rates[G]
            for c in range(n_p):
                step[c] -= share * rates[c]
            step[G] = 0.0
        size, square = move(h, work.z, step, rates, frames, out_tangent)
        unit = 1.0 / np.sqrt(square + rates[G] * rates[G])
        for i in range(n):
            for j in range(m):
                for a in range(4):
                    out_tangent[i, j, a] *= unit
        tangent_gamma = unit * rates[G]
        rate = unit * _moment_rate(piece.loads, p, out_places[n], work.dr, rates)
        for c in range(n_p):
            out_tangent_p[c] = unit * rates[c]
            p[c] += step[c]
            size = max(size, abs(step[c]) / (1.0 + abs(p[c])))
        gamma += step[G]
        size = max(size, abs(step[G]))
        if not size < LARGEST:  # also NaN
            status = DIVERGED
            break
        if size < tolerance:
            status = CONVERGED
            break

    moment, energy = observe(piece, h, rest, frames, p)
    return status, done, gamma, tangent_gamma, rate, orientation, moment, energy


@kernel
def _moment_rate(loads, p, place, dr, rates):
    """Rate of M = -m3 at the end, m3 = m03 + F1 r2 - F2 r1."""
    m0, force = np.empty(3), np.empty(3)
    constants(loads, p, m0, force)
    total = 0.0
    for c in range(len(rates)):
        total -= rates[c] * (force[0] * dr[c, 1] - force[1] * dr[c, 0])
        if c < len(p):
            total -= rates[c] * (loads[2, c] + loads[3, c] * place[1] - loads[4, c] * place[0])
    return total


@kernel
def observe(piece, h, rest, frames, p):
    """Moment of one arm M = -m3 at the end, and the sector's energy; (A.7), (A.21)."""
    n, m = rest.shape
    m0, force, moment = np.empty(3), np.empty(3), np.empty(3)
    at, d = np.empty((m, 3)), np.empty((m, 3, 3))
    place = np.zeros(3)
    constants(piece.loads, p, m0, force)
    energy = 0.0
    for i in range(n):
        stages(h[i], place, frames[i], at, d)
        for j in range(m):
            moment_at(m0, force, at[j], moment)
            for k in range(3):
                local = d[j, k, 0] * moment[0] + d[j, k, 1] * moment[1] + d[j, k, 2] * moment[2]
                energy += 0.5 * h[i] * WEIGHTS[j] * local * local / piece.stiffness[k]
        for j in range(m):
            for k in range(3):
                place[k] += h[i] * WEIGHTS[j] * d[j, 2, k]
    moment_at(m0, force, place, moment)
    return -moment[2], energy
