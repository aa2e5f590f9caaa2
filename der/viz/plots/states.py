"""The states of a ring as one picture: each drawn above its energy, and the falls between them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import MaxNLocator

from der.records.states import RingState, States
from der.utils.checks import Array
from der.viz.plots.arrows import arc, bends, label_places
from der.viz.plots.style import (
    BAR,
    DPI,
    INK,
    QUIET,
    STABLE,
    TITLE,
    UNSTABLE,
    about,
    blank,
    legend_below,
)
from der.viz.projection import Camera, flat, seen

MOST = 14  # states in one picture, the lowest
COLUMN, NARROWEST, HEIGHT = 0.98, 5.2, 6.3  # inches
HALF_WIDTH = 0.1  # of a ribbon, over the ring's mean radius: exaggerated, to be seen
NODE, LETTERS = 11.5, 6.8  # points: size of a node and of the letters at an arrow
CLEAR = 12.0  # points from the middle of a node to an arrow of others
LARGER = 2.0  # small shapes are drawn, at most, over the scale of the largest
GRIP: dict[str, Any] = {
    "linestyle": "none",
    "marker": "D",
    "markersize": 4.6,
    "markerfacecolor": INK,
    "markeredgecolor": "white",
    "markeredgewidth": 0.8,
}
_ZERO = 1e-9  # GJ/a: rounding
APART = 0.22  # of the radius: how far the strands of a covered ring are drawn apart
TILT = math.radians(42.0)  # of the view off the normal of the plane closest to a shape
LIGHT = np.array([0.35, 0.45, 0.82])  # on paper: right, up, towards the reader


def figure_of_states(found: States) -> Figure:
    """A column for each state, lowest first: its picture, its name, and below it its energy.

    Arrows are the falls, with the energy that each releases.

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
    figure = blank((width, HEIGHT))
    figure.text(0.5, 0.97, _title(found), **TITLE)
    left, right = 0.68 / width, 1.0 - 0.12 / width
    row = figure.add_axes((left, 0.645, right - left, 0.3))
    graph = figure.add_axes((left, 0.085, right - left, 0.54))
    for panel in (row, graph):
        panel.set_xlim(-0.5, n - 0.5)
    _pictures(row, found, shown, (right - left) * width / n, 0.3 * HEIGHT)
    _graph(graph, found, shown)
    _legend(figure, found, shown)
    return figure


def _title(found: States) -> str:
    """Ring, section, grips and what is left out in one line."""
    free = found.gamma is None
    parts = about(found.ring, found.section)
    parts.append("free in space" if free else rf"in grips, $\gamma$ = {found.gamma:.4g} rad")
    if len(found) > MOST:
        parts.append(f"the lowest {MOST} of {len(found)} states")
    return BAR.join(parts)


# --- Pictures --------------------------------------------------------------------------------


def _pictures(
    row: Axes, found: States, shown: tuple[RingState, ...], wide: float, tall: float
) -> None:
    """The ring in each state, with its name, energy and index; ``wide``, ``tall``: inches."""
    top = tall / wide
    row.set_ylim(0.0, top)
    row.set_axis_off()
    written: dict[str, Any] = {"ha": "center", "linespacing": 1.1}
    for i, state in enumerate(shown):
        name = "\n".join(textwrap.wrap(state.name, max(13, int(13 * wide))))
        row.text(i, 0.47 / wide, name, va="center", fontsize=7.8, color=INK, **written)
        energy = state.energy if abs(state.energy) > _ZERO else 0.0
        kind = "stable" if state.stable else f"index {'?' if state.index is None else state.index}"
        text = f"$U$ = {energy:.4g}\n{kind}"
        row.text(i, 0.13 / wide, text, va="center", fontsize=7.0, color=_colour(state), **written)
    if found.shapes is None:
        return
    x, frames = found.shapes.x, found.shapes.frames
    ribbons, cameras, held = [], [], []
    for i, state in enumerate(shown):
        spread = _drawn_apart(x[i], state)
        radius = float(np.linalg.norm(np.diff(x[i], axis=0), axis=1).sum()) / (2.0 * math.pi)
        camera = _camera(spread)
        cameras.append(camera)
        half = len(spread) // 2  # the grips hold the edges 0 and N/2
        held.append(0.5 * (spread[[-1, half - 1]] + spread[[0, half]]))
        light = LIGHT @ np.stack([camera.right, camera.up, camera.towards])
        ribbons.append(
            seen(
                spread,
                frames[i, :, 0],
                HALF_WIDTH * radius,
                camera,
                grips=found.gamma is not None,
                light=light,
            )
        )
    spans = np.array([np.ptp(corners.reshape(-1, 2), axis=0) for corners, _ in ribbons])
    room = np.array([0.92, top - 0.78 / wide])
    each = (room / spans).min(axis=1)
    each = np.minimum(each, LARGER * each.min())
    for i, ((corners, colours), scale) in enumerate(zip(ribbons, each, strict=True)):
        both = corners.reshape(-1, 2)
        middle = (both.min(axis=0) + both.max(axis=0)) / 2.0
        place = np.array([i, 0.5 * (top + 0.7 / wide)])
        row.add_collection(
            PolyCollection(
                list(scale * (corners - middle) + place),
                facecolors=colours,
                edgecolors=colours,
                linewidths=0.2,
            )
        )
        if found.gamma is not None:
            spots = scale * (flat(held[i], cameras[i]) - middle) + place
            row.plot(*spots.T, **GRIP, zorder=4)


def _drawn_apart(x: Array, state: RingState) -> Array:
    """Vertices, with the strands of a ring that lies on itself moved apart, to be seen."""
    if state.covering is None or abs(state.covering) < 2:
        return x
    middle = x.mean(axis=0)
    turn = 2.0 * math.pi * np.arange(len(x))[:, None] / len(x)
    return middle + (x - middle) * (1.0 + APART * np.cos(turn))


def _camera(x: Array) -> Camera:
    """Directions to the reader, right and up: off the normal of the plane closest to a shape.

    The longest axis lies level; of two sides, the picture is seen from that of +E1, or else +E3.
    """
    right, up, normal = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2]
    if np.ptp(x @ right) < 1.02 * np.ptp(x @ up):  # round: any axis would do
        right = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
        size = float(np.linalg.norm(right))
        right = right / size if size > 0.1 else up
    normal = normal * (1.0 if normal @ (1.0, 0.3, 0.1) >= 0.0 else -1.0)
    up = np.cross(normal, right)
    towards = math.cos(TILT) * normal - math.sin(TILT) * up
    return Camera(towards, right, np.cross(towards, right))


# --- The graph -------------------------------------------------------------------------------


def _graph(panel: Axes, found: States, shown: tuple[RingState, ...]) -> None:
    """Nodes at their energies, arrows down."""
    energy = np.array([state.energy for state in shown])
    place = {state.name: (float(i), state.energy) for i, state in enumerate(shown)}
    low, high = float(energy.min()), float(energy.max())
    if high - low < 0.05 * abs(high):  # one level: how far it lies above a ring without strain
        low, high = min(low, 0.0), max(high, 0.0)
    span = (high - low) if high - low > _ZERO else 1.0
    panel.set_ylim(low - 0.09 * span, low + 1.08 * span)
    for i, state in enumerate(shown):
        panel.plot((i, i), (state.energy, panel.get_ylim()[1]), color="#ececec", lw=0.7, zorder=0)
    _arrows(panel, found, place)
    for name, (x, y) in place.items():
        _node(panel, x, y, found[name])
    panel.set_ylabel("energy  $U\\,a/GJ$", fontsize=9, color=INK)
    panel.yaxis.set_major_locator(MaxNLocator(7))
    panel.set_xticks([])
    panel.tick_params(labelsize=8, color=QUIET, labelcolor=INK, direction="in")
    panel.spines[["top", "right", "bottom"]].set_visible(False)
    panel.spines["left"].set_color(QUIET)


def _merged(
    found: States, place: Mapping[str, tuple[float, float]]
) -> Iterator[tuple[str, str, float]]:
    """Each pair of states between which the ring falls, once, with the energy released."""
    seen = set()
    for fall in found.transitions:
        if fall.end is None or fall.released is None:
            continue
        pair = (fall.start, fall.end)
        if pair not in seen and fall.start in place and fall.end in place:
            seen.add(pair)
            yield *pair, fall.released


def _arrows(panel: Axes, found: States, place: Mapping[str, tuple[float, float]]) -> None:
    """An arrow from each state to those it falls to, around other states, with what it releases.

    It is dashed between states of a ring that was cut, as it passes by others.
    """
    falls = list(_merged(found, place))
    names = list(place)
    nodes = panel.transData.transform(list(place.values()))
    pairs = [(names.index(start), names.index(end)) for start, end, _ in falls]
    extent = panel.get_window_extent()
    box = (np.array([extent.x0, extent.y0]), np.array([extent.x1, extent.y1]))
    radius = 0.5 * NODE * DPI / 72.0
    chosen = bends(nodes, pairs, CLEAR * DPI / 72.0, box)
    t = np.linspace(0.0, 1.0, 61)
    ways = [arc(nodes[a], nodes[b], rad, t) for (a, b), rad in zip(pairs, chosen, strict=True)]
    texts = [f"{released:#.3g}" for _, _, released in falls]
    half = [np.array([0.31 * len(text) + 0.2, 0.75]) * LETTERS * DPI / 72.0 for text in texts]
    places = label_places(nodes, ways, half, radius)
    for (start, end, _), rad in zip(falls, chosen, strict=True):
        arrow = FancyArrowPatch(
            place[start],
            place[end],
            connectionstyle=f"arc3,rad={rad}",
            arrowstyle="-|>",
            mutation_scale=9,
            shrinkA=8,
            shrinkB=8,
            linewidth=0.9,
            linestyle=(0, (5.0, 2.0)) if found[end].needs_cut else "-",
            color="#6f6f6f",
            zorder=2,
        )
        panel.add_patch(arrow)
    for text, at in zip(texts, places, strict=True):
        x, y = panel.transData.inverted().transform(at)
        panel.text(
            float(x),
            float(y),
            text,
            ha="center",
            va="center",
            fontsize=LETTERS,
            color=INK,
            bbox={"boxstyle": "round,pad=0.12", "facecolor": "white", "edgecolor": "none"},
            zorder=4,
        )


def _node(panel: Axes, x: float, y: float, state: RingState) -> None:
    """A state: filled where it is stable, else with its index in it; a square needs a cut."""
    colour = _colour(state)
    panel.plot(
        x,
        y,
        marker="s" if state.needs_cut else "o",
        markersize=NODE,
        markerfacecolor=colour if state.stable else "white",
        markeredgecolor=colour,
        markeredgewidth=1.5,
        zorder=5,
        clip_on=False,
    )
    text = "?" if state.index is None else str(state.index)
    panel.text(
        x,
        y,
        text,
        ha="center",
        va="center_baseline",
        fontsize=7.5,
        color="white" if state.stable else colour,
        zorder=6,
        clip_on=False,
    )


def _colour(state: RingState) -> str:
    return STABLE if state.stable else UNSTABLE


def _legend(figure: Figure, found: States, shown: tuple[RingState, ...]) -> None:
    """What nodes, lines and marks mean, of those that are there."""
    white = {"marker": "o", "markerfacecolor": "white", "markeredgecolor": UNSTABLE}
    kinds: list[tuple[str, dict[str, Any]]] = []
    if any(state.stable for state in shown):
        look = {"marker": "o", "markerfacecolor": STABLE, "markeredgecolor": STABLE}
        kinds.append(("minimum", look))
    if not all(state.stable for state in shown):
        kinds.append(("saddle, with its ways down", white))
    if any(state.needs_cut for state in shown):
        look = {"marker": "s", "markerfacecolor": "white", "markeredgecolor": INK}
        kinds.append(("square, dashed: of a ring cut, turned once and joined", look))
    handles = [
        Line2D([], [], linestyle="none", markersize=7, label=label, **look) for label, look in kinds
    ]
    if found.gamma is not None and found.shapes is not None:
        handles.append(Line2D([], [], label="grip", **GRIP))
    if any(fall.end is not None for fall in found.transitions):
        arrow: dict[str, Any] = {"color": "#6f6f6f", "linewidth": 0.9, "marker": ">"}
        label = "falls to, energy released  [GJ/a]"
        handles.append(Line2D([], [], label=label, markersize=4, **arrow))
    legend_below(figure, handles, fontsize=7.8)
