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


def romberg(levels: Array) -> Array:
    """Values at h, the same less their h^2 term, and less their h^4 term: (3, ...) as ``levels``.

    Parameters
    ----------
    levels : (3, ...) values at h, 2h and 4h.
    """
    extrapolated: Array = _ROMBERG @ levels
    return extrapolated


def limit(levels: Array) -> tuple[Array, Array]:
    """Return the limits (m,) of values on three meshes, and their errors (m,).

    Parameters
    ----------
    levels : (3, m) values at h, 2h and 4h, of the order of one.

    Notes
    -----
    If corrections are a geometric series, first and last = r first, the limit still lacks
    4 r^2 first = 4 r last (`der.analysis.extrapolation.remaining_error`). One correction may vanish
    by chance: so r compares the largest of all values, and a last one counts as r first at least.
    """
    plain, once, twice = romberg(levels)
    first, last = np.abs(once - plain), np.abs(twice - once)
    scale = np.maximum(np.abs(twice), 1.0)
    most = float((first / scale).max())
    ratio = float((last / scale).max()) / most if most > _EXACT else 0.0
    return twice, (1.0 + 4.0 * ratio) * np.maximum(last, ratio * first)


def limits(levels: Sequence[Mapping[str, float | None]]) -> Extrapolated:
    """Return `limit` of every value known on each of three meshes, the finest first."""
    names = [name for name in levels[0] if all(level[name] is not None for level in levels)]
    if len(levels) < 3 or not names:
        return {}
    table = np.array([[level[name] for name in names] for level in levels], dtype=float)
    values, errors = limit(table)
    return dict(zip(names, zip(values.tolist(), errors.tolist(), strict=True), strict=True))
