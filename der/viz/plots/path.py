"""A path as one picture: snapshots of the ring above M(gamma) and U(gamma).

Figures are objects of their own, so that nothing global changes and no display is needed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from der.records.configurations import Shapes
from der.records.path import Mode, Path
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.curve import SNAP, sides, smooth, stretches
from der.viz.plots.style import (
    BAR,
    DASHES,
    DPI,
    INK,
    QUIET,
    STABLE,
    TITLE,
    UNSTABLE,
    blank,
    dress,
    mark,
    of_ring,
    save_figure,
)
from der.viz.projection import HALF_WIDTH, seen

SIZE = (8.0, 6.0)  # inches; 1200 x 900 px
# line style of a stretch by whether it is stable
STRETCHES: dict[bool | str | None, tuple[str, str, Any]] = {
    True: ("stable ($\\gamma$ held)", STABLE, "-"),
    False: ("unstable ($\\gamma$ held)", UNSTABLE, DASHES),
    None: ("equilibria (stability not computed)", STABLE, "-"),
    SNAP: ("the ring snaps", QUIET, (0, (1.2, 1.4))),
}
STATE: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 2.2, "color": INK}
MANY = 250  # states; more would hide the line that they lie on
MARKS = {  # label, marker, size
    "fold": ("fold", "D", 4.6),
    "limit": ("limit of M", "^", 5.6),
    "branch": ("branch point", "s", 4.8),
    "snap": ("landing", "*", 8.0),
    "contact": ("self-crossing", "x", 4.6),
}

LETTERS = "ABCDEF"  # one for each snapshot
CAPTION = 0.82  # room for what stands below a ribbon, of the row's height


def figure_of_path(path: Path) -> Figure:
    """Figure of a path: M and U against gamma, below a row of snapshots where it has shapes.

    Parameters
    ----------
    path : Path
        With at least one state.

    Raises
    ------
    ValueError
        If the path has no state.
    """
    if not len(path):
        raise ValueError("path must have at least one state to be plotted, got none")
    figure = blank(SIZE)
    figure.text(0.5, 0.972, _title(path), **TITLE)
    top = 0.94 if path.shapes is None else 0.665
    grid = figure.add_gridspec(
        2, 1, left=0.085, right=0.985, bottom=0.125, top=top, height_ratios=(1.45, 1), hspace=0.07
    )
    above = figure.add_subplot(grid[0])
    below = figure.add_subplot(grid[1], sharex=above)
    _draw_curve(above, path, path.moment, "moment  $M\\,a/GJ$")
    _draw_curve(below, path, path.energy, "energy  $U\\,a/GJ$")
    above.axhline(0.0, color=QUIET, linewidth=0.6, zorder=0)
    above.tick_params(labelbottom=False)
    below.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 2.5, 5, 10]))
    below.set_xlabel("rotation of a grip  $\\gamma/\\pi$", fontsize=9, color=INK)
    if path.shapes is not None:
        chosen = _snapshots(path, path.shapes)
        row = figure.add_axes((0.02, 0.685, 0.96, 0.265))
        _draw_ribbons(row, path.shapes, path.gamma, chosen)
        for panel, height in ((above, path.moment), (below, path.energy)):
            _letter(panel, path, height, chosen)
    handles = _legend_handles(path)
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.005),
        ncols=len(handles) if len(handles) <= 7 else 4,
        frameon=False,
        fontsize=7.5,
        handlelength=2.4,
        columnspacing=1.7,
        handletextpad=0.5,
        labelcolor=INK,
    )
    return figure


def save_plot(path: Path, file: FilePath) -> None:
    """Write the figure of a path, whole or not at all, in the format of the file's suffix.

    Raises
    ------
    ValueError
        If the suffix is no picture's, the place cannot be written to, or there is no state.
    """
    save_figure(figure_of_path(path), file)


# --- Words -----------------------------------------------------------------------------------


def _title(path: Path) -> str:
    """Ring, section, mesh and mode in one line."""
    section = path.section
    if section.get("h_over_t") is None:
        bar = rf"$\alpha$ = {section['alpha']:.4g}, $\beta$ = {section['beta']:.4g}"
    else:
        bar = rf"h/t = {section['h_over_t']:g}, $\nu$ = {section['nu']:g}"
    edges = path.numerics.get("n_edges")
    parts = [
        of_ring(path.ring),
        bar,
        "boundary-value problem" if edges is None else f"{edges} edges",
        _words(path.mode) if path.mode else _reach(path),
    ]
    if path.status != "done":
        parts.append(path.status)
    return BAR.join(parts)


def _times_pi(angle: float) -> str:
    """Return an angle as a multiple of pi: "0", "0.211 π", "π"."""
    multiple = f"{angle / math.pi:.3g}"
    return {"0": "0", "1": "π"}.get(multiple, f"{multiple} π")


def _reach(path: Path) -> str:
    """Return how far a path goes: "up to γ = π", "up to γ = π and back"."""
    top = float(path.gamma.max())
    back = " and back" if path.gamma[-1] == 0.0 < top else ""
    return rf"up to $\gamma$ = {_times_pi(top)}{back}"


def _words(mode: Mode) -> str:
    """Return the mode in a few words: "folds, stable, snap-through"."""
    words = ["folds" if mode.foldable else "does not fold"]
    if mode.stable is not None:
        words.append("stable" if mode.stable else "unstable")
    if mode.stable and mode.stable_3d is False:
        words.append("but not in 3-D")
    words.append("no snap" if mode.snapping == "none" else mode.snapping)
    return ", ".join(words)


def _legend_handles(path: Path) -> list[Line2D]:
    """One entry for every kind of line and of mark that occurs."""
    handles = []
    for stability, (label, colour, style) in STRETCHES.items():
        if stability in sides(path):
            handles.append(Line2D([], [], color=colour, linestyle=style, label=label))
    kinds = {point.kind for point in path.points}
    for kind, (label, marker, size) in MARKS.items():
        if kind in kinds:
            handles.append(Line2D([], [], label=label, **mark(marker, size)))
    if len(path) <= MANY:
        handles.append(Line2D([], [], label="computed state", **STATE))
    return handles


# --- Curves ----------------------------------------------------------------------------------


def _draw_curve(panel: Axes, path: Path, height: Array, label: str) -> None:
    """Draw stable and unstable stretches, the states on them, and the special points."""
    for stable, points in stretches(path, height):
        _, colour, style = STRETCHES[stable]
        panel.plot(*points.T, color=colour, linestyle=style, linewidth=1.5, zorder=2)
    if len(path) <= MANY:
        panel.plot(path.gamma / math.pi, height, zorder=3, **STATE)
    for kind, (_, marker, size) in MARKS.items():
        at = [point.position for point in path.points if point.kind == kind]
        panel.plot(path.gamma[at] / math.pi, height[at], zorder=4, **mark(marker, size))
    dress(panel, label)
    panel.margins(x=0.03, y=0.12)
    panel.yaxis.set_label_coords(-0.062, 0.5)


def _letter(panel: Axes, path: Path, height: Array, chosen: list[int]) -> None:
    """Write each snapshot's letter beside its state, where there is most room."""
    panel.autoscale_view()
    to_pixels = panel.transData.transform
    obstacles = to_pixels(smooth(path, height))
    low, high = panel.get_window_extent().get_points()
    turn = np.arange(16) * math.pi / 8
    offsets = 9.5 * np.column_stack([np.cos(turn), np.sin(turn)])  # points
    for letter, k in zip(LETTERS, chosen, strict=False):
        here = np.array([path.gamma[k] / math.pi, height[k]])
        places = to_pixels(here) + offsets * DPI / 72
        room = np.linalg.norm(places[:, None] - obstacles, axis=2).min(axis=1)
        room[np.any((places < low + 8) | (places > high - 8), axis=1)] = -1
        best = int(np.argmax(room))
        panel.plot(*here, "o", color=INK, markersize=3.6, zorder=3)
        panel.annotate(
            letter,
            (float(here[0]), float(here[1])),
            xytext=(float(offsets[best, 0]), float(offsets[best, 1])),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=8.5,
            fontweight="bold",
            color=INK,
            zorder=5,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )
        obstacles = np.append(obstacles, places[best : best + 1], axis=0)


# --- Ribbons ---------------------------------------------------------------------------------


def _snapshots(path: Path, shapes: Shapes) -> list[int]:
    """Return states spread evenly over the motion, the first, the last and the peak among them."""
    moved = np.linalg.norm(np.diff(shapes.x, axis=0), axis=(1, 2))
    way = np.append(0.0, np.cumsum(moved))
    even = np.linspace(0.0, way[-1], len(LETTERS))
    chosen = [int(np.argmin(np.abs(way - place))) for place in even]
    peak = int(np.argmax(np.abs(path.moment)))
    if peak not in chosen:
        inner = range(1, len(LETTERS) - 1)
        chosen[min(inner, key=lambda i: abs(way[chosen[i]] - way[peak]))] = peak
    return sorted(set(chosen))


def _draw_ribbons(row: Axes, shapes: Shapes, gamma: Array, chosen: list[int]) -> None:
    """Draw the ring at the chosen states, all from one side and in one scale."""
    x, frames = shapes.x, shapes.frames
    length = float(np.linalg.norm(np.diff(x[0], axis=0, append=x[0][:1]), axis=1).sum())
    width = HALF_WIDTH * length / (2 * math.pi)
    ribbons = [seen(x[k], frames[k, :, 0], width) for k in chosen]
    spans = np.array([np.ptp(corners.reshape(-1, 2), axis=0) for corners, _ in ribbons])
    tall = 1.06 * spans[:, 1].max()
    slot = max(1.12 * spans[:, 0].max(), CAPTION * tall)
    for i, (corners, colours) in enumerate(ribbons):
        flat = corners.reshape(-1, 2)
        centre = (flat.min(axis=0) + flat.max(axis=0)) / 2
        placed = corners - centre + [i * slot, 0.0]
        row.add_collection(
            PolyCollection(list(placed), facecolors=colours, edgecolors=colours, linewidths=0.25)
        )
        text = rf"$\bf{{{LETTERS[i]}}}$   $\gamma$ = {_times_pi(gamma[chosen[i]])}"
        row.text(i * slot, -tall / 2, text, ha="center", va="top", fontsize=8, color=INK)
    row.set_xlim(-slot / 2, (len(ribbons) - 0.5) * slot)
    row.set_ylim(-0.62 * tall, 0.5 * tall)
    row.set_aspect("equal")
    row.set_axis_off()
