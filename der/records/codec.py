"""Records of landscapes as JSON, one entry a line, and back; free of kernels.

A float is written by repr and comes back bit for bit; NaN is null. What is read is checked entry by
entry, so that a damaged file is refused in one line that says where.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from der.utils import checks
from der.utils.checks import Array, optional
from der.utils.files import Kept, json_entries, json_lines

SCHEMA = 1
T = TypeVar("T")


class OnDisk(Kept):
    """A record that writes itself as JSON, one entry a line, and reads itself again."""

    KIND: ClassVar[str]  # the first entry: what it is a record of

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        raise NotImplementedError

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """The record of what was written."""
        raise NotImplementedError

    def to_json(self) -> str:
        """JSON text of schema 1."""
        return json_lines({"kind": self.KIND, "schema": SCHEMA, **self.entries()})

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Record of a JSON text.

        Raises
        ------
        ValueError
            If it is not JSON, of another kind or schema, or not such a record; the message says
            where.
        """
        given = json_entries(text)
        if "kind" not in given:
            raise ValueError(f"not a record of {cls.KIND}")
        if (kind := given.pop("kind")) != cls.KIND:
            raise ValueError(f"kind is {checks.shown(kind)}, not {cls.KIND!r}")
        if (schema := given.pop("schema", None)) != SCHEMA:
            raise ValueError(f"schema is {checks.shown(schema)}, this version reads {SCHEMA}")
        entries = Entries("", given)
        record = cls.of_entries(entries)
        entries.end()
        return record


class Entries:
    """Entries of a JSON object that are taken one by one, each in its proper type.

    All methods raise ValueError with the place of an entry that is missing or wrong.
    """

    def __init__(self, where: str, given: object) -> None:
        if not isinstance(given, Mapping):
            raise ValueError(f"{where} must be an object, got {checks.shown(given)}")
        self._where = where
        self._left = dict(given)

    @property
    def names(self) -> tuple[str, ...]:
        """Entries that are left."""
        return tuple(self._left)

    def take(self, name: str, check: Callable[[str, Any], T]) -> T:
        """One entry that passes a check, such as `checks.text`."""
        place = f"{self._where}.{name}" if self._where else name
        if name not in self._left:
            raise ValueError(f"{place} is missing")
        return check(place, self._left.pop(name))

    def number(self, name: str) -> float:
        """A finite number."""
        return self.take(name, checks.checked_number)

    def number_or_none(self, name: str) -> float | None:
        """A finite number, or null."""
        return self.take(name, optional(checks.checked_number))

    def count(self, name: str) -> int:
        """A whole number >= 0."""
        return self.take(name, checks.count)

    def count_or_none(self, name: str) -> int | None:
        """A whole number >= 0, or null."""
        return self.take(name, optional(checks.count))

    def whole(self, name: str) -> int:
        """A whole number of either sign."""
        return self.take(name, _whole)

    def whole_or_none(self, name: str) -> int | None:
        """A whole number of either sign, or null."""
        return self.take(name, optional(_whole))

    def text(self, name: str) -> str:
        """A string."""
        return self.take(name, checks.text)

    def truth(self, name: str) -> bool:
        """True or false."""
        return self.take(name, checks.truth)

    def mapping(self, name: str) -> dict[str, Any]:
        """An object, as it is."""
        return self.take(name, checks.json_object)

    def array(self, name: str, *shape: int | str) -> Array:
        """Numbers of a shape as `checks.checked_array` takes it; null becomes NaN."""
        return self.take(name, lambda place, values: array_with_nulls(place, values, shape))

    def inside(self, name: str) -> Entries:
        """The entries of an object."""
        return self.take(name, Entries)

    def each(self, name: str, build: Callable[[Entries], T]) -> tuple[T, ...]:
        """What is built of every object of a list."""
        return tuple(self.take(name, lambda at, v: checks.each(at, v, _built(build))))

    def end(self) -> None:
        """Refuse what was not taken."""
        for name in self._left:
            place = f"{self._where}.{name}" if self._where else name
            raise ValueError(f"{place} is no entry of such a record")


def _whole(name: str, given: Any) -> int:
    return int(checks.checked_number(name, given, "a whole number", float.is_integer))


def _built(build: Callable[[Entries], T]) -> Callable[[str, Any], T]:
    def check(where: str, given: Any) -> T:
        entries = Entries(where, given)
        found = build(entries)
        entries.end()
        return found

    return check


def array_with_nulls(name: str, values: Any, shape: tuple[int | str, ...]) -> Array:
    """Nested lists of numbers and null as an array, null as NaN; letters in a shape are free."""
    if len(shape) > 1:
        rows = checks.each(name, values, lambda at, v: array_with_nulls(at, v, shape[1:]))
        _check_length(name, len(rows), shape[0])
        for i, row in enumerate(rows):
            if row.shape != rows[0].shape:
                raise ValueError(f"{name}[{i}] has shape {row.shape}, {name}[0] {rows[0].shape}")
        inner = [n if isinstance(n, int) else 0 for n in shape[1:]]
        return np.array(rows) if rows else np.zeros((0, *inner))
    numbers = checks.each(name, values, optional(checks.checked_number))
    _check_length(name, len(numbers), shape[0])
    return np.array([np.nan if v is None else v for v in numbers], dtype=float)


def _check_length(name: str, length: int, wanted: int | str) -> None:
    if isinstance(wanted, int) and length != wanted:
        raise ValueError(f"{name} must have {wanted} entries, got {length}")


def with_nulls(values: Array) -> object:
    """Nested lists with None for NaN."""
    if values.ndim > 1:
        return [with_nulls(row) for row in values]
    return [None if np.isnan(value) else float(value) for value in values]


def with_errors(values: Mapping[str, tuple[float, float]]) -> object:
    """Objects of value and error; None without any."""
    return {n: {"value": v, "error": e} for n, (v, e) in values.items()} or None


def errors_of(name: str, given: Any) -> dict[str, tuple[float, float]]:
    """Values and errors that `with_errors` wrote."""
    found: dict[str, tuple[float, float]] = {}
    for key, entry in ({} if given is None else checks.json_object(name, given)).items():
        entries = Entries(f"{name}.{key}", entry)
        found[key] = entries.number("value"), entries.number("error")
        entries.end()
    return found


def seconds(entries: Entries) -> float:
    """The time that a record says it took."""
    timing = entries.inside("timing")
    found = timing.number("solve_s")
    timing.end()
    return found


def sentences(name: str, given: Any) -> dict[str, str]:
    """An object of texts."""
    found = checks.json_object(name, given)
    return {key: checks.text(f"{name}.{key}", value) for key, value in found.items()}
