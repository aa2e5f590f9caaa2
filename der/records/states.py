"""The states of a ring, how stable they are and which of them snaps to which; free of kernels."""

from __future__ import annotations

from dataclasses import dataclass

from der.records.configurations import Shapes
from der.records.entries import Checked, in_memory
from der.records.record import RingRecord, SolveTime
from der.records.values import Count, Integer, Number, Text, Truth


@dataclass(frozen=True)
class RingState(Checked):
    """An equilibrium of a ring, in its grips or free in space.

    Mirror images, reversals and shifts that map the ring on itself are one state.
    """

    name: Text
    energy: Number  # GJ/a, of the full ring
    index: Count | None  # unstable modes, motions without cost left out; None: singular
    residual: Number  # largest force left, GJ/a
    planar: Truth  # whether the centreline lies in a plane, to 1e-6 a
    covering: Integer | None  # turning number of a planar centreline, by the sense of d1; else None
    link: Integer | None  # None where strands touch, as in a planar shape that crosses itself
    writhe: Number | None  # turns; None likewise
    twist: Number  # turns
    needs_cut: Truth  # whether the bar was cut, turned once about itself and joined to get there
    images: Count  # in how many shapes it comes that mirror, reverse or relabel each other
    repeats: Count | None  # of a shape around a uniform ring; 0: the same all over
    zero_modes: Count  # motions without cost beyond rigid ones: shift of the material, spin
    moment: Number | None = None  # of one arm, GJ/a, in grips
    distance: Number | None = None  # between the grips, a

    @property
    def stable(self) -> bool:
        """Whether it is a minimum."""
        return self.index == 0


@dataclass(frozen=True)
class Transition(Checked):
    """The end state of a state that is pushed along one of its unstable modes."""

    start: Text
    end: Text | None  # a minimum; None: no end state was reached
    stiffness: Number  # eigenvalue of the mode pushed along, GJ/a^2, < 0
    sign: Integer  # of the push
    via: tuple[Text, ...]  # saddles where its symmetry held it, until it was perturbed
    released: Number | None  # energy, GJ/a


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class States(RingRecord, name="states of a ring", kind="states", plot="states"):
    """The states of a ring that were found, lowest first, and the transitions between them.

    `load` reads what `save` or ``der states --out`` has written. The shapes of the states are in a
    file of their own, ``der.Shapes.load("shapes.npz")``, in the order of the states.
    """

    gamma: Number | None  # rotation of each grip, rad; None: without grips
    states: tuple[RingState, ...]
    transitions: tuple[Transition, ...]
    tried: Count  # initial guesses of the search
    nowhere: Count  # initial guesses that led to no new state
    peaks: Count  # states with more than 8 unstable modes, which are left out
    timing: SolveTime = SolveTime(0.0)
    shapes: Shapes | None = in_memory()  # of the states

    def __post_init__(self) -> None:
        super().__post_init__()
        names = [state.name for state in self.states]
        if len(set(names)) < len(names):
            raise ValueError(f"states must have names of their own, got {names}")
        for fall in self.transitions:
            for name in (fall.start, *fall.via, *([] if fall.end is None else [fall.end])):
                if name not in names:
                    raise ValueError(f"transitions must be between states, got {name!r}")

    def facts(self) -> list[str]:
        """How many states, and where."""
        place = "free" if self.gamma is None else f"gamma={self.gamma:.6g}"
        return [place, f"{len(self)} states", f"{len(self.minima)} minima"]

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> RingState:
        for state in self.states:
            if state.name == name:
                return state
        raise KeyError(name)

    @property
    def minima(self) -> tuple[RingState, ...]:
        """The stable states."""
        return tuple(state for state in self.states if state.stable)

    def falls_to(self, name: str) -> tuple[str, ...]:
        """The minima that a state snaps to, each once."""
        ends = [fall.end for fall in self.transitions if fall.start == name]
        return tuple(dict.fromkeys(end for end in ends if end is not None))
