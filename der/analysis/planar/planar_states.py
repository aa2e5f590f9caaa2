"""The planar states of a ring: circles covered several times, figure eights, the folded shape.

One unknown an edge, so that all of them take milliseconds. Sought are states symmetric about the
twisting axis: the ring bent evenly, which solves rings of D2 symmetry at once and is where Newton
starts with others, and what comes of circle and eight as the circle's natural curvature is changed
into the ring's own. On that way rings with sharp corners have several branches; one that
equilateral triangles share, and their neighbours do not, is entered from either side with an
imperfection that ends with the way.

How stable a state is counts in its plane only; `states` knows of space.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np

from der.continuation.arclength import follow
from der.continuation.events import Events
from der.continuation.richardson import limit
from der.errors import ContinuationFailed, Reason
from der.kernels.planar import Array
from der.problem import Options
from der.records.planar import FOLDED, PlanarState, PlanarStates
from der.records.record import SolveTime
from der.rod.planar_ring import PlanarRing, covered, eight, planar_ring, shapes, shifted
from der.rod.planar_system import (
    PlanarConfiguration,
    PlanarEquilibrium,
    PlanarRodSystem,
    solved,
)
from der.scene import Scene, meshes, sector_name
from der.utils.checks import shown
from der.utils.run import Run

MOST = 12  # turns
_TURNS = 3
_EDGES_A_TURN = 8  # at least
_IMPERFECTION = 1.0  # rad, of one wave on the ring, on the way to it
# other branches may lie close by: steps no longer than these
_OPTIONS = Options(first_step=0.02, largest_step=0.12, sharpest_turn=0.45)
_ALIKE = 1e-7  # of the energies of two states that are one
_COSTLESS = 1e-6  # of EI1 (2 pi/L)^2: stiffness of a motion that costs nothing


@dataclass(frozen=True, eq=False)
class Found:
    """A planar state on its mesh."""

    turning: int
    at: PlanarEquilibrium
    pin: Array | None  # the shift of the material, where it costs nothing


def planar(scene: Scene, *, turns: int | None = None) -> PlanarStates:
    """The planar states of a ring left alone, symmetric about its twisting axis.

    Parameters
    ----------
    scene : ring, section and mesh, and whether error bars are wanted; how it is controlled does not
        matter. Only alpha of the section enters, as a factor of energies and forces.
    turns : covered circles are sought up to so many turns, either way round; None: 3, or as many as
        the bar would like to.

    Returns
    -------
    PlanarStates
        Lowest first, with shapes. The folded shape's packing ratio is among them. Ctrl-C keeps
        those found so far.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed.
    """
    most = check_planar(scene, turns)
    mesh = planar_ring(scene)
    both_ways = [k for t in range(most + 1) for k in dict.fromkeys((t, -t))]
    # of a naturally straight ring those that turn the other way are mirror images
    turnings = [k for k in both_ways if k >= 0 or scene.ring.natural_ratio != 0.0]
    with Run() as run:
        each = run.collect(states_of_turning(mesh, k, scene.tolerance) for k in turnings)
        found = sorted((one for several in each for one in several), key=lambda one: one.at.energy)
        rows, kept = _distinct([_described(scene, mesh, one) for one in found])
        if not found and run.done:
            run.stop(Reason.NO_START, "no state was found from any start; use more edges")
    return PlanarStates(
        status=run.status,
        message=run.message,
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics=planar_numerics(scene),
        states=named(rows),
        timing=SolveTime(run.seconds),
        shapes=shapes(mesh, [found[k].at.phi for k in kept]) if found else None,
    )


def check_planar(scene: Scene, turns: int | None = None) -> int:
    """The turns to go to; ValueError, naming the argument, where a scene is not one in a plane."""
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a der.Scene, got {shown(scene)}")
    if scene.stretch != "inextensible":
        raise ValueError(f"stretch must be 'inextensible' in a plane, got {scene.stretch!r}")
    if scene.curvature != "logarithm":
        raise ValueError(f"curvature must be 'logarithm' in a plane, got {scene.curvature!r}")
    most = min(MOST, scene.n_edges // _EDGES_A_TURN)
    if turns is None:
        return min(max(_TURNS, math.ceil(abs(scene.ring.natural_ratio))), most)
    if isinstance(turns, bool) or not isinstance(turns, int) or not 1 <= turns <= most:
        raise ValueError(
            f"turns must be an integer from 1 to {most} on {scene.n_edges} edges, "
            f"got {shown(turns)}"
        )
    return turns


def planar_numerics(scene: Scene) -> dict[str, object]:
    """The numerical choices behind an answer, as they are written."""
    return {
        "n_edges": scene.n_edges,
        "unknowns_per_edge": 1,
        "error_bars": scene.error_bars,
        "tolerance": scene.tolerance,
    }


def coarser(scene: Scene) -> list[PlanarRing]:
    """The ring on N/2 and N/4 edges, where error bars are wanted."""
    if not scene.error_bars:
        return []
    levels = meshes(scene.n_edges, sector_name(scene.ring, "auto", scene.n_edges))
    return [planar_ring(scene, n) for n in levels[1:]]


# --- Search ----------------------------------------------------------------------------------


def states_of_turning(mesh: PlanarRing, turning: int, tolerance: float) -> list[Found]:
    """States that turn so many times, each once, lowest first."""
    found: list[Found] = []
    for one in _eights(mesh, tolerance) if turning == 0 else _covered(mesh, turning, tolerance):
        alike = _ALIKE * max(abs(one.at.energy), 1.0)
        if not any(abs(other.at.energy - one.at.energy) < alike for other in found):
            found.append(one)
    return sorted(found, key=lambda one: one.at.energy)


def _covered(mesh: PlanarRing, turning: int, tolerance: float) -> Iterator[Found]:
    """What is found from circles."""
    at = solved(mesh.rod(turning), covered(mesh, turning), np.zeros(2), tolerance=tolerance)
    if at.converged:
        yield Found(turning, at, None)
        if np.hypot(*at.force) <= _COSTLESS:
            return  # bent evenly: no shape of this turning has less energy
    turn = 2.0 * math.pi * mesh.share
    bumps = [np.sin(turn)]  # symmetric about the twisting axis, and about the other one
    if mesh.ring.symmetry == "D2":
        bumps.append(np.cos(turn) - 1.0)
    for bump in [sign * _IMPERFECTION * one for one in bumps for sign in (1.0, -1.0)]:
        natural = float(mesh.rest.sum()) * mesh.share + bump
        start = covered(mesh, turning) - mesh.natural + natural
        end = _led(mesh, turning, natural, start, None, tolerance)
        if end is not None:
            yield Found(turning, end, None)


def _eights(mesh: PlanarRing, tolerance: float) -> Iterator[Found]:
    """What is found from the two symmetric figure eights."""
    for shift in (0.0, 0.25):
        phi = eight(mesh, shift)
        pin = shifted(mesh, phi)
        if mesh.uniform:
            at = solved(mesh.rod(0), phi, np.zeros(2), pin=pin, tolerance=tolerance)
            if at.converged:
                yield Found(0, at, pin)
                return  # the other is the same, shifted
        end = _led(mesh, 0, float(mesh.rest.sum()) * mesh.share, phi, pin, tolerance)
        if end is not None:
            yield Found(0, end, None)


def _led(
    mesh: PlanarRing, turning: int, natural: Array, phi: Array, pin: Array | None, tolerance: float
) -> PlanarEquilibrium | None:
    """The state that one of a ring of these natural angles becomes in this ring; None: none."""
    turn = float(mesh.rest.sum())
    begin = np.diff(np.append(natural, natural[0] + turn))
    rod = mesh.rod(turning, begin, mesh.rest - begin)
    system = PlanarRodSystem(rod, pin)
    start = solved(rod, phi, np.zeros(2), 0.0, pin=pin, tolerance=tolerance)
    if not start.converged:
        return None
    events: Events[PlanarConfiguration] = Events(
        targets=(1.0,), stop=lambda at: at.parameter == 1.0
    )
    options = replace(_OPTIONS, tolerance=tolerance)
    try:
        *_, last = follow(system, start.state, events, options=options)
    except ContinuationFailed:
        return None
    phi, force, _ = last.solution.state
    end = solved(mesh.rod(turning), phi, force, pin=pin, tolerance=tolerance)
    return end if end.converged else None


# --- What is said about a state --------------------------------------------------------------


def _described(scene: Scene, mesh: PlanarRing, one: Found) -> PlanarState:
    """The record of a state, without a name, extrapolated where error bars are wanted."""
    levels = [(mesh, one.at)]
    for coarse in coarser(scene):
        at = _on_coarser(coarse, one, mesh, scene.tolerance)
        if at is not None:
            levels.append((coarse, at))
    packings: list[float] = []
    polygons = 0.0
    if one.turning == FOLDED:
        for level, at in levels:
            value, error = packing_ratio_of(level, at.phi, one.turning)
            packings.append(value)
            polygons = max(polygons, error)
    alpha = scene.section.alpha
    energy, energy_error = _sure([alpha * at.energy for _, at in levels])
    force, _ = _sure([alpha * float(np.hypot(*at.force)) for _, at in levels])
    packing, packing_error = _sure(packings) if packings else (None, None)
    index, costless = _index(mesh, one)
    return PlanarState(
        "",
        one.turning,
        energy,
        energy_error,
        index,
        costless,
        max(force, 0.0),
        packing,
        None if packing_error is None else packing_error + polygons,
        alpha * one.at.residual,
    )


def packing_ratio_of(mesh: PlanarRing, phi: Array, turning: int) -> tuple[float, float]:
    """`planar_area.packing_ratio`, imported where it is asked for."""
    from der.analysis.planar.area import packing_ratio

    return packing_ratio(mesh, phi, turning)


def _on_coarser(
    coarse: PlanarRing, one: Found, fine: PlanarRing, tolerance: float
) -> PlanarEquilibrium | None:
    """The same state on a mesh of every second edge, or fourth; None: there is none."""
    every = fine.n_edges // coarse.n_edges
    pin = None if one.pin is None else one.pin[::every]
    at = solved(
        coarse.rod(one.turning), one.at.phi[::every], one.at.force, pin=pin, tolerance=tolerance
    )
    return at if at.converged else None


def _sure(levels: list[float]) -> tuple[float, float | None]:
    """Extrapolated value and error, where all three meshes have one."""
    if len(levels) < 3:
        return levels[0], None
    return limit(*levels)


def _index(mesh: PlanarRing, one: Found) -> tuple[int | None, int]:
    """Ways down in the plane, and motions that cost nothing."""
    system, at = PlanarRodSystem(mesh.rod(one.turning)), one.at
    small = _COSTLESS * (2.0 * math.pi / mesh.ring.length) ** 2
    up, down = (system.negative(at.state, shift) for shift in (small, -small))
    if up < 0 or down < 0:
        return None, 0
    return up - len(at.force), down - up


def _distinct(rows: list[PlanarState]) -> tuple[list[PlanarState], list[int]]:
    """States that are not, within their errors, images of one before, and where they stand.

    A square ring's own symmetry maps states on others, but not the mesh.
    """
    kept: list[int] = []
    for k, row in enumerate(rows):
        if not any(_same(row, rows[j]) for j in kept):
            kept.append(k)
    return [rows[k] for k in kept], kept


def _same(a: PlanarState, b: PlanarState) -> bool:
    if (a.turning, a.index) != (b.turning, b.index) or not a.energy_error or not b.energy_error:
        return False
    return abs(a.energy - b.energy) <= a.energy_error + b.energy_error


def named(rows: list[PlanarState]) -> tuple[PlanarState, ...]:
    """The states, lowest first, with names: numbered where several turn alike."""
    rows = sorted(rows, key=lambda one: one.energy)
    total, seen = Counter(row.turning for row in rows), Counter[int]()
    found = []
    for row in rows:
        seen[row.turning] += 1
        number = f" {seen[row.turning]}" if total[row.turning] > 1 else ""
        found.append(replace(row, name=f"{_word(row.turning)}{number}"))
    return tuple(found)


def _word(turning: int) -> str:
    """What a state of so many turns is called."""
    number = {2: "two", 3: "three", 4: "four", 5: "five"}.get(abs(turning), str(abs(turning)))
    word = "flat" if abs(turning) == 1 else f"{number}-covered"
    if turning == 0:
        return "figure eight"
    if turning < 0:
        return "flipped" if turning == -1 else f"{word}, flipped"
    return word
