"""The planar states of a ring, and how it is squeezed in its plane; free of kernels.

Energies are those of the full ring in GJ/a, lengths in a, forces in GJ/a^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import ClassVar, Self

from der.records.codec import Entries, OnDisk, seconds, with_nulls
from der.records.configurations import Shapes
from der.utils import checks
from der.utils.checks import Array

STATUSES = ("done", "interrupted", "not converged")
KINDS = ("", "fold", "limit", "branch")
FOLDED = 3  # turns of the folded ring
_COLUMNS = ("distance", "force", "energy")


@dataclass(frozen=True)
class PlanarState:
    """An equilibrium of a ring that stays in its plane, symmetric about the twisting axis."""

    name: str
    turning: int  # turns of the tangent; below 0 inside out
    energy: float  # GJ/a
    energy_error: float | None  # None: no error bars, or a coarser mesh has no such state
    index: int | None  # ways down in the plane; None: not known
    zero_modes: int  # motions in the plane without cost: shift of the material
    force: float  # in the bar at the first grip, its size, GJ/a^2
    packing: float | None  # area inside the outer boundary over that of the flat ring; None: flat
    packing_error: float | None
    residual: float  # GJ/a

    @property
    def stable(self) -> bool:
        """Whether it is a minimum among planar shapes; in space it need not be one."""
        return self.index == 0


@dataclass(frozen=True, eq=False)
class PlanarStates(OnDisk):
    """The planar states of a ring that were found, lowest first.

    `load` reads what `save` or ``der planar --out`` has written. The shapes are in a file of their
    own, ``der.Shapes.load("shapes.npz")``, in the order of the states.
    """

    KIND: ClassVar[str] = "planar"
    ring: Mapping[str, object]
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    states: tuple[PlanarState, ...]
    status: str = "done"
    message: str = ""
    solve_s: float = 0.0
    shapes: Shapes | None = field(default=None, repr=False)  # of the states; not in the JSON

    def __post_init__(self) -> None:
        checks.one_of("status", self.status, STATUSES)

    def __repr__(self) -> str:
        return f"PlanarStates({self.ring.get('shape')}, {len(self)} states, {self.status})"

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

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        return {
            "status": self.status,
            "message": self.message,
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "states": [asdict(state) for state in self.states],
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """The states as they are written: without the shapes."""
        return cls(
            entries.mapping("ring"),
            entries.mapping("section"),
            entries.mapping("numerics"),
            entries.each("states", _state),
            entries.text("status"),
            entries.text("message"),
            seconds(entries),
        )


@dataclass(frozen=True)
class SqueezePoint:
    """A special point on the path: a fold of the distance, a limit of the force, a branch point."""

    kind: str
    distance: float
    force: float
    energy: float
    index_before: int | None
    index_after: int | None
    distance_error: float | None  # None: no error bars, or a coarser mesh has other points
    force_error: float | None
    energy_error: float | None


@dataclass(frozen=True, eq=False)
class Squeeze(OnDisk):
    """A ring between two points of its plane that are brought together or drawn apart.

    `load` reads what `save` or ``der planar --distance`` has written; shapes as with states.
    """

    KIND: ClassVar[str] = "squeeze"
    ring: Mapping[str, object]
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    distance: Array  # (n,) between the points, a
    force: Array  # (n,) that draws them apart, GJ/a^2; < 0: that holds them together
    energy: Array  # (n,) GJ/a
    index: tuple[int | None, ...]  # (n,) ways down in the plane, the distance held
    force_error: Array  # (n,) NaN: no error bars, or a coarser mesh has no such state
    energy_error: Array
    points: tuple[SqueezePoint, ...]
    goal: float  # distance at which the path ends
    status: str = "done"
    message: str = ""
    solve_s: float = 0.0
    shapes: Shapes | None = field(default=None, repr=False)  # of the states; not in the JSON

    def __post_init__(self) -> None:
        checks.one_of("status", self.status, STATUSES)
        for name in (*_COLUMNS, "force_error", "energy_error"):
            if len(getattr(self, name)) != len(self.index):
                raise ValueError(f"{name} must have a value for each of {len(self.index)} states")

    def __repr__(self) -> str:
        ends = f"distance {self.distance[0]:.6g} to {self.distance[-1]:.6g}" if len(self) else "-"
        return f"Squeeze({self.ring.get('shape')}, {ends}, {len(self)} states, {self.status})"

    def __len__(self) -> int:
        return len(self.index)

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        return {
            "status": self.status,
            "message": self.message,
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "goal": self.goal,
            **{name: getattr(self, name).tolist() for name in _COLUMNS},
            "index": list(self.index),
            "force_error": with_nulls(self.force_error),
            "energy_error": with_nulls(self.energy_error),
            "points": [asdict(point) for point in self.points],
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """The path as it is written: without the shapes."""
        whole = checks.optional(checks.count)
        return cls(
            entries.mapping("ring"),
            entries.mapping("section"),
            entries.mapping("numerics"),
            _finite(entries, "distance"),
            _finite(entries, "force"),
            _finite(entries, "energy"),
            tuple(entries.take("index", lambda at, v: checks.each(at, v, whole))),
            entries.array("force_error", "n"),
            entries.array("energy_error", "n"),
            entries.each("points", _point),
            entries.number("goal"),
            entries.text("status"),
            entries.text("message"),
            seconds(entries),
        )


def _state(entries: Entries) -> PlanarState:
    return PlanarState(
        entries.text("name"),
        entries.whole("turning"),
        entries.number("energy"),
        entries.number_or_none("energy_error"),
        entries.count_or_none("index"),
        entries.count("zero_modes"),
        entries.number("force"),
        entries.number_or_none("packing"),
        entries.number_or_none("packing_error"),
        entries.number("residual"),
    )


def _point(entries: Entries) -> SqueezePoint:
    return SqueezePoint(
        entries.take("kind", lambda at, v: checks.one_of(at, v, KINDS)),
        entries.number("distance"),
        entries.number("force"),
        entries.number("energy"),
        entries.count_or_none("index_before"),
        entries.count_or_none("index_after"),
        entries.number_or_none("distance_error"),
        entries.number_or_none("force_error"),
        entries.number_or_none("energy_error"),
    )


def _finite(entries: Entries, name: str) -> Array:
    """A column without gaps."""
    return entries.take(name, lambda at, v: checks.numbers(at, v))
