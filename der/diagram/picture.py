"""What is drawn of a phase diagram: a scan and its boundaries in unit coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from der.diagram.cases import FAILED, LABELS, Case, Row
from der.diagram.families import Family, widest_fillet
from der.diagram.scan import Scan, corners
from der.diagram.scanned_boundaries import Curve, planes
from der.utils.checks import Array
from der.viz.plots.phase_diagram import DiagramPicture, Mark, Slice
from der.viz.plots.regions import Boundary, Labels, Sheet

NUMBERS = {name: k for k, name in enumerate((*LABELS, FAILED))}


def picture(scan: Scan, curves: Sequence[Curve], beside: Sequence[Row] = ()) -> DiagramPicture:
    """What is drawn of a scan: one plane in two dimensions, slices in three.

    Parameters
    ----------
    beside : rows of other cases than the scan's, such as those solved on the sides of its curves
    """
    family = scan.family
    cuts = [None] if family.dimension == 2 else list(planes(family))
    return DiagramPicture(
        f"{family.title}, ν = {family.nu:g}",
        (family.parameters[0], family.parameters[-1]),
        (family.span, family.ranges["h_over_t"]),
        tuple(_slice(scan, k, curves, beside) for k in cuts),
    )


def _slice(scan: Scan, k: int | None, curves: Iterable[Curve], beside: Iterable[Row]) -> Slice:
    """A plane of the lattice; k: its place on the second of three axes."""
    family = scan.family
    rows = [row for row in beside if row.ok and _at(family, row.case, k)]
    return Slice(
        "" if k is None else _name(family, k),
        tuple(_sheet(scan, axis, k, rows) for axis in family.sheets),
        tuple(
            Boundary(curve.kind, curve.twist_axis, _places(family, [p.case for p in curve.points]))
            for curve in curves
            if k is None or all(_at(family, point.case, k) for point in curve.points)
        ),
        tuple(
            Mark(_shape(case), case.twist_axis, _places(family, [case])[0])
            for case in family.marks
            if _at(family, case, k)
        ),
    )


def _at(family: Family, case: Case, k: int | None) -> bool:
    """Whether a case lies in a plane."""
    unit = family.unit(case)
    return unit is not None and (k is None or abs(unit[1] * family.finest - k) < 1e-4)


def _places(family: Family, cases: Iterable[Case]) -> Array:
    """Unit coordinates (n, 2) of the first and last parameter; those outside are left out."""
    units = [family.unit(case) for case in cases]
    found = [(unit[0], unit[-1]) for unit in units if unit is not None]
    return np.array(found).reshape(-1, 2)


def _shape(case: Case) -> str:
    """The shape of a case; an ellipse with b = a is a circle."""
    return "circle" if case.shape == "ellipse" and case.b_over_a == 1.0 else case.shape


def _name(family: Family, k: int) -> str:
    """Which fillets a slice shows: from the sharpest, the same for all rings, to the widest."""
    low, high = family.ranges["r_over_a"]
    widest = "b" if family.shape == "rectangle" else "R_C"
    if k == 0:
        return f"$r/a$ = {low:g}"
    first = family.parameters[0]
    if high < max(widest_fillet(family.shape, {first: value}) for value in family.ranges[first]):
        widest = f"\\min({widest}, {high:g}a)"
    if k == family.finest:
        return f"$r = {widest}$"
    part = k / family.finest
    return f"$r = {low:g}a + {part:g}\\,({widest} - {low:g}a)$"


def _sheet(scan: Scan, axis: str, k: int | None, beside: Sequence[Row]) -> Sheet:
    """Nodes of one twisting axis in a plane, and solved cases beside them."""
    family = scan.family
    own = [
        row
        for row in beside
        if row.case.twist_axis == axis or _places(family, [row.case])[0, 0] == 1.0
    ]
    numbers: Labels = np.array([NUMBERS[row.label] for row in own], dtype=np.int64)
    places = _places(family, [row.case for row in own])
    return Sheet(axis, *_nodes(scan, axis, k), places, numbers)


def _nodes(scan: Scan, axis: str, k: int | None) -> tuple[Labels, Array]:
    """Number of the label, and slope at pi, (n, n) at every node of a plane.

    Inside a cell labels are those of its corners, and slopes are interpolated.
    """
    n = scan.family.finest + 1
    labels = np.full((n, n), NUMBERS[FAILED])
    slopes = np.zeros((n, n))
    for cell in scan.cells:
        (sheet, low), edge = cell
        if sheet != axis or (k is not None and not low[1] <= k <= low[1] + edge):
            continue
        rows = [scan.rows[node] for node in corners(cell)]
        i, j = low[0], low[-1]
        here = np.s_[i : i + edge + 1, j : j + edge + 1]
        labels[here] = NUMBERS[next((row.label for row in rows if row.ok), FAILED)]
        # of a cube the mean of both faces: only its sign is seen in a uniform cell
        at = np.array([row.slope or 0.0 for row in rows]).reshape((2,) * len(low))
        corner = at if k is None else at.mean(axis=1)
        ramp = np.linspace((1.0, 0.0), (0.0, 1.0), edge + 1)
        slopes[here] = ramp @ corner @ ramp.T
    for (sheet, place), row in scan.rows.items():
        if sheet == axis and (k is None or place[1] == k):
            labels[place[0], place[-1]] = NUMBERS[row.label]
            slopes[place[0], place[-1]] = row.slope or 0.0
    return labels, slopes
