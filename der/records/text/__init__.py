"""Every record in a few lines of text, for the terminal: `summary`.

Each kind of record has a module with the function `lines`. May import what records may.
Begin with table.py.
"""

from __future__ import annotations

from importlib import import_module

from der.records.path import Path
from der.records.record import Record
from der.records.units import in_units

_HOME = {  # the module that tells a record, by the name of its class
    "Path": "path",
    "Landscape": "landscape",
    "Surface": "landscape",
    "Pass": "landscape",
    "LeastPush": "opening",
    "States": "states",
    "PlanarStates": "planar",
    "Squeeze": "planar",
    "Comparison": "comparison",
}


def summary(record: Record, *, why: bool = True) -> str:
    """What a user wants to know first of a record.

    Parameters
    ----------
    record : any record but barriers over h/t.
    why : whether the last line says why something is missing.
    """
    home = import_module(f"der.records.text.{_HOME[type(record).__name__]}")
    lines: list[str] = home.lines(in_units(record))
    status = getattr(record, "status", "done")
    last = ["" if status == "done" else status, reason(record) if why else ""]
    if any(last) and not isinstance(record, Path):  # which says it above its points
        lines.append(": ".join(filter(None, last)))
    return "\n".join(lines)


def reason(record: Record) -> str:
    """Why something is missing, in a sentence; empty where nothing is."""
    found: str = getattr(record, "message", "") or getattr(record, "why", "")
    return found
