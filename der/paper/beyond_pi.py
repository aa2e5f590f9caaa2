"""A circle that is not foldable at pi, twisted beyond pi until it is folded."""

from __future__ import annotations

import math
from pathlib import Path as File

import numpy as np

from der.geometry.shapes import circle
from der.paper import canvas
from der.paper.bars import bar
from der.paper.cases import Case, Curve, at_vertices, smooth, solved
from der.paper.snapshots import LEVEL
from der.paper.tables import write_shapes
from der.utils.files import FilePath
from der.viz.curve import arc_length, evenly
from der.viz.plots import rings, style

TITLE = (
    "Circle, $h/t$ = 1: not foldable at the first arrival at $\\pi$; twisted on, the path ends in "
    "the three-covered ring"
)
NUMERALS = "ⅠⅡⅢⅣⅤⅥⅦⅧ"


def figc1(folder: FilePath) -> list[File]:
    """Circle, h/t = 1: moment and snapshots up to the three-covered ring."""
    case = Case("$h/t$ = 1", circle(), 1.0)
    (curve,) = solved([case], shapes=True, until="folded")
    chosen = _spread(curve)
    figure = canvas.page(10.0, 5.6)
    panel = figure.add_axes((0.065, 0.375, 0.92, 0.565))
    canvas.draw_curve(panel, curve, canvas.MOMENT, canvas.COLOURS[1])
    canvas.dress(panel, canvas.MOMENT, "R", 7 * math.pi / 4)
    panel.set_ylim(-0.35, 4.4)
    style.place_text(panel, (0.5, 1.05), TITLE, transform=panel.transAxes, fontsize=10)
    states = curve.states[chosen][:, :2]
    style.place_letters(panel, NUMERALS, states, smooth(curve)[:, :2])
    canvas.legend_of_marks(figure, [curve], dot="state shown below")

    row = figure.add_axes((0.01, 0.055, 0.98, 0.25))
    pictures = [bar(*at_vertices(curve, k), case.h_over_t, LEVEL) for k in chosen]
    sizes = np.array([np.ptp(picture.box, axis=0) for picture in pictures])
    widths = np.maximum(sizes[:, 0] + 0.035 * case.ring.length, 1.9)  # room for the words
    middles = np.cumsum(widths) - widths / 2
    tall = float(sizes[:, 1].max())
    for numeral, k, x, picture in zip(NUMERALS, chosen, middles, pictures, strict=True):
        canvas.place(row, picture, (x, 0.0))
        words = rf"$\bf{{{numeral}}}$   $\gamma$ = {curve.gamma[k] / math.pi:.3g} $\pi$"
        words = words.replace("= 0 $\\pi$", "= 0").replace("= 1 $\\pi$", "= $\\pi$")
        style.place_text(row, (x, -0.72 * tall), words, fontsize=8.5)
    rings.bare(row, (0.0, -0.85 * tall), (widths.sum(), 0.55 * tall))
    about = "circle, h/t = 1, beyond pi until folded (a = R)"
    shots = [(curve, k) for k in chosen]
    return [
        *canvas.written(folder, "figC1", figure, about, [curve]),
        write_shapes(File(folder) / "figC1_shapes.csv", f"figC1: {about}", shots),
    ]


def _spread(curve: Curve) -> list[int]:
    """States spread evenly over the ring's motion, with the first arrival at pi among them."""
    if curve.shapes is None:
        raise ValueError("curve must have shapes to be drawn, got none")
    return evenly(arc_length(curve.shapes.x), len(NUMERALS), keep=curve.first(math.pi))
