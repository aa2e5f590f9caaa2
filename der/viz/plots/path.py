"""A path as one picture: snapshots of the ring above M(gamma) and U(gamma)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from der.records.configurations import Shapes
from der.records.forces import Forces
from der.records.path import Mode, Path
from der.utils.checks import Array
from der.viz.animation import mean_radius
from der.viz.curve import arc_length, evenly, smooth
from der.viz.palette import FREE, INK, POINTS, ROSE
from der.viz.plots import style
from der.viz.plots.rings import bare, place_ribbon
from der.viz.ribbon import HALF_WIDTH, quadrilaterals
from der.viz.titles import folded_text, times_pi, title

STATE: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 2.2, "color": INK}
MANY = 250  # states; more would hide the line below them
LETTERS = "ABCDEF"  # one for each snapshot
SIDES = {"left": 0.085, "right": 0.985}
IN_ARM = "$F$, $m$: in the first arm, at the first grip"
ONE_GRIP = "$M$: one arm; a torque cell on a grip reads $2M$"
HIGH = 6.0  # inches of the part without forces
COMPONENTS = (ROSE, FREE, INK)  # colours, of vectors along E1, E2, E3
DASHED = ("-", "--", ":")
CAPTION = 0.82  # room for the text below a ribbon, over the row's height


def draw(path: Path) -> Figure:
    """The picture of a path: M and U against gamma; above them snapshots where it has shapes.

    Raises
    ------
    ValueError
        If the path has no state.
    """
    style.check_states("path", path)
    status = () if path.status == "done" else (path.status,)
    share = 1.0 if path.forces is None else 1.0 / 1.5  # of the part without forces, in height
    name = title(path, _mode(path.mode) if path.mode else _reach(path), *status)
    figure = style.blank(8.0, HIGH / share, name)

    def down(place: float) -> float:
        """A height in the part without forces as one in the figure."""
        return 1.0 - (1.0 - place) * share

    above, below = _draw_curves(figure, path, down)
    if path.shapes is not None:
        largest = int(np.argmax(np.abs(path.moment)))
        chosen = evenly(arc_length(path.shapes.x), len(LETTERS), keep=largest)
        row = figure.add_axes((0.02, down(0.685), 0.96, 0.265 * share))
        _draw_ribbons(row, path, path.shapes, chosen)
        for axes, height in ((above, path.moment), (below, path.energy)):
            places = np.column_stack([path.gamma / math.pi, height])[chosen]
            style.place_letters(axes, LETTERS, places, smooth(path, height))
    entries = _entries(path)
    if path.forces is not None:
        both = style.stacked(figure, 1.0, **SIDES, bottom=0.125 * share, top=down(0.01))
        entries += _draw_forces(both, path, path.forces)
        _note(figure, 0.079 * share, IN_ARM)
    _note(figure, down(0.079), ONE_GRIP)
    style.legend_below(figure, entries, fontsize=7.5)
    return figure


def _draw_curves(figure: Figure, path: Path, down: Callable[[float], float]) -> tuple[Axes, Axes]:
    """Draw M above U; ``down`` places them in the figure."""
    top = down(0.94 if path.shapes is None else 0.665)
    above, below = style.stacked(figure, 1.45, **SIDES, bottom=down(0.125), top=top)
    for axes, height in ((above, path.moment), (below, path.energy)):
        _draw_curve(axes, path, height)
        axes.yaxis.set_label_coords(-0.062, 0.5)
    style.label_axes(above, "", style.moment(path.scale, "moment of one arm"))
    style.label_axes(below, style.GAMMA, style.energy(path.scale))
    style.zero_line(above)
    below.xaxis.set_major_locator(MaxNLocator(9, steps=[1, 2, 2.5, 5, 10]))
    return above, below


def _note(figure: Figure, height: float, text: str) -> None:
    """A note beside the label of an abscissa."""
    figure.text(0.985, height, text, ha="right", va="center", fontsize=7.5, color=INK)


def _reach(path: Path) -> str:
    """How far a path goes: "up to γ = π", "up to γ = π and back"."""
    top = float(path.gamma.max())
    back = " and back" if path.gamma[-1] == 0.0 < top else ""
    return f"up to γ = {times_pi(top)}{back}"


def _mode(mode: Mode) -> str:
    """The folding mode as text: "stays folded when released, snap-through"."""
    snap = "no snap" if mode.snapping == "none" else mode.snapping
    return f"{folded_text(mode) if mode.foldable else 'not foldable'}, {snap}"


def _entries(path: Path) -> list[Any]:
    """An style.entry of the legend for every kind of line and style.mark that occurs."""
    kinds = {point.kind for point in path.points}
    entries = list(style.stretch_entries(path))
    entries += [
        style.entry(POINTS[kind], **style.mark(*style.MARKS[kind]))
        for kind in style.MARKS
        if kind in kinds
    ]
    if len(path) <= MANY:
        entries.append(style.entry("computed state", **STATE))
    return entries


def _draw_curve(axes: Axes, path: Path, height: Array) -> None:
    """Draw stable and unstable stretches, the states on them, and the special points."""
    style.draw_stretches(axes, path, height)
    if len(path) <= MANY:
        axes.plot(path.gamma / math.pi, height, zorder=3, **STATE)
    for kind, (marker, size) in style.MARKS.items():
        at = [point.position for point in path.points if point.kind == kind]
        axes.plot(path.gamma[at] / math.pi, height[at], zorder=4, **style.mark(marker, size))
    axes.margins(x=0.03, y=0.12)


def _draw_forces(axes: tuple[Axes, Axes], path: Path, forces: Forces) -> list[Any]:
    """Draw force and moment in the first arm at the first grip; return entries of the legend."""
    labels = (
        style.quantity(path.scale, "force", "F", "force"),
        style.quantity(path.scale, "moment", "m", "moment"),
    )
    for one, values, label, across in zip(
        axes, (forces.arm_force, forces.arm_moment), labels, ("", style.GAMMA), strict=True
    ):
        for component, colour, dashes in zip(values[:, 0].T, COMPONENTS, DASHED, strict=True):
            one.plot(*smooth(path, component).T, color=colour, linestyle=dashes, linewidth=1.6)
        style.label_axes(one, across, label)
        style.zero_line(one)
        one.margins(x=0.03, y=0.12)
        one.yaxis.set_label_coords(-0.062, 0.5)
    looks = zip(COMPONENTS, DASHED, strict=True)
    return [
        style.entry(f"along $E_{i}$", color=colour, linestyle=dashes, linewidth=1.6)
        for i, (colour, dashes) in enumerate(looks, 1)
    ]


def _draw_ribbons(row: Axes, path: Path, shapes: Shapes, chosen: list[int]) -> None:
    """Draw the ring at the chosen states, all from one side and in one scale."""
    width = HALF_WIDTH * mean_radius(shapes.x[0])
    ribbons = [quadrilaterals(shapes.x[k], shapes.frames[k, :, 0], width) for k in chosen]
    spans = np.array([np.ptp(corners.reshape(-1, 2), axis=0) for corners, _ in ribbons])
    tall = 1.06 * float(spans[:, 1].max())
    slot = max(1.12 * float(spans[:, 0].max()), CAPTION * tall)
    for i, ribbon in enumerate(ribbons):
        place_ribbon(row, ribbon, (i * slot, 0.0))
        text = rf"$\bf{{{LETTERS[i]}}}$   $\gamma$ = {times_pi(path.gamma[chosen[i]])}"
        style.place_text(row, (i * slot, -tall / 2), text, va="top", fontsize=8)
    bare(row, (-slot / 2, -0.62 * tall), ((len(ribbons) - 0.5) * slot, 0.5 * tall))
