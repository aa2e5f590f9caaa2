"""Following a path of equilibria through its folds, and finding what is special on it.

Pseudo-arclength (Riks, Keller) in the mass-weighted norm of rotation vectors and load, which does
not depend on the mesh. Each accepted step is looked at as a curve of its own, a cubic in the
projection s on the tangent at its start; a state at any s is that cubic's value, corrected
orthogonally to the tangent. All that is sought within a step, a given load, a fold, a limit of the
moment, a change of the index or of the link, is a root in s, and what is reported is always a
converged equilibrium.

    fold     dgamma/ds = 0: the null vector has a component along d(grad)/dgamma
    limit    dM/ds = 0
    branch   the index of a symmetry class changes away from folds
    contact  the linking number changes: a strand passes through another
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from der.equilibrium import (
    ADVICE,
    Control,
    Direction,
    Equilibrium,
    dot,
    equilibrium,
    moved,
    weights,
)
from der.frames import rotation_vector
from der.rod import strains
from der.sector import Sector
from der.stability import index, raw_index

FIRST_STEP = 0.05
LARGEST_STEP = 0.6
SMALLEST_STEP = 1e-7
_ANGLE = 0.12  # rad, aimed at between tangents of neighbouring states
_SHARPEST = 0.6  # rad, a step that turns more is repeated shorter
_ROOT = 1e-12  # of s; folds are a double root of gamma - gamma*, so far below 1e-10 in gamma
_CONTACT = 1e-5  # of s, for the passage of a strand


class Stuck(RuntimeError):
    """A path that cannot go on; everything found so far has been handed out before."""


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


@dataclass
class Tally:
    """What the solve has cost so far."""

    newton_iterations: int = 0
    steps: int = 0


@dataclass(frozen=True)
class Step:
    """The curve between two neighbouring states, s in [0, length]."""

    piece: Sector
    start: Equilibrium
    end: Equilibrium
    length: float
    tolerance: float
    tally: Tally
    jump: Direction = field(init=False)
    end_rate: Direction = field(init=False)

    def __post_init__(self) -> None:
        a, b = self.start, self.end
        q = np.empty_like(a.tangent.q)
        q[:, :3] = rotation_vector(a.state.quat, b.state.quat)
        if q.shape[1] == 4:
            q[:, 3] = b.state.stretch - a.state.stretch
        q[~self.piece.held.free] = 0.0
        jump = Direction(q, b.state.force - a.state.force, b.state.load - a.state.load)
        # d/ds at the end, where s is measured along the tangent at the start
        rate = 1.0 / dot(weights(self.piece.body), a.tangent, b.tangent)
        t = b.tangent
        object.__setattr__(self, "jump", jump)
        object.__setattr__(self, "end_rate", Direction(t.q * rate, t.force * rate, t.load * rate))

    def offset(self, s: float) -> Direction:
        """Cubic increment from the start to ``s``."""
        u = s / self.length
        h10 = self.length * u * (1.0 - u) ** 2
        h01 = u * u * (3.0 - 2.0 * u)
        h11 = self.length * u * u * (u - 1.0)
        a, d, b = self.start.tangent, self.jump, self.end_rate
        return Direction(
            h10 * a.q + h01 * d.q + h11 * b.q,
            h10 * a.force + h01 * d.force + h11 * b.force,
            h10 * a.load + h01 * d.load + h11 * b.load,
        )

    def at(self, s: float) -> Equilibrium:
        """The equilibrium at ``s``.

        Raises
        ------
        Stuck
            Where Newton's method fails although both ends of the step are equilibria.
        """
        if s == 0.0:
            return self.start
        if s == self.length:
            return self.end
        return self._solved(s, self.offset(s), Control.DIRECTION)

    def at_load(self, load: float, low: float, high: float) -> tuple[float, Equilibrium]:
        """The equilibrium at ``load`` between s = low and high, where the load is monotonic."""

        def cubic(s: float) -> float:
            return self.start.state.load + self.offset(s).load - load

        if cubic(low) * cubic(high) < 0.0:
            s = _root(cubic, low, high)
            step = self.offset(s)
            step = step._replace(load=load - self.start.state.load)
            try:
                found = self._solved(s, step, Control.LOAD)
            except Stuck:
                found = None
            if found is not None and self._near(found, s):
                return s, found
        # close to a fold: the load is a bad coordinate there, s is not
        s = _root(lambda t: self.at(t).state.load - load, low, high)
        found = self.at(s)
        return s, replace(found, state=found.state.but(load=load))

    def _near(self, found: Equilibrium, s: float) -> bool:
        """Whether a state found at given load lies where the cubic expects it."""
        mass = weights(self.piece.body)
        q = rotation_vector(self.start.state.quat, found.state.quat)
        q[~self.piece.held.free[:, :3]] = 0.0
        away = float(np.sum(mass * (q - self.offset(s).q[:, :3]) ** 2)) ** 0.5
        return away < 0.1 * self.length and found.tangent.load * self._load_rate(s) > 0.0

    def _load_rate(self, s: float) -> float:
        h = 1e-3 * self.length
        return self.offset(s + h).load - self.offset(s - h).load

    def _solved(self, s: float, step: Direction, control: Control) -> Equilibrium:
        found = equilibrium(
            self.piece.body,
            self.piece.held,
            moved(self.piece.held, self.start.state, step),
            along=self.start.tangent,
            control=control,
            tolerance=self.tolerance,
        )
        self.tally.newton_iterations += found.iterations
        if not found.converged:
            raise Stuck(
                f"no equilibrium within a step, at gamma = {self.start.state.load + step.load:.6f}"
                f" (s = {s:.3g} of {self.length:.3g}): {ADVICE[found.outcome]}"
            )
        return found


def _root(f: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq

    return float(brentq(f, low, high, xtol=_ROOT, rtol=8.9e-16))


def follow(piece: Sector, wanted: Wanted, tally: Tally) -> Iterator[Visit]:
    """Hand out the states of the path from the flat ring on, special points in their places.

    ``tally`` is counted up on the way.

    Raises
    ------
    Stuck
        Where the path cannot be continued, after all that was found has been handed out.
    """
    at = equilibrium(piece.body, piece.held, piece.start, tolerance=wanted.tolerance)
    tally.newton_iterations += at.iterations
    if not at.converged:
        raise Stuck(f"the flat ring is no equilibrium: {ADVICE[at.outcome]}")
    here = _visit(piece, wanted, at)
    yield here
    bend = None  # rate of change of the tangent over the last step
    length = FIRST_STEP
    while True:
        if tally.steps >= wanted.most_steps:
            raise Stuck(f"the path has not ended after {tally.steps} steps")
        step = _advance(piece, wanted, tally, here.at, bend, length)
        tally.steps += 1
        angle = _between(piece, here.at, step.end)
        bend = Direction(
            (step.end.tangent.q - here.at.tangent.q) / step.length,
            (step.end.tangent.force - here.at.tangent.force) / step.length,
            (step.end.tangent.load - here.at.tangent.load) / step.length,
        )
        found, ended = _special(piece, wanted, step, here)
        yield from found
        here = found[-1]
        if ended:
            return
        ease = math.sqrt(_ANGLE / max(angle, 1e-3))
        if step.end.iterations > 4:
            ease = min(ease, 0.7)
        length = min(step.length * min(max(ease, 0.5), 2.0), LARGEST_STEP)


def _visit(piece: Sector, wanted: Wanted, at: Equilibrium, **extra: object) -> Visit:
    """A visit with what is wanted of a regular state."""
    known = None
    if wanted.stability:
        known = tuple(
            index(piece.body, piece.held, modes, at.state) for _, modes in piece.classes.values()
        )
    return Visit(at, index=known, **extra)  # type: ignore[arg-type]


def _between(piece: Sector, a: Equilibrium, b: Equilibrium) -> float:
    """Angle between the tangents at two states [rad]."""
    return math.acos(min(1.0, max(-1.0, dot(weights(piece.body), a.tangent, b.tangent))))


def _advance(
    piece: Sector,
    wanted: Wanted,
    tally: Tally,
    start: Equilibrium,
    bend: Direction | None,
    length: float,
) -> Step:
    """One accepted step of at most ``length``, shortened until Newton's method follows."""
    t = start.tangent
    reason = ""
    while length > SMALLEST_STEP:
        guess = Direction(length * t.q, length * t.force, length * t.load)
        if bend is not None:
            half = 0.5 * length * length
            guess = Direction(
                guess.q + half * bend.q,
                guess.force + half * bend.force,
                guess.load + half * bend.load,
            )
            # s is the projection on the tangent, which the second-order term must not change
            excess = dot(weights(piece.body), t, guess) - length
            guess = Direction(
                guess.q - excess * t.q, guess.force - excess * t.force, guess.load - excess * t.load
            )
        end = equilibrium(
            piece.body,
            piece.held,
            moved(piece.held, start.state, guess),
            along=t,
            control=Control.DIRECTION,
            tolerance=wanted.tolerance,
            iterations=7,
        )
        tally.newton_iterations += end.iterations
        if end.converged and _between(piece, start, end) < _SHARPEST:
            return Step(piece, start, end, length, wanted.tolerance, tally)
        reason = ADVICE[end.outcome] if not end.converged else "the path turns too sharply"
        if end.where >= 0:
            reason = f"vertex {end.where} {reason}"
        length *= 0.5
    raise Stuck(f"no step forward from gamma = {start.state.load:.8f}: {reason}")


@dataclass(frozen=True)
class _Mark:
    """A visit and its place within a step."""

    s: float
    visit: Visit
    shown: bool = True


def _special(piece: Sector, wanted: Wanted, step: Step, here: Visit) -> tuple[list[Visit], bool]:
    """Visits after ``here`` up to the end of ``step``, and whether the path ends there."""
    folds = _folds(step)
    marks, ended = _at_targets(piece, wanted, step, folds)
    last = marks[-1] if ended else _Mark(step.length, _visit(piece, wanted, step.end))
    marks = [*marks[:-1], last] if ended else [*marks, last]
    marks += [_Mark(s, Visit(at, "fold")) for s, at in folds if s < last.s]
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
            s = _root(lambda t: step.at(t).tangent.load, s0, s1)
            found.append((s, step.at(s)))
    return found


def _at_targets(
    piece: Sector, wanted: Wanted, step: Step, folds: list[tuple[float, Equilibrium]]
) -> tuple[list[_Mark], bool]:
    """States at the wanted loads, in order, up to the end of the path if it lies in this step."""
    cuts = [
        (0.0, step.start),
        *folds,
        (step.length, step.end),
    ]
    marks: list[_Mark] = []
    for (s0, a), (s1, b) in pairwise(cuts):
        low, high = a.state.load, b.state.load
        loads = set(_between_loads(wanted, low, high))
        for load in sorted(loads, reverse=high < low):
            if load == low:
                continue
            s, at = (s1, b) if load == high else step.at_load(load, s0, s1)
            marks.append(_Mark(s, _visit(piece, wanted, at)))
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
            s = _root(lambda t: step.at(t).moment_rate, a.s, b.s)
            found.append(_Mark(s, Visit(step.at(s), "limit")))
    return found


def _index_changes(piece: Sector, wanted: Wanted, step: Step, line: list[_Mark]) -> list[_Mark]:
    """The line with branch points put in, and with the index of limits filled in."""
    line = [
        replace(m, visit=_visit(piece, wanted, m.visit.at, kind="limit"))
        if m.visit.kind == "limit"
        else m
        for m in line
    ]
    # a fold explains one change of the first class: look at its flanks, and then between them
    flank = 1e-3 * step.length
    known: list[_Mark] = []
    for m in line:
        if m.visit.kind == "fold":
            known += [
                _Mark(s, _visit(piece, wanted, step.at(s)), shown=False)
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
    if high[0] - low[0] < 2.0 * _ROOT:
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
        visit = _visit(piece, wanted, at, kind="contact", link=high[1], details=change)
        return [_Mark(low[0], visit)]
    s = 0.5 * (low[0] + high[0])
    middle = (s, piece.link(step.at(s).state))
    return [
        *_contacts(piece, wanted, step, low, middle),
        *_contacts(piece, wanted, step, middle, high),
    ]
