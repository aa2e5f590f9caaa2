"""The energy of a ring over twist and grip distance; free of kernels.

Energies are those of the full ring in GJ/a, moments of one arm, angles in radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from der.records.entries import Checked, Entry
from der.records.record import RingRecord, SolveTime
from der.records.values import Column, Number, Text, gaps, nested, table
from der.utils import checks
from der.utils.checks import Array, optional

Counts = NDArray[np.int64]
Minima = tuple[tuple[tuple[float, ...], ...], ...]


def _indices(name: str, given: Any) -> Counts:
    """Counts, -1 in memory and null in the file where not known."""
    known = optional(lambda at, value: -1 if value == -1 else checks.count(at, value))
    found = nested(known, 2)(name, given.tolist() if isinstance(given, np.ndarray) else given)
    return np.array([[-1 if i is None else i for i in row] for row in found], dtype=np.int64)


_GRID = ("gamma", "distance")
_MAP = gaps(*_GRID)
_MINIMA = Entry(nested(checks.number, 3), dims=_GRID)
_INDEX = Entry(
    _indices, lambda index: [[None if i < 0 else i for i in row] for row in index.tolist()], _GRID
)


@dataclass(frozen=True)
class NoMinimum(Checked):
    """Why no minimum is known in a cell."""

    gamma: Number
    distance: Number
    why: Text


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Surface(RingRecord, name="energy surface", kind="surface", plot="energy_surface"):
    """Least energy at prescribed twist and distance of the grips; NaN where no minimum was found.

    Minima are those among the shapes that have the symmetry of the ring in its grips; ``index`` is
    that of the full ring, and where it is not 0 an unstable mode breaks the symmetry.
    """

    gamma: Column  # (n,) rad
    distance: Column  # (m,) a, between the grips
    energy: Annotated[Array, _MAP]  # (n, m) of the lowest minimum
    moment: Annotated[Array, _MAP]  # (n, m) of one arm, (1/4) dU/dgamma
    force: Annotated[Array, _MAP]  # (n, m) dU/d(distance): tension in the grips, GJ/a^2
    index: Annotated[Counts, _INDEX]  # (n, m) unstable modes, both held; -1: not known
    minima: Annotated[Minima, _MINIMA]  # energies of all minima, ascending
    reasons: tuple[NoMinimum, ...]
    path: Annotated[Array, table(*_GRID, "energy")]  # (k, 3) along the path of twisting
    folds: Annotated[Array, gaps(None, 3)]  # gamma, distance, energy where gamma turns back
    rests: Annotated[Array, gaps(None, 3)]  # the same where M = 0 on the path
    snaps: tuple[Annotated[Array, gaps(None, 3)], ...]  # the same along each snap, up and down
    timing: SolveTime

    def __post_init__(self) -> None:
        super().__post_init__()
        for i, cell in enumerate(self.reasons):
            for name, axis in (("gamma", self.gamma), ("distance", self.distance)):
                if (value := getattr(cell, name)) not in axis:
                    raise ValueError(f"reasons[{i}].{name} must be on the grid, got {value!r}")

    def facts(self) -> list[str]:
        """How fine the grid is, and how many cells have no minimum."""
        n, m = self.energy.shape
        return [f"{n} x {m} cells", f"{int((self.count == 0).sum())} without a minimum"]

    @property
    def count(self) -> Counts:
        """Number of minima (n, m) in each cell."""
        return np.array([[len(cell) for cell in row] for row in self.minima], dtype=np.int64)
