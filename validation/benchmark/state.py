"""One state of the circle, M at gamma = pi/2, by everyone who can turn a ring: error over time.

A path has no meaning for a code that steps a dynamic rod through time, so all are asked for the
same single number, from the flat ring on, before anything has folded or snapped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import der
from der.bvp.solve import FINEST, solve_bvp
from der.errors import NotConverged
from validation.benchmark import elastica as bench_elastica
from validation.benchmark.methods import BARE, RELAXED, STEPPING
from validation.benchmark.rings import RINGS, BenchRing
from validation.benchmark.rows import Trial, failed, measured
from validation.benchmark.stepping import stepped

NAME = "circle, h/t 4, M at pi/2"
GAMMA = 0.5 * math.pi
CIRCLE: BenchRing = RINGS[0]
METHODS: Mapping[str, Mapping[str, object]] = {
    "rod, sector": {},
    "rod, full ring": {"sector": "full"},
    "rod, extrapolated": {"error_bars": True},
    "dynamic relaxation": RELAXED,
}
PEER = "PyElastica, closed ring"


def trials(
    sizes: Mapping[str, Sequence[int]],
    tolerances: Sequence[float],
    stepping: Sequence[float],
    elements: Sequence[int],
    repeats: int,
) -> Iterator[Trial]:
    """All methods; ``sizes`` by method, ``elements`` of PyElastica."""
    only: dict[str, object] = {"gamma_max": GAMMA, "save_at": (GAMMA,)}
    scene = CIRCLE.scene(**only)
    exact = float(solve_bvp(scene, tolerance=FINEST).moment[-1])

    def trial(method: str, setting: str, work: Callable[[], float], times: int) -> Trial:
        slow = times == 1
        try:
            done = measured(work, times, memory=not slow, warm=not slow)
        except (NotConverged, ValueError) as failure:
            return failed(NAME, method, setting, failure)
        off = max(abs(done.result - exact) / abs(exact), FINEST)
        return Trial(NAME, method, setting, done.cpu, done.wall, done.memory, off, None, None)

    for method, numbers in sizes.items():
        for n in numbers:
            rod = CIRCLE.scene(**{**BARE, **only, **METHODS[method]}, n_edges=n)
            yield trial(method, f"N {n}", lambda rod=rod: _last(der.fold(rod)), repeats)  # type: ignore[misc]
    for tolerance in tolerances:
        yield trial(
            "boundary value",
            f"{tolerance:.0e}",
            lambda tolerance=tolerance: _last(solve_bvp(scene, tolerance=tolerance)),  # type: ignore[misc]
            repeats,
        )
    for tolerance in stepping:
        yield trial(
            STEPPING,
            f"{tolerance:.0e}",
            lambda tolerance=tolerance: float(stepped(scene, tolerance).moment[-1]),  # type: ignore[misc]
            1,
        )
    if bench_elastica.installed() and elements:
        bench_elastica.moment(scene.section, 8, 0.1)  # compiles, or loads what was
        for n in elements:
            yield trial(
                PEER,
                f"N {n}",
                lambda n=n: bench_elastica.moment(scene.section, n, GAMMA),  # type: ignore[misc]
                1,
            )


def _last(path: der.Path) -> float:
    return float(path.moment[-1])
