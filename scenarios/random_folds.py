"""Fold 500 random rings under every control, and list the paths that end early.

Rings and sections are drawn from the ranges of the paper's phase diagrams. Their paths are followed
by arclength, loaded and unloaded by the angle, and loaded by a dead moment. The ring itself can end
a path early: a mode breaks the symmetry of the sector, or gamma turns back and the path leads to
-pi. Any other early end is a defect of the solver. The energy of paths
followed by arclength is also compared with the work done, the integral of 4 M dgamma.

    python -m scenarios.random_folds [--count N] [--seed N] [--edges N] [--out DIR]

prints a table and writes stops.csv to DIR (default: out/random_folds).
"""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

import der
from der.analysis.work import work_missing
from scenarios.output import Arguments, write_table

WAYS: dict[str, dict[str, object]] = {
    "arclength": {"control": "arclength"},
    "angle, up and down": {"control": "angle", "unload": True},
    "moment": {"control": "moment"},
}
# ends that are caused by the ring, and not by the solver
ANSWERS = (der.Reason.BREAKS_SYMMETRY.word, der.Reason.TURNED_BACK.word)
LOOSE = 1e-3  # of U: what the work between states is known to by interpolation
DENSE = 256  # states from 0 to pi where the path's own leave the work in doubt


def random_rings(count: int, seed: int) -> Iterator[tuple[der.Ring, der.Section]]:
    """Rings and sections, uniform over the ranges of figures 2, 3, 5 and 8; circles in log h/t.

    nu is uniform from 0 to 0.5, or one of 0, 0.3 and 0.5.
    """
    random = np.random.default_rng(seed)
    for _ in range(count):
        shape = random.choice(["circle", "ellipse", "rectangle", "triangle"])
        axis = str(random.choice(["x", "y"]))
        nu = float(random.choice([0.0, 0.3, 0.5, random.uniform(0.0, 0.5)]))
        h_over_t = float(random.uniform(1.0, 4.0))
        if shape == "circle":
            ring = der.circle()
            h_over_t = float(np.exp(random.uniform(math.log(0.2), math.log(60.0))))
        elif shape == "ellipse":
            ring = der.ellipse(float(random.uniform(0.5, 1.0)), axis)
            h_over_t = float(random.uniform(0.2, 4.0))
        elif shape == "rectangle":
            b = float(random.uniform(0.2, 1.0))
            ring = der.rectangle(b, float(random.uniform(0.1, b)), axis)
        else:
            apex = math.radians(float(random.uniform(30.0, 120.0)))
            inscribed = 0.5 * math.tan(math.pi / 4 - apex / 4)
            ring = der.triangle(apex, float(random.uniform(0.033, inscribed)))
        yield ring, der.rectangular_section(h_over_t, nu)


@dataclass(frozen=True)
class Stop:
    """A path that ended early."""

    way: str
    ring: der.Ring
    section: der.Section
    explained: bool
    message: str

    @property
    def row(self) -> list[object]:
        """Entries of the table."""
        words = json.dumps(self.ring.to_json())
        s = self.section
        return [self.way, self.explained, words, s.alpha, s.beta, self.message]


@dataclass(frozen=True)
class Tried:
    """The results of all rings."""

    count: int
    stops: tuple[Stop, ...]
    folded: int  # by arc length, three-covered at pi
    snaps: int  # by the angle, up and down
    seconds: dict[str, float]  # by way

    def of(self, way: str, *, explained: bool) -> int:
        """Number of stops."""
        return sum(stop.way == way and stop.explained == explained for stop in self.stops)


def tried(count: int, seed: int, n_edges: int = 64) -> Tried:
    """Fold ``count`` rings in every way."""
    stops: list[Stop] = []
    folded = snaps = 0
    seconds = dict.fromkeys(WAYS, 0.0)
    for ring, section in random_rings(count, seed):
        for way, options in WAYS.items():
            started = time.process_time()
            scene = der.Scene(ring, section, n_edges=n_edges, self_crossings=False, **options)  # type: ignore[arg-type]
            try:
                path = der.fold(scene)
            except der.NotConverged as failure:
                path = failure.path
                stops.append(Stop(way, ring, section, path.reason in ANSWERS, path.message))
            else:
                stops += [Stop(way, ring, section, False, m) for m in faults(scene, path)]
            seconds[way] += time.process_time() - started
            if way == "arclength":
                folded += path.mode is not None and path.mode.foldable
            snaps += sum(point.kind == "snap" for point in path.points)
    return Tried(count, tuple(stops), folded, snaps, seconds)


def faults(scene: der.Scene, path: der.Path) -> list[str]:
    """Sentences on what is wrong with a path that ended."""
    end = 0.0 if scene.unload else math.pi
    found = [f"ends at gamma = {path.gamma[-1]:.6f}"] if path.gamma[-1] != end else []
    return found + (work_faults(scene, path) if scene.control == "arclength" else [])


def work_faults(
    scene: der.Scene, path: der.Path, solver: Callable[[der.Scene], der.Path] = der.fold
) -> list[str]:
    """A sentence where the energy of a path is not the work done, on dense states either."""
    if work_missing(path) <= LOOSE:
        return []
    dense = tuple(np.linspace(0.0, math.pi, DENSE + 1))  # too few states, or a broken path?
    missing = work_missing(solver(replace(scene, save_at=dense)))
    return [f"U and the work differ by {missing:.2g} of U"] if missing > LOOSE else []


def main() -> None:
    """Run and print."""
    asked = Arguments(__file__, __doc__).parse(count=500, seed=1, edges=64)
    found = tried(asked.count, asked.seed, asked.edges)
    columns = ["way", "explained", "ring", "alpha", "beta", "message"]
    write_table(asked.out / "stops.csv", columns, (stop.row for stop in found.stops))
    for stop in found.stops:
        print(*stop.row, sep=" | ")
    print(f"{'way':20s} {'rings':>6s} {'unexplained':>12s} {'answers':>12s} {'CPU s':>8s}")
    for way in WAYS:
        counts = [found.of(way, explained=explained) for explained in (False, True)]
        line = f"{way:20s} {found.count:6d} {counts[0]:12d} {counts[1]:12d}"
        print(f"{line} {found.seconds[way]:8.1f}")
    print(f"{found.folded} of {found.count} folded at pi; {found.snaps} snaps")
    kinds = Counter(stop.message.split(":")[-1].strip()[:60] for stop in found.stops)
    for kind, number in kinds.most_common():
        print(f"{number:4d}  {kind}")


if __name__ == "__main__":
    main()
