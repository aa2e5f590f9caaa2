"""The energy of a ring over twist and grip distance, on disk as JSON; free of kernels.

Energies are those of the full ring in GJ/a, moments of one arm, angles in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from der.records.codec import Entries, OnDisk, array_with_nulls, seconds, with_nulls
from der.utils import checks
from der.utils.checks import Array, optional

Counts = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface(OnDisk):
    """Least energy at prescribed twist and distance of the grips; NaN where no minimum was found.

    Minima are those among the shapes that have the symmetry of the ring in its grips; ``index`` is
    that of the full ring, and where it is not 0 a way down breaks the symmetry.
    """

    KIND: ClassVar[str] = "surface"
    ring: Mapping[str, object]
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    gamma: Array  # (n,) rad
    distance: Array  # (m,) a, between the grips
    energy: Array  # (n, m) of the lowest minimum
    moment: Array  # (n, m) of one arm, (1/4) dU/dgamma
    force: Array  # (n, m) dU/d(distance): tension in the grips, GJ/a^2
    index: Counts  # (n, m) ways down, both held; -1: not known
    minima: tuple[tuple[tuple[float, ...], ...], ...]  # (n, m) energies of all minima, ascending
    reasons: Mapping[tuple[int, int], str]  # why a cell has none
    path: tuple[Array, Array, Array]  # gamma, distance, energy along the path of twisting
    folds: Array  # (k, 3) gamma, distance, energy where gamma turns back
    rests: Array  # (k, 3) the same where M = 0 on the path
    snaps: tuple[Array, ...]  # (k, 3) the same along each snap, up and down
    status: str
    message: str
    solve_s: float

    @property
    def count(self) -> Counts:
        """Number of minima (n, m) in each cell."""
        return np.array([[len(cell) for cell in row] for row in self.minima], dtype=np.int64)

    def entries(self) -> dict[str, object]:
        """What is written, by name; NaN becomes null."""
        maps = {name: with_nulls(getattr(self, name)) for name in ("energy", "moment", "force")}
        return {
            "status": self.status,
            "message": self.message,
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "gamma": self.gamma.tolist(),
            "distance": self.distance.tolist(),
            **maps,
            "index": [[None if i < 0 else i for i in row] for row in self.index.tolist()],
            "minima": self.minima,
            "reasons": [
                {"gamma": float(self.gamma[i]), "distance": float(self.distance[j]), "why": why}
                for (i, j), why in self.reasons.items()
            ],
            "path": dict(
                zip(("gamma", "distance", "energy"), map(np.ndarray.tolist, self.path), strict=True)
            ),
            "folds": self.folds.tolist(),
            "rests": self.rests.tolist(),
            "snaps": [snap.tolist() for snap in self.snaps],
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """A surface as it is written."""
        gamma, distance = entries.array("gamma", "n"), entries.array("distance", "n")
        shape = len(gamma), len(distance)
        path = entries.inside("path")
        places = (path.array("gamma", "n"), path.array("distance", "n"), path.array("energy", "n"))
        path.end()
        reasons = entries.each("reasons", lambda one: _reason(one, gamma, distance))
        return cls(
            entries.mapping("ring"),
            entries.mapping("section"),
            entries.mapping("numerics"),
            gamma,
            distance,
            entries.array("energy", *shape),
            entries.array("moment", *shape),
            entries.array("force", *shape),
            entries.take("index", lambda at, v: _indices(at, v, shape)),
            entries.take("minima", lambda at, v: _minima(at, v, shape)),
            dict(reasons),
            places,
            entries.array("folds", "k", 3),
            entries.array("rests", "k", 3),
            tuple(entries.take("snaps", lambda at, v: checks.each(at, v, _line))),
            entries.text("status"),
            entries.text("message"),
            seconds(entries),
        )


def _line(name: str, given: Any) -> Array:
    return array_with_nulls(name, given, ("k", 3))


def _indices(name: str, given: Any, shape: tuple[int, int]) -> Counts:
    def row(at: str, values: Any) -> list[int]:
        known = checks.each(at, values, optional(checks.count))
        return [-1 if value is None else value for value in known]

    rows = checks.each(name, given, row)
    if [len(one) for one in rows] != [shape[1]] * shape[0]:
        raise ValueError(f"{name} must have shape {shape}")
    return np.array(rows, dtype=np.int64).reshape(shape)


def _minima(name: str, given: Any, shape: tuple[int, int]) -> Any:
    def cell(at: str, values: Any) -> tuple[float, ...]:
        return tuple(checks.each(at, values, checks.checked_number))

    rows = checks.each(name, given, lambda at, v: tuple(checks.each(at, v, cell)))
    if [len(one) for one in rows] != [shape[1]] * shape[0]:
        raise ValueError(f"{name} must have shape {shape}")
    return tuple(rows)


def _reason(entries: Entries, gamma: Array, distance: Array) -> tuple[tuple[int, int], str]:
    """A cell without a minimum, by its place on the grid."""
    place = []
    for name, axis in (("gamma", gamma), ("distance", distance)):
        value = entries.number(name)
        (found,) = np.nonzero(axis == value)
        if len(found) != 1:
            raise ValueError(f"{name} = {value!r} of a reason is not on the grid")
        place.append(int(found[0]))
    return (place[0], place[1]), entries.text("why")
