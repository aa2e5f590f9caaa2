r"""Where two paths of equilibria exchange partners: the rod shot from one end to the other.

Given the constants p and gamma, x = (p, gamma), the frames follow from one end to the other, and
what is left are the conditions G(x) = 0 at the far end, one fewer than x has entries: a path. Two
paths meet where the rank of G_x falls by one. There is then a psi with

    G(x) = mu psi,     psi^T G_x = 0,     |psi| = 1

and mu = 0. Off it these equations still have one solution nearby, the centre of the hyperbola whose
branches the two paths are, and mu, a smooth function of the ring and its section, says how far off
it is. They are regular there, which those of the paths are not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.bvp.collocation import Collocation
from der.bvp.condensing import forward, workspace
from der.bvp.corrector import border, move
from der.bvp.gauss import Array
from der.bvp.meshes import Mesh
from der.packs.kernel import kernel

DIFFERENCE = 1e-5  # of p and gamma
SHOT = 1e-13  # last change of a frame
CONVERGED = 1e-11  # change of x
NEAR = 1e-4  # likewise
LARGEST = 0.5  # of x: a centre farther away is another one
MOST = 12


class Shot(NamedTuple):
    """The rod shot from its start."""

    frames: Array  # (n, m, 4)
    nodes: Array  # (n + 1, 4)
    places: Array  # (n + 1, 3)
    missed: Array  # (n_p,) G
    rates: Array  # (n_p, n_p + 1) G_x
    ok: bool


class Centre(NamedTuple):
    """Where G = mu psi."""

    shot: Shot
    x: Array  # (n_p + 1,) p, gamma
    psi: Array  # (n_p,)
    mu: float
    bend: Array  # (n_p + 1, n_p + 1) of psi^T G by x, about


@kernel
def _shoot(
    piece, h, rest, frames, p, gamma, iterations, tolerance, nodes, places, out_missed, out_rates
):
    """Newton's method for the frames only, in place; returns whether it converged.

    Fills also mesh points, G and G_x.
    """
    n, m = rest.shape
    n_p = p.size
    work = workspace(n, m, n_p)
    along = np.zeros_like(frames)
    still = np.zeros(n_p + 1)
    ok = False
    for _ in range(iterations):
        sign = forward(piece, h, rest, frames, p, gamma, work, nodes, places)
        if sign == 0:
            break
        size, _square = move(h, work.z, still, still, frames, along)
        if not size < 2.0:
            break
        if size < tolerance:
            ok = True
            break
    for i in range(n):
        for j in range(m):
            for a in range(4):
                along[i, j, a] = 0.0
    border(h, along, 1.0, nodes[n], places[n], work)
    for k in range(n_p):
        out_missed[k] = -work.small[n_p + 1, k]
        for c in range(n_p + 1):
            out_rates[k, c] = work.small[c, k]
    return ok


def shot(system: Collocation, mesh: Mesh, frames: Array, x: Array) -> Shot:
    """The rod shot with p and gamma, from frames nearby."""
    frames = frames.copy()
    piece, p = system.sector.piece, x[:-1].copy()
    n, n_p = len(mesh.h), len(p)
    found = (np.empty((n + 1, 4)), np.empty((n + 1, 3)), np.empty(n_p), np.empty((n_p, n_p + 1)))
    ok = _shoot(piece, mesh.h, mesh.rest, frames, p, x[-1], 12, SHOT, *found)
    return Shot(frames, *found, ok and bool(np.isfinite(found[-1]).all()))


def centre(
    system: Collocation,
    mesh: Mesh,
    frames: Array,
    x: Array,
    psi: Array | None = None,
    bend: Array | None = None,
) -> Centre | None:
    """Where G = mu psi and psi^T G_x = 0, from a state nearby; None where there is none.

    Parameters
    ----------
    psi : from a ring nearby, which gives it its sign; else the left singular vector of G_x.
    bend : from a ring nearby, which serves as long as Newton's steps are small.
    """
    start = x
    here = shot(system, mesh, frames, x)
    if not here.ok:
        return None
    if psi is None:
        psi = np.linalg.svd(here.rates)[0][:, -1]
    mu = float(psi @ here.missed)
    n_p = len(psi)
    size = 0.0
    for _ in range(MOST):
        if bend is None or size > NEAR:  # nearer, second derivatives of before do
            bend = _bend(system, mesh, here, x, psi, sides=(1.0, 0.0))
        if bend is None:
            return None
        try:
            change = _newton_step(here, bend, psi, mu)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(change[: n_p + 1] / (1.0 + np.abs(x))).max())
        x, psi, mu = x + change[: n_p + 1], psi + change[n_p + 1 : -1], mu + float(change[-1])
        if not np.abs(x - start).max() < LARGEST * (1.0 + np.abs(start).max()):
            return None
        here = shot(system, mesh, here.frames, x)
        if not here.ok:
            return None
        if size < CONVERGED:
            return Centre(here, x, psi, mu, bend)
    return None


def _newton_step(here: Shot, bend: Array, psi: Array, mu: float) -> Array:
    """Newton's change (2 n_p + 2,) of x, psi and mu.

    Raises
    ------
    LinAlgError
        Where the equations are singular.
    """
    n_p = len(psi)
    matrix = np.zeros((2 * n_p + 2, 2 * n_p + 2))
    matrix[:n_p, : n_p + 1] = here.rates
    matrix[:n_p, n_p + 1 : -1] = -mu * np.eye(n_p)
    matrix[:n_p, -1] = -psi
    matrix[n_p:-1, : n_p + 1] = bend
    matrix[n_p:-1, n_p + 1 : -1] = here.rates.T
    matrix[-1, n_p + 1 : -1] = 2.0 * psi
    residual = np.concatenate([here.missed - mu * psi, here.rates.T @ psi, [psi @ psi - 1.0]])
    return np.linalg.solve(matrix, -residual)


def hysteresis(system: Collocation, mesh: Mesh, frames: Array, x: Array, psi: Array) -> float:
    """psi^T G_pp n n, where n is the change of p that leaves G as it is with gamma held.

    The paths near an exchange are hyperbolas. Where this is zero, gamma is stationary along one of
    their asymptotes: the fold that each has on one side of the exchange has gone to infinity, and
    the curve of cusps touches that of exchanges.

    Raises
    ------
    ArithmeticError
        Where the rod cannot be shot.
    """
    here = shot(system, mesh, frames, x)
    bend = _bend(system, mesh, here, x, psi) if here.ok else None
    if bend is None:
        raise ArithmeticError("the rod cannot be shot")
    still = np.linalg.svd(here.rates[:, :-1])[2][-1]
    return float(still @ bend[:-1, :-1] @ still)


def _bend(
    system: Collocation,
    mesh: Mesh,
    here: Shot,
    x: Array,
    psi: Array,
    sides: tuple[float, float] = (1.0, -1.0),
) -> Array | None:
    """Second derivatives of psi^T G by x, by differences of its first; symmetric."""
    out = np.empty((len(x), len(x)))
    for k in range(len(x)):
        step = np.zeros_like(x)
        step[k] = DIFFERENCE * (1.0 + abs(x[k]))
        ahead, behind = (
            shot(system, mesh, here.frames, x + side * step) if side else here for side in sides
        )
        if not (ahead.ok and behind.ok):
            return None
        out[k] = psi @ (ahead.rates - behind.rates) / ((sides[0] - sides[1]) * step[k])
    return 0.5 * (out + out.T)
