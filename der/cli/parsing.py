"""From groups of options to a command: parsing of numbers, and errors that name the option.

A group is a dataclass, and an option is a field of it:

    edges: int = option("Edges of the full ring.", 64)

The type of the field says how the text is read; a bool is a flag.
"""

from __future__ import annotations

import inspect
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import MISSING, field, fields
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

from der.cli.output import say

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping
    from dataclasses import Field

# fields of options by arguments of the package that are named otherwise
_FIELDS = {"n_edges": "edges", "twist_axis": "axis", "folder": "out", "ranges": "span"}
_FIELDS |= {"name": "names", "range": "span"}
_LABELS: ContextVar[Mapping[str, str]] = ContextVar("labels")  # of the command that runs, by field


def option(
    text: str, default: Any = None, *, name: str | None = None, metavar: str | None = None
) -> Any:
    """Declare a field that is an option; ``text`` is its help, ``name`` one of its own."""
    return field(default=default, metadata={"help": text, "name": name, "metavar": metavar})


def file_option(text: str) -> Any:
    """Declare a field that is the name of a file."""
    return option(text, metavar="F")


def folder_option(text: str, default: Any = None) -> Any:
    """Declare a field that is the name of a folder."""
    return option(text, default, metavar="DIR")


def argument(text: str, metavar: str, default: Any = MISSING) -> Any:
    """Declare a field that is an argument without a name."""
    return field(default=default, metadata={"argument": typer.Argument(metavar=metavar, help=text)})


def number(text: str) -> float:
    """Parse an option's number, so that a bad one is named with its value."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"must be a number, got {text!r}") from None


def integer(text: str) -> int:
    """Parse an option's integer, likewise."""
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"must be an integer, got {text!r}") from None


_PARSERS: dict[Any, Any] = {float: number, int: integer}


def numbers(name: str, text: str | None) -> tuple[float, ...] | None:
    """The numbers in a comma-separated list."""
    if text is None:
        return None
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"{name} must be numbers separated by commas, got {text!r}") from None


@contextmanager
def options_named() -> Iterator[None]:
    """Turn a ValueError about an argument into one about the command's option for it."""
    try:
        yield
    except ValueError as wrong:
        name, *words = str(wrong).split(" ", 1)
        labels = _LABELS.get({})
        named = labels.get(name) or labels.get(_FIELDS.get(name, ""), name)
        raise typer.TyperException(" ".join([named, *words])) from None


def application(text: str) -> typer.Typer:
    """A program without commands; ``text`` is its help."""
    return typer.Typer(
        help=text, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
    )


def add_command(
    app: typer.Typer, function: Callable[..., int], refused: Collection[str] = ()
) -> None:
    """Add a command: a function of groups of options that returns the exit code.

    Its options are the fields of the groups, so that commands share options and not text.

    Parameters
    ----------
    refused : fields that it allows to have their default value only; its help does not show them.
    """
    groups = get_type_hints(function)
    del groups["return"]
    labels = {one.name: _label(one) for group in groups.values() for one in fields(group)}

    def run(**given: Any) -> None:
        _LABELS.set(labels)
        made = {
            name: group(**{f.name: given[f.name] for f in fields(group)})
            for name, group in groups.items()
        }
        try:
            code = function(**made)
        except KeyboardInterrupt as stopped:  # typer would say nothing
            kept = f"; {stopped}" if str(stopped) else " before anything was found"
            say(f"der: stopped by the user{kept}")
            code = 130
        raise typer.Exit(code)

    parameters = [
        _parameter(one, get_type_hints(group)[one.name], hidden=one.name in refused)
        for group in groups.values()
        for one in fields(group)
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    run.__doc__ = function.__doc__
    app.command(name=function.__name__.replace("_", "-"))(run)


def _label(one: Field[Any]) -> str:
    """How a field is called on the command line: "--range", "SHAPE"."""
    found = one.metadata.get("argument")
    if found is not None:
        return str(found.metavar).strip("[].")
    return str(one.metadata["name"] or f"--{one.name.replace('_', '-')}")


def _parameter(one: Field[Any], hint: Any, *, hidden: bool) -> inspect.Parameter:
    """A field of a group as typer reads it."""
    found = one.metadata.get("argument")
    if found is None:
        names = [one.metadata["name"]] if one.metadata["name"] else []
        if hint is bool and not names:
            flag = f"--{one.name.replace('_', '-')}"
            names = [f"{flag}/--no-{flag[2:]}" if one.default else flag]
        parsers = [_PARSERS[kind] for kind in get_args(hint) or (hint,) if kind in _PARSERS]
        parser = parsers[0] if parsers else None
        text, metavar = one.metadata["help"], one.metadata["metavar"]
        found = typer.Option(*names, parser=parser, metavar=metavar, help=text, hidden=hidden)
    default = inspect.Parameter.empty if one.default is MISSING else one.default
    kind = inspect.Parameter.KEYWORD_ONLY
    return inspect.Parameter(one.name, kind, default=default, annotation=Annotated[hint, found])
