"""Values that no argument may take, and the arguments of all public functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from der.geometry.scale import Scale
from der.geometry.section import Section, rectangular_section, section
from der.geometry.shapes import circle, ellipse, profile, rectangle, ring_from_json, triangle
from der.records.path import Path
from der.scene import Scene

LONGEST = 400  # characters of a sentence


class Argument(NamedTuple):
    """An argument of something public.

    ``names`` are those with which a message may begin: a section's ratio may overflow, and a unit.
    """

    where: str
    names: tuple[str, ...]
    call: Callable[[Any], object]
    refused: Mapping[str, Any]  # besides what is refused of every number


# Refused wherever a number is wanted; by name, so that a case is JSON.
NEVER: dict[str, Any] = {
    "nan": math.nan,
    "inf": math.inf,
    "-inf": -math.inf,
    "float32 inf": np.float32(np.inf),
    "huge int": 10**400,
    "unprintable int": 10**5000,
    "huge fraction": Fraction(10**400, 3),
    "bool": True,
    "numpy bool": np.bool_(True),
    "none": None,
    "text": "1",
    "bytes": b"1",
    "complex": 1j,
    "list": [1.0],
    "nested": [[1.0, 2.0], [3.0]],
    "dict": {},
    "object": object(),
    "type": float,
    "0-d array": np.array(1.0),
    "array": np.ones(3),
    "complex array": np.ones(3) * 1j,
}
NOT_POSITIVE = {"0": 0.0, "-0": -0.0, "-1": -1.0, "minus subnormal": -5e-324}
# May be accepted, or refused in a sentence; nothing else may happen.
PERHAPS: dict[str, Any] = {
    "subnormal": 5e-324,
    "nearly subnormal": 1e-310,
    "tiny": 1e-160,
    "large": 1e160,
    "largest": 1.7976931348623157e308,
    "float16": np.float16(0.1),
    "int64": np.int64(1),
    "fraction": Fraction(1, 3),
    "longdouble": np.longdouble(0.25),
}


SWITCHES = (
    *("stability", "self_crossings", "error_bars", "shapes"),
    *("history", "modes", "forces", "unload"),
)
CHOICES = ("sector", "control", "solver", "curvature", "stretch", "until")  # of a scene


def _but(*taken: str, **more: Any) -> dict[str, Any]:
    """The values that are never accepted, without some of them, and with others."""
    return {name: value for name, value in NEVER.items() if name not in taken} | more


def _numbers(where: str, names: str, call: Callable[[Any], object], **refused: Any) -> Argument:
    return Argument(where, tuple(names.split()), call, NEVER | refused)


def arguments() -> tuple[Argument, ...]:
    """Every argument of the public functions and classes that state a problem."""
    return (*_of_rings(), *_of_sections(), *_of_scenes(), *_of_records())


def _of_rings() -> Iterator[Argument]:
    axes = _but("text")
    yield _numbers("circle", "natural_curvature", circle)
    yield _numbers("ellipse", "b_over_a", ellipse, **NOT_POSITIVE, more=1.1)
    yield Argument("ellipse", ("twist_axis",), lambda v: ellipse(0.5, v), axes | {"z": "z"})
    yield _numbers("rectangle", "b_over_a", lambda v: rectangle(v, 0.1), **NOT_POSITIVE)
    yield _numbers("rectangle", "r_over_a", lambda v: rectangle(0.5, v), **NOT_POSITIVE)
    yield Argument("rectangle", ("twist_axis",), lambda v: rectangle(0.5, 0.1, v), axes)
    yield _numbers("triangle", "vertex_angle", lambda v: triangle(v, 0.01), **NOT_POSITIVE)
    yield _numbers("triangle", "r_over_a", lambda v: triangle(1.0, v), **NOT_POSITIVE)
    around = [0.0, 2.0 * math.pi]
    arrays = {"empty": [], "short": [0.0], "with nan": [0.0, math.nan], "falling": [1.0, 0.0]}
    yield _numbers("profile", "arc_length", lambda v: profile(v, [1.0, 1.0]), **arrays)
    yield _numbers("profile", "curvature arc_length", lambda v: profile(around, v), **arrays)
    rows = {"with nan": [[math.nan, 0.0]] * 9, "in one place": [[1.0, 1.0]] * 9, "few": [[0, 0]]}
    yield Argument("profile", ("points",), lambda v: profile(points=v), _but("none", **rows))
    # arc lengths of a ring: an array of numbers of any shape
    wrong = _but("list", "0-d array", "array", "bool", "numpy bool")
    for name in ("angle", "natural_angle", "curvature", "position"):
        yield Argument(f"Ring.{name}", ("s",), getattr(circle(), name), wrong)
    yield Argument("ring_from_json", ("shape", "ring"), lambda v: ring_from_json({"shape": v}), {})


def _of_sections() -> Iterator[Argument]:
    positive = NOT_POSITIVE
    yield _numbers("rectangular_section", "h_over_t alpha beta", rectangular_section, **positive)
    yield _numbers("rectangular_section", "nu", lambda v: rectangular_section(4.0, v), more=0.6)
    yield _numbers("section", "alpha", lambda v: section(v, 1.0), **positive)
    yield _numbers("section", "beta", lambda v: section(1.0, v), **positive)
    yield Argument("Section", ("h_over_t",), lambda v: Section(1.0, 1.0, v), _but("none"))
    yield Argument("Section", ("nu",), lambda v: Section(1.0, 1.0, 1.0, v), _but("none"))
    units = "a GJ moment force"
    usual = {"young_modulus": 1e9, "nu": 0.3, "h": 1.0, "t": 0.1, "a": 10.0}
    for name in usual:
        refused = {} if name == "nu" else positive
        yield _numbers("Scale.of", f"{name} {units}", _with(Scale.of, usual, name), **refused)
    ones = {"a": 1.0, "GJ": 1.0}
    for name in ones:
        yield _numbers("Scale", f"{name} {units}", _with(Scale, ones, name), **positive)


def _with(
    make: Callable[..., object], usual: Mapping[str, Any], name: str
) -> Callable[[Any], object]:
    """A call with the usual values, and a given one for ``name``."""
    return lambda value: make(**{**usual, name: value})


def _of_scenes() -> Iterator[Argument]:
    usual = {"ring": circle(), "section": rectangular_section(4.0)}

    def argument(name: str, refused: Mapping[str, Any]) -> Argument:
        return Argument("Scene", (name,), _with(Scene, usual, name), refused)

    for name in usual:
        yield argument(name, NEVER)
    for name in ("gamma_max", "a_over_t", "tolerance"):
        yield argument(name, NEVER | NOT_POSITIVE)
    yield argument("n_edges", NEVER | {"odd": 63, "few": 4, "many": 2**20})
    optional = {"self_crossings": ("none",), "until": ("none",)}
    for name in SWITCHES:
        yield argument(name, _but("bool", "numpy bool", *optional.get(name, ())))
    for name in CHOICES:
        yield argument(name, _but(*optional.get(name, ())))
    lists = {"past the end": [9.0], "negative": [-1.0], "with nan": [math.nan], "words": ["1"]}
    # an iterable of numbers, or an empty one, is accepted
    yield argument("save_at", _but("none", "list", "array", "dict", "bytes", **lists))


def _of_records() -> Iterator[Argument]:
    texts = {"empty": "", "number": "1", "list": "[]", "no schema": "{}", "torn": '{"schema": 1,'}
    yield Argument(
        "Path.from_json",
        ("not", "schema", "points", "record", "timing"),
        Path.from_json,
        {**texts, "deep": "[" * 100_000, "long": '{"schema": ' + "9" * 5000 + "}"},
    )


def refusal(argument: Argument, name: str) -> str | None:
    """A sentence where a value is wrongly accepted or wrongly refused; None where all is right.

    Exceptions other than ValueError are raised.
    """
    is_refused = name in argument.refused
    value = argument.refused[name] if is_refused else PERHAPS[name]
    try:
        argument.call(value)
    except ValueError as wrong:
        text = str(wrong)
        if not text.startswith(argument.names):
            return f"{argument.names[0]} of {argument.where} is not named: {text[:160]}"
        if "\n" in text or len(text) > LONGEST + 200:
            return (
                f"{argument.names[0]} of {argument.where}: {len(text)} characters are no sentence"
            )
        return None
    return f"{argument.names[0]} of {argument.where} takes {name}" if is_refused else None
