"""The states of a ring, how stable they are and which of them falls to which; free of kernels."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from der import checks
from der.files import FilePath
from der.landscape_record import SCHEMA, OnDisk
from der.shapes import Shapes

STATUSES = ("done", "interrupted", "not converged")


@dataclass(frozen=True)
class RingState:
    """An equilibrium of a ring, in its grips or free in space.

    Mirror images, reversals and shifts that map the ring on itself are one state.
    """

    name: str
    energy: float  # GJ/a, of the full ring
    index: int | None  # ways down, rigid motions and others without cost left out; None: singular
    residual: float  # largest force left, GJ/a
    planar: bool  # whether the centreline lies in a plane, to 1e-6 a
    covering: int | None  # turning number of a planar centreline, by the sense of d1; else None
    link: int | None  # None where strands touch, as in a planar shape that crosses itself
    writhe: float | None  # turns; None likewise
    twist: float  # turns
    needs_cut: bool  # whether the bar was cut, turned once about itself and joined to get there
    images: int  # in how many shapes it comes that mirror, reverse or relabel each other
    repeats: int | None  # times a shape repeats itself around a uniform ring; 0: the same all over
    zero_modes: int  # motions without cost beyond rigid ones: shift of the material, spin
    moment: float | None = None  # of one arm, GJ/a, in grips
    distance: float | None = None  # between the grips, a

    @property
    def stable(self) -> bool:
        """Whether it is a minimum."""
        return self.index == 0


@dataclass(frozen=True)
class Transition:
    """Where a state falls to when it is pushed along one of its ways down."""

    start: str
    end: str | None  # a minimum; None: it came to no rest
    stiffness: float  # eigenvalue of the mode pushed along, GJ/a^2, < 0
    sign: int  # of the push
    via: tuple[str, ...]  # saddles on which symmetry let it rest, before it was nudged on
    released: float | None  # energy, GJ/a

    def __post_init__(self) -> None:
        object.__setattr__(self, "via", tuple(self.via))


@dataclass(frozen=True, eq=False)
class States(OnDisk):
    """The states of a ring that were found, lowest first, and the falls between them."""

    ring: Mapping[str, object]
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    gamma: float | None  # rotation of each grip, rad; None: without grips
    states: tuple[RingState, ...]
    transitions: tuple[Transition, ...]
    tried: int  # starts of the search
    nowhere: int  # starts that led to no new state
    peaks: int  # states with more than 8 ways down, which are left out
    status: str = "done"
    message: str = ""
    solve_s: float = 0.0
    shapes: Shapes | None = field(default=None, repr=False)  # of the states; not in the JSON

    def __post_init__(self) -> None:
        checks.one_of("status", self.status, STATUSES)
        names = [state.name for state in self.states]
        if len(set(names)) < len(names):
            raise ValueError(f"states must have names of their own, got {names}")
        for fall in self.transitions:
            for name in (fall.start, *fall.via, *([] if fall.end is None else [fall.end])):
                if name not in names:
                    raise ValueError(f"transitions must be between states, got {name!r}")

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> RingState:
        for state in self.states:
            if state.name == name:
                return state
        raise KeyError(name)

    @property
    def minima(self) -> tuple[RingState, ...]:
        """The states in which a ring stays."""
        return tuple(state for state in self.states if state.stable)

    def falls_to(self, name: str) -> tuple[str, ...]:
        """The minima that a state falls to, each once."""
        ends = [fall.end for fall in self.transitions if fall.start == name]
        return tuple(dict.fromkeys(end for end in ends if end is not None))

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        return {
            "status": self.status,
            "message": self.message,
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "gamma": self.gamma,
            "states": [asdict(state) for state in self.states],
            "transitions": [asdict(fall) for fall in self.transitions],
            "tried": self.tried,
            "nowhere": self.nowhere,
            "peaks": self.peaks,
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def from_json(cls, text: str) -> States:
        """The record that `to_json` wrote; without shapes.

        Raises
        ------
        ValueError
            If the text is not such a record.
        """
        try:
            entries = checks.json_object("states", json.loads(text))
        except json.JSONDecodeError as wrong:
            raise ValueError(f"states must be JSON: {wrong}") from None
        if entries.pop("schema", None) != SCHEMA:
            raise ValueError(f"schema of states must be {SCHEMA}")
        timing = _object("timing", entries.pop("timing", None), {"solve_s"})
        expected = {f.name for f in fields(cls)} - {"shapes", "solve_s"}
        if set(entries) != expected:
            raise ValueError(f"states must have entries {sorted(expected)}, got {sorted(entries)}")
        gamma = checks.optional(checks.checked_number)("gamma", entries["gamma"])
        return cls(
            checks.json_object("ring", entries["ring"]),
            checks.json_object("section", entries["section"]),
            checks.json_object("numerics", entries["numerics"]),
            gamma,
            tuple(checks.each("states", entries["states"], _state)),
            tuple(checks.each("transitions", entries["transitions"], _transition)),
            checks.count("tried", entries["tried"]),
            checks.count("nowhere", entries["nowhere"]),
            checks.count("peaks", entries["peaks"]),
            checks.text("status", entries["status"]),
            checks.text("message", entries["message"]),
            checks.checked_number("solve_s", timing["solve_s"]),
        )

    @classmethod
    def load(cls, path: FilePath) -> States:
        """The record in a JSON file.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If it is not such a record.
        """
        with open(path, encoding="utf-8") as file:
            try:
                return cls.from_json(file.read())
            except ValueError as wrong:
                raise ValueError(f"{os.fspath(path)}: {wrong}") from wrong


def _whole(name: str, value: object) -> int:
    """A whole number of either sign."""
    number = checks.checked_number(name, value, "a whole number", float.is_integer)
    return int(number)


_CHECKS: Mapping[str, Any] = {
    "name": checks.text,
    "energy": checks.checked_number,
    "index": checks.optional(checks.count),
    "residual": checks.checked_number,
    "planar": checks.truth,
    "covering": checks.optional(_whole),
    "link": checks.optional(_whole),
    "writhe": checks.optional(checks.checked_number),
    "twist": checks.checked_number,
    "needs_cut": checks.truth,
    "images": checks.count,
    "repeats": checks.optional(checks.count),
    "zero_modes": checks.count,
    "moment": checks.optional(checks.checked_number),
    "distance": checks.optional(checks.checked_number),
    "start": checks.text,
    "end": checks.optional(checks.text),
    "stiffness": checks.checked_number,
    "sign": _whole,
    "via": lambda name, value: checks.each(name, value, checks.text),
    "released": checks.optional(checks.checked_number),
}


def _object(name: str, value: object, expected: set[str]) -> dict[str, Any]:
    entries = checks.json_object(name, value)
    if set(entries) != expected:
        raise ValueError(f"{name} must have entries {sorted(expected)}, got {sorted(entries)}")
    return entries


def _checked(name: str, value: object, kind: type) -> dict[str, Any]:
    entries = _object(name, value, {f.name for f in fields(kind)})
    return {key: _CHECKS[key](f"{name}.{key}", entry) for key, entry in entries.items()}


def _state(name: str, value: object) -> RingState:
    return RingState(**_checked(name, value, RingState))


def _transition(name: str, value: object) -> Transition:
    return Transition(**_checked(name, value, Transition))
