"""Minima over a grid of twist and grip distance, by a flood fill.

From a minimum in one cell, Newton's method looks for a minimum in each of the four neighbour cells;
if it finds none, dynamic relaxation is used. A minimum that is new to its cell spreads further in
turn. Each cell is reached from several directions, so all sheets of minima that are connected are
found. To find separate sheets, minima are also displaced far along their softest modes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from der.kernels.quaternions import Array, rotation_vector
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing
from der.rod.relaxation import relax
from der.rod.rod import State, edges
from der.rod.supports import Supports
from der.rod.system import RodSystem
from der.utils.run import Run

MOST_MINIMA = 6  # in one cell
_SAME = 1e-6  # rad, root mean square: two minima that are one
_NEAR = 0.5  # rad, likewise: a neighbour on the same sheet
_PARTS = (1, 4)  # steps to a neighbour, tried before relaxation
_RELAXED = 1e-6  # GJ/a, residual at which Newton's method takes over
_MOST_GRADIENTS = 3000
_SHAKE = 1.0  # rad, root mean square
_SHAKEN = 2  # modes

Cell = tuple[int, int]


@dataclass(frozen=True)
class Minimum:
    """A minimum in a cell."""

    solution: Equilibrium
    energy: float  # of the full ring


@dataclass
class Flood:
    """The grid, the minima in its cells, and why some cells have none."""

    ring: GrippedRing
    supports: Supports
    gamma: Array
    distance: Array
    tolerance: float
    ceiling: float  # energy above which only the lowest minimum of a cell is kept
    minima: dict[Cell, list[Minimum]] = field(default_factory=dict)
    reasons: dict[Cell, str] = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Share of the grip distance that the sector spans."""
        return 0.5 if self.ring.name == "quarter" else 1.0

    def system(self, distance: float) -> RodSystem:
        """The rod with the grips at a distance."""
        target = self.supports.target.copy()
        target[-1] = self.share * distance
        return RodSystem(self.ring.rod, self.supports._replace(target=target))

    def solve(self, cell: Cell, start: State) -> Equilibrium | None:
        """Return a minimum in ``cell`` from a state nearby; None: none, and the reason is kept."""
        i, j = cell
        system = self.system(self.distance[j])
        for parts in _PARTS:
            at = self._in_parts(cell, start, parts)
            if _is_minimum(at) and _apart(self.ring, start, at.state) < _NEAR:
                return at
        begin = system.at_load(start, self.gamma[i])
        end = relax(system, begin, tolerance=_RELAXED, most=_MOST_GRADIENTS)
        if end.rests:
            at = system.correct(end.state, tolerance=self.tolerance)
            if _is_minimum(at):
                return at
        without = f"no minimum was found from any neighbour: {at.advice}"
        self.reasons[cell] = "only saddles were found here" if at.converged else without
        return None

    def _in_parts(self, cell: Cell, start: State, parts: int) -> Equilibrium:
        """The equilibrium in ``cell`` by Newton's method, in several equal steps from a state."""
        span = float(edges(self.ring.rod, start)[:, 2].sum()) / self.share
        gammas = np.linspace(start.load, self.gamma[cell[0]], parts + 1)[1:]
        distances = np.linspace(span, self.distance[cell[1]], parts + 1)[1:]
        state = start
        for gamma, distance in zip(gammas, distances, strict=True):
            system = self.system(distance)
            at = system.correct(state, value=float(gamma), tolerance=self.tolerance)
            if not at.converged:
                break
            state = at.state
        return at

    def add(self, cell: Cell, at: Equilibrium) -> bool:
        """Add a minimum to its cell; return whether it is new there."""
        known = self.minima.setdefault(cell, [])
        energy = self.ring.copies * at.energy
        if len(known) >= MOST_MINIMA or (known and energy > self.ceiling):
            return False
        if any(_apart(self.ring, one.solution.state, at.state) < _SAME for one in known):
            return False
        known.append(Minimum(at, energy))
        self.reasons.pop(cell, None)
        return True

    def among(self, cell: Cell) -> list[Minimum]:
        """The minima of a cell, lowest first, without others above the ceiling."""
        found = sorted(self.minima.get(cell, ()), key=lambda one: one.energy)
        return found[:1] + [one for one in found[1:] if one.energy <= self.ceiling]

    def neighbours(self, cell: Cell) -> list[Cell]:
        """Cells beside, above and below."""
        i, j = cell
        around = [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
        n, m = len(self.gamma), len(self.distance)
        return [(a, b) for a, b in around if 0 <= a < n and 0 <= b < m]


def spread(
    flood: Flood,
    seeds: Iterable[tuple[Cell, State]],
    run: Run,
    progress: Callable[[float], object] | None,
) -> None:
    """Fill the grid from states near some of its cells, until nothing is new, or Ctrl-C."""
    waiting: deque[tuple[Cell, Equilibrium]] = deque()
    for cell, state in seeds:
        if run.done:
            _try(flood, cell, state, waiting)
    cells = len(flood.gamma) * len(flood.distance)
    while waiting and run.done:
        cell, at = waiting.popleft()
        for neighbour in flood.neighbours(cell):
            _try(flood, neighbour, at.state, waiting)
        if progress is not None:
            progress(len(flood.minima) / cells)


def shaken(flood: Flood, across: int) -> Iterator[tuple[Cell, State]]:
    """Minima of about ``across`` cells in each direction, displaced far along soft modes."""
    n, m = len(flood.gamma), len(flood.distance)
    root = float(np.sqrt(flood.ring.rod.length.sum()))
    for i, j in product(range(0, n, max(n // across, 1)), range(0, m, max(m // across, 1))):
        for one in flood.among((i, j))[:1]:
            system, state = flood.system(flood.distance[j]), one.solution.state
            _, modes = system.softest_modes(state, _SHAKEN)
            for mode, sign in product(modes, (1.0, -1.0)):
                kick = system.increment(sign * _SHAKE * root * mode)
                yield (i, j), system.retract(state, kick)


def _try(flood: Flood, cell: Cell, start: State, waiting: deque[tuple[Cell, Equilibrium]]) -> None:
    at = flood.solve(cell, start)
    if at is not None and flood.add(cell, at):
        waiting.append((cell, at))


def _is_minimum(at: Equilibrium) -> bool:
    return at.converged and at.index == 0


def _apart(ring: GrippedRing, a: State, b: State) -> float:
    """Root mean square of the rotations between two states [rad]."""
    w = rotation_vector(a.quat, b.quat)
    return float(np.sqrt(np.sum(ring.rod.mass * w * w)))
