"""The boundary-value problem as the paper prints it, and shorthands for tests of its solver.

Equations (A.15) with its thirteen unknowns (F, k, q, r) of each segment, stacked as in Eq. (4), are
handed to scipy's solve_bvp: another discretisation (Lobatto, order 4), another mesh, other unknowns
than der.bvp.equations has, and conditions where the natural curvature jumps. Lengths in units of
a, GJ = 1.
"""

import functools
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from shapes import scene

import der
import der.analysis.curve_distance
from der.bvp.collocation import Collocation, Solution, collocation
from der.bvp.continuation import follow
from der.bvp.events import Point, Wanted
from der.bvp.meshes import moved_to
from der.bvp.sectors import sector
from der.bvp.step import Statistics

Array = NDArray[np.float64]

TABLES = Path(__file__).parents[1] / "validation" / "reference"
R = math.sqrt(0.5)


# --- shorthands -------------------------------------------------------------------------------


def system(ring: der.Ring, h_over_t: float, nu: float = 0.3, **wants: Any) -> Collocation:
    """The collocation equations of a ring."""
    return collocation(sector(scene(ring, h_over_t, nu, **wants)))


@functools.cache
def path(
    ring: der.Ring, h_over_t: float, nu: float = 0.3, tolerance: float = 1e-8, **wants: Any
) -> der.Path:
    """The path of a ring, solved once a run."""
    return der.solve_bvp(scene(ring, h_over_t, nu, **wants), tolerance=tolerance)


@functools.cache
def points(equations: Collocation, gamma: float, tolerance: float = 1e-8) -> tuple[Point, ...]:
    """All that is met on the way to the first arrival at ``gamma``."""
    wanted = Wanted(gamma_max=gamma, targets=(), tolerance=tolerance)
    return tuple(follow(equations, wanted, Statistics()))


def state_at(equations: Collocation, gamma: float, tolerance: float = 1e-8) -> Solution:
    """The state at the first arrival at ``gamma``."""
    return points(equations, gamma, tolerance)[-1].solution


class Row(NamedTuple):
    """A row of a reference table, U of the full ring."""

    kind: str
    gamma: float
    moment: float
    energy: float


def rows(name: str) -> list[Row]:
    """The rows of a table in validation/reference, in path order."""
    lines = (TABLES / f"{name}.csv").read_text().splitlines()
    copies = 2.0 if any("half model" in line for line in lines if line.startswith("#")) else 4.0
    table = [line.split(",") for line in lines if not line.startswith("#")][1:]
    return [Row(r[1], float(r[2]), float(r[3]), copies * float(r[4])) for r in table]


# --- the equations as printed -----------------------------------------------------------------


class Segment(NamedTuple):
    """A piece of the sector: an interval [0, 1] of (A.15), Eq. (2) or Eq. (4)."""

    begin: float  # arc length from the sector's start
    end: float
    aspect: float | None  # c of an ellipse, whose parameter is tau; None: constant curvature
    curvature: float  # k1u L of a straight or an arc


def natural(segment: Segment, x: Array) -> tuple[Array, Array, Array]:
    """k1u, its derivative by x and ds/dx at x in [0, 1], lengths in L; Eqs. (1), (2)."""
    c = segment.aspect
    if c is None:
        one = np.ones_like(x)
        return segment.curvature * one, 0.0 * one, (segment.end - segment.begin) * one
    tau = 0.5 * math.pi * x
    speed = np.sqrt(c**2 * np.sin(tau) ** 2 + np.cos(tau) ** 2)
    slope = 3.0 * c * (1.0 - c**2) * np.cos(tau) * np.sin(tau) / speed**5
    return c / speed**3, 0.5 * math.pi * slope, 0.5 * math.pi * speed


def rod(segment: Segment, alpha: float, beta: float, x: Array, y: Array) -> Array:
    """Derivatives (13, k) of (F, k, q, r) by x: (A.15)."""
    f1, f2, f3, k1, k2, k3, q0, q1, q2, q3, *_ = y
    ku, ku_slope, speed = natural(segment, x)
    by_s = np.array(
        [
            f2 * k3 - f3 * k2,
            f3 * k1 - f1 * k3,
            f1 * k2 - f2 * k1,
            f2 / alpha + (beta / alpha - 1 / alpha) * k2 * k3,
            -f1 / beta - (alpha / beta - 1 / beta) * k1 * k3 + alpha / beta * ku * k3,
            (alpha - beta) * k1 * k2 - alpha * ku * k2,
            0.5 * (-q1 * k1 - q2 * k2 - q3 * k3),
            0.5 * (q0 * k1 - q3 * k2 + q2 * k3),
            0.5 * (q3 * k1 + q0 * k2 - q1 * k3),
            0.5 * (-q2 * k1 + q1 * k2 + q0 * k3),
            2 * (q1 * q3 + q0 * q2),
            2 * (q2 * q3 - q0 * q1),
            2 * (q0**2 + q3**2 - 0.5),
        ]
    )
    by_x = by_s * speed
    by_x[3] += ku_slope
    return by_x


def ends(quarter: bool, gamma: float, first: Array, last: Array) -> list[float]:
    """The thirteen conditions at the two ends: (A.17)-(A.20), or BC-III and BC-II."""
    c, s = math.cos(gamma / 2), math.sin(gamma / 2)
    grip = [last[10], last[11], last[1]]  # r1 = r2 = F2 = 0
    target = last[6:10] - R * np.array([c, c, -s, -s])
    if quarter:
        free = [first[7], first[9], first[4], first[10], first[12], first[1]]
        return [*free, *grip, *target]
    held = first[6:10] - R * np.array([c, -c, -s, s])
    return [*first[10:13], *held, *grip, *target[1:]]


def segments_of(ring: der.Ring) -> tuple[list[Segment], float]:
    """Segments of a ring's sector, lengths in L, and L/a."""
    p = ring.parameters
    straight = functools.partial(Segment, aspect=None, curvature=0.0)
    arc = functools.partial(Segment, aspect=None, curvature=1.0)
    if ring.shape == "circle":
        return [arc(0.0, math.pi / 2)], 1.0
    if ring.shape == "ellipse":
        b = p["b_over_a"]
        length = b if ring.twist_axis == "x" else 1.0
        aspect = (1.0 if ring.twist_axis == "x" else b) / length
        return [Segment(0.0, ring.length / 4 / length, aspect, 0.0)], length
    r = p["r_over_a"]
    if ring.shape == "rectangle":
        across, along = (1.0, p["b_over_a"]) if ring.twist_axis == "x" else (p["b_over_a"], 1.0)
        kinds = [straight, arc, straight]
        cuts = [0.0, along / r - 1, math.pi / 2, across / r - 1]
    else:
        apex = math.radians(p["vertex_angle"])
        corner, half_apex = (math.pi + apex) / 2, (math.pi - apex) / 2
        at_base, at_apex = math.tan(corner / 2), math.tan(half_apex)
        side = 0.5 / math.sin(apex / 2) / r
        kinds = [straight, arc, straight, arc]
        cuts = [0.0, 0.5 / r - at_base, corner, side - at_base - at_apex, half_apex]
    s = np.cumsum(cuts)
    return [kind(a, b) for kind, a, b in zip(kinds, s[:-1], s[1:], strict=True)], r


def as_printed(equations: Collocation, at: Solution, tolerance: float) -> tuple[float, float]:
    """M and U (full ring) of scipy's solution of the printed problem, from ``at`` disturbed.

    Unknowns of all segments are stacked; conditions at the joints: all but k1 are continuous, and
    k1 - k1u is.
    """
    piece, ring = equations.sector.piece, equations.sector.ring
    alpha, beta, _ = piece.stiffness
    segments, unit = segments_of(ring)
    n = len(segments)

    def slopes(x: Array, y: Array) -> Array:
        parts = [rod(g, alpha, beta, x, y[13 * i : 13 * i + 13]) for i, g in enumerate(segments)]
        return np.concatenate(parts)

    def conditions(first: Array, last: Array) -> Array:
        out = ends(piece.quarter, at.gamma, first[:13], last[-13:])
        for i in range(1, n):
            jump = first[13 * i : 13 * i + 13] - last[13 * i - 13 : 13 * i]
            jump[3] -= segments[i].curvature - segments[i - 1].curvature
            out += list(jump)
        return np.array(out)

    x = np.linspace(0.0, 1.0, 41)
    guess = np.concatenate([_guess(equations, at, g, unit, x) for g in segments])
    guess += 1e-3 * np.sin(np.arange(len(guess))[:, None] + 3.0 * x)
    found = solve_bvp(slopes, conditions, x, guess, tol=tolerance, max_nodes=20_000)
    assert found.success, found.message
    return -beta * float(found.y[-9, -1]) / unit, _energy(found, segments, alpha, beta, piece, unit)


def _energy(
    found: Any, segments: list[Segment], alpha: float, beta: float, piece: Any, unit: float
) -> float:
    """Energy of the full ring by Gauss's rule on scipy's mesh."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = 0.5 * np.diff(found.x)[:, None]
    x = (found.x[:-1, None] + half * (1 + nodes)).ravel()
    y = found.sol(x)
    total = 0.0
    for i, segment in enumerate(segments):
        ku, _, speed = natural(segment, x)
        k1, k2, k3 = y[13 * i + 3 : 13 * i + 6]
        density = 0.5 * (alpha * (k1 - ku) ** 2 + beta * k2**2 + k3**2) * speed
        total += float(density @ (half * weights).ravel())
    return (4 if piece.quarter else 2) * total / unit


def _guess(equations: Collocation, at: Solution, segment: Segment, unit: float, x: Array) -> Array:
    """The solver's state in the printed unknowns, (13, k)."""
    _, _, speed = natural(segment, x)
    steps = 0.5 * np.diff(x) * (speed[1:] + speed[:-1])
    s = np.append(0.0, np.cumsum(steps))
    s = unit * (segment.begin + s * (segment.end - segment.begin) / s[-1])
    piece = equations.sector.piece
    q = moved_to(at.mesh, at.nodes[:-1], at.frames, s)
    d = directors(q)
    constants = piece.loads @ at.p
    place = np.column_stack([np.interp(s, at.mesh.nodes, at.places[:, k]) for k in range(3)])
    moment = constants[:3] + np.cross(constants[3:], place)
    k = np.einsum("kij,kj->ki", d, moment) / piece.stiffness * unit
    k[:, 0] += natural(segment, x)[0]
    force = d @ constants[3:] * unit**2
    start = np.array([0.0, at.places[-1, 1], 0.0]) if piece.quarter else np.zeros(3)
    return np.concatenate([force, k, q, (place - start) / unit], axis=1).T


def directors(q: Array) -> Array:
    """Rows d1, d2, d3 (..., 3, 3) of unit quaternions: (A.10) as printed."""
    q0, q1, q2, q3 = np.moveaxis(np.asarray(q), -1, 0)
    matrix = [
        [q0**2 + q1**2 - 0.5, q1 * q2 + q0 * q3, q1 * q3 - q0 * q2],
        [q1 * q2 - q0 * q3, q0**2 + q2**2 - 0.5, q2 * q3 + q0 * q1],
        [q1 * q3 + q0 * q2, q2 * q3 - q0 * q1, q0**2 + q3**2 - 0.5],
    ]
    return 2.0 * np.moveaxis(np.array(matrix), (0, 1), (-2, -1))
