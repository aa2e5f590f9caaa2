"""The circle's moment over twist and section: curves, and the surface through them."""

from __future__ import annotations

import math
from pathlib import Path as File
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

from der.geometry.shapes import circle
from der.paper import canvas
from der.paper.cases import Case, Curve, smooth, solved
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.curve import arc_length

SHOWN = (1.0, 1.51, 1.6, 1.84, 2.0, 3.47, 4.0, 8.0)  # h/t
# Here the first fold sits at pi: the path of a less flat section ends there, of a flatter one
# turns back and goes on to the folded ring. So the surface has two sheets that meet at one edge.
FOLDABLE_FROM = 1.507577
NEAR = 1e-4  # of h/t, how close the sheets come to that edge
ALONG = 121  # points along each path
SURFACE: dict[str, Any] = {"color": "#d9e4ef", "alpha": 0.6, "linewidth": 0, "zorder": 1}
SURFACE["lightsource"] = LightSource(azdeg=300, altdeg=45)
TICKS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)


def fig2b(folder: FilePath) -> list[File]:
    """Moment of circles over gamma and h/t, and the curves by themselves."""
    curves = solved(Case(f"$h/t$ = {h:g}", circle(), h, "curve") for h in SHOWN)
    sheets = [
        solved(Case(f"$h/t$ = {h:.6g}", circle(), h, "surface") for h in values)
        for values in (
            np.linspace(1.0, FOLDABLE_FROM - NEAR, 10),
            np.geomspace(FOLDABLE_FROM + NEAR, 8.0, 30),
        )
    ]
    colours = canvas.sequence(len(curves))
    figure = canvas.page(10.0, 4.9)
    panel = Axes3D(figure, rect=(-0.02, 0.03, 0.51, 1.02), computed_zorder=False)
    panel.patch.set_alpha(0.0)
    figure.add_axes(panel)
    _draw_manifold(panel, sheets, curves, colours)
    _draw_flat(figure.add_axes((0.585, 0.305, 0.40, 0.665)), curves, colours)
    canvas.legend_of_marks(figure, curves)
    table = [*curves, *sheets[0], *sheets[1]]
    about = "moment of circles (a = R); curves shown, and those that make the surface"
    return canvas.written(folder, "fig2b", figure, about, table)


def _draw_manifold(
    panel: Any, sheets: list[list[Curve]], curves: list[Curve], colours: list[Any]
) -> None:
    """Draw the surface and the curves on it, on an Axes3D."""
    for sheet in sheets:
        gamma, moment = np.array([_resampled(curve) for curve in sheet]).transpose(2, 0, 1)
        h_over_t = np.array([[curve.case.h_over_t] * ALONG for curve in sheet])
        fine = {"rcount": len(sheet), "ccount": ALONG}
        panel.plot_surface(gamma, np.log(h_over_t), moment, **fine, **SURFACE)
    for curve, colour in zip(curves, colours, strict=True):
        points = smooth(curve)
        level = np.full(len(points), math.log(curve.case.h_over_t))
        panel.plot(points[:, 0], level, points[:, 1], color=colour, linewidth=1.7, zorder=3)
    panel.set_xticks(*canvas.quarters(math.pi))
    panel.set_yticks(np.log(TICKS), [f"{tick:g}" for tick in TICKS])
    panel.set_xlim(0, math.pi)
    panel.set_ylim(0, math.log(8.0))
    labels = {"x": ("$\\gamma$", 10), "y": ("$h/t$ (logarithmic)", 9), "z": ("$M\\,R/GJ$", 10)}
    for name, (label, size) in labels.items():
        getattr(panel, f"set_{name}label")(label, fontsize=size, color=canvas.INK)
    panel.tick_params(labelsize=8, pad=0, labelcolor=canvas.INK)
    panel.view_init(elev=28, azim=-58)
    panel.set_box_aspect((1.25, 1.35, 0.85), zoom=0.95)


def _draw_flat(panel: Axes, curves: list[Curve], colours: list[Any]) -> None:
    """Draw the curves against gamma."""
    for curve, colour in zip(curves, colours, strict=True):
        canvas.draw_curve(panel, curve, canvas.MOMENT, colour, canvas.labelled(curve))
    canvas.dress(panel, canvas.MOMENT, "R")
    canvas.legend(panel, fontsize=7.5, columnspacing=0.8)


def _resampled(curve: Curve) -> Array:
    """Points (gamma, moment) of a curve, evenly spread over its length in the panel."""
    points = smooth(curve)[:, :2]
    length = arc_length(points / (math.pi, 2.5))
    even = np.linspace(0.0, length[-1], ALONG)
    return np.column_stack([np.interp(even, length, column) for column in points.T])
