"""Rows of `der bench` on the boundary-value solver, with `scipy.integrate.solve_bvp` beside it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_bvp

import der
from der.ring import Ring
from der.sections import Section
from validation.curves import fold_error, read_reference
from validation.gauss import Array
from validation.solving import solve

REFERENCE = Path(__file__).parent / "reference"


class Case(NamedTuple):
    """A path with a reference, and the time that it should take."""

    name: str
    ring: Ring
    goal: float | None  # ms
    reference: str
    stepped: bool  # whether solve_bvp can step through gamma: no folds


CASES = (
    Case("circle, h/t 4", der.circle(), 10.0, "circ_ht4", True),
    Case(
        "rectangle 0.6, 0.3 about x, h/t 4",
        der.rectangle(0.6, 0.3),
        15.0,
        "rect_ba0.6_ra0.3_x_ht4",
        True,
    ),
    Case("ellipse 0.6 about x, h/t 4", der.ellipse(0.6), None, "ell_ba0.6_x_ht4", True),
    Case(
        "ellipse 0.85 about y, h/t 4, two folds",
        der.ellipse(0.85, "y"),
        None,
        "ell_ba0.85_y_ht4",
        False,
    ),
    Case(
        "triangle 60, 0.144, h/t 4",
        der.triangle(math.pi / 3, math.sqrt(3) / 12),
        None,
        "tri_aT60_ra0.1443_ht4",
        False,
    ),
    Case(
        "triangle 90, 1/30, h/t 4, two folds",
        der.triangle(math.pi / 2, 1 / 30),
        100.0,
        "tri_aT90_ra0.0333_ht4",
        False,
    ),
)


def rows(
    cpu_time: Callable[[Callable[[], object], int], float], repeats: int
) -> Iterator[tuple[str, str, float, str, float | None, str]]:
    """Group, case, value, unit, goal and note of each row."""
    for case in CASES:
        scene = der.Scene(case.ring, der.rectangular_section(4.0))
        coarse = cpu_time(lambda scene=scene: solve(scene, tolerance=1e-6), repeats)  # type: ignore[misc]
        path = solve(scene, tolerance=1e-6)
        note = f"{path.timing.steps} steps, {path.timing.newton_iterations} Newton iterations"
        yield "bvp path", f"{case.name}, 1e-6", 1e3 * coarse, "ms", case.goal, note
        seconds = cpu_time(lambda scene=scene: solve(scene), repeats)  # type: ignore[misc]
        yield "bvp path", f"{case.name}, 1e-8", 1e3 * seconds, "ms", None, ""
        yield "bvp error", f"{case.name}, 1e-8", *_error(scene, case.reference)
        if case.stepped:
            taken, difference, steps = _stepping(case.ring, der.rectangular_section(4.0), scene)
            note = f"{taken / coarse:.0f} times ours, M(pi) within {difference:.0e}"
            yield (
                "solve_bvp",
                f"{case.name}, {steps} steps of gamma, 1e-6",
                1e3 * taken,
                "ms",
                None,
                note,
            )


def _error(scene: der.Scene, name: str) -> tuple[float, str, float, str]:
    """Largest difference from the reference's states at multiples of pi/8, relative."""
    reference = read_reference(REFERENCE / f"{name}.csv")
    asked = np.array([k * math.pi / 8 for k in range(1, 8)])
    path = solve(scene)
    worst = 0.0
    for gamma, moment, energy in zip(
        reference.gamma, reference.moment, reference.energy, strict=True
    ):
        if np.abs(asked - gamma).min() > 1e-9:
            continue
        same = np.flatnonzero(np.abs(path.gamma - gamma) < 1e-9)
        _, scale, work = reference.scales
        apart = np.maximum(
            np.abs(path.moment[same] - moment) / scale, np.abs(path.energy[same] - energy) / work
        )
        worst = max(worst, float(apart.min()))
    folds = fold_error([point.gamma for point in path.folds], reference)
    note = f"folds off by {folds:.1e} rad" if reference.folds else ""
    return worst, "", 1e-8, note


def _stepping(ring: Ring, section: Section, scene: der.Scene) -> tuple[float, float, int]:
    """CPU time [s] of solve_bvp stepping through gamma, how far its M at pi is off, and its steps.

    33 steps where it follows (so many AUTO-07p took on the circle), halved where it does not.
    """
    pieces = _pieces(ring)
    x = np.linspace(0.0, 1.0, 6)
    y = np.concatenate([_flat(ring, begin + length * x) for begin, length in pieces])
    stiffness = (section.alpha, section.beta, 1.0)
    exact = solve(scene)
    start = time.process_time()
    gamma, step, steps = 0.0, math.pi / 33, 0
    while gamma < math.pi:
        ahead = min(gamma + step, math.pi)
        found: Any = solve_bvp(
            lambda x, y: _slopes(ring, pieces, stiffness, x, y),
            lambda a, b, gamma=ahead: _conditions(len(pieces), gamma, a, b),
            x,
            y,
            tol=1e-6,
            max_nodes=500,
        )
        if found.status != 0:
            step *= 0.5
            continue
        gamma, steps, x, y = ahead, steps + 1, found.x, found.y
    taken = time.process_time() - start
    return taken, abs(float(-y[-9, -1]) - float(exact.moment[-1])), steps


def _pieces(ring: Ring) -> list[tuple[float, float]]:
    """Begin and length of the segments of a quarter."""
    begin, end = 0.25 * ring.length, 0.5 * ring.length
    joints = [begin, *(s for s in ring.breaks if begin + 1e-12 < s < end - 1e-12), end]
    return [(a, b - a) for a, b in pairwise(joints)]


def _flat(ring: Ring, s: Array) -> Array:
    """The 13 unknowns F, M, q, r of the flat ring."""
    half = 0.5 * (ring.angle(s) - 0.5 * np.pi)
    y = np.zeros((13, len(s)))
    y[6], y[7] = np.cos(half), np.sin(half)
    y[10:] = ring.position(s).T
    return y


def _slopes(
    ring: Ring,
    pieces: list[tuple[float, float]],
    stiffness: tuple[float, float, float],
    x: Array,
    y: Array,
) -> Array:
    """(A.15) with the moments as unknowns, all segments on [0, 1]."""
    out = np.empty_like(y)
    for k, (begin, length) in enumerate(pieces):
        f1, f2, f3, m1, m2, m3, a, b, c, d, *_ = y[13 * k : 13 * k + 13]
        inside = np.clip(begin + length * x, begin + 1e-12, begin + length - 1e-12)
        k1 = ring.curvature(inside) + m1 / stiffness[0]
        k2, k3 = m2 / stiffness[1], m3 / stiffness[2]
        out[13 * k : 13 * k + 13] = length * np.array(
            [
                f2 * k3 - f3 * k2,
                f3 * k1 - f1 * k3,
                f1 * k2 - f2 * k1,
                m2 * k3 - m3 * k2 + f2,
                m3 * k1 - m1 * k3 - f1,
                m1 * k2 - m2 * k1,
                0.5 * (-b * k1 - c * k2 - d * k3),
                0.5 * (a * k1 - d * k2 + c * k3),
                0.5 * (d * k1 + a * k2 - b * k3),
                0.5 * (-c * k1 + b * k2 + a * k3),
                2 * (b * d + a * c),
                2 * (c * d - a * b),
                2 * (a * a + d * d) - 1.0,
            ]
        )
    return out


def _conditions(pieces: int, gamma: float, a: Array, b: Array) -> Array:
    """(A.17) to (A.20), and continuity at the joints."""
    last = b[13 * (pieces - 1) :]
    root = math.sqrt(0.5)
    c, s = root * math.cos(0.5 * gamma), root * math.sin(0.5 * gamma)
    start = [a[7], a[9], a[4], a[10], a[12], a[1]]
    end = [last[10], last[1], last[11], last[6] - c, last[7] - c, last[8] + s, last[9] + s]
    joints = a[13:] - b[: 13 * (pieces - 1)]
    return np.concatenate([start, end, joints])
