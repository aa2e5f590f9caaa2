"""The barrier of a ring left alone in space: the lowest way found from flat to folded.

It starts from what twisting knows. Rests of the twisted ring are equilibria of the ring left alone
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

from der.analysis.landscape.landscape import FARTHEST, barriers, numerics, rest_of, scene_sector
from der.analysis.landscape.rest_states import with_rests
from der.analysis.landscape.saddle_search import climb, downhill_modes
from der.continuation.arclength import follow
from der.continuation.events import Visit, Wanted, three_covered, visit
from der.continuation.richardson import extrapolated
from der.continuation.step import Stuck, Tally
from der.kernels.linking import vertices
from der.kernels.quaternions import Array, rotation_vector
from der.records.landscape import Barriers, Heights, Pass, Rest, Saddle
from der.records.record import SolveTime
from der.rod.equilibrium import Direction
from der.rod.falls import Fallen
from der.rod.free_ring import Alone, left_alone
from der.rod.gradient_flow import flow
from der.rod.rod import State
from der.rod.stability import all_modes, softest_modes
from der.scene import Scene, meshes
from der.utils.interrupts import interrupts_between_states

_KICK = 0.05  # rad, root mean square: off a saddle of higher index, along a mode that leads down
_NUDGE = 0.02  # rad, likewise: off a saddle of index 1, on to one of its two sides
_SOFTEST = 2  # modes of the folded ring that are followed uphill
ALIKE = 1e-6  # of the folded ring's energy: two saddles, or rests, that are one
_SHAPES = 60  # on the way, about equally far apart


@dataclass(frozen=True)
class _Found:
    """A saddle of index 1 and the flows down its two sides."""

    saddle: Saddle
    alone: Alone
    sides: tuple[Fallen, ...]


def barrier(scene: Scene) -> Pass:
    """The lowest way found between the flat and the folded ring, left alone in space.

    Parameters
    ----------
    scene : ring, section and mesh; how it is controlled does not matter.

    Notes
    -----
    Where there is none, ``why`` says so in a sentence. With the scene's ``error_bars`` its barriers
    are extrapolated, too. Ctrl-C keeps the saddles found so far.
    """
    with interrupts_between_states() as pressed:
        one = _pass(scene, pressed)
        if scene.error_bars and one.fold is not None:
            coarser = meshes(scene.n_edges, str(one.numerics["sector"]))[1:]
            coarse = [_pass(replace(scene, n_edges=n, error_bars=False), pressed) for n in coarser]
            if not pressed:
                heights = [{"fold": level.fold, "open": level.open} for level in (one, *coarse)]
                one = replace(one, extrapolated=extrapolated(heights))
    return one


def _pass(scene: Scene, pressed: list[int]) -> Pass:
    """The lowest way found on one mesh."""
    started = time.perf_counter()
    rests, alone, twisting, why = twisted_rests(scene)
    found: list[_Found] = []
    if not why:
        end = rests[-1]
        ends = {"flat": rests[0].energy, "folded": end.energy}
        if end.index_free != 0:
            ways = "unknown" if end.index_free is None else str(end.index_free)
            why = f"left alone the folded ring is no well; ways down: {ways}"
        else:
            found = _passes(rests, alone, twisting, ends, pressed)
    across = [one for one in found if set(one.saddle.ends) == {"flat", "folded"}]
    if pressed and not why:
        why = "stopped by the user before all saddles were looked for"
    if not why and not across:
        why = "no saddle was found between the flat and the folded ring"
    piece = scene_sector(scene, scene.sector)
    best = across[0] if across else None
    heights = (
        (None, None)
        if best is None
        else (best.saddle.energy - rests[0].energy, best.saddle.energy - rests[-1].energy)
    )
    way, shapes = _way(best) if best is not None else (np.zeros((0, 2)), np.zeros((0, 0, 3)))
    return Pass(
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=numerics(scene, piece),
        barriers=Heights(*heights),
        twisting=twisting,
        saddle=None if best is None else best.saddle,
        saddles=tuple(one.saddle for one in found),
        way=way,
        why=why,
        status="interrupted" if pressed else "done" if rests else "not converged",
        extrapolated={},
        timing=SolveTime(time.perf_counter() - started),
        shapes=shapes,
    )


def twisted_rests(scene: Scene) -> tuple[list[Rest], list[Alone], Barriers, str]:
    """Rests on the path of twisting, the same without grips, and why there is no pass."""
    piece, whole = scene_sector(scene, scene.sector), scene_sector(scene, "full")
    wanted = Wanted(
        load_max=FARTHEST,
        until_folded=True,
        stability=False,
        contacts=False,
        tolerance=scene.tolerance,
        most_steps=600,
    )
    tally, message = Tally(), ""
    visits: list[Visit] = []
    try:
        visits.extend(follow(piece, wanted, tally))
        visits, at = with_rests(piece, wanted, visits, tally)
    except Stuck as stuck:
        return [], [], barriers((), folded=False, message=str(stuck)), str(stuck)
    folded = three_covered(piece, visits[-1].at)
    exact = Wanted(contacts=False, tolerance=scene.tolerance)
    rests = [rest_of(piece, whole, visit(piece, exact, visits[k].at), k) for k in at]
    alone = [left_alone(piece, whole, visits[k].at.state) for k in at]
    twisting = barriers(rests, folded=folded)
    if not folded:
        message = twisting.why["fold"]
    return rests, alone, twisting, message


def _passes(
    rests: list[Rest],
    alone: list[Alone],
    twisting: Barriers,
    ends: dict[str, float],
    pressed: list[int],
) -> list[_Found]:
    """Saddles of index 1 from all starts, each once, lowest first."""
    found: list[_Found] = []
    alike = ALIKE * abs(ends["folded"])
    for candidate, twisted in _candidates(rests, alone, twisting):
        if pressed:
            break
        energy = _energy(candidate)
        if any(abs(one.saddle.energy - energy) < alike for one in found):
            continue
        found.append(_described(candidate, energy, ends, twisted=twisted))
    return sorted(found, key=lambda one: one.saddle.energy)


def _candidates(
    rests: list[Rest], alone: list[Alone], twisting: Barriers
) -> Iterator[tuple[Alone, bool]]:
    """Saddles of index 1, polished, and whether each is that of twisting."""
    start = alone[-1]
    if twisting.saddle is not None:
        start = alone[twisting.saddle]
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
                        yield reached.alone, False
                        break  # of two that mirror each other one is enough
    end = alone[-1]
    held = end.pinned()
    _, soft = softest_modes(end.body, held, all_modes(held), end.state, _SOFTEST)
    for mode in soft:
        reached = climb(end, mode, kick=_along(end, mode, _KICK))
        if reached is not None and reached.is_saddle:
            yield reached.alone, False


def _along(alone: Alone, mode: Array, size: float) -> Array:
    """Displacement by ``size``, root mean square, along a mode of unit norm in the lengths."""
    return size * math.sqrt(float(alone.body.length.sum())) * mode


def _energy(alone: Alone) -> float:
    return alone.polished().energy


def _described(alone: Alone, energy: float, ends: dict[str, float], *, twisted: bool) -> _Found:
    """A saddle with what can be said about it, after going down both sides."""
    held = alone.pinned()
    values, modes = softest_modes(alone.body, held, all_modes(held), alone.state, 3)
    down = int(np.argmin(values))
    sides = tuple(
        flow(
            alone.body,
            alone.held,
            alone.state,
            kick=Direction(_along(alone, sign * modes[down], _NUDGE), np.zeros(3), 0.0),
            tolerance=1e-7,
            every=1,
        )
        for sign in (1.0, -1.0)
    )
    names = tuple(name_of_rest(side, ends) for side in sides)
    saddle = Saddle(
        energy,
        alone.index(),
        alone.residual,
        alone.zero_modes,
        twisted,
        names,
        float(values[down]),
    )
    return _Found(saddle, alone, sides)


def name_of_rest(side: Fallen, ends: Mapping[str, float]) -> str:
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
    states: list[State] = [*flat.history[::-1], best.alone.state, *folded.history]
    energies = np.concatenate([flat.energies[::-1], [best.saddle.energy], folded.energies])
    mass = best.alone.body.mass
    steps = [
        float(np.sqrt(np.sum(mass * rotation_vector(a.quat, b.quat) ** 2)))
        for a, b in pairwise(states)
    ]
    progress = np.append(0.0, np.cumsum(steps))
    chosen = np.unique(np.searchsorted(progress, np.linspace(0.0, progress[-1], _SHAPES)))
    length = best.alone.body.length
    x = [vertices(states[k].quat, length * (1.0 + states[k].stretch)) for k in chosen]
    return np.column_stack([progress, energies]), np.array(x)
