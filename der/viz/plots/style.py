"""The style of all still pictures: figures, axes, marks, texts, legends, and saving.

Figures are made without pyplot: no global state changes, and no display is needed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence, Sized
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from der.geometry.scale import Scale
from der.records.path import Path
from der.records.units import unit
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.curve import stretches
from der.viz.files import checked_suffix, write
from der.viz.palette import INK, QUIET, STRETCHES

FORMATS = (".png", ".pdf", ".svg")
DPI = 150
GAMMA = "rotation of a grip  $\\gamma/\\pi$"
PLAIN = {"moment": "\\,a/GJ", "energy": "\\,a/GJ", "force": "\\,a^2/GJ", "length": "/a"}
HALO = [withStroke(linewidth=2.5, foreground="white")]
MARKS = {  # marker and size of special points, by their kind
    "fold": ("D", 4.6),
    "limit": ("^", 5.6),
    "branch": ("s", 4.8),
    "snap": ("*", 8.0),
    "contact": ("x", 4.6),
}


def save(figure: Figure, file: FilePath) -> None:
    """Write a figure atomically, in the format of the file's suffix.

    Raises
    ------
    ValueError
        If the suffix is not one of FORMATS or the file cannot be written.
    """
    suffix = checked_suffix("plot", file, FORMATS)
    # matplotlib's version is left out, so that equal pictures are equal files
    metadata: dict[str, Any] = {"Software": None} if suffix == ".png" else {}
    write("plot", file, lambda at: figure.savefig(at, format=suffix[1:], metadata=metadata))


def check_states(name: str, found: Sized) -> None:
    """Refuse a record without states: there is nothing to draw."""
    if not len(found):
        raise ValueError(f"{name} must have at least one state to be plotted, got none")


def blank(width: float, height: float, title: str, *, dpi: int = DPI) -> Figure:
    """An empty figure, inches, with a title along its upper edge."""
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    text = figure.text(0.5, 1.0 - 0.17 / height, title, fontsize=9.5, color=INK)
    text.set(ha="center", va="center")
    size, room = 9.5, 0.97 * figure.bbox.width
    while (wide := text.get_window_extent().width) > room:  # hinting: not in proportion to size
        size *= 0.99 * room / wide
        text.set_fontsize(size)
    return figure


def stacked(figure: Figure, ratio: float, **grid: float) -> tuple[Axes, Axes]:
    """Axes above each other over one abscissa; ``ratio``: of the upper to the lower height."""
    places = figure.add_gridspec(2, 1, height_ratios=(ratio, 1.0), hspace=0.07, **grid)
    above = figure.add_subplot(places[0])
    below = figure.add_subplot(places[1], sharex=above)
    above.tick_params(labelbottom=False)
    return above, below


def quantity(scale: Scale | None, words: str, symbol: str, kind: str) -> str:
    """The label of an axis: "energy  U a/GJ", or "energy  U  [N mm]"."""
    if scale is None:
        return f"{words}  ${symbol}{PLAIN[kind]}$"
    return f"{words}  ${symbol}$  [{unit(scale, kind)}]"


def moment(scale: Scale | None, words: str = "moment") -> str:
    """The label of an axis of M."""
    return quantity(scale, words, "M", "moment")


def energy(scale: Scale | None) -> str:
    """The label of an axis of U."""
    return quantity(scale, "energy", "U", "energy")


def label_axes(
    axes: Axes, across: str, up: str, *, fontsize: float = 9.0, ticks: tuple[int, int] = (0, 0)
) -> None:
    """Put labels on axes and give them the look of all pictures.

    Parameters
    ----------
    ticks : the most intervals between ticks, across and up; 0: matplotlib's choice.
    """
    for axis, most in zip((axes.xaxis, axes.yaxis), ticks, strict=True):
        if most:
            axis.set_major_locator(MaxNLocator(most))
    axes.set_xlabel(across, fontsize=fontsize, color=INK)
    axes.set_ylabel(up, fontsize=fontsize, color=INK)
    axes.tick_params(labelsize=fontsize - 1.0, color=QUIET, labelcolor=INK, direction="in")
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(QUIET)


def dress_bar(bar: Colorbar, label: str, ticks: Sequence[float], size: float) -> None:
    """Label, ticks and look of a colour bar."""
    bar.set_label(label, fontsize=size, color=INK)
    bar.set_ticks(list(ticks))
    bar.ax.tick_params(labelsize=size - 1.0, color=QUIET, labelcolor=INK)
    bar.outline.set_visible(False)


def zero_line(axes: Axes) -> None:
    """A thin line at zero."""
    axes.axhline(0.0, color=QUIET, linewidth=0.6, zorder=0)


def mark(marker: str, size: float, face: str = "white") -> dict[str, Any]:
    """The look of a special state."""
    look = {"linestyle": "none", "marker": marker, "markersize": size}
    return look | {"markerfacecolor": face, "markeredgecolor": INK, "markeredgewidth": 0.9}


def entry(label: str, **look: Any) -> Line2D:
    """An entry of a legend."""
    return Line2D([], [], label=label, **look)


def draw_stretches(axes: Axes, path: Path, height: Array, colour: str | None = None) -> None:
    """Draw a path's curve over gamma/pi by its stability; in one colour if that is given."""
    for kind, points in stretches(path, height):
        look = STRETCHES[kind]
        axes.plot(
            *points.T, color=colour or look.colour, linestyle=look.style, linewidth=1.6, zorder=2
        )


def stretch_entries(*paths: Path) -> Iterator[Line2D]:
    """Entries of a legend for the kinds of stretches that paths have."""
    kinds = {kind for path in paths for kind, _ in stretches(path, path.energy)}
    for kind, look in STRETCHES.items():
        if kind in kinds:
            yield entry(look.label, color=look.colour, linestyle=look.style, linewidth=1.6)


def place_text(axes: Axes, place: Sequence[float], text: str, **look: Any) -> None:
    """Write a text at a place of the axes, centred in both directions unless the look differs."""
    base: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 9, "color": INK}
    axes.text(place[0], place[1], text, **(base | look))


def annotate(
    axes: Axes, place: Sequence[float], text: str, away: Sequence[float], **look: Any
) -> None:
    """Write a text ``away`` (points) from a place of the axes, with a white halo."""
    base: dict[str, Any] = {"fontsize": 8.5, "color": INK, "va": "center", "zorder": 6}
    base |= {"path_effects": HALO, "textcoords": "offset points"}
    axes.annotate(text, (place[0], place[1]), (away[0], away[1]), **(base | look))


def place_letters(axes: Axes, letters: str, places: Array, curve: Array) -> None:
    """Mark places (n, 2) on a curve (m, 2) by dots, with letters where there is most room."""
    axes.autoscale_view()
    to_pixels = axes.transData.transform
    obstacles = to_pixels(curve)
    low, high = axes.get_window_extent().get_points()
    turn = np.arange(16) * math.pi / 8
    offsets = 9.5 * np.column_stack([np.cos(turn), np.sin(turn)])  # points
    for letter, here in zip(letters, places, strict=False):
        spots = to_pixels(here) + offsets * DPI / 72
        room = np.linalg.norm(spots[:, None] - obstacles, axis=2).min(axis=1)
        room[np.any((spots < low + 8) | (spots > high - 8), axis=1)] = -1
        best = int(np.argmax(room))
        axes.plot(*here, "o", color=INK, markersize=3.6, zorder=3)
        annotate(axes, here, letter, offsets[best], ha="center", fontweight="bold", zorder=5)
        obstacles = np.append(obstacles, spots[best : best + 1], axis=0)


def legend_below(figure: Figure, handles: Sequence[Any], *, fontsize: float = 8.0) -> None:
    """A legend along the lower edge, in as many columns as there is width for."""
    look: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 0.004), "frameon": False}
    look |= {"fontsize": fontsize, "labelcolor": INK, "handlelength": 2.0, "columnspacing": 1.6}
    look |= {"handletextpad": 0.5, "labelspacing": 0.35, "borderaxespad": 0.1}
    for columns in range(len(handles), 0, -1):
        legend = figure.legend(handles=list(handles), ncols=columns, **look)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()
