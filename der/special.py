"""What is special on a step of a path, and the states that were asked for.

fold     dgamma/ds = 0: the null vector has a component along d(grad)/dgamma
limit    dM/ds = 0
branch   the index of a symmetry class changes away from folds
contact  the linking number changes: a strand passes through another
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from der.equilibrium import Equilibrium
from der.rod import strains
from der.sector import Sector
from der.stability import index, raw_index
from der.step import ROOT, Step, root

_CONTACT = 1e-5  # of s, for the passage of a strand
_FLANK = 1e-3  # of a step: how far from a fold its two sides are looked at


@dataclass(frozen=True)
class Visit:
    """A state on the path, as it is handed out."""

    at: Equilibrium
    kind: str = ""  # "", "fold", "limit", "branch" or "contact"
    index: tuple[int | None, ...] | None = None  # by class, multiplicities not yet applied
    link: int | None = None
    details: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Wanted:
    """What the follower has to look for, and where it stops."""

    load_max: float = math.pi
    until_folded: bool = False
    targets: tuple[float, ...] | None = None  # loads at which to solve; None: multiples of pi/8
    stability: bool = True
    contacts: bool = True
    tolerance: float = 1e-10
    most_steps: int = 2000


def visit(piece: Sector, wanted: Wanted, at: Equilibrium, **extra: object) -> Visit:
    """A visit with what is wanted of a regular state."""
    known = None
    if wanted.stability:
        known = tuple(
            index(piece.body, piece.held, modes, at.state) for _, modes in piece.classes.values()
        )
    return Visit(at, index=known, **extra)  # type: ignore[arg-type]


@dataclass(frozen=True)
class _Mark:
    """A visit and its place within a step."""

    s: float
    visit: Visit
    shown: bool = True


def special_points(
    piece: Sector, wanted: Wanted, step: Step, here: Visit
) -> tuple[list[Visit], bool]:
    """Visits after ``here`` up to the end of ``step``, and whether the path ends there."""
    folds = _folds(step)
    marks, ended = _at_targets(piece, wanted, step, folds)
    if not ended:
        marks.append(_Mark(step.length, visit(piece, wanted, step.end)))
    end = marks[-1].s
    marks += [_Mark(s, Visit(at, "fold")) for s, at in folds if s < end]
    line = sorted([_Mark(0.0, here), *marks], key=lambda m: m.s)
    line += _limits(step, line)
    line.sort(key=lambda m: m.s)
    if wanted.stability:
        line = _index_changes(piece, wanted, step, line)
    if wanted.contacts:
        line = _passages(piece, wanted, step, line, ended)
    return [m.visit for m in line[1:] if m.shown], ended


def _folds(step: Step) -> list[tuple[float, Equilibrium]]:
    """Folds of the load within a step, also a pair of them between tangents of equal sign."""
    a, b = step.start.tangent.load, step.end_rate.load
    cuts = [0.0, step.length]
    if a * b > 0.0:
        # the cubic load(s) has its slowest point inside: look there before trusting the signs
        c3 = a + b - 2.0 * step.jump.load / step.length
        c2 = 3.0 * step.jump.load / step.length - 2.0 * a - b
        u = -c2 / (3.0 * c3) if c3 != 0.0 else -1.0
        if 0.0 < u < 1.0 and (a + 2.0 * c2 * u + 3.0 * c3 * u * u) * a < 0.1 * a * a:
            cuts.insert(1, u * step.length)
    rates = [step.at(s).tangent.load for s in cuts]
    found = []
    for (s0, r0), (s1, r1) in pairwise(zip(cuts, rates, strict=True)):
        if r0 * r1 < 0.0:
            s = root(lambda t: step.at(t).tangent.load, s0, s1)
            found.append((s, step.at(s)))
    return found


def _at_targets(
    piece: Sector, wanted: Wanted, step: Step, folds: list[tuple[float, Equilibrium]]
) -> tuple[list[_Mark], bool]:
    """States at the wanted loads, in order, up to the end of the path if it lies in this step."""
    cuts = [(0.0, step.start), *folds, (step.length, step.end)]
    marks: list[_Mark] = []
    for (s0, a), (s1, b) in pairwise(cuts):
        low, high = a.state.load, b.state.load
        loads = set(_between_loads(wanted, low, high))
        for load in sorted(loads, reverse=high < low):
            if load == low:
                continue
            s, at = (s1, b) if load == high else step.at_load(load, s0, s1)
            marks.append(_Mark(s, visit(piece, wanted, at)))
            if load == wanted.load_max:
                return marks, True
            if wanted.until_folded and load == math.pi and three_covered(piece, at):
                return marks, True
    return [m for m in marks if m.s < step.length], False


def _between_loads(wanted: Wanted, low: float, high: float) -> Iterator[float]:
    """Loads to solve for between two values, the end of the path among them."""
    low, high = min(low, high), max(low, high)
    targets = wanted.targets
    if targets is None:
        eighth = math.pi / 8.0
        first, last = math.floor(low / eighth), math.ceil(high / eighth)
        targets = tuple(k * eighth for k in range(first, last + 1))
    for load in (*targets, math.pi, wanted.load_max):
        if low <= load <= high:
            yield load


def three_covered(piece: Sector, at: Equilibrium) -> bool:
    """Whether a state is the planar ring that covers itself three times, to 1e-6."""
    x, _ = piece.shape(at.state)
    kappa, _ = strains(piece.body, at.state)
    turning = piece.copies * float(kappa[:, 0].sum())
    return float(np.ptp(x[:, 0])) < 1e-6 and abs(turning - 6.0 * math.pi) < 1e-6


def _limits(step: Step, line: list[_Mark]) -> list[_Mark]:
    """Limits of the moment between the marks of a line."""
    found = []
    for a, b in pairwise(line):
        if a.visit.at.moment_rate * b.visit.at.moment_rate < 0.0:
            s = root(lambda t: step.at(t).moment_rate, a.s, b.s)
            found.append(_Mark(s, Visit(step.at(s), "limit")))
    return found


def _index_changes(piece: Sector, wanted: Wanted, step: Step, line: list[_Mark]) -> list[_Mark]:
    """The line with branch points put in, and with the index of limits filled in."""
    line = [
        replace(m, visit=visit(piece, wanted, m.visit.at, kind="limit"))
        if m.visit.kind == "limit"
        else m
        for m in line
    ]
    # a fold explains one change of the first class: look at its flanks, and then between them
    flank = _FLANK * step.length
    known: list[_Mark] = []
    for m in line:
        if m.visit.kind == "fold":
            known += [
                _Mark(s, visit(piece, wanted, step.at(s)), shown=False)
                for s in (m.s - flank, m.s + flank)
                if 0.0 < s < line[-1].s
            ]
        else:
            known.append(m)
    known = [m for m in known if m.visit.index is not None and None not in m.visit.index]
    known.sort(key=lambda m: m.s)
    folds = [m.s for m in line if m.visit.kind == "fold"]
    found = []
    for a, b in pairwise(known):
        if any(a.s < s < b.s for s in folds):
            continue
        for c, (before, after) in enumerate(
            zip(a.visit.index or (), b.visit.index or (), strict=True)
        ):
            found += _branches(piece, step, c, (a.s, before), (b.s, after))
    return sorted([*line, *(m for m in known if not m.shown), *found], key=lambda m: m.s)


def _branches(
    piece: Sector,
    step: Step,
    c: int,
    low: tuple[float, int | None],
    high: tuple[float, int | None],
) -> list[_Mark]:
    """Where the index of class ``c`` changes between two places, by bisection."""
    label, (_, modes) = list(piece.classes.items())[c]
    if low[1] == high[1]:
        return []
    if high[0] - low[0] < 2.0 * ROOT:
        return [_Mark(low[0], Visit(step.at(low[0]), "branch", details={"symmetry": label}))]
    s = 0.5 * (low[0] + high[0])
    middle = (s, raw_index(piece.body, piece.held, modes, step.at(s).state))
    return [
        *_branches(piece, step, c, low, middle),
        *_branches(piece, step, c, middle, high),
    ]


def _passages(
    piece: Sector, wanted: Wanted, step: Step, line: list[_Mark], ended: bool
) -> list[_Mark]:
    """The line with the link of its ends filled in and contacts put where it changes."""
    last = line[-1]
    if ended and three_covered(piece, last.visit.at):
        return line  # the strands lie in each other: no link is defined
    if line[0].visit.link is None:
        line[0] = replace(line[0], visit=replace(line[0].visit, link=piece.link(step.start.state)))
    end = replace(last, visit=replace(last.visit, link=piece.link(last.visit.at.state)))
    found = _contacts(piece, wanted, step, (line[0].s, line[0].visit.link), (end.s, end.visit.link))
    return sorted([*line[:-1], end, *found], key=lambda m: m.s)


def _contacts(
    piece: Sector,
    wanted: Wanted,
    step: Step,
    low: tuple[float, int | None],
    high: tuple[float, int | None],
) -> list[_Mark]:
    """Where the link changes between two places, by bisection."""
    if low[1] == high[1]:
        return []
    if high[0] - low[0] < _CONTACT:
        change = {"linking_before": low[1], "linking_after": high[1]}
        at = step.at(low[0])
        found = visit(piece, wanted, at, kind="contact", link=high[1], details=change)
        return [_Mark(low[0], found)]
    s = 0.5 * (low[0] + high[0])
    middle = (s, piece.link(step.at(s).state))
    return [
        *_contacts(piece, wanted, step, low, middle),
        *_contacts(piece, wanted, step, middle, high),
    ]
