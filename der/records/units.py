"""A record's numbers in the units of its scale, for texts and pictures.

Records themselves are non-dimensional: moments and energies in GJ/a, lengths in a.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from der.geometry.scale import Scale
from der.records.entries import Checked

Kind = TypeVar("Kind")

PLAIN = {"moment": "GJ/a", "energy": "GJ/a", "force": "GJ/a^2", "length": "a"}
_HEADS = {"moment": "a/GJ", "energy": "a/GJ", "force": "a^2/GJ", "length": "a"}
_QUANTITIES = {  # of entries that texts and pictures show
    "moment": "moment rod_moment bvp_moment slope slope_at_pi grip_moment arm_moment",
    "energy": "energy energy_error rod_energy bvp_energy released energy_released fold open folded "
    "barrier twisting work minima",
    "force": "force force_error grip_force arm_force",
    "length": "distance distance_error goal",
}
_OF = {name: kind for kind, names in _QUANTITIES.items() for name in names.split()}
_TABLES = {  # columns of arrays
    ("Surface", "path"): ("", "length", "energy"),
    ("Surface", "folds"): ("", "length", "energy"),
    ("Surface", "rests"): ("", "length", "energy"),
    ("Surface", "snaps"): ("", "length", "energy"),
    ("Pass", "way"): ("", "energy"),
}
_MAPPINGS = ("details", "error", "raw", "extrapolated")
_WORKS = {  # of the least pushes
    "force": "energy",
    "couple": "energy",
    "force dead": "energy",
    "couple dead": "energy",
    "force dead load": "force",
    "couple dead load": "moment",
}
_PUSHES = {  # what push and load are, by the kind of a push
    "force": {"push": "length", "load": "force"},
    "couple": {"push": "", "load": "moment"},
}


def factor(scale: Scale | None, quantity: str) -> float:
    """Return what a number of the record is multiplied by to be shown."""
    return 1.0 if scale is None or not quantity else scale.unit(quantity)[0]


def unit(scale: Scale | None, quantity: str) -> str:
    """Return the unit of the numbers that are shown: "GJ/a", or "N mm"."""
    return PLAIN[quantity] if scale is None else scale.unit(quantity)[1]


def head(scale: Scale | None, symbol: str, quantity: str) -> str:
    """Return the head of a column: "M a/GJ", or "M [N mm]"."""
    if scale is None:
        return f"{symbol} {_HEADS[quantity]}"
    return f"{symbol} [{unit(scale, quantity)}]"


def in_units(record: Kind) -> Kind:
    """Return a copy of a record with the numbers that are shown in the units of its scale.

    The copy is for texts and pictures alone: what is saved is non-dimensional.
    """
    scale: Scale | None = getattr(record, "scale", None)
    return record if scale is None else _converted(record, scale, _OF)


def _converted(record: Any, scale: Scale, of: Mapping[str, str]) -> Any:
    """A copy of an object; ``of``: the quantities of its entries by name."""
    kind = type(record).__name__
    if kind == "Push":
        of = {**of, **_PUSHES[record.kind], "peak": _PUSHES[record.kind]["load"]}
    if kind == "LeastPush":
        of = {**of, **_WORKS}
    changes = {}
    for name in (one.name for one in fields(record) if one.init):
        value = getattr(record, name)
        columns = _TABLES.get((kind, name))
        if (kind, name) == ("Push", "curve"):
            columns = (of["push"], of["load"], "energy")
        if columns is not None:
            times = np.array([factor(scale, quantity) for quantity in columns])
            changes[name] = _times(value, times)
        elif name in _MAPPINGS and isinstance(value, Mapping):
            changes[name] = {
                key: _times(entry, factor(scale, of.get(key, ""))) for key, entry in value.items()
            }
        elif isinstance(value, Checked):
            changes[name] = _converted(value, scale, of)
        elif isinstance(value, tuple) and value and isinstance(value[0], Checked):
            changes[name] = tuple(_converted(one, scale, of) for one in value)
        elif name in of:
            changes[name] = _times(value, factor(scale, of[name]))
    return replace(record, **changes)


def _times(value: Any, times: Any) -> Any:
    """A number, or those in an array or in nested lists, times another; anything else as it is."""
    if isinstance(value, tuple | list):
        return type(value)(_times(one, times) for one in value)
    if isinstance(value, np.ndarray | float):
        return value * times
    return value
