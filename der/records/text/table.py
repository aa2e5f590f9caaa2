"""What the texts of all records share: numbers, titles, and tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from der.geometry.scale import Scale
from der.records.units import factor, head

WIDE = 15  # of a column of numbers with units
KNOWN = 1e-10  # GJ/a: of numbers whose record says no tolerance


def table(heads: Sequence[tuple[str, int]], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a table.

    Parameters
    ----------
    heads : the head and the width of every column; < 0: to the left, 0: as it is.
    rows : a text for every column.
    """
    widths = [width for _, width in heads]
    cells = ([head for head, _ in heads], *rows)
    return ["".join(map(_cell, row, widths)).rstrip() for row in cells]


def _cell(text: str, width: int) -> str:
    return f"{text:<{-width}}" if width < 0 else f"{text:>{width}}"


def number(value: float, form: str, floor: float = 0.0) -> str:
    """A number as text: 0 without a sign where it is below ``floor`` or its last digit."""
    text = f"{value:{form}}"
    return f"{0.0:{form}}" if abs(value) <= floor or float(text) == 0.0 else text


def column(record: Any, symbol: str, quantity: str, width: int) -> tuple[str, int]:
    """The head of a column of numbers, and its width."""
    return head(record.scale, symbol, quantity), width if record.scale is None else WIDE


def form(record: Any, plain: str) -> str:
    """The format of a number that may have a unit, and so any size: significant digits."""
    return plain if record.scale is None else ".7g"


def count(index: int | None) -> str:
    """An index, or "?" where it is not known."""
    return "?" if index is None else str(index)


def change(before: int | None, after: int | None, arrow: str = " -> ") -> str:
    """An index before and after a special point."""
    known = list(dict.fromkeys([count(before), count(after)]))
    return arrow.join(known)


def error(value: float | None) -> str:
    """An error, to one digit; "" where none is known."""
    if value is None or math.isnan(value):
        return ""
    return "0" if value == 0.0 else f"{value:.0e}"


def floor(record: Any) -> float:
    """What moments and energies of a record are known to, by the tolerance on record."""
    known = float(record.numerics.get("tolerance", KNOWN))  # GJ/a
    return known * factor(record.scale, "moment")


def title(record: Any) -> str:
    """Ring, section and mesh of a record in one line."""
    edges = record.numerics.get("n_edges")  # a boundary-value solution has none
    mesh = "" if edges is None else f", {edges} edges"
    return f"{_ring(record.ring)}, {_section(record.section)}{mesh}{_size(record.scale)}"


def _size(scale: Scale | None) -> str:
    """The reference length and the stiffness where they are known."""
    if scale is None:
        return ""
    length, name = scale.unit("length")
    return f", a = {length:.6g} {name}, GJ = {scale.GJ:.6g} N m^2"


def _ring(ring: Mapping[str, Any]) -> str:
    parameters = ", ".join(
        f"{name.replace('_over_', '/').replace('_', ' ')} {value:g}"
        for name, value in ring.items()
        if isinstance(value, int | float)
    )
    text = f"{ring['shape']} ({parameters})" if parameters else str(ring["shape"])
    return f"{text} about y" if ring.get("twist_axis") == "y" else text


def _section(section: Mapping[str, Any]) -> str:
    ratios = f"alpha {section['alpha']:.6g}, beta {section['beta']:.6g}"
    if section.get("h_over_t") is None:
        return ratios
    nu = "" if section.get("nu") is None else f", nu {section['nu']:g}"
    return f"h/t {section['h_over_t']:g}{nu} ({ratios})"
