"""Barriers over the section's h/t; free of kernels. Energies are those of the full ring in GJ/a."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from der.records.record import Record, SolveTime
from der.records.values import Column, Count, NumericsEntry, RingEntry, Text, gaps, mapping
from der.utils.checks import Array

_ALONG = gaps("h_over_t")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BarrierCurves(Record, name="barriers over h/t", kind="barriers", plot="barriers"):
    """Barriers over the section's h/t; NaN where there is none, or none is known."""

    ring: RingEntry
    numerics: NumericsEntry
    h_over_t: Column  # (n,)
    fold: Annotated[Array, _ALONG]  # (n,) from flat, with clamped grips that turn freely
    open: Annotated[Array, _ALONG]  # (n,) from folded
    gamma: Annotated[Array, _ALONG]  # (n,) of the saddle, rad
    folded_energy: Annotated[Array, _ALONG]
    fold_free: Annotated[Array, _ALONG]  # as fold and open, with the grips removed; NaN: not asked
    open_free: Annotated[Array, _ALONG]
    index_free: tuple[Count | None, ...]  # (n,) of the saddle of twisting with the grips removed
    why: tuple[Text, ...]  # (n,) sentences where something is missing
    error: Annotated[Mapping[str, Array], mapping(gaps(None))]  # with error bars: (n,) by name; the
    # arrays are then extrapolated
    timing: SolveTime

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, values in {"index_free": self.index_free, "why": self.why, **self.error}.items():
            self._check_lengths(name, values, ("h_over_t",))

    def facts(self) -> list[str]:
        """Over which h/t."""
        ends = f"{self.h_over_t[0]:g} to {self.h_over_t[-1]:g}" if len(self.h_over_t) else "-"
        return [f"h/t {ends}"]
