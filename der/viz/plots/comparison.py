"""Rod and boundary-value problem in one picture: the curves, and how far they lie apart."""

from __future__ import annotations

import math
from pathlib import Path as File
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from der.analysis.compare import Comparison
from der.records.path import Path
from der.records.text import headline
from der.utils.files import FilePath, write_whole
from der.viz.curve import smooth

FORMATS = (".png", ".pdf", ".svg")
ROD, BVP, BAR = "#D55E00", "#0072B2", "#8a8a8a"
FLOOR = 1e-13  # of the distances drawn: rounding


def figure_of_comparison(comparison: Comparison) -> Figure:
    """M and U of both against gamma; below, normal distances of the rod's states and their bars."""
    figure = Figure(figsize=(8.0, 7.0), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    rod = comparison.rod
    figure.suptitle(headline(rod), fontsize=10)
    grid = figure.add_gridspec(
        2, 2, left=0.1, right=0.985, bottom=0.125, top=0.935, wspace=0.27, hspace=0.23
    )
    handles: dict[str, Any] = {}
    for column, (name, label) in enumerate((("moment", "$M\\,a/GJ$"), ("energy", "$U\\,a/GJ$"))):
        above = figure.add_subplot(grid[0, column])
        below = figure.add_subplot(grid[1, column])
        _curves(above, comparison, name, label)
        _distances(below, comparison, name)
        for axes in (above, below):
            handles |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    figure.legend(
        list(handles.values()),
        list(handles),
        loc="lower center",
        ncols=3,
        frameon=False,
        fontsize=8,
        borderaxespad=0.2,
    )
    return figure


def save_comparison(comparison: Comparison, file: FilePath) -> None:
    """Write the figure, whole or not at all, in the format of the file's suffix.

    Raises
    ------
    ValueError
        If the suffix is not one of FORMATS.
    OSError
        If the file cannot be written.
    """
    suffix = File(file).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"plot must end in {', '.join(FORMATS)}, got {str(file)!r}")
    figure = figure_of_comparison(comparison)
    write_whole(file, lambda opened: figure.savefig(opened, format=suffix[1:]))


def _curves(axes: Axes, comparison: Comparison, name: str, label: str) -> None:
    """Both paths: the rod's states as open circles on the other's curve, smooth through its own."""
    rod, bvp = comparison.rod, comparison.bvp
    axes.plot(
        *smooth(bvp, getattr(bvp, name)).T,
        color=BVP,
        linewidth=1.4,
        label=f"boundary-value problem, {bvp.numerics['intervals']} intervals",
    )
    axes.plot(
        bvp.gamma / math.pi,
        getattr(bvp, name),
        linestyle="none",
        marker="o",
        markersize=2.6,
        color=BVP,
        label="its states",
    )
    axes.plot(
        rod.gamma / math.pi,
        getattr(rod, name),
        linestyle="none",
        marker="o",
        markersize=4.6,
        markerfacecolor="none",
        color=ROD,
        label=f"rod, {rod.numerics['n_edges']} edges{_extrapolated(rod)}",
    )
    axes.set_xlabel("$\\gamma/\\pi$")
    axes.set_ylabel(label)
    axes.margins(x=0.02)


def _extrapolated(rod: Path) -> str:
    return "" if rod.error is None else ", extrapolated"


def _distances(axes: Axes, comparison: Comparison, name: str) -> None:
    """Normal distances in path order, with the bars that allow for them."""
    states = comparison.states
    gamma = np.array([state.gamma for state in states]) / math.pi
    distance = np.array([getattr(state, f"{name}_distance") for state in states])
    bars = [getattr(state, f"{name}_bar") for state in states]
    axes.semilogy(
        gamma,
        np.maximum(distance, FLOOR),
        linestyle="none",
        marker="o",
        markersize=3.6,
        color=ROD,
        label="normal distance",
    )
    known = [k for k, bar in enumerate(bars) if bar is not None]
    if known:
        axes.semilogy(
            gamma[known],
            [bars[k] for k in known],
            linestyle="none",
            marker="_",
            markersize=8,
            color=BAR,
            label="error bar",
        )
    axes.set_xlabel("$\\gamma/\\pi$")
    if name == "moment":
        axes.set_ylabel("distance in the scaled plane")
    axes.set_ylim(bottom=0.5 * FLOOR)
    axes.margins(x=0.02)
