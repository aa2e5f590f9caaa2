"""Common parts of the paper's figures: pages, axes against gamma, curves with marks, and bars."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path as File
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes as Axes
from matplotlib.figure import Figure as Figure

from der.paper.bars import Picture
from der.paper.cases import Curve, in_words, smooth
from der.paper.tables import write_curves
from der.utils.files import FilePath
from der.viz.palette import INK as INK
from der.viz.palette import QUIET as QUIET
from der.viz.plots import rings, style

DPI = 200
# Okabe and Ito: told apart by the colour-blind
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
KINDS = {"fold": "fold", "limit": "limit of $M$"}  # of points that are marked
MOMENT, ENERGY = 1, 2  # columns of the states
NAMES = {MOMENT: "M", ENERGY: "U"}


def page(width: float, height: float) -> Figure:
    """An empty page, inches; it is made without pyplot and needs no display."""
    return Figure(figsize=(width, height), dpi=DPI, facecolor="white")


def save(figure: Figure, file: FilePath) -> File:
    """Write a picture atomically; return the file."""
    style.save(figure, file)
    return File(file)


def written(
    folder: FilePath, name: str, figure: Figure, about: str, curves: Sequence[Curve]
) -> list[File]:
    """Write picture and table of a figure; return the files."""
    return [
        save(figure, File(folder) / f"{name}.png"),
        write_curves(File(folder) / f"{name}.csv", f"{name}: {about}", curves),
    ]


def sequence(n: int) -> list[Any]:
    """n colours from dark to light, in an order that the colour-blind can see."""
    return list(colormaps["viridis"](np.linspace(0.0, 0.88, n)))


# --- Curves ----------------------------------------------------------------------------------


def quarters(largest: float) -> tuple[list[float], list[str]]:
    """Ticks at multiples of pi/4 up to the largest [rad], with their labels."""
    places = range(int(largest / (math.pi / 4) + 1e-6) + 1)
    return [k * math.pi / 4 for k in places], [pi_times(k, 4) for k in places]


def pi_times(k: int, n: int) -> str:
    """The angle k pi/n as mathtext."""
    common = math.gcd(k, n)
    k, n = k // common, n // common
    top = {0: "0", 1: "\\pi"}.get(k, f"{k}\\pi")
    return f"${top}$" if n == 1 else f"${top}/{n}$"


def dress(panel: Axes, column: int, length: str = "a", largest: float = math.pi) -> None:
    """Axes of a column against gamma from 0 to the largest [rad], in units of GJ over a length."""
    style.label_axes(panel, "$\\gamma$", f"${NAMES[column]}\\,{length}/GJ$", fontsize=9.5)
    panel.set_xticks(*quarters(largest))
    panel.set_xlim(0.0, largest)
    style.zero_line(panel)


def draw_curve(panel: Axes, curve: Curve, column: int, colour: Any, label: str = "") -> None:
    """Draw a column (1: moment, 2: energy) against gamma, with folds marked, and limits of M."""
    points = smooth(curve)
    panel.plot(points[:, 0], points[:, column], color=colour, linewidth=1.6, label=label, zorder=2)
    end = curve.states[-1]
    panel.plot(end[0], end[column], ".", color=colour, markersize=6, zorder=3, clip_on=False)
    for kind in KINDS if column == MOMENT else ("fold",):
        at = [point.position for point in curve.points if point.kind == kind]
        states = curve.states[at]
        panel.plot(states[:, 0], states[:, column], zorder=4, **mark(kind, colour))


def mark(kind: str, colour: Any = INK) -> dict[str, Any]:
    """The look of a fold or a limit."""
    marker, size = style.MARKS[kind]
    return style.mark(marker, 0.9 * size) | {"markeredgecolor": colour, "clip_on": False}


def labelled(curve: Curve) -> str:
    """The text of a curve in the legend: its label and the folding mode."""
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
    kinds: Sequence[str] = tuple(KINDS),
    dot: str = "end of the curve",
) -> None:
    """The legend of the marks, at the foot of the page."""
    occurring = {point.kind for curve in curves for point in curve.points}
    handles = [style.entry(KINDS[kind], **mark(kind)) for kind in kinds if kind in occurring]
    handles.append(style.entry(dot, linestyle="none", marker=".", color=INK))
    style.legend_below(figure, handles)


# --- Bars ------------------------------------------------------------------------------------


def place(
    panel: Axes, picture: Picture, at: Sequence[float], *, axis: bool = True, zorder: float = 2.0
) -> None:
    """Draw a bar, and its twisting axis if wanted, with the middle of its box at a point."""
    shift = np.array(at) - picture.box.mean(axis=0)
    rings.place_quadrilaterals(panel, picture.corners + shift, picture.colours, zorder=zorder)
    if axis:
        ends = (picture.axis + shift).T
        panel.plot(*ends, color=INK, linewidth=0.7, dashes=(4, 3), zorder=zorder - 0.5)
