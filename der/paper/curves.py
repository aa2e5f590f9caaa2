"""Figures of moments and energies against the twist of the grips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path as File
from typing import Any

from der.geometry.ring import Ring
from der.geometry.shapes import circle, ellipse, rectangle, triangle
from der.paper import canvas
from der.paper.cases import Case, Curve, in_words, plain, solved
from der.utils.files import FilePath
from der.viz.plots import style

PLAIN = (1.0, 2.0, 3.0, 4.0)  # h/t
FOLD_LINE: dict[str, Any] = {"color": canvas.QUIET, "linewidth": 0.7, "zorder": 1}
FOLD_LINE["linestyle"] = (0, (1, 2))


def families(rings: dict[str, Ring], cut: dict[float, float] | None = None) -> list[Case]:
    """One case for each panel's ring and each of the plain h/t; `cut` holds ends of curves."""
    cut = cut or {}
    return [
        Case(f"$h/t$ = {h:g}", ring, h, panel, cut.get(h))
        for panel, ring in rings.items()
        for h in PLAIN
    ]


def fig4b(folder: FilePath) -> list[File]:
    """Ellipse, b/a = 0.6, about either axis."""
    rings = {f"{axis} axis": ellipse(0.6, axis) for axis in "xy"}
    return _side_by_side(folder, "fig4b", "Ellipse, $b/a$ = 0.6", families(rings))


def fig7b(folder: FilePath) -> list[File]:
    """Rounded rectangle, b/a = 0.6, r/a = 0.3, about either axis."""
    rings = {f"{axis} axis": rectangle(0.6, 0.3, axis) for axis in "xy"}
    words = "Rounded rectangle, $b/a$ = 0.6, $r/a$ = 0.3"
    return _side_by_side(folder, "fig7b", words, families(rings))


def fig10b(folder: FilePath) -> list[File]:
    """Equilateral triangle, r half of the inscribed circle's radius."""
    rings = {"": triangle(math.radians(60), math.sqrt(3) / 12)}
    words = "Rounded triangle, $\\alpha_T$ = 60°, $r/a = \\sqrt{3}/12$"
    return _side_by_side(folder, "fig10b", words, families(rings))


def fig10c(folder: FilePath) -> list[File]:
    """Obtuse triangle, r about half of the inscribed circle's radius; h/t = 1 is cut."""
    rings = {"": triangle(math.radians(120), 1 / 15)}
    words = "Rounded triangle, $\\alpha_T$ = 120°, $r/a$ = 1/15"
    cases = families(rings, cut={1.0: 7 * math.pi / 8})
    return _side_by_side(folder, "fig10c", words, cases)


def figc2(folder: FilePath) -> list[File]:
    """Energy of circles."""
    curves = solved(
        Case(f"$h/t$ = {h:g}", circle(), h) for h in (1.0, 1.51, 1.6, 1.84, 2.0, 3.47, 4.0, 8.0)
    )
    figure = canvas.page(5.6, 4.2)
    panel = figure.add_axes((0.105, 0.155, 0.865, 0.775))
    panel.set_title("Circle", fontsize=10, color=canvas.INK)
    for curve, colour in zip(curves, canvas.sequence(len(curves)), strict=True):
        canvas.draw_curve(panel, curve, canvas.ENERGY, colour, canvas.labelled(curve))
    canvas.dress(panel, canvas.ENERGY, "R")
    panel.set_ylim(bottom=0.0)
    canvas.legend(panel, loc="upper left", bbox_to_anchor=(0.0, 1.0), ncols=1)
    canvas.legend_of_marks(figure, curves, kinds=("fold",))
    return canvas.written(folder, "figC2", figure, "energy of circles (a = R)", curves)


def fig11(folder: FilePath) -> list[File]:
    """Two triangles that snap back: moments above, energies below."""
    curves = solved(
        Case(
            f"$\\alpha_T$ = {d}°, $r/a$ = 1/{n}, $h/t$ = {h}",
            triangle(math.radians(d), 1 / n),
            float(h),
        )
        for d, n, h in ((120, 15, 1), (90, 30, 4))
    )
    figure = canvas.page(8.0, 5.8)
    grid = figure.add_gridspec(
        2, 2, left=0.075, right=0.985, bottom=0.105, top=0.895, hspace=0.13, wspace=0.17
    )
    for i, curve in enumerate(curves):
        above = figure.add_subplot(grid[0, i])
        below = figure.add_subplot(grid[1, i], sharex=above)
        for panel, column in ((above, canvas.MOMENT), (below, canvas.ENERGY)):
            canvas.draw_curve(panel, curve, column, canvas.COLOURS[i])
            canvas.dress(panel, column)
        above.set_xlabel("")
        above.tick_params(labelbottom=False)
        above.margins(y=0.08)
        below.set_ylim(bottom=0.0)
        words = f"({'ab'[i]})  {curve.case.label}\n{in_words(curve.mode)}"
        above.set_title(words, fontsize=9.5, color=canvas.INK, pad=20)
        _name_folds(above, below, curve)
    canvas.legend_of_marks(figure, curves)
    return canvas.written(folder, "fig11", figure, "rounded triangles that snap back", curves)


def _name_folds(above: canvas.Axes, below: canvas.Axes, curve: Curve) -> None:
    """Draw a line through both panels at each fold, with its gamma on top."""
    for fold in curve.points:
        if fold.kind == "fold":
            for panel in (above, below):
                panel.axvline(fold.gamma, **FOLD_LINE)
            place = above.get_xaxis_transform()
            look = {"fontsize": 8, "va": "bottom", "transform": place}
            style.place_text(above, (fold.gamma, 1.02), f"{fold.gamma:.4f}", **look)


def _side_by_side(folder: FilePath, name: str, words: str, cases: Sequence[Case]) -> list[File]:
    """Moments against gamma, one panel beside the other, one colour for every h/t."""
    curves = solved(cases)
    panels = list(dict.fromkeys(curve.case.panel for curve in curves))
    figure = canvas.page(0.8 + 3.9 * len(panels), 4.2)
    wide = figure.get_figwidth()
    grid = figure.add_gridspec(
        1, len(panels), left=0.55 / wide, right=1 - 0.2 / wide, bottom=0.255, top=0.935, wspace=0.1
    )
    first = None
    for i, name_of_panel in enumerate(panels):
        panel = figure.add_subplot(grid[i], sharey=first)
        first = first or panel
        colours = iter(canvas.COLOURS)
        for curve in curves:
            if curve.case.panel == name_of_panel:
                label = canvas.labelled(curve)
                canvas.draw_curve(panel, curve, canvas.MOMENT, next(colours), label)
        canvas.dress(panel, canvas.MOMENT)
        if i:
            panel.set_ylabel("")
        about = f", about the {name_of_panel}" if name_of_panel else ""
        panel.set_title(words + about, fontsize=9.5, color=canvas.INK)
        canvas.legend(panel)
    canvas.legend_of_marks(figure, curves)
    return canvas.written(folder, name, figure, plain(words), curves)
