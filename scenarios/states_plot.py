"""The picture of `scenarios.states_of_natural_curvature`: energies of all states over kappa0."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import der

INK, QUIET = "#222222", "#8a8a8a"
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


def figure_over_curvature(
    sweep: Sequence[tuple[float, der.States]],
    bar: der.Section,
    thresholds: Mapping[int, Sequence[float]],
) -> Figure:
    """Energy over natural curvature: lines are covered circles, by index; dots all states."""
    figure = Figure(figsize=(8.4, 5.4), dpi=150, facecolor="white")
    FigureCanvasAgg(figure)
    panel = figure.add_axes((0.085, 0.205, 0.895, 0.735))
    ends = (sweep[0][0], sweep[-1][0])
    for n, places in thresholds.items():
        for low, high in pairwise([ends[0], *places, ends[1]]):
            kappa = np.linspace(low, high, 60)
            index = _index(sweep, n, 0.5 * (low + high))
            energy = np.pi * bar.alpha * (n - kappa) ** 2
            style = STYLES.get(index, ":")
            panel.plot(kappa, energy, color=COLOURS[str(n)], linestyle=style, lw=1.7, zorder=2)
        for k in places:
            panel.plot(
                k, np.pi * bar.alpha * (n - k) ** 2, "|", color=INK, ms=11, mew=1.3, zorder=4
            )
    eights = [
        (k, state) for k, one in sweep for state in one.states if state.name == "figure eight"
    ]
    for (a, before), (b, after) in pairwise(eights):
        style = ":" if after.index is None else STYLES.get(after.index, ":")
        ends_at = (before.energy, after.energy)
        panel.plot((a, b), ends_at, color=COLOURS["8"], linestyle=style, lw=1.5, zorder=1)
    _dots(panel, sweep)
    panel.set_xlim(ends[0] - 0.05, ends[1] + 0.05)
    panel.set_ylim(-0.8, 16.0 * np.pi * bar.alpha)
    panel.set_xlabel("natural curvature  $\\kappa_0$  [1/R]", fontsize=9, color=INK)
    panel.set_ylabel("energy  $U\\,R/GJ$", fontsize=9, color=INK)
    panel.tick_params(labelsize=8, color=QUIET, labelcolor=INK, direction="in")
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(QUIET)
    title = f"States of a free ring over its natural curvature   |   h/t = {bar.h_over_t:g}"
    figure.text(0.5, 0.972, title, ha="center", va="center", fontsize=9.5, color=INK)
    handles = [Line2D([], [], color=COLOURS[n], label=LABELS[n]) for n in LABELS]
    handles += [
        Line2D([], [], color=INK, linestyle=style, label="stable" if k == 0 else f"index {k}")
        for k, style in STYLES.items()
    ]
    handles.append(Line2D([], [], ls="none", marker="|", ms=10, color=INK, label="threshold"))
    for label, face, edge in (
        ("planar minimum", INK, INK),
        ("planar saddle", "white", INK),
        ("minimum in space", SPACE, SPACE),
        ("saddle in space", "white", SPACE),
    ):
        look = {"markerfacecolor": face, "markeredgecolor": edge, "markersize": 4.4}
        handles.append(Line2D([], [], linestyle="none", marker="o", label=label, **look))  # type: ignore[arg-type]
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.005),
        ncols=5,
        frameon=False,
        fontsize=7.6,
        labelcolor=INK,
        handlelength=2.2,
    )
    return figure


def _index(sweep: Sequence[tuple[float, der.States]], covers: int, kappa: float) -> int:
    """The index of a covered circle as it was found nearest to a natural curvature."""
    known = [
        (abs(kappa0 - kappa), state.index)
        for kappa0, one in sweep
        for state in one.states
        if state.covering == covers and state.repeats == 0 and state.index is not None
    ]
    return min(known)[1]


def _dots(panel: Any, sweep: Sequence[tuple[float, der.States]]) -> None:
    """Every state that was found, filled where it is a minimum."""
    for kappa0, one in sweep:
        for state in one.states:
            colour = INK if state.planar else SPACE
            panel.plot(
                kappa0,
                state.energy,
                "s" if state.needs_cut else "o",
                markersize=4.2,
                markerfacecolor=colour if state.stable else "white",
                markeredgecolor=colour,
                markeredgewidth=0.8,
                zorder=5,
            )
