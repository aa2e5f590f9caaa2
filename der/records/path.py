"""The record: a path of equilibria with its special points, on disk and back.

Free of kernels, and the same for both solvers. The JSON format is a contract (see the README):
every float is written by repr and comes back bit for bit; a number that is not finite is refused
where it enters, by name. Angles in radians, moments in GJ/a, energies of the full ring in GJ/a.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Self

import numpy as np

from der.errors import Reason
from der.records.configurations import Shapes
from der.utils import checks
from der.utils.checks import Array, Counts, optional
from der.utils.files import Kept, json_entries, json_lines

SCHEMA = 1
SOLVERS = ("der", "bvp")
KINDS = ("fold", "limit", "branch", "snap", "contact")
SNAPPING = ("none", "snap-through", "snap-back")
REASONS = ("", *(reason.word for reason in Reason))
STATUSES = ("done", "not converged", "interrupted")
ARRAYS = ("gamma", "moment", "energy", "index", "index_moment")
ARRIVAL = 1e-9  # rad; a path is solved for at pi to 1e-10
NO_MOMENT = 1e-6  # of the largest |M|; the folded ring is planar to the same


@dataclass(frozen=True)
class Point:
    """A special point of a path; `details` are written flat into its JSON object.

    Raises
    ------
    ValueError
        If the kind is not one of KINDS, a number is not finite or negative where it counts, or a
        detail has the name of another entry.
    """

    kind: str
    gamma: float  # rad
    moment: float  # GJ/a
    energy: float  # GJ/a
    index_before: int | None  # None: not known
    index_after: int | None
    position: int  # of its state in the path's arrays
    details: Mapping[str, object] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        checks.one_of("kind", self.kind, KINDS)
        _check(self, checks.checked_number, "gamma", "moment", "energy")
        _check(self, optional(checks.count), "index_before", "index_after")
        _check(self, checks.count, "position")
        _check(self, checks.json_object, "details")
        if clash := sorted(set(self.details) & {entry.name for entry in fields(self)}):
            raise ValueError(f"details cannot hold {clash}: the point has such entries")


@dataclass(frozen=True)
class AtPi:
    """The state at the first arrival at gamma = pi; indices are None where not known."""

    moment: float  # GJ/a
    slope: float  # dM/dgamma
    energy: float  # GJ/a
    index: int | None  # gamma held
    index_moment: int | None  # moment held
    index_free: int | None  # grips removed

    def __post_init__(self) -> None:
        _check(self, checks.checked_number, "moment", "slope", "energy")
        _check(self, optional(checks.count), "index", "index_moment", "index_free")


@dataclass(frozen=True)
class Mode:
    """How a ring folds: the folding modes of the paper, judged at the first arrival at pi."""

    foldable: bool
    stable: bool | None  # None: not foldable
    snapping: str  # one of SNAPPING
    stable_3d: bool | None  # None: not known

    def __post_init__(self) -> None:
        checks.one_of("snapping", self.snapping, SNAPPING)
        _check(self, checks.truth, "foldable")
        _check(self, optional(checks.truth), "stable", "stable_3d")


@dataclass(frozen=True)
class Timing:
    """What the path cost."""

    solve_s: float
    newton_iterations: int
    steps: int

    def __post_init__(self) -> None:
        _check(self, checks.checked_number, "solve_s")
        _check(self, checks.count, "newton_iterations", "steps")


@dataclass(frozen=True, eq=False)
class Path(Kept):
    """A path of equilibria, the answer of either solver; compare two by their `to_json`.

    Mappings are of JSON's types: str keys; str, bool, int, float, None, lists, mappings.

    Raises
    ------
    ValueError
        If lengths, kinds or types are others, or a number is not finite; the message names it.
    """

    solver: str  # one of SOLVERS
    ring: Mapping[str, object]  # the statement, as in its JSON form
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    gamma: Array  # (n,) rad, in path order; with error bars the extrapolated values
    moment: Array  # (n,) GJ/a, of one arm
    energy: Array  # (n,) GJ/a, of the full ring
    index: Counts  # (n,) negative eigenvalues with gamma held; masked where not known
    index_moment: Counts  # (n,) the same with the moment held
    points: tuple[Point, ...]  # special points
    at_pi: AtPi | None  # None where the path never reached pi; so for the mode
    mode: Mode | None  # see `folding_mode`
    error: Mapping[str, object] | None  # None, or gamma, moment, energy: n numbers or None; and how
    timing: Timing
    shapes: Shapes | None = None  # not in the JSON
    status: str = "done"  # one of STATUSES; what there is of an incomplete path is good
    message: str = ""  # a sentence about the status
    reason: str = ""  # why it ended: the `word` of a der.errors.Reason; "" where it is just done
    raw: Mapping[str, object] | None = None  # with error bars: values at the finest N, by name

    def __post_init__(self) -> None:
        checks.one_of("solver", self.solver, SOLVERS)
        checks.one_of("status", self.status, STATUSES)
        _check(self, checks.text, "message")
        checks.one_of("reason", self.reason, REASONS)
        _check(self, checks.json_object, "ring", "section", "numerics")
        _check(self, optional(checks.json_object), "error", "raw")
        _check(self, checks.numbers, "gamma", "moment", "energy")
        _check(self, checks.counts, "index", "index_moment")
        object.__setattr__(self, "points", tuple(self.points))
        self._check_lengths()

    def _check_lengths(self) -> None:
        """Refuse what is not one entry a state, or points at a state that is not there."""
        entries = {name: getattr(self, name) for name in ARRAYS}
        if self.error is not None:
            for name in ("gamma", "moment", "energy"):
                where = f"error.{name}"
                bars = checks.each(where, self.error.get(name), optional(checks.checked_number))
                entries[where] = bars
        if self.shapes is not None:
            entries["shapes"] = self.shapes.x
        for name, values in entries.items():
            if len(values) != len(self):
                raise ValueError(f"{name} has {len(values)} entries, gamma has {len(self)}")
        for i, point in enumerate(self.points):
            if point.position >= len(self):
                raise ValueError(f"points[{i}].position is {point.position} of {len(self)} states")

    def __len__(self) -> int:
        return len(self.gamma)

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

    def interrupted(self) -> Path:
        """The same path as one that the user stopped."""
        why = Reason.INTERRUPTED
        return replace(self, status="interrupted", message=why.value, reason=why.word)

    def to_json(self) -> str:
        """JSON text of schema 1, one entry a line."""
        entries: dict[str, object] = {"schema": SCHEMA, "solver": self.solver}
        for name in ("status", "message", "reason", "ring", "section", "numerics"):
            entries[name] = getattr(self, name)
        for name in ARRAYS:
            entries[name] = getattr(self, name).tolist()  # masked becomes None
        entries["points"] = [flat_point(point) for point in self.points]
        entries["at_pi"] = None if self.at_pi is None else vars(self.at_pi)
        entries["mode"] = None if self.mode is None else vars(self.mode)
        entries["error"] = self.error
        if self.raw is not None:
            entries["raw"] = self.raw
        entries["timing"] = vars(self.timing)
        return json_lines(entries)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Path of a JSON text.

        Raises
        ------
        ValueError
            If it is not JSON, of another schema, or not such a record; the message says where.
        """
        entries = json_entries(text)
        if "kind" in entries:  # of landscapes and states
            raise ValueError(f"not a path but a record of kind {checks.shown(entries['kind'])}")
        if (schema := entries.pop("schema", None)) != SCHEMA:
            raise ValueError(f"schema is {schema!r}, this version reads {SCHEMA}")
        if not isinstance(entries.get("points"), list):
            raise ValueError("points is missing or not a list")
        points = enumerate(entries["points"])
        entries["points"] = [point_of(f"points[{i}]", point) for i, point in points]
        for name, kind in (("at_pi", AtPi), ("mode", Mode)):
            if entries.get(name) is not None:
                entries[name] = built(kind, name, entries[name])
        entries["timing"] = built(Timing, "timing", entries.get("timing"))
        if "shapes" in entries:
            raise ValueError("shapes have no place in the JSON")
        path: Self = built(cls, "record", entries)
        return path


def folding_mode(
    gamma: Array,
    moment: Array,
    points: Sequence[Point],
    at_pi: AtPi,
    *,
    three_covered: bool,
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
    if kinds & {"fold", "snap"}:  # by dynamic relaxation alone a snap is seen, and no fold
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
    )


@cache
def release() -> str:
    """The package's version: looking it up reads a file."""
    try:
        return version("ring-origami")
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "unknown"


def counts(values: Iterable[int | None]) -> Counts:
    """Masked integer array of counts, of which None is not known."""
    return checks.counts("counts", list(values))


def _check(record: object, check: Callable[[str, Any], object], *names: str) -> None:
    """Replace entries of a frozen record by their checked values."""
    for name in names:
        object.__setattr__(record, name, check(name, getattr(record, name)))


def flat_point(point: Point) -> dict[str, object]:
    """A special point as it is written, its details among its entries."""
    entries = dict(vars(point))
    return entries | entries.pop("details")


def point_of(where: str, entries: Any) -> Point:
    """Point of its JSON object, whose surplus entries are the details."""
    if not isinstance(entries, dict):
        raise ValueError(f"{where} is {entries!r}, not an object")
    own = {entry.name for entry in fields(Point)} - {"details"}
    known = {name: value for name, value in entries.items() if name in own}
    details = {name: value for name, value in entries.items() if name not in own}
    point: Point = built(Point, where, known | {"details": details})
    return point


def built(kind: Callable[..., Any], where: str, entries: Any) -> Any:
    """Record of a JSON object; a missing, surplus or wrong entry is refused with its place."""
    if not isinstance(entries, dict):
        raise ValueError(f"{where} is {entries!r}, not an object")
    try:
        return kind(**entries)
    except (TypeError, ValueError) as problem:  # TypeError: "... missing 1 required ...: 'solver'"
        raise ValueError(f"{where}: {' '.join(str(problem).split())}") from problem
