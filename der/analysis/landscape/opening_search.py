"""The search for the loading of least work: pairs of points, with all actuators at each.

It starts on a grid, with one of the pairs that a symmetry of the folded ring maps onto each other.
Then it continues between the points of the grid, around the best of each kind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from der.analysis.landscape.actuators import struts, wrenches
from der.analysis.landscape.barrier import ALIKE, name_of_rest
from der.analysis.landscape.opening_path import Instant as Reached
from der.analysis.landscape.opening_path import Opening, opened
from der.analysis.request import ring_of
from der.records.opening import ALIKE as TIE
from der.records.opening import KINDS, Instant, Push, least_of
from der.rod.free_ring import FreeRing
from der.scene import Scene
from der.utils.run import Run

_UNIFORM = 1e-9  # of cells and natural strains that are equal
_COARSER = 4  # edges between points that a mesh of N/4 edges has, too, as error bars need

Pair = tuple[int, int]


@dataclass
class Search:
    """A folded ring, and the loadings tried so far."""

    scene: Scene
    folded: FreeRing | None  # None: it is no well, and nothing is tried
    ends: dict[str, float]  # energies of the flat and folded ring
    most: float  # work beyond which a loading is not followed
    found: dict[Pair, list[tuple[Push, Opening]]] = field(default_factory=dict)

    def at(self, pair: Pair) -> list[tuple[Push, Opening]]:
        """Results of all actuators at one pair of points."""
        if pair not in self.found and self.folded is not None:
            energy = self.ends["folded"]
            self.found[pair] = []
            for actuator in struts(self.folded, pair) + wrenches(self.folded, pair):
                done = opened(
                    actuator,
                    energy,
                    ALIKE * abs(energy),
                    tolerance=self.scene.tolerance,
                    most=self.most,
                )
                if done.last is not None and done.line and done.last.index[0] == 0:
                    self.found[pair].append((_push(self, done), done))
        return self.found[pair]

    @property
    def all(self) -> list[tuple[Push, Opening]]:
        """Everything found so far."""
        return [one for several in self.found.values() for one in several]

    def least(self, *, dead: bool) -> dict[str, int]:
        """Positions of the loadings of least work, by kind."""
        pushes = [push for push, _ in self.all]
        places = {kind: least_of(pushes, kind, dead=dead) for kind in KINDS}
        return {kind: k for kind, k in places.items() if k is not None}

    def best(self) -> Iterator[tuple[str, int, bool]]:
        """Name and position of each loading of least work, and whether its load is dead."""
        for dead in (False, True):
            for kind, k in self.least(dead=dead).items():
                yield f"{kind} dead" if dead else kind, k, dead


def scan(search: Search, grid: int, run: Run, progress: Callable[[float], object] | None) -> None:
    """Try all actuators at the pairs of a grid; ``progress`` is called with the share done."""
    pairs = list(_pairs(search, grid))
    for k, pair in enumerate(pairs):
        if run.pressed:
            return
        search.at(pair)
        if progress is not None:
            progress((k + 1) / len(pairs))


def _pairs(search: Search, grid: int) -> Iterator[Pair]:
    """Pairs of edges on a grid, one of those that a symmetry of the ring maps onto each other."""
    n = search.scene.n_edges
    stride = n // grid
    for i in range(0, n, stride):
        for j in range(i + stride, n, stride):
            if (i, j) == same_pair(search, (i, j)):
                yield i, j


def same_pair(search: Search, pair: Pair) -> Pair:
    """The first of the pairs that a symmetry of the folded ring maps onto each other."""
    assert search.folded is not None
    n, rod = search.scene.n_edges, search.folded.rod
    i, j = pair
    if np.ptp(rod.cell) < _UNIFORM and np.all(np.ptp(rod.rest, axis=0) < _UNIFORM):
        apart = (j - i) % n
        return 0, min(apart, n - apart)
    images = [(i, j), (-i, -j)]
    if search.scene.ring.symmetry == "D2":
        images += [(n // 2 - i, n // 2 - j), (n // 2 + i, n // 2 + j)]
    first, second = min(sorted((a % n, b % n)) for a, b in images)
    return first, second


def refine(search: Search, stride: int, barrier: float | None, run: Run) -> None:
    """Search between the points of the grid, around the best of each kind.

    A slow loading that takes no more work than the barrier cannot be improved.
    """
    finest = _COARSER if search.scene.error_bars else 1
    while stride % (2 * finest) == 0:
        stride //= 2
        for dead in (False, True):
            for kind in KINDS:
                _descend(search, kind, stride, barrier, run, dead=dead)


def _descend(
    search: Search, kind: str, stride: int, barrier: float | None, run: Run, *, dead: bool
) -> None:
    """Replace the best loading of a kind by a better neighbour, until there is none."""
    before = None
    while not run.pressed:
        best = search.least(dead=dead).get(kind)
        if best is None or best == before:
            return
        push, _ = search.all[best]
        if not dead and barrier is not None and push.held.work < (1.0 + TIE) * barrier:
            return
        for pair in _around(search, push.edges, stride):
            search.at(pair)
        before = best


def _around(search: Search, pair: Pair, stride: int) -> list[Pair]:
    n = search.scene.n_edges
    steps = (-stride, 0, stride)
    near = {((pair[0] + a) % n, (pair[1] + b) % n) for a in steps for b in steps}
    return sorted({same_pair(search, one) for one in near if one[0] != one[1]})


def _push(search: Search, done: Opening) -> Push:
    actuator = done.actuator
    if done.last is None:
        raise ValueError("a push must have at least one state, got none")
    s = ring_of(search.scene, "full").arc_length / search.scene.ring.length
    return Push(
        actuator.kind,
        (float(s[actuator.points[0]]), float(s[actuator.points[1]])),
        actuator.points,
        actuator.direction,
        tuple(actuator.axis.tolist()),
        _instant(search, done.last),
        None if done.dead is None else _instant(search, done.dead),
        done.opens(done.last),
        done.opens(done.dead),
        done.peak,
        done.snaps,
        np.array(done.line) - [0.0, 0.0, search.ends["folded"]],
        done.why,
    )


def _instant(search: Search, reached: Reached) -> Instant:
    lands = "" if reached.lands is None else name_of_rest(reached.lands, search.ends)
    values = (reached.push, reached.force, reached.work, reached.energy - search.ends["folded"])
    return Instant(reached.kind, *values, *reached.index, lands)
