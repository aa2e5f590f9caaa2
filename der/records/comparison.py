"""The comparison of a rod's path with that of the boundary-value problem; free of kernels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from der.geometry.scale import Scale
from der.records.entries import Checked
from der.records.path import Path
from der.records.record import Record
from der.records.values import Count, Number, Text

AGREED = 0.9  # share of the states inside their error bars, below which the two disagree


@dataclass(frozen=True)
class ComparedState(Checked):
    """A state of the rod and its counterpart."""

    DERIVED: ClassVar[tuple[str, ...]] = ("agrees",)

    gamma: Number  # rad
    kind: Text  # "" or the kind of special point
    rod_moment: Number  # GJ/a
    rod_energy: Number
    bvp_moment: Number
    bvp_energy: Number
    moment_distance: Number  # normal distance in (gamma/pi, M/max|M|)
    moment_bar: Number | None  # allowed distance: error bars of the rod, and tolerance of the other
    energy_distance: Number
    energy_bar: Number | None

    @property
    def agrees(self) -> bool | None:
        """Whether both distances lie within their error bars; None where there are none."""
        if self.moment_bar is None or self.energy_bar is None:
            return None
        return self.moment_distance <= self.moment_bar and self.energy_distance <= self.energy_bar


@dataclass(frozen=True)
class ComparedPoint(Checked):
    """A fold or limit of both paths."""

    DERIVED: ClassVar[tuple[str, ...]] = ("difference",)

    kind: Text
    rod_gamma: Number  # rad
    bvp_gamma: Number
    bar: Number | None  # the rod's error of gamma there, rad, and the other's

    @property
    def difference(self) -> float:
        """In gamma, rad."""
        return abs(self.rod_gamma - self.bvp_gamma)

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries, the bar after the difference."""
        bar = entries.pop("bar")
        return super().on_disk(entries) | {"bar": bar}


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Record, name="comparison", plot="comparison"):
    """A rod's path and that of its boundary-value problem."""

    DERIVED: ClassVar[tuple[str, ...]] = ("within",)

    rod: Path
    bvp: Path
    states: tuple[ComparedState, ...]
    pairs: tuple[ComparedPoint, ...]  # folds and limits, in path order
    unmatched: Count  # states of the rod, and special points of either, without a counterpart

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries and the share that agrees; null where it is not known."""
        written = super().on_disk(entries)
        return written | ({"within": None} if math.isnan(self.within) else {})

    def facts(self) -> list[str]:
        """How well both agree."""
        share = "no error bars" if math.isnan(self.within) else f"{100 * self.within:.1f} % agree"
        moment, energy = self.largest
        within = f"within {moment:.1e} in M, {energy:.1e} in U"
        return [f"{len(self.states)} states", share, within]

    @property
    def ring(self) -> Mapping[str, object]:  # type: ignore[override]
        """The rod's."""
        return self.rod.ring

    @property
    def scale(self) -> Scale | None:  # type: ignore[override]
        """The rod's."""
        return self.rod.scale

    @property
    def solve_s(self) -> float:
        """Seconds that both solvers took."""
        return self.rod.solve_s + self.bvp.solve_s

    @property
    def within(self) -> float:
        """Share of the states with error bars that agree within them; NaN where there are none."""
        known = [state.agrees for state in self.states if state.agrees is not None]
        return sum(known) / len(known) if known else math.nan

    @property
    def disagrees(self) -> bool:
        """Whether too few states agree within their error bars; False where there are none."""
        return self.within < AGREED

    @property
    def largest(self) -> tuple[float, float]:
        """Largest distances in M and in U."""
        moment = max((state.moment_distance for state in self.states), default=math.nan)
        return moment, max((state.energy_distance for state in self.states), default=math.nan)
