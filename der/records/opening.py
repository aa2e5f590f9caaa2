"""What it takes to push a folded ring open, on disk as JSON; free of kernels.

Energies and works are those of the full ring in GJ/a, lengths in a, forces in GJ/a^2, couples in
GJ/a, angles in radians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from der.records.codec import Entries, OnDisk, errors_of, seconds, with_errors
from der.utils import checks
from der.utils.checks import Array, optional

KINDS = ("force", "couple")
EVENTS = ("pass", "fold", "branch", "limit", "end")
_CURVE = ("push", "load", "energy")
ALIKE = 5e-5  # of the least work: pushes that take the same, but for overshooting a branch point


@dataclass(frozen=True)
class Instant:
    """When a push has done its work: where the ring is let go, or where a dead load gets away."""

    event: str  # "pass", "fold", "branch", "limit" or "end"
    push: float  # by how much the strut has changed its length [a], or the wrench has turned [rad]
    load: float  # force or couple there
    work: float  # of the tool up to there
    energy: float  # of the ring above the folded one
    index_before: int | None  # ways down before it, in the tool; None: not known
    index_after: int | None  # and after; at a pass those of the ring let go
    lands: str  # "flat", "folded" or another rest, once it is let go; "" where it is not

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """An instant as it is written."""
        return cls(
            entries.take("event", lambda at, v: checks.one_of(at, v, EVENTS)),
            entries.number("push"),
            entries.number("load"),
            entries.number("work"),
            entries.number("energy"),
            entries.count_or_none("index_before"),
            entries.count_or_none("index_after"),
            entries.text("lands"),
        )


@dataclass(frozen=True, eq=False)
class Push:
    """One way of pushing, and what it comes to."""

    kind: str  # one of KINDS
    points: tuple[float, float]  # s/L, from the first grip
    edges: tuple[int, int]  # the same as edges of the mesh
    direction: str  # of the push or the turn, in a word
    axis: tuple[float, float, float]  # in which the second point is pushed, or about which turned,
    # in the basis of the ring at the beginning
    held: Instant  # the push prescribed, and slow
    dead: Instant | None  # the load dead; None: none was found that is too much
    opens: bool  # whether the slow push ends in another state than the folded one
    opens_dead: bool  # and the dead load
    peak: float  # largest force or couple on the way
    falls: int  # on the way, inside the folded ring's well, at the push as it is
    curve: Array  # (k, 3) push, force or couple, energy above the folded ring
    why: str = ""  # a sentence where the march ended early

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """A push as it is written."""
        first, second = entries.take("points", lambda at, v: checks.checked_array(at, v, (2,)))
        edges = entries.take("edges", lambda at, v: checks.each(at, v, checks.count))
        if len(edges) != 2:
            raise ValueError(f"edges of a push must be two, got {edges}")
        axis = entries.take("axis", lambda at, v: checks.checked_array(at, v, (3,)))
        held, curve = entries.inside("held"), entries.inside("curve")
        dead = entries.take("dead", optional(Entries))
        columns = [curve.array(name, "n") for name in _CURVE]
        if len({len(column) for column in columns}) != 1:
            raise ValueError("curve must have as many values of every column")
        found = cls(
            entries.take("kind", lambda at, v: checks.one_of(at, v, KINDS)),
            (float(first), float(second)),
            (edges[0], edges[1]),
            entries.text("direction"),
            (float(axis[0]), float(axis[1]), float(axis[2])),
            Instant.of_entries(held),
            None if dead is None else Instant.of_entries(dead),
            entries.truth("opens"),
            entries.truth("opens_dead"),
            entries.number("peak"),
            entries.count("falls"),
            np.column_stack(columns),
            entries.text("why"),
        )
        for part in (held, curve, *((dead,) if dead is not None else ())):
            part.end()
        return found


@dataclass(frozen=True, eq=False)
class LeastPush(OnDisk):
    """The ways of pushing a folded ring open that were tried, and the one of least work."""

    KIND: ClassVar[str] = "push"
    ring: Mapping[str, object]
    section: Mapping[str, object]
    numerics: Mapping[str, object]
    barrier: float | None  # of the ring left alone, to open: no slow push takes less
    twisting: float | None  # in clamped grips that turn freely
    pushes: tuple[Push, ...]  # all that were tried
    least: Mapping[str, int]  # by kind, position of the slow push of least work
    least_dead: Mapping[str, int]  # and of the dead load of least work up to its limit
    extrapolated: Mapping[str, tuple[float, float]]  # with error bars, value and error by name:
    # "force", "couple": work of the least push; "force dead": of the dead load up to its limit;
    # "force dead load": that load
    why: str  # a sentence where there is none
    status: str  # "done", "interrupted" or "not converged"
    solve_s: float
    shapes: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    # of "force", "couple dead", ...: vertices (N, 3) as it is let go or gets away, and the two
    # points (2, 3) where it is pushed; not in the JSON

    @property
    def best(self) -> Push | None:
        """The slow push of least work."""
        found = [self.pushes[k] for k in self.least.values()]
        return min(found, key=lambda one: one.held.work, default=None)

    def entries(self) -> dict[str, object]:
        """What is written, by name."""
        return {
            "status": self.status,
            "why": self.why,
            "ring": self.ring,
            "section": self.section,
            "numerics": self.numerics,
            "barrier": self.barrier,
            "twisting": self.twisting,
            "least": dict(self.least),
            "least_dead": dict(self.least_dead),
            "extrapolated": with_errors(self.extrapolated),
            "pushes": [_entries(one) for one in self.pushes],
            "timing": {"solve_s": self.solve_s},
        }

    @classmethod
    def of_entries(cls, entries: Entries) -> Self:
        """The pushes as they are written: without the shapes."""
        status, why = entries.text("status"), entries.text("why")
        pushes = entries.each("pushes", Push.of_entries)
        return cls(
            entries.mapping("ring"),
            entries.mapping("section"),
            entries.mapping("numerics"),
            entries.number_or_none("barrier"),
            entries.number_or_none("twisting"),
            pushes,
            entries.take("least", lambda at, v: _positions(at, v, len(pushes))),
            entries.take("least_dead", lambda at, v: _positions(at, v, len(pushes))),
            entries.take("extrapolated", errors_of),
            why,
            status,
            seconds(entries),
        )


def _positions(name: str, given: Any, pushes: int) -> dict[str, int]:
    found = {
        checks.one_of(f"a key of {name}", kind, KINDS): checks.count(f"{name}.{kind}", k)
        for kind, k in checks.json_object(name, given).items()
    }
    for kind, k in found.items():
        if k >= pushes:
            raise ValueError(f"{name}.{kind} is {k} of {pushes} pushes")
    return found


def _entries(one: Push) -> dict[str, object]:
    entries = {**vars(one), "held": vars(one.held)}
    entries["dead"] = None if one.dead is None else vars(one.dead)
    entries["curve"] = dict(zip(_CURVE, np.asarray(one.curve).T.tolist(), strict=True))
    return entries


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
