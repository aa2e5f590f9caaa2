"""Loops of loading and unloading over the path of equilibria, one column a ring."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.paper import canvas
from der.paper.hysteresis import Loop
from der.records.path import Path
from der.utils.checks import Array
from der.viz import palette
from der.viz.curve import smooth
from der.viz.plots import style
from der.viz.titles import ring_text, section_text

LINES: dict[str, dict[str, Any]] = {
    "equilibria": {"color": "#9ec9e8", "linestyle": "-", "linewidth": 3.2},
    "loading": {"color": canvas.INK, "linestyle": (0, (4.0, 1.8)), "linewidth": 1.3},
    "unloading": {"color": palette.UNSTABLE, "linestyle": (0, (1.0, 1.4)), "linewidth": 1.7},
}
STAR = style.mark("*", 8.0) | {"zorder": 5}
ROWS = (("moment", "$M\\,a/GJ$"), ("energy", "$U\\,a/GJ$"))


def figure_of_loops(loops: list[Loop]) -> Figure:
    """M above U against gamma: equilibria solid, loading dashed, unloading dotted."""
    figure = canvas.page(3.3 * len(loops), 5.8)
    grid = figure.add_gridspec(
        2, len(loops), left=0.045, right=0.99, bottom=0.135, top=0.92, hspace=0.08, wspace=0.17
    )
    for column, loop in enumerate(loops):
        axes = [figure.add_subplot(grid[row, column]) for row in range(2)]
        for panel, (name, label) in zip(axes, ROWS, strict=True):
            _draw(panel, loop, name)
            style.label_axes(panel, "", label if column == 0 else "")
        if _is_small(loop):
            _zoom(axes[1], loop)
        axes[0].set_title(_title(loop), fontsize=8.5, color=canvas.INK)
        axes[0].tick_params(labelbottom=False)
        style.zero_line(axes[0])
        axes[1].set_xlabel("$\\gamma/\\pi$", fontsize=9, color=canvas.INK)
    handles = [style.entry(label, **look) for label, look in LINES.items()]
    style.legend_below(figure, [*handles, style.entry("end state of a snap", **STAR)], fontsize=8.5)
    return figure


def _title(loop: Loop) -> str:
    """Ring and section, and the work of the loop."""
    ring, section = ring_text(loop.turned.ring), section_text(loop.turned.section, nu=False)
    spent = f"loop {loop.work:.4f}, snaps release {sum(loop.released):.4f} $GJ/a$"
    return f"{ring}\n{section}; {spent}"


def _is_small(loop: Loop) -> bool:
    """Whether snaps lie so close to each other that their energies do not show."""
    return float(np.ptp([snap.gamma for snap in loop.snaps])) < 0.2 * math.pi


def _zoom(panel: Axes, loop: Loop) -> None:
    """The energies of the loop, larger, where there is room."""
    inset = panel.inset_axes((0.58, 0.08, 0.4, 0.42))
    _draw(inset, loop, "energy")
    style.label_axes(inset, "", "")
    landed = [snap.position for snap in loop.snaps]
    at = [*landed, *(k - 1 for k in landed)]
    for set_limits, values in (
        (inset.set_xlim, loop.turned.gamma[at] / math.pi),
        (inset.set_ylim, loop.turned.energy[at]),
    ):
        low, high = float(values.min()), float(values.max())
        set_limits(low - 0.25 * (high - low), high + 0.25 * (high - low))
    inset.tick_params(labelsize=6.5)
    panel.indicate_inset_zoom(inset, edgecolor=canvas.QUIET)


def _draw(panel: Axes, loop: Loop, name: str) -> None:
    """The path, loading and unloading, and where the snaps end."""
    turned = loop.turned
    curves = (
        smooth(loop.equilibria, getattr(loop.equilibria, name)),
        _between(turned, name, 0, loop.top),
        _between(turned, name, loop.top, len(turned) - 1),
    )
    for curve, look in zip(curves, LINES.values(), strict=True):
        panel.plot(*curve.T, **look)
    at = [snap.position for snap in loop.snaps]
    panel.plot(turned.gamma[at] / math.pi, getattr(turned, name)[at], **STAR)
    panel.margins(x=0.03, y=0.07)


def _between(path: Path, name: str, first: int, last: int) -> Array:
    """The curve from one state to another; snaps are straight down."""
    curve = smooth(path, getattr(path, name))
    per = (len(curve) - 1) // (len(path) - 1)
    return curve[first * per : last * per + 1]
