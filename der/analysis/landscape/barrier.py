"""The barrier of the free ring: the lowest path found from flat to folded.

The search starts from the path of twisting. Equilibria of the twisted ring without load are
equilibria of the free ring (`rod.free_ring`), so the saddle of twisting is a saddle of the free
ring. If its index is 1, it is the pass. If the index is larger, modes that break the symmetry of
twisting lead down to lower saddles, which eigenvector following (`saddle_search`) finds. It also
follows the softest modes of the folded ring uphill. From every saddle of index 1 the ring then
flows down on both sides. The pass is the lowest saddle with the flat ring on one side and the
folded ring on the other, and the two flows are the minimum-energy path. The search does not prove
that no lower saddle exists.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from der.analysis.landscape.landscape import bare_request, barriers, rest_of
from der.analysis.landscape.rest_states import with_rests
from der.analysis.landscape.saddle_search import climb, downhill_modes
from der.analysis.path_record import mesh_numerics
from der.analysis.request import ring_of
from der.continuation.richardson import limits
from der.errors import ContinuationFailed
from der.kernels.linking import vertices
from der.kernels.quaternions import Array, rotation_vector
from der.problem import Statistics
from der.records.landscape import Barriers, Heights, Pass, Rest, Saddle
from der.records.record import SolveTime
from der.rod.dynamics import EndState, flow
from der.rod.free_ring import FreeRing, released
from der.rod.rod import State
from der.scene import Scene, meshes
from der.utils.run import Run

_KICK = 0.05  # rad, root mean square: from a saddle of higher index, along an unstable mode
_NUDGE = 0.02  # rad, likewise: from a saddle of index 1 to one of its two sides
_SOFTEST = 2  # modes of the folded ring that are followed uphill
ALIKE = 1e-6  # of the folded ring's energy: two saddles, or end states, that are one
_SHAPES = 60  # on the path, about equally far apart


@dataclass(frozen=True)
class _Found:
    """A saddle of index 1 and the flows down its two sides."""

    saddle: Saddle
    free: FreeRing
    sides: tuple[EndState, ...]


def barrier(scene: Scene) -> Pass:
    """Return the lowest path found between the flat and the folded free ring.

    Parameters
    ----------
    scene : ring, section and mesh; its control does not matter.

    Notes
    -----
    If no path is found, ``why`` says so in a sentence. With the scene's ``error_bars`` the barriers
    are also extrapolated. Ctrl-C keeps the saddles found so far.
    """
    with Run() as run:
        one = _pass(scene, run)
        if scene.error_bars and one.fold is not None:
            coarser = meshes(scene.n_edges, str(one.numerics["sector"]))[1:]
            bare = replace(scene, error_bars=False, finest=scene.n_edges)
            coarse = [_pass(replace(bare, n_edges=n), run) for n in coarser]
            if not run.pressed:
                heights = [{"fold": level.fold, "open": level.open} for level in (one, *coarse)]
                even = not ring_of(scene).kinks_in_cells
                one = replace(one, extrapolated=limits(heights, even=even))
    return one


def _pass(scene: Scene, run: Run) -> Pass:
    """The lowest path found on one mesh."""
    started = time.perf_counter()
    twisted = twisted_states(scene)
    why = twisted.no_well
    found = [] if why else _passes(twisted, run)
    across = [one for one in found if set(one.saddle.ends) == {"flat", "folded"}]
    if run.pressed and not why:
        why = "stopped by the user before all saddles were looked for"
    if not why and not across:
        why = "no saddle was found between the flat and the folded ring"
    way, shapes, heights = np.zeros((0, 2)), np.zeros((0, 0, 3)), Heights(None, None)
    if across:
        way, shapes = _path_over(across[0])
        energy, ends = across[0].saddle.energy, twisted.ends
        heights = Heights(energy - ends["flat"], energy - ends["folded"])
    return Pass(
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        scale=scene.scale,
        numerics=mesh_numerics(scene, ring_of(scene)),
        barriers=heights,
        twisting=twisted.barriers,
        saddle=across[0].saddle if across else None,
        saddles=tuple(one.saddle for one in found),
        way=way,
        why=why,
        status="interrupted" if run.pressed else "done" if twisted.rests else "not converged",
        extrapolated={},
        timing=SolveTime(time.perf_counter() - started),
        shapes=shapes,
    )


class Twisted(NamedTuple):
    """Equilibria without load on the path of twisting, and the same ones without grips."""

    rests: list[Rest]
    free: list[FreeRing]
    barriers: Barriers
    why: str  # why the path does not reach the folded ring; "" if it does

    @property
    def ends(self) -> dict[str, float]:
        """Energies of the flat and of the folded ring."""
        return {"flat": self.rests[0].energy, "folded": self.rests[-1].energy}

    @property
    def no_well(self) -> str:
        """Why the free folded ring is no well; "" if it is."""
        if self.why or self.rests[-1].index_free == 0:
            return self.why
        index = self.rests[-1].index_free
        known = "unknown" if index is None else index
        return f"the free folded ring is no well; its index is {known}"


def twisted_states(scene: Scene) -> Twisted:
    """Return the equilibria without load on the path of twisting, from flat to folded."""
    ring, full = ring_of(scene), ring_of(scene, "full")
    request, statistics = bare_request(scene), Statistics()
    try:
        points = list(request.follow(ring, statistics))
        points, at = with_rests(ring, request, points, statistics)
    except ContinuationFailed as failed:
        return Twisted([], [], barriers((), folded=False, message=str(failed)), str(failed))
    folded = ring.folded(points[-1].solution.state)
    exact = replace(request, stability=True)
    rests = [rest_of(ring, full, exact.point(ring, points[k].solution), k) for k in at]
    free = [released(ring, full, points[k].solution.state) for k in at]
    twisting = barriers(rests, folded=folded)
    return Twisted(rests, free, twisting, "" if folded else twisting.why["fold"])


def _passes(twisted: Twisted, run: Run) -> list[_Found]:
    """Saddles of index 1 from all initial guesses, each once, lowest first."""
    found: list[_Found] = []
    alike = ALIKE * abs(twisted.ends["folded"])
    for candidate, of_twisting in _candidates(twisted):
        if run.pressed:
            break
        energy = candidate.polished().energy
        if not any(abs(one.saddle.energy - energy) < alike for one in found):
            found.append(_described(candidate, energy, twisted.ends, twisted=of_twisting))
    return sorted(found, key=lambda one: one.saddle.energy)


def _candidates(twisted: Twisted) -> Iterator[tuple[FreeRing, bool]]:
    """Saddles of index 1, polished, and whether each is that of twisting."""
    end, saddle = twisted.free[-1], twisted.barriers.saddle
    start = end if saddle is None else twisted.free[saddle]
    if start.index() == 1:
        yield start, True
    else:
        for along, down in permutations(downhill_modes(start), 2):
            for sign in (1.0, -1.0):
                reached = climb(start, along, kick=_along(start, sign * down, _KICK))
                if reached is not None and reached.is_saddle:
                    yield reached.free, False
                    break  # of two that mirror each other one is enough
    _, soft = end.system.softest_modes(end.state, _SOFTEST)
    for mode in soft:
        reached = climb(end, mode, kick=_along(end, mode, _KICK))
        if reached is not None and reached.is_saddle:
            yield reached.free, False


def _along(free: FreeRing, mode: Array, size: float) -> Array:
    """Displacement by ``size``, root mean square, along a mode of unit norm in the lengths."""
    return size * math.sqrt(float(free.rod.length.sum())) * mode


def _described(free: FreeRing, energy: float, ends: dict[str, float], *, twisted: bool) -> _Found:
    """The record of a saddle, and the flows down its two sides."""
    values, modes = free.system.softest_modes(free.state, 3)
    down = int(np.argmin(values))
    sides = tuple(
        flow(
            free.unpinned,
            free.state,
            kick=free.unpinned.increment(_along(free, sign * modes[down], _NUDGE)),
            tolerance=1e-7,
            every=1,
        )
        for sign in (1.0, -1.0)
    )
    names = tuple(name_of_rest(side, ends) for side in sides)
    known = (energy, free.index(), free.residual, free.zero_modes)
    return _Found(Saddle(*known, twisted, names, float(values[down])), free, sides)


def name_of_rest(side: EndState, ends: Mapping[str, float]) -> str:
    """Name of the state in which a flow ends."""
    if not side.rests:
        return "nowhere"
    alike = ALIKE * abs(ends["folded"])
    for name, energy in ends.items():
        if abs(side.energy - energy) < alike:
            return name
    return f"another rest, U = {side.energy:.6g}"


def _path_over(best: _Found) -> tuple[Array, Array]:
    """Progress and energy from flat over the saddle to folded, and shapes on the path."""
    flat, folded = best.sides if best.saddle.ends[0] == "flat" else best.sides[::-1]
    states: list[State] = [*flat.history[::-1], best.free.state, *folded.history]
    energies = np.concatenate([flat.energies[::-1], [best.saddle.energy], folded.energies])
    mass = best.free.rod.mass
    steps = [
        float(np.sqrt(np.sum(mass * rotation_vector(a.quat, b.quat) ** 2)))
        for a, b in pairwise(states)
    ]
    progress = np.append(0.0, np.cumsum(steps))
    chosen = np.unique(np.searchsorted(progress, np.linspace(0.0, progress[-1], _SHAPES)))
    length = best.free.rod.length
    x = [vertices(states[k].quat, length * (1.0 + states[k].stretch)) for k in chosen]
    return np.column_stack([progress, energies]), np.array(x)
