"""Energy over twist and distance of the grips: contours, and the surface in perspective."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from der.records.energy_surface import Surface
from der.utils.checks import Array
from der.viz.palette import INK, QUIET, UNSTABLE
from der.viz.plots import style
from der.viz.titles import title

YELLOW = "#F0E442"
LEVELS = 28  # of a filled contour
CEILING = 1.35  # over the path's largest energy: higher energies have one colour
COLOURS = "YlGnBu_r"


def draw(surface: Surface) -> Figure:
    """Contours of the least energy over twist and distance, and the surface in perspective.

    Raises
    ------
    ValueError
        If no cell has a minimum.
    """
    if not np.any(np.isfinite(surface.energy)):
        raise ValueError("surface must have a minimum in some cell to be plotted, got none")
    figure = style.blank(10.4, 4.7, title(surface))
    ceiling = CEILING * float(np.nanmax(surface.path[:, 2]))
    norm = PowerNorm(0.7, 0.0, ceiling)
    axes = figure.add_axes((0.06, 0.175, 0.42, 0.74))
    filled = _contours(axes, surface, norm)
    handles = [*_hatches(axes, surface), *_overlay(axes, surface)]
    style.label_axes(
        axes, style.GAMMA, style.quantity(surface.scale, "distance of the grips", "d", "length")
    )
    axes.set_xlim(surface.gamma[0] / math.pi, surface.gamma[-1] / math.pi)
    axes.set_ylim(float(surface.distance[0]), float(surface.distance[-1]))
    bar = figure.colorbar(filled, cax=figure.add_axes((0.492, 0.175, 0.011, 0.74)))
    ticks = MaxNLocator(7).tick_values(0.0, 0.97 * ceiling)[:-1]
    style.dress_bar(bar, style.quantity(surface.scale, "least energy", "U", "energy"), ticks, 8.5)
    _relief(figure, surface, norm)
    style.legend_below(figure, handles)
    return figure


def _contours(axes: Axes, surface: Surface, norm: PowerNorm) -> Any:
    """Filled contours of the least energy up to the ceiling."""
    x, y, ceiling = surface.gamma / math.pi, surface.distance, float(norm.vmax or 1.0)
    values = np.ma.masked_invalid(np.minimum(surface.energy, 2.0 * ceiling)).T
    levels = ceiling * np.linspace(0.0, 1.0, LEVELS) ** 1.4
    axes.contour(x, y, values, levels, colors=INK, linewidths=0.35, alpha=0.35)
    return axes.contourf(x, y, values, levels, cmap=COLOURS, norm=norm, extend="max")


def _hatches(axes: Axes, surface: Surface) -> Iterator[Patch]:
    """Hatching over cells with several minima, and dots over those of index above 0."""
    look: dict[str, Any] = {"facecolor": "#d9ecd0", "edgecolor": QUIET, "linewidth": 0.0}
    unstable = "unstable to modes without the symmetry"
    for chosen, hatch, label in (
        (surface.count > 1, "////", "several minima"),
        (surface.index > 0, "....", unstable),
    ):
        if np.any(chosen):
            grid = (surface.gamma / math.pi, surface.distance, chosen.T.astype(float))
            shade = axes.contourf(*grid, (0.5, 1.5), colors="none", hatches=(hatch,))
            shade.set(edgecolor=(0.13, 0.13, 0.13, 0.35), linewidth=0.0)
            yield Patch(hatch=hatch, label=label, **look)


def _overlay(axes: Axes, surface: Surface) -> Iterator[Line2D]:
    """The path of twisting with its folds and M = 0 states, and snaps."""
    line: dict[str, Any] = {"color": INK, "linewidth": 1.5}
    edge = [withStroke(linewidth=2.8, foreground="white")]
    turn, away, _ = surface.path.T
    axes.plot(turn / math.pi, away, path_effects=edge, zorder=3, **line)
    yield style.entry("path of twisting", **line)
    snap: dict[str, Any] = {"color": UNSTABLE, "linewidth": 1.4}
    for one in surface.snaps:
        x, y = one[:, 0] / math.pi, one[:, 1]
        axes.plot(x, y, zorder=4, **snap)
        arrow = {"arrowstyle": "-|>", **snap}
        axes.annotate("", (x[-1], y[-1]), xytext=(x[0], y[0]), arrowprops=arrow, zorder=4)
    if surface.snaps:
        yield style.entry("snap", marker=">", markersize=4, **snap)
    for places, label, look in (
        (surface.folds, "fold", style.mark(*style.MARKS["fold"])),
        (surface.rests, "$M = 0$", style.mark("o", 5.0, YELLOW)),
    ):
        if len(places):
            axes.plot(places[:, 0] / math.pi, places[:, 1], zorder=5, clip_on=False, **look)
            yield style.entry(label, **look)


def _relief(figure: Figure, surface: Surface, norm: PowerNorm) -> None:
    """The surface in perspective up to the ceiling, with the path and snaps on it."""
    axes: Any = figure.add_axes((0.6, 0.09, 0.4, 0.9), projection="3d")
    x, y, height = _finer(surface)
    ceiling = float(norm.vmax or 1.0)
    fine: dict[str, Any] = {"rcount": len(x), "ccount": len(y), "linewidth": 0.0}
    visible = np.where(height <= ceiling, height, np.nan)
    axes.plot_surface(x, y, visible, cmap=COLOURS, norm=norm, antialiased=False, alpha=0.9, **fine)
    turn, away, energy = surface.path.T
    shown = (turn >= surface.gamma[0]) & (turn <= surface.gamma[-1])
    lines = [(turn, away, np.where(shown, energy, np.nan), INK)]
    lines += [(*one.T, UNSTABLE) for one in surface.snaps]
    for k, (gamma, distance, along, colour) in enumerate(lines):
        over = along + 0.01 * ceiling
        axes.plot(gamma / math.pi, distance, over, color=colour, linewidth=1.5, zorder=10 + k)
    axes.set_zlim(0.0, ceiling)
    axes.view_init(elev=27.0, azim=-128.0)
    axes.zaxis.set_rotate_label(False)
    axes.set_box_aspect((1.25, 1.0, 0.8), zoom=0.95)
    length = style.quantity(surface.scale, "", "d", "length").strip()
    height_label = style.quantity(surface.scale, "", "U", "energy").strip()
    labels = {"x": "$\\gamma/\\pi$", "y": length, "z": height_label}
    for name, label in labels.items():
        axis = getattr(axes, f"{name}axis")
        axis.set_label_text(label, fontsize=8.5, color=INK)
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_color(QUIET)
        axis._axinfo["grid"].update(color="#e2e2e2", linewidth=0.5)
        axis.set_major_locator(MaxNLocator(5))
    axes.tick_params(labelsize=7, pad=0, color=QUIET, labelcolor=INK)


def _finer(surface: Surface) -> tuple[Array, Array, Array]:
    """The grid and its energies, three times as fine, so that the edge at the ceiling is smooth."""
    from scipy.interpolate import RegularGridInterpolator

    axes = (surface.gamma, surface.distance)
    finer = [np.linspace(axis[0], axis[-1], 3 * len(axis) - 2) for axis in axes]
    gamma, distance = np.meshgrid(*finer, indexing="ij")
    height = RegularGridInterpolator(axes, surface.energy)((gamma, distance))
    return gamma / math.pi, distance, height
