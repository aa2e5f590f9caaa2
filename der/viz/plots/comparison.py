"""Rod and boundary-value problem in one picture: their curves, and the distances of these."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.records.comparison import Comparison
from der.records.path import Path
from der.viz.curve import smooth
from der.viz.palette import QUIET, STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.titles import SOLVERS, title

ROD, BVP = UNSTABLE, STABLE  # colours
FLOOR = 1e-13  # of the distances drawn: rounding


def draw(comparison: Comparison) -> Figure:
    """The picture of a comparison: M and U of both solvers over distances and their error bars."""
    rod, bvp = comparison.rod, comparison.bvp
    figure = style.blank(8.0, 7.0, title(rod, f"{bvp.numerics['intervals']} intervals"))
    sides = {"left": 0.1, "right": 0.985, "bottom": 0.125, "top": 0.935}
    grid = figure.subplots(2, 2, gridspec_kw=sides | {"wspace": 0.27, "hspace": 0.23})
    names = (
        ("moment", style.moment(rod.scale, "moment of one arm"), "distance in the scaled plane"),
        ("energy", style.energy(rod.scale), ""),
    )
    handles: dict[str, Any] = {}
    for (above, below), (name, label, distance) in zip(grid.T, names, strict=True):
        _draw_curves(above, rod, bvp, name)
        _draw_distances(below, comparison.states, name)
        style.label_axes(above, style.GAMMA, label)
        style.label_axes(below, style.GAMMA, distance)
        for axes in (above, below):
            axes.margins(x=0.02)
            handles |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    style.legend_below(figure, list(handles.values()))
    return figure


def _points(marker: str, size: float, colour: str, **more: Any) -> dict[str, Any]:
    """The look of separate points."""
    look = {"linestyle": "none", "marker": marker, "markersize": size, "color": colour}
    return look | more


def _draw_curves(axes: Axes, rod: Path, bvp: Path, name: str) -> None:
    """Draw both paths: the states of the rod as open circles on the curve of the other."""
    curve, states = smooth(bvp, getattr(bvp, name)), getattr(bvp, name)
    axes.plot(*curve.T, color=BVP, linewidth=1.4, label=SOLVERS["bvp"])
    axes.plot(bvp.gamma / math.pi, states, label="its states", **_points("o", 2.6, BVP))
    label = SOLVERS["der"] + ("" if rod.error is None else ", extrapolated")
    look = _points("o", 4.6, ROD, markerfacecolor="none")
    axes.plot(rod.gamma / math.pi, getattr(rod, name), label=label, **look)


def _draw_distances(axes: Axes, states: Any, name: str) -> None:
    """Draw normal distances in path order, with the error bars of both."""
    gamma = np.array([state.gamma for state in states]) / math.pi
    distance = np.array([getattr(state, f"{name}_distance") for state in states])
    allowed = np.array([getattr(state, f"{name}_bar") for state in states], dtype=float)
    look = _points("o", 3.6, ROD)
    axes.semilogy(gamma, np.maximum(distance, FLOOR), label="normal distance", **look)
    if np.isfinite(allowed).any():
        axes.semilogy(gamma, allowed, label="error bar", **_points("_", 8, QUIET))
    axes.set_ylim(bottom=0.5 * FLOOR)
