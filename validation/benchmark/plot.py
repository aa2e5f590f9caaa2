"""The two pictures of `der bench`: error over time with its Pareto front, and cost over N."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

from der.paper.canvas import INK, QUIET, page, save
from validation.benchmark.methods import STEPPING
from validation.benchmark.rows import Trial

if TYPE_CHECKING:
    from der.paper.canvas import Axes, Figure
    from validation.benchmark.scaling import Scale

# Okabe and Ito's colours, rod in warm ones and peers in cold: (colour, marker, filled)
LOOKS = {
    "rod, sector": ("#D55E00", "o", True),
    "rod, sector, index": ("#D55E00", "o", False),
    "rod, full ring": ("#E69F00", "s", True),
    "rod, full ring, index": ("#E69F00", "s", False),
    "rod, turning angle": ("#CC79A7", "^", True),
    "rod, tangent": ("#CC79A7", "v", False),
    "rod, finite EA": ("#999999", "D", True),
    "rod, extrapolated": ("#882255", "*", True),
    "dynamic relaxation": ("#009E73", "P", True),
    "boundary value": ("#0072B2", "o", True),
    STEPPING: ("#56B4E9", "s", True),
    "PyElastica, closed ring": ("#000000", "X", True),
}
NUMBERED = (
    "rod, sector",
    "rod, extrapolated",
    "PyElastica, closed ring",
    "dynamic relaxation",
    "boundary value",
    STEPPING,
)
COLUMNS = 4


def front(trials: Iterable[Trial]) -> list[Trial]:
    """The trials that none beats in both time and error, from fast to exact."""
    best: list[Trial] = []
    for trial in sorted((t for t in trials if t.error is not None), key=lambda t: (t.cpu, t.error)):
        if not best or (trial.error or 0.0) < (best[-1].error or 0.0):
            best.append(trial)
    return best


def draw_errors(trials: Sequence[Trial], file: File) -> File:
    """Write the picture of error over CPU time, a panel for each ring."""
    return save(figure_of_errors(trials), file)


def draw_costs(scales: Sequence[Scale], file: File) -> File:
    """Write the picture of time and memory over the number of edges."""
    return save(figure_of_costs(scales), file)


def figure_of_errors(trials: Sequence[Trial]) -> Figure:
    """Error of M or U, the larger, over CPU time; one panel a ring, the legend in a free one."""
    rings = list(dict.fromkeys(trial.ring for trial in trials))
    lines = math.ceil((len(rings) + 1) / COLUMNS)
    figure = page(3.7 * COLUMNS, 3.4 * lines)
    panels = list(figure.subplots(lines, COLUMNS, squeeze=False, sharey=True).ravel())
    for panel, ring in zip(panels, rings, strict=False):
        _draw_ring(panel, [trial for trial in trials if trial.ring == ring])
        panel.set_title(ring, fontsize=10, color=INK)
    for panel in panels[len(rings) :]:
        panel.set_axis_off()
    for panel in panels[::COLUMNS]:
        panel.set_ylabel("error of M or U (the larger)", fontsize=9, color=INK)
    handles, labels = _legend(panels, [trial.method for trial in trials])
    panels[len(rings)].legend(handles, labels, frameon=False, fontsize=9, loc="center left")
    edge = 0.25 / lines
    figure.subplots_adjust(0.045, 0.55 * edge, 0.99, 1.0 - 0.36 * edge, 0.09, 0.28)
    return figure


def _legend(panels: Sequence[Axes], methods: Sequence[str]) -> tuple[list[object], list[str]]:
    """One entry for each method that is drawn anywhere, and the front."""
    found = {}
    for panel in panels:
        found.update(dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True)))
    names = [name for name in LOOKS if name in methods and name in found]
    names += ["Pareto front"] * ("Pareto front" in found)
    return [found[name] for name in names], names


def _draw_ring(panel: Axes, trials: Sequence[Trial]) -> None:
    """Points of each method, joined in their order, and the front as a step line."""
    for method, (colour, marker, filled) in LOOKS.items():
        ours = [t for t in trials if t.method == method and t.error is not None]
        if not ours:
            continue
        panel.plot(
            [t.cpu for t in ours],
            [t.error or math.nan for t in ours],
            color=colour,
            marker=marker,
            markersize=8 if marker == "*" else 4.5,
            markerfacecolor=colour if filled else "white",
            linewidth=0.9,
            alpha=0.95,
            label=method,
            zorder=4 if method in NUMBERED else 3,
        )
        if method in NUMBERED:
            for trial in (ours[0], ours[-1]) if len(ours) > 1 else ours:
                _number(panel, trial, colour)
    best = front(trials)
    panel.step(
        [t.cpu for t in best],
        [t.error or math.nan for t in best],
        where="post",
        color=QUIET,
        linewidth=5.0,
        alpha=0.35,
        label="Pareto front",
        zorder=1,
    )
    panel.margins(x=0.13)
    _dress(panel, "CPU time, s")


def _number(panel: Axes, trial: Trial, colour: str) -> None:
    """Write the setting beside its point: left of the fastest method, away from the others."""
    left = trial.method == "boundary value"
    panel.annotate(
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
    sizes = [s.n for s in scales]
    rod = LOOKS["rod, sector"][0]
    iteration.plot(sizes, [1e6 * s.newton / s.n for s in scales], "o-", color=rod, markersize=5)
    iteration.set_title("one Newton iteration per edge, full ring", fontsize=10, color=INK)
    iteration.set_ylabel("CPU time, microseconds", fontsize=9, color=INK)
    path.plot(sizes, [s.path for s in scales], "o-", color=rod, markersize=5, label="0 to pi")
    last = scales[-1]
    path.plot(
        sizes, [last.path * n / last.n for n in sizes], "--", color=QUIET, linewidth=1, label="~ N"
    )
    path.set_title("a path, quarter of the ring", fontsize=10, color=INK)
    path.set_ylabel("CPU time, s", fontsize=9, color=INK)
    path.legend(frameon=False, fontsize=8.5)
    held = LOOKS["boundary value"][0]
    memory.plot(
        sizes,
        [1e-6 * s.held for s in scales],
        "s-",
        color=held,
        markersize=5,
        label="iteration, full ring",
    )
    memory.plot(
        sizes,
        [1e-6 * s.path_memory for s in scales],
        "o-",
        color=rod,
        markersize=5,
        label="path, quarter, all states kept",
    )
    memory.set_title("memory", fontsize=10, color=INK)
    memory.set_ylabel("held at once, MB", fontsize=9, color=INK)
    memory.legend(frameon=False, fontsize=8.5)
    for panel in (iteration, path, memory):
        _dress(panel, "N, edges of the full ring")
    iteration.set_ylim(0.1, 10.0)
    figure.subplots_adjust(0.05, 0.135, 0.99, 0.92, 0.24)
    return figure


def _dress(panel: Axes, across: str) -> None:
    """Logarithmic axes with a quiet grid."""
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
    panel.tick_params(labelsize=8, color=QUIET, labelcolor=INK, direction="in", which="both")
    panel.set_xlabel(across, fontsize=9, color=INK)
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(QUIET)
