"""Forces and couples that open a folded ring; free of kernels.

Energies and works are those of the full ring in GJ/a, lengths in a, forces in GJ/a^2, couples in
GJ/a, angles in radians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from der.records.entries import Checked, Entry, in_memory
from der.records.record import Record, SolveTime, Status
from der.records.units import unit
from der.records.values import (
    NUMERICS,
    Count,
    Estimates,
    Number,
    RingEntry,
    ScaleEntry,
    SectionEntry,
    Text,
    Truth,
    numbers,
    one_of,
    stated,
    table,
)
from der.utils import checks
from der.utils.checks import Array

KINDS = ("force", "couple")
EVENTS = {  # as text
    "pass": "reaches a saddle",
    "fold": "snaps at a fold",
    "branch": "snaps at a branch point",
    "limit": "limit of a dead load",
    "end": "end of the path",
}
ALIKE = 5e-5  # of the least work: pushes that take the same, but for overshooting a branch point


def _edges(name: str, given: Any) -> tuple[int, int]:
    first, second = checks.each(name, given, checks.count)[:2]
    return first, second


def _positions(name: str, given: Any) -> dict[str, int]:
    """Counts by kind of push."""
    return {
        checks.one_of(f"a key of {name}", kind, KINDS): checks.count(f"{name}.{kind}", k)
        for kind, k in checks.json_object(name, given).items()
    }


Positions = Annotated[Mapping[str, int], Entry(_positions)]


@dataclass(frozen=True)
class Instant(Checked):
    """The end of a push: where the ring is released, or snaps away under a dead load."""

    event: Annotated[str, one_of(tuple(EVENTS))]
    push: Number  # by how much the strut has changed its length [a], or the wrench has turned [rad]
    load: Number  # force or couple there
    work: Number  # of the actuator up to there
    energy: Number  # of the ring above the folded one
    index_before: Count | None  # unstable modes before it, in the actuator; None: not known
    index_after: Count | None  # and after; at a pass those of the free ring
    lands: Text  # end state after release: "flat", "folded" or another; "": not released


@dataclass(frozen=True, eq=False)
class Push(Checked):
    """A push at two points of the ring, and its result."""

    kind: Annotated[str, one_of(KINDS)]
    points: Annotated[tuple[float, float], numbers(2)]  # s/L, from the first grip
    edges: Annotated[tuple[int, int], Entry(_edges, dims=(2,))]  # the same as edges of the mesh
    direction: Text  # of the push or the turn, in a word
    axis: Annotated[tuple[float, float, float], numbers(3)]  # in which the second point is pushed,
    # or about which turned, in the basis of the ring at the beginning
    held: Instant  # the push prescribed, and slow
    dead: Instant | None  # the load dead; None: none was found that is too much
    opens: Truth  # whether the slow push ends in another state than the folded one
    opens_dead: Truth  # and the dead load
    peak: Number  # largest force or couple on the way
    falls: Count  # snaps on the way, inside the folded ring's well, at the push as it is
    curve: Annotated[Array, table("push", "load", "energy")]  # (k, 3), above the folded ring
    why: Text = ""  # a sentence where the march ended early


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LeastPush(Record, name="least push", kind="push", plot="opening"):
    """The pushes at a folded ring that were tried, and that of least work."""

    status: Status
    why: Text  # a sentence where there is none
    ring: RingEntry
    section: SectionEntry
    numerics: Annotated[Mapping[str, object], stated("points", points=checks.count, **NUMERICS)]
    scale: ScaleEntry | None = None
    barrier: Number | None  # of the free ring, to open: no slow push takes less
    twisting: Number | None  # in clamped grips that turn freely
    least: Positions  # by kind, position of the slow push of least work
    least_dead: Positions  # and of the dead load of least work up to its limit
    extrapolated: Estimates  # with error bars, value and error by name:
    # "force", "couple": work of the least push; "force dead": of the dead load up to its limit;
    # "force dead load": that load
    pushes: tuple[Push, ...]  # all that were tried
    timing: SolveTime
    shapes: Mapping[str, tuple[Array, Array]] = in_memory(dict)
    # of "force", "couple dead", ...: vertices (N, 3) as it is released or gets away, and the two
    # points (2, 3) where it is pushed

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("least", "least_dead"):
            for kind, k in getattr(self, name).items():
                if k >= len(self.pushes):
                    raise ValueError(f"{name}.{kind} is {k} of {len(self.pushes)} pushes")

    def facts(self) -> list[str]:
        """The least work of any slow push."""
        best, energy = self.best, unit(self.scale, "energy")
        work = (
            "no push opens it"
            if best is None
            else f"work {best.held.work:.6g} {energy} by {best.kind}"
        )
        return [f"{len(self.pushes)} pushes", work]

    @property
    def best(self) -> Push | None:
        """The slow push of least work."""
        found = [self.pushes[k] for k in self.least.values()]
        return min(found, key=lambda one: one.held.work, default=None)


def least_of(pushes: Sequence[Push], kind: str, *, dead: bool) -> int | None:
    """Position of the push of least work.

    Of those that take the same, one without a fall, and that of the smallest load.
    """
    works = {
        k: instant.work
        for k, one in enumerate(pushes)
        if (instant := one.dead if dead else one.held) is not None
        and one.kind == kind
        and (one.opens_dead if dead else one.opens)
    }
    if not works:
        return None
    limit = (1.0 + ALIKE) * min(works.values())
    alike = [k for k, work in works.items() if work <= limit]
    return min(alike, key=lambda k: (pushes[k].falls, pushes[k].peak, k))
