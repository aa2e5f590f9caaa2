"""Energy over twist and grip distance as a picture: contours, and the surface in perspective."""

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
from matplotlib.ticker import FixedLocator, MaxNLocator

from der.records.energy_surface import Surface
from der.utils.checks import Array
from der.viz.plots.style import INK, QUIET, TITLE, UNSTABLE, blank, dress, legend_below, mark, title

YELLOW = "#F0E442"
LEVELS = 28  # of a filled contour
CEILING = 1.35  # of the path's largest energy: what lies above is one colour


def figure_of_surface(surface: Surface) -> Figure:
    """Contours of the least energy over twist and grip distance, and the surface in perspective.

    Raises
    ------
    ValueError
        If no cell has a minimum.
    """
    if not np.any(np.isfinite(surface.energy)):
        raise ValueError("surface must have a minimum in some cell to be plotted, got none")
    figure = blank((10.4, 4.7))
    figure.text(0.5, 0.965, title(surface.ring, surface.section, surface.numerics), **TITLE)
    panel = figure.add_axes((0.06, 0.175, 0.42, 0.74))
    x, y = surface.gamma / math.pi, surface.distance
    ceiling = CEILING * float(np.nanmax(surface.path[2]))
    norm = PowerNorm(0.7, 0.0, ceiling)
    values = np.ma.masked_invalid(np.minimum(surface.energy, 2.0 * ceiling)).T
    levels = ceiling * np.linspace(0.0, 1.0, LEVELS) ** 1.4
    filled = panel.contourf(x, y, values, levels, cmap="YlGnBu_r", norm=norm, extend="max")
    panel.contour(x, y, values, levels, colors=INK, linewidths=0.35, alpha=0.35)
    handles = [*_several(panel, surface), *_overlay(panel, surface)]
    dress(panel, "distance of the grips  $d/a$")
    panel.margins(0.0)
    panel.set_xlim(float(x[0]), float(x[-1]))
    panel.set_ylim(float(y[0]), float(y[-1]))
    panel.set_xlabel("rotation of a grip  $\\gamma/\\pi$", fontsize=9, color=INK)
    bar = figure.colorbar(filled, cax=figure.add_axes((0.492, 0.175, 0.011, 0.74)))
    bar.set_label("least energy  $U\\,a/GJ$", fontsize=8.5, color=INK)
    bar.locator = FixedLocator(MaxNLocator(7).tick_values(0.0, 0.97 * ceiling)[:-1])
    bar.update_ticks()
    bar.ax.tick_params(labelsize=7.5, color=QUIET, labelcolor=INK)
    bar.outline.set_visible(False)
    _relief(figure, surface, ceiling, norm)
    legend_below(figure, handles)
    return figure


def _several(panel: Axes, surface: Surface) -> Iterator[Patch]:
    """Hatching over cells with several minima, and dots over those with a way down aside."""
    x, y = surface.gamma / math.pi, surface.distance
    for chosen, hatch, label in (
        (surface.count > 1, "////", "several minima"),
        (surface.index > 0, "....", "a lower one without symmetry"),
    ):
        if np.any(chosen):
            shade = panel.contourf(
                x, y, chosen.T.astype(float), (0.5, 1.5), colors="none", hatches=(hatch,)
            )
            shade.set(edgecolor=(0.13, 0.13, 0.13, 0.35), linewidth=0.0)
            yield Patch(
                facecolor="#d9ecd0", edgecolor=QUIET, linewidth=0.0, hatch=hatch, label=label
            )


def _overlay(panel: Axes, surface: Surface) -> Iterator[Line2D]:
    """The path of twisting with its folds and rests, and snaps."""
    line: dict[str, Any] = {"color": INK, "linewidth": 1.5}
    edge = [withStroke(linewidth=2.8, foreground="white")]
    turn, away, _ = surface.path
    panel.plot(turn / math.pi, away, path_effects=edge, zorder=3, **line)
    yield Line2D([], [], label="path of twisting", **line)
    for one in surface.snaps:
        panel.plot(one[:, 0] / math.pi, one[:, 1], color=UNSTABLE, linewidth=1.4, zorder=4)
        panel.annotate(
            "",
            (one[-1, 0] / math.pi, one[-1, 1]),
            xytext=(one[0, 0] / math.pi, one[0, 1]),
            arrowprops={"arrowstyle": "-|>", "color": UNSTABLE, "linewidth": 1.4},
            zorder=4,
        )
    if surface.snaps:
        yield Line2D([], [], color=UNSTABLE, linewidth=1.4, marker=">", markersize=4, label="snap")
    for places, label, marker, face in (
        (surface.folds, "fold", "D", "white"),
        (surface.rests, "$M = 0$", "o", YELLOW),
    ):
        if len(places):
            look = mark(marker, 5.0, face)
            panel.plot(places[:, 0] / math.pi, places[:, 1], zorder=5, clip_on=False, **look)
            yield Line2D([], [], label=label, **look)


def _relief(figure: Figure, surface: Surface, ceiling: float, norm: PowerNorm) -> None:
    """The surface in perspective, cut off at the ceiling, with the path on it."""
    panel: Any = figure.add_axes((0.6, 0.09, 0.4, 0.9), projection="3d")
    x, y, height = _finer(surface)
    panel.plot_surface(
        x,
        y,
        np.where(height <= ceiling, height, np.nan),
        cmap="YlGnBu_r",
        norm=norm,
        rcount=len(x),
        ccount=len(y),
        linewidth=0.0,
        antialiased=False,
        alpha=0.9,
    )
    turn, away, energy = surface.path
    shown = (turn >= surface.gamma[0]) & (turn <= surface.gamma[-1])
    along = np.where(shown, energy, np.nan)
    panel.plot(turn / math.pi, away, along + 0.01 * ceiling, color=INK, linewidth=1.6, zorder=10)
    for one in surface.snaps:
        over = one[:, 2] + 0.01 * ceiling
        panel.plot(one[:, 0] / math.pi, one[:, 1], over, color=UNSTABLE, linewidth=1.5, zorder=11)
    panel.set_zlim(0.0, ceiling)
    panel.view_init(elev=27.0, azim=-128.0)
    panel.zaxis.set_rotate_label(False)
    panel.set_box_aspect((1.25, 1.0, 0.8), zoom=0.95)
    for axis, label in (
        (panel.xaxis, "$\\gamma/\\pi$"),
        (panel.yaxis, "$d/a$"),
        (panel.zaxis, "$U\\,a/GJ$"),
    ):
        axis.set_label_text(label, fontsize=8.5, color=INK)
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.line.set_color(QUIET)
        axis._axinfo["grid"].update(color="#e2e2e2", linewidth=0.5)
        axis.set_major_locator(MaxNLocator(5))
    panel.tick_params(labelsize=7, pad=0, color=QUIET, labelcolor=INK)


def _finer(surface: Surface) -> tuple[Array, Array, Array]:
    """The grid and its energies, three times as fine, so that a cut through it is smooth."""
    from scipy.interpolate import RegularGridInterpolator

    axes = (surface.gamma, surface.distance)
    finer = [np.linspace(axis[0], axis[-1], 3 * len(axis) - 2) for axis in axes]
    gamma, distance = np.meshgrid(*finer, indexing="ij")
    height = RegularGridInterpolator(axes, surface.energy)((gamma, distance))
    return gamma / math.pi, distance, height
