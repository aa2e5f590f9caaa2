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
from der.stability import index_and_stiffness, raw_index
from der.step import ROOT, Step

EIGHTH = math.pi / 8.0  # states are solved for at its multiples where nothing else was asked
_CONTACT = 1e-4  # of s, for the passage of a strand: an ideal ring asks for no more
_BRIEF = 1e-3  # of s, between a passage and its reversal
_TURN = 1e-4  # of a step: between a fold and the places where dgamma/ds has its two signs
_FLANK = 1e-3  # of a step: how far from a fold its two sides are looked at
# of the softest torsion of a ring, GJ (2 pi/L)^2: within a step a mode's stiffness was seen to
# bulge by 0.002 of it at the median and by 0.06 in one of a hundred
_SOFT = 0.1
_NEARLY = 0.25  # of the softer end: a parabola that comes so close to zero is looked at


Indices = tuple[int | None, ...]  # by symmetry class, multiplicities not yet applied


@dataclass(frozen=True)
class Visit:
    """A state on the path, as it is handed out."""

    at: Equilibrium
    kind: str = ""  # "", "fold", "limit", "branch" or "contact"
    index: Indices | None = None
    stiffness: tuple[float, ...] = ()  # of the softest mode of each class, where index is known
    sides: tuple[Indices, Indices] | None = None  # index before and after a singular state
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
    if not wanted.stability:
        return Visit(at, **extra)  # type: ignore[arg-type]
    known, stiffness = zip(
        *(
            index_and_stiffness(piece.body, piece.held, modes, at.state)
            for _, modes in piece.classes.values()
        ),
        strict=True,
    )
    return Visit(at, index=known, stiffness=stiffness, **extra)  # type: ignore[arg-type]


def full_index(piece: Sector, index: Indices | None) -> int | None:
    """Index of the full ring: the sum over the classes, pairs counted twice."""
    if index is None:
        return None
    total = 0
    for (multiplicity, _), count in zip(piece.classes.values(), index, strict=True):
        if count is None:
            return None
        total += multiplicity * count
    return total


@dataclass(frozen=True)
class _Mark:
    """A visit and its place within a step."""

    s: float
    visit: Visit


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
    if wanted.contacts:
        line = _passages(piece, wanted, step, line, ended)
    if wanted.stability:  # the index at contacts is a sample, too
        line = _index_changes(piece, wanted, step, line)
    return [m.visit for m in line[1:]], ended


def _folds(step: Step) -> list[tuple[float, Equilibrium]]:
    """Folds of the load within a step, also a pair of them between tangents of equal sign."""
    rates = (step.start.tangent.load, step.end_rate.load)
    cuts = [0.0, *_slowest(step.length, step.jump.load, *rates), step.length]
    places = [(s, step.at(s)) for s in cuts]
    return [
        step.change(lambda at: at.tangent.load, low, high)
        for low, high in pairwise(places)
        if low[1].tangent.load * high[1].tangent.load < 0.0
    ]


def _slowest(length: float, jump: float, first: float, last: float) -> list[float]:
    """Where a cubic's rate is smallest between two equal signs, if it may change sign there.

    Two turns that lie close together show at the ends of an interval only by this.
    """
    if first * last <= 0.0 or length <= 0.0:  # two marks in one place
        return []
    c2 = 3.0 * jump / length - 2.0 * first - last
    c3 = first + last - 2.0 * jump / length
    u = -c2 / (3.0 * c3) if c3 != 0.0 else -1.0
    if not 0.0 < u < 1.0:
        return []
    rate = first + (2.0 * c2 + 3.0 * c3 * u) * u
    return [u * length] if rate * first < 0.1 * first * first else []


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
            if abs(load) == wanted.load_max:  # also of a path that has turned back for good
                return marks, True
            if wanted.until_folded and load == math.pi and three_covered(piece, at):
                return marks, True
    return [m for m in marks if m.s < step.length], False


def _between_loads(wanted: Wanted, low: float, high: float) -> Iterator[float]:
    """Loads to solve for between two values, the end of the path among them."""
    low, high = min(low, high), max(low, high)
    targets = wanted.targets
    if targets is None:
        first, last = math.floor(low / EIGHTH), math.ceil(high / EIGHTH)
        targets = tuple(k * EIGHTH for k in range(first, last + 1))
    for load in (*targets, math.pi, wanted.load_max, -wanted.load_max):
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
        first, last = a.visit.at, b.visit.at
        inside = _slowest(
            b.s - a.s, last.moment - first.moment, first.moment_rate, last.moment_rate
        )
        middle = [(a.s + u, step.at(a.s + u)) for u in inside]
        for low, high in pairwise([(a.s, first), *middle, (b.s, last)]):
            if low[1].moment_rate * high[1].moment_rate < 0.0:
                s, at = step.change(lambda at: at.moment_rate, low, high)
                found.append(_Mark(s, Visit(at, "limit")))
    return found


def _index_changes(piece: Sector, wanted: Wanted, step: Step, line: list[_Mark]) -> list[_Mark]:
    """The line with branch points put in, the index of limits, and that beside folds."""
    line = [
        replace(m, visit=visit(piece, wanted, m.visit.at, kind="limit"))
        if m.visit.kind == "limit"
        else m
        for m in line
    ]
    folds = [m.s for m in line if m.visit.kind == "fold"]
    flanks = [s for fold in folds for s in _beside(step, fold, folds, line[-1].s)]
    known = [m for m in line if m.visit.kind != "fold"]
    known += [_Mark(s, visit(piece, wanted, step.at(s))) for s in flanks]
    known = [m for m in known if m.visit.index is not None and None not in m.visit.index]
    found: list[_Mark] = []
    for a, b in pairwise(sorted(known, key=lambda m: m.s)):
        # across a fold, the first class loses or gains one by the fold itself
        first = 1 if any(a.s < s < b.s for s in folds) else 0
        for c in range(first, len(piece.classes)):
            places = [(m.s, (m.visit.index or ())[c]) for m in (a, b)]
            if places[0][1] == places[1][1]:
                places[1:1] = _between_equals(piece, step, c, a, b)
            for low, high in pairwise(places):
                found += _branches(piece, step, c, low, high)
    line = sorted([*line, *found], key=lambda m: m.s)
    singular = [m.s for m in line if m.visit.kind in ("fold", "branch")]
    return [
        replace(m, visit=_with_sides(piece, wanted, step, m, singular, line[-1].s))
        if m.visit.kind in ("fold", "branch")
        else m
        for m in line
    ]


def _between_equals(
    piece: Sector, step: Step, c: int, a: _Mark, b: _Mark
) -> list[tuple[float, int | None]]:
    """A place between two states of equal index where class ``c`` has another, if there is one.

    Two changes of opposite sense within a step show at its ends only by a soft mode. Where there is
    one, the state midway is looked at, and the one at which the parabola through the three
    stiffnesses is closest to zero.
    """
    ends = [m.visit.stiffness[c] for m in (a, b) if m.visit.stiffness]
    soft = _SOFT * (2.0 * math.pi / (piece.copies * float(piece.body.length.sum()))) ** 2
    soft *= float(piece.body.stiffness.min())
    if len(ends) < 2 or min(map(abs, ends)) > soft:
        return []
    _, modes = list(piece.classes.values())[c]
    there = (a.visit.index or ())[c]

    def seen(u: float) -> tuple[tuple[float, int | None], float]:
        s = a.s + u * (b.s - a.s)
        count, stiffness = index_and_stiffness(piece.body, piece.held, modes, step.at(s).state)
        return (s, count), stiffness

    place, stiffness = seen(0.5)
    if place[1] == there and (u := _closest(ends[0], stiffness, ends[1])) is not None:
        place, _ = seen(u)
    return [] if place[1] in (there, None) else [place]


def _closest(first: float, middle: float, last: float) -> float | None:
    """Where in (0, 1) the parabola through three values of one sign comes close to zero, if so."""
    slope, curvature = last - first, 2.0 * (first + last - 2.0 * middle)
    if first * last <= 0.0 or curvature * first <= 0.0 or abs(slope) >= abs(curvature):
        return None
    u = 0.5 - 0.5 * slope / curvature
    least = middle - 0.25 * slope * slope / curvature
    return u if least / first < _NEARLY * min(1.0, last / first) else None


def _beside(step: Step, s: float, singular: list[float], end: float) -> tuple[float, float]:
    """Places shortly before and after ``s``, nearer to it than to other singular states."""
    apart = 1e-6 * step.length  # what lies closer is the same state
    low = max((t for t in singular if t < s - apart), default=0.0)
    high = min((t for t in singular if t > s + apart), default=end)
    flank = _FLANK * step.length
    return s - min(flank, 0.5 * (s - low)), s + min(flank, 0.5 * (high - s))


def _with_sides(
    piece: Sector, wanted: Wanted, step: Step, mark: _Mark, singular: list[float], end: float
) -> Visit:
    """A singular state with the index on its two sides."""
    before, after = (
        visit(piece, wanted, step.at(s)).index for s in _beside(step, mark.s, singular, end)
    )
    return replace(mark.visit, sides=None if before is None or after is None else (before, after))


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
        at = step.at(low[0])
        if c == 0 and _turns(step, low[0]):  # one of two folds that the cubic did not show
            return [_Mark(low[0], Visit(at, "fold"))]
        return [_Mark(low[0], Visit(at, "branch", details={"symmetry": label}))]
    s = 0.5 * (low[0] + high[0])
    middle = (s, raw_index(piece.body, piece.held, modes, step.at(s).state))
    return [
        *_branches(piece, step, c, low, middle),
        *_branches(piece, step, c, middle, high),
    ]


def _turns(step: Step, s: float) -> bool:
    """Whether the load turns at ``s``; the tangent at a branch point itself tells nothing."""
    away = _TURN * step.length
    before, after = max(s - away, 0.0), min(s + away, step.length)
    return step.at(before).tangent.load * step.at(after).tangent.load < 0.0


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
    return sorted([*line[:-1], end, *_lasting(found)], key=lambda m: m.s)


def _lasting(contacts: list[_Mark]) -> list[_Mark]:
    """Contacts without those that undo the one before within a hair's breadth of s.

    Close to the folded state the strands lie within the mesh's sagitta of each other: such pairs
    come and go with N.
    """
    kept: list[_Mark] = []
    for m in contacts:
        back = m.visit.details["linking_after"]
        if kept and m.s - kept[-1].s < _BRIEF and kept[-1].visit.details["linking_before"] == back:
            kept.pop()
        else:
            kept.append(m)
    return kept


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
    middle = (s, piece.link(step.near(s)))
    return [
        *_contacts(piece, wanted, step, low, middle),
        *_contacts(piece, wanted, step, middle, high),
    ]
