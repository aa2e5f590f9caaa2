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
from typing import NamedTuple

import numpy as np

from der.analysis.self_crossing import passage
from der.continuation.bifurcations import (
    SAME,
    Change,
    Place,
    beside_folds,
    changes,
    is_fold,
    merged,
    own_changes,
)
from der.continuation.extrema import Found, of_load, of_moment, turns
from der.continuation.step import Step
from der.kernels.quaternions import rotation_vector
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import Sector
from der.rod.stability import indices_and_stiffness, stack

EIGHTH = math.pi / 8.0  # states are solved for at its multiples where nothing else was asked
_CONTACT = 1e-5  # of s, for the passage of a strand: places are found to 2e-6
_SIDE = 0.45  # of that: how far before and behind a passage the link is counted
_BRIEF = 1e-3  # of s, between a passage and its reversal
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
    # the load that it stands for on an extrapolated curve, and the sign of d load/ds there
    sought: tuple[float, float] | None = None


@dataclass(frozen=True)
class Wanted:
    """What the follower has to look for, and where it stops."""

    load_max: float = math.pi
    until_folded: bool = False
    targets: tuple[float, ...] | None = None  # loads at which to solve; None: multiples of pi/8
    limits: bool = True
    stride: float = 1.0  # by how much the path may turn further than usual from state to state
    stability: bool = True
    contacts: bool = True
    tolerance: float = 1e-10
    most_steps: int = 2000


def visit(piece: Sector, wanted: Wanted, at: Equilibrium, **extra: object) -> Visit:
    """A visit with what is wanted of a regular state."""
    if not wanted.stability:
        return Visit(at, **extra)  # type: ignore[arg-type]
    known, stiffness = indices_and_stiffness(piece.body, piece.held, piece.modes, at.state)
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


class _Mark(NamedTuple):
    """A visit and its place within a step."""

    s: float
    visit: Visit
    change: tuple[int, int] | None = None  # of a branch point: its class, and by how much


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
    if wanted.limits:
        line += _limits(step, line)
        line.sort(key=lambda m: m.s)
    if wanted.contacts:
        line = _passages(piece, wanted, step, line, ended)
    if wanted.stability:  # the index at contacts is a sample, too
        line = _index_changes(piece, wanted, step, line)
    return [m.visit for m in line[1:]], ended


def _folds(step: Step) -> list[Found]:
    """Folds of the load within a step, also a pair of them between tangents of equal sign."""

    def along(at: Equilibrium) -> tuple[float, float]:
        value, rate = of_load(at)
        return value, step.end_rate.load if at is step.end else rate

    return turns(step, (0.0, step.start), (step.length, step.end), of_load, along)


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
            if marks:  # loads may lie closer than places can be told
                s = max(s, marks[-1].s)
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


def covering(piece: Sector, at: Equilibrium) -> int | None:
    """How often the tangent of a planar state turns, to 1e-6, < 0 inside out; None: not planar."""
    x = piece.vertices(at.state)
    quat = at.state.quat
    # not the strains: some measures of curvature are no angles
    angle = rotation_vector(quat, np.roll(quat, -1, axis=0))[: len(piece.body.cell), 0]
    count = piece.copies * float(angle.sum()) / (2.0 * math.pi)
    planar = float(np.ptp(x[:, 0])) < 1e-6 and abs(count - round(count)) < 1e-6
    return round(count) if planar else None


def three_covered(piece: Sector, at: Equilibrium) -> bool:
    """Whether a state is the planar ring that covers itself three times."""
    return covering(piece, at) == 3


def touches_itself(piece: Sector, at: Equilibrium) -> bool:
    """Whether a state is planar and crosses or covers itself: then no link is defined."""
    return covering(piece, at) not in (None, 1, -1)


def _limits(step: Step, line: list[_Mark]) -> list[_Mark]:
    """Limits of the moment between the marks of a line."""
    return [
        _Mark(s, Visit(at, "limit"))
        for a, b in pairwise(line)
        for s, at in turns(step, (a.s, a.visit.at), (b.s, b.visit.at), of_moment)
    ]


def _index_changes(piece: Sector, wanted: Wanted, step: Step, line: list[_Mark]) -> list[_Mark]:
    """The line with branch points put in, the index of limits, and that beside folds."""
    line = [
        m._replace(visit=visit(piece, wanted, m.visit.at, kind="limit"))
        if m.visit.kind == "limit"
        else m
        for m in line
    ]
    folds = [m for m in line if m.visit.kind == "fold"]
    flanks = [s for m in folds for s in _beside(step, [m], folds, line[-1].s)]
    known = [m for m in line if m.visit.kind != "fold"]
    known += [_Mark(s, visit(piece, wanted, step.at(s))) for s in flanks]
    known = [m for m in known if m.visit.index is not None and None not in m.visit.index]
    found: list[Change] = []
    hidden: list[_Mark] = []
    for a, b in pairwise(sorted(known, key=lambda m: m.s)):
        across = [(m.s, m.visit.at) for m in folds if a.s < m.s < b.s]
        for c in range(len(piece.classes)):
            low, high = ((m.s, (m.visit.index or ())[c]) for m in (a, b))
            if c == 0 and across:  # it loses or gains one by each fold itself
                found += beside_folds(step, (low, a.visit.at), (high, b.visit.at), across)
                continue
            places = [low, high]
            if low[1] == high[1]:
                places[1:1] = _between_equals(piece, step, c, a, b)
            for one in (one for ends in pairwise(places) for one in changes(step, c, *ends)):
                if c == 0 and is_fold(step, one.s):  # one of two that the cubic did not show
                    hidden.append(_Mark(one.s, Visit(one.at, "fold")))
                else:
                    found.append(one)
    labels = list(piece.classes)
    branches = [
        _Mark(m.s, Visit(m.at, "branch", details={"symmetry": labels[m.c]}), (m.c, m.by))
        for m in merged(step, found)
    ]
    return _with_sides(piece, wanted, step, [*line, *hidden, *branches])


def _between_equals(piece: Sector, step: Step, c: int, a: _Mark, b: _Mark) -> list[Place]:
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
    own = stack([modes])
    there = (a.visit.index or ())[c]

    def seen(u: float) -> tuple[Place, float]:
        s = a.s + u * (b.s - a.s)
        state = step.at(s).state
        (count,), (stiffness,) = indices_and_stiffness(piece.body, piece.held, own, state)
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


def _beside(
    step: Step, group: list[_Mark], singular: list[_Mark], end: float
) -> tuple[float, float]:
    """Places shortly before and after some marks, nearer to them than to other singular ones."""
    apart = SAME * step.length
    low, high = group[0].s, group[-1].s
    last = max((m.s for m in singular if m.s < low - apart), default=0.0)
    following = min((m.s for m in singular if m.s > high + apart), default=end)
    flank = _FLANK * step.length
    return low - min(flank, 0.5 * (low - last)), high + min(flank, 0.5 * (following - high))


def _with_sides(piece: Sector, wanted: Wanted, step: Step, marks: list[_Mark]) -> list[_Mark]:
    """Marks in order, with the index on the two sides of singular states."""
    line = sorted(marks, key=lambda m: m.s)
    singular = [m for m in line if m.visit.kind in ("fold", "branch")]
    sided: dict[int, _Mark] = {}
    groups: list[list[_Mark]] = []
    for m in singular:
        if groups and m.s - groups[-1][-1].s < SAME * step.length:
            groups[-1].append(m)
        else:
            groups.append([m])
    while groups:
        group = groups.pop(0)
        places = [step.at(s) for s in _beside(step, group, singular, line[-1].s)]
        before, after = (visit(piece, wanted, at).index for at in places)
        near = groups and groups[0][0].s - group[-1].s < 2.0 * _FLANK * step.length
        if near and None in (after or ()):
            # the index midway to the next is uncertain: they share what changes over both
            groups[0] = group + groups[0]
            continue
        sides = _shared(places[0], group, before, after)
        for m, pair in zip(group, sides, strict=True):
            sided[id(m)] = m._replace(visit=replace(m.visit, sides=pair))
    return [sided.get(id(m), m) for m in line]


def _shared(
    start: Equilibrium, group: list[_Mark], before: Indices | None, after: Indices | None
) -> list[tuple[Indices, Indices] | None]:
    """The index on the two sides of each of some singular states in one place, one after another.

    ``start``: the state before them.
    """
    if before is None or after is None:
        return [None] * len(group)
    if len(group) == 1:
        return [(before, after)]
    folds = own_changes(start, [m.visit.at for m in group if m.change is None])
    sides: list[tuple[Indices, Indices] | None] = []
    for m in group:
        c, by = m.change or (0, folds.pop(0))
        past = tuple(
            None if count is None else count + by * (k == c) for k, count in enumerate(before)
        )
        sides.append((before, past))
        before = past
    return sides if before == after else [None] * len(group)


def _passages(
    piece: Sector, wanted: Wanted, step: Step, line: list[_Mark], ended: bool
) -> list[_Mark]:
    """The line with the link of its ends filled in and contacts put where it changes."""
    last = line[-1]
    if ended and touches_itself(piece, last.visit.at):
        return line
    if line[0].visit.link is None:
        before = replace(line[0].visit, link=piece.link(step.start.state))
        line[0] = line[0]._replace(visit=before)
    end = last._replace(visit=replace(last.visit, link=piece.link(last.visit.at.state)))
    found = _contacts(piece, wanted, step, (line[0].s, line[0].visit.link), (end.s, end.visit.link))
    line = [*line[:-1], end]
    contacts = [_on_its_side(step, line, m) for m in _lasting(found)]
    return sorted([*line, *contacts], key=lambda m: m.s)


def _on_its_side(step: Step, line: list[_Mark], contact: _Mark) -> _Mark:
    """A contact, put on the other side of a state solved for where its load says so.

    The place of a state at a given load is known to second order only.
    """
    load, rate = of_load(contact.visit.at)
    for m in line[1:-1]:  # the ends of the step stay its ends
        if not m.visit.kind and abs(m.s - contact.s) < SAME * step.length:
            ahead = (load - m.visit.at.state.load) * rate
            if ahead * (contact.s - m.s) < 0.0:
                contact = contact._replace(s=math.nextafter(m.s, math.copysign(math.inf, ahead)))
    return contact


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
    *,
    halve: bool = False,
) -> list[_Mark]:
    """Where the link changes between two places: at passages, else by bisection (``halve``)."""
    if low[1] == high[1]:
        return []
    if high[0] - low[0] < _CONTACT:
        change = {"linking_before": low[1], "linking_after": high[1]}
        at = step.at(low[0])
        found = visit(piece, wanted, at, kind="contact", link=high[1], details=change)
        return [_Mark(low[0], found)]
    passed = None if halve else passage(step, low[0], high[0])
    if passed is None:
        s = 0.5 * (low[0] + high[0])
        inside = [(s, piece.link(step.near(s)))]
    else:
        sides = passed - _SIDE * _CONTACT, passed + _SIDE * _CONTACT
        inside = [(s, piece.link(step.at(s).state)) for s in sides if low[0] < s < high[0]]
    # what changes beside a passage that was looked at is bisected: it was none, or not the only one
    return [
        one
        for ends in pairwise([low, *inside, high])
        for one in _contacts(piece, wanted, step, *ends, halve=passed is not None)
    ]
