"""Phase diagrams as pictures: regions of folding modes, their boundaries, the paper's cases."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from der.utils.checks import Array
from der.viz.palette import INK, QUIET
from der.viz.plots import style
from der.viz.plots.regions import Boundary, Sheet, pixels

DPI = 200
REGIONS = (  # name and colour by label: the hue is the snapping, dark is what stays folded
    ("not foldable", "#ECECEC"),
    ("unstable at fixed $M$, snap-through", "#DCEAF6"),
    ("unstable at fixed $M$, snap-back", "#FDEBCF"),
    ("stable at fixed $M$ only, snap-through", "#B4D2EA"),
    ("stable at fixed $M$ only, snap-back", "#F8CE93"),
    ("stays folded when released, snap-through", "#4A8FC4"),
    ("stays folded when released, snap-back", "#DD7F22"),
    ("failed", "#FFFFFF"),
)
BOUNDARIES: dict[str, tuple[str, Any, float]] = {  # name, line style and width by kind
    "foldability": ("foldability (fold at $\\pi$)", "-", 1.5),
    "stability": ("stability at fixed $M$", (0, (4, 1.6)), 1.3),
    "stays folded": ("stays folded when released", (0, (1.7, 0.7)), 2.4),
    "snap-back": ("snap-back (cusp)", (0, (1, 1.3)), 1.5),
    "infinite slope": ("foldability (infinite slope at $\\pi$)", (0, (7, 1.2)), 1.5),
    "exchange": ("branch exchange", (0, (8, 1.5, 1, 1.5)), 1.5),
}
GAPS = {"stays folded": "#FFFFFF"}  # of dashes: it hides the curve of stability where they are one
SYMBOLS = {"circle": "o", "ellipse": "s", "rectangle": "s", "triangle": "^"}
PARAMETERS = {
    "b_over_a": "$b/a$",
    "r_over_a": "$r/a$",
    "vertex_angle": "$\\alpha_T$ [degrees]",
    "natural_curvature": "natural curvature $\\times\\,R$",
    "h_over_t": "$h/t$",
}
COLUMNS = 3  # of slices


class Mark(NamedTuple):
    """A case that the paper shows."""

    shape: str
    axis: str
    place: Array  # (2,)


class Slice(NamedTuple):
    """One plane of a diagram; places are in unit coordinates."""

    title: str  # "" where it is the only one
    sheets: tuple[Sheet, ...]  # one for each twisting axis
    boundaries: tuple[Boundary, ...]
    marks: tuple[Mark, ...]


@dataclass(frozen=True, eq=False)
class DiagramPicture:
    """What is drawn of a phase diagram."""

    title: str
    parameters: tuple[str, str]  # across and up
    spans: tuple[tuple[float, float], tuple[float, float]]  # first and last value of both
    slices: tuple[Slice, ...]

    @property
    def mirrored(self) -> bool:
        """Whether the regions of two twisting axes are joined at the first parameter's end."""
        return len(self.slices[0].sheets) == 2

    def values(self, places: Array, axis: str) -> Array:
        """Parameters (..., 2) of unit coordinates; the second axis is mirrored."""
        low, high = np.array(self.spans).T
        found = low + places * (high - low)
        if axis != self.slices[0].sheets[0].axis:
            found[..., 0] = 2.0 * high[0] - found[..., 0]
        return np.asarray(found)


def draw(diagram: DiagramPicture) -> Figure:
    """The picture of a phase diagram: one plane, or slices of three dimensions."""
    several = len(diagram.slices) > 1
    figure, panels = _several(diagram) if several else _one(diagram)
    for n, (axes, one) in enumerate(zip(panels, diagram.slices, strict=True)):
        _draw_slice(axes, diagram, one)
        _label(axes, diagram, small=several)
        left, bottom = n % COLUMNS == 0, n + COLUMNS >= len(panels)
        axes.tick_params(labelleft=left, labelbottom=bottom)
        axes.set_xlabel(PARAMETERS[diagram.parameters[0]] if bottom else "", color=INK)
        axes.set_ylabel(PARAMETERS[diagram.parameters[1]] if left else "", color=INK)
        axes.set_title(one.title, fontsize=8.5, color=INK, pad=14.0 if diagram.mirrored else 4.0)
    style.legend_below(figure, _entries(diagram))
    return figure


def _one(diagram: DiagramPicture) -> tuple[Figure, list[Axes]]:
    """The page of one plane."""
    width, height = (6.6, 5.62) if diagram.mirrored else (4.8, 5.42)
    figure = style.blank(width, height, diagram.title, dpi=DPI)
    box = (0.62 / width, 1.7 / height, 1.0 - 0.82 / width, 3.3 / height)
    return figure, [figure.add_axes(box)]


def _several(diagram: DiagramPicture) -> tuple[Figure, list[Axes]]:
    """The page of slices."""
    rows = math.ceil(len(diagram.slices) / COLUMNS)
    each, gap = (2.3, 0.3) if diagram.mirrored else (2.15, 0.2)
    width, height = 10.2, each * rows + 2.1
    figure = style.blank(width, height, diagram.title, dpi=DPI)
    sides = {"left": 0.5 / width, "right": 1 - 0.15 / width}
    sides |= {"bottom": 1.25 / height, "top": 1 - 0.72 / height, "wspace": 0.06, "hspace": gap}
    grid = figure.add_gridspec(rows, COLUMNS, **sides)
    return figure, [
        figure.add_subplot(grid[divmod(n, COLUMNS)]) for n in range(len(diagram.slices))
    ]


def _draw_slice(axes: Axes, diagram: DiagramPicture, one: Slice) -> None:
    """Draw regions, boundaries and marked cases."""
    ends = np.array([(0.0, 0.0), (1.0, 1.0)])
    colours = ListedColormap([colour for _, colour in REGIONS])
    look: dict[str, Any] = {"cmap": colours, "vmin": -0.5, "vmax": len(REGIONS) - 0.5, "zorder": 0}
    look |= {"origin": "lower", "aspect": "auto", "interpolation": "nearest"}
    for sheet in one.sheets:
        (left, low), (right, high) = diagram.values(ends, sheet.axis).tolist()
        axes.imshow(pixels(sheet, one.boundaries).T, extent=(left, right, low, high), **look)
    for boundary in one.boundaries:
        x, y = diagram.values(boundary.line, boundary.axis).T
        axes.plot(x, y, zorder=3, **_line(boundary.kind)[1])
    for case in one.marks:
        place = diagram.values(case.place, case.axis)
        axes.plot(*place, clip_on=False, zorder=6, **style.mark(SYMBOLS[case.shape], 5.0))


def _line(kind: str) -> tuple[str, dict[str, Any]]:
    """Name and look of a boundary."""
    own = kind.removesuffix(" (scan)")
    name, dashes, width = BOUNDARIES.get(own, (kind, "-.", 1.0))
    look = {"color": INK, "linestyle": dashes, "linewidth": width, "gapcolor": GAPS.get(own)}
    return name if own == kind else kind, look


def _label(axes: Axes, diagram: DiagramPicture, *, small: bool) -> None:
    """Limits and ticks; the regions of two twisting axes are joined where they meet."""
    (low, high), up = diagram.spans
    axes.set_xlim(low, 2.0 * high - low if diagram.mirrored else high)
    axes.set_ylim(*up)
    axes.tick_params(labelsize=8 if small else 8.5, color=QUIET, labelcolor=INK)
    for spine in axes.spines.values():
        spine.set_color(QUIET)
    if diagram.mirrored:
        _join(axes, diagram, small=small)
    elif small:
        axes.xaxis.set_major_locator(MaxNLocator(6, prune="upper"))


def _join(axes: Axes, diagram: DiagramPicture, *, small: bool) -> None:
    """Ticks of both twisting axes, which meet at the ring that is the same about both."""
    low, high = diagram.spans[0]
    inner = MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(low, high)
    first = (
        low + 1e-9 if small else low - 1e-9
    )  # in a slice, the first tick would overlap the neighbour's
    values = [float(v) for v in inner if first <= v < high - 1e-9]
    ticks = [*values, high, *(2.0 * high - v for v in values)]
    axes.set_xticks(ticks, [f"{min(v, 2.0 * high - v):.3g}" for v in ticks])
    axes.axvline(high, color=INK, linewidth=0.6, zorder=2)
    for at, sheet in zip((0.25, 0.75), diagram.slices[0].sheets, strict=True):
        look = {"va": "bottom", "fontsize": 8 if small else 9, "transform": axes.transAxes}
        style.place_text(axes, (at, 1.015), f"${sheet.axis}$-axis twisting", **look)


def _entries(diagram: DiagramPicture) -> list[Any]:
    """What colours, lines and symbols mean, of those that occur."""
    sheets = [sheet for one in diagram.slices for sheet in one.sheets]
    labels = set(np.unique([sheet.labels for sheet in sheets]).tolist())
    kinds = sorted({boundary.kind for one in diagram.slices for boundary in one.boundaries})
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor=QUIET, linewidth=0.6, label=name)
        for k, (name, colour) in enumerate(REGIONS)
        if k in labels
    ]
    handles += [style.entry(name, **look) for name, look in map(_line, kinds)]
    symbols = dict.fromkeys(case.shape for one in diagram.slices for case in one.marks)
    handles += [
        style.entry(f"{shape}, shown in the paper", **style.mark(SYMBOLS[shape], 5.0))
        for shape in symbols
    ]
    return handles
