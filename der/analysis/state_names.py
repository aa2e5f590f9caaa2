"""Names of states of a ring: planar shapes by their turning number, others by kind and number."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

_NUMBERS = {2: "two", 3: "three", 4: "four", 5: "five"}


def covered_name(turning: int) -> str:
    """Return the name of a circle covered several times: "flat", "three-covered"."""
    times = abs(turning)
    return "flat" if times == 1 else f"{_NUMBERS.get(times, times)}-covered"


def planar_name(turning: int) -> str:
    """Return the name of a planar state by its turning number, < 0 if flipped."""
    if turning == 0:
        return "figure eight"
    if turning == -1:
        return "flipped"
    return covered_name(turning) + (", flipped" if turning < 0 else "")


def numbered(names: Sequence[str], always: Collection[str] = ()) -> list[str]:
    """Return the names with numbers where a name occurs more than once, or is one of ``always``."""
    total, seen = Counter(names), Counter[str]()
    found = []
    for name in names:
        seen[name] += 1
        found.append(f"{name} {seen[name]}" if total[name] > 1 or name in always else name)
    return found
