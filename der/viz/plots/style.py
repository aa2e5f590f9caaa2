"""What pictures of the engine's answers share: colours, title, axes, and how a ring is seen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path as File
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from der.utils.checks import Array
from der.utils.files import FilePath, write_whole

FORMATS = (".png", ".pdf", ".svg")
DPI = 150
INK, QUIET = "#222222", "#8a8a8a"
STABLE, UNSTABLE, FREE = "#0072B2", "#D55E00", "#009E73"  # Okabe and Ito
DASHES = (0, (3.5, 1.6))  # of what is unstable
UNITS = {"vertex_angle": "°"}
BAR = "   |   "  # between the parts of a title
ACROSS = 200  # points along a ring


def save_figure(figure: Figure, file: FilePath) -> None:
    """Write a figure, whole or not at all, in the format of the file's suffix.

    Raises
    ------
    ValueError
        If the suffix is not one of FORMATS or the place cannot be written to.
    """
    suffix = File(file).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"plot must end in {', '.join(FORMATS)}, got {str(file)!r}")
    try:
        write_whole(file, lambda opened: figure.savefig(opened, format=suffix[1:]))
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(f"plot {str(file)!r} cannot be written: {reason}") from problem


def seen(x: Array, points: Array | None = None) -> Array:
    """Smooth closed curve (n, 3) through vertices: to the right, up and towards the reader.

    The ring is seen from 40 degrees off the normal of the plane to which it is closest. With
    ``points`` (k, 3), these as they are seen, instead.
    """
    from scipy.interpolate import CubicSpline

    n = len(x)
    curve = CubicSpline(np.arange(n + 1), np.append(x, x[:1], axis=0), bc_type="periodic")
    fine = curve(np.linspace(0.0, n, ACROSS + 1))
    centre = fine.mean(axis=0)
    right, up, towards = np.linalg.svd(fine - centre, full_matrices=False)[2]
    tilt = math.radians(40.0)
    seen_up = math.cos(tilt) * up + math.sin(tilt) * towards
    seen_towards = -math.sin(tilt) * up + math.cos(tilt) * towards
    shown = fine if points is None else points
    return np.asarray((shown - centre) @ np.stack([right, seen_up, seen_towards], axis=1))


TITLE: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 9.5, "color": INK}


def blank(size: tuple[float, float]) -> Figure:
    """A figure without a display."""
    figure = Figure(figsize=size, dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def title(
    ring: Mapping[str, object], section: Mapping[str, object], numerics: Mapping[str, object]
) -> str:
    """Ring, section and mesh in one line."""
    edges = f"{numerics.get('n_edges')} edges"
    edges = f"extrapolated from {edges}" if numerics.get("error_bars") else edges
    return BAR.join([*about(ring, section), edges])


def about(ring: Mapping[str, object], section: Mapping[str, object]) -> list[str]:
    """Words for a ring and words for its section."""
    parts = [of_ring(ring)]
    if section.get("h_over_t") is not None:
        parts.append(f"h/t = {section['h_over_t']:g}")
    elif section:
        parts.append(rf"$\alpha$ = {section['alpha']:.4g}, $\beta$ = {section['beta']:.4g}")
    return parts


def of_ring(ring: Mapping[str, object]) -> str:
    """Words for a ring."""
    words = [str(ring["shape"])]
    words += [
        f"{name.replace('_over_', '/').replace('_', ' ')} = {value:g}{UNITS.get(name, '')}"
        for name, value in ring.items()
        if isinstance(value, float) and (name, value) != ("natural_curvature", 1.0)
    ]
    if ring.get("twist_axis") == "y":
        words.append("about y")
    return ", ".join(words)


def sure(value: float, error: float) -> str:
    """An extrapolated value with its error, both to the second digit of the error."""
    if not error > 0.0:
        return f"{value:.6g}"
    places = min(max(1 - math.floor(math.log10(error)), 0), 12)
    return f"{value:.{places}f} ± {error:.{places}f}"


def dress(panel: Axes, label: str) -> None:
    """Axes as all pictures have them, with the name of what goes up."""
    panel.set_ylabel(label, fontsize=9, color=INK)
    panel.tick_params(labelsize=8, color=QUIET, labelcolor=INK, direction="in")
    panel.spines[["top", "right"]].set_visible(False)
    panel.spines[["left", "bottom"]].set_color(QUIET)


def mark(marker: str, size: float, face: str = "white") -> dict[str, Any]:
    """How a special state is drawn."""
    return {
        "linestyle": "none",
        "marker": marker,
        "markersize": size,
        "markerfacecolor": face,
        "markeredgecolor": INK,
        "markeredgewidth": 0.9,
    }


def legend_below(figure: Figure, handles: Sequence[Any], *, fontsize: float = 8.0) -> None:
    """A legend along the lower edge, in as many columns as there is width for."""
    if not handles:
        return
    for columns in range(len(handles), 0, -1):
        legend = figure.legend(
            handles=list(handles),
            loc="lower center",
            bbox_to_anchor=(0.5, 0.004),
            ncols=columns,
            frameon=False,
            fontsize=fontsize,
            handlelength=2.0,
            columnspacing=1.6,
            handletextpad=0.5,
            labelspacing=0.35,
            borderaxespad=0.1,
            labelcolor=INK,
        )
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()
