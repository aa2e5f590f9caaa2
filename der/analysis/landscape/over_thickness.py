"""Barriers of a ring over the h/t of its section, from a landscape and a pass at each value."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from der.analysis.landscape.barrier import barrier
from der.analysis.landscape.landscape import landscape
from der.continuation.richardson import Extrapolated
from der.geometry.ring import Ring
from der.geometry.section import rectangular_section
from der.records.barriers import BarrierCurves
from der.records.landscape import Landscape, Pass
from der.records.record import SolveTime
from der.scene import Scene
from der.utils.run import Run

_BARRIERS = ("fold", "open", "fold_free", "open_free")


def barriers_over(
    ring: Ring,
    h_over_t: Iterable[float],
    *,
    nu: float = 0.3,
    n_edges: int = 64,
    free: bool = False,
    error_bars: bool = True,
    progress: Callable[[float], object] | None = None,
) -> BarrierCurves:
    """Barriers of a ring over the h/t of its section.

    Parameters
    ----------
    free : whether to compute the barriers of the free ring, too; takes ten times as long.
    error_bars : whether to extrapolate from N, N/2 and N/4 edges, with error bars.
    progress : called with h/t after every landscape.

    Notes
    -----
    Ctrl-C keeps the values found so far.
    """

    def solved(value: float) -> _Row:
        section = rectangular_section(value, nu)
        scene = Scene(ring, section, n_edges=n_edges, stability=False, error_bars=error_bars)
        return _Row.of(value, landscape(scene), barrier(scene) if free else None)

    def tell(row: _Row) -> None:
        if progress is not None:
            progress(row.values[0])

    with Run() as run:
        rows = run.collect((solved(float(value)) for value in h_over_t), tell)
    names = ("h_over_t", "fold", "open", "gamma", "folded_energy", "fold_free", "open_free")
    columns = np.array([row.values for row in rows]).reshape(-1, len(names)).T
    errors = np.array([row.errors for row in rows]).reshape(-1, len(_BARRIERS)).T
    return BarrierCurves(
        ring=ring.to_json(),
        numerics={"n_edges": n_edges, "nu": nu, "error_bars": error_bars},
        **dict(zip(names, columns, strict=True)),
        index_free=tuple(row.index_free for row in rows),
        why=tuple(row.why for row in rows),
        error=dict(zip(_BARRIERS, errors, strict=True)) if error_bars else {},
        timing=SolveTime(run.seconds),
    )


class _Row(NamedTuple):
    """The values at one h/t."""

    values: tuple[float, ...]  # h/t, and the columns of the record
    errors: tuple[float, ...]  # of `_BARRIERS`
    index_free: int | None  # of the saddle, without grips
    why: str

    @classmethod
    def of(cls, h_over_t: float, one: Landscape, free: Pass | None) -> _Row:
        """The row of a landscape, and of the barrier of the free ring."""
        found, extrapolated = one.barriers, one.extrapolated
        sentences = set(found.why.values()) | ({free.why} - {""} if free else set())
        saddle = None if found.saddle is None else one.rests[found.saddle]
        known = {
            "fold": found.fold,
            "open": found.open,
            "gamma": None if saddle is None else saddle.gamma,
            "folded": one.rests[-1].energy if one.folded else None,
        }
        if extrapolated:
            known = {name: extrapolated.get(name, (None, None))[0] for name in known}
        without = {} if free is None else free.extrapolated
        own = {"fold": free.fold, "open": free.open} if free else {"fold": None, "open": None}
        of_free = [without.get(name, (value, None))[0] for name, value in own.items()]
        return cls(
            _numbers(h_over_t, *known.values(), *of_free),
            (*_errors(extrapolated), *_errors(without)),
            None if saddle is None else saddle.index_free,
            "; ".join(sorted(sentences)),
        )


def _errors(extrapolated: Extrapolated) -> tuple[float, ...]:
    """Errors of the barriers to fold and to open, or NaN."""
    return tuple(extrapolated.get(name, (np.nan, np.nan))[1] for name in ("fold", "open"))


def _numbers(*values: float | None) -> tuple[float, ...]:
    return tuple(np.nan if value is None else value for value in values)
