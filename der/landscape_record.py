"""What is known of a ring's energy landscape, on disk as JSON; free of kernels.

Three answers of growing freedom: along the path of twisting (`Landscape`), over twist and grip
distance (`Surface`), and of the ring left alone (`Pass`); `BarrierCurves` are those over h/t.
Energies are those of the full ring in GJ/a, moments of one arm, angles in radians.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from der.checks import Array
from der.files import FilePath, write_whole
from der.record import Path

SCHEMA = 1
Counts = NDArray[np.int64]


class OnDisk:
    """A record that writes itself as JSON, one entry a line."""

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        raise NotImplementedError

    def to_json(self) -> str:
        """JSON text of schema 1."""
        entries = {"schema": SCHEMA, **self.entries()}
        lines = [f'"{name}": {json.dumps(entries[name], allow_nan=False)}' for name in entries]
        return "{\n  " + ",\n  ".join(lines) + "\n}\n"

    def save(self, path: FilePath) -> None:
        """Write JSON, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written; one already there is then unharmed.
        """
        content = self.to_json().encode()
        write_whole(path, lambda file: file.write(content))


# --- Along the path of twisting --------------------------------------------------------------


@dataclass(frozen=True)
class Rest:
    """A state that stays where it is when nobody turns the grips, M = 0."""

    gamma: float  # rad
    energy: float  # GJ/a
    index_moment: int | None  # ways down while the grips are clamped but turn; None: singular
    index_free: int | None  # ways down with the grips removed; None: singular, or no equilibrium
    slope: float  # dM/dgamma
    distance: float  # between the grips, a
    position: int  # in the path's arrays

    @property
    def kind(self) -> str:
        """Well, or saddle: whether the ring under no moment comes back when it is nudged."""
        return "well" if self.index_moment == 0 else "saddle"


@dataclass(frozen=True)
class Barriers:
    """What it costs to get from one well into the other over the highest saddle between them."""

    fold: float | None  # that saddle above the flat ring
    open: float | None  # above the folded ring
    saddle: int | None  # which of the rests it is
    why: Mapping[str, str] = field(default_factory=dict)  # a sentence where one is None, or special


@dataclass(frozen=True, eq=False)
class Landscape(OnDisk):
    """Energy along the path of twisting, from the flat ring to the folded one."""

    path: Path  # stable and unstable branches, all rests among its states
    rests: tuple[Rest, ...]  # in path order: the flat ring first
    folded: bool  # whether the last rest is the planar three-covered ring
    barriers: Barriers  # on the scene's own mesh
    extrapolated: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # with error bars, values and errors without any mesh: of the barriers "fold" and "open", of
    # "gamma", their saddle's, of the height "folded" above flat and of the "slope" there

    @property
    def status(self) -> str:
        """The path's: done, not converged or interrupted."""
        return self.path.status

    @property
    def wells(self) -> tuple[Rest, ...]:
        """Rests that are minima while the grips turn freely."""
        return tuple(rest for rest in self.rests if rest.kind == "well")

    @property
    def saddles(self) -> tuple[Rest, ...]:
        """The other rests."""
        return tuple(rest for rest in self.rests if rest.kind == "saddle")

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        path = self.path
        return {
            "status": path.status,
            "message": path.message,
            "ring": path.ring,
            "section": path.section,
            "numerics": path.numerics,
            **{name: getattr(path, name).tolist() for name in ("gamma", "energy", "moment")},
            "index": path.index.tolist(),
            "points": [
                {"kind": point.kind, "gamma": point.gamma, "position": point.position}
                for point in path.points
            ],
            "rests": [{**asdict(rest), "kind": rest.kind} for rest in self.rests],
            "folded": self.folded,
            "barriers": {"fold": self.barriers.fold, "open": self.barriers.open},
            "why": dict(self.barriers.why),
            "extrapolated": _with_errors(self.extrapolated),
            "timing": vars(path.timing),
        }


@dataclass(frozen=True, eq=False)
class BarrierCurves(OnDisk):
    """Barriers over the section's h/t; NaN where there is none, or none is known."""

    ring: Mapping[str, object]
    numerics: Mapping[str, object]
    h_over_t: Array  # (n,)
    fold: Array  # (n,) from flat, with clamped grips that turn freely
    open: Array  # (n,) from folded
    gamma: Array  # (n,) of the saddle, rad
    folded_energy: Array  # (n,)
    fold_free: Array  # (n,) as fold and open, with the grips removed; NaN where not asked for
    open_free: Array  # (n,)
    index_free: tuple[int | None, ...]  # (n,) of the saddle of twisting with the grips removed
    why: tuple[str, ...]  # (n,) sentences where something is missing
    error: Mapping[str, Array]  # with error bars: (n,) by name; the arrays are then extrapolated
    solve_s: float

    _ARRAYS: ClassVar[tuple[str, ...]] = (
        "h_over_t",
        "fold",
        "open",
        "gamma",
        "folded_energy",
        "fold_free",
        "open_free",
    )

    def entries(self) -> dict[str, object]:
        """What is written, by name; NaN becomes null."""
        arrays = {name: _with_nulls(getattr(self, name)) for name in self._ARRAYS}
        return {
            "ring": self.ring,
            "numerics": self.numerics,
            **arrays,
            "index_free": list(self.index_free),
            "why": list(self.why),
            "error": {name: _with_nulls(values) for name, values in self.error.items()} or None,
            "timing": {"solve_s": self.solve_s},
        }


# --- Over twist and grip distance ------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Surface(OnDisk):
    """Least energy at prescribed twist and distance of the grips; NaN where no minimum was found.

    Minima are those among the shapes that have the symmetry of the ring in its grips; ``index`` is
    that of the full ring, and where it is not 0 a way down breaks the symmetry.
    """

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
        maps = {name: _with_nulls(getattr(self, name)) for name in ("energy", "moment", "force")}
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


# --- Without grips ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Saddle:
    """A saddle of the ring left alone, and where the two ways down from it end."""

    energy: float  # GJ/a
    index: int | None  # ways down, rigid motions and a circle's material shift taken out
    residual: float  # largest force left, GJ/a
    zero_modes: int  # beyond rigid motions: 1 where material may shift along the ring at no cost
    twisted: bool  # whether it is the saddle on the path of twisting itself
    ends: tuple[str, ...]  # "flat", "folded" or another rest, on the two ways down
    stiffness: float  # of the way down: its eigenvalue, GJ/a^2


@dataclass(frozen=True, eq=False)
class Pass(OnDisk):
    """The lowest way found from flat to folded of the ring left alone in space."""

    ring: Mapping[str, object]
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    fold: float | None  # barriers: the saddle above flat and above folded
    open: float | None
    twisting: Barriers  # the same in clamped grips that turn freely
    saddle: Saddle | None  # the one that is crossed
    saddles: tuple[Saddle, ...]  # all that were found, lowest first
    way: Array  # (k, 2) progress [rad, root mean square] from flat, and energy, down both sides
    shapes: Array  # (k, N, 3) vertices on the way; not in the JSON
    why: str  # a sentence where there is no such way, or none is known
    status: str  # "done" or "interrupted"
    extrapolated: Mapping[str, tuple[float, float]]  # with error bars: of "fold" and "open"
    solve_s: float

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        return {
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "barriers": {"fold": self.fold, "open": self.open},
            "twisting": {"fold": self.twisting.fold, "open": self.twisting.open},
            "saddle": None if self.saddle is None else asdict(self.saddle),
            "saddles": [asdict(saddle) for saddle in self.saddles],
            "way": {"progress": self.way[:, 0].tolist(), "energy": self.way[:, 1].tolist()},
            "why": self.why,
            "status": self.status,
            "extrapolated": _with_errors(self.extrapolated),
            "timing": {"solve_s": self.solve_s},
        }


def _with_nulls(values: Array) -> object:
    """Nested lists with None for NaN."""
    if values.ndim > 1:
        return [_with_nulls(row) for row in values]
    return [None if np.isnan(value) else float(value) for value in values]


def _with_errors(values: Mapping[str, tuple[float, float]]) -> object:
    """Objects of value and error; None without any."""
    return {n: {"value": v, "error": e} for n, (v, e) in values.items()} or None
