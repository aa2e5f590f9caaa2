"""The look of all figures: pages, axes, curves, marks and bars. Only here is matplotlib imported.

It is imported when a page is opened, so that the register of figures costs nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

import numpy as np

from der.paper.bars import Picture
from der.paper.cases import Array, Curve, in_words, smooth
from der.utils.files import FilePath, write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes
    from matplotlib.figure import Figure as Figure

DPI = 200
INK, QUIET = "#222222", "#8a8a8a"
# Okabe and Ito: told apart by the colour-blind
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKS = {"fold": ("fold", "D", 4.2), "limit": ("limit of $M$", "^", 4.6)}
MOMENT, ENERGY = 1, 2  # columns of the states
NAMES = {MOMENT: "M", ENERGY: "U"}


def page(width: float, height: float) -> Figure:
    """An empty page, inches; it belongs to nobody and needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Figure, file: FilePath) -> File:
    """Write a PNG, whole or not at all; return the file."""
    # matplotlib's name and version would make the same picture another file
    metadata = {"Software": None}
    write_whole(file, lambda opened: figure.savefig(opened, format="png", metadata=metadata))
    return File(file)


def sequence(n: int) -> list[Any]:
    """n colours from dark to light that the colour-blind can put in order."""
    from matplotlib import colormaps

    return list(colormaps["viridis"](np.linspace(0.0, 0.88, n)))


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue of a colour's name, from 0 to 1."""
    from matplotlib.colors import to_rgb

    return to_rgb(colour)


# --- Curves ----------------------------------------------------------------------------------


def quarters(largest: float) -> tuple[list[float], list[str]]:
    """Ticks at multiples of pi/4 up to the largest [rad], with their labels."""
    places = range(int(largest / (math.pi / 4) + 1e-6) + 1)
    return [k * math.pi / 4 for k in places], [pi_times(k, 4) for k in places]


def pi_times(k: int, n: int) -> str:
    """The angle k pi/n as it is written."""
    common = math.gcd(k, n)
    k, n = k // common, n // common
    top = {0: "0", 1: "\\pi"}.get(k, f"{k}\\pi")
    return f"${top}$" if n == 1 else f"${top}/{n}$"


def dress(panel: Axes, column: int, length: str = "a", largest: float = math.pi) -> None:
    """Axes of a column against gamma from 0 to the largest [rad], in units of GJ over a length."""
    panel.set_xticks(*quarters(largest))
    panel.set_xlim(0.0, largest)
    panel.set_xlabel("$\\gamma$", fontsize=10, color=INK, labelpad=1)
    panel.set_ylabel(f"${NAMES[column]}\\,{length}/GJ$", fontsize=10, color=INK)
    panel.axhline(0.0, color=QUIET, linewidth=0.6, zorder=0)
    panel.tick_params(labelsize=8.5, color=QUIET, labelcolor=INK, direction="in")
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(QUIET)


def draw_curve(panel: Axes, curve: Curve, column: int, colour: Any, label: str = "") -> None:
    """Draw a column (1: moment, 2: energy) against gamma, with folds marked, and limits of M."""
    points = smooth(curve)
    panel.plot(points[:, 0], points[:, column], color=colour, linewidth=1.6, label=label, zorder=2)
    end = curve.states[-1]
    panel.plot(end[0], end[column], ".", color=colour, markersize=6, zorder=3, clip_on=False)
    for kind in MARKS if column == MOMENT else ("fold",):
        at = [point.position for point in curve.points if point.kind == kind]
        states = curve.states[at]
        panel.plot(states[:, 0], states[:, column], zorder=4, **mark(kind, colour))


def mark(kind: str, colour: Any = INK) -> dict[str, Any]:
    """The look of a fold or a limit."""
    _, marker, size = MARKS[kind]
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": size,
        "markerfacecolor": "white",
        "markeredgecolor": colour,
        "markeredgewidth": 1.0,
        "clip_on": False,
    }


def labelled(curve: Curve) -> str:
    """Words of a curve for the legend: its label and how the ring folds."""
    cut = curve.case.cut
    end = "" if cut is None else f" (cut at {pi_times(round(cut / math.pi * 8), 8)})"
    return f"{curve.case.label}: {in_words(curve.mode)}{end}"


def legend(panel: Axes, **options: Any) -> None:
    """The panel's legend, below it unless the options say where."""
    below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14), "ncols": 2}
    look = {"frameon": False, "fontsize": 8, "labelcolor": INK, "handlelength": 1.5}
    panel.legend(**(below | look | {"columnspacing": 1.2, "borderpad": 0.0} | options))


def legend_of_marks(
    figure: Figure,
    curves: Iterable[Curve],
    kinds: Sequence[str] = tuple(MARKS),
    dot: str = "end of the curve",
) -> None:
    """A line at the foot of the page that says what the marks are."""
    from matplotlib.lines import Line2D

    there = {point.kind for curve in curves for point in curve.points}
    handles = [
        Line2D([], [], label=MARKS[kind][0], **mark(kind)) for kind in kinds if kind in there
    ]
    handles.append(Line2D([], [], linestyle="none", marker=".", color=INK, label=dot))
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.01),
        ncols=len(handles),
        frameon=False,
        fontsize=8,
        labelcolor=INK,
        handletextpad=0.2,
        columnspacing=2.0,
        borderpad=0.0,
    )


def write_beside(panel: Axes, at: Array, names: Sequence[str], curve: Array) -> None:
    """Write names beside points (n, 2) of a panel, where a curve (m, 2) leaves most room.

    The panel's limits are final, and so is its place on the page.
    """
    from matplotlib.patheffects import withStroke

    pixels = panel.transData.transform
    obstacles = np.concatenate([pixels(curve), pixels(at)])
    low, high = panel.get_window_extent().get_points()
    turn = np.arange(16) * math.pi / 8
    for name, here in zip(names, at, strict=True):
        wide = 9.0 + 2.0 * len(name)  # points, as the offsets are
        offsets = np.column_stack([wide * np.cos(turn), 10.0 * np.sin(turn)])
        places = pixels(here) + offsets * DPI / 72
        room = np.linalg.norm(places[:, None] - obstacles, axis=2).min(axis=1)
        room[np.any((places < low + 12) | (places > high - 12), axis=1)] = -1.0
        best = int(np.argmax(room))
        panel.annotate(
            name,
            (float(here[0]), float(here[1])),
            xytext=(float(offsets[best, 0]), float(offsets[best, 1])),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=9,
            fontweight="bold",
            color=INK,
            zorder=6,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )
        obstacles = np.append(obstacles, places[best : best + 1], axis=0)


# --- Bars ------------------------------------------------------------------------------------


def place(
    panel: Axes, picture: Picture, at: Sequence[float], *, axis: bool = True, zorder: float = 2.0
) -> None:
    """Draw a bar, and its twisting axis if wanted, with the middle of its box at a point."""
    from matplotlib.collections import PolyCollection

    shift = np.array(at) - picture.box.mean(axis=0)
    bar = PolyCollection(
        list(picture.corners + shift),
        facecolors=picture.colours,
        edgecolors=picture.colours,
        linewidths=0.25,
        zorder=zorder,
    )
    panel.add_collection(bar)
    if axis:
        ends = (picture.axis + shift).T
        panel.plot(*ends, color=INK, linewidth=0.7, dashes=(4, 3), zorder=zorder - 0.5)


def words(panel: Axes, at: Sequence[float], text: str, **options: Any) -> None:
    """Text at a point of a panel."""
    look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 9, "color": INK}
    panel.text(at[0], at[1], text, **(look | options))


def bare(panel: Axes, low: Sequence[float] | Array, high: Sequence[float] | Array) -> None:
    """A panel without axes, one scale both ways, that shows a box."""
    panel.set_xlim(low[0], high[0])
    panel.set_ylim(low[1], high[1])
    panel.set_aspect("equal")
    panel.set_axis_off()


def page_3d(figure: Figure, box: tuple[float, float, float, float]) -> Any:
    """A panel in three dimensions whose parts are drawn in the order of their zorder."""
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    panel = Axes3D(figure, rect=box, computed_zorder=False)
    figure.add_axes(panel)
    panel.patch.set_alpha(0.0)
    return panel


def light(azimuth: float, elevation: float) -> Any:
    """Light from a direction, degrees, for a surface in three dimensions."""
    from matplotlib.colors import LightSource

    return LightSource(azdeg=azimuth, altdeg=elevation)
