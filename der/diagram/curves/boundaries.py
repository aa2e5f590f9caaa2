"""The boundaries between folding modes of one slice of a phase diagram.

Where neighbouring cases of a scan differ, a boundary lies between them. Six kinds are curves on
which a condition holds (`conditions`), and are traced across the slice (`tracing`):

    stability        the folded state loses its stability at fixed moment
    stays folded     the folded state loses its stability when released
    foldability      the fold at which the path turns back reaches gamma = pi
    infinite slope   that fold merges with its mirror image in the folded state
    snap-back        two folds merge in a cusp
    exchange         the path from the flat ring exchanges branches with another one: it then leads
                     elsewhere, or leaves folds behind on a closed one

Where curves meet, the corner is solved for (`corners`). A curve is kept from corner to corner where
the labels on its two sides, solved for, differ by what it bounds (`pruning`). Where no condition
explains a difference, the boundary is found by bisection of the label between two cases.

The search (`asking`) has cases and curves made by workers; `on_slices` has what they do.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from der.bvp.gauss import Array
from der.diagram.cases import Row
from der.diagram.curves import on_slices
from der.diagram.curves.asking import Search, answered, call, rows_of
from der.diagram.curves.corners import Line, Met
from der.diagram.curves.label_changes import Crossing, crossings_of, differences
from der.diagram.curves.on_slices import STABILITY, bounding, explained, known
from der.diagram.curves.polylines import distance, loose_ends, meetings
from der.diagram.curves.pruning import BESIDE, asked_beside, beside, pieces_of, unlike
from der.diagram.curves.slices import Boundaries, Slice, between, bisected, chains, joined, slices
from der.diagram.families import Family
from der.diagram.scanned_boundaries import BoundaryPoint, Curve

NARROW = 1e-3  # of the side: cases so near to each other have the state that a condition needs
NEAREST = 1e-4  # likewise, beside the end of another curve
SHARPER = 8  # halvings between such points of a curve
ROUNDS, ROUND = 3, 12  # searches around loose ends, and places of each
BISECTED = 1e-6  # of the diagram's side

Holds = list[bool | None]  # whether a curve bounds something, by point; None: not known


def boundaries(family: Family, rows: Sequence[Row]) -> Boundaries:
    """Boundaries of a diagram from the rows of its scan, in this process; of a cube, by slices."""
    return joined(answered(located(part)) for part in slices(family, rows))


def located(part: Slice) -> Search[Boundaries]:
    """The boundaries between the cases of a slice."""
    crossings = crossings_of(part.placed)
    lines = yield from _traced(part, crossings, [])
    kept, met = yield from _kept(part, lines)
    left = [crossing for crossing in crossings if not explained(crossing, kept)]
    # near the boundary, a state is close to the one that makes it
    left = yield from bisected(part, left, NARROW)
    before = len(lines)
    lines = yield from _traced(part, [n for n in left if not explained(n, kept)], lines)
    if len(lines) > before:
        kept, met = yield from _kept(part, lines)
    kept, met = yield from _continued(part, lines, kept, met)
    released = yield from _released(part, kept)
    found = yield from call(on_slices.curves, part.bare, kept, released, met)
    left = [narrow for narrow in left if not explained(narrow, kept)]
    points: dict[str, list[BoundaryPoint]] = defaultdict(list)
    for narrow in (yield from bisected(part, left, BISECTED)):
        points[narrow.kind].append(between(part, narrow))
    found.curves.extend(
        Curve(f"{kind} (bisected)", part.sheet, chain)
        for kind, some in points.items()
        for chain in chains(part.family, some)
    )
    return found


def _traced(
    part: Slice, crossings: list[Crossing], lines: list[Line], *, one_new: bool = False
) -> Search[list[Line]]:
    """Curves, and those that bound what differs between cases; see `on_slices.traced`."""
    if not crossings:
        return lines
    return (yield from call(on_slices.traced, part.bare, crossings, lines, one_new))


def _continued(
    part: Slice, lines: list[Line], kept: list[Line], met: list[Met]
) -> Search[tuple[list[Line], list[Met]]]:
    """Kept curves and corners, with the curves that continue those with loose ends."""
    asked: list[Array] = []
    for _ in range(ROUNDS):
        before = len(lines)
        ends = [end for end in _loose(kept, met) if distance(end, np.array(asked)) > BESIDE]
        asked += ends
        around = yield from _around(part, ends, kept)
        around = yield from bisected(part, around, NEAREST)
        lines = yield from _traced(part, around, lines, one_new=True)
        if len(lines) == before:
            break
        kept, met = yield from _kept(part, lines)
    return kept, met


def _around(part: Slice, ends: list[Array], kept: list[Line]) -> Search[list[Crossing]]:
    """Unlike neighbours on small circles, with no curve between that bounds what differs."""
    turns = 2.0 * math.pi * np.arange(ROUND) / ROUND
    circle = BESIDE * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    places = [[(float(u[0]), float(u[1])) for u in np.clip(e + circle, 0.0, 1.0)] for e in ends]
    rows = iter((yield from rows_of([part.case(u) for own in places for u in own])))
    found = []
    for own in places:
        there = [(place, next(rows)) for place in own]
        for (a, first), (b, second) in pairwise([*there, there[0]]):
            chord = np.array([a, b])
            for kind in differences(first, second):
                lines = [line for line in kept if line.kind in bounding(kind)]
                if not any([*meetings(chord, line.places)] for line in lines):
                    found.append(Crossing(kind, a, b, first, second))
    return found


# --- Parts of curves that are boundaries -----------------------------------------------------


def _kept(part: Slice, lines: list[Line]) -> Search[tuple[list[Line], list[Met]]]:
    """Pieces of curves on whose two sides the modes differ by their kind, and their corners."""
    lines, met = yield from call(on_slices.with_corners, part.bare, lines)
    asked = [(n, k) for n, line in enumerate(lines) for k in asked_beside(line)]
    holds: list[Holds] = [[None] * len(line.points) for line in lines]
    for _ in range(SHARPER):
        sides = yield from _sides(part, lines, asked)
        for (n, k), rows in zip(asked, sides, strict=True):
            holds[n][k] = None if rows is None else _bounds(lines[n].kind, *rows)
        if not (asked := (yield from _sharpened(part, lines, holds))):
            break
    pieces = [
        piece for line, own in zip(lines, holds, strict=True) for piece in pieces_of(line, own)
    ]
    pieces.sort(key=lambda piece: -len(piece.points))
    kept: list[Line] = []
    for piece in pieces:
        if not known(piece.kind, piece.points, kept):
            kept.append(piece)
    there = {(corner, piece.kind) for piece in kept for corner in piece.corners}
    met = [replace(m, kinds=tuple(k for k in m.kinds if (m, k) in there)) for m in met]
    return kept, [one for one in met if len(one.kinds) > 1]


def _released(part: Slice, kept: list[Line]) -> Search[list[Line]]:
    """The parts of curves of stability that bound rings that stay folded when released, too.

    What they lose there is the stiffness of the class that turns the grips.
    """
    lines = [(n, line) for n, line in enumerate(kept) if line.kind == STABILITY]
    asked = [(n, k) for n, line in lines for k in asked_beside(line)]
    holds: dict[int, Holds] = {n: [None] * len(line.points) for n, line in lines}
    for (n, k), rows in zip(asked, (yield from _sides(part, kept, asked)), strict=True):
        if rows is not None:
            holds[n][k] = rows[0].stays_folded != rows[1].stays_folded
    pieces = [piece for n, line in lines for piece in pieces_of(line, holds[n])]
    return pieces


def _sides(
    part: Slice, lines: list[Line], asked: list[tuple[int, int]]
) -> Search[list[tuple[Row, Row] | None]]:
    """The cases on the two sides of points; None where those do not tell."""
    sides = [beside(lines[n], k, lines) for n, k in asked]
    rows = iter((yield from rows_of([part.case(u) for places in sides for u in places])))
    return [(next(rows), next(rows)) if places else None for places in sides]


def _sharpened(part: Slice, lines: list[Line], holds: list[Holds]) -> Search[list[tuple[int, int]]]:
    """New points between neighbours where the modes differ on the sides of only one."""
    gaps = [(n, k) for n, line in enumerate(lines) for k in unlike(line, holds[n], NARROW)]
    if not gaps:
        return []
    ends = [(lines[n].kind, *lines[n].points[k : k + 2]) for n, k in gaps]
    points = yield from call(on_slices.between, part.bare, ends)
    new = []
    added = [0] * len(lines)
    for (n, k), at in zip(gaps, points, strict=True):
        if at is not None:
            added[n] += 1
            lines[n].insert(k + added[n], at, None)
            holds[n].insert(k + added[n], None)
            new.append((n, k + added[n]))
    return new


def _loose(kept: list[Line], met: list[Met]) -> Iterator[Array]:
    """The loose ends of curves."""
    ends = [(line.corners[0] in met, line.corners[-1] in met) for line in kept]
    for n, k in loose_ends([line.places for line in kept], ends):
        yield kept[n].points[k].u


def _bounds(kind: str, one: Row, other: Row) -> bool:
    """Whether two cases differ by what a curve of this kind bounds."""
    return any(kind in bounding(what) for what in differences(one, other))
