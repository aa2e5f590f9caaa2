"""Beside a ring in a recording: curves over gamma, series over steps, and events."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
import rerun as rr

from der.records.path import Path
from der.records.units import head
from der.utils.checks import Array
from der.viz.animation import spread
from der.viz.captions import density_unit, event_text
from der.viz.curve import SNAP, stretches
from der.viz.palette import POINTS
from der.viz.rerun.axes import PlotAxes, dotted, send_axes, send_labels
from der.viz.rerun.entities import GREEN, ORANGE, QUIET, SKY, VERMILION, Colour, Entities
from der.viz.ribbon import viridis

# label, colour and radius of a stretch of the curves by its stability in the grips
STRETCHES: dict[bool | str | None, tuple[str, Colour, float]] = {
    True: ("stable_at_fixed_gamma", SKY, 0.9),
    False: ("unstable_at_fixed_gamma", VERMILION, 0.5),
    None: ("unknown", QUIET, 0.8),
    SNAP: ("snaps", ORANGE, 0.5),
}
CLASSES = (GREEN, SKY, ORANGE)  # of the eigenvalues of each symmetry
MOVING = "in motion"
HELD = "stable at fixed γ"
# colours of the state lines; any index but 0 is vermilion
STATES: dict[str, Colour] = {
    HELD: (0, 114, 178),
    MOVING: (120, 94, 20),
    "start": (70, 70, 70),
    "fold": (204, 121, 167),
    "limit of M": (0, 114, 178),
    "branch point": (150, 80, 0),
    "snap": (120, 94, 20),
    "self-crossing": GREEN,
}


def send_key(sent: Entities) -> None:
    """The colours of the energy density, as a bar."""
    share = np.linspace(0.0, 1.0, 65)
    bars = [[[300 * a, 0], [300 * b, 0]] for a, b in pairwise(share)]
    shades = viridis(0.5 * (share[1:] + share[:-1]))
    sent.still("key/bar", rr.LineStrips2D(bars, colors=shades, radii=5.0))
    ends = ["0", f"energy density, {density_unit(sent.motion.scale)}", f"{sent.top:.3g}"]
    send_labels(sent, "key/values", [[0, 14], [150, 14], [300, 14]], ends)


def send_curve(
    sent: Entities,
    path: Path,
    name: str,
    *,
    axes: PlotAxes | None = None,
    entity: str = "",
    colour: Colour | None = None,
) -> None:
    """The curve over gamma, its special points, and the present state on it.

    Parameters
    ----------
    axes : shared ones, that are sent already; new ones if not given.
    entity : where it goes; ``curves/name`` if not given.
    colour : of the curve and its dot, where several share axes.
    """
    motion, entity = sent.motion, entity or f"curves/{name}"
    heights: Array = getattr(path, name)
    if axes is None:
        axes = PlotAxes(path.gamma, heights)
        send_axes(sent, entity, axes)
    pieces = [
        (kind, piece)
        for kind, line in stretches(path, heights)
        for piece in axes.inside(axes.place(math.pi * line[:, 0], line[:, 1]))
    ]
    _send_stretches(sent, pieces, entity, colour)
    at = [point.position for point in path.points]
    if at:
        labels = np.array([POINTS[point.kind] for point in path.points])
        places = axes.place(path.gamma[at], heights[at])
        shown = axes.holds(places)
        look: dict[str, Any] = {"colors": ORANGE, "radii": 1.3, "show_labels": False}
        marks = rr.Points2D(places[shown], labels=labels[shown].tolist(), **look)
        sent.still(f"{entity}/points", marks)
    values: Array = getattr(motion, name)
    places = axes.place(motion.gamma, values)
    known = np.isfinite(values) & axes.holds(places)
    shade, size = (colour, 3.2) if colour else ((255, 255, 255), 2.4)
    sent.still(f"{entity}/now", rr.Points2D.from_fields(colors=shade, radii=size, draw_order=50.0))
    columns = rr.Points2D.columns(positions=places[known].astype(np.float32))
    sent.run(f"{entity}/now", columns.partition(known.astype(int)))


def _send_stretches(
    sent: Entities,
    pieces: Sequence[tuple[bool | str | None, Array]],
    entity: str,
    colour: Colour | None,
) -> None:
    """The curve by its stability; dotted where the ring snaps, or is unstable in one colour."""
    for key, (label, own, width) in STRETCHES.items():
        strips = [piece for kind, piece in pieces if kind is key]
        if key is SNAP or (key is False and colour is not None):
            strips = [dash for strip in strips for dash in dotted(strip)]
        if strips:
            lines = rr.LineStrips2D(strips, colors=colour or own, radii=width)
            sent.still(f"{entity}/{label}", lines)


def send_series(
    sent: Entities, path: Path, *, name: str = "", colour: Colour | None = None
) -> None:
    """M, U, gamma, the index and the lowest eigenvalues over the steps.

    Parameters
    ----------
    name, colour : of the ring, where there are several.
    """
    motion = sent.motion
    index = spread(np.ma.filled(path.index.astype(float), np.nan), motion.position)
    series = {
        "moment": (motion.moment, head(motion.scale, "M", "moment"), SKY),
        "gamma": (motion.gamma, "gamma, rad", QUIET),
        "energy": (motion.energy, head(motion.scale, "U", "energy"), ORANGE),
        "index": (index, "index", VERMILION),
    }
    for k, (label, column) in enumerate(zip(motion.classes, motion.eigenvalues.T, strict=True)):
        series[f"eigenvalues/{label.replace(' ', '_')}"] = (column, label, CLASSES[k])
    for entity, (values, label, own) in series.items():
        known = np.isfinite(values)
        if known.any():
            steps = np.flatnonzero(known | (motion.position < 0))  # a nan breaks the line
            modes = rr.components.InterpolationMode
            # a count stays until it changes
            look: dict[str, Any] = {
                "colors": colour or own,
                "interpolation_mode": modes.StepAfter if entity == "index" else modes.Linear,
                "names": f"{label.split(' ')[0].rstrip(',')}, {name}" if name else label,
            }
            sent.still(f"series/{entity}", rr.SeriesLines(widths=2.0, **look))
            sent.run(f"series/{entity}", rr.Scalars.columns(scalars=values[steps]), steps)


# --- Events ---------------------------------------------------------------------------------


def send_events(sent: Entities, path: Path, *, name: str = "") -> None:
    """Special points in the log; stability and the last event as lines over the steps.

    Parameters
    ----------
    name : of the ring, where there are several.
    """
    motion = sent.motion
    steps = [motion.step_of(point.position) for point in path.points]
    before = f"{name}: " if name else ""
    if steps:
        texts = [before + event_text(point, path.scale) for point in path.points]
        sent.run("events", rr.TextLog.columns(text=texts), steps)
    kinds = [POINTS[point.kind] for point in path.points]
    names = {
        k: f"index {i}" if i else HELD for k, i in enumerate(path.index.tolist()) if i is not None
    }
    names[-1] = MOVING
    at = enumerate(motion.position.tolist())
    _send_states(sent, "states/stability", {step: names[k] for step, k in at if k in names})
    _send_states(sent, "states/event", {0: "start", **dict(zip(steps, kinds, strict=True))})


def _send_states(sent: Entities, entity: str, states: Mapping[int, str]) -> None:
    """A line of states, each from its step to the next one."""
    changes = [next(group) for _, group in groupby(sorted(states), key=lambda k: states[k])]
    if not changes:
        return
    values = sorted(set(states.values()))
    colours = [STATES.get(value, VERMILION) for value in values]
    sent.still(entity, rr.StateConfiguration(values=values, colors=colours))
    sent.run(entity, rr.StateChange.columns(state=[states[k] for k in changes]), changes)
