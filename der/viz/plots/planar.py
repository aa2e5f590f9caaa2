"""Pictures of a ring that stays in its plane: its states side by side, or how it is squeezed."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from der.records.planar import FOLDED, PlanarState, PlanarStates, Squeeze
from der.utils.checks import Array
from der.viz.plots.style import (
    BAR,
    INK,
    QUIET,
    STABLE,
    TITLE,
    UNSTABLE,
    about,
    blank,
    dress,
    legend_below,
)

COLUMNS = 6  # at most
CELL, ROW = 1.55, 1.95  # inches, of a state
APART = 0.16  # of the radius: how far the strands of a covered ring are drawn apart
LARGER = 2.0  # small shapes are drawn, at most, over the scale of the largest
SHOWN = 6  # shapes along a path
_ROUND, _ZERO = 1e-6, 1e-9  # of the radius; GJ/a: rounding
MARKS = {"fold": "s", "limit": "D", "branch": "^"}
NAMES = {"fold": "fold of the distance", "limit": "limit of the force", "branch": "branch point"}


def figure_of_planar(found: PlanarStates | Squeeze) -> Figure:
    """The states of a ring in its plane, or the curve of squeezing it, with shapes.

    Raises
    ------
    ValueError
        If there is no state.
    """
    if not len(found):
        raise ValueError("states must be at least one to be plotted, got none")
    return _of_states(found) if isinstance(found, PlanarStates) else _of_squeeze(found)


# --- States ----------------------------------------------------------------------------------


def _of_states(found: PlanarStates) -> Figure:
    rows = math.ceil(len(found) / COLUMNS)
    columns = math.ceil(len(found) / rows)
    width, height = max(columns * CELL, 5.4) + 0.3, rows * ROW + 0.95
    figure = blank((width, height))
    figure.text(0.5, 1.0 - 0.2 / height, _title(found, "in its plane"), **TITLE)
    shapes = [] if found.shapes is None else [_drawn_apart(x[:, 1:]) for x in found.shapes.x]
    extents = [float(np.ptp(x, axis=0).max()) for x in shapes]
    for k, state in enumerate(found.states):
        row, column = divmod(k, columns)
        there = min(columns, len(found) - row * columns)
        left = 0.5 * width + (column - 0.5 * there) * CELL
        top = height - 0.45 - row * ROW
        panel = figure.add_axes(
            ((left + 0.08) / width, (top - 1.3) / height, (CELL - 0.16) / width, 1.26 / height)
        )
        if shapes:
            _curve(panel, shapes[k], _colour(state.index))
            _frame(panel, shapes[k], 0.54 * max(extents[k], max(extents) / LARGER))
        _say(panel, state)
    _legend(figure, found)
    return figure


def _say(panel: Axes, state: PlanarState) -> None:
    """Name, energy and index below a shape."""
    panel.set_axis_off()
    kind = "stable" if state.stable else f"index {'?' if state.index is None else state.index}"
    name = "\n".join(textwrap.wrap(state.name, 18))
    text: dict[str, Any] = {"ha": "center", "va": "top", "transform": panel.transAxes}
    panel.text(0.5, -0.02, name, fontsize=8.0, color=INK, linespacing=1.15, **text)
    energy = state.energy if abs(state.energy) > _ZERO else 0.0
    lines = f"$U$ = {energy:.5g}, {kind}"
    if state.turning == FOLDED and state.packing is not None:
        lines += f"\npacking {state.packing:.4f}"
    low = -0.28 if "\n" in name else -0.16
    panel.text(0.5, low, lines, fontsize=7.2, color=_colour(state.index), **text)


def _colour(index: int | None) -> str:
    return STABLE if index == 0 else UNSTABLE


def _drawn_apart(x: Array) -> Array:
    """Vertices (n, 2), with the strands of a circle moved apart where it is covered twice or more.

    It is where its vertices turn more than once about the middle.
    """
    away = x - x.mean(axis=0)
    radius = np.hypot(*away.T)
    turns = np.unwrap(np.arctan2(*away.T))
    if float(np.ptp(radius)) > _ROUND * float(radius.mean()) or np.ptp(turns) < 2.1 * math.pi:
        return x
    turn = 2.0 * math.pi * np.arange(len(x))[:, None] / len(x)
    return np.asarray(x + APART * away * np.cos(turn))


def _curve(panel: Axes, x: Array, colour: str) -> None:
    """A closed curve."""
    panel.add_patch(Polygon(x, fill=False, edgecolor=colour, lw=1.6, joinstyle="round"))


def _frame(panel: Axes, shape: Array, half: float) -> None:
    """Equal scales, the middle of the shape in that of the panel, ``half`` to its sides."""
    panel.set_aspect("equal")
    middle = 0.5 * (shape.min(axis=0) + shape.max(axis=0))
    panel.set_xlim(middle[0] - half, middle[0] + half)
    panel.set_ylim(middle[1] - half, middle[1] + half)


def _legend(figure: Figure, found: PlanarStates) -> None:
    kinds = {"stable in its plane": STABLE, "not stable": UNSTABLE}
    there = {
        "stable in its plane": any(state.stable for state in found.states),
        "not stable": not all(state.stable for state in found.states),
    }
    handles = [
        Line2D([], [], color=colour, lw=1.8, label=name)
        for name, colour in kinds.items()
        if there[name]
    ]
    legend_below(figure, handles)


def _title(found: PlanarStates | Squeeze, what: str) -> str:
    return BAR.join([*about(found.ring, found.section), what])


# --- Squeezed --------------------------------------------------------------------------------


def _of_squeeze(found: Squeeze) -> Figure:
    figure = blank((7.6, 5.6))
    pulled = found.distance[-1] > found.distance[0]
    figure.text(0.5, 0.965, _title(found, "pulled" if pulled else "squeezed"), **TITLE)
    chosen = _chosen(found)
    if found.shapes is not None:
        _shapes(figure, found, chosen)
    left = figure.add_axes((0.095, 0.13, 0.385, 0.45))
    right = figure.add_axes((0.59, 0.13, 0.385, 0.45))
    _column(left, found, found.force, "force  $F\\,a^2/GJ$", chosen)
    _column(right, found, found.energy, "energy  $U\\,a/GJ$", chosen)
    seen = dict.fromkeys(point.kind for point in found.points)
    look: dict[str, Any] = {"linestyle": "none", "markersize": 5, "color": UNSTABLE}
    handles = [Line2D([], [], marker=MARKS[kind], label=NAMES[kind], **look) for kind in seen]
    handles.append(Line2D([], [], color=STABLE, lw=1.6, label="stable at this distance"))
    if any(index != 0 for index in found.index):
        handles.append(Line2D([], [], color=UNSTABLE, lw=1.6, label="not stable"))
    legend_below(figure, handles)
    return figure


def _chosen(found: Squeeze) -> list[int]:
    """States that are drawn: evenly along the curve of energy over distance."""
    spans = [max(float(np.ptp(c)), 1e-300) for c in (found.distance, found.energy)]
    steps = np.hypot(np.diff(found.distance) / spans[0], np.diff(found.energy) / spans[1])
    along = np.append(0.0, np.cumsum(steps))
    wanted = np.linspace(0.0, along[-1], min(SHOWN, len(found)))
    return sorted({int(np.argmin(np.abs(along - place))) for place in wanted})


def _shapes(figure: Figure, found: Squeeze, chosen: list[int]) -> None:
    """The ring at some states, all to one scale, with the two points."""
    shapes = found.shapes
    if shapes is None:
        return
    x = shapes.x[chosen][:, :, 1:]
    half = 0.55 * float(max(np.ptp(x[:, :, 0]), np.ptp(x[:, :, 1])))
    for k, one in enumerate(x):
        panel = figure.add_axes((0.03 + 0.94 * k / len(chosen), 0.63, 0.94 / len(chosen), 0.3))
        panel.set_axis_off()
        _curve(panel, one, _colour(found.index[chosen[k]]))
        spots = 0.5 * (one + np.roll(one, 1, axis=0))[[0, len(one) // 2]]
        panel.plot(*spots.T, "o", color=INK, ms=4.0, zorder=4)
        _frame(panel, one, half)
        text = f"{chr(97 + k)}:  {found.distance[chosen[k]]:.3g} $a$"
        panel.text(0.5, -0.02, text, ha="center", va="top", fontsize=8, transform=panel.transAxes)


def _column(panel: Axes, found: Squeeze, values: Array, label: str, chosen: list[int]) -> None:
    """A quantity over the distance, special points and the shapes drawn marked."""
    stable = np.array([index == 0 for index in found.index])
    panel.plot(found.distance, values, color=STABLE, lw=1.6)
    unstable = np.where(stable, np.nan, values)
    panel.plot(found.distance, unstable, color=UNSTABLE, lw=1.6)
    if values.min() < 0.0 < values.max() or not values[0]:
        panel.axhline(0.0, color=QUIET, lw=0.6, zorder=0)
    aside = -6 if float(np.polyfit(found.distance, values, 1)[0]) > 0.0 else 6
    for k, at in enumerate(chosen):
        panel.plot(found.distance[at], values[at], "o", ms=3.6, color=INK, zorder=4)
        panel.annotate(
            chr(97 + k),
            (found.distance[at], values[at]),
            (aside, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color=INK,
        )
    for point in found.points:
        value = point.force if values is found.force else point.energy
        panel.plot(point.distance, value, MARKS[point.kind], ms=5, color=UNSTABLE, zorder=5)
    dress(panel, label)
    panel.set_xlabel("distance of the points  [$a$]", fontsize=9, color=INK)
    panel.xaxis.set_major_locator(MaxNLocator(6))
    panel.yaxis.set_major_locator(MaxNLocator(6))
