"""A path as one picture: snapshots of the ring above M(gamma) and U(gamma)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from der.records.configurations import Shapes
from der.records.path import Mode, Path
from der.utils.checks import Array
from der.viz.curve import smooth
from der.viz.palette import INK, POINTS
from der.viz.plots.rings import bare, place_ribbon
from der.viz.plots.style import (
    ENERGY,
    GAMMA,
    MARKS,
    MOMENT,
    blank,
    draw_stretches,
    entry,
    label_axes,
    legend_below,
    mark,
    place_letters,
    stretch_entries,
    zero_line,
)
from der.viz.ribbon import HALF_WIDTH, quadrilaterals
from der.viz.titles import times_pi, title

STATE: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 2.2, "color": INK}
MANY = 250  # states; more would hide the line that they lie on
LETTERS = "ABCDEF"  # one for each snapshot
CAPTION = 0.82  # room for the text below a ribbon, over the row's height


def draw(path: Path) -> Figure:
    """The picture of a path: M and U against gamma, below snapshots where it has shapes.

    Raises
    ------
    ValueError
        If the path has no state.
    """
    if not len(path):
        raise ValueError("path must have at least one state to be plotted, got none")
    status = () if path.status == "done" else (path.status,)
    figure = blank(8.0, 6.0, title(path, _mode(path.mode) if path.mode else _reach(path), *status))
    top = 0.94 if path.shapes is None else 0.665
    grid = figure.add_gridspec(
        2, 1, left=0.085, right=0.985, bottom=0.125, top=top, height_ratios=(1.45, 1), hspace=0.07
    )
    above = figure.add_subplot(grid[0])
    below = figure.add_subplot(grid[1], sharex=above)
    curves = ((above, path.moment, "", MOMENT), (below, path.energy, GAMMA, ENERGY))
    for axes, height, across, up in curves:
        _draw_curve(axes, path, height)
        label_axes(axes, across, up)
        axes.yaxis.set_label_coords(-0.062, 0.5)
    zero_line(above)
    above.tick_params(labelbottom=False)
    below.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 2.5, 5, 10]))
    if path.shapes is not None:
        chosen = _snapshots(path, path.shapes)
        _draw_ribbons(figure.add_axes((0.02, 0.685, 0.96, 0.265)), path, path.shapes, chosen)
        for axes, height, *_ in curves:
            places = np.column_stack([path.gamma / math.pi, height])[chosen]
            place_letters(axes, LETTERS, places, smooth(path, height))
    legend_below(figure, _entries(path), fontsize=7.5)
    return figure


def _reach(path: Path) -> str:
    """How far a path goes: "up to γ = π", "up to γ = π and back"."""
    top = float(path.gamma.max())
    back = " and back" if path.gamma[-1] == 0.0 < top else ""
    return f"up to γ = {times_pi(top)}{back}"


def _mode(mode: Mode) -> str:
    """The folding mode as text: "foldable, stable at fixed M, snap-through"."""
    parts = ["foldable" if mode.foldable else "not foldable"]
    if mode.stable is not None:
        parts.append(f"{'stable' if mode.stable else 'unstable'} at fixed M")
    if mode.stable and mode.stable_3d is False:
        parts.append("but not in 3-D")
    parts.append("no snap" if mode.snapping == "none" else mode.snapping)
    return ", ".join(parts)


def _entries(path: Path) -> list[Any]:
    """An entry of the legend for every kind of line and mark that occurs."""
    kinds = {point.kind for point in path.points}
    entries = list(stretch_entries(path))
    entries += [entry(POINTS[kind], **mark(*MARKS[kind])) for kind in MARKS if kind in kinds]
    if len(path) <= MANY:
        entries.append(entry("computed state", **STATE))
    return entries


def _draw_curve(axes: Axes, path: Path, height: Array) -> None:
    """Draw stable and unstable stretches, the states on them, and the special points."""
    draw_stretches(axes, path, height)
    if len(path) <= MANY:
        axes.plot(path.gamma / math.pi, height, zorder=3, **STATE)
    for kind, (marker, size) in MARKS.items():
        at = [point.position for point in path.points if point.kind == kind]
        axes.plot(path.gamma[at] / math.pi, height[at], zorder=4, **mark(marker, size))
    axes.margins(x=0.03, y=0.12)


# --- Snapshots -------------------------------------------------------------------------------


def _snapshots(path: Path, shapes: Shapes) -> list[int]:
    """States spread evenly over the motion, with the first, the last and the largest moment."""
    moved = np.linalg.norm(np.diff(shapes.x, axis=0), axis=(1, 2))
    way = np.append(0.0, np.cumsum(moved))
    even = np.linspace(0.0, way[-1], len(LETTERS))
    chosen = [int(np.argmin(np.abs(way - place))) for place in even]
    peak = int(np.argmax(np.abs(path.moment)))
    if peak not in chosen:
        inner = range(1, len(LETTERS) - 1)
        chosen[min(inner, key=lambda i: abs(way[chosen[i]] - way[peak]))] = peak
    return sorted(set(chosen))


def _draw_ribbons(row: Axes, path: Path, shapes: Shapes, chosen: list[int]) -> None:
    """Draw the ring at the chosen states, all from one side and in one scale."""
    first = shapes.x[0]
    length = float(np.linalg.norm(np.diff(first, axis=0, append=first[:1]), axis=1).sum())
    width = HALF_WIDTH * length / (2 * math.pi)
    ribbons = [quadrilaterals(shapes.x[k], shapes.frames[k, :, 0], width) for k in chosen]
    spans = np.array([np.ptp(corners.reshape(-1, 2), axis=0) for corners, _ in ribbons])
    tall = 1.06 * float(spans[:, 1].max())
    slot = max(1.12 * float(spans[:, 0].max()), CAPTION * tall)
    for i, ribbon in enumerate(ribbons):
        place_ribbon(row, ribbon, (i * slot, 0.0))
        text = rf"$\bf{{{LETTERS[i]}}}$   $\gamma$ = {times_pi(path.gamma[chosen[i]])}"
        row.text(i * slot, -tall / 2, text, ha="center", va="top", fontsize=8, color=INK)
    bare(row, (-slot / 2, -0.62 * tall), ((len(ribbons) - 0.5) * slot, 0.5 * tall))
