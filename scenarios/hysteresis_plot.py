"""Loops of loading and unloading over the path of equilibria, one column a ring."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from der.records.path import Path
from der.utils.files import FilePath, write_whole
from der.viz.curve import smooth

if TYPE_CHECKING:
    from scenarios.hysteresis import Loop

PATH, LOADING, UNLOADING, INK, QUIET = "#9ec9e8", "#222222", "#D55E00", "#222222", "#8a8a8a"
LINES: tuple[tuple[str, str, Any, float], ...] = (  # label, colour, style, width
    ("equilibria", PATH, "-", 3.2),
    ("loading", LOADING, (0, (4.0, 1.8)), 1.3),
    ("unloading", UNLOADING, (0, (1.0, 1.4)), 1.7),
)
NAMES = {"vertex_angle": "angle", "b_over_a": "b/a", "r_over_a": "r/a"}
PANELS = (("moment", "$M\\,a/GJ$"), ("energy", "$U\\,a/GJ$"))


def save_loops(loops: list[Loop], file: FilePath) -> None:
    """Write the picture as png, whole or not at all.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    figure = figure_of_loops(loops)
    write_whole(file, lambda opened: figure.savefig(opened, format="png"))


def figure_of_loops(loops: list[Loop]) -> Figure:
    """M above U against gamma: equilibria solid, loading dashed, unloading dotted."""
    figure = Figure(figsize=(3.3 * len(loops), 5.8), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        2, len(loops), left=0.045, right=0.99, bottom=0.135, top=0.92, hspace=0.08, wspace=0.17
    )
    for column, loop in enumerate(loops):
        panels = [figure.add_subplot(grid[row, column]) for row in range(2)]
        for panel, (name, label) in zip(panels, PANELS, strict=True):
            _draw(panel, loop, name)
            if name == "energy" and _is_small(loop):
                _zoom(panel, loop)
            if column == 0:
                panel.set_ylabel(label, fontsize=9, color=INK)
        panels[0].set_title(_title(loop), fontsize=8.5, color=INK)
        panels[0].tick_params(labelbottom=False)
        panels[0].axhline(0.0, color=QUIET, linewidth=0.6, zorder=0)
        panels[1].set_xlabel("$\\gamma/\\pi$", fontsize=9, color=INK)
    handles = [
        Line2D([], [], color=colour, linestyle=style, linewidth=width, label=label)
        for label, colour, style, width in LINES
    ]
    handles.append(Line2D([], [], label="landing", **_star()))
    figure.legend(
        handles=handles,
        loc="lower center",
        ncols=len(handles),
        frameon=False,
        fontsize=8.5,
        handlelength=3.0,
        labelcolor=INK,
    )
    return figure


def _star() -> dict[str, Any]:
    return {
        "linestyle": "none",
        "marker": "*",
        "markersize": 8.0,
        "markerfacecolor": "white",
        "markeredgecolor": INK,
        "markeredgewidth": 0.9,
        "zorder": 5,
    }


def _title(loop: Loop) -> str:
    """Ring and section, and what the loop spends."""
    ring = loop.turned.ring
    degrees = {"vertex_angle": "°"}
    numbers = [
        f"{NAMES[name]} = {value:.3g}{degrees.get(name, '')}"
        for name, value in ring.items()
        if name in NAMES
    ]
    about = ", about y" if ring["twist_axis"] == "y" else ""
    first = (
        f"{ring['shape']}, {', '.join(numbers)}{about}, h/t = {loop.turned.section['h_over_t']:g}"
    )
    return f"{first}\nloop {loop.work:.4f}, snaps release {sum(loop.released):.4f} $GJ/a$"


def _is_small(loop: Loop) -> bool:
    """Whether snaps lie so close to each other that their energies do not show."""
    return float(np.ptp([snap.gamma for snap in loop.snaps])) < 0.2 * math.pi


def _zoom(panel: Axes, loop: Loop) -> None:
    """The energies of the loop, larger, where there is room."""
    inset = panel.inset_axes((0.58, 0.08, 0.4, 0.42))
    _draw(inset, loop, "energy")
    path = loop.turned
    at = [snap.position for snap in loop.snaps]
    at += [k - 1 for k in at]
    for set_limits, values in (
        (inset.set_xlim, path.gamma[at] / math.pi),
        (inset.set_ylim, path.energy[at]),
    ):
        low, high = float(values.min()), float(values.max())
        set_limits(low - 0.25 * (high - low), high + 0.25 * (high - low))
    inset.tick_params(labelsize=6.5)
    panel.indicate_inset_zoom(inset, edgecolor=QUIET)


def _draw(panel: Axes, loop: Loop, name: str) -> None:
    """The path, the way up and the way down, and where the ring lands."""
    turned = loop.turned
    top = int(np.argmax(turned.gamma))
    ways = (
        smooth(loop.equilibria, getattr(loop.equilibria, name)),
        _between(turned, name, 0, top),
        _between(turned, name, top, len(turned) - 1),
    )
    for curve, (_, colour, style, width) in zip(ways, LINES, strict=True):
        panel.plot(*curve.T, color=colour, linestyle=style, linewidth=width)
    at = [snap.position for snap in loop.snaps]
    panel.plot(turned.gamma[at] / math.pi, getattr(turned, name)[at], **_star())
    panel.margins(x=0.03, y=0.07)
    panel.tick_params(labelsize=8, color=QUIET, labelcolor=INK, direction="in")
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(QUIET)


def _between(path: Path, name: str, first: int, last: int) -> np.ndarray:
    """The curve from one state to another; snaps are straight down."""
    curve = smooth(path, getattr(path, name))
    per = (len(curve) - 1) // (len(path) - 1)
    return curve[first * per : last * per + 1]
