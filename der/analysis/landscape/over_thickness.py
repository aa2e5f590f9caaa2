"""Barriers of a ring over the h/t of its section: one landscape, and one pass, each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import numpy as np

from der.analysis.landscape.barrier import barrier
from der.analysis.landscape.landscape import landscape
from der.continuation.richardson import Extrapolated
from der.geometry.ring import Ring
from der.geometry.section import rectangular_section
from der.records.landscape import BarrierCurves, Landscape, Pass
from der.records.record import SolveTime
from der.scene import Scene
from der.utils.interrupts import interrupts_between_states

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
    free : whether to look for the barriers of the ring left alone, too; takes ten times as long.
    error_bars : whether to extrapolate from N, N/2 and N/4 edges, and say how sure that is.
    progress : called with h/t after every landscape.

    Notes
    -----
    Ctrl-C keeps the values so far.
    """
    started = time.perf_counter()
    rows: list[tuple[float, ...]] = []
    indices: list[int | None] = []
    why: list[str] = []
    errors: list[tuple[float, ...]] = []
    with interrupts_between_states() as pressed:
        for value in map(float, h_over_t):
            section = rectangular_section(value, nu)
            scene = Scene(ring, section, n_edges=n_edges, stability=False, error_bars=error_bars)
            one = landscape(scene)
            sentences = set(one.barriers.why.values())
            found = barrier(scene) if free else None
            if found is not None:
                sentences |= {found.why} - {""}
            rows.append((value, *_twisting(one), *_alone(found)))
            errors.append(
                (
                    *_errors(one.extrapolated),
                    *_errors(found.extrapolated if found is not None else {}),
                )
            )
            saddle = one.barriers.saddle
            indices.append(None if saddle is None else one.rests[saddle].index_free)
            why.append("; ".join(sorted(sentences)))
            if progress is not None:
                progress(value)
            if pressed:
                break
    values, fold, opening, gamma, energy, fold_free, open_free = np.array(rows).reshape(-1, 7).T
    return BarrierCurves(
        ring=ring.to_json(),
        numerics={"n_edges": n_edges, "nu": nu, "error_bars": error_bars},
        h_over_t=values,
        fold=fold,
        open=opening,
        gamma=gamma,
        folded_energy=energy,
        fold_free=fold_free,
        open_free=open_free,
        index_free=tuple(indices),
        why=tuple(why),
        error=dict(zip(_BARRIERS, np.array(errors).reshape(-1, 4).T, strict=True))
        if error_bars
        else {},
        timing=SolveTime(time.perf_counter() - started),
    )


def _twisting(one: Landscape) -> tuple[float, ...]:
    """Barriers to fold and to open, gamma of the saddle and energy of the folded ring, or NaN."""
    found, sure = one.barriers, one.extrapolated
    saddle = None if found.saddle is None else one.rests[found.saddle].gamma
    energy = one.rests[-1].energy if one.folded else None
    known = {"fold": found.fold, "open": found.open, "gamma": saddle, "folded": energy}
    if sure:
        known = {name: sure[name][0] if name in sure else None for name in known}
    return _numbers(*known.values())


def _alone(found: Pass | None) -> tuple[float, ...]:
    """Barriers of the ring left alone, or NaN."""
    if found is None:
        return _numbers(None, None)
    known = {"fold": found.fold, "open": found.open}
    known |= {name: value for name, (value, _) in found.extrapolated.items()}
    return _numbers(*known.values())


def _errors(sure: Extrapolated) -> tuple[float, ...]:
    """Errors of the barriers to fold and to open, or NaN."""
    return tuple(sure.get(name, (np.nan, np.nan))[1] for name in ("fold", "open"))


def _numbers(*values: float | None) -> tuple[float, ...]:
    return tuple(np.nan if value is None else value for value in values)
