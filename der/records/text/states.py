"""States of a ring in a table."""

from __future__ import annotations

from collections.abc import Iterator

from der.records.states import RingState, States
from der.records.text.path import ONE_ARM
from der.records.text.table import column, count, floor, form, number, table, title


def lines(found: States) -> list[str]:
    """The states, lowest first, what each snaps to, and what the search was like."""
    gripped = found.gamma is not None
    place = f"grips at gamma = {found.gamma:.8g}" if gripped else "free in space"
    wide = max([len(state.name) for state in found.states], default=5) + 2
    moment, distance = column(found, "M", "moment", 12), column(found, "distance", "length", 12)
    more = [moment, distance] if gripped else []
    energy = column(found, "U", "energy", 14)
    heads = [("state", -wide), energy, ("index", 7), *more, ("link", 6), ("  snaps to", 0)]
    rows = table(heads, (_row(found, state) for state in found.states))
    return [f"{title(found)}, {place}", "", *rows, "", _search(found), *_notes(found)]


def _row(found: States, state: RingState) -> list[str]:
    least = floor(found)
    gripped = []
    if found.gamma is not None and state.moment is not None and state.distance is not None:
        gripped = [
            number(state.moment, form(found, ".7f"), least),
            number(state.distance, form(found, ".5f")),
        ]
    ends = ", ".join(
        f"{end} ({number(state.energy - found[end].energy, '.6g', least)})"
        for end in found.falls_to(state.name)
    )
    link = "" if state.link is None else str(state.link)
    mark = "c" if state.needs_cut else " "
    end = f"{mark} {ends or ('stays' if state.stable else '?')}"
    return [
        state.name,
        number(state.energy, form(found, ".8f")),
        count(state.index),
        *gripped,
        link,
        end,
    ]


def _search(found: States) -> str:
    """How many initial guesses, and what became of them."""
    text = (
        f"states: {len(found)}, minima among them: {len(found.minima)}; initial guesses: "
        f"{found.tried}, of which {found.nowhere} led to no new state; {found.solve_s:.1f} s"
    )
    if found.peaks:
        text += f"; left out, with an index above 8: {found.peaks}"
    return text


def _notes(found: States) -> Iterator[str]:
    """What the heads and marks mean."""
    if any(state.link is not None for state in found.states):
        yield "link: times that the bar's edge winds around its middle; none where strands touch"
    if any(state.needs_cut for state in found.states):
        yield "c: the other frame class: only after a cut, one turn of an end, and a new joint"
    if found.gamma is not None and len(found):
        yield f"distance: between the grips{', in units of a' if found.scale is None else ''}"
        yield ONE_ARM
