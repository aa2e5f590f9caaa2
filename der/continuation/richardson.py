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


def romberg(levels: Array) -> Array:
    """Values at h, the same less their h^2 term, and less their h^4 term: (3, ...) as ``levels``.

    Parameters
    ----------
    levels : (3, ...) values at h, 2h and 4h.
    """
    extrapolated: Array = _ROMBERG @ levels
    return extrapolated


def limit(fine: float, middle: float, coarse: float) -> tuple[float, float]:
    """Return the limit of three values, and its error: the change by the last stage."""
    _, once, twice = romberg(np.array([fine, middle, coarse])).tolist()
    return twice, abs(twice - once)


def limits(levels: Sequence[Mapping[str, float | None]]) -> Extrapolated:
    """Return `limit` of every value known on each of three meshes, the finest first."""
    found = {}
    for name in levels[0]:
        known = [value for level in levels if (value := level[name]) is not None]
        if len(known) == 3:
            found[name] = limit(*known)
    return found
