"""Run time against error, on this machine, in one run: `der bench`.

Every number is measured here and now: CPU time of this process (``time.process_time``), medians of
several runs, warm unless a row says otherwise, so that ratios between rows mean something on a
noisy machine. Errors are normal distances to reference curves that another program computed
(AUTO-07p, orthogonal collocation; see validation/reference), as in `validation.curves`.
"""

from __future__ import annotations

import json
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

import der
from der.assembly import assemble, take_out
from der.block_ldl import factor
from der.control import follow_angle
from der.equilibrium import Control, Direction, Equilibrium, equilibrium, moved
from der.relaxed_march import follow_relaxed
from der.rod import State
from der.scene import MEASURES
from der.sector import Sector, sector
from der.snap import Landing, snap
from der.special import Visit, Wanted
from der.step import Tally
from validation.bench_bvp import rows as bvp_rows
from validation.curves import ReferenceCurve, curve_error, fold_error, read_reference

REFERENCE = Path(__file__).parent / "reference"
Follower = Callable[[Sector, Wanted, Tally], Iterator[Visit]]
CASES = {4.0: "circ_ht4", 1.6: "circ_ht1.6", 1.0: "circ_ht1_beyond_pi"}


@dataclass(frozen=True)
class Row:
    """One measured quantity."""

    group: str
    case: str
    value: float
    unit: str
    goal: float | None = None
    note: str = ""


def run(file: Path | None = None, *, quick: bool = False) -> list[Row]:
    """Measure everything, print a table as it grows, and write JSON if ``file`` is given."""
    print(f"der {version('ring-origami')}, {machine()}")
    rows: list[Row] = []
    try:
        for row in measure(quick=quick):
            rows.append(row)
            print(_line(row), flush=True)
    finally:  # Ctrl-C keeps the rows it has
        if file is not None:
            record = {"machine": machine(), "rows": [asdict(row) for row in rows]}
            file.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n")
    return rows


def _line(row: Row) -> str:
    goal = "" if row.goal is None else f"goal {row.goal:g}"
    value = f"{row.value:11.4g} {row.unit:7}"
    return f"{row.group:12}{row.case:52}{value} {goal:11} {row.note}".rstrip()


def machine() -> str:
    """Processor, Python and the libraries that matter for speed."""
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba"))
    return f"{_processor()}, Python {platform.python_version()}, {libraries}"


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:  # not Linux
        pass
    return platform.processor() or platform.machine()


def measure(*, quick: bool = False) -> Iterator[Row]:
    """All rows, one after the other."""
    repeats = 5 if quick else 15
    yield from _paths(repeats)
    yield from _needs(repeats)
    yield from _relaxation((32, 64, 128) if quick else (32, 64, 128, 256))
    yield from _snaps(repeats)
    yield from _recording(repeats)
    yield from _errors((32, 64, 128) if quick else (32, 64, 128, 256, 512))
    yield from _newton((64, 1024) if quick else (64, 256, 1024, 4096, 16384, 65536))
    yield from (Row(*row) for row in bvp_rows(cpu_time, 3 if quick else repeats))
    yield from _start_up(2 if quick else 5)


def cpu_time(work: Callable[[], object], repeats: int) -> float:
    """Median CPU time of ``work`` [s], after one run that is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


def _circle(h_over_t: float, **wants: object) -> der.Scene:
    return der.Scene(der.circle(), der.rectangular_section(h_over_t), **wants)  # type: ignore[arg-type]


def _paths(repeats: int) -> Iterator[Row]:
    """The two paths that the project sets itself goals for."""
    cases = [
        ("h/t 4, N 64, quarter, no stability", _circle(4.0, stability=False), 15.0),
        ("h/t 4, N 64, full ring, index at every state", _circle(4.0, sector="full"), 60.0),
        ("h/t 4, N 64, quarter, index at every state", _circle(4.0), None),
        ("h/t 1.6, N 64, quarter, index, two folds", _circle(1.6), None),
        ("h/t 1, N 64, until folded, index", _circle(1.0, until="folded"), None),
        (
            "h/t 4, N 128, quarter, error bars",
            _circle(4.0, n_edges=128, stability=False, error_bars=True),
            60.0,
        ),
        (
            "h/t 1.6, N 64, quarter, angle up and down, 2 snaps",
            _circle(1.6, control="angle", unload=True),
            None,
        ),
        (
            "h/t 4, N 64, quarter, by relaxation alone",
            _circle(4.0, control="angle", solver="relaxation"),
            None,
        ),
    ]
    for case, scene, goal in cases:
        path = der.fold(scene)
        note = f"{path.timing.steps} steps, {path.timing.newton_iterations} Newton iterations"
        seconds = cpu_time(lambda scene=scene: der.fold(scene), repeats)  # type: ignore[misc]
        yield Row("path", case, 1e3 * seconds, "ms", goal, note)


def _needs(repeats: int) -> Iterator[Row]:
    """What each need of a scene costs, over the same path without it."""
    bare = {"stability": False, "contacts": False}
    base = cpu_time(lambda: der.fold(_circle(4.0, **bare)), repeats)
    yield Row("need", "none: h/t 4, N 64, quarter", 1e3 * base, "ms")
    cases: dict[str, dict[str, object]] = {
        "stability": {"stability": True},
        "contacts": {"contacts": True},
        "shapes": {"shapes": True},
        "shapes with softest modes": {"shapes": True, "modes": True},
        "full ring": {"sector": "full"},
        "half ring": {"sector": "half"},
        "finite stretch": {"stretch": "finite"},
    }
    for name, wants in cases.items():
        scene = _circle(4.0, **{**bare, **wants})
        seconds = cpu_time(lambda scene=scene: der.fold(scene), repeats)  # type: ignore[misc]
        yield Row("need", name, seconds / base, "times")


def _relaxation(sizes: tuple[int, ...]) -> Iterator[Row]:
    """The march of the angle by dynamic relaxation alone against the same by Newton, over N."""
    wanted = Wanted(stability=False, contacts=False)
    for n in sizes:
        piece = sector(der.circle(), der.rectangular_section(4.0), n)

        def march(follow: Follower, tally: Tally, piece: Sector = piece) -> int:
            return len(list(follow(piece, wanted, tally)))

        newton, relaxed = Tally(), Tally()
        states = march(follow_relaxed, relaxed), march(follow_angle, newton)
        times = [
            cpu_time(lambda follow=follow, march=march: march(follow, Tally()), 5)  # type: ignore[misc]
            for follow in (follow_relaxed, follow_angle)
        ]
        per_state = [1e3 * t / k for t, k in zip(times, states, strict=True)]
        case = f"h/t 4, N {n}, quarter"
        note = f"{relaxed.force_evaluations} force evaluations, {1e3 * times[0]:.0f} ms"
        yield Row("relaxation", f"{case}, a state", per_state[0], "ms", None, note)
        note = f"{newton.newton_iterations} Newton iterations, {1e3 * times[1]:.0f} ms"
        yield Row("relaxation", f"{case}, a state by Newton", per_state[1], "ms", None, note)


def _snaps(repeats: int) -> Iterator[Row]:
    """One snap: dynamic relaxation past the fold, and the polish by Newton."""
    wanted = Wanted(stability=False, contacts=False)
    for name in ("quarter", "full"):
        piece = sector(der.circle(), der.rectangular_section(1.6), 64, name=name)
        before = next(v.at for v in follow_angle(piece, wanted, Tally()) if v.kind == "fold")

        def fall(piece: Sector = piece, before: Equilibrium = before) -> Landing:
            return snap(piece, wanted, Tally(), before, before.tangent)

        seconds = cpu_time(fall, repeats)
        note = f"{fall().details['force_evaluations']} force evaluations"
        yield Row("snap", f"h/t 1.6, N 64, {name}", 1e3 * seconds, "ms", 100.0, note)


def _recording(repeats: int) -> Iterator[Row]:
    """A recording for playback: 400 equilibria of 128 edges, scaled from what the path has."""
    from der.view_rerun import recording_bytes

    gammas = tuple(np.linspace(0.0, np.pi, 361)[1:])
    scene = _circle(1.6, n_edges=128, shapes=True, stability=False, save_at=gammas)
    path = der.fold(scene)
    share = 400.0 / len(path)
    size = len(recording_bytes(path)) * share
    seconds = cpu_time(lambda: recording_bytes(path), min(repeats, 5)) * share
    case = "400 steps, 128 edges"
    yield Row("recording", f"{case}, file", 1e-6 * size, "MB", 10.0)
    yield Row("recording", f"{case}, made", seconds, "s", 1.0)


def _errors(sizes: tuple[int, ...]) -> Iterator[Row]:
    """Curve error over N for each reference curve and measure, the fitted order, and the folds."""
    for h_over_t, name in CASES.items():
        reference = read_reference(REFERENCE / f"{name}.csv")
        until = "folded" if "beyond" in name else None
        for measure_name in MEASURES:
            if measure_name != MEASURES[0] and h_over_t != 4.0:
                continue
            errors = []
            for n in sizes:
                path = der.fold(
                    _circle(
                        h_over_t,
                        n_edges=n,
                        curvature=measure_name,
                        stability=False,
                        contacts=False,
                        until=until,
                    )
                )
                errors.append(max(curve_error(path.gamma, path.moment, path.energy, reference)))
                note = f"in {1e3 * path.timing.solve_s:.1f} ms"
                if reference.folds:
                    gammas = [point.gamma for point in path.folds]
                    note += f", folds off by {fold_error(gammas, reference):.2g} rad"
                case = f"h/t {h_over_t:g}, {measure_name}, N {n}"
                goal = {4.0: 1e-2, 1.6: 2.5e-2}.get(h_over_t) if n == 64 else None
                goal = goal if measure_name == MEASURES[0] else None
                yield Row("curve error", case, errors[-1], "", goal, note)
            if measure_name == MEASURES[0]:
                yield from _extrapolated(h_over_t, until, reference)
            order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
            case = f"h/t {h_over_t:g}, {measure_name}, N {sizes[0]} ... {sizes[-1]}"
            yield Row("order", case, float(order), "", 2.0)


def _extrapolated(h_over_t: float, until: str | None, reference: ReferenceCurve) -> Iterator[Row]:
    """Curve error of the extrapolated path."""
    scene = _circle(
        h_over_t, n_edges=128, stability=False, contacts=False, until=until, error_bars=True
    )
    path = der.fold(scene)
    error = max(curve_error(path.gamma, path.moment, path.energy, reference))
    note = f"in {1e3 * path.timing.solve_s:.1f} ms"
    if reference.folds:
        gammas = [point.gamma for point in path.folds]
        note += f", folds off by {fold_error(gammas, reference):.2g} rad"
    goal = 2e-5 if h_over_t == 4.0 else 3e-4
    yield Row("curve error", f"h/t {h_over_t:g}, error bars, N 128", error, "", goal, note)


def _newton(sizes: tuple[int, ...]) -> Iterator[Row]:
    """One Newton iteration of the full ring, assembly, factorisation and solve, over N.

    Timed as whole solves at a given gamma; the last pass of a solve, for tangent and index, costs
    an iteration, and so does its share of the call.
    """
    for n in sizes:
        ring = sector(der.circle(), der.rectangular_section(4.0), n, name="full")
        flat = equilibrium(ring.body, ring.held, ring.start)
        rate = flat.tangent
        start = moved(ring.held, flat.state, Direction(0.1 * rate.q, 0.1 * rate.force, 0.1))

        def solve(ring: Sector = ring, start: State = start) -> Equilibrium:
            return equilibrium(ring.body, ring.held, start, control=Control.LOAD)

        solved = solve()
        many = max(1, 2048 // n)
        seconds = cpu_time(lambda solve=solve, many=many: [solve() for _ in range(many)], 7)  # type: ignore[misc]
        seconds /= many * (solved.iterations + 1)
        goal = 0.15 if n == 64 else None
        note = f"{1e6 * seconds / n:.2f} us an edge, residual {solved.residual:.1e}"
        yield Row("newton", f"full ring, N {n}", 1e3 * seconds, "ms", goal, note)
        yield Row("memory", f"full ring, N {n}", _bytes(ring) / n, "B/edge", 4096.0)


def _bytes(ring: Sector) -> int:
    """Bytes that one iteration holds at once: state, derivatives and factors."""
    state, held = ring.start, ring.held
    system = assemble(ring.body, held, state.quat, state.stretch, state.force, state.load)
    blocks = take_out(held.free, system.diag, system.off, system.border)
    factors = factor(*blocks)
    arrays = [*state.__dict__.values(), *held, *ring.body, *system, *blocks, *factors]
    total = sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))
    return total


def _start_up(repeats: int) -> Iterator[Row]:
    """Wall time of whole commands, compiled before."""
    for words, goal in (
        (["--help"], 0.5),
        (["fold", "circle", "--h-over-t", "4", "--quiet"], 3.0),
    ):
        times = []
        for _ in range(repeats):
            start = time.perf_counter()
            subprocess.run([sys.executable, "-m", "der", *words], check=True, capture_output=True)
            times.append(time.perf_counter() - start)
        yield Row("start-up", "der " + " ".join(words), statistics.median(times), "s", goal)
