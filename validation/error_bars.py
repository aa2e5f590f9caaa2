"""How many error bars hold, over random rings: `python -m validation error-bars`.

Three rings of five are those of the paper's phase diagrams (`scenarios.random_folds`); of the other
two, one has a piecewise-linear natural curvature, and one is drawn through 8 to 200 points. Each is
folded with error bars on 64 and on 128 edges. Every value with an error bar is held against the
boundary-value problem, solved to 1e-10; the errors of both are added. The kinds are

    state    every state but folds: normal distances of M and of U, as `der compare` judges them
    fold, limit    gamma, M and U of each; paired in path order where both solvers find equally many
    branch   the same against three finer rods, extrapolated: the other solver has no branch points
    at pi    M and U of the state at gamma = pi; and its *slope*, dM/dgamma

A thing is inside if all its values lie within their bars; it has no bar if one of them has none. It
is unpaired if the other path has no counterpart. Rings that a solver cannot follow are counted.
"""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import der
from der.analysis.compare import compare
from der.continuation.richardson import romberg
from der.errors import NotConverged
from der.geometry.outline import PiecewiseLinear, reflected
from der.records.path import NUMBERS, Path
from der.scene import Scene
from der.utils.checks import Array
from scenarios.random_folds import random_rings

TOLERANCE = 1e-10  # of the boundary-value problem
FINER = (1024, 512, 256)  # edges of the rods that branch points are held against
KINDS = ("state", "fold", "limit", "branch", "at pi", "slope")
SHAPES = ("paper", "knots", "points")
POINTS = (8, 12, 16, 24, 48, 100, 200)


# --- Rings -----------------------------------------------------------------------------------


def rings(count: int, seed: int) -> Iterator[tuple[str, der.Ring, der.Section]]:
    """Rings with their sections, and which of `SHAPES` each is."""
    random = np.random.default_rng(seed)
    papers = random_rings(count, seed)
    for k in range(count):
        shape = ("paper", "knots", "paper", "points", "paper")[k % 5]
        if shape == "paper":
            yield shape, *next(papers)
            continue
        ring = _of_knots(random) if shape == "knots" else _of_points(random)
        nu = float(random.choice([0.0, 0.3, 0.5, random.uniform(0.0, 0.5)]))
        yield shape, ring, der.rectangular_section(float(random.uniform(1.0, 4.0)), nu)


def _of_knots(random: np.random.Generator) -> der.Ring:
    """A closed ring of piecewise-linear curvature, at times with jumps; of C2 or D2 symmetry."""
    n = int(random.integers(2, 6))
    knots = np.append(0.0, np.cumsum(random.uniform(0.2, 1.0, n)))
    start, end = random.uniform(0.1, 2.0, (2, n))
    smooth = random.random(n - 1) < 0.8
    start[1:][smooth] = end[:-1][smooth]
    if random.random() < 0.5:
        knots, start, end = reflected(knots, start, end)
    scale = math.pi / float(np.diff(knots) @ (start + end) / 2)
    knots, start, end = knots * scale, *_closed(knots * scale, start, end)
    s, k = np.repeat(knots, 2)[1:-1], np.column_stack([start, end]).ravel()
    return der.profile(np.append(s, 2.0 * s[-1] - s[::-1]), np.append(k, k[::-1]))


def _closed(knots: Array, start: Array, end: Array) -> tuple[Array, Array]:
    """Curvature of a half that turns by pi and ends on its axis: changed by a + b cos(pi s/S)."""
    from scipy.optimize import root

    wave = np.cos(math.pi * knots / knots[-1])

    def changed(p: Array) -> tuple[Array, Array]:
        return start + p[0] + p[1] * wave[:-1], end + p[0] + p[1] * wave[1:]

    def gap(p: Array) -> tuple[float, float]:
        half = PiecewiseLinear.integrated(knots, *changed(p))
        return float(half.knot_angle[-1]) - math.pi, float(half.knot_place[-1].real)

    return changed(root(gap, np.zeros(2), tol=1e-13).x)


def _of_points(random: np.random.Generator) -> der.Ring:
    """A ring through points of r = 1 + sum of e_m cos(m theta), m = 2 to 4."""
    n = int(random.choice(POINTS))
    theta = 2.0 * math.pi * np.arange(n) / n
    size = [float(random.uniform(-0.3, 0.3)) / (m * m - 1) for m in (2, 3, 4)]
    r = 1.0 + sum(e * np.cos(m * theta) for m, e in zip((2, 3, 4), size, strict=True))
    return der.profile(points=np.column_stack([r * np.sin(theta), -r * np.cos(theta)]))


# --- What lies outside -----------------------------------------------------------------------


@dataclass(frozen=True)
class Judged:
    """One thing with error bars, or without."""

    kind: str
    gamma: float
    times: float | None  # its largest error over its error bar; None: it has none


def judged(scene: Scene) -> Iterator[Judged]:
    """Everything on the path of a scene with error bars; NaN for what has no counterpart."""
    rod = der.fold(scene)
    found = compare(scene, rod, tolerance=TOLERANCE)
    for state in found.states:
        sizes = (state.moment_distance, state.energy_distance)
        yield Judged("state", state.gamma, _times(sizes, (state.moment_bar, state.energy_bar)))
    for kind in ("fold", "limit"):
        theirs = [_values(found.bvp, p.position) for p in found.bvp.points if p.kind == kind]
        yield from _points(rod, kind, theirs)
    if rod.branches:
        yield from _points(rod, "branch", _branch_points(scene))
    if rod.at_pi is not None and found.bvp.at_pi is not None:
        yield from _at_pi(rod, found.bvp)


def _times(sizes: Sequence[float], bars: Sequence[float | None]) -> float | None:
    """The largest quotient of an error and its bar; equal numbers need none."""
    if None in bars:
        return None
    known = [bar for bar in bars if bar is not None]
    return max(
        0.0 if size == 0.0 else math.inf if bar == 0.0 else size / bar
        for size, bar in zip(sizes, known, strict=True)
    )


Values = tuple[Array, Array]  # gamma, M and U, and their errors


def _values(path: Path, k: int) -> Values:
    """Values of the boundary-value problem, and their errors; at least the tolerance."""
    errors: Mapping[str, Any] = path.error or {}
    scales = np.array([math.pi, np.abs(path.moment).max(), np.abs(path.energy).max()])
    return (
        np.array([getattr(path, name)[k] for name in NUMBERS]),
        np.array([errors[name][k] for name in NUMBERS]) + TOLERANCE * scales,
    )


def _points(rod: Path, kind: str, theirs: Sequence[Values]) -> Iterator[Judged]:
    """The special points of one kind."""
    ours = [point for point in rod.points if point.kind == kind]
    paired = len(ours) == len(theirs)
    for k, point in enumerate(ours):
        times = _off(rod, point.position, theirs[k]) if paired else math.nan
        yield Judged(kind, point.gamma, times)


def _off(rod: Path, k: int, theirs: Values) -> float | None:
    """How many times its error bars a state of the rod is off others' gamma, M and U."""
    errors: Mapping[str, Any] = rod.error or {}
    values, more = theirs
    sizes = np.abs([getattr(rod, name)[k] for name in NUMBERS] - values)
    bars = [errors[name][k] for name in NUMBERS]
    sums = [None if b is None else b + e for b, e in zip(bars, more.tolist(), strict=True)]
    return _times(sizes.tolist(), sums)


def _branch_points(scene: Scene) -> list[Values]:
    """Branch points by Romberg extrapolation of finer rods; none where these do not agree."""
    plain = replace(scene, error_bars=False, self_crossings=False, save_at=())
    paths = [der.fold(replace(plain, n_edges=n)).branches for n in FINER]
    if len({len(points) for points in paths}) > 1:
        return []
    tables = np.array([[[getattr(p, n) for n in NUMBERS] for p in points] for points in paths])
    return [
        (last[2], np.abs(last[2] - last[1])) for last in map(romberg, tables.transpose(1, 0, 2))
    ]


def _at_pi(rod: Any, bvp: Any) -> Iterator[Judged]:
    """M, U and dM/dgamma at the first arrival at pi."""
    errors: Mapping[str, Any] = rod.error or {}
    k, i = (path.gamma.tolist().index(math.pi) for path in (rod, bvp))
    yield Judged("at pi", math.pi, _off(rod, k, _values(bvp, i)))
    bar, here, there = errors["slope_at_pi"], *(path.at_pi.slope for path in (rod, bvp))
    allowed = None if bar is None else bar + TOLERANCE * max(1.0, abs(there))
    yield Judged("slope", math.pi, _times([abs(here - there)], [allowed]))


# --- The count -------------------------------------------------------------------------------


@dataclass
class Survey:
    """What has been judged."""

    found: list[dict[str, Any]] = field(default_factory=list)  # a row for each thing
    failed: Counter[str] = field(default_factory=Counter)  # by edges and reason
    interrupted: bool = False

    def add(self, shape: str, scene: Scene) -> None:
        """Judge a ring."""
        try:
            things = list(judged(scene))
        except NotConverged as failure:
            self.failed[f"{scene.n_edges} edges: {failure.path.reason}"] += 1
            return
        section = {"alpha": scene.section.alpha, "beta": scene.section.beta}
        case = {"ring": scene.ring.to_json(), "section": section}
        rows = [{"shape": shape, "edges": scene.n_edges, **vars(thing)} for thing in things]
        self.found += [row if _inside(row["times"]) else row | case for row in rows]

    def __str__(self) -> str:
        """A table of shares."""
        heads = ("edges", "kind", *SHAPES, "all", "outside", "no bar", "unpaired", "worst")
        lines = ["".join(f"{head:>9}" for head in heads)]
        for edges in sorted({row["edges"] for row in self.found}):
            for kind in KINDS:
                rows = [r for r in self.found if (r["edges"], r["kind"]) == (edges, kind)]
                lines.append("".join(f"{one:>9}" for one in (edges, kind, *_shares(rows))))
        lines += [f"not judged, {reason}: {count}" for reason, count in self.failed.items()]
        return "\n".join(lines)


def _inside(times: float | None) -> bool:
    return times is not None and times <= 1.0


def _shares(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Per cent inside their bars, by shape and of all; and how many are not, and why."""
    for shape in (*SHAPES, None):
        of = [r["times"] for r in rows if shape in (None, r["shape"])]
        known = [times for times in of if times is not None and not math.isnan(times)]
        yield f"{100.0 * sum(map(_inside, known)) / len(known):.1f} %" if known else "-"
    yield str(len(known) - sum(map(_inside, known)))
    yield str(of.count(None))
    yield str(len(of) - len(known) - of.count(None))
    yield f"{max(known):.3g}" if known else "-"


def survey(count: int, seed: int, edges: Sequence[int] = (64, 128)) -> Survey:
    """Judge random rings, until Ctrl-C."""
    done = Survey()
    try:
        for k, (shape, ring, section) in enumerate(rings(count, seed)):
            for n in edges:
                done.add(shape, Scene(ring, section, n_edges=n, error_bars=True))
            if sys.stderr.isatty():
                print(f"\r{k + 1} of {count} rings", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        done.interrupted = True
    return done


def saved(done: Survey) -> str:
    """Every judged thing as JSON; those outside, without bar or pair with their ring."""
    rows = [row | {"times": _plain(row["times"])} for row in done.found]
    return json.dumps({"judged": rows, "failed": done.failed}, allow_nan=False) + "\n"


def _plain(times: float | None) -> float | str | None:
    return times if times is None or math.isfinite(times) else str(times)
