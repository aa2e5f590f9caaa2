"""What is known of a ring's energy landscape, on disk as JSON; free of kernels.

Answers of growing freedom: along the path of twisting (`Landscape`), over twist and grip distance
(`landscape_surface_record`), and of the ring left alone (`Pass`); `BarrierCurves` are those over
h/t.
Energies are those of the full ring in GJ/a, moments of one arm, angles in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import ClassVar, Self

import numpy as np

from der.records.codec import (
    Entries,
    OnDisk,
    errors_of,
    seconds,
    sentences,
    with_errors,
    with_nulls,
)
from der.records.path import Path, Timing, built, flat_point, point_of
from der.utils import checks
from der.utils.checks import Array, optional

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

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """A rest as it is written; its kind follows from the rest."""
        kind = entries.text("kind")
        rest = cls(
            entries.number("gamma"),
            entries.number("energy"),
            entries.count_or_none("index_moment"),
            entries.count_or_none("index_free"),
            entries.number("slope"),
            entries.number("distance"),
            entries.count("position"),
        )
        if kind != rest.kind:
            raise ValueError(f"kind of a rest must be {rest.kind}, got {kind!r}")
        return rest


@dataclass(frozen=True)
class Barriers:
    """What it costs to get from one well into the other over the highest saddle between them."""

    fold: float | None  # that saddle above the flat ring
    open: float | None  # above the folded ring
    saddle: int | None  # which of the rests it is
    why: Mapping[str, str] = field(default_factory=dict)  # a sentence where one is None, or special

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """Barriers as they are written."""
        heights = entries.number_or_none("fold"), entries.number_or_none("open")
        return cls(*heights, entries.count_or_none("saddle"), entries.take("why", sentences))


@dataclass(frozen=True, eq=False)
class Landscape(OnDisk):
    """Energy along the path of twisting, from the flat ring to the folded one."""

    KIND: ClassVar[str] = "landscape"
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
            **{name: getattr(path, name).tolist() for name in ("index", "index_moment")},
            "points": [flat_point(point) for point in path.points],
            "rests": [{**asdict(rest), "kind": rest.kind} for rest in self.rests],
            "folded": self.folded,
            "barriers": {name: getattr(self.barriers, name) for name in ("fold", "open", "saddle")},
            "why": dict(self.barriers.why),
            "extrapolated": with_errors(self.extrapolated),
            "timing": vars(path.timing),
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """A landscape as it is written."""
        points = entries.take("points", lambda at, v: checks.each(at, v, point_of))
        names = ("status", "message", "ring", "section", "numerics", "gamma", "energy", "moment")
        path = built(
            Path,
            "record",
            {name: entries.take(name, _as_it_is) for name in (*names, "index", "index_moment")}
            | {"solver": "der", "at_pi": None, "mode": None, "error": None, "points": points}
            | {"timing": built(Timing, "timing", entries.mapping("timing"))},
        )
        rests = entries.each("rests", Rest.of_entries)
        for i, rest in enumerate(rests):
            if rest.position >= len(path):
                raise ValueError(f"rests[{i}].position is {rest.position} of {len(path)} states")
        heights = entries.inside("barriers")
        barriers = Barriers(
            heights.number_or_none("fold"),
            heights.number_or_none("open"),
            heights.count_or_none("saddle"),
            entries.take("why", sentences),
        )
        heights.end()
        return cls(
            path, rests, entries.truth("folded"), barriers, entries.take("extrapolated", errors_of)
        )


@dataclass(frozen=True, eq=False)
class BarrierCurves(OnDisk):
    """Barriers over the section's h/t; NaN where there is none, or none is known."""

    KIND: ClassVar[str] = "barriers"
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
        arrays = {name: with_nulls(getattr(self, name)) for name in self._ARRAYS}
        return {
            "ring": self.ring,
            "numerics": self.numerics,
            **arrays,
            "index_free": list(self.index_free),
            "why": list(self.why),
            "error": {name: with_nulls(values) for name, values in self.error.items()} or None,
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """Curves as they are written."""
        values = {name: entries.array(name, "n") for name in cls._ARRAYS}
        n = len(values["h_over_t"])
        for name, array in values.items():
            if len(array) != n:
                raise ValueError(f"{name} has {len(array)} entries, h_over_t has {n}")
        indices = entries.take("index_free", lambda at, v: checks.each(at, v, _INDEX))
        why = entries.take("why", lambda at, v: checks.each(at, v, checks.text))
        given = entries.take("error", optional(Entries))
        error = {} if given is None else {name: given.array(name, n) for name in given.names}
        return cls(
            entries.mapping("ring"),
            entries.mapping("numerics"),
            **values,
            index_free=tuple(indices),
            why=tuple(why),
            error=error,
            solve_s=seconds(entries),
        )


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

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """A saddle as it is written."""
        return cls(
            entries.number("energy"),
            entries.count_or_none("index"),
            entries.number("residual"),
            entries.count("zero_modes"),
            entries.truth("twisted"),
            tuple(entries.take("ends", lambda at, v: checks.each(at, v, checks.text))),
            entries.number("stiffness"),
        )


@dataclass(frozen=True, eq=False)
class Pass(OnDisk):
    """The lowest way found from flat to folded of the ring left alone in space."""

    KIND: ClassVar[str] = "pass"
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
    status: str  # "done", "interrupted" or "not converged"
    extrapolated: Mapping[str, tuple[float, float]]  # with error bars: of "fold" and "open"
    solve_s: float

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        return {
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "barriers": {"fold": self.fold, "open": self.open},
            "twisting": asdict(self.twisting),
            "saddle": None if self.saddle is None else asdict(self.saddle),
            "saddles": [asdict(saddle) for saddle in self.saddles],
            "way": {"progress": self.way[:, 0].tolist(), "energy": self.way[:, 1].tolist()},
            "why": self.why,
            "status": self.status,
            "extrapolated": with_errors(self.extrapolated),
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """A pass as it is written: without the shapes on its way."""
        heights, way = entries.inside("barriers"), entries.inside("way")
        progress, energy = way.array("progress", "n"), way.array("energy", "n")
        if len(progress) != len(energy):
            raise ValueError(f"way.energy has {len(energy)} entries, progress {len(progress)}")
        twisting = entries.inside("twisting")
        saddle = entries.take("saddle", optional(Entries))
        found = cls(
            entries.mapping("ring"),
            entries.mapping("section"),
            entries.mapping("numerics"),
            heights.number_or_none("fold"),
            heights.number_or_none("open"),
            Barriers.of_entries(twisting),
            None if saddle is None else Saddle.of_entries(saddle),
            entries.each("saddles", Saddle.of_entries),
            np.column_stack([progress, energy]),
            np.zeros((0, 0, 3)),
            entries.text("why"),
            entries.text("status"),
            entries.take("extrapolated", errors_of),
            seconds(entries),
        )
        for part in (heights, way, twisting, *((saddle,) if saddle is not None else ())):
            part.end()
        return found


def _as_it_is(name: str, given: object) -> object:
    """An entry that is checked where it is used."""
    return given


_INDEX = optional(checks.count)
