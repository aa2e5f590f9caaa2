"""Fold 500 rings at random in every way there is, and list the stops that nobody has explained.

Rings and sections of the ranges of the paper's phase diagrams are
followed by the arc length, turned up and down by the angle, and loaded by a dead moment. A stop
that says what the ring does, where it breaks a symmetry that the sector keeps or its path leads
back beyond -pi, is an answer; any other is a defect of the solver. Followed paths are held against
the work done, too: U is the integral of 4 M dgamma.

    python -m scenarios.random_folds [--count N] [--seed N] [--edges N] [--out DIR]

prints a table and writes stops.csv to DIR (default: out/random_folds).
"""

from __future__ import annotations

import csv
import json
import math
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path as File

import numpy as np

import der
from der.geometry.ring import Ring
from der.geometry.section import Section
from der.records.path import Path
from validation.arguments import Arguments
from validation.stress.random_rings import LOOSE, random_rings, work_missing

WAYS: dict[str, dict[str, object]] = {
    "arclength": {"control": "arclength"},
    "angle, up and down": {"control": "angle", "unload": True},
    "moment": {"control": "moment"},
}
ANSWERS = ("break the symmetry", "breaks the symmetry", "turned back")  # in a stop's sentence
DENSE = 256  # states from 0 to pi where the path's own leave the work in doubt


@dataclass(frozen=True)
class Stop:
    """A path that did not end as it should."""

    way: str
    ring: Ring
    section: Section
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
    """What became of the rings."""

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
                message = str(failure)
                stops.append(Stop(way, ring, section, is_answer(message), message))
                path = failure.path
            else:
                stops += [Stop(way, ring, section, False, m) for m in faults(scene, path)]
            seconds[way] += time.process_time() - started
            if way == "arclength":
                folded += path.mode is not None and path.mode.foldable
            snaps += sum(point.kind == "snap" for point in path.points)
    return Tried(count, tuple(stops), folded, snaps, seconds)


def is_answer(message: str) -> bool:
    """Whether a stop says what the ring does, and not that the solver has failed."""
    return any(words in message for words in ANSWERS)


def faults(scene: der.Scene, path: Path) -> list[str]:
    """Sentences on what is wrong with a path that ended."""
    found = []
    end = 0.0 if scene.unload else math.pi
    if path.gamma[-1] != end:
        found.append(f"ends at gamma = {path.gamma[-1]:.6f}")
    if scene.control == "arclength" and work_missing(path) > LOOSE:  # too few states, or broken?
        dense = tuple(np.linspace(0.0, math.pi, DENSE + 1))
        missing = work_missing(der.fold(replace(scene, save_at=dense)))
        if missing > LOOSE:
            found.append(f"U and the work differ by {missing:.2g} of U")
    return found


def main() -> None:
    """Run and print."""
    parser = Arguments(__file__, __doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--edges", type=int, default=64)
    parser.add_argument("--out", type=File, default=File("out/random_folds"))
    asked = parser.parse_args()
    found = tried(asked.count, asked.seed, asked.edges)
    asked.out.mkdir(parents=True, exist_ok=True)
    with (asked.out / "stops.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["way", "explained", "ring", "alpha", "beta", "message"])
        table.writerows(stop.row for stop in found.stops)
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
