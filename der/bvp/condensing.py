"""The terms of one Newton iteration: intervals are condensed one after the other.

An interval gives one dense system of 4 m unknowns. Its right-hand sides are the variations of its
left end, of p and of gamma, and the residual. The next interval starts from the variations at its
right end. See `corrector`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.bvp.equations import directors, product, stage
from der.bvp.gauss import Array, rule
from der.packs.kernel import kernel

# the rule's tables are constants to the kernels, see `gauss.Rule`
WEIGHTS, PARTIAL, SLOPE = rule().weights, rule().partial, rule().slope
SLOPE_SUM, LAST, FIRST = rule().slope_sum, rule().last, rule().first


class Piece(NamedTuple):
    """What the kernels know of a sector; see `sectors`."""

    quarter: bool  # whether it starts at a free point and not at a grip
    stiffness: Array  # (3,) B = (alpha, beta, 1)
    start: Array  # (4,) frames of the flat ring at the ends
    end: Array
    loads: Array  # (6, n_p) p -> (m0, F)


class Inner(NamedTuple):
    """Workspace: the terms of an interval's equations at its m stages.

    The numbers q of all stages stand in one row of 4 m, along which the longest loops run.
    """

    at: Array  # (m, 3) positions less the first
    d: Array  # (m, 3, 3) directors
    f: Array  # (m, 4) q'
    fq: Array  # (m, 4, 4) its derivatives by q,
    fm: Array  # (m, 4, 3) by the moment there,
    fp: Array  # (6, 4 m) by m0 and F
    fx: Array  # (3, 4 m) and by position
    gq: Array  # (m, 3, 4) derivative of d3 by q
    bent: Array  # (3, 4 m) change of q' by the tangents of one stage


class Work(NamedTuple):
    """Workspace of Newton's method, with p and gamma as the first n_p + 1 variations."""

    z: Array  # (n, n_p + 2, 4 m) variations at the stages, the residual's last,
    dq: Array  # (n_p + 2, 4) and of frame
    dr: Array  # (n_p + 2, 3) and position at the right end of an interval
    w: Array  # (4 m + n_p + 2, 4 m) columns of one interval
    inner: Inner
    target: Array  # (2, 4) frame wanted at the far end, and its derivative by gamma
    small: Array  # (n_p + 3, n_p + 1) columns of the border


@kernel
def workspace(n, m, n_p):
    """Workspace for up to n intervals of m stages."""
    inner = Inner(
        np.empty((m, 3)),
        np.empty((m, 3, 3)),
        np.empty((m, 4)),
        np.empty((m, 4, 4)),
        np.empty((m, 4, 3)),
        np.empty((6, 4 * m)),
        np.empty((3, 4 * m)),
        np.empty((m, 3, 4)),
        np.empty((3, 4 * m)),
    )
    return Work(
        np.empty((n, n_p + 2, 4 * m)),
        np.empty((n_p + 2, 4)),
        np.empty((n_p + 2, 3)),
        np.empty((4 * m + n_p + 2, 4 * m)),
        inner,
        np.empty((2, 4)),
        np.empty((n_p + 3, n_p + 1)),
    )


@kernel
def eliminate(w):
    """Solve in place: (n + c, n) columns of [matrix | right-hand sides]; the determinant's sign.

    0 where a pivot vanishes. Solutions replace the right-hand sides, multipliers the matrix.
    Gauss-Jordan elimination takes more products than Gaussian elimination, but its loops run over n
    neighbouring numbers.
    """
    n = w.shape[1]
    sign = 1
    for k in range(n):
        pivot, row = abs(w[k, k]), k
        for i in range(k + 1, n):
            size = abs(w[k, i])
            row = i if size > pivot else row
            pivot = size if size > pivot else pivot
        if not pivot > 0.0:
            return 0
        if w[k, row] < 0.0:
            sign = -sign
        if row != k:
            sign = -sign
            for j in range(k, w.shape[0]):
                w[j, k], w[j, row] = w[j, row], w[j, k]
        inverse = 1.0 / w[k, k]
        for i in range(n):
            w[k, i] *= inverse
        w[k, k] = 0.0
        for j in range(k + 1, w.shape[0]):
            factor = w[j, k]
            for i in range(n):
                w[j, i] -= factor * w[k, i]
            w[j, k] = factor * inverse
    return sign


@kernel
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


@kernel
def constants(loads, p, out_m0, out_force):
    """Moment m0 at the start, and force, from p."""
    for k in range(3):
        out_m0[k], out_force[k] = 0.0, 0.0
        for c in range(p.size):
            out_m0[k] += loads[k, c] * p[c]
            out_force[k] += loads[3 + k, c] * p[c]


@kernel
def stages(h, place, frames, out_at, out_d):
    """Positions and directors at the stages of an interval that starts at ``place``."""
    m = frames.shape[0]
    for j in range(m):
        directors(frames[j], out_d[j])
    for j in range(m):
        for k in range(3):
            total = 0.0
            for i in range(m):
                total += PARTIAL[j, i] * out_d[i, 2, k]
            out_at[j, k] = place[k] + h * total


@kernel
def moment_at(m0, force, at, out):
    """Moment at a position: m0 + F x r."""
    out[0] = m0[0] + force[1] * at[2] - force[2] * at[1]
    out[1] = m0[1] + force[2] * at[0] - force[0] * at[2]
    out[2] = m0[2] + force[0] * at[1] - force[1] * at[0]


@kernel
def _right_hand_sides(piece, rest, m0, force, frames, inner, moment, turn):
    """Fill ``inner``, except for positions and directors, which are known."""
    for j in range(frames.shape[0]):
        at, d, f = inner.at[j], inner.d[j], inner.f[j]
        fq, fm, gq = inner.fq[j], inner.fm[j], inner.gq[j]
        moment_at(m0, force, at, moment)
        stage(frames[j], moment, rest[j], piece.stiffness, d, turn, f, fq, fm, gq)
        for a in range(4):
            row = 4 * j + a
            f1, f2, f3 = fm[a, 0], fm[a, 1], fm[a, 2]
            inner.fp[0, row], inner.fp[1, row], inner.fp[2, row] = f1, f2, f3
            inner.fp[3, row] = at[1] * f3 - at[2] * f2
            inner.fp[4, row] = at[2] * f1 - at[0] * f3
            inner.fp[5, row] = at[0] * f2 - at[1] * f1
            inner.fx[0, row] = f2 * force[2] - f3 * force[1]
            inner.fx[1, row] = f3 * force[0] - f1 * force[2]
            inner.fx[2, row] = f1 * force[1] - f2 * force[0]


@kernel
def _matrix(h, inner, out_w):
    """The interval's matrix, times h: slopes less what q' gains, directly and by the positions."""
    m, size = inner.f.shape[0], out_w.shape[1]
    bent = inner.bent
    for i in range(m):
        for j in range(m):
            factor = -h * h * PARTIAL[j, i]
            for row in range(4 * j, 4 * j + 4):
                for k in range(3):
                    bent[k, row] = factor * inner.fx[k, row]
        for b in range(4):
            column = 4 * i + b
            g1, g2, g3 = inner.gq[i, 0, b], inner.gq[i, 1, b], inner.gq[i, 2, b]
            for row in range(size):
                out_w[column, row] = bent[0, row] * g1 + bent[1, row] * g2 + bent[2, row] * g3
            for j in range(m):
                out_w[column, 4 * j + b] += SLOPE[j, i]
            for a in range(4):
                out_w[column, 4 * i + a] -= h * inner.fq[i, a, b]


@kernel
def _columns(loads, h, node, frames, dq, dr, inner, out_w):
    """The interval's right-hand sides, times h: variations with p, gamma; the residual's last."""
    m, size = inner.f.shape[0], out_w.shape[1]
    n_p, n_c = loads.shape[1], dq.shape[0]
    for c in range(n_c):
        column = size + c
        for j in range(m):
            for a in range(4):
                out_w[column, 4 * j + a] = SLOPE_SUM[j] * dq[c, a]
        r1, r2, r3 = h * dr[c, 0], h * dr[c, 1], h * dr[c, 2]
        for row in range(size):
            out_w[column, row] += (
                r1 * inner.fx[0, row] + r2 * inner.fx[1, row] + r3 * inner.fx[2, row]
            )
        if c < n_p:
            for k in range(6):
                factor = h * loads[k, c]
                if factor != 0.0:
                    for row in range(size):
                        out_w[column, row] += factor * inner.fp[k, row]
    for j in range(m):
        for a in range(4):
            slope = -SLOPE_SUM[j] * node[a]
            for i in range(m):
                slope += SLOPE[j, i] * frames[i, a]
            out_w[size + n_c - 1, 4 * j + a] -= slope - h * inner.f[j, a]


@kernel
def _carry(h, frames, inner, z, node, place, out_node, out_place, out_dq, out_dr):
    """Right end of an interval, with its variations, from the left one's and the stages'."""
    m = inner.f.shape[0]
    for a in range(4):
        out_node[a] = FIRST * node[a]
        for j in range(m):
            out_node[a] += LAST[j] * frames[j, a]
    for k in range(3):
        out_place[k] = place[k]
        for j in range(m):
            out_place[k] += h * WEIGHTS[j] * inner.d[j, 2, k]
    for c in range(out_dq.shape[0]):
        for a in range(4):
            out_dq[c, a] *= FIRST
        r1, r2, r3 = 0.0, 0.0, 0.0
        for j in range(m):
            for a in range(4):
                change = z[c, 4 * j + a]
                out_dq[c, a] += LAST[j] * change
                moved = WEIGHTS[j] * change
                r1 += moved * inner.gq[j, 0, a]
                r2 += moved * inner.gq[j, 1, a]
                r3 += moved * inner.gq[j, 2, a]
        out_dr[c, 0] += h * r1
        out_dr[c, 1] += h * r2
        out_dr[c, 2] += h * r3


@kernel
def forward(piece, h, rest, frames, p, gamma, work, nodes, places):
    """Eliminate all intervals, one after the other; returns the determinant's sign, 0 if singular.

    Fills ``nodes``, ``places``, and of ``work`` all but ``small``; ``dq`` and ``dr`` are then those
    at the far end.
    """
    z, dq, dr, w, inner, target = work.z, work.dq, work.dr, work.w, work.inner, work.target
    m0, force, moment = np.empty(3), np.empty(3), np.empty(3)
    turn, d_start = np.empty((3, 4)), np.empty(4)
    size = w.shape[1]
    constants(piece.loads, p, m0, force)
    _ends(piece.quarter, piece.start, piece.end, p, gamma, nodes[0], d_start, target[0], target[1])
    turned = 0 if piece.quarter else p.size
    for c in range(dq.shape[0]):
        for a in range(4):
            dq[c, a] = d_start[a] if c == turned else 0.0
        for k in range(3):
            dr[c, k] = 0.0
    for k in range(3):
        places[0, k] = 0.0
    sign = 1
    for i in range(len(h)):
        stages(h[i], places[i], frames[i], inner.at, inner.d)
        _right_hand_sides(piece, rest[i], m0, force, frames[i], inner, moment, turn)
        _matrix(h[i], inner, w)
        _columns(piece.loads, h[i], nodes[i], frames[i], dq, dr, inner, w)
        sign *= eliminate(w)
        if sign == 0:
            return 0
        for c in range(z.shape[1]):
            for row in range(size):
                z[i, c, row] = w[size + c, row]
        _carry(
            h[i], frames[i], inner, z[i], nodes[i], places[i], nodes[i + 1], places[i + 1], dq, dr
        )
    return sign
