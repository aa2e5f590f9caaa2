"""Supports and loads of a rod: held unknowns, conditions on positions, and what the load moves.

Five kinds of data describe them, all linear for the kernels:

* ``free``   which entries of an edge's increment may move (a clamped or gripped edge: none);
* ``axis``, ``weight``  conditions on positions, sum_j weight[k, j] e_j . axis[k] = target[k];
* ``turn``   how fast the load turns an edge's frame about the fixed ``turn_axis``;
* ``pull``   how fast the load adds a dead force to the tension resultant of an edge: a dead force
  P at the end of a rod that starts at rest is pull[j] = P on every edge before it;
* ``reach``  how fast the load lengthens an edge: that of a strut, which pushes two points apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from der.kernels.quaternions import Array
from der.rod.rod import Rod


class Supports(NamedTuple):
    """How a rod with n edges and blocks of b unknowns is held and loaded (kernels take it)."""

    free: NDArray[np.bool_]  # (n, b)
    weight: Array  # (n_c, n)
    axis: Array  # (n_c, 3)
    target: Array  # (n_c,)
    turn: Array  # (n,) rotation of the edge about turn_axis per unit of load
    turn_axis: Array  # (3,)
    pull: Array  # (n, 3) dead force per unit of load
    reach: Array  # (n,) length of the edge per unit of load, beyond its own


def supported(
    rod: Rod,
    *,
    clamped: tuple[int, ...] = (),
    held: tuple[tuple[Array, Array, float], ...] = (),
    turn: dict[int, float] | None = None,
    turn_axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
    pull: Array | None = None,
    reach: dict[int, float] | None = None,
) -> Supports:
    """Supports of an open rod or a ring.

    Parameters
    ----------
    clamped : edges whose frame (and stretch) is held.
    held : conditions (weight (n,), axis (3,), target): weighted sum of edge vectors along an axis.
    turn : rotation per unit of load about ``turn_axis`` of some clamped edges.
    pull : (n, 3) or (3,) dead force per unit of load.
    reach : length per unit of load that some edges have beyond their own.

    Raises
    ------
    ValueError
        For an edge that the rod does not have, or forces of another shape. If an edge turns that is
        not clamped: its frame would be both free and prescribed. Or if an edge both turns and
        lengthens.
    """
    n = rod.n_edges
    for name, edges in (("clamped", clamped), ("turn", turn or {}), ("reach", reach or {})):
        for j in edges:
            if not 0 <= j < n:
                raise ValueError(f"{name} must name edges from 0 to {n - 1}, got {j!r}")
    if pull is not None and np.shape(pull) not in ((3,), (n, 3)):
        raise ValueError(f"pull must have the shape (3,) or ({n}, 3), got {np.shape(pull)}")
    free = np.ones((n, rod.block), dtype=bool)
    free[list(clamped)] = False
    rates, longer, force = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    for j, rate in (turn or {}).items():
        if free[j].any():
            raise ValueError(f"edge {j} turns with the load but is not clamped")
        rates[j] = rate
    for j, rate in (reach or {}).items():
        if rates[j] != 0.0:
            raise ValueError(f"edge {j} turns with the load and cannot lengthen with it, too")
        longer[j] = rate
    if pull is not None:
        force[:] = pull
    return Supports(
        free,
        np.array([w for w, _, _ in held], dtype=float).reshape(len(held), n),
        np.array([a for _, a, _ in held], dtype=float).reshape(len(held), 3),
        np.array([t for _, _, t in held], dtype=float),
        rates,
        np.array(turn_axis, dtype=float),
        force,
        longer,
    )


def check_cut(rod: Rod, free: NDArray[np.bool_]) -> None:
    """Make sure that a closed rod can be factored as a band.

    Raises
    ------
    ValueError
        Where the frame of its edge 0 is not held, by a grip or to take out rigid rotations: the
        factorisation cuts the cycle there.
    """
    if rod.closed and free[0, :3].any():
        raise ValueError(f"free must hold the frame of edge 0 of a closed rod, got {free[0]}")
