"""States of a ring in a table, for the terminal."""

from __future__ import annotations

from der.records.states import RingState, States
from der.records.text import known_to, number, titled


def words(found: States) -> str:
    """The states, lowest first, what each falls to, and what the search was like."""
    place = "free in space" if found.gamma is None else f"grips at gamma = {found.gamma:.8g}"
    lines = [f"{titled(found.ring, found.section, found.numerics)}, {place}"]
    gripped = found.gamma is not None
    wide = max([len(state.name) for state in found.states], default=5) + 2
    more = f"{'M a/GJ':>12}{'distance a':>12}" if gripped else ""
    lines += ["", f"{'state':{wide}}{'U a/GJ':>14}{'index':>7}{more}  {'link':>4}  falls to"]
    lines += [_row(found, state, wide) for state in found.states]
    lines += ["", _search(found)]
    if any(state.link is not None for state in found.states):
        lines.append(
            "link: times that the bar's edge winds around its middle; none where strands touch"
        )
    if any(state.needs_cut for state in found.states):
        lines.append("c: of a ring that was cut, turned once about itself and joined again")
    if gripped and len(found):
        lines.append("distance: between the grips, in units of a")
    if found.message:
        lines.append(f"{found.status}: {found.message}")
    return "\n".join(lines)


def _row(found: States, state: RingState, wide: int) -> str:
    floor = known_to(found.numerics)
    index = "?" if state.index is None else str(state.index)
    more = ""
    if state.moment is not None and state.distance is not None:
        more = number(state.moment, "12.7f", floor) + number(state.distance, "12.5f")
    link = "" if state.link is None else str(state.link)
    mark = "c" if state.needs_cut else " "
    ends = ", ".join(
        f"{end} ({number(state.energy - found[end].energy, '.6g', floor)})"
        for end in found.falls_to(state.name)
    )
    if not ends:
        ends = "stays" if state.stable else "?"
    energy = number(state.energy, "14.8f")
    return f"{state.name:{wide}}{energy}{index:>7}{more}  {link:>4}{mark} {ends}"


def _search(found: States) -> str:
    """How many starts, and what became of them."""
    text = (
        f"states: {len(found)}, minima among them: {len(found.minima)}; starts: {found.tried}, "
        f"of which {found.nowhere} led nowhere; {found.solve_s:.1f} s"
    )
    if found.peaks:
        text += f"; left out, with more than 8 ways down: {found.peaks}"
    return text
