"""An energy landscape along the path of twisting: U over M, with M = 0 states and barriers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.records.landscape import Landscape, Rest
from der.records.units import unit
from der.utils.checks import Array
from der.viz.palette import INK, QUIET
from der.viz.plots import style
from der.viz.titles import OPENS, STAYS, sure, title

KINDS = {"well": style.mark("o", 5.6, INK), "saddle": style.mark("^", 6.6)}  # of M = 0 states


def draw(landscape: Landscape) -> Figure:
    """The picture of a landscape: U above M, and beside them U from the saddle to the folded ring.

    Raises
    ------
    ValueError
        If the path has no state.
    """
    path = landscape.path
    style.check_states("landscape", path)
    zoomed = landscape.barriers.open is not None
    figure = style.blank(8.6 if zoomed else 6.0, 4.6, title(path))
    left, right = (0.075, 0.5645) if zoomed else (0.105, 0.985)
    ratio = 0.4925 / 0.2325
    above, below = style.stacked(figure, ratio, left=left, right=right, bottom=0.165, top=0.915)
    curves = (
        (above, path.energy, "", style.energy(path.scale)),
        (below, path.moment, style.GAMMA, style.moment(path.scale)),
    )
    for axes, height, across, up in curves:
        _draw_curve(axes, landscape, height)
        style.label_axes(axes, across, up)
    style.zero_line(below)
    _fold_barrier(above, landscape)
    if zoomed:
        _saddle_and_well(figure.add_axes((0.6405, 0.165, 0.3445, 0.75)), landscape)
    there = {rest.kind for rest in landscape.rests}
    states = [
        style.entry(f"{kind}, $M = 0$", **look) for kind, look in KINDS.items() if kind in there
    ]
    style.legend_below(figure, [*style.stretch_entries(path), *states])
    return figure


def _draw_curve(axes: Axes, landscape: Landscape, height: Array) -> None:
    """Draw a curve over gamma, with the M = 0 states on it."""
    style.draw_stretches(axes, landscape.path, height)
    for rest in landscape.rests:
        place = (rest.gamma / math.pi, height[rest.position])
        axes.plot(*place, zorder=5, clip_on=False, **KINDS[rest.kind])


def _fold_barrier(axes: Axes, landscape: Landscape) -> None:
    """The height of the saddle above the flat ring, as an arrow; without one, the reason."""
    found = landscape.barriers
    axes.margins(x=0.03, y=0.1)
    axes.autoscale_view()
    if found.fold is None or found.saddle is None:
        text = found.why.get("fold", "")
        axes.set_title(text, fontsize=7.5, color=QUIET, loc="left", wrap=True)
        return
    saddle, flat = landscape.rests[found.saddle], landscape.rests[0]
    _barrier(axes, 0.05, flat, saddle, (0.0, saddle.gamma / math.pi))
    text = _height("fold", found.fold, landscape)
    style.annotate(axes, (0.05, flat.energy + 0.74 * found.fold), text, (7.0, 0.0))


def _saddle_and_well(axes: Axes, landscape: Landscape) -> None:
    """The neighbourhood of the saddle and the folded well, with the barrier to open."""
    found, path = landscape.barriers, landscape.path
    if found.open is None or found.saddle is None:
        return
    saddle, end = landscape.rests[found.saddle], landscape.rests[-1]
    _draw_curve(axes, landscape, path.energy)
    span = (end.gamma - saddle.gamma) / math.pi
    x = end.gamma / math.pi + 0.12 * span
    room = 1.15 if "open" in landscape.extrapolated else 0.6  # for the text beside the arrow
    axes.set_xlim(saddle.gamma / math.pi - 0.75 * span, end.gamma / math.pi + room * span)
    axes.set_ylim(end.energy - 0.7 * found.open, saddle.energy + 0.45 * found.open)
    _barrier(axes, x, end, saddle, (saddle.gamma / math.pi, x))
    text = _height("open", found.open, landscape)
    style.annotate(axes, (x, 0.5 * (end.energy + saddle.energy)), text, (6.0, 0.0))
    for rest, name, away in ((saddle, "saddle", 11.0), (end, "folded", -16.0)):
        index = "?" if rest.index_free is None else rest.index_free
        gamma, side = rest.gamma / math.pi, "bottom" if away > 0.0 else "top"
        text = f"{name}\n$\\gamma$ = {gamma:.4f} $\\pi$\nindex without grips: {index}"
        if rest is end and landscape.folded and rest.index_free is not None:
            text += f"\n{OPENS if rest.index_free else STAYS}"
        look = {"ha": "center", "va": side, "fontsize": 7.5}
        style.annotate(axes, (gamma, rest.energy), text, (0.0, away), **look)
    style.label_axes(axes, "$\\gamma/\\pi$", style.energy(path.scale), ticks=(5, 0))
    axes.ticklabel_format(useOffset=False)


def _height(name: str, mesh: float, landscape: Landscape) -> str:
    """A barrier as text; where it is extrapolated, the value of the mesh follows."""
    known, energy = landscape.extrapolated, unit(landscape.scale, "energy")
    if name not in known:
        return f"to {name}\n{mesh:.4g} {energy}"
    value, _, error = sure(*known[name]).partition(" ")
    return f"to {name}\n{value}\n{error} {energy}\nextrapolated\n(mesh {mesh:.5g})"


def _barrier(axes: Axes, x: float, low: Rest, high: Rest, across: Iterable[float]) -> None:
    """An arrow from one energy to the other, and levels through both."""
    for rest in (low, high):
        axes.plot(list(across), [rest.energy] * 2, color=QUIET, lw=0.7, linestyle=":", zorder=1)
    look: dict[str, Any] = {"arrowstyle": "<|-|>", "color": INK, "linewidth": 0.9}
    look |= {"shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (x, high.energy), xytext=(x, low.energy), arrowprops=look, zorder=4)
