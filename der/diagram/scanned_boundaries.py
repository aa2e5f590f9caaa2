"""Boundaries of folding modes as a scan sees them: lines through its finest cells.

A point lies between two neighbours that fold differently; `error` is the largest error of the
parameter that varies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from der.diagram.cases import Case, Row
from der.diagram.families import Family
from der.diagram.scan import Cell, Node, Scan, corners

Pair: TypeAlias = tuple[Node, Node]
Square: TypeAlias = tuple[Node, Node, Node, Node]  # once round


@dataclass(frozen=True)
class BoundaryPoint:
    """A point of a boundary.

    Attributes
    ----------
    case : the ring and its section there
    gamma : where on the path the mode changes [rad]; NaN where that is not known
    moment : M there [GJ/a]; NaN where it is not known
    error : of the parameters
    """

    case: Case
    gamma: float
    moment: float
    error: float


@dataclass(frozen=True)
class Curve:
    """A boundary between folding modes.

    Attributes
    ----------
    kind : one of KINDS, with " (scan)" after it here, "infinite slope" or "exchange"
    twist_axis : of its rings; one with b = a is the same about both axes
    points : in order along the curve
    """

    kind: str
    twist_axis: str
    points: tuple[BoundaryPoint, ...]


@dataclass(frozen=True)
class Corner:
    """Where boundaries meet.

    Attributes
    ----------
    kinds : of the two, or three
    twist_axis : of the ring
    point : with gamma and moment of the first's state
    """

    kinds: tuple[str, ...]
    twist_axis: str
    point: BoundaryPoint


def scanned_boundaries(scan: Scan) -> list[Curve]:
    """The boundaries between the nodes of a scan's finest cells.

    Those of a diagram in three dimensions are cut at the values of its second unit coordinate that
    the coarse grid has.
    """
    found = []
    squares = list(_squares(scan))
    for kind in KINDS:
        for axis in scan.family.sheets:
            own = [square for square in squares if square[0][0] == axis]
            for line in _lines(own, scan.rows, KINDS[kind]):
                points = [_point(scan, kind, pair) for pair in line]
                found.append(Curve(f"{kind} (scan)", axis, tuple(points)))
    return found


def planes(family: Family) -> range:
    """Places on the lattice's second axis where a diagram in three dimensions is cut."""
    return range(0, family.finest + 1, family.finest // family.coarse)


# --- What changes at a boundary --------------------------------------------------------------


def _foldable(row: Row) -> bool | None:
    return row.foldable if row.ok else None


def _stable(row: Row) -> bool | None:
    return row.stable if row.ok and row.foldable else None


def _stays_folded(row: Row) -> bool | None:
    return row.stays_folded if row.ok and row.foldable else None


def _snaps_back(row: Row) -> bool | None:
    return row.snapping == "snap-back" if row.ok and row.foldable else None


KINDS: Mapping[str, Callable[[Row], bool | None]] = {
    "foldability": _foldable,
    "stability": _stable,
    "stays folded": _stays_folded,
    "snap-back": _snaps_back,
}


def _point(scan: Scan, kind: str, pair: Pair) -> BoundaryPoint:
    """The point between two nodes; the slope at pi says where between them stability is lost."""
    family = scan.family
    rows = [scan.rows[node] for node in pair]
    part, gamma, moment = 0.5, math.pi, math.nan
    if kind == "stability":
        first, second = (row.slope or 0.0 for row in rows)
        part, moment = first / (first - second), 0.0
    elif kind == "snap-back":
        folds = next(row.folds for row in rows if row.folds)
        gamma = sum(folds) / len(folds)
    unit = [
        (i + part * (j - i)) / family.finest for i, j in zip(pair[0][1], pair[1][1], strict=True)
    ]
    apart = [_value(rows[1].case, name) - _value(rows[0].case, name) for name in family.parameters]
    error = max(part, 1.0 - part) * max(abs(length) for length in apart)
    return BoundaryPoint(family.case(pair[0][0], unit), gamma, moment, error)


def _value(case: Case, name: str) -> float:
    return float(getattr(case, name))


# --- Lines through cells ---------------------------------------------------------------------


def _squares(scan: Scan) -> Iterator[Square]:
    """Cells of the finest level, or their faces in the planes of the cut."""
    cells = [cell for cell in scan.cells if cell[1] == 1]
    if scan.family.dimension == 2:
        for cell in cells:
            yield _round(corners(cell))
        return
    cut = set(planes(scan.family))
    faces = {face for cell in cells for face in _faces(cell) if face[0][1][1] in cut}
    yield from sorted(faces)


def _round(found: Sequence[Node]) -> Square:
    """The four corners of a square, once round."""
    return found[0], found[1], found[3], found[2]


def _faces(cell: Cell) -> tuple[Square, Square]:
    """The faces of a cube before and behind, along the second axis."""
    found = corners(cell)
    before, behind = (found[0], found[1], found[4], found[5]), (*found[2:4], *found[6:8])
    return _round(before), _round(behind)


def _lines(
    squares: Sequence[Square], rows: Mapping[Node, Row], mode: Callable[[Row], bool | None]
) -> list[list[Pair]]:
    """Lines through squares, from one pair of neighbours that differ to the next."""
    beside: dict[Pair, list[Pair]] = {}
    for square in squares:
        pairs = []
        for a, b in zip(square, (*square[1:], square[0]), strict=True):
            one, other = mode(rows[a]), mode(rows[b])
            if one is not None and other is not None and one != other:
                pairs.append((min(a, b), max(a, b)))
        for here, there in zip(pairs[::2], pairs[1::2], strict=False):
            beside.setdefault(here, []).append(there)
            beside.setdefault(there, []).append(here)
    return _chained(beside)


def _chained(beside: dict[Pair, list[Pair]]) -> list[list[Pair]]:
    """Lines of neighbours: those with ends first, then closed ones, whose first is their last."""
    lines = []
    left = {here: list(there) for here, there in beside.items()}
    ends = sorted(here for here in left if len(left[here]) == 1)
    for start in itertools.chain(ends, sorted(left)):
        if not left[start]:
            continue
        line = [start]
        while left[line[-1]]:
            here = line[-1]
            there = left[here].pop(0)
            left[there].remove(here)
            line.append(there)
        lines.append(line)
    return lines
