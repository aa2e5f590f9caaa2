"""Energy barriers over h/t as a picture: to fold, above, and to open, below."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter

from der.records.barriers import BarrierCurves
from der.viz.palette import DASHES, QUIET, STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.titles import title

LINE: dict[str, Any] = {"linewidth": 1.6, "markersize": 2.8}
GRIPPED = LINE | {"color": STABLE, "linestyle": "-", "marker": "o"}
FREE = LINE | {"color": UNSTABLE, "linestyle": DASHES, "marker": "s"}
FOLDED: dict[str, Any] = {"color": QUIET, "linewidth": 1.0, "linestyle": ":"}
TICKS = (1, 1.5, 2, 3, 4, 6, 8, 10, 15, 20, 30, 50)


def draw(curves: BarrierCurves) -> Figure:
    """The picture of barriers over h/t, in grips and of the free ring."""
    figure = style.blank(6.2, 5.0, title(curves))
    above, below = style.stacked(figure, 0.8, left=0.12, right=0.97, bottom=0.145, top=0.915)
    handles = []
    for label, look, *both in (
        ("in grips that turn freely", GRIPPED, curves.fold, curves.open),
        ("free ring", FREE, curves.fold_free, curves.open_free),
    ):
        if np.any(np.isfinite(both)):
            for axes, values in zip((above, below), both, strict=True):
                axes.plot(curves.h_over_t, values, **look)
            handles.append(style.entry(label, **look))
    above.plot(curves.h_over_t, curves.folded_energy, **FOLDED)
    handles.append(style.entry("energy of the folded ring", **FOLDED))
    across = "height over thickness of the section  $h/t$"
    style.label_axes(above, "", "to fold  $\\Delta U\\,a/GJ$")
    style.label_axes(below, across, "to open  $\\Delta U\\,a/GJ$")
    style.zero_line(below)
    below.set_xscale("log")
    below.xaxis.set_minor_locator(FixedLocator([]))
    low, high = float(curves.h_over_t.min()), float(curves.h_over_t.max())
    below.xaxis.set_major_locator(FixedLocator([tick for tick in TICKS if low <= tick <= high]))
    below.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    style.legend_below(figure, handles)
    return figure
