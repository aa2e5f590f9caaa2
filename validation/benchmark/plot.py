"""The two pictures of `der bench`: error over time with its Pareto front, and cost over N."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from der.paper.canvas import INK, QUIET, page
from validation.benchmark.methods import BOUNDARY_VALUE, RELAXATION, STEPPING
from validation.benchmark.rows import Trial, front
from validation.benchmark.state import PEER

if TYPE_CHECKING:
    from der.paper.canvas import Axes, Figure
    from validation.benchmark.scaling import Scale

# Okabe and Ito's colours, rod in warm ones and peers in cold: (colour, marker, filled, numbered)
LOOKS = {
    "rod, sector": ("#D55E00", "o", True, True),
    "rod, sector, index": ("#D55E00", "o", False, False),
    "rod, full ring": ("#E69F00", "s", True, False),
    "rod, full ring, index": ("#E69F00", "s", False, False),
    "rod, turning angle": ("#CC79A7", "^", True, False),
    "rod, tangent": ("#CC79A7", "v", False, False),
    "rod, finite EA": ("#999999", "D", True, False),
    "rod, extrapolated": ("#882255", "*", True, True),
    RELAXATION: ("#009E73", "P", True, True),
    BOUNDARY_VALUE: ("#0072B2", "o", True, True),
    STEPPING: ("#56B4E9", "s", True, True),
    PEER: ("#000000", "X", True, True),
}
COLUMNS = 4


def figure_of_errors(trials: Sequence[Trial]) -> Figure:
    """Error of M or U, the larger, over CPU time; axes for each ring, the legend in a free one."""
    rings = list(dict.fromkeys(trial.ring for trial in trials))
    lines = math.ceil((len(rings) + 1) / COLUMNS)
    figure = page(3.7 * COLUMNS, 3.4 * lines)
    all_axes = list(figure.subplots(lines, COLUMNS, squeeze=False, sharey=True).ravel())
    for axes, ring in zip(all_axes, rings, strict=False):
        _draw_ring(axes, [trial for trial in trials if trial.ring == ring])
        axes.set_title(ring, fontsize=10, color=INK)
    for axes in all_axes[len(rings) :]:
        axes.set_axis_off()
    for axes in all_axes[::COLUMNS]:
        axes.set_ylabel("error of M or U (the larger)", fontsize=9, color=INK)
    handles, labels = _legend(all_axes, [trial.method for trial in trials])
    all_axes[len(rings)].legend(handles, labels, frameon=False, fontsize=9, loc="center left")
    edge = 0.25 / lines
    figure.subplots_adjust(0.045, 0.55 * edge, 0.99, 1.0 - 0.36 * edge, 0.09, 0.28)
    return figure


def _legend(all_axes: Sequence[Axes], methods: Sequence[str]) -> tuple[list[object], list[str]]:
    """One entry for each method that is drawn anywhere, and the front."""
    found = {}
    for axes in all_axes:
        found.update(dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True)))
    names = [name for name in LOOKS if name in methods and name in found]
    names += ["Pareto front"] * ("Pareto front" in found)
    return [found[name] for name in names], names


def _draw_ring(axes: Axes, trials: Sequence[Trial]) -> None:
    """Points of each method, joined in their order, and the front as a step line."""
    for method, (colour, marker, filled, numbered) in LOOKS.items():
        ours = [t for t in trials if t.method == method and t.error is not None]
        if not ours:
            continue
        axes.plot(
            *_places(ours),
            color=colour,
            marker=marker,
            markersize=8 if marker == "*" else 4.5,
            markerfacecolor=colour if filled else "white",
            linewidth=0.9,
            alpha=0.95,
            label=method,
            zorder=4 if numbered else 3,
        )
        for trial in (ours[0], ours[-1])[: len(ours)] if numbered else ():
            _number(axes, trial, colour)
    broad: dict[str, Any] = {"color": QUIET, "linewidth": 5.0, "alpha": 0.35, "zorder": 1}
    axes.step(*_places(front(trials)), where="post", label="Pareto front", **broad)
    axes.margins(x=0.13)
    _dress(axes, "CPU time, s")


def _places(trials: Sequence[Trial]) -> tuple[list[float], list[float]]:
    return [trial.cpu for trial in trials], [trial.error or math.nan for trial in trials]


def _number(axes: Axes, trial: Trial, colour: str) -> None:
    """Write the setting beside its point: left of the fastest method, away from the others."""
    left = trial.method == BOUNDARY_VALUE
    axes.annotate(
        trial.setting,
        (trial.cpu, trial.error or 0.0),
        textcoords="offset points",
        xytext=(-5, -3) if left else (5, 3),
        horizontalalignment="right" if left else "left",
        fontsize=6.5,
        color=colour,
        zorder=5,
    )


def figure_of_costs(scales: Sequence[Scale]) -> Figure:
    """A Newton iteration an edge, a path, and memory, over the number of edges."""
    figure = page(12.0, 3.6)
    iteration, path, memory = figure.subplots(1, 3)
    rod, iterated = LOOKS["rod, sector"][0], LOOKS[BOUNDARY_VALUE][0]

    def draw(axes: Axes, values: list[float], look: str, colour: str, label: str = "") -> None:
        width = 1.0 if colour == QUIET else 1.5
        sizes = [s.n for s in scales]
        axes.plot(sizes, values, look, color=colour, markersize=5, linewidth=width, label=label)

    draw(iteration, [1e6 * s.newton / s.n for s in scales], "o-", rod)
    draw(path, [s.path for s in scales], "o-", rod, "0 to pi")
    draw(path, [scales[-1].path * s.n / scales[-1].n for s in scales], "--", QUIET, "~ N")
    draw(memory, [1e-6 * s.held for s in scales], "s-", iterated, "iteration, full ring")
    kept = [1e-6 * s.path_memory for s in scales]
    draw(memory, kept, "o-", rod, "path, quarter, all states kept")
    for axes, title, label in (
        (iteration, "one Newton iteration per edge, full ring", "CPU time, microseconds"),
        (path, "a path, quarter of the ring", "CPU time, s"),
        (memory, "memory", "held at once, MB"),
    ):
        axes.set_title(title, fontsize=10, color=INK)
        axes.set_ylabel(label, fontsize=9, color=INK)
        _dress(axes, "N, edges of the full ring")
        if axes is not iteration:
            axes.legend(frameon=False, fontsize=8.5)
    iteration.set_ylim(0.1, 10.0)
    figure.subplots_adjust(0.05, 0.135, 0.99, 0.92, 0.24)
    return figure


def _dress(axes: Axes, across: str) -> None:
    """Logarithmic axes with a quiet grid."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
    axes.tick_params(labelsize=8, color=QUIET, labelcolor=INK, direction="in", which="both")
    axes.set_xlabel(across, fontsize=9, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(QUIET)
