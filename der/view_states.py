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

from der.checks import Array
from der.projection import Camera, seen
from der.states_record import RingState, States
from der.view_style import BAR, DPI, INK, QUIET, STABLE, TITLE, UNSTABLE, about, blank

MOST = 14  # states in one picture, the lowest
COLUMN, NARROWEST, HEIGHT = 0.98, 5.2, 6.3  # inches
HALF_WIDTH = 0.1  # of a ribbon, over the ring's mean radius: exaggerated, to be seen
SAG = 0.3  # inches: an arrow below its chord, at most
LARGER = 2.0  # small shapes are drawn, at most, over the scale of the largest
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
    _legend(figure, shown)
    return figure


def _title(found: States) -> str:
    """Ring, section, grips and what is left out in one line."""
    free = found.gamma is None
    parts = about(found.ring, found.section)
    parts.append("free in space" if free else rf"in grips, $\gamma$ = {found.gamma:.4g}")
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
    ribbons = []
    for i, state in enumerate(shown):
        spread = _drawn_apart(x[i], state)
        radius = float(np.linalg.norm(np.diff(x[i], axis=0), axis=1).sum()) / (2.0 * math.pi)
        camera = _camera(spread)
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
        flat = corners.reshape(-1, 2)
        middle = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
        place = np.array([i, 0.5 * (top + 0.7 / wide)])
        row.add_collection(
            PolyCollection(
                list(scale * (corners - middle) + place),
                facecolors=colours,
                edgecolors=colours,
                linewidths=0.2,
            )
        )


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
    span = max(float(np.ptp(energy)), 1e-9 + 0.05 * abs(float(energy.max())), 1e-6)
    panel.set_ylim(float(energy.min()) - 0.09 * span, float(energy.max()) + 0.08 * span)
    for i, state in enumerate(shown):
        panel.plot((i, i), (state.energy, panel.get_ylim()[1]), color="#ececec", lw=0.7, zorder=0)
    nodes = panel.transData.transform(list(place.values()))
    labels = [(float(x), float(y)) for x, y in nodes]
    for k, (start, end, released) in enumerate(_merged(found, place)):
        _arrow(panel, place[start], place[end], released, labels, k, of_cut=found[end].needs_cut)
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


def _arrow(
    panel: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    released: float,
    labels: list[tuple[float, float]],
    order: int,
    *,
    of_cut: bool,
) -> None:
    """An arrow from a state to the one it falls to; its label goes where there is most room.

    It is dashed between states of a ring that was cut, as it passes by others.
    """
    to_pixels = panel.transData.transform
    a, b = to_pixels(start), to_pixels(end)
    deepest = 2.0 * SAG * DPI / max(math.hypot(*(b - a)), 1.0)
    bend = min(0.16 if order % 2 else 0.1, deepest)
    arrow = FancyArrowPatch(
        start,
        end,
        connectionstyle=f"arc3,rad={-bend}",
        arrowstyle="-|>",
        mutation_scale=9,
        shrinkA=8,
        shrinkB=8,
        linewidth=0.9,
        linestyle=(0, (5.0, 2.0)) if of_cut else "-",
        color="#6f6f6f",
        zorder=2,
    )
    panel.add_patch(arrow)
    # the curve of arc3: a parabola whose control point is rad times the chord off its middle
    control = 0.5 * (a + b) - bend * np.array([b[1] - a[1], a[0] - b[0]])
    best, room = None, -1.0
    for t in (0.3, 0.24, 0.36, 0.42, 0.18, 0.5, 0.58):
        at = (1 - t) ** 2 * a + 2 * t * (1 - t) * control + t**2 * b
        free = min((math.hypot(*(at - np.array(o)) * (0.4, 1.0)) for o in labels), default=99.0)
        if free > room + 1.0:
            best, room = at, free
        if room > 24.0:
            break
    if best is None:
        return
    labels.append((float(best[0]), float(best[1])))
    x, y = panel.transData.inverted().transform(best)
    panel.text(
        float(x),
        float(y),
        f"{released:.3g}",
        ha="center",
        va="center",
        fontsize=6.8,
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
        markersize=11.5,
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


def _legend(figure: Figure, shown: tuple[RingState, ...]) -> None:
    kinds: list[tuple[str, dict[str, Any]]] = [
        ("minimum", {"marker": "o", "markerfacecolor": STABLE, "markeredgecolor": STABLE}),
        (
            "saddle, with its ways down",
            {"marker": "o", "markerfacecolor": "white", "markeredgecolor": UNSTABLE},
        ),
    ]
    if any(state.needs_cut for state in shown):
        look = {"marker": "s", "markerfacecolor": "white", "markeredgecolor": INK}
        kinds.append(("square, dashed: of a ring cut, turned once and joined", look))
    handles = [
        Line2D([], [], linestyle="none", markersize=7, label=label, **look) for label, look in kinds
    ]
    arrow: dict[str, Any] = {"color": "#6f6f6f", "linewidth": 0.9, "marker": ">", "markersize": 4}
    handles.append(Line2D([], [], label="falls to, energy released", **arrow))
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.004),
        ncols=len(handles),
        frameon=False,
        fontsize=7.8,
        columnspacing=1.6,
        handletextpad=0.5,
        labelcolor=INK,
    )
