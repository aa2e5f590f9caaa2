"""The boundary-value problem's path: from the scene to the record."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from der.bvp.collocation import collocation
from der.bvp.continuation import follow
from der.bvp.events import Point, Wanted
from der.bvp.record import Followed
from der.bvp.sectors import sector
from der.bvp.step import Statistics
from der.errors import Reason
from der.geometry.section import section
from der.geometry.shapes import circle
from der.records.path import Path
from der.scene import Scene
from der.utils.checks import checked_number
from der.utils.run import Run

TOLERANCE = 1e-8
FINEST, COARSEST = 1e-11, 1e-3
ACROSS = 0.4  # of the tolerance: errors across the path, which at equal gamma show larger


def solve_bvp(
    scene: Scene, *, tolerance: float = TOLERANCE, progress: Callable[[float], object] | None = None
) -> Path:
    """The path of equilibria of a ring by its boundary-value problem (paper, Eq. A.15).

    Parameters
    ----------
    scene : the ring, its section and what is wanted. Its sector is a quarter or a half; edges only
        say where shapes are sampled. Of indices only that of the folded ring without grips is
        computed, which says whether it stays folded when released.
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
        For a tolerance that is not allowed, or a scene that asks for what this solver cannot do:
        stretch, control of anything but arc length, dynamic relaxation, the full ring.
    NotConverged
        Where the path cannot be followed to its end; has the path so far.
    Interrupted
        At Ctrl-C; has the path so far.
    """
    return solve_with_points(scene, tolerance=tolerance, progress=progress)[0]


def solve_with_points(
    scene: Scene, *, tolerance: float = TOLERANCE, progress: Callable[[float], object] | None = None
) -> tuple[Path, list[Point]]:
    """`solve_bvp`, and the points with their solutions."""
    check(scene, tolerance)
    followed = Followed(scene, collocation(sector(scene)), tolerance)
    points = followed.points

    def tell(point: Point) -> None:
        if progress is not None:
            progress(point.solution.gamma)

    with Run() as run:
        run.prepare(lambda: use_kernels(followed.system.sector.piece.quarter))
        wanted = _wanted(followed)
        points += run.collect(follow(followed.system, wanted, followed.statistics), tell)
        if run.done and followed.turned_back:
            run.note(Reason.TURNED_BACK)
        if run.done and scene.unfolded(points[-1].solution.gamma):
            run.stop(Reason.UNFOLDED)
        path = followed.record(run)
    return run.answer(path), points


def _wanted(followed: Followed) -> Wanted:
    """What a scene asks for on its path."""
    scene = followed.scene
    return Wanted(
        gamma_max=scene.last_gamma,
        until=followed.three_covered if scene.until == "folded" else None,
        targets=None if scene.save_at is None else tuple(scene.save_at),
        tolerance=ACROSS * followed.tolerance,
    )


def check(scene: object, tolerance: object) -> None:
    """Refuse what this solver cannot do: a ValueError that names it."""
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be a der.Scene, got {scene!r}")
    allowed = f"a number from {FINEST:g} to {COARSEST:g} for a boundary-value problem"
    checked_number("tolerance", tolerance, allowed, lambda t: FINEST <= t <= COARSEST)
    for name, only in (("stretch", "inextensible"), ("control", "arclength"), ("solver", "newton")):
        if getattr(scene, name) != only:
            raise ValueError(
                f"{name} must be {only!r} for a boundary-value problem, "
                f"got {getattr(scene, name)!r}"
            )
    sector(scene)


@cache
def use_kernels(quarter: bool) -> None:
    """Load or compile the kernels, once a process, before the clock starts."""
    scene = Scene(circle(), section(1.0, 1.0), sector="quarter" if quarter else "half")
    system = collocation(sector(scene))
    for _ in follow(system, Wanted(gamma_max=0.1, targets=(), tolerance=1e-3), Statistics()):
        pass
