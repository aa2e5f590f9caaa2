"""The barrier of a ring left free in space: the lowest way found from flat to folded.

It starts from what twisting knows. Rests of the twisted ring are equilibria of the ring left free
(`landscape_alone`), so its saddle is one of the free ring's: where it has one way down, it is the
pass itself; where it has more, modes that break the symmetry of twisting lead down to lower
saddles, and eigenvector following (`landscape_saddles`) finds them. So do the softest modes of the
folded ring, uphill. From every saddle of index 1 the ring then flows down on both sides; the pass
is the lowest that has the flat ring on one side and the folded one on the other, and the two flows
are the minimum-energy path. That no lower saddle exists is not proved, only looked for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import pairwise

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

_KICK = 0.05  # rad, root mean square: off a saddle of higher index, along a mode that leads down
_NUDGE = 0.02  # rad, likewise: off a saddle of index 1, on to one of its two sides
_SOFTEST = 2  # modes of the folded ring that are followed uphill
ALIKE = 1e-6  # of the folded ring's energy: two saddles, or rests, that are one
_SHAPES = 60  # on the way, about equally far apart


@dataclass(frozen=True)
class _Found:
    """A saddle of index 1 and the flows down its two sides."""

    saddle: Saddle
    free: FreeRing
    sides: tuple[EndState, ...]


def barrier(scene: Scene) -> Pass:
    """The lowest way found between the flat and the folded ring, left free in space.

    Parameters
    ----------
    scene : ring, section and mesh; how it is controlled does not matter.

    Notes
    -----
    Where there is none, ``why`` says so in a sentence. With the scene's ``error_bars`` its barriers
    are extrapolated, too. Ctrl-C keeps the saddles found so far.
    """
    with Run() as run:
        one = _pass(scene, run)
        if scene.error_bars and one.fold is not None:
            coarser = meshes(scene.n_edges, str(one.numerics["sector"]))[1:]
            coarse = [_pass(replace(scene, n_edges=n, error_bars=False), run) for n in coarser]
            if not run.pressed:
                heights = [{"fold": level.fold, "open": level.open} for level in (one, *coarse)]
                one = replace(one, extrapolated=limits(heights))
    return one


def _pass(scene: Scene, run: Run) -> Pass:
    """The lowest way found on one mesh."""
    started = time.perf_counter()
    rests, free, twisting, why = twisted_rests(scene)
    found: list[_Found] = []
    if not why:
        end = rests[-1]
        ends = {"flat": rests[0].energy, "folded": end.energy}
        if end.index_free != 0:
            index = "unknown" if end.index_free is None else str(end.index_free)
            why = f"the free folded ring is no well; its index is {index}"
        else:
            found = _passes(rests, free, twisting, ends, run)
    across = [one for one in found if set(one.saddle.ends) == {"flat", "folded"}]
    if run.pressed and not why:
        why = "stopped by the user before all saddles were looked for"
    if not why and not across:
        why = "no saddle was found between the flat and the folded ring"
    ring = ring_of(scene)
    best = across[0] if across else None
    way, shapes = _way(best) if best is not None else (np.zeros((0, 2)), np.zeros((0, 0, 3)))
    heights = (
        (None, None)
        if best is None
        else (best.saddle.energy - rests[0].energy, best.saddle.energy - rests[-1].energy)
    )
    return Pass(
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=mesh_numerics(scene, ring),
        barriers=Heights(*heights),
        twisting=twisting,
        saddle=None if best is None else best.saddle,
        saddles=tuple(one.saddle for one in found),
        way=way,
        why=why,
        status="interrupted" if run.pressed else "done" if rests else "not converged",
        extrapolated={},
        timing=SolveTime(time.perf_counter() - started),
        shapes=shapes,
    )


def twisted_rests(scene: Scene) -> tuple[list[Rest], list[FreeRing], Barriers, str]:
    """Rests on the path of twisting, the same without grips, and why there is no pass."""
    ring, full = ring_of(scene), ring_of(scene, "full")
    request, statistics = bare_request(scene), Statistics()
    try:
        points = list(request.follow(ring, statistics))
        points, at = with_rests(ring, request, points, statistics)
    except ContinuationFailed as failed:
        return [], [], barriers((), folded=False, message=str(failed)), str(failed)
    folded = ring.folded(points[-1].solution.state)
    exact = replace(request, stability=True)
    rests = [rest_of(ring, full, exact.point(ring, points[k].solution), k) for k in at]
    free = [released(ring, full, points[k].solution.state) for k in at]
    twisting = barriers(rests, folded=folded)
    return rests, free, twisting, "" if folded else twisting.why["fold"]


def _passes(
    rests: list[Rest],
    free: list[FreeRing],
    twisting: Barriers,
    ends: dict[str, float],
    run: Run,
) -> list[_Found]:
    """Saddles of index 1 from all starts, each once, lowest first."""
    found: list[_Found] = []
    alike = ALIKE * abs(ends["folded"])
    for candidate, twisted in _candidates(rests, free, twisting):
        if run.pressed:
            break
        energy = _energy(candidate)
        if any(abs(one.saddle.energy - energy) < alike for one in found):
            continue
        found.append(_described(candidate, energy, ends, twisted=twisted))
    return sorted(found, key=lambda one: one.saddle.energy)


def _candidates(
    rests: list[Rest], free: list[FreeRing], twisting: Barriers
) -> Iterator[tuple[FreeRing, bool]]:
    """Saddles of index 1, polished, and whether each is that of twisting."""
    start = free[-1]
    if twisting.saddle is not None:
        start = free[twisting.saddle]
    if start.index() == 1:
        yield start, True
    else:
        modes = downhill_modes(start)
        for along in modes:
            for down in modes:
                if down is along:
                    continue
                for sign in (1.0, -1.0):
                    reached = climb(start, along, kick=_along(start, sign * down, _KICK))
                    if reached is not None and reached.is_saddle:
                        yield reached.free, False
                        break  # of two that mirror each other one is enough
    end = free[-1]
    _, soft = end.system.softest_modes(end.state, _SOFTEST)
    for mode in soft:
        reached = climb(end, mode, kick=_along(end, mode, _KICK))
        if reached is not None and reached.is_saddle:
            yield reached.free, False


def _along(free: FreeRing, mode: Array, size: float) -> Array:
    """Displacement by ``size``, root mean square, along a mode of unit norm in the lengths."""
    return size * math.sqrt(float(free.rod.length.sum())) * mode


def _energy(free: FreeRing) -> float:
    return free.polished().energy


def _described(free: FreeRing, energy: float, ends: dict[str, float], *, twisted: bool) -> _Found:
    """A saddle with what can be said about it, after going down both sides."""
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
    saddle = Saddle(
        energy,
        free.index(),
        free.residual,
        free.zero_modes,
        twisted,
        names,
        float(values[down]),
    )
    return _Found(saddle, free, sides)


def name_of_rest(side: EndState, ends: Mapping[str, float]) -> str:
    """Which rest a flow has come to."""
    if not side.rests:
        return "nowhere"
    alike = ALIKE * abs(ends["folded"])
    for name, energy in ends.items():
        if abs(side.energy - energy) < alike:
            return name
    return f"another rest, U = {side.energy:.6g}"


def _way(best: _Found) -> tuple[Array, Array]:
    """Progress and energy from flat over the saddle to folded, and shapes on the way."""
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
