"""Phase diagrams as pictures: regions of folding modes, their boundaries, the paper's cases."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path as File
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from der.diagram.cases import FAILED, LABELS, Case, Row
from der.diagram.families import Family, widest_fillet
from der.diagram.scan import Scan, corners
from der.diagram.scanned_boundaries import Curve, planes
from der.paper import canvas
from der.paper.cases import Array
from der.utils.files import FilePath

Labels = NDArray[np.int64]

NAMES = (*LABELS, FAILED)
# the hue is the snapping, the strength stability
COLOURS = ("#ECECEC", "#C9DFF1", "#FBDCAE", "#62A3D3", "#E69138", "#FFFFFF")
LINES = {  # of boundaries, by kind
    "foldability": {"linestyle": "-", "linewidth": 1.5},
    "stability": {"linestyle": (0, (4, 1.6)), "linewidth": 1.3},
    "snap-back": {"linestyle": (0, (1, 1.3)), "linewidth": 1.5},
    "infinite slope": {"linestyle": (0, (7, 1.2)), "linewidth": 1.5},
    "exchange": {"linestyle": (0, (8, 1.5, 1, 1.5)), "linewidth": 1.5},
}
OTHER = {"linestyle": "-.", "linewidth": 1.0}
MEANINGS = {
    "foldability": "foldability (fold at $\\pi$)",
    "infinite slope": "foldability (infinite slope at $\\pi$)",
    "exchange": "paths exchange",
    "snap-back": "snap-back (cusp)",
}
SYMBOLS = {"circle": "o", "ellipse": "s", "rectangle": "s", "triangle": "^"}
WORDS = {
    "b_over_a": "$b/a$",
    "r_over_a": "$r/a$",
    "vertex_angle": "$\\alpha_T$ [degrees]",
    "natural_curvature": "natural curvature $\\times\\,R$",
    "h_over_t": "$h/t$",
}
LINE = 0.167  # of the legend, inches
IN_A_ROW = 5  # of a legend below slices
FINER = 4  # pixels between two nodes, at least,
PIXELS = 512  # and at least so many across
BETWEEN = 6  # pieces of a line between two points of a curve
UNSEEN = 10.0  # cells: places are not asked beyond a boundary unless there is no other


def save_diagram(
    scan: Scan, curves: Iterable[Curve], file: FilePath, beside: Iterable[Row] = ()
) -> File:
    """Draw a phase diagram: one panel in two dimensions, slices in three; return the file.

    Parameters
    ----------
    beside : rows of other cases than the scan's, such as those solved on the sides of its curves
    """
    curves, beside = list(curves), list(beside)
    draw = _flat if scan.family.dimension == 2 else _slices
    return canvas.save(draw(scan, curves, beside), file)


def _flat(scan: Scan, curves: Sequence[Curve], beside: Sequence[Row]) -> canvas.Figure:
    """The picture of a diagram of two parameters."""
    family = scan.family
    marks = [case for case in family.marks if family.unit(case) is not None]
    wide, columns = (6.6, 3) if len(family.sheets) == 2 else (4.8, 2)
    legend = _legend(scan, curves, marks)
    foot = 0.62 + LINE * math.ceil(len(legend) / columns)
    above = 0.62 if len(family.sheets) == 2 else 0.42
    high = foot + 3.3 + above
    figure = canvas.page(wide, high)
    panel = figure.add_axes((0.62 / wide, foot / high, 1.0 - 0.82 / wide, 3.3 / high))
    _fill(panel, scan, None, curves, beside, marks)
    _dress(panel, family)
    panel.set_xlabel(WORDS[family.parameters[0]], fontsize=10, color=canvas.INK)
    panel.set_ylabel(WORDS[family.parameters[-1]], fontsize=10, color=canvas.INK)
    _head(figure, family, 0.62 / wide, 1 - 0.19 / high)
    _show_legend(figure, legend, columns)
    return figure


def _slices(scan: Scan, curves: Sequence[Curve], beside: Sequence[Row]) -> canvas.Figure:
    """The picture of a diagram of three parameters: slices at parts of the second's range."""
    family = scan.family
    cut = list(planes(family))
    columns = 3
    lines = math.ceil(len(cut) / columns)
    legend = _legend(scan, curves, [m for m in family.marks if any(_at(family, m, k) for k in cut)])
    foot = 0.66 + LINE * math.ceil(len(legend) / IN_A_ROW)
    wide, high = 10.2, foot + 0.6 + (2.3 if len(family.sheets) == 2 else 2.15) * lines
    figure = canvas.page(wide, high)
    grid = figure.add_gridspec(
        lines,
        columns,
        left=0.5 / wide,
        right=1 - 0.15 / wide,
        bottom=foot / high,
        top=1 - 0.72 / high,
        wspace=0.06,
        hspace=0.3 if len(family.sheets) == 2 else 0.2,
    )
    for n, k in enumerate(cut):
        panel = figure.add_subplot(grid[n // columns, n % columns])
        here = [curve for curve in curves if _in_slice(family, curve, k)]
        marks = [case for case in family.marks if _at(family, case, k)]
        near = [row for row in beside if _at(family, row.case, k)]
        _fill(panel, scan, k, here, near, marks)
        _dress(panel, family, small=True)
        title = 0.175 if len(family.sheets) == 2 else 0.04
        place = panel.get_window_extent().height / canvas.DPI
        look = {"fontsize": 8.5, "va": "bottom", "transform": panel.transAxes}
        canvas.words(panel, (0.5, 1.0 + title / place), _slice_name(family, k), **look)
        panel.tick_params(labelleft=n % columns == 0, labelbottom=n + columns >= len(cut))
        if n % columns == 0:
            panel.set_ylabel(WORDS[family.parameters[-1]], fontsize=9.5, color=canvas.INK)
        if n + columns >= len(cut):
            panel.set_xlabel(WORDS[family.parameters[0]], fontsize=9.5, color=canvas.INK)
    _head(figure, family, 0.5 / wide, 1 - 0.2 / high)
    _show_legend(figure, legend, IN_A_ROW)
    return figure


def _head(figure: Any, family: Family, x: float, y: float) -> None:
    """The title of the page."""
    words = f"{family.title}, $\\nu$ = {family.nu:g}"
    figure.text(x, y, words, fontsize=10.5, color=canvas.INK, va="center")


def _slice_name(family: Family, k: int) -> str:
    """Which fillets a slice shows: from the sharpest, the same for all rings, to the widest."""
    low, high = family.ranges[1]
    widest = "b" if family.shape == "rectangle" else "R_C"
    if k == 0:
        return f"$r/a$ = {low:g}"
    if high < max(widest_fillet(family.shape, {family.parameters[0]: v}) for v in family.ranges[0]):
        widest = f"\\min({widest}, {high:g}a)"
    if k == family.finest:
        return f"$r = {widest}$"
    part = k / family.finest
    return f"$r = {low:g}a + {part:g}\\,({widest} - {low:g}a)$"


def _at(family: Family, case: Case, k: int) -> bool:
    """Whether a case lies in a slice."""
    unit = family.unit(case)
    return unit is not None and abs(unit[1] * family.finest - k) < 1e-4


def _in_slice(family: Family, curve: Curve, k: int) -> bool:
    return all(_at(family, point.case, k) for point in curve.points)


# --- Regions ---------------------------------------------------------------------------------


def _fill(
    panel: Any,
    scan: Scan,
    k: int | None,
    curves: Sequence[Curve],
    beside: Sequence[Row],
    marks: Sequence[Case],
) -> None:
    """Draw regions, boundaries and marked cases; k: those in this plane of the lattice."""
    from matplotlib.colors import ListedColormap

    family = scan.family
    low, high = family.span
    for sheet in family.sheets:
        sides = (low, high) if sheet == family.sheets[0] else (2.0 * high - low, high)
        panel.imshow(
            _regions(
                scan, sheet, k, _segments(family, sheet, curves), _others(family, sheet, beside)
            ).T,
            extent=(*sides, *family.ranges[-1]),
            cmap=ListedColormap(COLOURS),
            vmin=-0.5,
            vmax=len(COLOURS) - 0.5,
            origin="lower",
            aspect="auto",
            interpolation="nearest",
            zorder=0,
        )
    _draw_curves(panel, family, curves)
    for case in marks:
        here = _across(family, case.twist_axis, [case]), [case.h_over_t]
        panel.plot(*here, **_symbol(case, family), clip_on=False, zorder=6)


class Others(NamedTuple):
    """Cases beside the nodes of a plane."""

    places: Array  # (m, 2) in units of the lattice
    labels: Labels  # (m,)


NONE = Others(np.empty((0, 2)), np.empty(0, dtype=np.int64))


def _regions(
    scan: Scan, sheet: str, k: int | None, segments: Array, others: Others = NONE
) -> Labels:
    """Number of the label at fine places between the nodes of a plane.

    Where a boundary passes (segments, (m, 2, 2), in units of the lattice), it is that of the
    nearest case on the same side; elsewhere, whether a ring can be folded and snaps back is what
    most of the neighbours do, weighted by distance; whether it is stable is the sign of the slope
    at pi, interpolated.
    """
    labels, slopes = _nodes(scan, sheet, k)
    n = len(labels)
    finer = max(FINER, PIXELS // (n - 1))
    place = (np.arange(finer * (n - 1)) + 0.5) / finer
    weight = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(n)))

    def mean(values: Array | NDArray[np.bool_]) -> Array:
        spread: Array = weight @ values.astype(float) @ weight.T
        return spread

    foldable = (labels > 0) & (labels < NAMES.index(FAILED))
    back = foldable & np.isin(labels, [NAMES.index(name) for name in LABELS if "back" in name])
    stable = mean(np.where(foldable, slopes, 0.0)) > 0.0
    snaps_back = mean(back) > 0.5 * mean(foldable)
    found: Labels = np.where(stable, 3, 1) + np.where(snaps_back, 1, 0)
    parts = [mean(labels == 0), mean(foldable), mean(labels == NAMES.index(FAILED))]
    winner = np.argmax(parts, axis=0)
    found[winner == 0] = 0
    found[winner == 2] = NAMES.index(FAILED)
    _take_sides(found, labels, segments, others)
    return found


def _others(family: Family, sheet: str, rows: Iterable[Row]) -> Others:
    """Solved cases of a sheet."""
    places, labels = [], []
    for row in rows:
        unit = family.unit(row.case)
        if row.ok and unit is not None and (row.case.twist_axis == sheet or unit[0] == 1.0):
            places.append((unit[0] * family.finest, unit[-1] * family.finest))
            labels.append(NAMES.index(row.label))
    return Others(np.array(places).reshape(-1, 2), np.array(labels, dtype=np.int64))


def _segments(family: Family, sheet: str, curves: Iterable[Curve]) -> Array:
    """The pieces of a sheet's boundaries, (m, 2, 2), in units of the lattice."""
    pieces: list[Array] = [np.empty((0, 2, 2))]
    for curve in curves:
        units = [family.unit(point.case) for point in curve.points]
        at = np.array([(u[0], u[-1]) for u in units if u is not None]) * family.finest
        if curve.twist_axis == sheet and len(at) > 1:
            at = _smooth(curve.kind, at)
            pieces.append(np.stack([at[:-1], at[1:]], axis=1))
    return np.concatenate(pieces)


def _smooth(kind: str, places: Array) -> Array:
    """A curve through places in order, (n, 2), with more between them.

    Akima's, which does not swing at a kink; what was scanned or bisected is left as it is.
    """
    from scipy.interpolate import Akima1DInterpolator

    apart = np.linalg.norm(np.diff(places, axis=0), axis=1)
    places = places[np.append(True, apart > 1e-9 * apart.max())]
    if len(places) < 3 or kind.endswith(")"):
        return places
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
    n = np.arange(BETWEEN * (len(places) - 1) + 1) / BETWEEN
    smooth: Array = Akima1DInterpolator(along, places)(np.interp(n, np.arange(len(along)), along))
    return smooth


def _take_sides(found: Labels, labels: Labels, segments: Array, others: Others) -> None:
    """Where labels differ within a cell, put right what lies on the other side of a boundary."""
    finer = len(found) // (len(labels) - 1)
    low, high = segments.min(axis=1), segments.max(axis=1)
    inner = (np.arange(finer) + 0.5) / finer
    offsets = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    around = [labels[:-1, :-1], labels[:-1, 1:], labels[1:, :-1], labels[1:, 1:]]
    mixed = np.ptp(around, axis=0) > 0
    homes = np.clip(others.places.astype(np.int64), 0, len(labels) - 2)
    mixed[tuple(homes[others.labels != around[0][tuple(homes.T)]].T)] = True
    for i, j in np.argwhere(mixed):
        near = ((low <= (i + 1, j + 1)) & (high >= (i, j))).all(axis=1)
        if not near.any():
            continue
        here = np.array((i, j))
        own = (homes == here).all(axis=1)
        cases = np.concatenate([here + steps, others.places[own]])
        names = np.concatenate([labels[tuple((here + steps).T)], others.labels[own]])
        places = here + offsets
        far = np.linalg.norm(places[:, None] - cases, axis=2)
        far[_crossed(places, cases, segments[near])] = np.inf
        block = found[i * finer : (i + 1) * finer, j * finer : (j + 1) * finer]
        hidden = np.isinf(far.min(axis=1))
        chosen = np.where(hidden, block.ravel(), names[np.argmin(far, axis=1)])
        if hidden.any() and not hidden.all():  # no case on its side is seen: what lies beside has
            far = np.linalg.norm(places[hidden, None] - places[~hidden], axis=2)
            far[_crossed(places[hidden], places[~hidden], segments[near])] += UNSEEN
            chosen[hidden] = chosen[~hidden][np.argmin(far, axis=1)]
        block[...] = chosen.reshape(block.shape)


def _crossed(places: Array, nodes: Array, segments: Array) -> NDArray[np.bool_]:
    """Whether a segment lies between place and node, (places, nodes)."""
    p, q = places[:, None, None], nodes[None, :, None]
    a, b = segments[:, 0], segments[:, 1]
    sides = _turn(p, q, a) * _turn(p, q, b) < 0.0
    ends = _turn(a, b, p) * _turn(a, b, q) < 0.0
    crossed: NDArray[np.bool_] = np.any(sides & ends, axis=2)
    return crossed


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Twice the area of a triangle, positive where it is traversed to the left."""
    u, v = b - a, c - a
    area: Array = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return area


def _nodes(scan: Scan, sheet: str, k: int | None) -> tuple[Labels, Array]:
    """Number of the label, and slope at pi, at every node of a plane.

    Inside a cell labels are those of its corners, and slopes are interpolated.
    """
    n = scan.family.finest + 1
    labels = np.full((n, n), NAMES.index(FAILED))
    slopes = np.zeros((n, n))
    for cell in scan.cells:
        (axis, low), edge = cell
        if axis != sheet or (k is not None and not low[1] <= k <= low[1] + edge):
            continue
        rows = [scan.rows[node] for node in corners(cell)]
        i, j = low[0], low[-1]
        here = np.s_[i : i + edge + 1, j : j + edge + 1]
        label = next((row.label for row in rows if row.ok), FAILED)
        labels[here] = NAMES.index(label)
        # of a cube the mean of both faces: uniform cells, whose sign is all that is seen
        at = np.array([row.slope or 0.0 for row in rows]).reshape((2,) * len(low))
        corner = at if k is None else at.mean(axis=1)
        ramp = np.linspace((1.0, 0.0), (0.0, 1.0), edge + 1)
        slopes[here] = ramp @ corner @ ramp.T
    for (axis, place), row in scan.rows.items():
        if axis == sheet and (k is None or place[1] == k):
            labels[place[0], place[-1]] = NAMES.index(row.label)
            slopes[place[0], place[-1]] = row.slope or 0.0
    return labels, slopes


# --- What lies on top ------------------------------------------------------------------------


def _draw_curves(panel: Any, family: Family, curves: Iterable[Curve]) -> None:
    """Draw boundaries; a ring with b = a lies on its curve's side."""
    for curve in curves:
        cases = [point.case for point in curve.points]
        x = _across(family, curve.twist_axis, cases)
        low, high = family.ranges[-1]
        side = np.array([family.span[1] - family.span[0], high - low])
        y = [case.h_over_t for case in cases]
        x, y = side[:, None] * _smooth(curve.kind, np.stack([x, y], axis=1) / side).T
        panel.plot(x, y, color=canvas.INK, zorder=3, **_line(curve.kind))


def _across(family: Family, axis: str, cases: Iterable[Case]) -> list[float]:
    """Where cases lie across a panel; the second axis is mirrored at the first's end."""
    values = [float(getattr(case, family.parameters[0])) for case in cases]
    high = family.span[1]
    return values if axis == family.sheets[0] else [2.0 * high - value for value in values]


def _line(kind: str) -> Any:
    return LINES.get(kind.removesuffix(" (scan)"), OTHER)


def _symbol(case: Case, family: Family) -> dict[str, Any]:
    """The look of a case that the paper shows."""
    round_one = case.shape == "circle" or (case.shape == "ellipse" and case.b_over_a == 1.0)
    return {
        "linestyle": "none",
        "marker": "o" if round_one else SYMBOLS[family.shape],
        "markersize": 5.0,
        "markerfacecolor": "white",
        "markeredgecolor": canvas.INK,
        "markeredgewidth": 1.0,
    }


def _dress(panel: Any, family: Family, *, small: bool = False) -> None:
    """Limits and ticks of a panel; two axes are joined where they meet."""
    low, high = family.span
    both = len(family.sheets) == 2
    panel.set_xlim(low, 2.0 * high - low if both else high)
    panel.set_ylim(*family.ranges[-1])
    panel.tick_params(labelsize=8 if small else 8.5, color=canvas.QUIET, labelcolor=canvas.INK)
    for spine in panel.spines.values():
        spine.set_color(canvas.QUIET)
    if both:
        _join(panel, family, small=small)
    elif small:
        from matplotlib.ticker import MaxNLocator

        panel.xaxis.set_major_locator(MaxNLocator(6, prune="upper"))


def _join(panel: Any, family: Family, *, small: bool) -> None:
    """Ticks from both sides towards the ring that is the same about both axes."""
    low, high = family.span
    from matplotlib.ticker import MaxNLocator

    inner = MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(low, high)
    first = low + 1e-9 if small else low - 1e-9  # beside the next panel's there is no room
    values = [float(v) for v in inner if first <= v <= high + 1e-9]
    values = values if any(abs(v - high) < 1e-9 for v in values) else [*values, high]
    mirrored = [2.0 * high - v for v in values if abs(v - high) > 1e-9]
    words = [f"{v:.3g}" for v in values]
    panel.set_xticks([*values, *mirrored], [*words, *words[: len(mirrored)]])
    panel.axvline(high, color=canvas.INK, linewidth=0.6, zorder=2)
    for at, axis in ((0.25, family.sheets[0]), (0.75, family.sheets[1])):
        look = {"fontsize": 8 if small else 9, "transform": panel.transAxes, "va": "bottom"}
        canvas.words(panel, (at, 1.015), f"${axis}$-axis twisting", **look)


def _legend(scan: Scan, curves: Sequence[Curve], marks: Sequence[Case]) -> list[Any]:
    """What colours, lines and symbols mean."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    there = {row.label for row in scan.rows.values()}
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor=canvas.QUIET, linewidth=0.6, label=name)
        for name, colour in zip(NAMES, COLOURS, strict=True)
        if name in there
    ]
    for kind in sorted({curve.kind for curve in curves}):
        words = MEANINGS.get(kind, kind)
        handles.append(Line2D([], [], color=canvas.INK, label=words, **_line(kind)))
    symbols = {_symbol(case, scan.family)["marker"]: case for case in marks}
    for marker, case in symbols.items():
        name = "circle" if marker == "o" else case.shape
        look = _symbol(case, scan.family)
        handles.append(Line2D([], [], label=f"{name}, shown in the paper", **look))
    return handles


def _show_legend(figure: Any, handles: list[Any], columns: int) -> None:
    """The legend at the foot of the page."""
    figure.legend(
        handles=handles,
        loc="lower center",
        bbox_to_anchor=(0.5, 0.012),
        ncols=columns,
        frameon=False,
        fontsize=8,
        labelcolor=canvas.INK,
        handlelength=2.0,
        columnspacing=1.6,
        borderpad=0.0,
    )
