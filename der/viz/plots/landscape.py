"""Energy landscapes as pictures: along the path, across a pass, and barriers over h/t."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator

from der.records.landscape import BarrierCurves, Landscape, Pass, Rest
from der.utils.checks import Array
from der.viz.curve import stretches
from der.viz.plots.style import (
    DASHES,
    INK,
    QUIET,
    STABLE,
    TITLE,
    UNSTABLE,
    blank,
    dress,
    legend_below,
    mark,
    seen,
    sure,
    title,
)

BRANCHES: Mapping[object, tuple[str, str, Any]] = {
    True: ("stable ($\\gamma$ held)", STABLE, "-"),
    False: ("unstable ($\\gamma$ held)", UNSTABLE, DASHES),
    None: ("equilibria", STABLE, "-"),
}
RESTS = {  # label, and how it is drawn
    "well": ("well", mark("o", 5.6, INK)),
    "saddle": ("saddle", mark("^", 6.6)),
}
HALO = [withStroke(linewidth=2.5, foreground="white")]
RINGS = 6  # on a pass


# --- Along the path --------------------------------------------------------------------------


def figure_of_landscape(landscape: Landscape) -> Figure:
    """U over M against gamma, with rests and barriers; beside it the saddle and its well, larger.

    Raises
    ------
    ValueError
        If the path has no state.
    """
    path = landscape.path
    if not len(path):
        raise ValueError("landscape must have at least one state to be plotted, got none")
    zoomed = landscape.barriers.open is not None
    figure = blank((8.6, 4.6) if zoomed else (6.0, 4.6))
    figure.text(0.5, 0.965, title(path.ring, path.section, path.numerics), **TITLE)
    grid = figure.add_gridspec(
        2,
        2 if zoomed else 1,
        left=0.075 if zoomed else 0.105,
        right=0.985,
        bottom=0.165,
        top=0.915,
        height_ratios=(1.9, 1.0),
        width_ratios=(1.25, 1.0) if zoomed else None,
        hspace=0.07,
        wspace=0.24,
    )
    above = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=above)
    for panel, height, label in (
        (above, path.energy, "energy  $U\\,a/GJ$"),
        (below, path.moment, "moment  $M\\,a/GJ$"),
    ):
        _branches(panel, landscape, height)
        _rests(panel, landscape.rests, height)
        dress(panel, label)
    above.tick_params(labelbottom=False)
    below.axhline(0.0, color=QUIET, linewidth=0.6, zorder=0)
    below.set_xlabel("rotation of a grip  $\\gamma/\\pi$", fontsize=9, color=INK)
    _fold_barrier(above, landscape)
    if zoomed:
        beside = figure.add_subplot(grid[:, 1])
        _saddle_and_well(beside, landscape)
    handles = [
        Line2D([], [], color=colour, linestyle=style, label=label)
        for stable, (label, colour, style) in BRANCHES.items()
        if stable in {kind for kind, _ in stretches(path, path.energy)}
    ]
    kinds = {rest.kind for rest in landscape.rests}
    handles += [
        Line2D([], [], label=f"{label}, $M = 0$", **look)
        for kind, (label, look) in RESTS.items()
        if kind in kinds
    ]
    legend_below(figure, handles)
    return figure


def _branches(panel: Axes, landscape: Landscape, height: Array) -> None:
    for stable, points in stretches(landscape.path, height):
        _, colour, style = BRANCHES[stable]
        panel.plot(*points.T, color=colour, linestyle=style, linewidth=1.6, zorder=2)


def _rests(panel: Axes, rests: tuple[Rest, ...], height: Array) -> None:
    for rest in rests:
        _, look = RESTS[rest.kind]
        place = (rest.gamma / math.pi, height[rest.position])
        panel.plot(*place, zorder=5, clip_on=False, **look)


def _fold_barrier(panel: Axes, landscape: Landscape) -> None:
    """The height of the saddle above the flat ring, as an arrow where there is most room."""
    found = landscape.barriers
    panel.margins(x=0.03, y=0.1)
    panel.autoscale_view()
    if found.fold is None or found.saddle is None:
        text = found.why.get("fold", "")
        panel.set_title(text, fontsize=7.5, color=QUIET, loc="left", wrap=True)
        return
    saddle, flat = landscape.rests[found.saddle], landscape.rests[0]
    x = 0.05
    _level(panel, saddle.energy, (0.0, saddle.gamma / math.pi))
    _arrow(panel, x, flat.energy, saddle.energy)
    text = _height("fold", found.fold, landscape.extrapolated)
    _say(panel, (x, flat.energy + 0.74 * found.fold), text, (7.0, 0.0))


def _saddle_and_well(panel: Axes, landscape: Landscape) -> None:
    """The neighbourhood of the saddle and the folded well, with the barrier to open."""
    found, path = landscape.barriers, landscape.path
    if found.open is None or found.saddle is None:
        return
    saddle, end = landscape.rests[found.saddle], landscape.rests[-1]
    _branches(panel, landscape, path.energy)
    _rests(panel, landscape.rests, path.energy)
    span = (end.gamma - saddle.gamma) / math.pi
    x = end.gamma / math.pi + 0.12 * span
    room = 1.15 if "open" in landscape.extrapolated else 0.6  # for words beside the arrow
    panel.set_xlim(saddle.gamma / math.pi - 0.75 * span, end.gamma / math.pi + room * span)
    panel.set_ylim(end.energy - 0.7 * found.open, saddle.energy + 0.45 * found.open)
    _level(panel, saddle.energy, (saddle.gamma / math.pi, x))
    _level(panel, end.energy, (end.gamma / math.pi, x))
    _arrow(panel, x, end.energy, saddle.energy)
    middle = 0.5 * (end.energy + saddle.energy)
    _say(panel, (x, middle), _height("open", found.open, landscape.extrapolated), (6.0, 0.0))
    for rest, name, away in ((saddle, "saddle", 11.0), (end, "folded", -16.0)):
        ways = "?" if rest.index_free is None else rest.index_free
        text = f"{name}\n$\\gamma$ = {rest.gamma / math.pi:.4f} $\\pi$\nways down alone: {ways}"
        up = away > 0.0
        panel.annotate(
            text,
            (rest.gamma / math.pi, rest.energy),
            xytext=(0.0, away),
            textcoords="offset points",
            ha="center",
            va="bottom" if up else "top",
            fontsize=7.5,
            color=INK,
            path_effects=HALO,
            zorder=6,
        )
    dress(panel, "energy  $U\\,a/GJ$")
    panel.set_xlabel("$\\gamma/\\pi$", fontsize=9, color=INK)
    panel.ticklabel_format(useOffset=False)
    panel.xaxis.set_major_locator(MaxNLocator(5))


# --- Over h/t --------------------------------------------------------------------------------


def figure_of_barriers(curves: BarrierCurves) -> Figure:
    """Barriers to fold, above, and to open, below, over h/t: in grips, and left alone."""
    figure = blank((6.2, 5.0))
    figure.text(0.53, 0.965, title(curves.ring, {}, curves.numerics), **TITLE)
    grid = figure.add_gridspec(
        2, 1, left=0.12, right=0.97, bottom=0.145, top=0.915, height_ratios=(1.0, 1.25), hspace=0.07
    )
    above = figure.add_subplot(grid[0])
    below = figure.add_subplot(grid[1], sharex=above)
    lines = (
        ("in grips that turn freely", STABLE, "-", "o", curves.fold, curves.open),
        ("left alone in space", UNSTABLE, DASHES, "s", curves.fold_free, curves.open_free),
    )
    handles = []
    for label, colour, style, marker, *both in lines:
        if not np.any(np.isfinite(both)):
            continue
        look: dict[str, Any] = {"color": colour, "linestyle": style, "linewidth": 1.6}
        look["marker"] = marker
        for panel, values in zip((above, below), both, strict=True):
            panel.plot(curves.h_over_t, values, markersize=2.8, **look)
        handles.append(Line2D([], [], label=label, markersize=2.8, **look))
    above.plot(curves.h_over_t, curves.folded_energy, color=QUIET, linewidth=1.0, linestyle=":")
    handles.append(
        Line2D([], [], color=QUIET, linestyle=":", linewidth=1.0, label="energy of the folded ring")
    )
    dress(above, "to fold  $\\Delta U\\,a/GJ$")
    dress(below, "to open  $\\Delta U\\,a/GJ$")
    above.tick_params(labelbottom=False)
    below.axhline(0.0, color=QUIET, linewidth=0.6, zorder=0)
    for panel in (above, below):
        panel.set_xscale("log")
        panel.xaxis.set_minor_locator(FixedLocator([]))
    low, high = float(curves.h_over_t.min()), float(curves.h_over_t.max())
    ticks = [tick for tick in (1, 1.5, 2, 3, 4, 6, 8, 10, 15, 20, 30, 50) if low <= tick <= high]
    below.xaxis.set_major_locator(FixedLocator(ticks))
    below.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    below.set_xlabel("height over thickness of the section  $h/t$", fontsize=9, color=INK)
    legend_below(figure, handles)
    return figure


# --- Left alone ------------------------------------------------------------------------------


def figure_of_pass(found: Pass) -> Figure:
    """Energy along the minimum-energy path, with the ring on its way above it.

    Raises
    ------
    ValueError
        If there is no such path.
    """
    if found.saddle is None or found.fold is None or found.open is None:
        raise ValueError(f"pass must have a saddle to be plotted: {found.why}")
    figure = blank((7.6, 5.0))
    figure.text(0.5, 0.965, title(found.ring, found.section, found.numerics), **TITLE)
    panel = figure.add_axes((0.085, 0.165, 0.895, 0.5))
    panel.margins(x=0.11)
    progress, energy = found.way.T
    span = float(np.ptp(energy))
    panel.set_ylim(float(energy.min()) - 0.05 * span, float(energy.max()) + 0.5 * span)  # words
    top = int(np.argmax(energy))
    panel.plot(progress, energy, color=STABLE, linewidth=1.7, zorder=2)
    ends = ((0, "well"), (top, "saddle"), (len(energy) - 1, "well"))
    for k, kind in ends:
        _, look = RESTS[kind]
        panel.plot(progress[k], energy[k], zorder=5, clip_on=False, **look)
    dress(panel, "energy  $U\\,a/GJ$")
    panel.set_xlabel(
        "way down both sides of the saddle  [rad, root mean square]", fontsize=9, color=INK
    )
    _annotate_pass(panel, found, float(progress[top]))
    legend_below(
        figure,
        [
            Line2D([], [], color=STABLE, linewidth=1.7, label="way of least energy"),
            Line2D([], [], label="well: flat, folded", **RESTS["well"][1]),
            Line2D([], [], label="saddle", **RESTS["saddle"][1]),
        ],
    )
    row = figure.add_axes((0.085, 0.69, 0.895, 0.24))
    low, high = panel.get_xlim()
    row.set_xlim(low, high)
    _rings(row, found)
    row.set_xlim(low, high)
    return figure


def _annotate_pass(panel: Axes, found: Pass, at: float) -> None:
    """Barriers of the free ring and of twisting, in words and in an enlargement of the top."""
    saddle = found.saddle
    if saddle is None or found.fold is None or found.open is None:
        return
    kind = "the saddle of twisting" if saddle.twisted else "a saddle beside that of twisting"
    lines = [f"{kind}, ways down: {'?' if saddle.index is None else saddle.index}"]
    for name, value, twisting in (
        ("fold", found.fold, found.twisting.fold),
        ("open", found.open, found.twisting.open),
    ):
        text = f"{value:.5g} GJ/a"
        if name in found.extrapolated:
            text = f"{sure(*found.extrapolated[name])} GJ/a, extrapolated (mesh {value:.5g})"
        lines.append(f"to {name}: {text}")
        mesh = " (mesh)" if name in found.extrapolated else ""
        other = "no barrier" if twisting is None else f"{twisting:.5g} GJ/a{mesh}"
        lines.append(f"      in clamped grips, by twisting: {other}")
    panel.text(
        0.03, 0.975, "\n".join(lines), transform=panel.transAxes, va="top", fontsize=8, color=INK
    )
    progress, energy = found.way.T
    inset = panel.inset_axes((0.61, 0.08, 0.26, 0.4))
    end = float(progress[-1])
    inset.plot(progress, energy, color=STABLE, linewidth=1.4)
    inset.set_xlim(at - 0.8 * (end - at), end + 0.1 * (end - at))
    inset.set_ylim(energy[-1] - 0.4 * found.open, energy[-1] + 1.4 * found.open)
    inset.axhline(energy[-1], color=QUIET, linewidth=0.6, linestyle=":")
    inset.tick_params(labelsize=6.5, color=QUIET, labelcolor=INK, direction="in")
    inset.ticklabel_format(useOffset=False)
    panel.indicate_inset_zoom(inset, edgecolor=QUIET)


def _rings(row: Axes, found: Pass) -> None:
    """Rings on the way, each over its place on the curve below, in one scale."""
    chosen = np.linspace(0, len(found.shapes) - 1, RINGS).round().astype(int)
    end = float(found.way[-1, 0])
    views = [seen(found.shapes[k]) for k in chosen]
    widest = max(float(np.ptp(view[:, 0])) for view in views)
    scale = 0.86 * end / (RINGS - 1) / widest
    for i, view in enumerate(views):
        middle = 0.5 * (view.min(axis=0) + view.max(axis=0))
        ring = scale * (view - middle)
        ring[:, 0] += i * end / (RINGS - 1)
        for k in np.argsort(ring[:-1, 2]):
            near = slice(max(k - 1, 0), k + 3)
            row.plot(*ring[k : k + 2, :2].T, color="white", linewidth=3.4, solid_capstyle="butt")
            row.plot(*ring[near, :2].T, color=STABLE, linewidth=1.5, solid_capstyle="round")
    row.set_aspect("equal", adjustable="datalim")
    row.set_axis_off()


# --- Pieces ----------------------------------------------------------------------------------


def _height(name: str, mesh: float, known: Mapping[str, tuple[float, float]]) -> str:
    """A barrier in words: extrapolated where that was done, and then that of the curve, too."""
    if name not in known:
        return f"to {name}\n{mesh:.4g} GJ/a"
    value, _, error = sure(*known[name]).partition(" ")
    return f"to {name}\n{value}\n{error} GJ/a\nextrapolated\n(mesh {mesh:.5g})"


def _level(panel: Axes, height: float, across: tuple[float, float]) -> None:
    panel.plot(across, (height, height), color=QUIET, linewidth=0.7, linestyle=":", zorder=1)


def _arrow(panel: Axes, x: float, low: float, high: float) -> None:
    look = {"arrowstyle": "<|-|>", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    panel.annotate("", (x, high), xytext=(x, low), arrowprops=look, zorder=4)


def _say(panel: Axes, place: tuple[float, float], text: str, away: tuple[float, float]) -> None:
    panel.annotate(
        text,
        place,
        xytext=away,
        textcoords="offset points",
        va="center",
        fontsize=8.5,
        color=INK,
        path_effects=HALO,
        zorder=6,
    )
