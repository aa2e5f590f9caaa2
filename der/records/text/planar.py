"""Planar states of a ring, or how it is squeezed, in a table."""

from __future__ import annotations

import numpy as np

from der.records.planar import PlanarStates, Squeeze
from der.records.text.table import change, column, count, error, floor, form, number, table, title

_ROWS = 12  # of a path, at most


def lines(found: PlanarStates | Squeeze) -> list[str]:
    """What was found, and how well it is known."""
    place = "in its plane" if isinstance(found, PlanarStates) else "squeezed in its plane"
    if isinstance(found, Squeeze) and len(found) and found.distance[-1] > found.distance[0]:
        place = "pulled in its plane"
    rows = _states(found) if isinstance(found, PlanarStates) else _path(found)
    cost = f"states: {len(found)}; {1e3 * found.solve_s:.0f} ms"
    return [f"{title(found)}, {place}", "", *rows, cost]


def _states(found: PlanarStates) -> list[str]:
    """The states, lowest first."""
    least = floor(found)
    wide = max([len(state.name) for state in found.states], default=5) + 2
    heads = [
        ("state", -wide),
        ("turns", 5),
        column(found, "U", "energy", 16),
        ("+-", 9),
        ("index", 7),
        column(found, "F", "force", 13),
    ]
    rows = (
        (
            state.name,
            str(state.turning),
            number(state.energy, form(found, ".9f"), least),
            error(state.energy_error),
            count(state.index),
            ("*" if state.zero_modes else " ") + number(state.force, form(found, "12.6f"), least),
        )
        for state in found.states
    )
    told = [*table(heads, rows), ""]
    if found.folded is not None and found.folded.packing is not None:
        known = found.folded.packing_error
        sure = "" if known is None else f" +- {error(known)}"
        told.append(f"folded: packing ratio {found.folded.packing:.8f}{sure}")
    told.append("index: unstable modes in the plane; in space there may be more (der states)")
    if any(state.zero_modes for state in found.states):
        told.append("*: material shifts along the ring without cost")
    return told


def _path(found: Squeeze) -> list[str]:
    """Some of the states, and the special points."""
    least, digits = floor(found), form(found, ".8f")
    heads = (
        column(found, "distance", "length", 12),
        column(found, "F", "force", 15),
        ("+-", 9),
        column(found, "U", "energy", 15),
        ("+-", 9),
        ("index", 7),
        ("", 0),
    )
    wanted = set(np.linspace(0, len(found) - 1, min(_ROWS, len(found))).round().astype(int))
    marks = {_nearest(found, point.distance, point.energy): point for point in found.points}
    rows = []
    for k in sorted(wanted | set(marks)):
        point = marks.get(k)
        own = count(found.index[k])
        rows.append(
            (
                number(float(found.distance[k]), digits),
                number(float(found.force[k]), digits, least),
                error(found.force_error[k]),
                number(float(found.energy[k]), digits, least),
                error(found.energy_error[k]),
                own if point is None else change(point.index_before, point.index_after, "->"),
                "" if point is None else f"  {point.kind}",
            )
        )
    return [*table(heads, rows), "", "F: draws the points apart; below 0 it holds them together"]


def _nearest(found: Squeeze, distance: float, energy: float) -> int:
    """The state that a special point is."""
    return int(np.argmin(np.abs(found.distance - distance) + np.abs(found.energy - energy)))
