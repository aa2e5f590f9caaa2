"""What is known of a ring's energy landscape; free of kernels.

`Landscape` is that along the path of twisting, `Pass` that of the free ring. The one over twist and
grip distance is in `der.records.energy_surface`, barriers over h/t are in `der.records.barriers`.
Energies are those of the full ring in GJ/a, moments of one arm, angles in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from der.geometry.scale import Scale
from der.records.entries import Checked, in_memory
from der.records.path import Path, Timing
from der.records.record import Record, SolveTime, Status
from der.records.units import unit
from der.records.values import (
    Count,
    Estimates,
    Number,
    NumericsEntry,
    RingEntry,
    ScaleEntry,
    SectionEntry,
    Text,
    Texts,
    Truth,
    table,
)
from der.utils.checks import Array

# --- Along the path of twisting --------------------------------------------------------------


@dataclass(frozen=True)
class Rest(Checked):
    """An equilibrium without load, M = 0."""

    gamma: Number  # rad
    energy: Number  # GJ/a
    index_moment: Count | None  # index while the grips are clamped but turn; None: singular
    index_free: Count | None  # with the grips removed; None: singular, or no equilibrium
    slope: Number  # dM/dgamma
    distance: Number  # between the grips, a
    position: Count  # in the path's arrays

    @property
    def kind(self) -> str:
        """Well, or saddle: whether the ring under no moment is stable."""
        return _kind(self.index_moment)

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries and the kind."""
        return entries | {"kind": self.kind}

    @classmethod
    def from_disk(cls, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries without the kind, which follows from them."""
        given, kind = entries.pop("kind", None), _kind(entries.get("index_moment"))
        if given != kind:
            raise ValueError(f"kind must be {kind}, got {given!r}")
        return entries


def _kind(index: object) -> str:
    return "well" if index == 0 else "saddle"


@dataclass(frozen=True)
class Barriers(Checked):
    """Energies from one well to the other, over the highest saddle between them."""

    fold: Number | None  # that saddle above the flat ring
    open: Number | None  # above the folded ring
    saddle: Count | None  # position of that saddle in `rests`
    why: Texts = field(default_factory=dict)  # a sentence where one is None, or special


@dataclass(frozen=True, eq=False, repr=False)
class Landscape(Record, name="landscape", kind="landscape", plot="landscape"):
    """Energy along the path of twisting, from the flat ring to the folded one."""

    JOINED: ClassVar[str] = "path"
    _KNOWN: ClassVar[dict[str, Any]] = {"solver": "der", "at_pi": None, "mode": None, "error": None}

    path: Path  # stable and unstable branches, with all M = 0 states
    rests: tuple[Rest, ...]  # in path order: the flat ring first
    folded: Truth  # whether the last M = 0 state is the planar three-covered ring
    barriers: Barriers  # on the scene's own mesh
    extrapolated: Estimates = field(default_factory=dict)
    # with error bars, extrapolated values and errors: of the barriers "fold" and "open", of
    # "gamma", their saddle's, of the height "folded" above flat and of the "slope" there

    def __post_init__(self) -> None:
        super().__post_init__()
        for i, rest in enumerate(self.rests):
            if rest.position >= len(self.path):
                there = f"{rest.position} of {len(self.path)} states"
                raise ValueError(f"rests[{i}].position is {there}")

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries of the path, without those that never differ, and the other entries."""
        path = entries.pop("path")
        first = {name: path[name] for name in _OF_PATH if name in path}
        last = {"why": entries["barriers"].pop("why"), "extrapolated": entries.pop("extrapolated")}
        return super().on_disk(first | entries | last | {"timing": path["timing"]})

    @classmethod
    def from_disk(cls, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries with those of the path, and the sentences about barriers, in their places."""
        entries = super().from_disk(entries)
        own = {name: entries.pop(name) for name in _OWN if name in entries}
        if "why" in own and isinstance(own.get("barriers"), dict):
            own["barriers"] = own["barriers"] | {"why": own.pop("why")}
        return own | {"path": {"schema": 1} | cls._KNOWN | entries}

    def facts(self) -> list[str]:
        """How many states with M = 0, and the barrier to open."""
        known = self.barriers.open
        barrier = (
            "no barrier to open"
            if known is None
            else f"barrier to open {known:.6g} {unit(self.scale, 'energy')}"
        )
        return [f"{len(self.rests)} states with M = 0", barrier]

    @property
    def ring(self) -> Mapping[str, object]:  # type: ignore[override]
        """The path's."""
        return self.path.ring

    @property
    def scale(self) -> Scale | None:  # type: ignore[override]
        """The path's."""
        return self.path.scale

    @property
    def status(self) -> str:
        """The path's: done, not converged or interrupted."""
        return self.path.status

    @property
    def message(self) -> str:
        """The path's: a sentence about the status."""
        return self.path.message

    @property
    def timing(self) -> Timing:  # type: ignore[override]
        """The path's."""
        return self.path.timing

    @property
    def wells(self) -> tuple[Rest, ...]:
        """States with M = 0 that are minima while the grips turn freely."""
        return tuple(rest for rest in self.rests if rest.kind == "well")

    @property
    def saddles(self) -> tuple[Rest, ...]:
        """The other states with M = 0."""
        return tuple(rest for rest in self.rests if rest.kind == "saddle")


_ABOUT = ("status", "message", "reason", "ring", "section", "numerics", "scale")
_OF_PATH = (*_ABOUT, "gamma", "energy", "moment", "index", "index_moment", "points")
_OWN = ("rests", "folded", "barriers", "why", "extrapolated")


# --- Without grips ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Saddle(Checked):
    """A saddle of the free ring, and where the two paths of descent from it end."""

    energy: Number  # GJ/a
    index: Count | None  # rigid motions and a circle's material shift taken out
    residual: Number  # largest force left, GJ/a
    zero_modes: Count  # beyond rigid motions: 1 where material may shift along the ring at no cost
    twisted: Truth  # whether it is the saddle on the path of twisting itself
    ends: tuple[Text, ...]  # "flat", "folded" or another M = 0 state, on the two sides
    stiffness: Number  # of the unstable mode: its eigenvalue, GJ/a^2


@dataclass(frozen=True)
class Heights(Checked):
    """The saddle above the flat ring, and above the folded one."""

    fold: Number | None
    open: Number | None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Pass(Record, name="barrier of the free ring", kind="pass", plot="minimum_energy_path"):
    """The lowest saddle found between flat and folded of the free ring, and the path over it."""

    ring: RingEntry
    section: SectionEntry
    numerics: NumericsEntry
    scale: ScaleEntry | None = None
    barriers: Heights
    twisting: Barriers  # the same in clamped grips that turn freely
    saddle: Saddle | None  # the one that is crossed
    saddles: tuple[Saddle, ...]  # all that were found, lowest first
    way: Annotated[Array, table("progress", "energy")]  # (k, 2) progress [rad, root mean square]
    # from flat, and energy, down both sides
    why: Text  # a sentence where there is no such path, or none is known
    status: Status
    extrapolated: Estimates  # with error bars: of "fold" and "open"
    timing: SolveTime
    shapes: Array = in_memory(lambda: np.zeros((0, 0, 3)))  # (k, N, 3) vertices on the path

    def facts(self) -> list[str]:
        """Its barriers."""
        known = {"fold": self.fold, "open": self.open}
        energy = unit(self.scale, "energy")
        return [f"{n} none" if v is None else f"{n} {v:.6g} {energy}" for n, v in known.items()]

    @property
    def fold(self) -> float | None:
        """The barrier from flat, GJ/a."""
        return self.barriers.fold

    @property
    def open(self) -> float | None:
        """The barrier from folded, GJ/a."""
        return self.barriers.open
