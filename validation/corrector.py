r"""Newton's method for the collocation equations on one sector, and the tangent of the path.

Unknown are the frames at the stages, the constants p of the rod (below) and gamma; frames at the
mesh points and all positions are explicit in them. Each interval gives, with the variations of its
left end, of p and of gamma as right-hand sides, one dense system of 4 m unknowns, solved with
partial pivoting and at once (condensation); what is carried on to the next interval are the
variations at its right end. A small system remains for p and gamma: the conditions at the far end
and one more, for the step:

    interval i    G_i dQ_i = dq_i + (terms in dp) - residual,    dq_{i+1} = linear in dq_i, dQ_i
    end           3 rotations (vector part of target^-1 o q: regular at all gamma), 1 or 2 positions
    step          gamma given, or a step orthogonal to the tangent

O(n) in the number of intervals n.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from validation.equations import directors, product, stage
from validation.gauss import Array

CONVERGED, DIVERGED, SLOW, SINGULAR = 0, 1, 2, 3
LARGEST = 2.0  # a Newton increment of a frame above this leads nowhere


class Piece(NamedTuple):
    """What the kernels know of a sector; see `sectors`."""

    quarter: bool  # whether it starts at a free point and not at a grip
    stiffness: Array  # (3,) B = (alpha, beta, 1)
    start: Array  # (4,) frames of the flat ring at the ends
    end: Array
    loads: Array  # (6, n_p) p -> (m0, F)


class Inner(NamedTuple):
    """Workspace: what an interval's equations are made of, at its m stages."""

    at: Array  # (m, 3) positions less the first
    d: Array  # (m, 3, 3) directors
    f: Array  # (m, 4) q'
    fq: Array  # (m, 4, 4) its derivatives by q,
    fm: Array  # (m, 4, 3) by the moment
    fx: Array  # (m, 4, 3) and by position
    gq: Array  # (m, 3, 4) derivative of d3 by q


@njit(cache=True)
def _eliminate(w, n):
    """Solve in place: (n, n + c) rows [matrix | right-hand sides]; returns the determinant's sign.

    0 where a pivot vanishes. Solutions replace the right-hand sides.
    """
    sign = 1
    width = w.shape[1]
    for k in range(n):
        pivot, row = abs(w[k, k]), k
        for i in range(k + 1, n):
            if abs(w[i, k]) > pivot:
                pivot, row = abs(w[i, k]), i
        if not pivot > 0.0:
            return 0
        if row != k:
            sign = -sign
            for j in range(k, width):
                w[k, j], w[row, j] = w[row, j], w[k, j]
        if w[k, k] < 0.0:
            sign = -sign
        inverse = 1.0 / w[k, k]
        for i in range(k + 1, n):
            factor = w[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, width):
                    w[i, j] -= factor * w[k, j]
    for k in range(n - 1, -1, -1):
        inverse = 1.0 / w[k, k]
        for j in range(n, width):
            w[k, j] *= inverse
        for i in range(k):
            factor = w[i, k]
            for j in range(n, width):
                w[i, j] -= factor * w[k, j]
    return sign


@njit(cache=True)
def _ends(quarter, start, end, p, gamma, out_q0, out_dq0, out_target, out_dtarget):
    """Frame at the start, its derivative by the parameter that turns it, and the same at the end.

    A quarter starts at the free point, turned by p[0] about E2; a half at the grip at -E3, turned
    by gamma about E3. Both end at the grip at +E3, turned by -gamma.
    """
    spin = np.zeros(4)
    angle = p[0] if quarter else gamma
    axis = 2 if quarter else 3
    spin[0], spin[axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    product(spin, start, out_q0)
    spin[0], spin[axis] = -0.5 * np.sin(0.5 * angle), 0.5 * np.cos(0.5 * angle)
    product(spin, start, out_dq0)
    spin[2] = 0.0
    spin[0], spin[3] = np.cos(0.5 * gamma), -np.sin(0.5 * gamma)
    product(spin, end, out_target)
    spin[0], spin[3] = -0.5 * np.sin(0.5 * gamma), -0.5 * np.cos(0.5 * gamma)
    product(spin, end, out_dtarget)


@njit(cache=True)
def _vector_part(target, q, out):
    """Vector part of conj(target) o q."""
    out[0] = target[0] * q[1] - target[1] * q[0] - target[2] * q[3] + target[3] * q[2]
    out[1] = target[0] * q[2] + target[1] * q[3] - target[2] * q[0] - target[3] * q[1]
    out[2] = target[0] * q[3] - target[1] * q[2] + target[2] * q[1] - target[3] * q[0]


@njit(cache=True)
def _constants(loads, p, out_m0, out_force):
    """Moment m0 at the start, and force, from p."""
    for k in range(3):
        out_m0[k], out_force[k] = 0.0, 0.0
        for c in range(p.size):
            out_m0[k] += loads[k, c] * p[c]
            out_force[k] += loads[3 + k, c] * p[c]


@njit(cache=True)
def _stages(partial, h, place, frames, out_at, out_d):
    """Positions and directors at the stages of an interval that starts at ``place``."""
    m = frames.shape[0]
    for j in range(m):
        directors(frames[j], out_d[j])
    for j in range(m):
        for k in range(3):
            total = 0.0
            for i in range(m):
                total += partial[j, i] * out_d[i, 2, k]
            out_at[j, k] = place[k] + h * total


@njit(cache=True)
def _moment(m0, force, at, out):
    """Moment at a position: m0 + F x r."""
    out[0] = m0[0] + force[1] * at[2] - force[2] * at[1]
    out[1] = m0[1] + force[2] * at[0] - force[0] * at[2]
    out[2] = m0[2] + force[0] * at[1] - force[1] * at[0]


@njit(cache=True)
def _right_hand_sides(piece, h, rest, m0, force, frames, inner, moment, turn):
    """Fill ``inner`` but for positions and directors, which it has."""
    for j in range(frames.shape[0]):
        _moment(m0, force, inner.at[j], moment)
        fm, fx = inner.fm[j], inner.fx[j]
        stage(
            frames[j],
            moment,
            rest[j],
            piece.stiffness,
            inner.d[j],
            turn,
            inner.f[j],
            inner.fq[j],
            fm,
            inner.gq[j],
        )
        for a in range(4):
            fx[a, 0] = fm[a, 1] * force[2] - fm[a, 2] * force[1]
            fx[a, 1] = fm[a, 2] * force[0] - fm[a, 0] * force[2]
            fx[a, 2] = fm[a, 0] * force[1] - fm[a, 1] * force[0]


@njit(cache=True)
def _matrix(rule, h, inner, out_w):
    """The interval's matrix: slopes less what q' gains, directly and by the positions."""
    m = inner.f.shape[0]
    for j in range(m):
        for a in range(4):
            row = 4 * j + a
            for i in range(m):
                for b in range(4):
                    out_w[row, 4 * i + b] = 0.0
                out_w[row, 4 * i + a] = rule.slope[j, i] / h
            for b in range(4):
                out_w[row, 4 * j + b] -= inner.fq[j, a, b]
        for i in range(m):
            factor = h * rule.partial[j, i]
            for a in range(4):
                x0 = factor * inner.fx[j, a, 0]
                x1 = factor * inner.fx[j, a, 1]
                x2 = factor * inner.fx[j, a, 2]
                for b in range(4):
                    out_w[4 * j + a, 4 * i + b] -= (
                        x0 * inner.gq[i, 0, b] + x1 * inner.gq[i, 1, b] + x2 * inner.gq[i, 2, b]
                    )


@njit(cache=True)
def _columns(rule, loads, h, node, frames, dq, dr, inner, out_w):
    """The interval's right-hand sides: variations with p and gamma, and the residual's, last."""
    m = inner.f.shape[0]
    size, n_p, n_c = 4 * m, loads.shape[1], dq.shape[1]
    for j in range(m):
        at, fm, fx = inner.at[j], inner.fm[j], inner.fx[j]
        for c in range(n_c):
            v0, v1, v2 = 0.0, 0.0, 0.0  # of the moment, by p itself
            if c < n_p:
                v0 = loads[0, c] + loads[4, c] * at[2] - loads[5, c] * at[1]
                v1 = loads[1, c] + loads[5, c] * at[0] - loads[3, c] * at[2]
                v2 = loads[2, c] + loads[3, c] * at[1] - loads[4, c] * at[0]
            for a in range(4):
                out_w[4 * j + a, size + c] = (
                    rule.slope_sum[j] * dq[a, c] / h
                    + fm[a, 0] * v0
                    + fm[a, 1] * v1
                    + fm[a, 2] * v2
                    + fx[a, 0] * dr[0, c]
                    + fx[a, 1] * dr[1, c]
                    + fx[a, 2] * dr[2, c]
                )
        for a in range(4):
            residual = -rule.slope_sum[j] * node[a] / h - inner.f[j, a]
            for i in range(m):
                residual += rule.slope[j, i] * frames[i, a] / h
            out_w[4 * j + a, size + n_c - 1] -= residual


@njit(cache=True)
def _carry(rule, h, frames, inner, z, node, place, out_node, out_place, out_dq, out_dr):
    """Right end of an interval, with its variations, from the left one's and the stages'."""
    m, n_c = inner.f.shape[0], out_dq.shape[1]
    for a in range(4):
        out_node[a] = rule.first * node[a]
        for j in range(m):
            out_node[a] += rule.last[j] * frames[j, a]
        for c in range(n_c):
            total = rule.first * out_dq[a, c]
            for j in range(m):
                total += rule.last[j] * z[4 * j + a, c]
            out_dq[a, c] = total
    for k in range(3):
        out_place[k] = place[k]
        for j in range(m):
            out_place[k] += h * rule.weights[j] * inner.d[j, 2, k]
            for b in range(4):
                factor = h * rule.weights[j] * inner.gq[j, k, b]
                for c in range(n_c):
                    out_dr[k, c] += factor * z[4 * j + b, c]


@njit(cache=True)
def _forward(rule, piece, h, rest, frames, p, gamma, nodes, places, z, dq, dr, inner, w, target):
    """Eliminate all intervals, one after the other; returns the determinant's sign, 0 if singular.

    Fills ``nodes``, ``places``, ``z`` (variations at the stages), ``dq`` and ``dr`` (at the far
    end), and ``target`` (2, 4): the frame wanted there and its derivative by gamma.
    """
    m0, force, moment = np.empty(3), np.empty(3), np.empty(3)
    turn, d_start = np.empty((3, 4)), np.empty(4)
    size = 4 * rest.shape[1]
    _constants(piece.loads, p, m0, force)
    _ends(piece.quarter, piece.start, piece.end, p, gamma, nodes[0], d_start, target[0], target[1])
    dq[:] = 0.0
    dr[:] = 0.0
    dq[:, 0 if piece.quarter else p.size] = d_start
    places[0] = 0.0
    sign = 1
    for i in range(len(h)):
        _stages(rule.partial, h[i], places[i], frames[i], inner.at, inner.d)
        _right_hand_sides(piece, h[i], rest[i], m0, force, frames[i], inner, moment, turn)
        _matrix(rule, h[i], inner, w)
        _columns(rule, piece.loads, h[i], nodes[i], frames[i], dq, dr, inner, w)
        sign *= _eliminate(w, size)
        if sign == 0:
            return 0
        z[i] = w[:, size:]
        _carry(
            rule,
            h[i],
            frames[i],
            inner,
            z[i],
            nodes[i],
            places[i],
            nodes[i + 1],
            places[i + 1],
            dq,
            dr,
        )
    return sign


@njit(cache=True)
def _border(rule, h, along, along_gamma, z, node, place, dq, dr, target, out):
    """The small system: conditions at the far end, and the row of the tangent.

    Columns p, gamma | increment that removes the residual, orthogonal to the tangent | tangent.
    """
    n_p = out.shape[0] - 1
    G, R = n_p, n_p + 1
    n, m = along.shape[:2]
    vec, q = np.empty(3), np.empty(4)
    length = h.sum()
    out[:] = 0.0
    for c in range(R + 1):
        for a in range(4):
            q[a] = dq[a, c]
        _vector_part(target[0], q, vec)
        for k in range(3):
            out[k, c] = vec[k]
        for k in range(n_p - 3):  # r1, and r2 of a half
            out[3 + k, c] = dr[k, c]
    _vector_part(target[1], node, vec)
    for k in range(3):
        out[k, G] += vec[k]
    _vector_part(target[0], node, vec)
    for k in range(3):
        out[k, R] += vec[k]
    for k in range(n_p - 3):
        out[3 + k, R] += place[k]
    for i in range(n):
        for j in range(m):
            for a in range(4):
                factor = 4.0 * h[i] * rule.weights[j] / length * along[i, j, a]
                for c in range(R + 1):
                    out[n_p, c] += factor * z[i, 4 * j + a, c]
    out[n_p, G] += along_gamma
    out[:, R] *= -1.0
    out[n_p, R + 1] = 1.0


@njit(cache=True)
def _move(rule, h, z, step, rates, frames, out_tangent):
    """Add the increment to the frames; returns its size and the tangent's square, frames' part."""
    n, m = frames.shape[:2]
    n_q = len(rates)  # p and gamma
    size, square = 0.0, 0.0
    length = h.sum()
    for i in range(n):
        for j in range(m):
            for a in range(4):
                change, along = z[i, 4 * j + a, n_q], 0.0
                for c in range(n_q):
                    change += z[i, 4 * j + a, c] * step[c]
                    along += z[i, 4 * j + a, c] * rates[c]
                frames[i, j, a] += change
                size = max(size, abs(change))
                out_tangent[i, j, a] = along
                square += 4.0 * h[i] * rule.weights[j] / length * along * along
    return size, square


@njit(cache=True)
def correct(
    rule, piece, h, rest, frames, p, gamma, along, along_gamma, by_gamma, iterations, tolerance
):
    """Newton's method from a guess, in place, and the tangent of the path at the result.

    Parameters
    ----------
    rule : `gauss.Rule`; piece : `Piece`.
    h : (n,) lengths of the intervals; rest : (n, m) k1u at the stages.
    frames : (n, m, 4), p : (n_p,), gamma : the guess; frames and p are overwritten.
    along : (n, m, 4), along_gamma : the tangent to which the step is orthogonal, and that orients
        the new one.
    by_gamma : whether gamma is given instead.
    iterations : at most; tolerance : of the last increment, whose square is the error left.

    Returns
    -------
    status : one of CONVERGED, DIVERGED, SLOW, SINGULAR.
    done : iterations; size : the last increment.
    gamma : of the result.
    nodes : (n + 1, 4) frames and places : (n + 1, 3) positions less the first, at the mesh points.
    tangent : (n, m, 4), tangent_p : (n_p,), tangent_gamma; of unit length in the mean square of
        rotations and gamma.
    rate : dM along it, M the moment of one arm.
    orientation : sign of the determinant of the whole system, tangent row included.
    """
    n, m = rest.shape
    n_p = p.size
    G, R = n_p, n_p + 1  # columns: p, gamma, residual
    nodes, places = np.empty((n + 1, 4)), np.empty((n + 1, 3))
    z = np.empty((n, 4 * m, n_p + 2))
    dq, dr = np.empty((4, n_p + 2)), np.empty((3, n_p + 2))
    w = np.empty((4 * m, 4 * m + n_p + 2))
    inner = Inner(
        np.empty((m, 3)),
        np.empty((m, 3, 3)),
        np.empty((m, 4)),
        np.empty((m, 4, 4)),
        np.empty((m, 4, 3)),
        np.empty((m, 4, 3)),
        np.empty((m, 3, 4)),
    )
    target = np.empty((2, 4))
    small = np.empty((n_p + 1, n_p + 3))
    tangent = np.zeros_like(frames)
    tangent_p, tangent_gamma, rate = np.zeros(n_p), 0.0, 0.0
    orientation, status, done, size = 0, SLOW, 0, np.inf

    while done < iterations:
        done += 1
        orientation = _forward(
            rule, piece, h, rest, frames, p, gamma, nodes, places, z, dq, dr, inner, w, target
        )
        if orientation != 0:
            _border(rule, h, along, along_gamma, z, nodes[n], places[n], dq, dr, target, small)
            orientation *= _eliminate(small, n_p + 1)
        if orientation == 0 or (by_gamma and small[G, R + 1] == 0.0):
            status = SINGULAR
            break
        step, rates = small[:, R].copy(), small[:, R + 1].copy()
        if by_gamma:  # less what the tangent adds to gamma
            step -= step[G] / rates[G] * rates
            step[G] = 0.0
        size, square = _move(rule, h, z, step, rates, frames, tangent)
        unit = 1.0 / np.sqrt(square + rates[G] * rates[G])
        tangent *= unit
        tangent_p, tangent_gamma = unit * rates[:n_p], unit * rates[G]
        rate = unit * _moment_rate(piece.loads, p, places[n], dr, rates)
        for c in range(n_p):
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

    return (
        status,
        done,
        size,
        gamma,
        nodes,
        places,
        tangent,
        tangent_p,
        tangent_gamma,
        rate,
        orientation,
    )


@njit(cache=True)
def _moment_rate(loads, p, place, dr, rates):
    """Rate of M = -m3 at the end, m3 = m03 + F1 r2 - F2 r1."""
    m0, force = np.empty(3), np.empty(3)
    _constants(loads, p, m0, force)
    total = 0.0
    for c in range(len(rates)):
        total -= rates[c] * (force[0] * dr[1, c] - force[1] * dr[0, c])
        if c < len(p):
            total -= rates[c] * (loads[2, c] + loads[3, c] * place[1] - loads[4, c] * place[0])
    return total


@njit(cache=True)
def observe(rule, piece, h, rest, frames, p):
    """Moment of one arm M = -m3 at the end, and the sector's energy; (A.7), (A.21)."""
    n, m = rest.shape
    m0, force, moment = np.empty(3), np.empty(3), np.empty(3)
    at, d = np.empty((m, 3)), np.empty((m, 3, 3))
    place = np.zeros(3)
    _constants(piece.loads, p, m0, force)
    energy = 0.0
    for i in range(n):
        _stages(rule.partial, h[i], place, frames[i], at, d)
        for j in range(m):
            _moment(m0, force, at[j], moment)
            for k in range(3):
                local = d[j, k, 0] * moment[0] + d[j, k, 1] * moment[1] + d[j, k, 2] * moment[2]
                energy += 0.5 * h[i] * rule.weights[j] * local * local / piece.stiffness[k]
        for j in range(m):
            for k in range(3):
                place[k] += h[i] * rule.weights[j] * d[j, 2, k]
    _moment(m0, force, place, moment)
    return -moment[2], energy
