"""The planar states of a ring, and how it is squeezed in its plane; free of kernels.

Energies are those of the full ring in GJ/a, lengths in a, forces in GJ/a^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from der.records.configurations import Shapes
from der.records.entries import Checked, in_memory
from der.records.record import RingRecord, SolveTime
from der.records.units import unit
from der.records.values import Column, Count, Integer, Number, Text, along, gaps, one_of
from der.utils.checks import Array

KINDS = ("", "fold", "limit", "branch")
FOLDED = 3  # turns of the folded ring


@dataclass(frozen=True)
class PlanarState(Checked):
    """An equilibrium of a ring that stays in its plane, symmetric about the twisting axis."""

    name: Text
    turning: Integer  # turns of the tangent; below 0 inside out
    energy: Number  # GJ/a
    energy_error: Number | None  # None: no error bars, or a coarser mesh has no such state
    index: Count | None  # unstable modes in the plane; None: not known
    zero_modes: Count  # motions in the plane without cost: shift of the material
    force: Number  # in the bar at the first grip, its size, GJ/a^2
    packing: Number | None  # area inside the outer boundary over that of the flat ring; None: flat
    packing_error: Number | None
    residual: Number  # GJ/a

    @property
    def stable(self) -> bool:
        """Whether it is a minimum among planar shapes; in space it need not be one."""
        return self.index == 0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PlanarStates(RingRecord, name="planar states of a ring", kind="planar", plot="planar"):
    """The planar states of a ring that were found, lowest first.

    `load` reads what `save` or ``der planar --out`` has written. The shapes are in a file of their
    own, ``der.Shapes.load("shapes.npz")``, in the order of the states.
    """

    states: tuple[PlanarState, ...]
    timing: SolveTime = SolveTime(0.0)
    shapes: Shapes | None = in_memory()  # of the states

    def facts(self) -> list[str]:
        """How many states."""
        return [f"{len(self)} states"]

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, name: str) -> PlanarState:
        for state in self.states:
            if state.name == name:
                return state
        raise KeyError(name)

    @property
    def folded(self) -> PlanarState | None:
        """The three-covered state of least energy: the shape of the folded ring."""
        return next((state for state in self.states if state.turning == FOLDED), None)


@dataclass(frozen=True)
class SqueezePoint(Checked):
    """A special point on the path: a fold of the distance, a limit of the force, a branch point."""

    kind: Annotated[str, one_of(KINDS)]
    distance: Number
    force: Number
    energy: Number
    index_before: Count | None
    index_after: Count | None
    distance_error: Number | None  # None: no error bars, or a coarser mesh has other points
    force_error: Number | None
    energy_error: Number | None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Squeeze(RingRecord, name="squeeze of a ring", kind="squeeze", plot="squeeze"):
    """A ring between two points of its plane that are brought together or drawn apart.

    `load` reads what `save` or ``der planar --distance`` has written; shapes as with states.
    """

    goal: Number  # distance at which the path ends
    distance: Column  # (n,) between the points, a
    force: Annotated[Array, along("distance")]  # draws them apart, GJ/a^2; < 0: holds them together
    energy: Annotated[Array, along("distance")]  # GJ/a
    index: tuple[Count | None, ...]  # (n,) unstable modes in the plane, the distance held
    force_error: Annotated[Array, gaps("distance")]  # NaN: no error bars, or no such coarser state
    energy_error: Annotated[Array, gaps("distance")]
    points: tuple[SqueezePoint, ...]
    timing: SolveTime = SolveTime(0.0)
    shapes: Shapes | None = in_memory()  # of the states

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_lengths("index", self.index, ("distance",))

    def facts(self) -> list[str]:
        """Between which distances."""
        ends = "-"
        if len(self):
            length = unit(self.scale, "length")
            ends = f"{self.distance[0]:.6g} to {self.distance[-1]:.6g} {length}"
        return [f"distance {ends}", f"{len(self)} states"]

    def __len__(self) -> int:
        return len(self.index)
