"""How loads open a folded ring: rings under their loads, curves of the loads, and their work."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from der.records.opening import ALIKE, EVENTS, KINDS, LeastPush, Push
from der.records.units import unit
from der.utils.checks import Array
from der.viz.palette import DASHES, FREE, INK, STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.plots.rings import bare, seen
from der.viz.ribbon import projected
from der.viz.titles import sure, title

COLOURS = {"force": STABLE, "couple": UNSTABLE}
MOST = 7  # loads of each kind whose work is shown
SHAPES = ("force", "couple", "force dead", "couple dead")
SYMBOLS = {"pass": "^", "fold": "D", "branch": "s", "limit": "v", "end": "X"}
MARKS = {name: style.mark(s, 5.2 if s in "Ds" else 6.2) for name, s in SYMBOLS.items()}  # of events
BEST_DEAD: dict[str, Any] = {"color": INK, "linewidth": 1.1, "linestyle": DASHES}
OTHERS: dict[str, Any] = {"color": "#d0d0d0", "linewidth": 0.8}
DEAD: dict[str, Any] = {"marker": "|", "markersize": 9, "color": INK, "linestyle": "none"}
ARROW = 0.15  # length of an arrow
WIDE, HIGH = 1.0, 0.5  # of the picture of one ring, in its own units


def draw(found: LeastPush) -> Figure:
    """The picture of opening loads: opening rings, loads over displacements, and the least work.

    Raises
    ------
    ValueError
        If no load opens the ring.
    """
    if not found.least:
        raise ValueError(f"push must open the ring to be plotted: {found.why}")
    figure = style.blank(9.2, 6.9, title(found))
    _draw_rings(figure.add_axes((0.01, 0.665, 0.98, 0.295)), found)
    kinds = [kind for kind in KINDS if kind in found.least]
    places = {1: [(0.17, 0.43)], 2: [(0.435, 0.195), (0.145, 0.195)]}[len(kinds)]
    for kind, (low, high) in zip(kinds, places, strict=True):
        _draw_curves(figure.add_axes((0.07, low, 0.31, high)), found, kind)
    ranked = {kind: _ranked(found, kind) for kind in kinds}
    _draw_works(figure.add_axes((0.64, 0.165, 0.345, 0.465)), found, ranked)
    style.legend_below(figure, _entries(found, ranked))
    return figure


def _entries(found: LeastPush, ranked: Mapping[str, list[Push]]) -> list[Any]:
    """What colours, lines and marks mean, of those that occur."""
    handles: list[Any] = []
    for kind, ones in ranked.items():
        count = f"best {MOST} of {len(ones)}" if len(ones) > MOST else f"all {len(ones)}"
        label = f"quasi-static {kind}, {count} that open the ring"
        handles.append(Patch(color=COLOURS[kind], alpha=0.75, label=label))
    best = [found.pushes[k].held for k in found.least.values()]
    dead = [found.pushes[k].dead for k in found.least_dead.values()]
    events = {instant.event for instant in (*best, *dead) if instant is not None}
    mesh, energy = " (mesh)" if found.extrapolated else "", unit(found.scale, "energy")
    entries: list[tuple[object, str, dict[str, Any]]] = [
        (True, "others that open the ring", OTHERS),
        (any(_dashed(found, kind) for kind in ranked), "the best dead load", BEST_DEAD),
        (
            found.barrier,
            f"barrier of the free ring, {found.barrier or 0.0:.4g} {energy}{mesh}",
            {"color": FREE, "linewidth": 1.5},
        ),
        *((name in events, text, MARKS[name]) for name, text in EVENTS.items()),
        (
            any(one.dead and one.opens_dead for ones in ranked.values() for one in ones[:MOST]),
            "work of the dead load at its limit",
            DEAD,
        ),
    ]
    return handles + [style.entry(text, **look) for occurs, text, look in entries if occurs]


# --- Rings -----------------------------------------------------------------------------------


def _draw_rings(row: Axes, found: LeastPush) -> None:
    """Draw the opening rings in one scale, with arrows at their loads."""
    shown = [name for name in SHAPES if name in found.shapes]
    shapes = [found.shapes[name] for name in shown]
    views = [seen(x, level=points[1] - points[0]) for x, points in shapes]
    row.set_axis_off()
    if not views:
        return
    widest, highest = np.max([np.ptp(view.line, axis=0) for view in views], axis=0)
    scale = min(0.6 * WIDE / widest, 0.86 * HIGH / highest)
    for i, (name, view) in enumerate(zip(shown, views, strict=True)):
        kind, _, dead = name.partition(" ")
        push = found.pushes[(found.least_dead if dead else found.least)[kind]]
        at = np.array([i * WIDE, 0.0])
        view.draw(row, scale, at, COLOURS[kind])
        points = found.shapes[name][1]
        ends = scale * (projected(points, view.camera) - view.middle) + at
        loads = projected(_loads(push, points), view.camera)
        _draw_arrows(row, ends, loads, heads=(1.0, 0.72) if kind == "couple" else (1.0,))
        caption, below = _caption(found, push, name), (i * WIDE, -0.5 * HIGH - 0.07)
        style.place_text(row, below, caption, va="top", fontsize=7.5, linespacing=1.35)
    bare(row, (-0.5 * WIDE, -0.5 * HIGH - 0.36), ((len(shown) - 0.5) * WIDE, 0.5 * HIGH + 0.04))


def _loads(push: Push, points: Array) -> Array:
    """Unit vectors (2, 3): of the forces, or of the axes of the couples."""
    pull = np.array(push.axis)
    if push.kind == "force":
        line = points[1] - points[0]
        pull = line / max(float(np.linalg.norm(line)), 1e-300)
        pull *= -1.0 if push.direction == "together" else 1.0
    return np.array([-pull, pull])


def _draw_arrows(row: Axes, at: Array, loads: Array, heads: tuple[float, ...]) -> None:
    """Arrows at points (2, 2): a force has one head, the axis of a couple has two."""
    longest = max(float(np.linalg.norm(loads, axis=1).max()), 1e-9)
    look: dict[str, Any] = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.1}
    look |= {"shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
    for place, along in zip(at, loads, strict=True):
        row.plot(*place, marker="o", markersize=3.4, color=INK, zorder=6)
        for share in heads:
            tip = place + share * ARROW / longest * along
            row.annotate("", tip, place, annotation_clip=False, arrowprops=look, zorder=7)


def _caption(found: LeastPush, push: Push, name: str) -> str:
    """The load, its points, the event at its end, and the work, extrapolated where known."""
    dead = name.endswith("dead")
    instant = push.dead if dead and push.dead is not None else push.held
    energy = unit(found.scale, "energy")
    work = f"work {instant.work:.4g} {energy}{' (mesh)' if found.extrapolated else ''}"
    if name in found.extrapolated:
        value = sure(*found.extrapolated[name])
        work = f"work {value} {energy}\nextrapolated (mesh {instant.work:.4g})"
    first = f"{'dead' if dead else 'quasi-static'} {push.kind}, {push.direction}"
    return "\n".join([first, _points(push), EVENTS[instant.event], work])


def _points(push: Push) -> str:
    first, second = push.points
    return f"s/L = {first:.3g}, {second:.3g}"


# --- Curves ----------------------------------------------------------------------------------


def _draw_curves(axes: Axes, found: LeastPush, kind: str) -> None:
    """Draw load over displacement of all loads that open the ring, the best on top."""
    best = found.pushes[found.least[kind]]
    at_limit = found.pushes[found.least_dead[kind]] if kind in found.least_dead else None
    for one in found.pushes:
        if one.kind == kind and one.opens and one not in (best, at_limit):
            axes.plot(*_line(one), zorder=1, **OTHERS)
    if at_limit is not None and _dashed(found, kind):
        axes.plot(*_line(at_limit), zorder=3, **BEST_DEAD | {"color": COLOURS[kind]})
    axes.plot(*_line(best), color=COLOURS[kind], linewidth=1.8, zorder=4)
    end = best.held
    axes.plot(end.push, end.load, zorder=6, clip_on=False, **MARKS[end.event])
    if at_limit is not None and (limit := at_limit.dead) is not None:
        axes.plot(limit.push, limit.load, zorder=6, **MARKS[limit.event])
    shown = [best] if at_limit is None else [best, at_limit]
    axes.set_ylim(0.0, 2.2 * max(one.peak for one in shown))
    axes.set_xlim(0.0, 1.7 * max(one.held.push for one in shown))
    style.label_axes(axes, *_labels(found, kind), ticks=(6, 5))
    axes.xaxis.labelpad = 2


def _labels(found: LeastPush, kind: str) -> tuple[str, str]:
    """Labels of the axes of displacement and load."""
    if kind == "couple":
        couple = style.quantity(found.scale, "couple", "C", "moment")
        return "angle  $\\theta$  [rad]", couple
    distance = style.quantity(found.scale, "change of distance", "\\Delta D", "length")
    return distance, style.quantity(found.scale, "force", "P", "force")


def _dashed(found: LeastPush, kind: str) -> bool:
    """Whether the best dead load is another one than the best quasi-static one."""
    return found.least_dead.get(kind, found.least[kind]) != found.least[kind]


def _line(push: Push) -> tuple[Array, Array]:
    """Load over displacement, smooth between the computed equilibria."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    x, load, _ = push.curve.T
    if len(x) < 3 or np.any(np.diff(x) <= 0.0):
        return x, load
    fine = np.linspace(x[0], x[-1], 120)
    through = PchipInterpolator if push.falls else CubicSpline  # at a snap there is a kink
    return fine, through(x, load)(fine)


# --- Works -----------------------------------------------------------------------------------


def _draw_works(axes: Axes, found: LeastPush, ranked: Mapping[str, list[Push]]) -> None:
    """Draw the work of the best loads as bars, and that of dead loads at their limits."""
    rows = [one for ones in ranked.values() for one in ones[:MOST]]
    place = np.arange(len(rows))[::-1].astype(float)
    place[: sum(one.kind == "force" for one in rows)] += 0.6
    for y, one in zip(place, rows, strict=True):
        axes.barh(y, one.held.work, height=0.66, color=COLOURS[one.kind], alpha=0.75, linewidth=0)
        if one.dead is not None and one.opens_dead:
            axes.plot(one.dead.work, y, zorder=4, **DEAD)
            continue
        text = "no limit of a dead load" if one.dead is None else "a dead load does not open it"
        look = {"va": "center_baseline", "fontsize": 6.5, "color": "white", "path_effects": []}
        style.annotate(axes, (0.0, y), text, (4.0, 0.0), **look)
    if found.barrier is not None:
        axes.axvline(found.barrier, color=FREE, linewidth=1.5, zorder=3)
    widest = max(one.held.work for one in rows)
    axes.set_xlim(0.0, 1.05 * min(widest, 2.0 * (found.barrier or math.inf)))
    style.label_axes(
        axes,
        style.quantity(found.scale, "work until the ring opens", "W", "energy"),
        "",
        ticks=(5, 0),
    )
    axes.set_yticks(place, [f"{_points(one)}  {one.direction}" for one in rows])
    axes.tick_params(axis="y", length=0, labelsize=7)
    axes.spines["left"].set_visible(False)
    axes.xaxis.labelpad = 2
    axes.grid(axis="x", color="#e8e8e8", linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)


def _ranked(found: LeastPush, kind: str) -> list[Push]:
    """Loads of a kind that open the ring, by work.

    Loads of nearly the same work are in the order: the best one; then by the number of snaps,
    places and directions.
    """
    best = found.pushes[found.least[kind]]
    opening = [one for one in found.pushes if one.kind == kind and one.opens]
    opening.sort(key=lambda one: one.held.work)
    start, starts = -math.inf, []  # least work of each group of nearly the same work
    for one in opening:
        start = start if one.held.work <= (1.0 + ALIKE) * start else one.held.work
        starts.append((start, one is not best, one.falls, one.points, one.direction))
    return [opening[k] for k in sorted(range(len(opening)), key=starts.__getitem__)]
