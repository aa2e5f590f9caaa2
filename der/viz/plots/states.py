"""The states of a ring as one picture: each above its energy, and what relaxes to what."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import MaxNLocator

from der.records.states import RingState, States
from der.utils.checks import Array
from der.viz.palette import INK, STABLE, UNSTABLE
from der.viz.plots.arrows import LETTERS, arc, bends, half_sizes, label_places
from der.viz.plots.rings import LARGER, box_middle, oblique, place_ribbon, strands_apart
from der.viz.plots.style import DPI, ENERGY, blank, entry, label_axes, legend_below
from der.viz.ribbon import projected, quadrilaterals
from der.viz.titles import title

MOST = 14  # states in one picture, the lowest
COLUMN, NARROWEST, HEIGHT = 0.98, 5.2, 6.3  # inches
HALF_WIDTH = 0.1  # of a ribbon, over the ring's mean radius: exaggerated, to be seen
NODE = 11.5  # points: size of a node
CLEAR = 12.0  # points from the middle of a node to an arrow of others
GRIP: dict[str, Any] = {
    "linestyle": "none",
    "marker": "D",
    "markersize": 4.6,
    "markerfacecolor": INK,
    "markeredgecolor": "white",
    "markeredgewidth": 0.8,
}
ARROW = "#6f6f6f"
APART = 0.22  # of the radius: how far the strands of an n-covered ring are drawn apart
LIGHT = np.array([0.35, 0.45, 0.82])  # on paper: right, up, towards the reader
_ZERO = 1e-9  # GJ/a: rounding


def draw(found: States) -> Figure:
    """A column for each state, lowest first: its shape, its name, and below it its energy.

    Arrows lead to the states to which unstable ones relax, with the energy that is released.

    Raises
    ------
    ValueError
        If there is no state.
    """
    if not len(found):
        raise ValueError("states must be at least one to be plotted, got none")
    shown = found.states[:MOST]
    n = len(shown)
    width = max(NARROWEST, COLUMN * n + 0.9)
    place = "free ring" if found.gamma is None else f"in grips, γ = {found.gamma:.4g} rad"
    part = () if len(found) <= MOST else (f"the lowest {MOST} of {len(found)} states",)
    figure = blank(width, HEIGHT, title(found, place, *part, mesh=False))
    left, right = 0.68 / width, 1.0 - 0.12 / width
    row = figure.add_axes((left, 0.645, right - left, 0.3))
    graph = figure.add_axes((left, 0.085, right - left, 0.54))
    for axes in (row, graph):
        axes.set_xlim(-0.5, n - 0.5)
    wide = (right - left) * width / n  # inches of a column
    row.set_ylim(0.0, 0.3 * HEIGHT / wide)
    row.set_axis_off()
    for i, state in enumerate(shown):
        _caption(row, i, state, wide)
    if found.shapes is not None:
        _draw_ribbons(row, found, shown, wide)
    _draw_graph(graph, found, shown)
    legend_below(figure, _entries(found, shown), fontsize=7.8)
    return figure


# --- Shapes ----------------------------------------------------------------------------------


def _caption(row: Axes, i: int, state: RingState, wide: float) -> None:
    """Name, energy and index of a state."""
    look: dict[str, Any] = {"ha": "center", "va": "center", "linespacing": 1.1}
    name = "\n".join(textwrap.wrap(state.name, max(13, int(13 * wide))))
    row.text(i, 0.47 / wide, name, fontsize=7.8, color=INK, **look)
    energy = state.energy if abs(state.energy) > _ZERO else 0.0
    kind = "stable" if state.stable else f"index {'?' if state.index is None else state.index}"
    text = f"$U$ = {energy:.4g}\n{kind}"
    row.text(i, 0.13 / wide, text, fontsize=7.0, color=_colour(state), **look)


def _draw_ribbons(row: Axes, found: States, shown: tuple[RingState, ...], wide: float) -> None:
    """Draw the ring in each state, with its grips; ``wide``: inches of a column."""
    top = row.get_ylim()[1]
    pictures = [_ribbon(found, i, state) for i, state in enumerate(shown)]
    spans = np.array([np.ptp(corners.reshape(-1, 2), axis=0) for (corners, _), _ in pictures])
    scales = (np.array([0.92, top - 0.78 / wide]) / spans).min(axis=1)
    scales = np.minimum(scales, LARGER * scales.min())
    for i, ((ribbon, grips), scale) in enumerate(zip(pictures, scales, strict=True)):
        at = (float(i), 0.5 * (top + 0.7 / wide))
        place_ribbon(row, ribbon, at, scale)
        if found.gamma is not None:
            spots = scale * (grips - box_middle(ribbon[0])) + np.array(at)
            row.plot(*spots.T, **GRIP, zorder=4)


def _ribbon(found: States, i: int, state: RingState) -> tuple[tuple[Array, Array], Array]:
    """Quadrilaterals and colours of a state's ribbon, and its grips (2, 2), as they are seen."""
    assert found.shapes is not None
    x, d1 = found.shapes.x[i], found.shapes.frames[i, :, 0]
    radius = float(np.linalg.norm(np.diff(x, axis=0), axis=1).sum()) / (2.0 * math.pi)
    if state.covering is not None and abs(state.covering) > 1:
        x = strands_apart(x, APART)
    camera, gripped = oblique(x), found.gamma is not None
    light = LIGHT @ np.stack([camera.right, camera.up, camera.towards])
    width = HALF_WIDTH * radius
    ribbon = quadrilaterals(x, d1, width, camera, grips=gripped, light=light)
    half = len(x) // 2  # the grips hold the edges 0 and N/2
    return ribbon, projected(0.5 * (x[[-1, half - 1]] + x[[0, half]]), camera)


# --- The graph -------------------------------------------------------------------------------


def _draw_graph(axes: Axes, found: States, shown: tuple[RingState, ...]) -> None:
    """Draw nodes at their energies, and arrows down."""
    energy = np.array([state.energy for state in shown])
    low, high = float(energy.min()), float(energy.max())
    if high - low < 0.05 * abs(high):  # one level: how far it lies above a ring without strain
        low, high = min(low, 0.0), max(high, 0.0)
    span = (high - low) if high - low > _ZERO else 1.0
    axes.set_ylim(low - 0.09 * span, low + 1.08 * span)
    axes.vlines(range(len(shown)), energy, axes.get_ylim()[1], color="#ececec", lw=0.7, zorder=0)
    _draw_arrows(axes, found, {state.name: (i, state.energy) for i, state in enumerate(shown)})
    for i, state in enumerate(shown):
        _draw_node(axes, i, state)
    label_axes(axes, "", ENERGY)
    axes.yaxis.set_major_locator(MaxNLocator(7))
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)


def _merged(
    found: States, place: Mapping[str, tuple[float, float]]
) -> Iterator[tuple[str, str, float]]:
    """Each pair of states of which the first relaxes to the second, and the energy released."""
    seen = set()
    for one in found.transitions:
        if one.end is None or one.released is None:
            continue
        pair = (one.start, one.end)
        if pair not in seen and one.start in place and one.end in place:
            seen.add(pair)
            yield *pair, one.released


def _draw_arrows(axes: Axes, found: States, place: Mapping[str, tuple[float, float]]) -> None:
    """Draw an arrow from each state to those it relaxes to, around other states.

    Arrows between states of the other frame class are dashed, as they pass by others.
    """
    merged = list(_merged(found, place))
    names = list(place)
    nodes = axes.transData.transform(list(place.values()))
    pairs = [(names.index(start), names.index(end)) for start, end, _ in merged]
    extent = axes.get_window_extent()
    box = (np.array([extent.x0, extent.y0]), np.array([extent.x1, extent.y1]))
    chosen = bends(nodes, pairs, CLEAR * DPI / 72.0, box)
    arcs = [arc(nodes[a], nodes[b], bend) for (a, b), bend in zip(pairs, chosen, strict=True)]
    texts = [f"{released:#.3g}" for _, _, released in merged]
    places = label_places(nodes, arcs, half_sizes(texts, DPI), 0.5 * NODE * DPI / 72.0)
    for (start, end, _), bend in zip(merged, chosen, strict=True):
        look: dict[str, Any] = {"shrinkA": 8, "shrinkB": 8, "linewidth": 0.9, "color": ARROW}
        look |= {"arrowstyle": "-|>", "mutation_scale": 9, "zorder": 2}
        look |= {"linestyle": (0, (5.0, 2.0)) if found[end].needs_cut else "-"}
        style = f"arc3,rad={bend}"
        axes.add_patch(FancyArrowPatch(place[start], place[end], connectionstyle=style, **look))
    for text, at in zip(texts, places, strict=True):
        x, y = axes.transData.inverted().transform(at)
        box_look = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"}
        look = {"ha": "center", "va": "center", "fontsize": LETTERS, "color": INK, "zorder": 4}
        axes.text(float(x), float(y), text, bbox=box_look, **look)


def _look(state: RingState) -> dict[str, Any]:
    """How a node is drawn: filled where it is stable, a square in the other frame class."""
    colour = _colour(state)
    return {
        "marker": "s" if state.needs_cut else "o",
        "markerfacecolor": colour if state.stable else "white",
        "markeredgecolor": colour,
        "markeredgewidth": 1.5,
    }


def _draw_node(axes: Axes, x: float, state: RingState) -> None:
    """Draw a state with its index in it."""
    axes.plot(x, state.energy, markersize=NODE, zorder=5, clip_on=False, **_look(state))
    axes.text(
        x,
        state.energy,
        "?" if state.index is None else str(state.index),
        ha="center",
        va="center_baseline",
        fontsize=7.5,
        color="white" if state.stable else _colour(state),
        zorder=6,
        clip_on=False,
    )


def _colour(state: RingState) -> str:
    return STABLE if state.stable else UNSTABLE


def _entries(found: States, shown: tuple[RingState, ...]) -> list[Any]:
    """What nodes, lines and marks mean, of those that are there."""
    circle: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 7}
    filled = {"markerfacecolor": STABLE, "markeredgecolor": STABLE}
    open_ = {"markerfacecolor": "white", "markeredgecolor": UNSTABLE}
    kind = "stable as a free ring" if found.gamma is None else "stable at fixed γ"
    handles = []
    if any(state.stable for state in shown):
        handles.append(entry(kind, **circle | filled))
    if not all(state.stable for state in shown):
        handles.append(entry("unstable, with its index", **circle | open_))
    if any(state.needs_cut for state in shown):
        look = circle | open_ | {"marker": "s", "markeredgecolor": INK}
        handles.append(
            entry("square, dashed: of a ring cut, twisted by one turn and joined", **look)
        )
    if found.gamma is not None and found.shapes is not None:
        handles.append(entry("grip", **GRIP))
    if any(one.end is not None for one in found.transitions):
        arrow: dict[str, Any] = {"color": ARROW, "linewidth": 0.9, "marker": ">", "markersize": 4}
        handles.append(entry("relaxes to, energy released  [GJ/a]", **arrow))
    return handles
