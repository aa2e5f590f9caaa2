"""Steps along the path on one mesh, by kernels: predict, correct, judge, estimate the error.

A guess follows the cubic through two states and their tangents: that of the last step beyond its
end, or of a step within it. Where to look within a step is decided elsewhere (`step`).

Constants handed to `newton` are of numpy's types: for each of Python's numba would
compile it again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.bvp.condensing import WEIGHTS, Piece, Work, workspace
from der.bvp.corrector import CONVERGED, DIVERGED, SLOW, newton, total
from der.bvp.gauss import Array, rule
from der.packs.kernel import kernel

TOO_SHARP, OTHER_BRANCH = 4, 5  # why a solution is not the next state; others in `corrector`
LARGEST_STEP, SMALLEST_STEP = 0.6, 1e-8
ANGLE = 0.15  # rad, aimed at between tangents of neighbouring states
SHARPEST = 0.6  # rad, a step that turns more is repeated shorter
STRAIGHT = 0.01  # bulge of a step that is believed although its ends are oriented unequally
EASY = 4  # Newton iterations; a step that takes more is followed by a shorter one
HALVINGS = 55  # of a step: to rounding
NEGLIGIBLE = 1e-3  # of the tolerance: square of a step's last increment, about the error left

HALVES, HALVES_INNER = rule().halves, rule().halves_inner
# numbers of a state; its errors; of the step to it: length and cosine of the angle between the
# tangents, both at the start, and length along the tangent at the end
GAMMA, MOMENT, ENERGY, TANGENT_GAMMA, MOMENT_RATE, ORIENTATION, ITERATIONS = range(7)
ERROR, LENGTH, COSINE, REACH, NUMBERS = 7, 10, 11, 12, 13


class States(NamedTuple):
    """Neighbouring states, one after the other; see `collocation.Solution`."""

    frames: Array  # (K, n, m, 4)
    p: Array  # (K, n_p)
    tangent: Array  # (K, n, m, 4)
    tangent_p: Array  # (K, n_p)
    nodes: Array  # (K, n + 1, 4)
    places: Array  # (K, n + 1, 3)
    numbers: Array  # (K, NUMBERS)


class Halved(NamedTuple):
    """Workspace: a state on halved intervals."""

    frames: Array  # (2 n, m, 4) the guess, and the result
    along: Array  # (2 n, m, 4) the direction across which it is corrected
    p: Array
    nodes: Array
    places: Array
    tangent: Array
    tangent_p: Array
    work: Work


@kernel
def _room(n, m, n_p):
    """Workspace for a state on n intervals, halved."""
    return Halved(
        np.empty((2 * n, m, 4)),
        np.empty((2 * n, m, 4)),
        np.empty(n_p),
        np.empty((2 * n + 1, 4)),
        np.empty((2 * n + 1, 3)),
        np.empty((2 * n, m, 4)),
        np.empty(n_p),
        workspace(2 * n, m, n_p),
    )


@kernel
def _halve(nodes, frames, p, tangent, out):
    """Fill a workspace with a state, its polynomials evaluated at the stages of half intervals."""
    n, m = frames.shape[:2]
    for i in range(n):
        for row in range(2 * m):
            half, j = 2 * i + row // m, row % m
            for a in range(4):
                value, rate = HALVES[row, 0] * nodes[i, a], 0.0
                for c in range(m):
                    value += HALVES[row, c + 1] * frames[i, c, a]
                    rate += HALVES_INNER[row, c] * tangent[i, c, a]
                out.frames[half, j, a], out.along[half, j, a] = value, rate
    for c in range(p.size):
        out.p[c] = p[c]


@kernel
def _errors(piece, h, rest, nodes, frames, p, tangent, row, fine):
    """Change of gamma, M and U of a state by one iteration on halved intervals, ``h`` and ``rest``.

    The polynomials are accurate to h^(m+1) between the mesh points, so one iteration leaves the
    square of that: the change is the discretisation error of the coarse solution, h^(2m), to 1 part
    in 2^(2m).
    """
    _halve(nodes, frames, p, tangent, fine)
    status, _, gamma, _, _, _, moment, energy = newton(
        piece, h, rest, fine.frames, fine.p, row[GAMMA], fine.along, row[TANGENT_GAMMA],
        np.bool_(False), np.int64(1), 0.0, fine.work, fine.nodes, fine.places, fine.tangent,
        fine.tangent_p,
    )  # fmt: skip
    if status != SLOW:  # not even one
        return np.inf, np.inf, np.inf
    energy *= copies(piece)
    return abs(gamma - row[GAMMA]), abs(moment - row[MOMENT]), abs(energy - row[ENERGY])


@kernel
def errors(
    quarter, stiffness, start, end, loads, fine_h, fine_rest, nodes, frames, p, tangent, numbers
):
    """Estimated errors of gamma, M and U of a state, from its solution on halved intervals."""
    piece, (n, m) = Piece(quarter, stiffness, start, end, loads), frames.shape[:2]
    fine = _room(n, m, p.size)
    return _errors(piece, fine_h, fine_rest, nodes, frames, p, tangent, numbers, fine)


@kernel
def copies(piece):
    """How many of the sector make the ring."""
    return 4 if piece.quarter else 2


@kernel
def _combine(at, k, of_x, of_y, of_first, of_last, out_frames, out_p):
    """Sum of the states k - 1 and k and their tangents, with weights; returns its gamma."""
    x, y, numbers = max(k - 1, 0), k, at.numbers
    for i in range(out_frames.shape[0]):
        for j in range(out_frames.shape[1]):
            for a in range(4):
                out_frames[i, j, a] = (
                    of_x * at.frames[x, i, j, a] + of_y * at.frames[y, i, j, a]
                    + of_first * at.tangent[x, i, j, a] + of_last * at.tangent[y, i, j, a]
                )  # fmt: skip
    for c in range(out_p.size):
        out_p[c] = (
            of_x * at.p[x, c] + of_y * at.p[y, c]
            + of_first * at.tangent_p[x, c] + of_last * at.tangent_p[y, c]
        )  # fmt: skip
    return (
        of_x * numbers[x, GAMMA] + of_y * numbers[y, GAMMA]
        + of_first * numbers[x, TANGENT_GAMMA] + of_last * numbers[y, TANGENT_GAMMA]
    )  # fmt: skip


@kernel
def _predict(at, k, length):
    """Fill frames and p of state k with a guess at a distance along the tangent; its gamma."""
    of_x, of_first, of_last = 0.0, 0.0, length  # on the tangent
    if k > 1:  # on the cubic of the step before, s measured along the tangent at its start
        step, cosine = at.numbers[k - 1, LENGTH], at.numbers[k - 1, COSINE]
        s = step + length * cosine
        u = s / step
        of_x, of_first = 1.0 - u * u * (3.0 - 2.0 * u), s * (1.0 - u) ** 2
        # the cubic does not know the distance along the tangent at the end
        of_last = length - of_first * cosine + of_x * at.numbers[k - 1, REACH]
    return _combine(at, k - 1, of_x, 1.0 - of_x, of_first, of_last, at.frames[k], at.p[k])


@kernel
def _note(piece, found, row):
    """Fill the numbers of a state from what Newton's method returns."""
    _, iterations, gamma, tangent_gamma, rate, orientation, moment, energy = found
    row[GAMMA], row[MOMENT], row[ENERGY] = gamma, moment, copies(piece) * energy
    row[TANGENT_GAMMA], row[MOMENT_RATE] = tangent_gamma, rate
    row[ORIENTATION], row[ITERATIONS] = orientation, iterations


@kernel
def _cubic(step, s):
    """Weights at ``s`` of start, end and their tangents on the cubic to a state, by its numbers."""
    u = s / step[LENGTH]
    of_end, of_first = u * u * (3.0 - 2.0 * u), s * (1.0 - u) ** 2
    return 1.0 - of_end, of_end, of_first, s * u * (u - 1.0) / step[COSINE]  # s: at the start


@kernel
def _expected(numbers, k, s):
    """Gamma at ``s`` on the cubic to state k."""
    of_start, of_end, of_first, of_last = _cubic(numbers[k], s)
    x, y = numbers[k - 1], numbers[k]
    rates = of_first * x[TANGENT_GAMMA] + of_last * y[TANGENT_GAMMA]
    return of_start * x[GAMMA] + of_end * y[GAMMA] + rates


@kernel
def _place(numbers, k, gamma, low, high):
    """Where gamma is as wanted on the cubic to state k, by bisection; NaN where it is not."""
    rises = _expected(numbers, k, high) > gamma
    if (_expected(numbers, k, low) > gamma) == rises:
        return np.nan
    for _ in range(HALVINGS):
        s = 0.5 * (low + high)
        if (_expected(numbers, k, s) > gamma) == rises:
            high = s
        else:
            low = s
    return 0.5 * (low + high)


@kernel
def between(
    quarter, stiffness, start, end, loads, h, rest, k, low, high, gamma, by_gamma, tolerance,
    frames, p, tangent, tangent_p, nodes, places, numbers,
    out_frames, out_p, out_tangent, out_tangent_p, out_nodes, out_places, out_numbers,
):  # fmt: skip
    """Fill one state: the solution beside the cubic of the step to state k, at low = high = s.

    With gamma given, between low and high.

    Returns
    -------
    status : of Newton's method, which corrects in the plane across the tangent at the start, or
        with gamma held; DIVERGED where the cubic has no such gamma.
    s : distance of the solution along that tangent.
    away : its distance from the cubic at ``s``, without that of gamma.
    """
    piece = Piece(quarter, stiffness, start, end, loads)
    at = States(frames, p, tangent, tangent_p, nodes, places, numbers)
    (n, m), n_p, first = rest.shape, p.shape[1], numbers[k - 1, TANGENT_GAMMA]
    s = _place(numbers, k, gamma, low, high) if by_gamma else low
    if not s >= 0.0:
        return DIVERGED, s, s
    guess = np.empty((n, m, 4))
    of_start, of_end, of_first, of_last = _cubic(numbers[k], s)
    expected = _combine(at, k, of_start, of_end, of_first, of_last, guess, out_p)
    for i in range(n):
        for j in range(m):
            for a in range(4):
                out_frames[i, j, a] = guess[i, j, a]
    found = newton(
        piece, h, rest, out_frames, out_p, gamma if by_gamma else expected, tangent[k - 1], first,
        by_gamma, np.int64(12), tolerance, workspace(n, m, n_p), out_nodes, out_places, out_tangent,
        out_tangent_p,
    )  # fmt: skip
    _note(piece, found, out_numbers)
    reached, square, sector = first * (found[2] - numbers[k - 1, GAMMA]), 0.0, total(h)
    for i in range(n):
        for j in range(m):
            weight = 4.0 * h[i] * WEIGHTS[j] / sector
            for a in range(4):
                x = out_frames[i, j, a]
                reached += weight * tangent[k - 1, i, j, a] * (x - frames[k - 1, i, j, a])
                square += weight * (x - guess[i, j, a]) ** 2
    return found[0], reached, np.sqrt(square)


@kernel
def _judge(h, at, k, length):
    """Whether state k may follow the one before, as a status; fills the numbers of the step."""
    before, row = at.numbers[k - 1], at.numbers[k]
    first, last, jump = before[TANGENT_GAMMA], row[TANGENT_GAMMA], row[GAMMA] - before[GAMMA]
    cosine, reach, square, sector = first * last, last * jump, jump * jump, total(h)
    for i in range(h.size):
        for j in range(at.frames.shape[2]):
            weight = 4.0 * h[i] * WEIGHTS[j] / sector
            for a in range(4):
                first, last = at.tangent[k - 1, i, j, a], at.tangent[k, i, j, a]
                jump = at.frames[k, i, j, a] - at.frames[k - 1, i, j, a]
                cosine += weight * first * last
                reach += weight * last * jump
                square += weight * jump * jump
    row[LENGTH], row[COSINE], row[REACH] = length, cosine, reach
    if not _angle(row) < SHARPEST:
        return TOO_SHARP
    bulge = np.sqrt(max(square / length**2 - 1.0, 0.0))  # distance from the tangent, over length
    alike = row[ORIENTATION] == before[ORIENTATION]
    return CONVERGED if alike or bulge < STRAIGHT else OTHER_BRANCH


@kernel
def _angle(row):
    """Angle between the tangents at both ends of the step to a state."""
    return np.arccos(min(1.0, max(-1.0, row[COSINE])))


@kernel
def _next_length(row):
    """Length of the step after that to a state."""
    ease = np.sqrt(ANGLE / max(_angle(row), 1e-3))
    if row[ITERATIONS] > EASY:
        ease = min(ease, 0.7)
    return min(row[LENGTH] * min(max(ease, 0.5), 2.0), LARGEST_STEP)


@kernel
def march(
    quarter, stiffness, start, end, loads, h, rest, fine_h, fine_rest,
    k, length, tolerance, moment, energy, stops,
    out_frames, out_p, out_tangent, out_tangent_p, out_nodes, out_places, out_numbers,
):  # fmt: skip
    """Go on from state k - 1, by the cubic of the step to it where k > 1.

    The march ends where the arrays are full, with a state whose error is too large, with a step
    across a gamma where the path may stop, or where no step can be taken.

    Parameters
    ----------
    quarter, stiffness, start, end, loads : the parts of a `Piece`.
    h, rest : as for `correct`; fine_h, fine_rest : of the halved intervals.
    k : states that are known; length : of the first step, which is shortened until Newton's method
        follows.
    tolerance : of the error, of gamma relative to pi; moment, energy : what the others are relative
        to, unless a state has larger ones.
    stops : values of gamma where the path may stop.
    out_frames, ... : see `States`.

    Returns
    -------
    k : states that are known now.
    status : CONVERGED, or why the last step was not taken.
    length : of the next step.
    iterations : of Newton's method.

    Notes
    -----
    What Newton's method leaves is the square of the last increment, times 13 at most (measured);
    the tangent is that before it.
    """
    piece, (n, m), n_p = Piece(quarter, stiffness, start, end, loads), rest.shape, out_p.shape[1]
    at = States(out_frames, out_p, out_tangent, out_tangent_p, out_nodes, out_places, out_numbers)
    fine, close = _room(n, m, n_p), np.sqrt(NEGLIGIBLE * tolerance)
    status, iterations, over = CONVERGED, 0, False
    while k < out_p.shape[0] and not over:
        before, row = out_numbers[k - 1], out_numbers[k]
        guess = _predict(at, k, length)
        found = newton(
            piece, h, rest, at.frames[k], at.p[k], guess, at.tangent[k - 1], before[TANGENT_GAMMA],
            np.bool_(False), np.int64(7), close, fine.work, at.nodes[k], at.places[k],
            at.tangent[k], at.tangent_p[k],
        )  # fmt: skip
        _note(piece, found, row)
        iterations += found[1]
        status = found[0]
        if status == CONVERGED:
            status = _judge(h, at, k, length)
        if status != CONVERGED:
            length *= 0.5
            if not length > SMALLEST_STEP:
                break
            continue
        row[ERROR], row[ERROR + 1], row[ERROR + 2] = _errors(
            piece, fine_h, fine_rest, at.nodes[k], at.frames[k], at.p[k], at.tangent[k], row, fine
        )
        moment, energy = max(moment, abs(row[MOMENT])), max(energy, abs(row[ENERGY]))
        larger = max(row[ERROR] / np.pi, row[ERROR + 1] / moment)
        over = not max(larger, row[ERROR + 2] / energy) <= tolerance
        for stop in stops:
            over = over or (before[GAMMA] - stop) * (row[GAMMA] - stop) <= 0.0
        length = _next_length(row)
        k += 1
    return k, status, length, iterations
