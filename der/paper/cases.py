"""The contents of the figures: rings with their sections, and the states of their paths."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from der.bvp.solve import solve_bvp
from der.geometry.ring import Ring
from der.geometry.section import rectangular_section
from der.records.configurations import Shapes
from der.records.path import Mode, Path, Point
from der.scene import Scene
from der.utils.checks import Array
from der.viz.curve import arc_length
from der.viz.ribbon import unit
from der.viz.titles import folded_text

STATES = 64  # at least, from gamma = 0 to pi: the spline through them is then within 6e-4 of
PER = 8  # the panel of one through 1024, measured on every curve of the figures
N_EDGES = 256  # of a drawn ring: 10 in the sharpest fillet
SAME = 1e-6  # of the curve; states that are closer (a fold next to a saved state) make no slope
ARRIVED = 1e-9  # rad


@dataclass(frozen=True)
class Case:
    """A ring and the height over thickness of its section, with their labels.

    Parameters
    ----------
    label : what tells it from the others in its panel, "h/t = 4"; may hold mathtext.
    panel : the part of the figure that shows it; empty where there is but one.
    cut : the curve is drawn up to its first arrival at this gamma [rad] only.
    """

    label: str
    ring: Ring
    h_over_t: float
    panel: str = ""
    cut: float | None = None

    @property
    def name(self) -> str:
        """The case in a table: panel and label in plain letters."""
        return plain(f"{self.panel} {self.label}")

    def entries(self) -> list[str]:
        """Its cells in a table: `case`, then RING_COLUMNS of tables.py."""
        ring = self.ring.to_json()
        shape = ring["shape"]
        cells = [ring.get(name, "") for name in ("b_over_a", "r_over_a", "vertex_angle")]
        axis = ring["twist_axis"] if shape in ("ellipse", "rectangle") else ""
        return [self.name, str(shape), str(axis), *map(str, cells), repr(float(self.h_over_t))]

    def solve(
        self,
        *,
        save_at: Sequence[float] | None = None,
        shapes: bool = False,
        until: str | None = None,
    ) -> Path:
        """The path from gamma = 0 to pi, or until folded; saved at multiples of pi/STATES."""
        if save_at is None:
            turns = 1 if until is None else 2
            save_at = [math.pi * i / STATES for i in range(turns * STATES + 1)]
        section = rectangular_section(h_over_t=self.h_over_t)
        options: dict[str, Any] = {"shapes": shapes, "until": until, "save_at": save_at}
        return solve_bvp(Scene(self.ring, section, n_edges=N_EDGES, **options))


@dataclass(frozen=True, eq=False)
class Curve:
    """The states of a path that a figure shows.

    Attributes
    ----------
    states : (n, 6) array in path order, STATE_COLUMNS of tables.py
    points : folds and limits among them
    mode : of the complete path, None where it ends before pi
    shapes : of the states, None where they were not asked for
    """

    case: Case
    states: Array
    points: tuple[Point, ...]
    mode: Mode | None
    shapes: Shapes | None

    @property
    def gamma(self) -> Array:
        """Rotation of one grip [rad], (n,)."""
        return self.states[:, 0]

    @property
    def moment(self) -> Array:
        """Of one arm [GJ/a], (n,)."""
        return self.states[:, 1]

    @property
    def energy(self) -> Array:
        """Of the full ring [GJ/a], (n,)."""
        return self.states[:, 2]

    def first(self, gamma: float) -> int:
        """Position of the state of the first arrival at gamma, which was solved for."""
        return int(np.flatnonzero(np.abs(self.gamma - gamma) < ARRIVED)[0])


def curve_of(case: Case, path: Path) -> Curve:
    """The curve of a path, cut where the case says."""
    n = len(path)
    if case.cut is not None:
        n = int(np.flatnonzero(path.gamma >= case.cut - ARRIVED)[0]) + 1
    error = path.error or {}
    errors = [error.get(name, [math.nan] * len(path)) for name in ("gamma", "moment", "energy")]
    columns = [path.gamma, path.moment, path.energy, *errors]
    return Curve(
        case,
        np.array(columns, dtype=float).T[:n] + 0.0,  # no -0.0
        tuple(point for point in path.points if point.position < n),
        path.mode,
        path.shapes,
    )


def solved(cases: Iterable[Case], **options: Any) -> list[Curve]:
    """The curves of the cases; options are those of `solve`."""
    return [curve_of(case, case.solve(**options)) for case in cases]


def smooth(curve: Curve) -> Array:
    """Points (gamma, moment, energy), (m, 3), of a smooth curve through all states.

    It is the cubic spline over the chord length in all three, which can turn back at folds.
    """
    values = curve.states[:, :3]
    span = np.ptp(values, axis=0)
    values = values[np.append(True, np.diff(arc_length(values / span)) > SAME)]
    chord = arc_length(values / span)
    place = np.arange(PER * (len(chord) - 1) + 1) / PER
    return CubicSpline(chord, values)(np.interp(place, np.arange(len(chord)), chord))


def plain(words: str) -> str:
    """Words without mathtext."""
    words = words.replace("°", " degrees").replace("\\sqrt{3}", "sqrt(3)")
    return " ".join(words.replace("$", "").replace("\\", "").split())


def in_words(mode: Mode | None) -> str:
    """The folding mode in words: "stays folded when released, snap-back"."""
    if mode is None:
        return "ends before $\\pi$"
    if not mode.foldable:
        return "not foldable"
    snapping = "no snap" if mode.snapping == "none" else mode.snapping
    return f"{folded_text(mode)}, {snapping}"


def at_vertices(curve: Curve, k: int) -> tuple[Array, Array]:
    """Vertices and the directors d1 there, (N, 3) each, of a state with shapes."""
    if curve.shapes is None:
        raise ValueError(f"curve must have shapes to be drawn, got none for {curve.case.name!r}")
    d1 = curve.shapes.frames[k, :, 0]
    d1 = d1 + np.roll(d1, -1, axis=0)  # vertex j joins edges j and j + 1
    return curve.shapes.x[k], unit(d1)
