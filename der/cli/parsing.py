"""From groups of options to a command: parsing of numbers, and errors that name the option."""

from __future__ import annotations

import inspect
from contextlib import contextmanager
from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any, get_type_hints

import typer

from der.cli.output import say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_OPTIONS = {"n_edges": "--edges", "twist_axis": "--axis", "file": "FILE"}  # named otherwise


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


def numbers(name: str, text: str | None) -> tuple[float, ...] | None:
    """The numbers in a comma-separated list."""
    if text is None:
        return None
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise ValueError(f"{name} must be numbers separated by commas, got {text!r}") from None


def number_option(text: str, *names: str) -> Any:
    """An option that takes a number."""
    return typer.Option(*names, parser=number, help=text)


def integer_option(text: str, *names: str) -> Any:
    """An option that takes an integer."""
    return typer.Option(*names, parser=integer, help=text)


@contextmanager
def options_named() -> Iterator[None]:
    """Turn a ValueError about an argument into one about the option of that name."""
    try:
        yield
    except ValueError as wrong:
        name, *words = str(wrong).split(" ", 1)
        option = _OPTIONS.get(name, f"--{name.replace('_', '-')}")
        raise typer.TyperException(" ".join([option, *words])) from None


def add_command(app: typer.Typer, function: Callable[..., int]) -> None:
    """Add a command: a function of groups of options that returns the exit code.

    Its options are the fields of the groups, so that commands share options and not text.
    """
    groups = get_type_hints(function)
    del groups["return"]

    def run(**given: Any) -> None:
        made = {
            name: group(**{f.name: given[f.name] for f in fields(group)})
            for name, group in groups.items()
        }
        try:
            code = function(**made)
        except KeyboardInterrupt:  # typer would say nothing
            say("der: stopped by the user before anything was found")
            code = 130
        raise typer.Exit(code)

    hints: dict[str, Any] = {}
    for group in groups.values():
        hints |= get_type_hints(group, include_extras=True)
    parameters = [
        inspect.Parameter(
            f.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if f.default is MISSING else f.default,
            annotation=hints[f.name],
        )
        for group in groups.values()
        for f in fields(group)
    ]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = hints
    run.__doc__ = function.__doc__
    app.command(name=function.__name__)(run)
