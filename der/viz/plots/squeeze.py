"""A ring squeezed in its plane: force and energy over the distance of two points, and shapes."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.records.planar import Squeeze
from der.utils.checks import Array
from der.viz.curve import arc_length, evenly
from der.viz.palette import INK, STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.plots.rings import closed_curve, draw_closed
from der.viz.titles import title

LETTERS = "ABCDEF"  # one for each shape
NAMES = {"fold": "fold of the distance", "limit": "limit of the force", "branch": "branch point"}
LINE: dict[bool, dict[str, Any]] = {  # by whether it is stable
    stable: {"color": colour, "linewidth": 1.6}
    for stable, colour in ((True, STABLE), (False, UNSTABLE))
}


def draw(found: Squeeze) -> Figure:
    """The picture of a ring that is squeezed or pulled in its plane.

    Raises
    ------
    ValueError
        If there is no state.
    """
    style.check_states("record", found)
    pulled = found.distance[-1] > found.distance[0]
    figure = style.blank(7.6, 5.6, title(found, "pulled" if pulled else "squeezed", mesh=False))
    chosen = _chosen(found)
    if found.shapes is not None:
        _draw_shapes(figure, found, found.shapes.x[chosen][:, :, 1:], chosen)
    force = style.quantity(found.scale, "force", "F", "force")
    for left, values, label in (
        (0.095, found.force, force),
        (0.59, found.energy, style.energy(found.scale)),
    ):
        axes = figure.add_axes((left, 0.13, 0.385, 0.45))
        _draw_values(axes, found, values, label)
        places = np.column_stack([found.distance, values])
        style.place_letters(axes, LETTERS, places[chosen], places)
    kinds = dict.fromkeys(point.kind for point in found.points)
    handles = [style.entry(NAMES[kind], **style.mark(*style.MARKS[kind])) for kind in kinds]
    handles.append(style.entry("stable at fixed distance", **LINE[True]))
    if any(index != 0 for index in found.index):
        handles.append(style.entry("unstable at fixed distance", **LINE[False]))
    style.legend_below(figure, handles)
    return figure


def _chosen(found: Squeeze) -> list[int]:
    """States that are drawn: evenly along the curve of energy over distance."""
    values = np.column_stack([found.distance, found.energy])
    spans = np.maximum(np.ptp(values, axis=0), 1e-300)
    return evenly(arc_length(values / spans), min(len(LETTERS), len(found)))


def _draw_shapes(figure: Figure, found: Squeeze, x: Array, chosen: list[int]) -> None:
    """Draw shapes x (k, N, 2) in one scale, with the two points."""
    half = 0.55 * float(np.ptp(x, axis=1).max())
    share = 0.94 / len(chosen)
    distance = "$d/a$" if found.scale is None else "$d$"
    for k, (at, one) in enumerate(zip(chosen, x, strict=True)):
        axes = figure.add_axes((0.03 + share * k, 0.63, share, 0.3))
        draw_closed(axes, closed_curve(one), LINE[found.index[at] == 0]["color"], half)
        spots = 0.5 * (one + np.roll(one, 1, axis=0))[[0, len(one) // 2]]
        axes.plot(*spots.T, "o", color=INK, markersize=4.0, zorder=4)
        text = rf"$\bf{{{LETTERS[k]}}}$   {distance} = {found.distance[at]:.3g}"
        look = {"va": "top", "fontsize": 8, "transform": axes.transAxes}
        style.place_text(axes, (0.5, -0.02), text, **look)


def _draw_values(axes: Axes, found: Squeeze, values: Array, label: str) -> None:
    """Draw a quantity over the distance, with special points marked."""
    stable = np.array([index == 0 for index in found.index])
    axes.plot(found.distance, values, **LINE[True])
    axes.plot(found.distance, np.where(stable, np.nan, values), **LINE[False])
    if values.min() < 0.0 < values.max() or not values[0]:
        style.zero_line(axes)
    for point in found.points:
        value = point.force if values is found.force else point.energy
        axes.plot(point.distance, value, zorder=5, **style.mark(*style.MARKS[point.kind]))
    style.label_axes(
        axes,
        style.quantity(found.scale, "distance of the points", "d", "length"),
        label,
        ticks=(6, 6),
    )
