"""Barriers with error bars: extrapolated from N, N/2 and N/4 edges by Romberg's scheme.

Rests are defined without any mesh, by M = 0, so their energies have error series in even powers of
the cell, and so have the barriers: states of the three meshes need not be matched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Extrapolated = Mapping[str, tuple[float, float]]  # name -> value and error


def romberg(fine: float, middle: float, coarse: float) -> tuple[float, float]:
    """Limit of three values whose cells double, and its error: what the last stage has changed."""
    finer, coarser = (4.0 * fine - middle) / 3.0, (4.0 * middle - coarse) / 3.0
    value = (16.0 * finer - coarser) / 15.0
    return value, abs(value - finer)


def extrapolated(levels: Sequence[Mapping[str, float | None]]) -> Extrapolated:
    """Values and errors of all that is known on each of three meshes, the finest first."""
    found = {}
    for name in levels[0]:
        values = [level[name] for level in levels]
        known = [value for value in values if value is not None]
        if len(known) == 3:
            found[name] = romberg(*known)
    return found
