"""The states of a ring, how stable they are and which of them falls to which; free of kernels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import ClassVar, Self

from der.records.codec import Entries, OnDisk, seconds
from der.records.configurations import Shapes
from der.utils import checks

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
    """The states of a ring that were found, lowest first, and the falls between them.

    `load` reads what `save` or ``der states --out`` has written. The shapes of the states are in a
    file of their own, ``der.Shapes.load("shapes.npz")``, in the order of the states.
    """

    KIND: ClassVar[str] = "states"
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

    def __repr__(self) -> str:
        """Which ring, how many states, and how the search ended."""
        place = "free" if self.gamma is None else f"gamma={self.gamma:.6g}"
        return (
            f"States({self.ring.get('shape')}, {place}, {len(self)} states, "
            f"{len(self.minima)} minima, {self.status})"
        )

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
    def of_entries(cls, entries: Entries) -> Self:
        """The states as they are written: without the shapes."""
        return cls(
            entries.mapping("ring"),
            entries.mapping("section"),
            entries.mapping("numerics"),
            entries.number_or_none("gamma"),
            entries.each("states", _state),
            entries.each("transitions", _transition),
            entries.count("tried"),
            entries.count("nowhere"),
            entries.count("peaks"),
            entries.text("status"),
            entries.text("message"),
            seconds(entries),
        )


def _state(entries: Entries) -> RingState:
    return RingState(
        entries.text("name"),
        entries.number("energy"),
        entries.count_or_none("index"),
        entries.number("residual"),
        entries.truth("planar"),
        entries.whole_or_none("covering"),
        entries.whole_or_none("link"),
        entries.number_or_none("writhe"),
        entries.number("twist"),
        entries.truth("needs_cut"),
        entries.count("images"),
        entries.count_or_none("repeats"),
        entries.count("zero_modes"),
        entries.number_or_none("moment"),
        entries.number_or_none("distance"),
    )


def _transition(entries: Entries) -> Transition:
    return Transition(
        entries.text("start"),
        entries.take("end", checks.optional(checks.text)),
        entries.number("stiffness"),
        entries.whole("sign"),
        tuple(entries.take("via", lambda name, value: checks.each(name, value, checks.text))),
        entries.number_or_none("released"),
    )
