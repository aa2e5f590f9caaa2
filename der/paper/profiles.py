"""Figures of rings of different profiles: moments, and below them the rings before and after."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path as File

import numpy as np
from matplotlib.colors import to_rgb

from der.geometry.ring import Ring
from der.geometry.shapes import ellipse, rectangle, triangle
from der.paper import canvas
from der.paper.bars import bar, camera
from der.paper.cases import Case, Curve, at_vertices, in_words, solved
from der.utils.files import FilePath
from der.viz.plots import rings, style
from der.viz.ribbon import Camera

H_OVER_T = 4.0
INSCRIBED = math.tan(math.radians(15)) / 2  # circle in the triangle of 120 degrees, radius over a
BEFORE = (0.80, 0.80, 0.80)
THICK = 0.9  # of bars with a square section, seen face to face
ROW = (3.95, 1.6)  # of rings below a panel, inches
LEVEL, UPRIGHT = camera("level"), camera("upright")


@dataclass(frozen=True)
class Panel:
    """A family of rings, and how they are seen.

    Parameters
    ----------
    title : above the curves
    cases : from left to right
    view : of the rings, face to face
    """

    title: str
    cases: Sequence[Case]
    view: Camera


def figd1(folder: FilePath) -> list[File]:
    """Ellipses, h/t = 4, about either axis."""
    rings = {f"$b/a$ = {b:g}": partial(ellipse, b) for b in (1.0, 0.85, 0.7, 0.6)}
    panels = [
        _panel(f"({letter})", f"Ellipses about the {axis} axis", rings, axis)
        for letter, axis in zip("ab", "xy", strict=True)
    ]
    return _profiles(folder, "figD1", panels, "ellipses, h/t = 4")


def figd2(folder: FilePath) -> list[File]:
    """Rounded rectangles, h/t = 4, about either axis; squares with different fillets."""
    rings = {f"$b/a$ = {b:g}": partial(rectangle, b, 0.3) for b in (1.0, 0.8, 0.6, 0.4)}
    squares = {f"$r/a$ = {r:g}": rectangle(1.0, r) for r in (0.1, 0.3, 0.6, 1.0)}
    panels = [_panel("(a)", f"$r/a$ = 0.3, about the {axis} axis", rings, axis) for axis in "xy"]
    panels.append(Panel("(b) $b/a$ = 1, $h/t$ = 4", _cases(squares, "(b)"), LEVEL))
    return _profiles(folder, "figD2", panels, "rounded rectangles, h/t = 4")


def figd3(folder: FilePath) -> list[File]:
    """Rounded triangles, h/t = 4: different angles, different fillets."""
    angles = {f"$\\alpha_T$ = {d}°": triangle(math.radians(d), 1 / 30) for d in (60, 75, 90, 120)}
    # the paper's r/a = R_C/2 = 1/15, and not 2/15, which is R_C within half a percent
    fillets = {"1/30": 1 / 30, "1/15": 1 / 15, "1/10": 1 / 10, "$R_C/a$": INSCRIBED}
    obtuse = {f"$r/a$ = {name}": triangle(math.radians(120), r) for name, r in fillets.items()}
    panels = [
        Panel("(a) $r/a$ = 1/30, $h/t$ = 4", _cases(angles, "(a)"), UPRIGHT),
        Panel("(b) $\\alpha_T$ = 120°, $h/t$ = 4", _cases(obtuse, "(b)"), UPRIGHT),
    ]
    return _profiles(folder, "figD3", panels, "rounded triangles, h/t = 4")


def _panel(letter: str, title: str, rings: Mapping[str, Callable[[str], Ring]], axis: str) -> Panel:
    """Rings about one twisting axis."""
    cases = _cases({label: ring(axis) for label, ring in rings.items()}, f"{letter} {axis} axis")
    return Panel(f"{letter} {title}, $h/t$ = 4", cases, LEVEL if axis == "x" else UPRIGHT)


def _cases(rings: Mapping[str, Ring], panel: str) -> list[Case]:
    """The cases of rings, by label, in a panel."""
    return [Case(label, ring, H_OVER_T, panel) for label, ring in rings.items()]


def _profiles(folder: FilePath, name: str, panels: Sequence[Panel], about: str) -> list[File]:
    """Draw and write the panels side by side; the rings of one are in one scale."""
    families = [solved(panel.cases, shapes=True) for panel in panels]
    wide, high = 0.55 + 4.0 * len(panels), 5.35
    figure = canvas.page(wide, high)
    top = None
    for i, (panel, curves) in enumerate(zip(panels, families, strict=True)):
        left = (0.6 + 4.0 * i) / wide
        above = figure.add_axes((left, 2.33 / high, 3.55 / wide, 2.70 / high), sharey=top)
        top = top or above
        for curve, colour in zip(curves, canvas.COLOURS, strict=False):
            canvas.draw_curve(above, curve, canvas.MOMENT, colour)
        canvas.dress(above, canvas.MOMENT)
        if i:
            above.set_ylabel("")
        above.set_title(panel.title, fontsize=9.5, color=canvas.INK)
        row = figure.add_axes((left - 0.2 / wide, 0.28 / high, ROW[0] / wide, ROW[1] / high))
        _draw_rings(row, curves, panel.view)
    table = [curve for curves in families for curve in curves]
    canvas.legend_of_marks(figure, table)
    return canvas.written(folder, name, figure, about, table)


def _draw_rings(row: canvas.Axes, curves: Sequence[Curve], view: Camera) -> None:
    """Draw the flat rings in grey, over them the rings at the end of their paths; name them."""
    slot = _slot(curves)
    for i, (curve, colour) in enumerate(zip(curves, canvas.COLOURS, strict=False)):
        before, after = (
            bar(*at_vertices(curve, k), 1.0, view, shade, THICK)
            for k, shade in ((0, BEFORE), (-1, to_rgb(colour)))
        )
        canvas.place(row, before, (i * slot, 0.0), zorder=1.0)
        canvas.place(row, after, (i * slot, 0.0), axis=False, zorder=3.0)
        words = curve.case.label + "\n" + in_words(curve.mode).replace(", ", ",\n")
        look = {"fontsize": 8, "color": colour, "va": "top", "linespacing": 1.15}
        style.place_text(row, (i * slot, -0.53 * slot), words, **look)
    wide = len(curves) * slot
    top = 0.52 * slot
    rings.bare(row, (-slot / 2, top - wide * ROW[1] / ROW[0]), (wide - slot / 2, top))


def _slot(curves: Sequence[Curve]) -> float:
    """Side of a square that holds any of the rings, flat or folded, with its twisting axis."""
    ends = [at_vertices(curve, k)[0] for curve in curves for k in (0, -1)]
    return 1.35 * max(float(np.ptp(x, axis=0)[1:].max()) for x in ends)
