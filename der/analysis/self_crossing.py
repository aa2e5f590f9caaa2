"""Self-crossing: an event of a ring's path, where one strand of the ideal curve passes another.

A change of the linking number, an integer, tells that a strand has passed within a step. The zero
of the signed gap between the two strands tells where. It is located on the step's interpolant,
corrected to an equilibrium once, and the link is counted on both sides. If the gap does not show
the crossing, the link is bisected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeAlias

from der.continuation.events import Events, Mark, regular
from der.continuation.extrema import of_parameter
from der.continuation.roots import find_root
from der.continuation.step import SAME, Step
from der.kernels.strands import gap, nearest_strands
from der.problem import Solution
from der.rod.gripped_ring import GrippedRing
from der.rod.rod import State

CONTACT = 1e-5  # of s, for a crossing: places are found to 2e-6
_SIDE = 0.45  # of that: how far before and behind a crossing the link is counted
_BRIEF = 1e-3  # of s, between a crossing and its reversal
_PLACE = 1e-3  # of s: how well the root is found before the curve is corrected there
_ROUNDS = 2  # of the chord after that

Place: TypeAlias = tuple[float, int]  # s, and the link there


@dataclass
class SelfCrossing:
    """Points of kind "contact" where the linking number of a ring changes.

    It remembers the link of the last two ends of steps, which are starts of the next.
    """

    ring: GrippedRing
    stability: bool  # whether the index is wanted there
    _known: list[tuple[Solution[State], int]] = field(default_factory=list)

    def located(self, step: Step[State], line: list[Mark], *, ended: bool) -> list[Mark]:
        """Return the marks of a step together with the crossings, where the link changes."""
        start, end = step.start, line[-1].point.solution
        if ended and self.ring.overlaps(end.state):
            return line
        # a ring that starts planar and covering itself has no link to start from
        if self._remembered(start) is None and self.ring.overlaps(start.state):
            return line
        low, high = (line[0].s, self._link(start)), (line[-1].s, self._link(end))
        crossings = [_on_its_side(step, line, m) for m in _lasting(self._between(step, low, high))]
        return sorted([*line, *crossings], key=lambda m: m.s)

    def _remembered(self, solution: Solution[State]) -> int | None:
        return next((link for known, link in self._known if known is solution), None)

    def _link(self, solution: Solution[State]) -> int:
        link = self._remembered(solution)
        if link is None:
            link = self.ring.link(solution.state)
            self._known = [*self._known[-1:], (solution, link)]
        return link

    def _between(
        self, step: Step[State], low: Place, high: Place, *, halve: bool = False
    ) -> list[Mark]:
        """Changes of the link between two places: at roots of the gap, else by bisection."""
        if low[1] == high[1]:
            return []
        if high[0] - low[0] < CONTACT:
            details = {"linking_before": low[1], "linking_after": high[1]}
            events: Events[State] = Events(stability=self.stability)
            at = step.at(low[0])
            return [Mark(low[0], regular(self.ring, events, at, kind="contact", details=details))]
        passed = None if halve else crossing(self.ring, step, low[0], high[0])
        if passed is None:
            s = 0.5 * (low[0] + high[0])
            inside = [(s, self.ring.link(step.near(s)))]
        else:
            sides = passed - _SIDE * CONTACT, passed + _SIDE * CONTACT
            inside = [(s, self.ring.link(step.at(s).state)) for s in sides if low[0] < s < high[0]]
        # a change beside the crossing found is bisected: that was no crossing, or not the only one
        return [
            one
            for ends in pairwise([low, *inside, high])
            for one in self._between(step, *ends, halve=passed is not None)
        ]


def _on_its_side(step: Step[State], line: list[Mark], crossing: Mark) -> Mark:
    """A crossing, moved to the other side of a solution at a target if its parameter says so.

    The place of a solution at a given parameter is known to second order only.
    """
    value, rate = of_parameter(crossing.point.solution)
    for m in line[1:-1]:  # the ends of the step stay its ends
        if not m.point.kind and abs(m.s - crossing.s) < SAME * step.length:
            ahead = (value - m.point.solution.parameter) * rate
            if ahead * (crossing.s - m.s) < 0.0:
                crossing = crossing._replace(s=math.nextafter(m.s, math.copysign(math.inf, ahead)))
    return crossing


def _lasting(crossings: list[Mark]) -> list[Mark]:
    """Crossings without pairs that cancel within a very short part of the path.

    Close to the folded state the distance of the strands is below the mesh's sagitta: such pairs
    depend on N.
    """
    kept: list[Mark] = []
    for m in crossings:
        back = m.point.details["linking_after"]
        if kept and m.s - kept[-1].s < _BRIEF and kept[-1].point.details["linking_before"] == back:
            kept.pop()
        else:
            kept.append(m)
    return kept


def crossing(ring: GrippedRing, step: Step[State], low: float, high: float) -> float | None:
    """Return a place between two of a step at which a strand passes; None: the gap shows none.

    The interpolant is corrected to an equilibrium once, close to the crossing.

    Raises
    ------
    ContinuationFailed
        If Newton's method fails there.
    """
    shapes = [ring.vertices(step.expected(s)) for s in (low, high)]
    i, k = nearest_strands(*shapes)
    if i < 0:
        return None
    known = {s: float(gap(x, i, k)) for s, x in zip((low, high), shapes, strict=True)}
    if not known[low] * known[high] < 0.0:
        return None

    def apart(s: float) -> float:
        if s not in known:
            known[s] = float(gap(ring.vertices(step.expected(s)), i, k))
        return known[s]

    s = find_root(apart, low, high, _PLACE)
    here, (t, first) = apart(s), [one for one in known.items() if one[0] != s][-1]
    if here == first:
        return None
    slope = (here - first) / (s - t)
    step.at(s)  # from here on the curve passes through this equilibrium
    known.clear()
    for _ in range(_ROUNDS):
        s -= apart(s) / slope
        if not low < s < high:
            return None
    return s
