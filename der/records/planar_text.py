"""Planar states of a ring, or how it is squeezed, in a table for the terminal."""

from __future__ import annotations

import math

import numpy as np

from der.records.planar import PlanarState, PlanarStates, Squeeze
from der.records.text import known_to, number, titled

_ROWS = 12  # of a path, at most


def words(found: PlanarStates | Squeeze) -> str:
    """What was found, and how well it is known."""
    place = "in its plane" if isinstance(found, PlanarStates) else "squeezed in its plane"
    if isinstance(found, Squeeze) and len(found) and found.distance[-1] > found.distance[0]:
        place = "pulled in its plane"
    lines = [f"{titled(found.ring, found.section, found.numerics)}, {place}", ""]
    lines += _states(found) if isinstance(found, PlanarStates) else _path(found)
    if found.message:
        lines.append(f"{found.status}: {found.message}")
    return "\n".join(lines)


def _states(found: PlanarStates) -> list[str]:
    """The states, lowest first."""
    floor = known_to(found.numerics)
    wide = max([len(state.name) for state in found.states], default=5) + 2
    lines = [f"{'state':{wide}}{'turns':>5}{'U a/GJ':>16}{'+-':>9}{'index':>7}{'F a^2/GJ':>13}"]
    lines += [_row(state, wide, floor) for state in found.states]
    lines.append("")
    if found.folded is not None and found.folded.packing is not None:
        error = found.folded.packing_error
        known = "" if error is None else f" +- {_bar(error)}"
        lines.append(f"folded: packing ratio {found.folded.packing:.8f}{known}")
    lines.append("index: ways down in the plane; in space there may be more (der states)")
    if any(state.zero_modes for state in found.states):
        lines.append("*: material shifts along the ring without cost")
    lines.append(f"states: {len(found)}; {1e3 * found.solve_s:.0f} ms")
    return lines


def _row(state: PlanarState, wide: int, floor: float) -> str:
    index = "?" if state.index is None else str(state.index)
    mark = "*" if state.zero_modes else " "
    energy = number(state.energy, "16.9f", floor)
    force = number(state.force, "12.6f", floor)
    return (
        f"{state.name:{wide}}{state.turning:5d}{energy}{_bar(state.energy_error):>9}"
        f"{index:>7}{mark}{force}"
    )


def _path(found: Squeeze) -> list[str]:
    """Some of the states, and the special points."""
    head = ("distance a", "F a^2/GJ", "+-", "U a/GJ", "+-", "index")
    lines = ["".join(f"{text:>{w}}" for text, w in zip(head, (12, 15, 9, 15, 9, 7), strict=True))]
    special = iter(found.points)
    wanted = set(np.linspace(0, len(found) - 1, min(_ROWS, len(found))).round().astype(int))
    marks = {_nearest(found, point.distance, point.energy): point for point in special}
    floor = known_to(found.numerics)
    for k in sorted(wanted | set(marks)):
        index = "?" if found.index[k] is None else str(found.index[k])
        extra = ""
        if k in marks:
            point = marks[k]
            before, after = (
                "?" if i is None else i for i in (point.index_before, point.index_after)
            )
            index = index if before == after else f"{before}->{after}"
            extra = f"  {point.kind}"
        lines.append(
            number(float(found.distance[k]), "12.8f")
            + number(float(found.force[k]), "15.8f", floor)
            + f"{_bar(found.force_error[k]):>9}"
            + number(float(found.energy[k]), "15.8f", floor)
            + f"{_bar(found.energy_error[k]):>9}{index:>7}{extra}"
        )
    lines += ["", "F: draws the points apart; below 0 it holds them together"]
    lines.append(f"states: {len(found)}; {1e3 * found.solve_s:.0f} ms")
    return lines


def _nearest(found: Squeeze, distance: float, energy: float) -> int:
    """The state that a special point is."""
    return int(np.argmin(np.abs(found.distance - distance) + np.abs(found.energy - energy)))


def _bar(error: float | None) -> str:
    """An error, to one digit; "" where none is known."""
    if error is None or math.isnan(error):
        return ""
    return "0" if error == 0.0 else f"{error:.0e}"
