"""Error over time on one ring: the rod in its variants, relaxation, and boundary-value solvers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import der
from der.bvp.solve import solve_bvp
from der.errors import NotConverged
from validation.benchmark.rings import BenchRing, Known
from validation.benchmark.rows import Trial, failed, finite, measured
from validation.benchmark.stepping import stepped

BARE: Mapping[str, object] = {"stability": False, "self_crossings": False}
ROD: Mapping[str, Mapping[str, object]] = {
    "rod, sector": {},
    "rod, sector, index": {"stability": True},
    "rod, full ring": {"sector": "full"},
    "rod, full ring, index": {"sector": "full", "stability": True},
    "rod, turning angle": {"curvature": "angle"},
    "rod, tangent": {"curvature": "tangent"},
    "rod, finite EA": {"stretch": "finite"},
    "rod, extrapolated": {"error_bars": True},
}
RELAXED: Mapping[str, object] = {"control": "angle", "solver": "relaxation"}
STEPPING = "solve_bvp, stepped"
FEWEST = {"rod, extrapolated": 32}

SIZES = (16, 32, 64, 128, 256, 512, 1024)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def rod_trials(truth: Known, sizes: Sequence[int], repeats: int) -> Iterator[Trial]:
    """All variants of the rod, over the number of edges."""
    for method, wants in ROD.items():
        _rod(truth.case, 32, wants)()  # loads, or compiles, what this variant needs
        for n in sizes:
            if n >= FEWEST.get(method, 0):
                yield _path_trial(truth, method, f"N {n}", _rod(truth.case, n, wants), repeats)


def relaxation_trials(truth: Known, sizes: Sequence[int], repeats: int) -> Iterator[Trial]:
    """The march of the angle by dynamic relaxation alone; it snaps where the path folds."""
    for n in sizes:
        work = _rod(truth.case, n, RELAXED)
        if n == sizes[0]:
            _rod(truth.case, 16, RELAXED)()
        yield _path_trial(truth, "dynamic relaxation", f"N {n}", work, repeats)


def bvp_trials(truth: Known, tolerances: Sequence[float], repeats: int) -> Iterator[Trial]:
    """The boundary-value solver over its tolerance."""
    solve_bvp(truth.case.scene(), tolerance=1e-3)
    for tolerance in tolerances:

        def work(tolerance: float = tolerance) -> der.Path:
            return solve_bvp(truth.case.scene(), tolerance=tolerance)

        yield _path_trial(truth, "boundary value", f"{tolerance:.0e}", work, repeats)


def stepping_trials(truth: Known, tolerances: Sequence[float], repeats: int) -> Iterator[Trial]:
    """`scipy.integrate.solve_bvp`, stepping through gamma; there is none where the path folds."""
    if truth.case.folds:
        return
    name = truth.case.name
    for tolerance in tolerances:
        setting = f"{tolerance:.0e}"
        try:
            done = measured(
                lambda tolerance=tolerance: stepped(truth.case.scene(), tolerance),  # type: ignore[misc]
                repeats,
                memory=False,
                warm=False,
            )
        except ValueError as failure:
            yield failed(name, STEPPING, setting, failure)
            continue
        path = done.result
        moment, energy = (max(error, truth.floor) for error in path.errors(truth.curve))
        note = f"{path.steps} steps, {path.nodes} nodes"
        yield Trial(name, STEPPING, setting, done.cpu, done.wall, None, moment, energy, None, note)


def _rod(case: BenchRing, n: int, wants: Mapping[str, object]) -> Callable[[], der.Path]:
    """The work of folding a ring of ``n`` edges."""
    return lambda: der.fold(case.scene(n_edges=n, **{**BARE, **wants}))


def _path_trial(
    truth: Known, method: str, setting: str, work: Callable[[], der.Path], repeats: int
) -> Trial:
    """Time, memory and errors of what returns a path; a failure is a trial without errors."""
    name = truth.case.name
    try:
        done = measured(work, repeats, warm=False)
    except (NotConverged, ValueError) as failure:  # refused, or given up: both say why
        return failed(name, method, setting, failure)
    path = done.result
    moment, energy = (max(error, truth.floor) for error in truth.errors(path))
    folds = None
    note = f"{path.timing.newton_iterations} iterations, {path.timing.steps} steps"
    if truth.curve.folds:
        folds = finite(truth.fold_error(path))
        if folds is None:
            note += f"; {len(path.folds)} of {len(truth.curve.folds)} folds"
    memory = done.memory
    return Trial(name, method, setting, done.cpu, done.wall, memory, moment, energy, folds, note)
