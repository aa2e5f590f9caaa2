"""Richardson extrapolation from three meshes, cells doubling, errors in even powers of the cell.

Sources: Richardson (1911), Phil. Trans. A 210; Romberg (1955), K. Norske Vid. Selsk. Forh. 28.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from der.problem import Array

Extrapolated: TypeAlias = Mapping[str, tuple[float, float]]  # name -> value and error

# weights of the values at h, 2h and 4h: (4, -1)/3 for one term, and (16, -1)/15 of two such
_ROMBERG = np.array([[1.0, 0.0, 0.0], [4.0 / 3.0, -1.0 / 3.0, 0.0], [64 / 45, -20 / 45, 1 / 45]])
_EXACT = 1e-9  # a smaller first correction is rounding
_ROUNDING = 2.0**-46  # relative: of sums over 4,096 edges, 64 times that of a number
UNEVEN = 640.0 / 340.0  # times the last correction: what kinks of the curvature inside cells leave


def romberg(levels: Array) -> Array:
    """Values at h, the same less their h^2 term, and less their h^4 term: (3, ...) as ``levels``.

    Parameters
    ----------
    levels : (3, ...) values at h, 2h and 4h.
    """
    extrapolated: Array = _ROMBERG @ levels
    return extrapolated


def limit(levels: Array, *, even: bool = True) -> tuple[Array, Array]:
    """Return the limits (n, m) of values at the states of a path, and their errors (n, m).

    Parameters
    ----------
    levels : (3, n, m) values at h, 2h and 4h, of the order of one; n is 1 for a state alone.
    even : whether no kinks of the natural curvature lie inside of cells.

    Notes
    -----
    If corrections are a geometric series, first and last = r first, the limit still lacks
    4 r^2 first = 4 r last (`der.analysis.extrapolation.remaining_error`). One correction may vanish
    by chance: so they are the largest of a state and its two neighbours (of all, without even
    series), r is at least that of all values, and a last one counts as this times the first.
    """
    shape = levels.shape[1:]
    plain, once, twice = romberg(levels.reshape(len(levels), -1)).reshape(levels.shape)
    first, last = np.abs(once - plain), np.abs(twice - once)
    scale = np.maximum(np.abs(twice), 1.0)
    most = float((first / scale).max())
    least = float((last / scale).max()) / most if most > _EXACT else 0.0
    first, last = (
        _beside(one) if even else np.tile(one.max(axis=0), (shape[0], 1)) for one in (first, last)
    )
    own = np.divide(last, first, out=np.zeros(shape), where=first > _EXACT * scale)
    r = np.clip(own, least, max(least, 1.0))
    last = np.maximum(last, least * first) * (1.0 if even else UNEVEN)
    return twice, (1.0 + 4.0 * r) * last + _ROUNDING * scale


def _beside(values: Array) -> Array:
    """The largest of each row (n, m) and the two beside it."""
    around = np.pad(values, ((1, 1), (0, 0)))
    return np.maximum(np.maximum(around[:-2], around[2:]), values)


def limits(levels: Sequence[Mapping[str, float | None]], *, even: bool = True) -> Extrapolated:
    """Return `limit` of every value known on each of three meshes, the finest first."""
    names = [name for name in levels[0] if all(level.get(name) is not None for level in levels)]
    if len(levels) < 3 or not names:
        return {}
    table = np.array([[level[name] for name in names] for level in levels], dtype=float)
    (values,), (errors,) = (one.tolist() for one in limit(table[:, None], even=even))
    return dict(zip(names, zip(values, errors, strict=True), strict=True))
