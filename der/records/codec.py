"""Reading of every record: objects of plain JSON values.

cattrs builds the nested objects and keeps the place of what is wrong; the entries themselves are
checked by the objects, and written by `der.records.entries.plain`. cattrs is imported when
something is read, because importing it takes as long as everything else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import cache, partial
from inspect import isclass
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

from der.records.entries import Checked, entry_of, written
from der.utils import checks
from der.utils.checks import short, shown

Kind = TypeVar("Kind", bound=Checked)
LONGEST = 400  # characters of a sentence about what is wrong


class _Misplaced(ValueError):
    """A value of the wrong kind; its message follows the name of its place."""


class _InList(ValueError):
    """What is wrong with the entry of a list at the place that is its message."""


def record_of(kind: type[Kind], values: Any) -> Kind:
    """Object of a class, of plain JSON values.

    Raises
    ------
    ValueError
        Where an entry is missing, unknown, or not what its type says; the message begins with its
        place, such as ``points[3].gamma``.
    """
    from cattrs import BaseValidationError

    try:
        found: Kind = _converter().structure(values, kind)
    except (BaseValidationError, ValueError) as problem:
        raise ValueError(short(_fault(problem), LONGEST)) from None
    except RecursionError:
        raise ValueError("an entry is nested too deep") from None
    return found


@cache
def _converter() -> Any:
    """The converter, with hooks for entries, tuples and objects."""
    from cattrs import Converter
    from cattrs.gen import make_dict_structure_fn, override

    converter = Converter(detailed_validation=True)

    def of_object(kind: Any) -> Callable[[Any, Any], Any]:
        hints = get_type_hints(kind, include_extras=True)
        for one in fields(kind):  # of which cattrs would take the bare type
            one.type = hints[one.name]
        left_out = {one.name for one in fields(kind)} - set(written(kind))
        omitted: dict[str, Any] = {name: override(omit=True) for name in left_out}
        build = make_dict_structure_fn(kind, converter, _cattrs_forbid_extra_keys=True, **omitted)
        needed = [name for name in written(kind) if name not in kind.OPTIONAL]

        def read(value: Any, _: Any) -> Any:
            entries = kind.from_disk(dict(_a(dict, value)))
            if missing := [name for name in needed if name not in entries]:
                raise ValueError(f"{missing[0]} is missing")
            return build(entries, kind)

        return read

    # the last one that fits is taken
    converter.register_structure_hook_factory(_is_tuple, partial(_tuple_reader, converter))
    converter.register_structure_hook_factory(
        lambda hint: isclass(hint) and issubclass(hint, Checked), of_object
    )
    converter.register_structure_hook_func(
        lambda hint: not _is_tuple(hint) and entry_of(hint) is not None, lambda value, _: value
    )
    return converter


def _tuple_reader(converter: Any, hint: Any) -> Callable[[Any, Any], Any]:
    """What reads a list of entries of one kind, up to the first wrong one."""
    from cattrs import BaseValidationError

    kind = get_args(hint)[0]

    def one(place: int, value: Any) -> Any:
        try:
            return converter.structure(value, kind)
        except (BaseValidationError, ValueError) as problem:
            raise _InList(f"[{place}]") from problem

    return lambda value, _: tuple(one(*pair) for pair in enumerate(_a(list, value)))


def _is_tuple(hint: Any) -> bool:
    origin: object = get_origin(hint)
    return origin is tuple


def _a(kind: type, value: Any) -> Any:
    """The value, if it is a list or an object."""
    if isinstance(value, kind):
        return checks.keyed("an object", value) if kind is dict else value
    raise _Misplaced(f"must be {'a list' if kind is list else 'an object'}, got {shown(value)}")


def _fault(problem: BaseException) -> str:
    """The first thing that is wrong, after its place."""
    from cattrs import BaseValidationError, ForbiddenExtraKeysError
    from cattrs.errors import AttributeValidationNote

    place = ""
    while isinstance(problem, BaseValidationError | _InList):
        if isinstance(problem, _InList):
            place += str(problem)
            problem = cast(BaseException, problem.__cause__)
            continue
        noted, others = problem.group_exceptions()  # type: ignore[attr-defined]
        kind: Any = problem.cl
        problem, note = noted[0] if noted else (others[0], None)
        if isinstance(note, AttributeValidationNote) and note.name != kind.JOINED:
            place += f".{note.name}" if place else note.name
    if isinstance(problem, _Misplaced):
        return f"{place} {problem}"
    before = f"{place}." if place else ""
    if isinstance(problem, ForbiddenExtraKeysError):
        return f"{before}{min(problem.extra_fields)} is no entry of such a record"
    return before + str(problem)
