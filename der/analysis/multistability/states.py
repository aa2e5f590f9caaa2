"""What other states are there? A search by deflation, pushes and soft modes.

From starts that are known to be states of some ring (`states_starts`) deflated Newton's method
(`states_deflation`) goes to states not yet known. Each new state is pushed along its ways down
(`states_basins`), which finds the minima, and is then itself a start: displaced along its softest
modes, near and far, to either side. The search ends when enough states are known or all starts are
used up. That there are no others is not proved, only looked for.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from der.analysis.landscape.saddle_search import displaced
from der.analysis.multistability.deflation import Known, deflated, recognised
from der.analysis.multistability.descriptors import described, names
from der.analysis.multistability.initial_guesses import free_starts, gripped_starts
from der.analysis.multistability.symmetry_images import Images, images
from der.analysis.multistability.transitions import Descent, descents
from der.analysis.path_record import mesh_numerics
from der.analysis.request import ring_of
from der.errors import Reason
from der.kernels.linking import vertices
from der.kernels.quaternions import rotation
from der.records.configurations import Shapes
from der.records.record import SolveTime
from der.records.states import States, Transition
from der.rod.free_ring import FreeRing
from der.rod.gripped_ring import GrippedRing, free_supports
from der.scene import Scene
from der.utils.checks import checked_number, shown
from der.utils.run import Run

MOST = 200  # states that may be asked for
WAYS = 8  # down, at most: states with more are counted and left out
_SOFTEST = 6  # modes of a state along which the search goes on
_SIZES = (0.3, 0.9, 1.8)  # rad, root mean square: how far along them it starts
_TRIES, _FEWEST_TRIES = 8, 64  # starts for each state asked for, and in all
_MOST_EDGES = 1024


def states(
    scene: Scene,
    *,
    gamma: float | None = None,
    count: int = 12,
    progress: Callable[[int], object] | None = None,
) -> States:
    """Equilibria of a ring, free in space or in its grips, and which of them falls to which.

    Parameters
    ----------
    scene : ring, section, mesh and measure; how it is controlled does not matter.
    gamma : rotation of each grip, rad, from 0 to 2 pi; None: the ring without grips.
    count : states after which the search ends; minima that these fall to are added.
    progress : called with the number of states after every start.

    Returns
    -------
    States
        Lowest first, with shapes. Ctrl-C keeps those found so far.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed.
    """
    check(scene, gamma, count)
    full = ring_of(scene, "full")
    starts = free_starts(scene, full) if gamma is None else gripped_starts(scene, full, gamma)
    supports = free_supports(full.rod) if gamma is None else full.supports
    search = Search(images(full.rod, supports, 0.0 if gamma is None else gamma), count)

    def tell(_: None) -> None:
        if progress is not None:
            progress(len(search.known))

    with Run() as run:
        run.collect(search.run(starts), tell)
        found = record(scene, full, search, gamma)
        if run.done and not len(found):
            flat = _flat(full, scene.tolerance)
            run.stop(Reason.NO_START, f"no state was found from any start{flat}")
    return replace(found, status=run.status, message=run.message, timing=SolveTime(run.seconds))


def check(scene: Scene, gamma: float | None, count: int) -> None:
    """Raise ValueError, naming the argument, where `states` cannot do what is asked."""
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a der.Scene, got {shown(scene)}")
    if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST:
        raise ValueError(f"count must be an integer from 1 to {MOST}, got {shown(count)}")
    if gamma is not None:
        allowed = "a number from 0 to 2 pi"
        checked_number("gamma", gamma, allowed, lambda g: 0.0 <= g <= 2.0 * math.pi)
    if scene.n_edges > _MOST_EDGES:
        raise ValueError(f"n_edges must be at most {_MOST_EDGES} here, got {scene.n_edges}")


def _flat(full: GrippedRing, tolerance: float) -> str:
    """What the solver says of the flat ring, where that is not at rest."""
    at = full.correct(full.start, tolerance=tolerance)
    return "" if at.converged else f"; the flat ring is no equilibrium: {at.advice}"


@dataclass
class Search:
    """States found so far, and where to look next."""

    images: Images
    count: int
    known: list[Known] = field(default_factory=list)
    indices: list[int | None] = field(default_factory=list)
    peaks: list[Known] = field(default_factory=list)  # with too many ways down
    pushes: list[tuple[int, Descent, tuple[int, ...]]] = field(default_factory=list)
    tried: int = 0
    nowhere: int = 0

    def run(self, starts: Iterator[FreeRing]) -> Iterator[None]:
        """Search from each start and from all that is found, handing over after every one."""
        for start in starts:
            if len(self.known) >= self.count:
                return
            self._try(start)
            yield
            yield from self._push_new()
        begun: deque[Iterator[FreeRing]] = deque()
        opened = 0
        while len(self.known) < self.count and self.tried < max(_TRIES * self.count, _FEWEST_TRIES):
            while opened < len(self.known):  # those just found take their turn, lowest first
                begun.append(self._beside(opened))
                opened += 1
            if not begun:
                return
            source = begun.popleft()
            beside = next(source, None)
            if beside is None:
                continue
            begun.append(source)
            self._try(beside)
            yield
            yield from self._push_new()

    def _try(self, start: FreeRing) -> None:
        self.tried += 1
        one = deflated(start, self.known + self.peaks, self.images)
        index = None if one is None else one.free.index()
        if one is None:
            self.nowhere += 1
        elif index is not None and index > WAYS:
            self.peaks.append(one)
        else:
            self._add(one)

    def _add(self, one: Known) -> int:
        """Where a state stands in the list; it is added if it is new."""
        at = recognised(one, self.known, self.images)
        if at is not None:
            return at
        self.known.append(one)
        self.indices.append(one.free.index())
        return len(self.known) - 1

    def _push_new(self) -> Iterator[None]:
        """Push all states that have not been pushed."""
        done = {start for start, _, _ in self.pushes}
        k = max(done, default=-1) + 1
        while k < len(self.known):
            for fall in descents(self.known[k], self.indices[k] or 0, self.images):
                self.pushes.append((k, fall, tuple(self._add(rest) for rest in fall.rests)))
                yield
            k += 1

    def _beside(self, k: int) -> Iterator[FreeRing]:
        """Starts beside a state, near ones first."""
        free = self.known[k].free
        _, modes = free.system.softest_modes(free.state, _SOFTEST)
        length = math.sqrt(float(free.rod.length.sum()))
        for size in _SIZES:
            for mode in modes:
                for sign in (1.0, -1.0):
                    yield displaced(free, sign * size * length * mode)


def record(scene: Scene, full: GrippedRing, search: Search, gamma: float | None) -> States:
    """The record of a search, lowest state first."""
    order = sorted(range(len(search.known)), key=lambda k: search.known[k].energy)
    known = [search.known[k] for k in order]
    indices = [search.indices[k] for k in order]
    called = names(full, known, indices)
    name = {k: called[i] for i, k in enumerate(order)}
    rows = zip(known, called, indices, strict=True)
    transitions = []
    for start, fall, rests in search.pushes:
        end = name[rests[-1]] if fall.ended else None
        via = tuple(name[k] for k in (rests[:-1] if fall.ended else rests))
        released = search.known[start].energy - fall.rests[-1].energy if fall.ended else None
        way = Transition(name[start], end, fall.stiffness, fall.sign, via, released)
        transitions.append((order.index(start), way))
    about = {**mesh_numerics(scene, full), "count": search.count}
    return States(
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=about,
        gamma=gamma,
        states=tuple(described(full, *row) for row in rows),
        transitions=tuple(way for _, way in sorted(transitions, key=lambda one: one[0])),
        tried=search.tried,
        nowhere=search.nowhere,
        peaks=len(search.peaks),
        shapes=_shapes(full, known),
    )


def _shapes(full: GrippedRing, known: list[Known]) -> Shapes | None:
    """Vertices and frames of the states."""
    if not known:
        return None
    at = [one.free.state for one in known]
    x = np.array([vertices(state.quat, full.lengths(state)) for state in at])
    frames = np.array([rotation(state.quat).swapaxes(1, 2) for state in at])
    return Shapes(x, frames, arc_length=full.arc_length)
