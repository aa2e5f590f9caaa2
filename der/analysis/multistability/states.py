"""Search for all states of a ring by deflation, unstable modes and soft modes.

From initial guesses (`initial_guesses`) deflated Newton's method (`deflation`) finds states not yet
known. Each new state is followed down its unstable modes (`transitions`), which finds the minima.
Then it is itself an initial guess: displaced along its softest modes, near and far, to both sides.
The search ends when enough states are known or all guesses are used. It does not prove that there
are no other states.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from itertools import product

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
LARGEST_INDEX = 8  # largest index: states with more unstable modes are counted and left out
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
    """Return equilibria of a ring, free in space or in its grips, and their transitions.

    Parameters
    ----------
    scene : ring, section, mesh and measure; its control does not matter.
    gamma : rotation of each grip, rad, from 0 to 2 pi; None: the ring without grips.
    count : states after which the search ends; minima that these relax to are added.
    progress : called with the number of states after every initial guess.

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
    """Raise ValueError, naming the argument, if `states` cannot do the search."""
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
    """Why the flat ring is no equilibrium; "" if it is one."""
    at = full.correct(full.start, tolerance=tolerance)
    return "" if at.converged else f"; the flat ring is no equilibrium: {at.advice}"


@dataclass
class Search:
    """States found so far, and the initial guesses still to try."""

    images: Images
    count: int
    known: list[Known] = field(default_factory=list)
    indices: list[int | None] = field(default_factory=list)
    peaks: list[Known] = field(default_factory=list)  # with too many unstable modes
    followed: list[tuple[int, Descent, tuple[int, ...]]] = field(default_factory=list)
    tried: int = 0
    nowhere: int = 0

    def run(self, starts: Iterator[FreeRing]) -> Iterator[None]:
        """Search from each initial guess and from each state found; yield after every step."""
        for start in starts:
            if len(self.known) >= self.count:
                return
            yield from self._try(start)
        begun: deque[Iterator[FreeRing]] = deque()
        opened = 0
        while len(self.known) < self.count and self.tried < max(_TRIES * self.count, _FEWEST_TRIES):
            begun.extend(self._beside(k) for k in range(opened, len(self.known)))  # new states
            opened = len(self.known)
            if not begun:
                return
            source = begun.popleft()
            beside = next(source, None)
            if beside is not None:
                begun.append(source)
                yield from self._try(beside)

    def _try(self, start: FreeRing) -> Iterator[None]:
        """Search from one initial guess, and down from all states that are new."""
        self.tried += 1
        one = deflated(start, self.known + self.peaks, self.images)
        index = None if one is None else one.free.index()
        if one is None:
            self.nowhere += 1
        elif index is not None and index > LARGEST_INDEX:
            self.peaks.append(one)
        else:
            self._add(one)
        yield
        k = max((start for start, _, _ in self.followed), default=-1) + 1
        while k < len(self.known):
            for down in descents(self.known[k], self.indices[k] or 0, self.images):
                self.followed.append((k, down, tuple(self._add(rest) for rest in down.rests)))
                yield
            k += 1

    def _add(self, one: Known) -> int:
        """Return the position of a state in the list; it is added if it is new."""
        at = recognised(one, self.known, self.images)
        if at is not None:
            return at
        self.known.append(one)
        self.indices.append(one.free.index())
        return len(self.known) - 1

    def _beside(self, k: int) -> Iterator[FreeRing]:
        """Initial guesses beside a state, near ones first."""
        free = self.known[k].free
        _, modes = free.system.softest_modes(free.state, _SOFTEST)
        length = math.sqrt(float(free.rod.length.sum()))
        for size, mode, sign in product(_SIZES, modes, (1.0, -1.0)):
            yield displaced(free, sign * size * length * mode)


def record(scene: Scene, full: GrippedRing, search: Search, gamma: float | None) -> States:
    """Return the record of a search, lowest state first."""
    order = sorted(range(len(search.known)), key=lambda k: search.known[k].energy)
    known = [search.known[k] for k in order]
    indices = [search.indices[k] for k in order]
    called = names(full, known, indices)
    name = dict(zip(order, called, strict=True))
    rows = zip(known, called, indices, strict=True)
    transitions = []
    for start, down, rests in sorted(search.followed, key=lambda one: order.index(one[0])):
        end = name[rests[-1]] if down.ended else None
        via = tuple(name[k] for k in (rests[:-1] if down.ended else rests))
        released = search.known[start].energy - down.rests[-1].energy if down.ended else None
        mode = (down.stiffness, down.sign)
        transitions.append(Transition(name[start], end, *mode, via, released))
    return States(
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        scale=scene.scale,
        numerics={**mesh_numerics(scene, full), "count": search.count},
        gamma=gamma,
        states=tuple(described(full, *row) for row in rows),
        transitions=tuple(transitions),
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
