"""Error over time on one ring: the rod in its variants, relaxation, and boundary-value solvers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import der
from validation.benchmark.extent import Extent
from validation.benchmark.rings import BARE, known
from validation.benchmark.rows import Attempt, Trial, front_text
from validation.benchmark.stepping import stepped

RELAXATION, BOUNDARY_VALUE, STEPPING = (
    "dynamic relaxation",  # the angle is turned; the ring snaps where the path folds
    "boundary value",
    "solve_bvp, stepped",
)
ROD: Mapping[str, Mapping[str, object]] = {
    "rod, sector": {},
    "rod, sector, index": {"stability": True},
    "rod, full ring": {"sector": "full"},
    "rod, full ring, index": {"sector": "full", "stability": True},
    "rod, turning angle": {"curvature": "angle"},
    "rod, tangent": {"curvature": "tangent"},
    "rod, finite EA": {"stretch": "finite"},
    "rod, extrapolated": {"error_bars": True},
    RELAXATION: {"control": "angle", "solver": "relaxation"},
}
FEWEST = {"rod, extrapolated": 32}


def attempts(
    scene: Callable[..., der.Scene], extent: Extent, rods: Mapping[str, Mapping[str, object]] = ROD
) -> Iterator[Attempt]:
    """All methods over their numbers of edges or tolerances.

    Parameters
    ----------
    scene : makes the scene of the ring with further entries.
    rods : the variants of the rod.
    """

    def rod(n: int, wants: Mapping[str, object]) -> Callable[[], der.Path]:
        return partial(der.fold, scene(**{**BARE, **wants, "n_edges": n}))

    for method, wants in rods.items():
        slow = method == RELAXATION
        repeats = extent.slow_repeats if slow else extent.repeats
        sizes = [
            n for n in (extent.relaxed if slow else extent.edges) if n >= FEWEST.get(method, 0)
        ]
        if sizes:
            rod(32, wants)()  # loads, or compiles, what this variant needs
        for n in sizes:
            yield Attempt(method, f"N {n}", rod(n, wants), repeats)
    der.solve_bvp(scene(), tolerance=1e-3)
    for tolerance in extent.tolerances:
        work = partial(der.solve_bvp, scene(), tolerance=tolerance)
        yield Attempt(BOUNDARY_VALUE, f"{tolerance:.0e}", work, extent.repeats)
    for tolerance in extent.stepping:
        step = partial(stepped, scene(), tolerance)
        yield Attempt(STEPPING, f"{tolerance:.0e}", step, extent.slow_repeats, memory=False)


def rows(extent: Extent) -> Iterator[Trial | str]:
    """Errors over time of each ring's complete path."""
    for case in extent.rings:
        truth = known(case, extent.states)
        wanted = replace(extent, stepping=()) if case.folds else extent
        trials = []
        for attempt in attempts(case.scene, wanted):
            trials.append(attempt.trial(case.name, truth.errors))
            yield trials[-1]
        if case.folds:
            yield f"{case.name}: solve_bvp cannot step past a fold, skipped"
        yield front_text(case.name, trials)
