"""What the entries of a record may hold, declared with their types.

The type of a field holds its check, and how the entry is written:

    gamma: Column                                       finite numbers, (n,)
    index: Count | None                                 an integer >= 0, or null
    energy: Annotated[Array, gaps("gamma", "distance")] (n, m), as many as these; null for NaN

These types are in `der.records.values`. `Checked` applies the checks to every new object: no record
holds what its file could not. `plain` writes such objects, `der.records.codec` reads them.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from der.utils import checks

Check = Callable[[str, Any], Any]
Dims = tuple[str | int | None, ...]


@dataclass(frozen=True)
class Entry:
    """How an entry is checked and written.

    Parameters
    ----------
    check : takes name and value; returns the value in its proper type, or raises ValueError.
    write : turns the value into JSON's types.
    dims : for every dimension the name of an entry of the same length, the length, or None.
    """

    check: Check
    write: Callable[[Any], Any] = lambda value: value
    dims: Dims = ()


class Checked:
    """A dataclass whose entries are checked by their types when an object is made.

    Raises
    ------
    ValueError
        Where an entry is not what its type says; the message begins with the name of the entry.
    """

    OPTIONAL: ClassVar[tuple[str, ...]] = ()  # entries that a file may lack
    DERIVED: ClassVar[tuple[str, ...]] = ()  # properties that are written, too, after the entries
    JOINED: ClassVar[str] = ""  # name of the entry whose own entries stand among these in a file

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, entry in entries_of(kind).items():
            value = getattr(self, name)
            if entry.dims and value is not None:
                self._check_lengths(name, value, entry.dims)
            object.__setattr__(self, name, entry.check(name, value))

    def _check_lengths(self, name: str, value: Any, dims: Dims) -> None:
        """Refuse a length that ``dims`` does not allow; without a length, the check refuses it."""
        dim = dims[0]
        wanted = len(getattr(self, dim)) if isinstance(dim, str) else dim
        if not isinstance(value, Sequence | np.ndarray):
            return
        if wanted is not None and len(value) != wanted:
            there = f"{dim} has {wanted}" if isinstance(dim, str) else f"it must have {wanted}"
            raise ValueError(f"{name} has {len(value)} entries, {there}")
        if len(dims) > 1:
            for i, row in enumerate(value):
                self._check_lengths(f"{name}[{i}]", row, dims[1:])

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """What is written, made of the entries by name."""
        return entries | {name: getattr(self, name) for name in self.DERIVED}

    @classmethod
    def from_disk(cls, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries by name, made of what is written, which may be anything."""
        return {name: value for name, value in entries.items() if name not in cls.DERIVED}


def plain(value: Any) -> Any:
    """An object in JSON's types: a dict of its entries."""
    if not isinstance(value, Checked):
        return value
    kind: Any = type(value)
    known = entries_of(kind)
    return value.on_disk(
        {
            name: (known[name].write if name in known else plain)(getattr(value, name))
            for name in written(kind)
        }
    )


def in_memory(factory: Callable[[], Any] = lambda: None) -> Any:
    """A field that is not written."""
    return field(default_factory=factory, repr=False, metadata={"in memory": True})


def written(kind: type) -> tuple[str, ...]:
    """Names of the entries that are written."""
    return tuple(one.name for one in fields(kind) if not one.metadata.get("in memory"))


@cache
def entries_of(kind: type) -> dict[str, Entry]:
    """The entries of a class that are checked, by name."""
    hints = get_type_hints(kind, include_extras=True)
    found = {one.name: entry_of(hints[one.name]) for one in fields(kind)}
    return {name: entry for name, entry in found.items() if entry is not None}


def entry_of(hint: Any) -> Entry | None:
    """How values of a type are checked; None for objects that check themselves, such as records."""
    inner = get_args(hint)
    if get_origin(hint) is Annotated:
        return next((one for one in inner if isinstance(one, Entry)), None)
    if get_origin(hint) in (Union, types.UnionType) and len(inner) == 2:
        entry = entry_of(inner[0])
        return None if entry is None else _or_none(entry)
    if get_origin(hint) is tuple and inner[1:] == (...,):
        each = entry_of(inner[0]) or Entry(lambda _, one: one, plain)
        return Entry(
            lambda name, values: tuple(checks.each(name, values, each.check)),
            lambda values: [each.write(one) for one in values],
        )
    return None


def _or_none(entry: Entry) -> Entry:
    return replace(
        entry,
        check=checks.optional(entry.check),
        write=lambda value: None if value is None else entry.write(value),
    )
