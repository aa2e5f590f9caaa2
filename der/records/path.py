"""The record of a path of equilibria with its special points.

Free of kernels, and the same for both solvers. The JSON format is a contract (see the README):
every float is written by repr and comes back bit for bit; a number that is not finite is refused
where it enters, by name. Angles in radians, moments in GJ/a, energies of the full ring in GJ/a.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated, Any, ClassVar

import numpy as np

from der.errors import Reason
from der.records.configurations import Shapes
from der.records.entries import Checked, in_memory
from der.records.forces import Forces
from der.records.record import SPARSE, Record, SolveTime, Status
from der.records.values import (
    Column,
    Count,
    Json,
    Number,
    NumericsEntry,
    RingEntry,
    ScaleEntry,
    SectionEntry,
    Text,
    Truth,
    along,
    indices,
    one_of,
)
from der.utils import checks
from der.utils.checks import Array, Counts, optional

SOLVERS = ("der", "bvp")
KINDS = ("fold", "limit", "branch", "snap", "contact")
SNAPPING = ("none", "snap-through", "snap-back")
REASONS = ("", *(reason.word for reason in Reason))
NUMBERS = ("gamma", "moment", "energy")
ARRIVAL = 1e-9  # rad; a path is solved for at pi to 1e-10
NO_MOMENT = 1e-6  # of the largest |M|; the folded ring is planar to the same


@dataclass(frozen=True)
class Point(Checked):
    """A special point of a path; `details` are written flat into its JSON object.

    Raises
    ------
    ValueError
        If the kind is not one of KINDS, a number is not finite or negative where it counts, or a
        detail has the name of another entry.
    """

    kind: Annotated[str, one_of(KINDS)]
    gamma: Number  # rad
    moment: Number  # GJ/a
    energy: Number  # GJ/a
    index_before: Count | None  # None: not known
    index_after: Count | None
    position: Count  # of its state in the path's arrays
    details: Json = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if clash := sorted(set(self.details) & {entry.name for entry in fields(self)}):
            raise ValueError(f"details cannot hold {clash}: the point has such entries")

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries with the details among them."""
        return entries | entries.pop("details")

    @classmethod
    def from_disk(cls, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries with the surplus ones as details."""
        own = {entry.name for entry in fields(cls)} - {"details"}
        known = {name: entries.pop(name) for name in own & set(entries)}
        return known | {"details": entries}


@dataclass(frozen=True)
class AtPi(Checked):
    """The state at the first arrival at gamma = pi; indices are None where not known."""

    moment: Number  # GJ/a
    slope: Number  # dM/dgamma
    energy: Number  # GJ/a
    index: Count | None  # gamma held
    index_moment: Count | None  # moment held
    index_free: Count | None  # grips removed


@dataclass(frozen=True)
class Mode(Checked):
    """How a ring folds: the folding modes of the paper, judged at the first arrival at pi."""

    OPTIONAL: ClassVar[tuple[str, ...]] = ("stable_free",)  # of records before it was there

    foldable: Truth
    stable: Truth | None  # the paper's, by the slope; None: not foldable, or not known
    snapping: Annotated[str, one_of(SNAPPING)]
    stable_3d: Truth | None  # at fixed moment, by the index; None: not known
    stable_free: Truth | None = (
        None  # folded, stays so when released; None: not known, or not folded
    )


@dataclass(frozen=True)
class Timing(SolveTime):
    """What the path cost."""

    newton_iterations: Count
    steps: Count


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Path(Record, name="path", plot="path"):
    """A path of equilibria, the answer of either solver; compare two by their `to_json`.

    `load` reads what `save` or ``der fold --out`` has written. Mappings are of JSON's types: str
    keys; str, bool, int, float, None, lists, mappings.

    Raises
    ------
    ValueError
        If lengths, kinds or types are others, or a number is not finite; the message names it.
    """

    OPTIONAL: ClassVar[tuple[str, ...]] = ("status", "message", "reason", *SPARSE)

    solver: Annotated[str, one_of(SOLVERS)]
    status: Status = "done"  # the states of an incomplete path are good
    message: Text = ""  # a sentence about the status
    reason: Annotated[str, one_of(REASONS)] = ""  # why it ended: `word` of a der.errors.Reason
    ring: RingEntry  # the statement, as in its JSON form
    section: SectionEntry
    numerics: NumericsEntry
    scale: ScaleEntry | None = None  # None: not dimensional
    gamma: Column  # (n,) rad, in path order; with error bars the extrapolated values
    moment: Annotated[Array, along("gamma")]  # GJ/a, of one arm
    energy: Annotated[Array, along("gamma")]  # GJ/a, of the full ring
    index: Annotated[Counts, indices("gamma")]  # negative eigenvalues with gamma held
    index_moment: Annotated[Counts, indices("gamma")]  # the same with the moment held
    points: tuple[Point, ...]  # special points
    at_pi: AtPi | None  # None where the path never reached pi; so for the mode
    mode: Mode | None  # see `folding_mode`
    error: Json | None  # None, or gamma, moment, energy: n numbers or None; and how
    raw: Json | None = None  # with error bars: values at the finest N, by name
    forces: Forces | None = None  # of grips and arms, where they were asked for
    timing: Timing
    shapes: Shapes | None = in_memory()

    def __post_init__(self) -> None:
        super().__post_init__()
        known = {}
        if self.error is not None:
            for name in NUMBERS:
                bars = self.error.get(name)
                known[f"error.{name}"] = checks.each(
                    f"error.{name}", bars, optional(checks.checked_number)
                )
        if self.forces is not None:
            for one in fields(Forces):
                known[f"forces.{one.name}"] = list(getattr(self.forces, one.name))
        if self.shapes is not None:
            known["shapes"] = list(self.shapes.x)
        for name, values in known.items():
            self._check_lengths(name, values, ("gamma",))
        for i, point in enumerate(self.points):
            if point.position >= len(self):
                raise ValueError(f"points[{i}].position is {point.position} of {len(self)} states")

    def __len__(self) -> int:
        return len(self.gamma)

    def facts(self) -> list[str]:
        """How the ring folds, and how far the path goes."""
        top = f"gamma to {self.gamma.max():.6g}" if len(self) else "no gamma"
        mode = []
        if self.mode is not None:
            mode = ["foldable" if self.mode.foldable else "not foldable", self.mode.snapping]
        return [
            self.solver,
            top,
            *mode,
            f"{len(self)} states",
            f"{len(self.points)} special points",
        ]

    @property
    def folds(self) -> tuple[Point, ...]:
        """Points where gamma turns back."""
        return self._of_kind("fold")

    @property
    def limits(self) -> tuple[Point, ...]:
        """Points where the moment turns back."""
        return self._of_kind("limit")

    @property
    def branches(self) -> tuple[Point, ...]:
        """Points where another path crosses."""
        return self._of_kind("branch")

    @property
    def contacts(self) -> tuple[Point, ...]:
        """Points where the ideal ring passes through itself."""
        return self._of_kind("contact")

    def _of_kind(self, kind: str) -> tuple[Point, ...]:
        return tuple(point for point in self.points if point.kind == kind)


def folding_mode(
    gamma: Array, moment: Array, points: Sequence[Point], at_pi: AtPi, *, three_covered: bool
) -> Mode:
    """Folding mode of a path that starts at gamma = 0.

    Parameters
    ----------
    gamma, moment : (n,) arrays
        The path, which may go on beyond pi.
    points : sequence of Point
        Its special points; limits decide whether M is monotonic, since they are solved for and
        differences between noisy neighbours are not.
    at_pi : AtPi
        The state at the first arrival at pi.
    three_covered : bool
        Whether that state is the planar three-covered one.

    Raises
    ------
    ValueError
        If gamma never reaches pi.
    """
    arrived = np.flatnonzero(np.asarray(gamma) >= np.pi - ARRIVAL)
    if not arrived.size:
        raise ValueError(f"gamma never reaches pi, only {np.max(gamma, initial=0.0)!r}")
    kinds = {point.kind for point in points if point.position <= arrived[0]}
    foldable = three_covered and abs(at_pi.moment) <= NO_MOMENT * float(np.abs(moment).max())
    if kinds & {"fold", "snap"}:  # dynamic relaxation sees the snap, and no fold
        snapping = "snap-back"
    elif "limit" in kinds:
        snapping = "snap-through"
    else:
        snapping = "none"
    return Mode(
        foldable=foldable,
        stable=at_pi.slope > 0.0 if foldable else None,
        snapping=snapping,
        stable_3d=None if at_pi.index_moment is None else at_pi.index_moment == 0,
        stable_free=at_pi.index_free == 0 if foldable and at_pi.index_free is not None else None,
    )


@cache
def release() -> str:
    """The version of the package, looked up once, because that reads a file."""
    try:
        return version("ring-origami")
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "unknown"


def counts(values: Iterable[int | None]) -> Counts:
    """Masked integer array of counts, of which None is not known."""
    return checks.counts("counts", list(values))
