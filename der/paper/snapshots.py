"""Figures of rings while they are folded: one row for each section, one column for each angle."""

from __future__ import annotations

import math
from pathlib import Path as File

import numpy as np

from der.geometry.ring import Ring
from der.geometry.shapes import circle, ellipse, rectangle, triangle
from der.paper import canvas
from der.paper.bars import Picture, bar, camera
from der.paper.cases import Case, Curve, at_vertices, in_words, plain, solved
from der.paper.tables import write_shapes
from der.utils.files import FilePath
from der.viz.plots import rings, style
from der.viz.ribbon import Camera

EIGHTHS = (0, 2, 4, 5, 6, 7, 8)  # of pi: the snapshots; the ring moves most near the end
WIDTH = 10.0  # inches
SECTIONS = (1.0, 4.0)  # h/t of the rows
LEVEL = camera("level", azimuth=20.0, elevation=-42.0)
NOTE = (
    "Bars drawn thicker than they are, with the section's h/t; dark: grips; dashed: twisting "
    "axis; strands pass through each other. Each state is the path's first at its $\\gamma$."
)
UPRIGHT = camera("upright", azimuth=38.0, elevation=22.0)


def fig2c(folder: FilePath) -> list[File]:
    """Circle."""
    return _rows(folder, "fig2c", "Circle", circle(), LEVEL)


def fig4c(folder: FilePath) -> list[File]:
    """Ellipse, b/a = 0.6, about the x axis."""
    return _rows(folder, "fig4c", "Ellipse, $b/a$ = 0.6, about the x axis", ellipse(0.6), LEVEL)


def fig7c(folder: FilePath) -> list[File]:
    """Rounded rectangle, b/a = 0.6, r/a = 0.3, about the x axis."""
    words = "Rounded rectangle, $b/a$ = 0.6, $r/a$ = 0.3, about the x axis"
    return _rows(folder, "fig7c", words, rectangle(0.6, 0.3), LEVEL)


def fig10d(folder: FilePath) -> list[File]:
    """Equilateral triangle, r half of the inscribed circle's radius."""
    words = "Rounded triangle, $\\alpha_T$ = 60°, $r/a = \\sqrt{3}/12$"
    ring = triangle(math.radians(60), math.sqrt(3) / 12)
    return _rows(folder, "fig10d", words, ring, UPRIGHT)


def fig10e(folder: FilePath) -> list[File]:
    """Obtuse triangle, r about half of the inscribed circle's radius."""
    words = "Rounded triangle, $\\alpha_T$ = 120°, $r/a$ = 1/15"
    return _rows(folder, "fig10e", words, triangle(math.radians(120), 1 / 15), UPRIGHT)


def _rows(folder: FilePath, name: str, words: str, ring: Ring, view: Camera) -> list[File]:
    """Draw and write the snapshots of a ring, all in one scale."""
    cases = [Case(f"$h/t$ = {h:g}", ring, h) for h in SECTIONS]
    curves = solved(cases, save_at=[math.pi * k / 8 for k in EIGHTHS], shapes=True)
    shots = [[curve.first(math.pi * k / 8) for k in EIGHTHS] for curve in curves]
    pictures = [
        [bar(*at_vertices(curve, k), curve.case.h_over_t, view) for k in row]
        for curve, row in zip(curves, shots, strict=True)
    ]
    listed = [(curve, k) for curve, row in zip(curves, shots, strict=True) for k in row]
    return [
        canvas.save(_page(words, curves, pictures), File(folder) / f"{name}.png"),
        write_shapes(File(folder) / f"{name}.csv", f"{name}: {plain(words)}", listed),
    ]


def _page(words: str, curves: list[Curve], pictures: list[list[Picture]]) -> canvas.Figure:
    """The page: a row of pictures below the words of each curve."""
    sizes = np.array([[np.ptp(picture.box, axis=0) for picture in row] for row in pictures])
    widths = sizes[:, :, 0].max(axis=0) + 0.03 * curves[0].case.ring.length
    heights = sizes[:, :, 1].max(axis=1)
    middles = np.cumsum(widths) - widths / 2
    line = 0.024 * widths.sum()  # room for a line of words

    low = np.array([0.0, -heights.sum() - (2 * len(curves) + 2.2) * line])
    high = np.array([widths.sum(), 3.0 * line])
    figure = canvas.page(WIDTH, WIDTH * (high - low)[1] / (high - low)[0])
    panel = figure.add_axes((0, 0, 1, 1))
    style.place_text(panel, (widths.sum() / 2, 2.1 * line), words, fontsize=11)
    for x, k in zip(middles, EIGHTHS, strict=True):
        style.place_text(panel, (x, 0.4 * line), f"$\\gamma$ = {canvas.pi_times(k, 8)}")
    top = 0.0
    for curve, row, height in zip(curves, pictures, heights, strict=True):
        title = f"{curve.case.label}: {in_words(curve.mode)}"
        style.place_text(panel, (0.6 * line, top - line), title, ha="left", fontsize=9.5)
        top -= 1.7 * line
        for x, picture in zip(middles, row, strict=True):
            canvas.place(panel, picture, (x, top - height / 2))
        top -= height + 0.3 * line
    small = {"fontsize": 7.5, "color": canvas.QUIET}
    style.place_text(panel, (widths.sum() / 2, low[1] + 0.9 * line), NOTE, **small)
    rings.bare(panel, low, high)
    return figure
