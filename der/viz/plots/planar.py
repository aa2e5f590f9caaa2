"""The planar states of a ring side by side."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.records.planar import FOLDED, PlanarState, PlanarStates
from der.records.units import factor, unit
from der.utils.checks import Array
from der.viz.palette import STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.plots.rings import LARGER, closed_curve, draw_closed, strands_apart
from der.viz.titles import title

COLUMNS = 6  # at most
CELL, ROW = 1.55, 1.95  # inches, of a state
APART = 0.16  # of the radius: how far the strands of an n-covered circle are drawn apart
KINDS = ((True, "stable in its plane", STABLE), (False, "unstable in its plane", UNSTABLE))
_ROUND, _ZERO = 1e-6, 1e-9  # of the radius; GJ/a: rounding


def draw(found: PlanarStates) -> Figure:
    """The picture of the planar states of a ring.

    Raises
    ------
    ValueError
        If there is no state.
    """
    style.check_states("record", found)
    rows = math.ceil(len(found) / COLUMNS)
    columns = math.ceil(len(found) / rows)
    width, height = max(columns * CELL, 5.4) + 0.3, rows * ROW + 0.95
    figure = style.blank(width, height, title(found, "in its plane", mesh=False))
    shapes = [] if found.shapes is None else [_drawn(x[:, 1:]) for x in found.shapes.x]
    extents = [float(np.ptp(x, axis=0).max()) for x in shapes]
    for k, state in enumerate(found.states):
        row, column = divmod(k, columns)
        there = min(columns, len(found) - row * columns)
        left = 0.5 * width + (column - 0.5 * there) * CELL
        top = height - 0.45 - row * ROW
        box = np.array([left + 0.08, top - 1.3, CELL - 0.16, 1.26]) / ([width, height] * 2)
        axes = figure.add_axes(tuple(box))
        axes.set_axis_off()
        if shapes:
            half = 0.54 * max(extents[k], max(extents) / LARGER)
            draw_closed(axes, shapes[k], _colour(state), half)
        _caption(axes, state, found)
    occurring = {state.stable for state in found.states}
    handles = [
        style.entry(text, color=c, linewidth=1.8)
        for is_stable, text, c in KINDS
        if is_stable in occurring
    ]
    style.legend_below(figure, handles)
    return figure


def _caption(axes: Axes, state: PlanarState, found: PlanarStates) -> None:
    """Name, energy and index below a shape."""
    name = "\n".join(textwrap.wrap(state.name, 18))
    look: dict[str, Any] = {"va": "top", "transform": axes.transAxes}
    style.place_text(axes, (0.5, -0.02), name, fontsize=8.0, linespacing=1.15, **look)
    kind = f"index {'?' if state.index is None else state.index}"
    energy = state.energy if abs(state.energy) > _ZERO * factor(found.scale, "energy") else 0.0
    height = "$U\\,a/GJ$" if found.scale is None else "$U$"
    unit_name = "" if found.scale is None else f" {unit(found.scale, 'energy')}"
    lines = f"{height} = {energy:.5g}{unit_name}, {kind}"
    if state.turning == FOLDED and state.packing is not None:
        lines += f"\npacking {state.packing:.4f}"
    low = -0.28 if "\n" in name else -0.16
    style.place_text(axes, (0.5, low), lines, fontsize=7.2, color=_colour(state), **look)


def _colour(state: PlanarState) -> str:
    return STABLE if state.stable else UNSTABLE


def _drawn(x: Array) -> Array:
    """A smooth curve through vertices (n, 2); strands of an n-covered circle are moved apart."""
    away = x - x.mean(axis=0)
    radius = np.hypot(*away.T)
    turns = np.unwrap(np.arctan2(*away.T))
    if float(np.ptp(radius)) <= _ROUND * float(radius.mean()) and np.ptp(turns) > 2.1 * math.pi:
        x = strands_apart(x, APART)
    return closed_curve(x)
