"""Checks of arguments and of entries of files: the value in its proper type, or a ValueError.

The first argument of every check is a name for the message: "h_over_t must be a finite number > 0,
got -1". A bool is no number; scalars of numpy are numbers.
"""

import math
import reprlib
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from numbers import Real
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Counts: TypeAlias = "np.ma.MaskedArray[Any, np.dtype[np.int64]]"
T = TypeVar("T")

LARGEST = 1e30  # number of a record or array: its square, and its single precision, are finite
LONGEST = 2000  # characters of a text in a record
LEVELS = 20  # of objects and lists in each other

# --- Arguments -------------------------------------------------------------------------------


def checked_number(
    name: str,
    value: object,
    allowed: str = "a finite number",
    is_allowed: Callable[[float], bool] = lambda number: True,
) -> float:
    """Return `value` as a float if it is a finite real number that `is_allowed` accepts.

    Parameters
    ----------
    name : str
        Name for the message.
    value : object
        The value given.
    allowed : str
        The allowed values, in words, for the message: "a finite number > 0".
    is_allowed : callable
        The same as a predicate of a finite float.

    Returns
    -------
    float
        The number.

    Raises
    ------
    ValueError
        If `value` is not a number (a bool and a string are none), not finite, or not allowed.
    """
    if type(value) is float and math.isfinite(value) and is_allowed(value):
        return value  # the usual case
    number = math.nan
    if type(value) is float:  # usual, and faster to test than other numbers
        number = value
    elif isinstance(value, Real) and not isinstance(value, bool):
        with suppress(OverflowError):  # an int too large for a float stays nan
            number = float(value)
    if math.isfinite(number) and is_allowed(number):
        return number
    raise ValueError(f"{name} must be {allowed}, got {shown(value)}")


_SHORT = reprlib.Repr()
_SHORT.maxlevel = 5
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = _SHORT.maxset = _SHORT.maxfrozenset = 50
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 400


def shown(value: object) -> str:
    """Return any value as text for a sentence: one line of limited length."""
    try:
        text = str(value) if isinstance(value, Real) else _SHORT.repr(value)
    except ValueError:  # integers of more than 4300 digits cannot be printed
        text = f"a {type(value).__name__} of too many digits"
    return short(text)


def short(text: str, most: int = 200) -> str:
    """Return a text as one line of limited length."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[: most - 10]} ..."


def positive(name: str, value: object) -> float:
    """Return a finite number > 0."""
    return checked_number(name, value, "a finite number > 0", lambda number: number > 0)


def one_of(name: str, value: object, allowed: Collection[str]) -> str:
    """Return one of the words in `allowed`."""
    if isinstance(value, str) and value in allowed:
        return value
    raise ValueError(f"{name} must be one of {', '.join(allowed)}, got {shown(value)}")


def checked_array(name: str, values: ArrayLike | None, shape: tuple[int | str, ...]) -> Array:
    """Return a copy of an array of finite numbers.

    Parameters
    ----------
    name : str
        Name for the message.
    values : array_like
        The values given.
    shape : tuple
        A number for every dimension of fixed length, a letter for every free one: ("n", 3).

    Returns
    -------
    ndarray
        Of floats.

    Raises
    ------
    ValueError
        If `values` is no such array, or an entry not finite.
    """
    wanted = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    try:
        given = np.asarray(values)
    except ValueError:  # rows of different lengths
        given = np.asarray(None)
    if given.dtype.kind not in "iuf" or given.ndim != len(shape):
        raise ValueError(f"{name} must be an array of numbers, shape {wanted}, got {shown(values)}")
    if any(n != m for n, m in zip(shape, given.shape, strict=True) if isinstance(n, int)):
        raise ValueError(f"{name} must have shape {wanted}, got {given.shape}")
    for place in np.argwhere(~np.isfinite(given))[:1].tolist():
        raise ValueError(f"{name} must be finite numbers, got {name}{place} = {given[*place]}")
    return bounded(name, given.astype(np.float64))


def bounded(name: str, values: Array) -> Array:
    """Return an array if none of its numbers is larger than `LARGEST`."""
    for place in np.argwhere(np.abs(values) > LARGEST)[:1].tolist():
        where = f"{name}{place}" if place else name
        raise ValueError(f"{where} must be at most {LARGEST:g} in size, got {values[*place]}")
    return values


# --- Entries of a record ---------------------------------------------------------------------


def number(name: str, value: object) -> float:
    """Return a finite number that is not larger than `LARGEST`."""
    found = checked_number(name, value)
    if abs(found) > LARGEST:
        raise ValueError(f"{name} must be at most {LARGEST:g} in size, got {shown(value)}")
    return found


def text(name: str, value: object) -> str:
    """Return a string that can be printed: one line of limited length."""
    if not isinstance(value, str):
        raise ValueError(f"{name} must be a text, got {shown(value)}")
    if len(value) > LONGEST:
        raise ValueError(f"{name} must have at most {LONGEST} characters, got {len(value)}")
    if not value.isprintable():  # half a character, or what a terminal takes for a command
        raise ValueError(f"{name} must be one line of printable characters, got {shown(value)}")
    return value


def truth(name: str, value: object) -> bool:
    """Return a bool."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise ValueError(f"{name} must be true or false, got {shown(value)}")


def count(name: str, value: object) -> int:
    """Return an integer >= 0 that fits 64 bits."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and 0 <= value < 2**63:
        return int(value)
    raise ValueError(f"{name} must be an integer >= 0, got {shown(value)}")


def optional(check: Callable[[str, Any], T]) -> Callable[[str, Any], T | None]:
    """Return the check that lets None pass as well."""
    return lambda name, value: None if value is None else check(name, value)


def numbers(name: str, values: object) -> Array:
    """Return a read-only copy of a list or a one-dimensional array of finite numbers."""
    if _are_floats(values):
        array = np.array(values)
    else:
        array = np.array(each(name, values, checked_number), dtype=np.float64)
    bounded(name, array)
    array.setflags(write=False)
    return array


def _are_floats(values: object) -> bool:
    """Whether this is a plain one-dimensional array of finite floats, which need no check each."""
    plain = type(values) is np.ndarray and values.ndim == 1 and values.dtype == np.float64
    return plain and bool(np.isfinite(values).all())  # type: ignore[call-overload]


def counts(name: str, values: object) -> Counts:
    """Return a read-only copy of a list of counts and None, or of a masked array of integers."""
    known = each(name, values, optional(count))
    data = np.array([value or 0 for value in known], dtype=np.int64)
    mask = np.array([value is None for value in known], dtype=np.bool_)
    data.setflags(write=False)
    mask.setflags(write=False)
    return np.ma.MaskedArray(data, mask=mask, copy=False)


def each(name: str, values: object, check: Callable[[str, Any], T]) -> list[T]:
    """Return the checked entries of a list or array, of which an array's masked ones are None."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, list | tuple):
        raise ValueError(f"{name} must be a list, got {shown(values)}")
    return [check(f"{name}[{i}]", value) for i, value in enumerate(values)]


def keyed(name: str, value: object) -> Mapping[str, Any]:
    """Return a mapping whose keys are texts."""
    if not isinstance(value, Mapping):
        raise ValueError(f"{name} must be an object, got {shown(value)}")
    for key in value:
        text(f"a key of {name}", key)
    return value


def json_object(name: str, value: object, levels: int = LEVELS) -> dict[str, Any]:
    """Return a copy of a mapping in the types of JSON, which a file keeps.

    Parameters
    ----------
    levels : of mappings and lists in each other, at most.
    """
    return {
        key: _json_value(f"{name}.{key}", entry, levels - 1)
        for key, entry in keyed(name, value).items()
    }


def _json_value(name: str, value: object, levels: int) -> object:
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return text(name, value)
    if isinstance(value, int):
        number(name, value)
        return value
    if isinstance(value, float):
        return number(name, value)
    if isinstance(value, Mapping | list | tuple) and not levels:
        raise ValueError(f"{short(name)} must have at most {LEVELS} levels")
    if isinstance(value, Mapping):
        return json_object(name, value, levels)
    if isinstance(value, list | tuple):
        if all(type(entry) is float and abs(entry) <= LARGEST for entry in value):
            return list(value)  # long lists are of this kind
        return each(name, value, lambda at, entry: _json_value(at, entry, levels - 1))
    raise ValueError(f"{name} must be something JSON can hold, got a {type(value).__name__}")
