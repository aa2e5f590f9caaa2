"""What the entries of a record may hold, declared with their types.

The type of a field carries its check, and how it is written where that is not as it is:

    gamma: Column                                       finite numbers, (n,)
    index: Count | None                                 an integer >= 0, or null
    energy: Annotated[Array, gaps("gamma", "distance")] (n, m), as many as these; null for NaN

`Checked` applies the checks to every new object, so that no record holds what its file could not.
`plain` writes such objects, and `der.records.codec` reads them.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from der.utils import checks
from der.utils.checks import Array

Check = Callable[[str, Any], Any]
Dims = tuple[str | int | None, ...]


@dataclass(frozen=True)
class Entry:
    """How an entry is checked and written.

    Parameters
    ----------
    check : takes name and value; returns the value in its proper type, or raises ValueError.
    write : the value as JSON has it.
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
    JOINED: ClassVar[str] = ""  # name of the entry whose own entries stand among these in a file

    def __post_init__(self) -> None:
        kind: Any = type(self)
        for name, entry in entries_of(kind).items():
            value = getattr(self, name)
            if entry.dims and value is not None:
                self._check_lengths(name, value, entry.dims)
            object.__setattr__(self, name, entry.check(name, value))

    def _check_lengths(self, name: str, value: Any, dims: Dims) -> None:
        """Refuse another length than ``dims`` says; what has no length, its check refuses."""
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
        return entries

    @classmethod
    def from_disk(cls, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries by name, made of what is written, which may be anything."""
        return entries


def plain(value: Any) -> Any:
    """An object as JSON has it: a dict of its entries."""
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
    """How something of a type is checked; None for what is checked by itself, such as a record."""
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


# --- Single values ---------------------------------------------------------------------------


def integer(name: str, value: object) -> int:
    """Return an integer of either sign."""
    return int(checks.checked_number(name, value, "an integer", float.is_integer))


def one_of(allowed: Sequence[str]) -> Entry:
    """One of some words."""
    return Entry(lambda name, value: checks.one_of(name, value, allowed))


Number = Annotated[float, Entry(checks.checked_number)]
Count = Annotated[int, Entry(checks.count)]
Integer = Annotated[int, Entry(integer)]
Text = Annotated[str, Entry(checks.text)]
Truth = Annotated[bool, Entry(checks.truth)]
Json = Annotated[Mapping[str, object], Entry(checks.json_object)]


# --- Arrays ----------------------------------------------------------------------------------

Column = Annotated[Array, Entry(checks.numbers, np.ndarray.tolist)]  # (n,), finite


def along(name: str) -> Entry:
    """Finite numbers, as many as another entry has."""
    return Entry(checks.numbers, np.ndarray.tolist, (name,))


def indices(name: str) -> Entry:
    """Counts, masked where not known, as many as another entry has."""
    return Entry(checks.counts, np.ma.MaskedArray.tolist, (name,))


def gaps(*dims: str | int | None) -> Entry:
    """Numbers, NaN in memory and null in the file where there is none."""

    def check(name: str, values: Any) -> Array:
        found = _with_nan(name, values, len(dims))
        if not found.size:  # rows of a known length that are not there
            found = found.reshape([n if isinstance(n, int) else len(found) for n in dims])
        return found

    return Entry(check, _with_null, dims)


def table(*columns: str) -> Entry:
    """Columns (n, k) of finite numbers: an object of lists in the file."""

    def check(name: str, values: Any) -> Array:
        if not isinstance(values, Mapping):
            return checks.checked_array(name, values, ("n", len(columns)))
        if set(values) != set(columns):
            raise ValueError(f"{name} must have the entries {', '.join(columns)}")
        found = [checks.numbers(f"{name}.{column}", values[column]) for column in columns]
        if len({len(column) for column in found}) > 1:
            raise ValueError(f"{name} must have as many values of every column")
        return np.column_stack(found)

    return Entry(check, lambda rows: dict(zip(columns, rows.T.tolist(), strict=True)))


def numbers(count: int) -> Entry:
    """A tuple of finite numbers."""
    return Entry(
        lambda name, value: tuple(checks.checked_array(name, value, (count,)).tolist()), list
    )


def _with_nan(name: str, values: Any, ndim: int) -> Array:
    """Nested lists of numbers and None, or an array, as an array with NaN."""
    plain_array = isinstance(values, np.ndarray) and values.dtype == np.float64
    if plain_array and values.ndim == ndim and not np.isinf(values).any():
        return values.copy()
    if ndim > 1:
        rows = checks.each(name, values, lambda at, row: _with_nan(at, row, ndim - 1))
        return np.array(rows, dtype=float)
    known = checks.each(name, values, _number_or_nan)
    return np.array(known, dtype=float)


def _number_or_nan(name: str, value: Any) -> float:
    gap = value is None or (isinstance(value, float) and np.isnan(value))
    return np.nan if gap else checks.checked_number(name, value)


def _with_null(values: Array) -> Any:
    if values.ndim > 1:
        return [_with_null(row) for row in values]
    return [None if np.isnan(value) else value for value in values.tolist()]


# --- Mappings --------------------------------------------------------------------------------


def _object(name: str, value: Any) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{name} must be an object, got {checks.shown(value)}")
    return value


def _estimates(name: str, given: Any) -> dict[str, tuple[float, float]]:
    """Values with their errors; null in the file where there are none."""
    found = {}
    for key, pair in ({} if given is None else _object(name, given)).items():
        place = f"{name}.{key}"
        if isinstance(pair, Mapping):
            if set(pair) != {"value", "error"}:
                raise ValueError(f"{place} must have the entries value, error")
            pair = pair["value"], pair["error"]
        value, error = checks.checked_array(place, pair, (2,)).tolist()
        found[key] = value, error
    return found


Estimates = Annotated[
    Mapping[str, tuple[float, float]],
    Entry(
        _estimates,
        lambda found: {n: {"value": v, "error": e} for n, (v, e) in found.items()} or None,
    ),
]


def mapping(entry: Entry) -> Entry:
    """An object whose values are all of one type; null in the file where it is empty."""

    def check(name: str, given: Any) -> dict[str, Any]:
        known = {} if given is None else _object(name, given)
        return {key: entry.check(f"{name}.{key}", value) for key, value in known.items()}

    return Entry(check, lambda found: {key: entry.write(v) for key, v in found.items()} or None)


def _text_object(name: str, given: Any) -> dict[str, str]:
    return {key: checks.text(f"{name}.{key}", v) for key, v in _object(name, given).items()}


Texts = Annotated[Mapping[str, str], Entry(_text_object, dict)]
