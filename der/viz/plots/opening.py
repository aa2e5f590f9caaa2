"""How a folded ring is pushed open, as a picture: rings under their loads, curves and works."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from der.records.opening import ALIKE, KINDS, LeastPush, Push
from der.utils.checks import Array
from der.viz.plots.style import (
    DASHES,
    FREE,
    INK,
    STABLE,
    TITLE,
    UNSTABLE,
    blank,
    dress,
    legend_below,
    mark,
    seen,
    sure,
    title,
)

COLOURS = {"force": STABLE, "couple": UNSTABLE}
AXES = {
    "force": ("change of distance  $\\Delta D/a$", "force  $P\\,a^2/GJ$"),
    "couple": ("turn  $\\theta$  [rad]", "couple  $C\\,a/GJ$"),
}
MOST = 7  # bars of each kind
RINGS = (
    ("force", "force"),
    ("couple", "couple"),
    ("force dead", "force"),
    ("couple dead", "couple"),
)
EVENTS = {
    "pass": "carried to a pass",
    "fold": "snaps at a fold",
    "branch": "snaps at a branch point",
    "limit": "limit of a dead load",
    "end": "end of the march",
}
MARKS = {"pass": "^", "fold": "D", "branch": "s", "limit": "v", "end": "X"}
ARROW = 0.15  # length of an arrow
WIDE, HIGH = 1.0, 0.5  # of a little picture, in its own units


def figure_of_push(found: LeastPush) -> Figure:
    """Rings at the moment they open, with their loads; loads over pushes; works of the best.

    Raises
    ------
    ValueError
        If no push opens the ring.
    """
    if not found.least:
        raise ValueError(f"push must open the ring to be plotted: {found.why}")
    figure = blank((9.2, 6.9))
    figure.text(0.5, 0.977, title(found.ring, found.section, found.numerics), **TITLE)
    _rings(figure.add_axes((0.01, 0.665, 0.98, 0.295)), found)
    kinds = [kind for kind in KINDS if kind in found.least]
    places = {1: [(0.17, 0.43)], 2: [(0.435, 0.195), (0.145, 0.195)]}[len(kinds)]
    for kind, (low, high) in zip(kinds, places, strict=True):
        _curves(figure.add_axes((0.07, low, 0.31, high)), found, kind)
    rows = {kind: _ranked(found, kind) for kind in kinds}
    _works(figure.add_axes((0.64, 0.165, 0.345, 0.465)), found, rows)
    legend_below(figure, _handles(found, rows))
    return figure


def _handles(found: LeastPush, rows: Mapping[str, list[Push]]) -> list[Any]:
    """What colours, lines and marks mean, of those that are there."""
    handles: list[Any] = []
    for kind, ranked in rows.items():
        n = len(ranked)
        count = f"best {MOST} of {n}" if n > MOST else f"all {n}"
        label = f"slow {kind}, {count} that open it"
        handles.append(Patch(color=COLOURS[kind], alpha=0.75, label=label))
    handles.append(Line2D([], [], color="#bdbdbd", linewidth=0.8, label="others that open it"))
    if any(_dashed(found, kind) for kind in rows):
        look: dict[str, Any] = {"color": INK, "linewidth": 1.1, "linestyle": DASHES}
        handles.append(Line2D([], [], label="push of the best dead load", **look))
    if found.barrier is not None:
        mesh = " (mesh)" if found.extrapolated else ""
        label = f"barrier of the ring left alone, {found.barrier:.4g} GJ/a{mesh}"
        handles.append(Line2D([], [], color=FREE, linewidth=1.5, label=label))
    events = {found.pushes[k].held.event for k in found.least.values()}
    events |= {dead.event for k in found.least_dead.values() if (dead := found.pushes[k].dead)}
    handles += [
        Line2D([], [], label=label, **_mark(event))
        for event, label in EVENTS.items()
        if event in events
    ]
    if any(one.dead and one.opens_dead for ranked in rows.values() for one in ranked[:MOST]):
        label = "work of the dead load when it gets away"
        tick: dict[str, Any] = {"marker": "|", "markersize": 9, "linestyle": "none", "color": INK}
        handles.append(Line2D([], [], label=label, **tick))
    return handles


# --- Rings -----------------------------------------------------------------------------------


def _rings(row: Axes, found: LeastPush) -> None:
    """Rings as they are let go or get away, in one scale, with arrows where they are pushed."""
    shown = [(name, kind) for name, kind in RINGS if name in found.shapes]
    views = [seen(found.shapes[name][0]) for name, _ in shown]
    if not views:
        row.set_axis_off()
        return
    scale = min(
        0.6 * WIDE / max(float(np.ptp(view[:, 0])) for view in views),
        0.86 * HIGH / max(float(np.ptp(view[:, 1])) for view in views),
    )
    for i, ((name, kind), view) in enumerate(zip(shown, views, strict=True)):
        dead = name.endswith("dead")
        push = found.pushes[(found.least_dead if dead else found.least)[kind]]
        x, points = found.shapes[name]
        middle = 0.5 * (view.min(axis=0) + view.max(axis=0))
        place = np.array([i * WIDE, 0.0, 0.0])
        _ring(row, scale * (view - middle) + place, COLOURS[kind])
        loads = _loads(push, points)
        tips = np.concatenate([points, points + loads])
        ends = scale * (seen(x, tips) - middle) + place
        _arrows(row, ends[:2], ends[2:] - ends[:2], double=kind == "couple")
        row.text(
            i * WIDE,
            -0.5 * HIGH - 0.07,
            _caption(found, push, name),
            ha="center",
            va="top",
            fontsize=7.5,
            color=INK,
            linespacing=1.35,
        )
    row.set_xlim(-0.5 * WIDE, (len(shown) - 0.5) * WIDE)
    row.set_ylim(-0.5 * HIGH - 0.36, 0.5 * HIGH + 0.04)
    row.set_aspect("equal")
    row.set_axis_off()


def _ring(row: Axes, ring: Array, colour: str) -> None:
    """A closed curve (n, 3), what is nearer on top of what is farther."""
    for k in np.argsort(ring[:-1, 2]):
        near = slice(max(int(k) - 1, 0), int(k) + 3)
        row.plot(*ring[k : k + 2, :2].T, color="white", linewidth=3.4, solid_capstyle="butt")
        row.plot(*ring[near, :2].T, color=colour, linewidth=1.5, solid_capstyle="round")


def _loads(push: Push, points: Array) -> Array:
    """Directions (2, 3) of unit length: of the forces, or the axes of the couples."""
    if push.kind == "force":
        line = points[1] - points[0]
        line = line / max(float(np.linalg.norm(line)), 1e-300)
        pull = -line if push.direction == "together" else line
    else:
        pull = np.array(push.axis)
    return np.array([-pull, pull])


def _arrows(row: Axes, at: Array, way: Array, *, double: bool) -> None:
    """Arrows at two points: a force has one head, a couple's axis two."""
    longest = max(float(np.linalg.norm(way[:, :2], axis=1).max()), 1e-9)
    for place, along in zip(at[:, :2], way[:, :2], strict=True):
        row.plot(*place, marker="o", markersize=3.4, color=INK, zorder=6)
        for share in (1.0, 0.72) if double else (1.0,):
            row.annotate(
                "",
                place + share * ARROW / longest * along,
                xytext=place,
                annotation_clip=False,
                arrowprops={
                    "arrowstyle": "-|>",
                    "color": INK,
                    "linewidth": 1.1,
                    "shrinkA": 0,
                    "shrinkB": 0,
                    "mutation_scale": 8,
                },
                zorder=7,
            )


def _caption(found: LeastPush, push: Push, name: str) -> str:
    """What is pushed where, how it ends and its work: without mesh where that is known."""
    dead = name.endswith("dead")
    moment = push.dead if dead and push.dead is not None else push.held
    work = f"work {moment.work:.4g} GJ/a"
    if name in found.extrapolated:
        work = f"work {sure(*found.extrapolated[name])} GJ/a\nextrapolated (mesh {moment.work:.4g})"
    elif found.extrapolated:
        work += " (mesh)"
    first = f"{'dead' if dead else 'slow'} {push.kind}, {push.direction}"
    return f"{first}\n{_points(push)}\n{EVENTS[moment.event]}\n{work}"


def _points(push: Push) -> str:
    first, second = push.points
    return f"s/L = {first:.3g}, {second:.3g}"


# --- Curves ----------------------------------------------------------------------------------


def _curves(panel: Axes, found: LeastPush, kind: str) -> None:
    """Load over push: those that open the ring, the best on top."""
    best = found.least[kind]
    dead = found.least_dead.get(kind)
    for k, one in enumerate(found.pushes):
        if one.kind == kind and one.opens and k not in (best, dead):
            panel.plot(*_line(one), color="#d5d5d5", linewidth=0.8, zorder=1)
    panel.margins(x=0.02)
    push = found.pushes[best]
    top = 2.2 * max(push.peak, found.pushes[dead].peak if dead is not None else 0.0)
    if dead is not None and _dashed(found, kind):
        look: dict[str, Any] = {"color": COLOURS[kind], "linewidth": 1.1, "linestyle": DASHES}
        panel.plot(*_line(found.pushes[dead]), zorder=3, **look)
    panel.plot(*_line(push), color=COLOURS[kind], linewidth=1.8, zorder=4)
    panel.plot(push.held.push, push.held.load, zorder=6, clip_on=False, **_mark(push.held.event))
    if dead is not None and (limit := found.pushes[dead].dead) is not None:
        panel.plot(limit.push, limit.load, zorder=6, **_mark(limit.event))
    panel.set_ylim(0.0, top)
    widest = 1.7 * max(push.held.push, found.pushes[dead].held.push if dead is not None else 0.0)
    panel.set_xlim(0.0, widest)
    across, up = AXES[kind]
    dress(panel, up)
    panel.set_xlabel(across, fontsize=9, color=INK, labelpad=2)
    panel.xaxis.set_major_locator(MaxNLocator(6))
    panel.yaxis.set_major_locator(MaxNLocator(5))


def _dashed(found: LeastPush, kind: str) -> bool:
    """Whether the best dead load is that of another push than the best slow one."""
    return found.least_dead.get(kind, found.least[kind]) != found.least[kind]


def _line(push: Push) -> tuple[Array, Array]:
    """Load over push, smooth between the minima that were solved for."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    x, load, _ = push.curve.T
    if len(x) < 3 or np.any(np.diff(x) <= 0.0):
        return x, load
    fine = np.linspace(x[0], x[-1], 120)
    through = PchipInterpolator if push.falls else CubicSpline  # where it falls there is a kink
    return fine, through(x, load)(fine)


def _mark(event: str) -> dict[str, Any]:
    """How an event is marked."""
    return mark(MARKS[event], 5.2 if event in ("fold", "branch") else 6.2)


# --- Works -----------------------------------------------------------------------------------


def _works(panel: Axes, found: LeastPush, ranked: Mapping[str, list[Push]]) -> None:
    """Works of the best pushes as bars, and what dead loads have done when they get away."""
    rows = [one for of_kind in ranked.values() for one in of_kind[:MOST]]
    place = np.arange(len(rows))[::-1].astype(float)
    place[: sum(one.kind == "force" for one in rows)] += 0.6
    for y, one in zip(place, rows, strict=True):
        panel.barh(y, one.held.work, height=0.66, color=COLOURS[one.kind], alpha=0.75, linewidth=0)
        if one.dead is not None and one.opens_dead:
            panel.plot(one.dead.work, y, marker="|", markersize=9, color=INK, zorder=4)
            continue
        text = "no limit of a dead load" if one.dead is None else "a dead load does not open it"
        say: dict[str, Any] = {"xytext": (4.0, 0.0), "textcoords": "offset points"}
        panel.annotate(text, (0.0, y), va="center_baseline", fontsize=6.5, color="white", **say)
    panel.set_yticks(place, [f"{_points(one)}  {one.direction}" for one in rows])
    panel.tick_params(axis="y", length=0)
    if found.barrier is not None:
        panel.axvline(found.barrier, color=FREE, linewidth=1.5, zorder=3)
    widest = max(one.held.work for one in rows)
    panel.set_xlim(0.0, 1.05 * min(widest, 2.0 * (found.barrier or math.inf)))
    dress(panel, "")
    panel.tick_params(axis="y", labelsize=7)
    panel.spines["left"].set_visible(False)
    panel.set_xlabel("work until the ring opens  $W\\,a/GJ$", fontsize=9, color=INK, labelpad=2)
    panel.xaxis.set_major_locator(MaxNLocator(5))
    panel.grid(axis="x", color="#e8e8e8", linewidth=0.6, zorder=0)
    panel.set_axisbelow(True)


def _ranked(found: LeastPush, kind: str) -> list[Push]:
    """Pushes of a kind that open the ring, by work; of those that take the same the best first.

    The others of these in the order of falls on the way, places and directions.
    """
    best = found.pushes[found.least[kind]]
    opening = [one for one in found.pushes if one.kind == kind and one.opens]
    opening.sort(key=lambda one: one.held.work)
    group, start = [], -math.inf
    for one in opening:
        if one.held.work > (1.0 + ALIKE) * start:
            start = one.held.work
        group.append((start, one is not best, one.falls, one.points, one.direction))
    order = sorted(range(len(opening)), key=lambda k: group[k])
    return [opening[k] for k in order]
