"""The path by `scipy.integrate.solve_bvp`, stepping through gamma: (A.15) as it is written."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

import der
from der.bvp.gauss import Array
from der.geometry.ring import Ring

STEPS = 33  # to pi, as many as AUTO-07p took on the circle; halved where solve_bvp fails
MOST_NODES = 20_000
FIRST_NODES = 6  # per segment
SHORTEST = 1e-3  # rad; a path that folds can be stepped no further


@dataclass(frozen=True)
class Stepped:
    """The path that was found."""

    gamma: Array  # (n,) rad
    moment: Array  # (n,) GJ/a, of one arm
    energy: Array  # (n,) GJ/a, of the full ring
    steps: int
    nodes: int  # of the last solution, over all segments

    @property
    def note(self) -> str:
        """Steps and nodes in words."""
        return f"{self.steps} steps, {self.nodes} nodes"


def stepped(scene: der.Scene, tolerance: float) -> Stepped:
    """The path of a ring with two symmetries by steps of gamma, each from the one before.

    Raises
    ------
    ValueError
        For a ring without quarter, or a path that cannot be stepped to its end.
    """
    ring, section = scene.ring, scene.section
    if ring.symmetry != "D2":
        raise ValueError(f"ring must have a quarter to be stepped here, got a {ring.shape}")
    pieces = _pieces(ring)
    x = np.linspace(0.0, 1.0, FIRST_NODES)
    y = np.concatenate([_flat(ring, begin + length * x) for begin, length in pieces])
    stiffness = (section.alpha, section.beta, 1.0)
    gamma, step = 0.0, math.pi / STEPS
    states = [(0.0, 0.0, 0.0)]
    while gamma < scene.gamma_max:
        ahead = min(gamma + step, scene.gamma_max)
        found: Any = solve_bvp(
            lambda x, y: _slopes(ring, pieces, stiffness, x, y),
            lambda a, b, gamma=ahead: _conditions(len(pieces), gamma, a, b),
            x,
            y,
            tol=tolerance,
            max_nodes=MOST_NODES,
        )
        if found.status != 0:
            step *= 0.5
            if step < SHORTEST:
                raise ValueError(f"gamma cannot be stepped beyond {gamma:.6f}: {found.message}")
            continue
        gamma, x, y = ahead, found.x, found.y
        energy = _energy(found.sol, x, pieces, stiffness)
        states.append((gamma, float(-y[-9, -1]), energy))
    gammas, moments, energies = np.array(states).T
    return Stepped(gammas, moments, energies, len(states) - 1, len(x) * len(pieces))


def _pieces(ring: Ring) -> list[tuple[float, float]]:
    """Begin and length of the segments of a quarter."""
    begin, end = 0.25 * ring.length, 0.5 * ring.length
    joints = [begin, *(s for s in ring.breaks if begin + 1e-12 < s < end - 1e-12), end]
    return [(a, b - a) for a, b in pairwise(joints)]


def _energy(
    solution: Any, x: Array, pieces: list[tuple[float, float]], stiffness: tuple[float, ...]
) -> float:
    """U of the full ring: four times the integral of m^2 / (2 EI), by Gauss's rule."""
    points, weights = np.polynomial.legendre.leggauss(4)
    half = 0.5 * np.diff(x)[:, None]
    y = solution((x[:-1, None] + half * (1.0 + points)).ravel())
    density = np.zeros(y.shape[1])
    for k, (_, length) in enumerate(pieces):
        moments = y[13 * k + 3 : 13 * k + 6]
        density += 0.5 * length * sum(m * m / s for m, s in zip(moments, stiffness, strict=True))
    return 4.0 * float(((half * weights).ravel() * density).sum())


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
