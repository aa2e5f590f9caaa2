"""The states of a ring as one picture: each above its energy, and what relaxes to what."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from der.records.states import RingState, States
from der.records.units import factor, unit
from der.utils.checks import Array
from der.viz.palette import INK, STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.plots.arrows import LETTERS, arc, bends, half_sizes, label_places
from der.viz.plots.rings import LARGER, box_middle, oblique, place_ribbon, strands_apart
from der.viz.ribbon import projected, quadrilaterals
from der.viz.titles import title

MOST = 14  # states in one picture, the lowest
COLUMN, NARROWEST, HEIGHT = 0.98, 5.2, 6.3  # inches
HALF_WIDTH = 0.1  # of a ribbon, over the ring's mean radius: exaggerated, to be seen
NODE = 11.5  # points: size of a node
CLEAR = 12.0  # points from the middle of a node to an arrow of others
GRIP = style.mark("D", 4.6, INK) | {"markeredgecolor": "white", "markeredgewidth": 0.8}
ARROW = "#6f6f6f"
APART = 0.22  # of the radius: how far the strands of an n-covered ring are drawn apart
LIGHT = np.array([0.35, 0.45, 0.82])  # on paper: right, up, towards the reader
_ZERO = 1e-9  # GJ/a: rounding


def draw(found: States) -> Figure:
    """A column for each state, lowest first: its shape, its name, and its energy in a graph.

    Arrows point to the states to which unstable ones relax, with the released energy.

    Raises
    ------
    ValueError
        If there is no state.
    """
    style.check_states("record", found)
    shown = found.states[:MOST]
    n = len(shown)
    width = max(NARROWEST, COLUMN * n + 0.9)
    place = "free ring" if found.gamma is None else f"in grips, γ = {found.gamma:.4g} rad"
    part = () if len(found) <= MOST else (f"the lowest {MOST} of {len(found)} states",)
    figure = style.blank(width, HEIGHT, title(found, place, *part, mesh=False))
    left, right = 0.68 / width, 1.0 - 0.12 / width
    row = figure.add_axes((left, 0.645, right - left, 0.3))
    graph = figure.add_axes((left, 0.085, right - left, 0.54))
    for axes in (row, graph):
        axes.set_xlim(-0.5, n - 0.5)
    wide = (right - left) * width / n  # inches of a column
    row.set_ylim(0.0, 0.3 * HEIGHT / wide)
    row.set_axis_off()
    for i, state in enumerate(shown):
        _caption(row, i, state, wide, _ZERO * factor(found.scale, "energy"))
    if found.shapes is not None:
        _draw_ribbons(row, found, shown, wide)
    _draw_graph(graph, found, shown)
    style.legend_below(figure, _entries(found, shown), fontsize=7.8)
    return figure


# --- Shapes ----------------------------------------------------------------------------------


def _caption(row: Axes, i: int, state: RingState, wide: float, zero: float) -> None:
    """Name, energy and index of a state; energies up to ``zero`` are rounding."""
    name = "\n".join(textwrap.wrap(state.name, max(13, int(13 * wide))))
    style.place_text(row, (i, 0.47 / wide), name, fontsize=7.8, linespacing=1.1)
    energy = state.energy if abs(state.energy) > zero else 0.0
    kind = f"index {'?' if state.index is None else state.index}"
    look = {"fontsize": 7.0, "linespacing": 1.1, "color": _colour(state)}
    style.place_text(row, (i, 0.13 / wide), f"$U$ = {energy:.4g}\n{kind}", **look)


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
    span = (high - low) if high - low > _ZERO * factor(found.scale, "energy") else 1.0
    axes.set_ylim(low - 0.09 * span, low + 1.08 * span)
    axes.vlines(range(len(shown)), energy, axes.get_ylim()[1], color="#ececec", lw=0.7, zorder=0)
    _draw_arrows(axes, found, {state.name: (i, state.energy) for i, state in enumerate(shown)})
    for i, state in enumerate(shown):
        _draw_node(axes, i, state)
    style.label_axes(axes, "", style.energy(found.scale), ticks=(0, 7))
    axes.set_xticks([])
    axes.spines["bottom"].set_visible(False)


def _merged(
    found: States, place: Mapping[str, tuple[float, float]]
) -> dict[tuple[str, str], float]:
    """The energy released between each pair of states of which the first relaxes to the second."""
    merged: dict[tuple[str, str], float] = {}
    for one in found.transitions:
        if one.end is not None and one.released is not None and {one.start, one.end} <= set(place):
            merged.setdefault((one.start, one.end), one.released)
    return merged


def _draw_arrows(axes: Axes, found: States, place: Mapping[str, tuple[float, float]]) -> None:
    """Draw an arrow from each state to those to which it relaxes, around other states.

    Arrows to states of the other frame class are dashed, because they cross other states.
    """
    merged = _merged(found, place)
    names = list(place)
    nodes = axes.transData.transform(list(place.values()))
    pairs = [(names.index(start), names.index(end)) for start, end in merged]
    box = axes.get_window_extent().get_points()
    chosen = bends(nodes, pairs, CLEAR * style.DPI / 72.0, (box[0], box[1]))
    arcs = [arc(nodes[a], nodes[b], bend) for (a, b), bend in zip(pairs, chosen, strict=True)]
    texts = [f"{released:#.3g}" for released in merged.values()]
    half = half_sizes(texts, style.DPI)
    places = label_places(nodes, arcs, half, 0.5 * NODE * style.DPI / 72.0)
    look: dict[str, Any] = {"shrinkA": 8, "shrinkB": 8, "linewidth": 0.9, "color": ARROW}
    look |= {"arrowstyle": "-|>", "mutation_scale": 9, "zorder": 2}
    for (start, end), bend in zip(merged, chosen, strict=True):
        look["linestyle"] = (0, (5.0, 2.0)) if found[end].needs_cut else "-"
        look["connectionstyle"] = f"arc3,rad={bend}"
        axes.add_patch(FancyArrowPatch(place[start], place[end], **look))
    box_look = {"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"}
    for text, at in zip(texts, axes.transData.inverted().transform(places), strict=True):
        style.place_text(axes, at, text, fontsize=LETTERS, zorder=4, bbox=box_look)


def _draw_node(axes: Axes, x: float, state: RingState) -> None:
    """Draw a state with its index: filled where stable, a square in the other frame class."""
    colour = _colour(state)
    face, letter = (colour, "white") if state.stable else ("white", colour)
    look = style.mark("s" if state.needs_cut else "o", NODE, face)
    look |= {"markeredgecolor": colour, "markeredgewidth": 1.5}
    axes.plot(x, state.energy, zorder=5, clip_on=False, **look)
    text = {"va": "center_baseline", "fontsize": 7.5, "color": letter, "zorder": 6}
    index = "?" if state.index is None else str(state.index)
    style.place_text(axes, (x, state.energy), index, clip_on=False, **text)


def _colour(state: RingState) -> str:
    return STABLE if state.stable else UNSTABLE


def _entries(found: States, shown: tuple[RingState, ...]) -> list[Any]:
    """What nodes, lines and marks mean, of those that occur."""
    stable = style.mark("o", 7, STABLE) | {"markeredgecolor": STABLE}
    unstable = style.mark("o", 7) | {"markeredgecolor": UNSTABLE}
    other = "square, dashed: of a ring cut, twisted by one turn and joined"
    arrow = {"color": ARROW, "linewidth": 0.9, "marker": ">", "markersize": 4}
    entries: list[tuple[bool, str, dict[str, Any]]] = [
        (
            any(state.stable for state in shown),
            "stable as a free ring" if found.gamma is None else "stable at fixed γ",
            stable,
        ),
        (not all(state.stable for state in shown), "unstable, with its index", unstable),
        (any(state.needs_cut for state in shown), other, style.mark("s", 7)),
        (found.gamma is not None and found.shapes is not None, "grip", GRIP),
        (
            any(one.end is not None for one in found.transitions),
            f"relaxes to, energy released  [{unit(found.scale, 'energy')}]",
            arrow,
        ),
    ]
    return [style.entry(label, **look) for occurs, label, look in entries if occurs]
