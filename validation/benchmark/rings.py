"""The rings on which the benchmark compares methods, and what is known of their paths.

The reference is the path of the boundary-value problem at a tolerance of 1e-11: a curve through
many more states than any method finds. Where AUTO-07p has computed the same ring, a row of the
benchmark says how far its states are from that curve.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import der
from der.analysis.curve_distance import ReferenceCurve, curve_error, fold_error, read_reference
from der.bvp.solve import FINEST, solve_with_points
from validation.benchmark.rows import Row, counts, finite

TABLES = Path(__file__).parents[1] / "reference"
SHIFTED = 61  # states at other places, which measure the error of that curve
NEAR = 1e-3  # of the scaled state; closer states make the curve's parameter uneven
BARE: Mapping[str, object] = {
    "stability": False,
    "self_crossings": False,
}  # the least one can ask for


class BenchRing(NamedTuple):
    """A ring, and the table that AUTO-07p has computed of it."""

    name: str
    ring: der.Ring
    h_over_t: float = 4.0
    table: str = ""
    folds: int = 0

    def scene(self, **wants: object) -> der.Scene:
        """The scene of the ring, with further entries."""
        return der.Scene(self.ring, der.rectangular_section(self.h_over_t), **wants)  # type: ignore[arg-type]


RINGS = (
    BenchRing("circle, h/t 4", der.circle(), table="circ_ht4"),
    BenchRing("circle, h/t 1.6", der.circle(), 1.6, "circ_ht1.6", 2),
    BenchRing("ellipse 0.85 about y", der.ellipse(0.85, "y"), 4.0, "ell_ba0.85_y_ht4", 2),
    BenchRing("rectangle 0.6, r/a 0.3", der.rectangle(0.6, 0.3), table="rect_ba0.6_ra0.3_x_ht4"),
    BenchRing("rectangle 0.6, r/a 0.05", der.rectangle(0.6, 0.05)),
    BenchRing(
        "triangle 90, r/a 1/30",
        der.triangle(math.pi / 2, 1 / 30),
        table="tri_aT90_ra0.0333_ht4",
        folds=2,
    ),
)


def circle(h_over_t: float, **wants: object) -> der.Scene:
    """The scene of a circle, with further entries."""
    return BenchRing("circle", der.circle(), h_over_t).scene(**wants)


@dataclass(frozen=True)
class Known:
    """What is known of a ring's path."""

    case: BenchRing
    curve: ReferenceCurve
    floor: float  # distance, in the scaled planes, below which the curve says nothing

    def errors(self, found: Any) -> Mapping[str, Any]:
        """Entries of a trial: normal distances in M and U, error of the folds' gamma, a note."""
        off = curve_error(found.gamma, found.moment, found.energy, self.curve)
        moment, energy = (max(error, self.floor) for error in off)
        if not isinstance(found, der.Path):
            return {"moment": moment, "energy": energy, "note": found.note}
        folds, note = None, counts(found)
        if self.curve.folds:
            folds = finite(fold_error([point.gamma for point in found.folds], self.curve))
            if folds is None:
                note += f"; {len(found.folds)} of {len(self.curve.folds)} folds"
        return {"moment": moment, "energy": energy, "folds": folds, "note": note}


@cache  # several parts of the benchmark ask for the same
def known(case: BenchRing, states: int) -> Known:
    """Solve for the path at many states, and judge the curve through them by others."""
    curve = _curve(case, states, 0.0)
    other = _curve(case, SHIFTED, 0.37)
    floor = max(curve_error(other.gamma, other.moment, other.energy, curve))
    return Known(case, curve, max(floor, FINEST))


def _curve(case: BenchRing, states: int, shift: float) -> ReferenceCurve:
    places = (np.arange(1, states) + shift) * math.pi / states
    path, points = solve_with_points(case.scene(save_at=tuple(places)), tolerance=FINEST)
    others = np.array([point.solution.p for point in points])
    scaled = np.column_stack([path.gamma, path.moment, path.energy, others])
    scaled /= np.abs(scaled).max(axis=0)
    kept = [0]
    for k, state in enumerate(scaled):
        if np.linalg.norm(state - scaled[kept[-1]]) > NEAR:
            kept.append(k)
    kept[-1] = len(scaled) - 1  # the last state is always kept
    folds = tuple(point.gamma for point in path.folds)
    return ReferenceCurve(
        path.gamma[kept], path.moment[kept], path.energy[kept], others[kept], folds
    )


def rows(truth: Known) -> Iterator[Row]:
    """How well the reference is known, by itself and by AUTO-07p."""
    name = truth.case.name
    note = f"{len(truth.curve.gamma)} states at {FINEST:g}; the curve through others, judged by 61"
    yield Row("reference", name, truth.floor, "", note=note)
    if truth.case.table:
        auto = read_reference(TABLES / f"{truth.case.table}.csv")
        off = max(curve_error(auto.gamma, auto.moment, auto.energy, truth.curve))
        apart = f"{fold_error(truth.curve.folds, auto):.1e}" if auto.folds else ""
        note = f"folds {apart} rad apart" if apart else ""
        yield Row("reference", f"{name}, states of AUTO-07p off it", off, "", note=note)
