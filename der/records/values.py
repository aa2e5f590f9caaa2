"""The types of entries: numbers, texts, arrays and mappings, each with its check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Annotated, Any

import numpy as np

from der.geometry.scale import Scale
from der.geometry.section import SPREAD
from der.records.entries import Check, Entry
from der.utils import checks
from der.utils.checks import Array

# --- Single values ---------------------------------------------------------------------------


def integer(name: str, value: object) -> int:
    """Return an integer of either sign."""
    return int(
        checks.checked_number(name, checks.number(name, value), "an integer", float.is_integer)
    )


def one_of(allowed: Sequence[str]) -> Entry:
    """One of some words."""
    return Entry(lambda name, value: checks.one_of(name, value, allowed))


Number = Annotated[float, Entry(checks.number)]
Count = Annotated[int, Entry(checks.count)]
Integer = Annotated[int, Entry(integer)]
Text = Annotated[str, Entry(checks.text)]
Truth = Annotated[bool, Entry(checks.truth)]
Json = Annotated[Mapping[str, object], Entry(checks.json_object)]


def _scale(name: str, value: object) -> Scale:
    if isinstance(value, Scale):
        return value
    entries = checks.json_object(name, value)
    wanted = [one.name for one in fields(Scale)]
    if set(entries) != set(wanted):
        raise ValueError(f"{name} must have the entries {', '.join(wanted)}")
    try:
        return Scale(**entries)
    except ValueError as wrong:
        raise ValueError(f"{name}.{wrong}") from None


ScaleEntry = Annotated[Scale, Entry(_scale, asdict)]


def stated(*needed: str, **known: Check) -> Entry:
    """An object of JSON values, of which some have a check of their own, and some must be there."""

    def check(name: str, value: object) -> dict[str, Any]:
        found = checks.json_object(name, value)
        if missing := [key for key in needed if key not in found]:
            raise ValueError(f"{name}.{missing[0]} is missing")
        return found | {
            key: own(f"{name}.{key}", found[key]) for key, own in known.items() if key in found
        }

    return Entry(check)


def _ratio(name: str, value: object) -> float:
    allowed = f"a number from {1.0 / SPREAD:g} to {SPREAD:g}"
    return checks.checked_number(name, value, allowed, lambda r: 1.0 / SPREAD <= r <= SPREAD)


def _gammas(name: str, value: object) -> list[float]:
    return checks.each(name, value, checks.number)


_maybe_ratio, _maybe_number = checks.optional(_ratio), checks.optional(checks.number)
RingEntry = Annotated[Mapping[str, object], stated("shape", shape=checks.text)]
SectionEntry = Annotated[
    Mapping[str, object],
    stated(
        *("alpha", "beta"),
        **dict.fromkeys(("alpha", "beta"), _ratio),
        **dict.fromkeys(("h_over_t", "GJ"), _maybe_ratio),
        nu=_maybe_number,
    ),
]
NUMERICS: dict[str, Check] = {
    "tolerance": checks.positive,
    "a_over_t": _maybe_ratio,
    "save_at": checks.optional(_gammas),
}
NumericsEntry = Annotated[Mapping[str, object], stated(**NUMERICS)]


def nested(check: Check, depth: int) -> Check:
    """The check of tuples in tuples, ``depth`` of them, of values with a check."""
    if depth == 0:
        return check
    inner = nested(check, depth - 1)
    return lambda name, values: tuple(checks.each(name, values, inner))


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
        return checks.bounded(name, values.copy())
    if ndim > 1:
        rows = checks.each(name, values, lambda at, row: _with_nan(at, row, ndim - 1))
        return np.array(rows, dtype=float)
    known = checks.each(name, values, _number_or_nan)
    return np.array(known, dtype=float)


def _number_or_nan(name: str, value: Any) -> float:
    gap = value is None or (isinstance(value, float) and np.isnan(value))
    return np.nan if gap else checks.number(name, value)


def _with_null(values: Array) -> Any:
    if values.ndim > 1:
        return [_with_null(row) for row in values]
    return [None if np.isnan(value) else value for value in values.tolist()]


# --- Mappings --------------------------------------------------------------------------------


def _estimates(name: str, given: Any) -> dict[str, tuple[float, float]]:
    """Values with their errors; null in the file where there are none."""
    found = {}
    for key, pair in ({} if given is None else checks.keyed(name, given)).items():
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
        known = {} if given is None else checks.keyed(name, given)
        return {key: entry.check(f"{name}.{key}", value) for key, value in known.items()}

    return Entry(check, lambda found: {key: entry.write(v) for key, v in found.items()} or None)


def _texts(name: str, given: Any) -> dict[str, str]:
    return {key: checks.text(f"{name}.{key}", v) for key, v in checks.keyed(name, given).items()}


Texts = Annotated[Mapping[str, str], Entry(_texts, dict)]
