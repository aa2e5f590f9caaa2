"""Tables of what the figures show: one row a state, or one row a vertex of the ring."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path as File

import numpy as np

from der.geometry.mesh import sites
from der.paper.cases import Curve, at_vertices, in_words, plain
from der.utils.files import FilePath, write_whole

RING_COLUMNS = {
    "ring": "circle or ellipse or rectangle or triangle",
    "twist_axis": "x: grips at the ends of the short semi-axis; y: of the long one",
    "b_over_a": "short semi-axis over the long one",
    "r_over_a": "radius of the fillets",
    "vertex_angle": "of the triangle at the apex [degrees]",
    "h_over_t": "height over thickness of the section; Poisson's ratio is 0.3",
}
STATE_COLUMNS = {
    "gamma": "rotation of one grip [rad]",
    "moment": "of one arm [GJ/a]",
    "energy": "of the full ring [GJ/a]",
    "error_gamma": "estimated error of gamma [rad]",
    "error_moment": "of the moment [GJ/a]",
    "error_energy": "of the energy [GJ/a]",
}
PLACE = ("r1", "r2", "r3", "d11", "d12", "d13")
POINT_COLUMN = {"point": "fold: gamma turns back; limit: the moment turns back; else empty"}


def write_curves(file: FilePath, about: str, curves: Iterable[Curve]) -> File:
    """Write the table of all states of the curves; return the file."""
    rows = []
    curves = list(curves)
    for curve in curves:
        kinds = {point.position: point.kind for point in curve.points}
        for k, state in enumerate(curve.states.tolist()):
            rows.append([*curve.case.entries(), *map(repr, state), kinds.get(k, "")])
    return _write(file, about, curves, STATE_COLUMNS | POINT_COLUMN, rows)


def write_shapes(file: FilePath, about: str, shots: Iterable[tuple[Curve, int]]) -> File:
    """Write the table of the ring in some states (curve, position); return the file."""
    shots = list(shots)
    columns = STATE_COLUMNS | {
        "arc_length": "of the vertex from the first grip [a]",
        **dict.fromkeys(
            PLACE[:3], "position of the vertex along E1 or E2 or E3 (twisting axis) [a]"
        ),
        **dict.fromkeys(PLACE[3:], "component of the director d1, along the section's height"),
    }
    rows = []
    for curve, k in shots:
        x, d1 = at_vertices(curve, k)
        frames = sites(curve.case.ring, len(x), "full")
        s = 0.5 * (frames[:-1] + frames[1:])
        state = list(map(repr, curve.states[k].tolist()))
        rows += [
            [*curve.case.entries(), *state, *map("{:.10g}".format, row)]
            for row in np.column_stack([s, x, d1]).tolist()
        ]
    return _write(file, about, [curve for curve, _ in shots], columns, rows)


def _write(
    file: FilePath,
    about: str,
    curves: Sequence[Curve],
    columns: Mapping[str, str],
    rows: Iterable[Sequence[str]],
) -> File:
    """Write a table of cases: comments that begin with #, the columns' names, and the rows."""
    columns = {"case": "which curve", **RING_COLUMNS, **columns}
    modes = {curve.case.name: plain(in_words(curve.mode)) for curve in curves}
    named = "; ".join(f"{name}: {words}" for name, words in columns.items())
    modes_named = "modes: " + "; ".join(f"{name}: {mode}" for name, mode in modes.items())
    return write_table(file, columns, rows, (about, named, modes_named))


def write_table(
    file: FilePath,
    columns: Iterable[str],
    rows: Iterable[Sequence[object]],
    comments: Sequence[str] = (),
) -> File:
    """Write a table: comments, the columns' names, and the rows; return the file."""
    text = io.StringIO(newline="")
    text.writelines(f"# {comment}\n" for comment in comments)
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    table.writerows(rows)
    content = text.getvalue().encode()
    write_whole(file, lambda opened: opened.write(content))
    return File(file)
