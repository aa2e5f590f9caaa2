"""Loading and unloading of four rings by the angle: each snaps both ways, at different folds.

These are the paper's cases (Figs. 7b, 11 and D.1b). Its finite elements, loaded and unloaded by the
angle, leave the path of equilibria at its folds. Here the discrete rod is loaded and unloaded;
where it snaps, dynamic relaxation finds the equilibrium in which it ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as File

import numpy as np

from der.analysis.fold import fold
from der.analysis.work import work
from der.geometry.section import rectangular_section
from der.paper.snapping_rings import SNAPPING
from der.paper.tables import write_table
from der.records.path import Path, Point
from der.scene import Scene
from der.utils.files import FilePath

EDGES = 128
LOADS = tuple(np.linspace(0.0, math.pi, 321))  # states at these, so that integrals are accurate
# rad, from a fold: there gamma is quadratic along the path
BESIDE = tuple(LOADS[1] * (k / 4) ** 2 for k in range(1, 5))


@dataclass(frozen=True)
class Landing:
    """The end state of a snap, beside the path of equilibria."""

    point: Point
    distance: float  # to the nearest state of the path at that gamma: of any vertex, a
    position: int  # of that state
    folds: int  # passed by the path before it


@dataclass(frozen=True)
class Loop:
    """One ring: its path of equilibria, and its path under loading and unloading."""

    name: str
    equilibria: Path
    turned: Path

    @property
    def top(self) -> int:
        """Position of the state at which unloading begins."""
        return int(np.argmax(self.turned.gamma))

    @property
    def snaps(self) -> list[Point]:
        """End states of snaps, in order."""
        return [point for point in self.turned.points if point.kind == "snap"]

    @property
    def released(self) -> list[float]:
        """Energy that each snap releases, GJ/a."""
        return [float(str(snap.details["energy_released"])) for snap in self.snaps]

    @cached_property
    def work(self) -> float:
        """Work done on the full ring, 4 times the loop integral of M dgamma, GJ/a."""
        gamma, moment = self.turned.gamma, self.turned.moment
        return sum(float(work(gamma[part], moment[part])[-1]) for part in self._smooth_parts())

    def _smooth_parts(self) -> Iterator[slice]:
        """Parts of the path that are smooth: it is cut at each snap, and where unloading begins."""
        landed = {snap.position for snap in self.snaps}
        first = 0
        for k in sorted({*landed, self.top}):
            yield slice(first, k if k in landed else k + 1)
            first = k
        yield slice(first, len(self.turned))

    @cached_property
    def landings(self) -> list[Landing]:
        """The end state of every snap, beside the state of the path that is nearest to it."""
        return [_landing(self, snap) for snap in self.snaps]


def _landing(loop: Loop, snap: Point) -> Landing:
    """The state of the path, at the gamma of a snap, whose vertices are nearest to the ring's."""
    path, turned = loop.equilibria, loop.turned
    if path.shapes is None or turned.shapes is None:
        raise ValueError("paths must have shapes to be compared")
    here = np.flatnonzero(np.abs(path.gamma - snap.gamma) < 1e-12)
    away = np.linalg.norm(path.shapes.x[here] - turned.shapes.x[snap.position], axis=2).max(axis=1)
    position = int(here[np.argmin(away)])
    folds = sum(fold.position <= position for fold in path.folds)
    return Landing(snap, float(away.min()), position, folds)


def loop(name: str) -> Loop:
    """One of the `SNAPPING` rings, loaded and unloaded."""
    ring, h_over_t = SNAPPING[name]
    section = rectangular_section(h_over_t)
    scene = Scene(ring, section, n_edges=EDGES, self_crossings=False, shapes=True, save_at=LOADS)
    folds = fold(replace(scene, shapes=False, stability=False, save_at=())).folds
    beside = {point.gamma + sign * away for point in folds for away in BESIDE for sign in (-1, 1)}
    loads = tuple(sorted({*LOADS, *beside}))
    turned = fold(replace(scene, control="angle", unload=True, history=True, save_at=loads))
    landed = {point.gamma for point in turned.points if point.kind == "snap"}
    return Loop(name, fold(replace(scene, save_at=tuple({*LOADS, *landed}))), turned)


def hysteresis(folder: FilePath) -> list[File]:
    """Moments and energies of loading and unloading, over the path of equilibria."""
    return write_loops([loop(name) for name in SNAPPING], folder)


def write_loops(loops: list[Loop], folder: FilePath) -> list[File]:
    """Write hysteresis.png and, of every state, hysteresis.csv; return the files."""
    from der.paper.canvas import save
    from der.paper.hysteresis_plot import figure_of_loops

    rows = [
        [one.name, way, *map(float, state)]
        for one in loops
        for way, path, part in (
            ("equilibrium", one.equilibria, slice(None)),
            ("loading", one.turned, slice(0, one.top + 1)),
            ("unloading", one.turned, slice(one.top, None)),
        )
        for state in zip(path.gamma[part], path.moment[part], path.energy[part], strict=True)
    ]
    columns = ("ring", "way", "gamma", "moment", "energy")
    data = write_table(File(folder) / "hysteresis.csv", columns, rows)
    return [save(figure_of_loops(loops), File(folder) / "hysteresis.png"), data]
