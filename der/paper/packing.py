"""The paper's figures of packing ratios, each as a picture and as a table of its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.bvp.planar.folded_shape import folded
from der.bvp.planar.packing import packing_ratio
from der.bvp.released import index_free, planar_shape, stiffnesses
from der.geometry.ring import Ring
from der.geometry.section import rectangular_section
from der.geometry.shapes import ellipse, rectangle, triangle
from der.paper import canvas
from der.paper.canvas import INK, QUIET
from der.paper.tables import write_table
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.plots import rings, style

MAP_POINTS = 720  # on a ring of a map: packing ratios to about 1e-7
SHAPE_POINTS = 600
H_OVER_T, NU = 4.0, 0.3  # of the rings of which is said whether they stay folded when released
FOLDED, OPENS, FLAT = "#0072B2", "#D55E00", "#bdbdbd"  # blue and vermilion of Okabe and Ito
RELEASED = f"when released ($h/t$ = {H_OVER_T:g}, $\\nu$ = {NU:g})"
LETTERS = "ABCDEFGH"
DOT = style.mark("o", 4.5) | {"zorder": 4}
# places of the labels of contours of fig. 9: away from the jump
LABELS = (
    *((38, 0.28), (38, 0.24), (38, 0.16), (36, 0.09)),
    *((76, 0.19), (76, 0.16), (76, 0.11), (76, 0.05)),
)
ELLIPSES = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # b/a of the insets
RECTANGLES = {  # r/a by b/a
    0.2: (0.1, 0.2),
    0.6: (0.1, 0.3, 0.6),
    1.0: (0.1, 0.5, 1.0),
}
TRIANGLES = {  # r/a by the vertex angle in degrees
    30.0: (0.033, 0.2, 0.35),
    60.0: (0.05, 0.2),
    90.0: (0.033, 0.15),
    120.0: (1 / 30,),
}


def fig3b(folder: FilePath, columns: int = 51) -> list[Path]:
    """Draw the packing ratio of ellipses against b/a in [0.5, 1]; return the files.

    Raises
    ------
    ValueError
        If `columns`, the number of ellipses, is less than 2.
    """
    b = np.linspace(0.5, 1.0, _checked(columns))
    ratio = np.array([packing_ratio(ellipse(c), MAP_POINTS) for c in b])
    held = np.array([stiffness_released(ellipse(c)) for c in b])
    figure = _curve_figure(b, ratio)
    columns_of = {"b_over_a": b, "packing_ratio": ratio, "stays_folded": held > 0.0}
    return _written(folder, "fig3b", figure, columns_of)


def fig6(folder: FilePath, columns: int = 49) -> list[Path]:
    """Draw the packing ratio of rectangles over (b/a, r/a); return the files.

    Parameters and errors are those of `fig3b`; the map has two rows for five columns.
    """
    b, share = _grid(0.2, 1.0, columns)
    r = 0.1 + share * (b - 0.1)
    ratio = np.vectorize(lambda b, r: packing_ratio(rectangle(b, r), MAP_POINTS))(b, r)
    marks = [
        _Mark((c, r), rectangle(c, r), f"{c:.2g}, {r:.2g}")
        for c, radii in RECTANGLES.items()
        for r in radii
    ]
    held = np.vectorize(lambda b, r: stiffness_released(rectangle(b, r)))(b, r)
    figure = _map_figure(b, r, (ratio, held), marks, "$b/a,\\ r/a$")
    axes = figure.axes[0]
    style.label_axes(axes, "aspect ratio  $b/a$", "fillet radius  $r/a$", fontsize=10)
    axes.text(0.27, 0.72, "$r > b$: no such ring", fontsize=8.5, color=QUIET)
    columns_of = {"b_over_a": b, "r_over_a": r, "packing_ratio": ratio, "stays_folded": held > 0.0}
    return _written(folder, "fig6", figure, columns_of)


def fig9(folder: FilePath, columns: int = 22) -> list[Path]:
    """Draw the packing ratio of triangles over (vertex angle, r/a); return the files.

    Parameters and errors are those of `fig3b`; the map has two rows for five columns. With
    small fillets the folded shape of least energy, and so the ratio, jumps between 50 and 60
    degrees, where columns are closer.
    """
    share_across, share = _grid(0.0, 1.0, columns)
    degrees = np.interp(share_across, [0.0, 0.3, 0.6, 1.0], [30.0, 50.0, 60.0, 120.0])
    inscribed = np.tan(np.pi / 4 - np.radians(degrees) / 4) / 2
    r = 0.033 + share * (inscribed - 0.033)
    ratio = np.vectorize(lambda d, r: packing_ratio(triangle(math.radians(d), r), MAP_POINTS))(
        degrees, r
    )
    marks = [
        _Mark((d, r), triangle(math.radians(d), r), f"{d:.0f}°, {r:.2g}")
        for d, radii in TRIANGLES.items()
        for r in radii
    ]
    held = np.vectorize(lambda d, r: stiffness_released(triangle(math.radians(d), r)))(degrees, r)
    figure = _map_figure(degrees, r, (ratio, held), marks, "$\\alpha_T,\\ r/a$", LABELS)
    axes = figure.axes[0]
    across = "vertex angle  $\\alpha_T$  (degrees)"
    style.label_axes(axes, across, "fillet radius  $r/a$", fontsize=10)
    axes.set_xticks(range(30, 121, 15))
    axes.text(84, 0.29, "$r > R_C$: no such ring", fontsize=8.5, color=QUIET)
    columns_of = {"vertex_angle": degrees, "r_over_a": r, "packing_ratio": ratio}
    columns_of["stays_folded"] = held > 0.0
    return _written(folder, "fig9", figure, columns_of)


def stiffness_released(ring: Ring) -> float:
    """Return the least stiffness of the folded ring without grips: positive where it stays so.

    See `der.bvp.released.stiffnesses`; continuous where it vanishes.
    """
    state = planar_shape(ring, rectangular_section(H_OVER_T, NU))
    least = abs(min(stiffnesses(state)))
    return least if index_free(state) == 0 else -least


class _Mark(NamedTuple):
    """A ring whose folded shape is shown beside a map."""

    at: tuple[float, float]
    ring: Ring
    label: str


def _checked(columns: object) -> int:
    if isinstance(columns, bool) or not isinstance(columns, int) or columns < 2:
        raise ValueError(f"columns must be an integer >= 2, got {columns!r}")
    return columns


def _grid(first: float, last: float, columns: object) -> tuple[Array, Array]:
    """Return the abscissa, and the share of the ordinate's range, of every point of a map."""
    n = _checked(columns)
    across, share = np.meshgrid(np.linspace(first, last, n), np.linspace(0, 1, 2 + 2 * n // 5))
    return across, share


def _written(folder: FilePath, name: str, figure: Figure, table: dict[str, Array]) -> list[Path]:
    """Write the picture and its numbers."""
    rows = np.column_stack([np.ravel(column) for column in table.values()])
    texts = [[f"{value:.10g}" for value in row] for row in rows]
    csv = write_table(Path(folder) / f"{name}.csv", table, texts)
    return [canvas.save(figure, Path(folder) / f"{name}.png"), csv]


# --- Pictures --------------------------------------------------------------------------------


def _curve_figure(b: Array, ratio: Array) -> Figure:
    """Packing ratio against b/a, below the folded shapes of some ellipses."""
    figure = canvas.page(6.6, 4.6)
    axes = figure.add_axes((0.11, 0.18, 0.86, 0.5))
    axes.plot(b, ratio, color=FOLDED, linewidth=1.8, zorder=2)
    axes.axhline(1 / 9, color=QUIET, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    axes.text(0.5, 1 / 9 + 0.004, "circle, 1/9", fontsize=8.5, color=QUIET, va="bottom")
    axes.set_xlim(0.46, 1.04)
    axes.set_ylim(0.08, 0.32)
    style.label_axes(axes, "aspect ratio  $b/a$", "packing ratio", fontsize=10)
    for c in ELLIPSES:
        ring = ellipse(c)
        height = packing_ratio(ring, MAP_POINTS)
        axes.vlines(c, height, 0.32, color=QUIET, linewidth=0.6, linestyle=(0, (1, 2)), zorder=1)
        axes.plot(c, height, **DOT)
        centre = 0.11 + 0.86 * (c - 0.46) / 0.58
        inset = figure.add_axes((centre - 0.069, 0.72, 0.138, 0.2))
        _draw_shapes(inset, ring)
        figure.text(centre, 0.955, f"{height:.3f}", ha="center", fontsize=9, color=INK)
    figure.text(0.012, 0.955, "ratio", fontsize=9, color=QUIET)
    _say_released(figure, 0.54, "")
    return figure


def _say_released(figure: Figure, x: float, also: str) -> None:
    """Say what the colours of the shapes mean."""
    look: dict[str, Any] = {"ha": "center", "fontsize": 7.6}
    figure.text(x, 0.042, f"blue: stays folded {RELEASED}", color=FOLDED, **look)
    figure.text(x, 0.01, f"vermilion{also}: opens {RELEASED}", color=OPENS, **look)


def _map_figure(
    x: Array,
    y: Array,
    values: tuple[Array, Array],
    marks: Sequence[_Mark],
    what: str,
    labels_at: Sequence[tuple[float, float]] = (),
) -> Figure:
    """Contours of the packing ratio, beside the folded shapes of the rings that are marked.

    Parameters
    ----------
    values : packing ratio, and stiffness when released: hatched where that is not positive
    """
    ratio, held = values
    figure = canvas.page(9.2, 4.9)
    axes = figure.add_axes((0.065, 0.115, 0.465, 0.835))
    _contours(axes, x, y, ratio, labels_at)
    if held.min() < 0.0:
        lowest = 2.0 * float(held.min())
        axes.contourf(x, y, held, levels=[lowest, 0.0], colors="none", hatches=["////"])
        axes.contour(x, y, held, levels=[0.0], colors=INK, linewidths=1.2)
    for k, mark in enumerate(marks):
        axes.plot(*mark.at, clip_on=False, **DOT)
        # to the left of the last point of the map
        away = (-7.5 if mark.at[0] == np.max(x) else 6.5, 6.5)
        style.annotate(axes, mark.at, LETTERS[k], away, ha="center", fontsize=9, fontweight="bold")
        left, bottom = 0.635 + 0.182 * (k % 2), 0.763 - 0.224 * (k // 2)
        _draw_shapes(figure.add_axes((left, bottom, 0.175, 0.155)), mark.ring)
        value = packing_ratio(mark.ring, MAP_POINTS)
        caption = rf"$\bf{{{LETTERS[k]}}}$  {mark.label}:  {value:.2f}"
        figure.text(left + 0.0875, bottom + 0.166, caption, ha="center", fontsize=8.5, color=INK)
    about = figure.text(0.8135, 0.972, f"ring ({what}): packing ratio", color=QUIET, fontsize=8.5)
    about.set(ha="center", va="center")
    _say_released(figure, 0.8135, ", hatched")
    return figure


def _contours(
    axes: Axes, x: Array, y: Array, ratio: Array, labels_at: Sequence[tuple[float, float]]
) -> None:
    """Draw filled contours of the packing ratio, with a colour bar beside them."""
    highest = float(np.max(ratio))
    levels = np.append(np.arange(4, 12) / 40, np.arange(6, 20 * highest + 1) / 20)
    named = [
        v for v in levels[1:] if v < highest - 0.1 and round(40 * v) % (2 if v < 0.3 else 4) == 0
    ]
    filled = axes.contourf(x, y, ratio, levels=levels, cmap="viridis")
    lines = axes.contour(x, y, ratio, levels=levels[1:], colors="white", linewidths=0.5)
    axes.clabel(lines, named, fmt="%.3g", fontsize=7, manual=labels_at or False)
    axes.use_sticky_edges = False
    axes.margins(0.04)
    figure = axes.figure
    bar = figure.colorbar(filled, cax=figure.add_axes((0.545, 0.115, 0.014, 0.835)))
    style.dress_bar(bar, "packing ratio", [v for v in levels if round(40 * v) % 4 == 0], 9.5)


def _draw_shapes(axes: Axes, ring: Ring) -> None:
    """Draw the folded ring inside its flat outline, in one scale, about one centre.

    The colour says whether it stays folded when released.
    """
    s = np.linspace(0.0, ring.length, SHAPE_POINTS + 1)
    flat = ring.position(s)[:, 1:]
    points = folded(ring, SHAPE_POINTS).points
    points = np.append(points, points[:1], axis=0)
    folds = FOLDED if stiffness_released(ring) > 0.0 else OPENS
    for curve, colour, width in ((flat, FLAT, 0.9), (points, folds, 1.1)):
        axes.plot(*(curve - rings.box_middle(curve)).T, color=colour, linewidth=width)
    axes.set_aspect("equal")
    axes.set_axis_off()
