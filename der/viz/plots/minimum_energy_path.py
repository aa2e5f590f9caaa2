"""The minimum-energy path of a free ring as a picture: from flat by the saddle to folded."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from der.records.landscape import Pass, Saddle
from der.records.units import unit
from der.viz.palette import INK, QUIET, STABLE
from der.viz.plots import style
from der.viz.plots.rings import seen
from der.viz.titles import sure, title

RINGS = 6  # on the path
LINE: dict[str, Any] = {"color": STABLE, "linewidth": 1.7}
WELL, SADDLE = style.mark("o", 5.6, INK), style.mark("^", 6.6)
SIDES = (0.085, 0.895)  # left edge and width of both axes, of the figure


def draw(found: Pass) -> Figure:
    """The picture of a pass: energy along its path, and above it the ring at places of the path.

    Raises
    ------
    ValueError
        If there is no such path.
    """
    if found.saddle is None or found.fold is None or found.open is None:
        raise ValueError(f"pass must have a saddle to be plotted: {found.why}")
    figure = style.blank(7.6, 5.0, title(found))
    axes = figure.add_axes((SIDES[0], 0.165, SIDES[1], 0.5))
    axes.margins(x=0.11)
    progress, energy = found.way.T
    span = float(np.ptp(energy))
    axes.set_ylim(float(energy.min()) - 0.05 * span, float(energy.max()) + 0.5 * span)  # for text
    top = int(np.argmax(energy))
    axes.plot(progress, energy, zorder=2, **LINE)
    for k, look in ((0, WELL), (top, SADDLE), (len(energy) - 1, WELL)):
        axes.plot(progress[k], energy[k], zorder=5, clip_on=False, **look)
    style.label_axes(
        axes, "distance along the path  [rad, root mean square]", style.energy(found.scale)
    )
    place: dict[str, Any] = {"ha": "left", "va": "top", "fontsize": 8, "transform": axes.transAxes}
    style.place_text(axes, (0.03, 0.975), "\n".join(_barriers(found, found.saddle)), **place)
    _enlarge(axes, found, float(progress[top]))
    states = {"well: flat, folded": WELL, "saddle": SADDLE}
    entries = {"minimum-energy path": LINE} | states
    style.legend_below(figure, [style.entry(text, **look) for text, look in entries.items()])
    if len(found.shapes):
        _draw_rings(figure.add_axes((SIDES[0], 0.69, SIDES[1], 0.24)), found, axes.get_xlim())
    return figure


def _barriers(found: Pass, saddle: Saddle) -> list[str]:
    """Barriers of the free ring, and of twisting in grips, as lines of text."""
    kind = "the saddle of twisting" if saddle.twisted else "another saddle than that of twisting"
    lines = [f"{kind}, index {'?' if saddle.index is None else saddle.index}"]
    energy = unit(found.scale, "energy")
    for name in ("fold", "open"):
        value, twisting = getattr(found, name), getattr(found.twisting, name)
        text, mesh = f"{value:.5g} {energy}", ""
        if name in found.extrapolated:
            text = f"{sure(*found.extrapolated[name])} {energy}, extrapolated (mesh {value:.5g})"
            mesh = " (mesh)"
        lines.append(f"to {name}: {text}")
        other = "no barrier" if twisting is None else f"{twisting:.5g} {energy}{mesh}"
        lines.append(f"      in clamped grips, by twisting: {other}")
    return lines


def _enlarge(axes: Axes, found: Pass, saddle: float) -> None:
    """The path from the saddle to the folded ring, enlarged, in axes of its own."""
    progress, energy = found.way.T
    end, height = float(progress[-1]), found.open or 1.0
    inset = axes.inset_axes((0.61, 0.08, 0.26, 0.4))
    inset.plot(progress, energy, **LINE | {"linewidth": 1.4})
    inset.set_xlim(saddle - 0.8 * (end - saddle), end + 0.1 * (end - saddle))
    inset.set_ylim(energy[-1] - 0.4 * height, energy[-1] + 1.4 * height)
    inset.axhline(energy[-1], color=QUIET, linewidth=0.6, linestyle=":")
    inset.tick_params(labelsize=6.5, color=QUIET, labelcolor=INK, direction="in")
    inset.ticklabel_format(useOffset=False)
    axes.indicate_inset_zoom(inset, edgecolor=QUIET)


def _draw_rings(row: Axes, found: Pass, limits: tuple[float, float]) -> None:
    """Rings on the path, each over its place on the curve below, in one scale."""
    places = np.linspace(0.0, float(found.way[-1, 0]), RINGS)
    chosen = np.linspace(0, len(found.shapes) - 1, RINGS).round().astype(int)  # equally far apart
    views = [seen(found.shapes[k]) for k in chosen]
    scale = 0.86 * places[1] / max(float(np.ptp(view.line[:, 0])) for view in views)
    for place, view in zip(places, views, strict=True):
        view.draw(row, scale, np.array([place, 0.0]), STABLE)
    row.set_aspect("equal", adjustable="datalim")
    row.set_xlim(*limits)
    row.set_axis_off()
