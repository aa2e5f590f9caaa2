"""The boundary-value problem's path: from the scene to the record."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import cache

import numpy as np

from der.bvp.collocation import Collocation, Solution, collocation
from der.bvp.continuation import Stuck, Tally, Visit, Wanted, follow
from der.bvp.full_ring import full_ring, turning
from der.bvp.sectors import sector
from der.errors import STOPPED, Interrupted, NotConverged, Reason
from der.geometry.mesh import sites
from der.geometry.ring import circle
from der.geometry.section import section
from der.records.configurations import Shapes
from der.records.path import AtPi, Mode, Path, Point, Timing, folding_mode, release
from der.scene import Scene
from der.utils.checks import checked_number, counts
from der.utils.interrupts import interrupts_between_states

TOLERANCE = 1e-8
FINEST, COARSEST = 1e-11, 1e-3
ACROSS = 0.4  # of the tolerance: errors across the path, which at equal gamma show larger
_FLAT = 1e-6  # out-of-plane extent of a folded ring, a
HOW = (
    "change of the state, across the path, on a collocation mesh of half the intervals' length; "
    "Gauss collocation of 4 stages, of order 8 at the ends of intervals"
)


def solve_bvp(
    scene: Scene,
    *,
    tolerance: float = TOLERANCE,
    progress: Callable[[float], object] | None = None,
) -> Path:
    """The path of equilibria of a ring by its boundary-value problem (paper, Eq. A.15).

    Parameters
    ----------
    scene : the ring, its section and what is wanted. Its sector is a quarter or a half; edges only
        say where shapes are sampled; indices are not computed.
    tolerance : of gamma/pi, M and U, relative to the largest on the path; from 1e-11 to 1e-3.
    progress : called with gamma [rad] after every state.

    Returns
    -------
    Path
        Moments of one arm and energies of the full ring, in units of GJ/a; `error` holds the
        estimated errors of every state, `index` is masked.

    Raises
    ------
    ValueError
        For a tolerance that is not allowed, or a scene that asks for what this solver has not:
        stretch, control of anything but arc length, dynamic relaxation, the full ring.
    NotConverged
        Where the path cannot be followed to its end; has the path so far.
    Interrupted
        At Ctrl-C; has the path so far.
    """
    return solve_visits(scene, tolerance=tolerance, progress=progress)[0]


def solve_visits(
    scene: Scene,
    *,
    tolerance: float = TOLERANCE,
    progress: Callable[[float], object] | None = None,
) -> tuple[Path, list[Visit]]:
    """`solve_bvp`, and the solutions themselves."""
    check(scene, tolerance)
    system = collocation(sector(scene))
    until_folded = scene.until == "folded"
    beyond = scene.gamma_max > math.pi
    wanted = Wanted(
        gamma_max=math.inf if until_folded and not beyond else scene.gamma_max,
        until=(lambda at: three_covered(system, at)) if until_folded else None,
        targets=None if scene.save_at is None else tuple(scene.save_at),
        tolerance=ACROSS * tolerance,
    )
    tally = Tally()
    visits: list[Visit] = []

    def record(status: str, message: str = "", reason: str = "") -> Path:
        timing = Timing(time.perf_counter() - started, tally.newton_iterations, tally.steps)
        return _record(scene, system, tolerance, visits, timing, status, message, reason)

    with interrupts_between_states() as pressed:
        _load_kernels(system.sector.piece.quarter)
        started = time.perf_counter()
        try:
            for visit in follow(system, wanted, tally):
                visits.append(visit)
                if progress is not None:
                    progress(visit.at.gamma)
                if pressed:
                    raise KeyboardInterrupt
        except Stuck as stuck:
            raise NotConverged(str(stuck), record("not converged", str(stuck))) from None
        except KeyboardInterrupt:
            pressed.clear()  # one more must not lose what there is
            raise Interrupted(record("interrupted", STOPPED, Reason.INTERRUPTED.word)) from None
        back = (Reason.TURNED_BACK.value, Reason.TURNED_BACK.word)
        path = record("done", *(back if visits[-1].at.gamma == -scene.gamma_max else ()))
        if pressed:  # while the record was made
            raise Interrupted(path.interrupted())
    return path, visits


def check(scene: object, tolerance: object) -> None:
    """Refuse what this solver cannot do: a ValueError that names it."""
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a der.Scene, got {scene!r}")
    allowed = f"a number from {FINEST:g} to {COARSEST:g} for a boundary-value problem"
    checked_number("tolerance", tolerance, allowed, lambda t: FINEST <= t <= COARSEST)
    for name, only in (
        ("stretch", "inextensible"),
        ("control", "arclength"),
        ("solver", "newton"),
    ):
        if getattr(scene, name) != only:
            raise ValueError(
                f"{name} must be {only!r} for a boundary-value problem, "
                f"got {getattr(scene, name)!r}"
            )
    sector(scene)


@cache
def _load_kernels(quarter: bool) -> None:
    """Load or compile the kernels, once a process, before the clock starts."""
    scene = Scene(circle(), section(1.0, 1.0), sector="quarter" if quarter else "half")
    system = collocation(sector(scene))
    for _ in follow(system, Wanted(gamma_max=0.1, targets=(), tolerance=1e-3), Tally()):
        pass


def three_covered(system: Collocation, at: Solution) -> bool:
    """Whether a solution is the planar ring that covers itself three times."""
    extent = 2.0 * float(np.abs(at.places[:, 0]).max())
    return extent < _FLAT and abs(turning(system, at) - 6.0 * math.pi) < 0.1


def _record(
    scene: Scene,
    system: Collocation,
    tolerance: float,
    visits: list[Visit],
    timing: Timing,
    status: str,
    message: str,
    reason: str,
) -> Path:
    """The record of what was visited."""
    moments = np.array([visit.at.moment for visit in visits])
    gamma = np.array([visit.at.gamma for visit in visits])
    points = tuple(
        Point(v.kind, v.at.gamma, v.at.moment, v.at.energy, None, None, k)
        for k, v in enumerate(visits)
        if v.kind
    )
    at_pi = mode = None
    for k, visit in enumerate(visits):
        if visit.at.gamma == math.pi:
            at = visit.at
            at_pi = AtPi(at.moment, at.slope, at.energy, None, None, None)
            before = tuple(point for point in points if point.position <= k)
            covered = three_covered(system, at)
            mode = folding_mode(
                gamma[: k + 1], moments[: k + 1], before, at_pi, three_covered=covered
            )
            break
    if reason == Reason.TURNED_BACK.word and float(gamma.max()) < math.pi:
        mode = Mode(foldable=False, stable=None, snapping="snap-back", stable_3d=None)
    unknown = counts("index", [None] * len(visits))
    error = {
        name: [float(getattr(visit.error, name)) for visit in visits]
        for name in ("gamma", "moment", "energy")
    }
    return Path(
        solver="bvp",
        ring=scene.ring.to_json(),
        section=asdict(scene.section),
        numerics={
            "method": "Gauss collocation",
            "stages": len(system.rule.points),
            "intervals": max((len(visit.at.mesh.h) for visit in visits), default=0),
            "sector": "quarter" if system.sector.piece.quarter else "half",
            "tolerance": tolerance,
            "gamma_max": scene.gamma_max,
            "until": scene.until,
            "save_at": None if scene.save_at is None else list(scene.save_at),
            "version": release(),
        },
        gamma=gamma,
        moment=moments,
        energy=np.array([visit.at.energy for visit in visits]),
        index=unknown,
        index_moment=unknown,
        points=points,
        at_pi=at_pi,
        mode=mode,
        error=error | {"how": HOW},
        timing=timing,
        shapes=_shapes(scene, system, visits) if scene.shapes and visits else None,
        status=status,
        message=message,
        reason=reason,
    )


def _shapes(scene: Scene, system: Collocation, visits: list[Visit]) -> Shapes:
    """Vertices and frames of the full ring at every state."""
    shapes = [full_ring(system, visit.at, scene.n_edges) for visit in visits]
    x, frames = (np.array(parts) for parts in zip(*shapes, strict=True))
    places = sites(scene.ring, scene.n_edges, "full")[:-1]
    return Shapes(x, frames, arc_length=places)
