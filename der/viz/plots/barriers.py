"""Energy barriers over h/t as a picture: to fold, above, and to open, below."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter

from der.records.barriers import BarrierCurves
from der.viz.palette import DASHES, QUIET, STABLE, UNSTABLE
from der.viz.plots.style import blank, entry, label_axes, legend_below, zero_line
from der.viz.titles import title

TICKS = (1, 1.5, 2, 3, 4, 6, 8, 10, 15, 20, 30, 50)


def draw(curves: BarrierCurves) -> Figure:
    """The picture of barriers over h/t, in grips and of the free ring."""
    figure = blank(6.2, 5.0, title(curves))
    grid = figure.add_gridspec(
        2, 1, left=0.12, right=0.97, bottom=0.145, top=0.915, height_ratios=(1.0, 1.25), hspace=0.07
    )
    above = figure.add_subplot(grid[0])
    below = figure.add_subplot(grid[1], sharex=above)
    lines = (
        ("in grips that turn freely", STABLE, "-", "o", curves.fold, curves.open),
        ("free ring", UNSTABLE, DASHES, "s", curves.fold_free, curves.open_free),
    )
    handles = []
    for label, colour, style, marker, *both in lines:
        if not np.any(np.isfinite(both)):
            continue
        look: dict[str, Any] = {"color": colour, "linestyle": style, "linewidth": 1.6}
        look |= {"marker": marker, "markersize": 2.8}
        for axes, values in zip((above, below), both, strict=True):
            axes.plot(curves.h_over_t, values, **look)
        handles.append(entry(label, **look))
    look = {"color": QUIET, "linewidth": 1.0, "linestyle": ":"}
    above.plot(curves.h_over_t, curves.folded_energy, **look)
    handles.append(entry("energy of the folded ring", **look))
    label_axes(above, "", "to fold  $\\Delta U\\,a/GJ$")
    label_axes(below, "height over thickness of the section  $h/t$", "to open  $\\Delta U\\,a/GJ$")
    zero_line(below)
    above.tick_params(labelbottom=False)
    below.set_xscale("log")
    below.xaxis.set_minor_locator(FixedLocator([]))
    low, high = float(curves.h_over_t.min()), float(curves.h_over_t.max())
    below.xaxis.set_major_locator(FixedLocator([tick for tick in TICKS if low <= tick <= high]))
    below.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    legend_below(figure, handles)
    return figure
