"""The picture of `scenarios.states_of_natural_curvature`: energies of all states over kappa0."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import der
from der.viz.palette import INK
from der.viz.plots import style

Sweep = Sequence[tuple[float, der.States]]

COLOURS = {"1": "#0072B2", "2": "#009E73", "3": "#CC79A7", "8": "#E69F00"}  # Okabe and Ito
LABELS = {"1": "flat", "2": "two-covered", "3": "three-covered", "8": "figure eight"}
SPACE = "#D55E00"
STYLES: Mapping[int, Any] = {
    0: "-",
    1: (0, (5, 1.6)),
    2: (0, (2.5, 1.4)),
    3: (0, (4.0, 1.2, 1.0, 1.2)),
    4: (0, (1.0, 1.2)),
}
DOTS = (
    ("planar minimum", INK, INK),
    ("planar saddle", "white", INK),
    ("minimum in space", SPACE, SPACE),
    ("saddle in space", "white", SPACE),
)


def figure_over_curvature(
    sweep: Sweep, section: der.Section, thresholds: Mapping[int, Sequence[float]]
) -> Figure:
    """Energy over natural curvature: lines are covered circles, by index; dots all states."""
    title = f"States of a free ring over its natural curvature   |   h/t = {section.h_over_t:g}"
    figure = style.blank(8.4, 5.4, title)
    axes = figure.add_axes((0.085, 0.205, 0.895, 0.735))
    ends = (sweep[0][0], sweep[-1][0])
    for n, places in thresholds.items():

        def energy(kappa: Any, n: int = n) -> Any:
            return np.pi * section.alpha * (n - kappa) ** 2

        for low, high in pairwise([ends[0], *places, ends[1]]):
            kappa = np.linspace(low, high, 60)
            look = STYLES.get(_index(sweep, n, 0.5 * (low + high)), ":")
            axes.plot(kappa, energy(kappa), color=COLOURS[str(n)], linestyle=look, lw=1.7)
        for k in places:
            axes.plot(k, energy(k), "|", color=INK, ms=11, mew=1.3, zorder=4)
    _eights(axes, sweep)
    _dots(axes, sweep)
    axes.set_xlim(ends[0] - 0.05, ends[1] + 0.05)
    axes.set_ylim(-0.8, 16.0 * np.pi * section.alpha)
    style.label_axes(axes, "natural curvature  $\\kappa_0$  [1/R]", "energy  $U\\,R/GJ$")
    style.legend_below(figure, list(_entries()), fontsize=7.6)
    return figure


def _entries() -> Iterator[Line2D]:
    """The entries of the legend."""
    for n, label in LABELS.items():
        yield style.entry(label, color=COLOURS[n])
    for k, look in STYLES.items():
        yield style.entry(f"index {k}", color=INK, linestyle=look)
    yield style.entry("threshold", ls="none", marker="|", ms=10, color=INK)
    for label, face, edge in DOTS:
        yield style.entry(label, **style.mark("o", 4.4, face) | {"markeredgecolor": edge})


def _index(sweep: Sweep, covers: int, kappa: float) -> int:
    """The index of a covered circle as it was found nearest to a natural curvature."""
    known = [
        (abs(kappa0 - kappa), state.index)
        for kappa0, one in sweep
        for state in one.states
        if state.covering == covers and state.repeats == 0 and state.index is not None
    ]
    return min(known)[1]


def _eights(axes: Axes, sweep: Sweep) -> None:
    """Lines through the energies of figure eights, by index."""
    found = [(k, state) for k, one in sweep for state in one.states if state.name == LABELS["8"]]
    for (a, before), (b, after) in pairwise(found):
        look = ":" if after.index is None else STYLES.get(after.index, ":")
        energies = (before.energy, after.energy)
        axes.plot((a, b), energies, color=COLOURS["8"], linestyle=look, lw=1.5, zorder=1)


def _dots(axes: Axes, sweep: Sweep) -> None:
    """Every state that was found, filled where it is a minimum."""
    for kappa0, one in sweep:
        for state in one.states:
            colour = INK if state.planar else SPACE
            marker = style.mark("s" if state.needs_cut else "o", 4.2)
            marker |= {"markerfacecolor": colour if state.stable else "white", "zorder": 5}
            axes.plot(kappa0, state.energy, **marker | {"markeredgecolor": colour})
