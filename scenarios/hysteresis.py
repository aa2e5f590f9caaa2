"""Turn four rings up to pi and back: each snaps on both ways, at different folds.

The paper's cases (Figs. 7b, 11 and D.1b), where its finite elements, loaded and unloaded by the
angle, leave the rod's path of equilibria at its folds. Here the rod itself is loaded and unloaded;
where it snaps, dynamic relaxation carries it to rest. Three claims are checked:

    loop      4 times the loop integral of M dgamma is what the snaps release together
    landing   every snap ends in a state of the path of equilibria, which is followed by arc length
    folds     every snap begins at one of its folds

    python -m scenarios.hysteresis [DIR]

writes hysteresis.png and .csv, and json, png, npz and rrd of each ring, to DIR (out/hysteresis).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as File

import numpy as np

import der
from der.utils.files import write_whole
from scenarios.output import folder, usage, write
from scenarios.snapping_rings import SNAPPING

if __name__ == "__main__":
    usage(__file__, __doc__)

EDGES = 128
LOADS = tuple(np.linspace(0.0, math.pi, 257))  # states at these, so that integrals are accurate
_GAUSS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Landing:
    """Where a snap ends, beside the path of equilibria."""

    point: der.Point
    distance: float  # of the nearest state of the path at that gamma: of any vertex, a
    position: int  # of that state
    folds: int  # passed by the path before it


@dataclass(frozen=True)
class Loop:
    """One ring, its path of equilibria and its way up and down."""

    name: str
    equilibria: der.Path
    turned: der.Path

    @property
    def snaps(self) -> list[der.Point]:
        """Landings, in order."""
        return [point for point in self.turned.points if point.kind == "snap"]

    @property
    def released(self) -> list[float]:
        """Energy that each snap releases, GJ/a."""
        return [float(str(snap.details["energy_released"])) for snap in self.snaps]

    @cached_property
    def work(self) -> float:
        """Work done on the full ring, 4 times the loop integral of M dgamma, GJ/a."""
        gamma, moment = self.turned.gamma, self.turned.moment
        return 4.0 * sum(_area(gamma[piece], moment[piece]) for piece in self._pieces())

    def _pieces(self) -> Iterator[slice]:
        """The smooth pieces of the way: cut over each snap, and where gamma is turned back."""
        top = int(np.argmax(self.turned.gamma))
        landed = {snap.position for snap in self.snaps}
        first = 0
        for k in sorted({*landed, top}):
            yield slice(first, k if k in landed else k + 1)
            first = k
        yield slice(first, len(self.turned))

    @cached_property
    def landings(self) -> list[Landing]:
        """Every snap beside the state of the path that is nearest to it."""
        return [_landing(self, snap) for snap in self.snaps]


def _area(gamma: np.ndarray, moment: np.ndarray) -> float:
    """Integral of M dgamma along a smooth curve through states, a spline of its chord length."""
    from scipy.interpolate import CubicSpline

    scaled = np.column_stack([gamma / math.pi, moment / np.abs(moment).max()])
    chord = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(scaled, axis=0), axis=1)))
    apart = np.append(True, np.diff(chord) > 1e-7)
    s, spline = chord[apart], CubicSpline(chord[apart], np.column_stack([gamma, moment])[apart])
    half = 0.5 * np.diff(s)[:, None]
    at = s[:-1, None] + half * (1.0 + _GAUSS[0])
    return float(np.sum(half * _GAUSS[1] * spline(at)[..., 1] * spline(at, 1)[..., 0]))


def _landing(loop: Loop, snap: der.Point) -> Landing:
    """The state of the path at a landing's gamma whose vertices are nearest to the ring's."""
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
    section = der.rectangular_section(h_over_t)
    scene = der.Scene(ring, section, n_edges=EDGES, contacts=False, shapes=True, save_at=LOADS)
    turned = der.fold(replace(scene, control="angle", unload=True, history=True))
    landed = {point.gamma for point in turned.points if point.kind == "snap"}
    return Loop(name, der.fold(replace(scene, save_at=tuple({*LOADS, *landed}))), turned)


loops = {name: loop(name) for name in SNAPPING}


def draw(place: File) -> list[File]:
    """Write hysteresis.png and its data, hysteresis.csv: every state of every way."""
    from scenarios.hysteresis_plot import save_loops

    rows = ["ring,way,gamma,moment,energy"]
    for one in loops.values():
        top = int(np.argmax(one.turned.gamma))
        ways = (
            ("equilibrium", one.equilibria, slice(None)),
            ("loading", one.turned, slice(0, top + 1)),
            ("unloading", one.turned, slice(top, None)),
        )
        for way, path, part in ways:
            states = zip(path.gamma[part], path.moment[part], path.energy[part], strict=True)
            rows += [f"{one.name},{way},{g!r},{m!r},{u!r}" for g, m, u in _floats(states)]
    picture, data = place / "hysteresis.png", place / "hysteresis.csv"
    save_loops(list(loops.values()), picture)
    content = ("\n".join(rows) + "\n").encode()
    write_whole(data, lambda file: file.write(content))
    return [picture, data]


def _floats(states: Iterable[tuple[float, ...]]) -> Iterator[tuple[float, ...]]:
    return (tuple(map(float, state)) for state in states)


def table() -> str:
    """Folds, landings and energies in a few lines of text."""
    rows = [
        f"{'':14}{'gamma':>9}{'M before':>10}{'M after':>10}{'released':>10}"
        f"{'to the path':>13}  lands after"
    ]
    for one in loops.values():
        for landing in one.landings:
            details = landing.point.details
            rows.append(
                f"{one.name:14}{landing.point.gamma:9.5f}{details['moment_before']:10.5f}"
                f"{details['moment_after']:10.5f}{details['energy_released']:10.6f}"
                f"{landing.distance:13.1e}  {landing.folds} folds"
            )
        released = sum(one.released)
        rows.append(f"{'':14}loop {one.work:.8f}, released {released:.8f}, ")
        rows[-1] += f"{abs(one.work - released):.1e} apart"
    return "\n".join(rows)


if __name__ == "__main__":
    for one in loops.values():
        write(one.turned, "hysteresis", stem=one.name)
    draw(folder("hysteresis"))
    print(table())
