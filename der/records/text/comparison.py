"""Rod against boundary-value problem in a table."""

from __future__ import annotations

import math

from der.records.comparison import AGREED, Comparison
from der.records.text.path import ONE_ARM, mode_text
from der.records.text.table import form, table
from der.records.units import unit


def lines(found: Comparison) -> list[str]:
    """The differences at the states that were asked for, and at folds and limits."""
    asked, digits = _asked(found), form(found, ".9f")
    moment, wide = ("", 14) if found.scale is None else (f" [{unit(found.scale, 'moment')}]", 16)
    moments = ((f"M {solver}{moment}", wide) for solver in ("rod", "bvp"))
    heads = (("", -8), ("gamma", 12), *moments, ("distance", 11), ("bar", 10), ("", 0))
    rows = [
        (
            state.kind,
            f"{state.gamma:.8f}",
            f"{state.rod_moment:{digits}}",
            f"{state.bvp_moment:{digits}}",
            f"{state.moment_distance:.1e}",
            "" if state.moment_bar is None else f"{state.moment_bar:.1e}",
            "  beyond" if state.agrees is False else "",
        )
        for state in found.states
        if state.kind or state.gamma in asked
    ]
    told = [*table(heads, rows), ONE_ARM]
    for pair in found.pairs:
        bar = "" if pair.bar is None else f", bar {pair.bar:.1e}"
        told.append(
            f"{pair.kind:8}{pair.rod_gamma:12.8f}{'':14}{pair.bvp_gamma:12.8f} by bvp: "
            f"{pair.difference:.1e} rad apart{bar}"
        )
    told += _agreement(found)
    both = {"rod": found.rod.mode, "bvp": found.bvp.mode}
    return told + [f"{name}: {mode_text(mode)}" for name, mode in both.items() if mode is not None]


def _agreement(found: Comparison) -> list[str]:
    """How far the curves are apart, and how many states are inside their error bars."""
    moment, energy = found.largest
    told = [f"largest normal distance: {moment:.1e} in M, {energy:.1e} in U (scaled planes)"]
    if not math.isnan(found.within):
        told.append(f"{100 * found.within:.1f} % of the states agree within their error bars")
    if found.disagrees:
        told.append(
            f"The two solvers disagree: less than {100 * AGREED:.0f} % of the states are inside "
            "their error bars. Use more edges."
        )
    if found.unmatched:
        told.append(f"{found.unmatched} states or special points have no counterpart")
    return told


def _asked(found: Comparison) -> set[float]:
    """Gammas that the user asked for, or the multiples of pi/8."""
    listed = found.rod.numerics.get("save_at")
    if isinstance(listed, list):
        return {*listed, math.pi}
    return {k * math.pi / 8.0 for k in range(-80, 81)}
