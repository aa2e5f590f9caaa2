"""The planar states of a ring: circles covered several times, figure eights, the folded shape.

There is one unknown for each edge, so a search takes milliseconds. It finds states symmetric about
the twisting axis. One is the ring bent uniformly: for rings of D2 symmetry it is a solution, for
others an initial guess. The others are reached from circle and figure eight when the natural
curvature of the circle is changed step by step into the ring's own. On this path rings with sharp
corners have several branches. One branch exists for equilateral triangles, but not for their
neighbours; it is reached from both sides with an imperfection that vanishes at the end of the path.

The index is that in the plane; for modes in space see `multistability.states`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from der.analysis.run_record import run_entries
from der.analysis.state_names import numbered, planar_name
from der.continuation.arclength import follow
from der.continuation.events import Events
from der.continuation.richardson import limit
from der.errors import ContinuationFailed, Reason
from der.geometry.section import section
from der.geometry.shapes import circle
from der.kernels.planar import Array
from der.problem import Options
from der.records.planar import FOLDED, PlanarState, PlanarStates
from der.rod.planar_ring import PlanarRing, covered, eight, planar_ring, shapes, shifted
from der.rod.planar_system import PlanarConfiguration, PlanarEquilibrium, PlanarRodSystem, solved
from der.scene import Scene, meshes, sector_name
from der.utils.checks import shown
from der.utils.run import Run

MOST = 12  # turns
_TURNS = 3
_EDGES_A_TURN = 8  # at least
_IMPERFECTION = 1.0  # rad, of one wave on the ring, at the start of the path
# steps are short, because other branches may be close
OPTIONS = Options(first_step=0.02, largest_step=0.12, sharpest_turn=0.45)
_ALIKE = 1e-7  # of the energies of two states that are one
_COSTLESS = 1e-6  # of EI1 (2 pi/L)^2: stiffness of a motion without energy


@dataclass(frozen=True, eq=False)
class Found:
    """A planar state on its mesh."""

    turning: int
    at: PlanarEquilibrium
    pin: Array | None  # the shift of the material, if it needs no energy


def planar(scene: Scene, *, turns: int | None = None) -> PlanarStates:
    """Return the planar states of a free ring that are symmetric about its twisting axis.

    Parameters
    ----------
    scene : ring, section and mesh, and whether error bars are wanted; its control does not matter.
        Only alpha of the section enters, as a factor of energies and forces.
    turns : largest number of turns of covered circles, in both senses; None: 3, or as many as the
        natural curvature has.

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
    both_senses = [k for t in range(most + 1) for k in dict.fromkeys((t, -t))]
    # of a naturally straight ring those of negative turning number are mirror images
    turnings = [k for k in both_senses if k >= 0 or scene.ring.natural_ratio != 0.0]
    with Run() as run:
        each = run.collect(states_of_turning(mesh, k, scene.tolerance) for k in turnings)
        found = sorted((one for several in each for one in several), key=lambda one: one.at.energy)
        rows, kept = _distinct([_described(scene, mesh, one) for one in found])
        if not found and run.done:
            run.stop(Reason.NO_START, "no state was found from any start; use more edges")
    return PlanarStates(
        **run_entries(scene, run),
        numerics=planar_numerics(scene),
        states=named(rows),
        shapes=shapes(mesh, [found[k].at.phi for k in kept]) if found else None,
    )


def check_planar(scene: Scene, turns: int | None = None) -> int:
    """Return the largest number of turns; ValueError, naming the argument, for a wrong scene."""
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
    """Return the numerical choices behind an answer, as they are recorded."""
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
    """States of one turning number, each once, lowest first."""
    found: list[Found] = []
    for one in _eights(mesh, tolerance) if turning == 0 else _covered(mesh, turning, tolerance):
        alike = _ALIKE * max(abs(one.at.energy), 1.0)
        if not any(abs(other.at.energy - one.at.energy) < alike for other in found):
            found.append(one)
    return sorted(found, key=lambda one: one.at.energy)


def _covered(mesh: PlanarRing, turning: int, tolerance: float) -> Iterator[Found]:
    """States found from circles."""
    at = solved(mesh.rod(turning), covered(mesh, turning), np.zeros(2), tolerance=tolerance)
    if at.converged:
        yield Found(turning, at, None)
        if np.hypot(*at.force) <= _COSTLESS:
            return  # bent uniformly: no shape of this turning number has less energy
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
    """States found from the two symmetric figure eights."""
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
    """The state of this ring reached from one of a ring of these natural angles; None: none."""
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
    options = replace(OPTIONS, tolerance=tolerance)
    try:
        *_, last = follow(system, start.state, events, options=options)
    except ContinuationFailed:
        return None
    phi, force, _ = last.solution.state
    end = solved(mesh.rod(turning), phi, force, pin=pin, tolerance=tolerance)
    return end if end.converged else None


# --- The record of a state -------------------------------------------------------------------


def _described(scene: Scene, mesh: PlanarRing, one: Found) -> PlanarState:
    """The record of a state, without a name, extrapolated where error bars are wanted."""
    levels = [(mesh, one.at)]
    for coarse in coarser(scene):
        at = _on_coarser(coarse, one, mesh, scene.tolerance)
        if at is not None:
            levels.append((coarse, at))
    alpha = scene.section.alpha
    values = {
        "energy": [alpha * at.energy for _, at in levels],
        "force": [alpha * float(np.hypot(*at.force)) for _, at in levels],
    }
    inexact = 0.0
    if one.turning == FOLDED:
        from der.analysis.planar.area import packing_ratio  # which takes long to load

        ratios = [packing_ratio(level, at.phi, one.turning) for level, at in levels]
        values["packing"] = [value for value, _ in ratios]
        inexact = max(error for _, error in ratios)
    sure = _extrapolated(values, even=not any(level.kinks_in_cells for level, _ in levels))
    packing, packing_error = sure.get("packing", (None, None))
    if packing_error is not None:
        packing_error += inexact
    index, force, residual = _index(mesh, one), max(sure["force"][0], 0.0), alpha * one.at.residual
    return PlanarState(
        "", one.turning, *sure["energy"], *index, force, packing, packing_error, residual
    )


def _on_coarser(
    coarse: PlanarRing, one: Found, fine: PlanarRing, tolerance: float
) -> PlanarEquilibrium | None:
    """The same state on a mesh with half or a quarter of the edges; None: there is none."""
    every = fine.n_edges // coarse.n_edges
    pin = None if one.pin is None else one.pin[::every]
    at = solved(
        coarse.rod(one.turning), one.at.phi[::every], one.at.force, pin=pin, tolerance=tolerance
    )
    return at if at.converged else None


def _extrapolated(
    levels: Mapping[str, list[float]], *, even: bool
) -> dict[str, tuple[float, float | None]]:
    """Extrapolated values and errors, if all three meshes have a value."""
    table = np.array(list(levels.values())).T
    if len(table) < 3:
        return {name: (values[0], None) for name, values in levels.items()}
    (values,), (errors,) = (one.tolist() for one in limit(table[:, None], even=even))
    return dict(zip(levels, zip(values, errors, strict=True), strict=True))


def _index(mesh: PlanarRing, one: Found) -> tuple[int | None, int]:
    """Index in the plane, and number of motions without energy."""
    system, at = PlanarRodSystem(mesh.rod(one.turning)), one.at
    small = _COSTLESS * (2.0 * math.pi / mesh.ring.length) ** 2
    up, down = (system.negative(at.state, shift) for shift in (small, -small))
    if up < 0 or down < 0:
        return None, 0
    return up - len(at.force), down - up


def use_kernels() -> None:
    """Call the kernels of a rod in its plane, on a small ring."""
    mesh = planar_ring(Scene(circle(), section(1.0, 1.0), n_edges=8))
    for one in states_of_turning(mesh, 1, 1e-10):
        _index(mesh, one)


def _distinct(rows: list[PlanarState]) -> tuple[list[PlanarState], list[int]]:
    """States that are not images of earlier ones, within their errors, and their positions.

    The symmetry of a square ring maps states onto others, but does not map the mesh onto itself.
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
    """Return the states, lowest first, with names: numbered if several have one turning number."""
    rows = sorted(rows, key=lambda one: one.energy)
    names = numbered([planar_name(row.turning) for row in rows])
    return tuple(replace(row, name=name) for row, name in zip(rows, names, strict=True))
