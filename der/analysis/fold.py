"""Folding a ring: from the scene to the record."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import cache
from typing import Any

import numpy as np

from der.analysis.self_crossing import gap, nearest_strands
from der.continuation.arclength import follow
from der.continuation.events import EIGHTH, Visit, Wanted, full_index, three_covered
from der.continuation.step import Stuck, Tally
from der.errors import STOPPED, Interrupted, NotConverged, Reason
from der.geometry.mesh import sites
from der.geometry.section import section
from der.geometry.shapes import circle
from der.kernels.assembly import assemble
from der.kernels.quaternions import Array
from der.records.configurations import Shapes
from der.records.path import AtPi, Mode, Path, Point, Timing, folding_mode, release
from der.rod.equilibrium import equilibrium
from der.rod.gripped_ring import Sector, free_ring, sector
from der.rod.rod import State
from der.rod.stability import all_modes, index
from der.scene import Scene, meshes
from der.utils.checks import counts, shown
from der.utils.interrupts import interrupts_between_states

_NO_MOMENT = 1e-6  # of the largest |M|: a state of rest
_KEPT = 64  # configurations of a snap for N gradients; it takes about 5 N
_STRIDE = (
    5.0 / 3.0
)  # where nothing is counted between states: on 280 rings as many folds and limits
_BALANCED = 1e-6  # residual, of the largest bending moment, of a free ring at rest


def fold(
    scene: Scene,
    *,
    progress: Callable[[float], object] | None = None,
    watch: Callable[[Array], object] | None = None,
) -> Path:
    """The path of equilibria of a ring from flat (gamma = 0) on, with what is special on it.

    Parameters
    ----------
    scene : the ring, its section and what is wanted.
    progress : called with gamma [rad] after every state.
    watch : called with the vertices (N, 3) of the ring after every state.

    Returns
    -------
    Path
        Moments of one arm and energies of the full ring, in units of GJ/a.

    Raises
    ------
    NotConverged
        Where the path cannot be followed to its end; has the path so far.
    Interrupted
        At Ctrl-C; has the path so far.
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a der.Scene, got {shown(scene)}")
    piece = _piece(scene, scene.n_edges, scene.sector)
    until_folded = scene.until == "folded"
    beyond = scene.gamma_max > math.pi
    counting = scene.stability or scene.looks_for_self_crossings
    wanted = Wanted(
        load_max=math.inf if until_folded and not beyond else scene.gamma_max,
        until_folded=until_folded,
        targets=None if scene.save_at is None else tuple(scene.save_at),
        # who lists the states that are wanted, and nothing between them, is not slowed by others
        stride=1.0 if counting or scene.save_at is None else _STRIDE,
        stability=scene.stability,
        contacts=scene.looks_for_self_crossings,
        tolerance=scene.tolerance,
    )
    tally = Tally()
    visits: list[Visit] = []
    started = time.perf_counter()

    def entries(status: str, message: str = "", reason: str = "") -> dict[str, Any]:
        timing = Timing(time.perf_counter() - started, tally.newton_iterations, tally.steps)
        return _entries(scene, piece, visits, timing, status, message, reason)

    with interrupts_between_states() as pressed:
        try:
            _load_kernels(wanted.stability, wanted.contacts, snaps=scene.control != "arclength")
            started = time.perf_counter()
            for visit in _march(scene, piece, wanted, tally):
                visits.append(visit)
                if progress is not None:
                    progress(visit.at.state.load)
                if watch is not None:
                    watch(piece.vertices(visit.at.state))
                if pressed:
                    raise KeyboardInterrupt
            turned_back = visits[-1].at.state.load == -scene.gamma_max

            def done() -> dict[str, Any]:
                back = (Reason.TURNED_BACK.value, Reason.TURNED_BACK.word)
                return entries("done", *(back if turned_back else ()))

            bars = scene.error_bars
            found = _with_error_bars(scene, piece, wanted, visits, done) if bars else done()
        except Stuck as stuck:
            raise NotConverged(str(stuck), Path(**entries("not converged", str(stuck)))) from None
        except KeyboardInterrupt:
            pressed.clear()  # one more must not lose what there is
            raise Interrupted(
                Path(**entries("interrupted", STOPPED, Reason.INTERRUPTED.word))
            ) from None
        if pressed:  # while the record was made
            ending = {"status": "interrupted", "message": STOPPED}
            raise Interrupted(Path(**found | ending | {"reason": Reason.INTERRUPTED.word}))
    return Path(**found)


def _piece(scene: Scene, n_edges: int, name: str) -> Sector:
    """A sector of the scene's ring with ``n_edges`` edges in the full ring."""
    return sector(
        scene.ring,
        scene.section,
        n_edges,
        name=name,
        measure=scene.curvature,
        stretching=scene.stretching,
    )


def _with_error_bars(
    scene: Scene,
    piece: Sector,
    wanted: Wanted,
    visits: list[Visit],
    entries: Callable[[], dict[str, Any]],
) -> dict[str, Any]:
    """The record's entries with the values extrapolated from three meshes, and their errors.

    Indices, and the mode but for its slope, are those of the scene's own mesh, unknown where a
    state passes a fold or branch point on its way to the extrapolated curve. Whether that reaches a
    gamma asked for beside a fold is decided by the curve (`moved_folds`). Where the path of the
    coarsest ends elsewhere, so are all values, and no error is known.
    """
    from der.analysis.error_bars import error_bars
    from der.analysis.matching import Family
    from der.analysis.moved_folds import all_asked

    coarse = [_piece(scene, n, piece.name) for n in meshes(scene.n_edges, piece.name)[1:]]
    end = _end(coarse[-1], replace(wanted, most_steps=4 * len(visits) + 100))
    if end != visits[-1].at.state.load:
        return _without_errors(entries(), scene.n_edges // 4, end)
    asked = {math.pi, scene.gamma_max, -scene.gamma_max}
    if scene.save_at is not None:
        asked |= set(scene.save_at)
    else:
        last = max(abs(visit.at.state.load) for visit in visits)
        most = math.ceil(last / EIGHTH)
        asked |= {k * EIGHTH for k in range(-most, most + 1)}
    family = Family((piece, *coarse), scene.tolerance)
    visits[:] = all_asked(family, wanted, visits, asked)
    bars = error_bars(family.pieces, visits, asked, tolerance=scene.tolerance)
    place = {k: i for i, k in enumerate(bars.order)}
    singular = [k for k in place if visits[k].kind in ("fold", "branch")]
    for k, visit in enumerate(visits):
        if k in place and any((place[s] < place[k]) != (s < k) for s in singular):
            # it lay on the other side of a singular state: the meshes do not agree on its index
            visits[k] = replace(visit, index=None, sides=None)
    visits[:] = [visits[k] for k in bars.order]
    found = entries()

    def at(k: int) -> dict[str, float]:
        return {name: float(getattr(bars, name)[k]) for name in ("gamma", "moment", "energy")}

    at_pi, mode = found["at_pi"], found["mode"]
    if at_pi is not None and mode is not None and bars.slope is not None:
        now = at(bars.gamma.tolist().index(math.pi))
        at_pi = replace(at_pi, moment=now["moment"], energy=now["energy"], slope=bars.slope)
        mode = replace(mode, stable=bars.slope > 0.0 if mode.foldable else None)
    return found | {
        "gamma": bars.gamma,
        "moment": bars.moment,
        "energy": bars.energy,
        "points": tuple(replace(point, **at(point.position)) for point in found["points"]),
        "at_pi": at_pi,
        "mode": mode,
        "error": bars.error,
        "raw": bars.raw,
    }


def _end(piece: Sector, wanted: Wanted) -> float | None:
    """The load at which a path ends; None where it cannot be followed."""
    bare = replace(
        wanted, targets=(), limits=False, stride=_STRIDE, stability=False, contacts=False
    )
    try:
        return [visit.at.state.load for visit in follow(piece, bare, Tally())][-1]
    except Stuck:
        return None


def _without_errors(found: dict[str, Any], n_edges: int, end: float | None) -> dict[str, Any]:
    """A record's entries whose error bars say that ``n_edges`` edges lead to another ``end``."""
    where = "cannot be followed to an end" if end is None else f"ends at gamma = {end:.6g}"
    raw = {name: found[name].tolist() for name in ("gamma", "moment", "energy")}
    how = (
        f"null, and values not extrapolated: on {n_edges} edges the path {where}, so that the"
        " meshes are not yet of one kind; use more edges"
    )
    unknown = {name: [None] * len(values) for name, values in raw.items()}
    return found | {"error": unknown | {"slope_at_pi": None, "how": how}, "raw": raw}


def _march(scene: Scene, piece: Sector, wanted: Wanted, tally: Tally) -> Iterator[Visit]:
    """The states of the path, in the way in which the scene is controlled and solved.

    What a scene does not need is not imported either.
    """
    every = math.ceil(scene.n_edges / _KEPT) if scene.history else 0
    if scene.solver == "relaxation":
        from der.analysis.loading_by_relaxation import follow_relaxed

        # no Hessian anywhere: neither index nor link is looked for between states
        bare = replace(wanted, stability=False, contacts=False)
        return follow_relaxed(piece, bare, tally, unload=scene.unload, every=every)
    if scene.control == "angle":
        from der.analysis.loading import follow_angle

        return follow_angle(piece, wanted, tally, unload=scene.unload, every=every)
    if scene.control == "moment":
        from der.analysis.loading import follow_moment

        return follow_moment(piece, wanted, tally, unload=scene.unload, every=every)
    return follow(piece, wanted, tally)


@cache
def _load_kernels(stability: bool, contacts: bool, *, snaps: bool) -> None:
    """Load or compile the kernels that a path needs, once a process, before the clock starts."""
    piece = sector(circle(), section(1.0, 1.0), 8)
    if snaps:
        from der.rod.relaxation import relax

        relax(piece.body, piece.held, piece.start)
    for _ in follow(piece, Wanted(load_max=0.1, stability=stability, contacts=contacts), Tally()):
        pass
    if contacts:
        x = piece.vertices(piece.start)
        gap(x, *nearest_strands(x, x))


def _entries(
    scene: Scene,
    piece: Sector,
    visits: list[Visit],
    timing: Timing,
    status: str,
    message: str,
    reason: str,
) -> dict[str, Any]:
    """The entries of the record of what was visited."""
    indices = [full_index(piece, visit.index) for visit in visits]
    moments = np.array([piece.moment(visit.at.moment) for visit in visits])
    points = tuple(_points(piece, visits))
    at_pi = mode = None
    for k, visit in enumerate(visits):
        if visit.at.state.load == math.pi:
            at_rest = abs(moments[k]) <= _NO_MOMENT * float(np.abs(moments).max())
            free = _free_index(scene, piece, visit) if at_rest and visit.index else None
            at_pi = AtPi(
                float(moments[k]),
                piece.moment(visit.at.slope),
                piece.copies * visit.at.energy,
                indices[k],
                _moment_index(visit, indices[k]),
                free,
            )
            end = slice(0, k + 1)
            before = tuple(point for point in points if point.position <= k)
            gamma = np.array([v.at.state.load for v in visits[end]])
            mode = folding_mode(
                gamma, moments[end], before, at_pi, three_covered=three_covered(piece, visit.at)
            )
            break
    if reason == Reason.TURNED_BACK.word and at_pi is None:
        mode = Mode(foldable=False, stable=None, snapping="snap-back", stable_3d=None)
    if scene.control == "moment":
        mode = None  # a ring that fell through under its moment tells nothing of its folds in gamma
    return {
        "solver": "der",
        "ring": scene.ring.to_json(),
        "section": asdict(scene.section),
        "numerics": _numerics(scene, piece),
        "gamma": np.array([visit.at.state.load for visit in visits]),
        "moment": moments,
        "energy": np.array([piece.copies * visit.at.energy for visit in visits]),
        "index": counts("index", indices),
        "index_moment": counts("index_moment", list(map(_moment_index, visits, indices))),
        "points": points,
        "at_pi": at_pi,
        "mode": mode,
        "error": None,
        "timing": timing,
        # an unfinished path keeps its shapes in any case: they are what it got to
        "shapes": _shapes(scene, piece, visits, status)
        if scene.shapes or status != "done"
        else None,
        "status": status,
        "message": message,
        "reason": reason,
    }


def _moment_index(visit: Visit, held: int | None) -> int | None:
    """Index with the moment held: one more where dM/dgamma < 0; unknown where it vanishes."""
    if held is None or visit.kind == "limit":
        return None
    return held + (visit.at.slope < 0.0)


def _points(piece: Sector, visits: list[Visit]) -> list[Point]:
    """The special points, with the index on their two sides."""
    points = []
    for k, visit in enumerate(visits):
        if not visit.kind:
            continue
        before, after = (
            full_index(piece, index) for index in visit.sides or (visit.index, visit.index)
        )
        at = visit.at
        numbers = (at.state.load, piece.moment(at.moment), piece.copies * at.energy)
        points.append(Point(visit.kind, *numbers, before, after, k, visit.details))
    return points


def _free_index(scene: Scene, piece: Sector, visit: Visit) -> int | None:
    """Index of the ring with its grips removed, rigid motions taken out, if it stays at rest."""
    whole = _piece(scene, scene.n_edges, "full")
    held = free_ring(whole.body)
    quat = piece.full_frames(visit.at.state)
    stretch = piece.full_lengths(visit.at.state) / whole.body.length - 1.0
    state = State(quat, stretch, np.zeros(3), 0.0)
    system = assemble(whole.body, held, quat, stretch, state.force, 0.0)
    free = held.free.reshape(-1)
    residual = system.grad.reshape(-1)[free]
    border = system.border.reshape(-1, 3)[free]
    force = -np.linalg.lstsq(border, residual, rcond=None)[0]
    scale = float(np.abs(system.diag).max() * whole.body.cell.max())
    if float(np.abs(residual + border @ force).max()) > _BALANCED * scale:
        if not scene.stretching:
            return None
        # a grip holds the length of its edge, too: without it the ring settles a little
        settled = equilibrium(whole.body, held, state.but(force=force), tolerance=scene.tolerance)
        if not settled.converged:
            return None
        state, force = settled.state, settled.state.force
    return index(whole.body, held, all_modes(held), state.but(force=force))


def _shapes(scene: Scene, piece: Sector, visits: list[Visit], status: str) -> Shapes | None:
    """The full ring at every state, if there is any, and what else was asked to be kept of it."""
    if not visits:
        return None
    from der.analysis.full_ring import shapes

    modes = scene.modes and status != "interrupted"  # who pressed Ctrl-C does not wait for them
    arc_length = sites(scene.ring, scene.n_edges, "full")[:-1]
    return shapes(piece, visits, arc_length, history=scene.history, modes=modes)


def _numerics(scene: Scene, piece: Sector) -> dict[str, object]:
    return {
        "n_edges": scene.n_edges,
        "sector": piece.name,
        "curvature": scene.curvature,
        "stretch": scene.stretch,
        "a_over_t": scene.a_over_t,
        "tolerance": scene.tolerance,
        "gamma_max": scene.gamma_max,
        "until": scene.until,
        "control": scene.control,
        "unload": scene.unload,
        "solver": scene.solver,
        "error_bars": scene.error_bars,
        "save_at": None if scene.save_at is None else list(scene.save_at),
        "stability": scene.stability,
        "version": release(),
    }
