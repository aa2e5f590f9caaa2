"""What was found on the path of a boundary-value problem, and the record of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from der.bvp.collocation import Collocation, Solution
from der.bvp.events import Point
from der.bvp.full_ring import full_ring, turning
from der.bvp.gauss import Array
from der.bvp.released import index_free, planar
from der.bvp.step import Statistics
from der.errors import Reason
from der.geometry.mesh import sites
from der.records import path as records
from der.records.configurations import Shapes
from der.records.path import NO_MOMENT, AtPi, Mode, Path, Timing, folding_mode, release
from der.scene import Scene
from der.utils.run import Run

FLAT = 1e-6  # out-of-plane extent of a folded ring, a
HOW = (
    "change of the state, across the path, on a collocation mesh of half the intervals' length; "
    "Gauss collocation of 4 stages, of order 8 at the ends of intervals"
)


@dataclass
class Followed:
    """A path as far as it has been followed."""

    scene: Scene
    system: Collocation
    tolerance: float
    points: list[Point] = field(default_factory=list)
    statistics: Statistics = field(default_factory=Statistics)

    @property
    def turned_back(self) -> bool:
        """Whether the path ends at -gamma_max."""
        return self.points[-1].solution.gamma == -self.scene.gamma_max

    def three_covered(self, at: Solution) -> bool:
        """Whether a solution is the planar ring of turning number 3."""
        extent = 2.0 * float(np.abs(at.places[:, 0]).max())
        return extent < FLAT and abs(turning(self.system, at) - 6.0 * math.pi) < 0.1

    def record(self, run: Run) -> Path:
        """Return the record of the path."""
        scene, cost = self.scene, self.statistics
        values: dict[str, Any] = {
            name: np.array([getattr(point.solution, name) for point in self.points])
            for name in records.NUMBERS
        }
        errors = {
            name: [float(getattr(point.error, name)) for point in self.points]
            for name in records.NUMBERS
        }
        special = tuple(
            records.Point(one.kind, at.gamma, at.moment, at.energy, None, None, k)
            for k, one in enumerate(self.points)
            for at in (one.solution,)
            if one.kind
        )
        at_pi, mode = self._at_pi(values["gamma"], values["moment"], special)
        if run.reason is Reason.TURNED_BACK and at_pi is None:
            mode = Mode(foldable=False, stable=None, snapping="snap-back", stable_3d=None)
        unknown = records.counts([None] * len(self.points))
        return Path(
            solver="bvp",
            ring=scene.ring.to_json(),
            section=asdict(scene.section),
            scale=scene.scale,
            numerics=self._numerics(),
            **values,
            index=unknown,
            index_moment=unknown,
            points=special,
            at_pi=at_pi,
            mode=mode,
            error={**errors, "how": HOW},
            timing=Timing(run.seconds, cost.newton_iterations, cost.steps),
            **self._kept(),
            status=run.status,
            message=run.message,
            reason="" if run.reason is None else run.reason.word,
        )

    def _at_pi(
        self, gamma: Array, moment: Array, special: tuple[records.Point, ...]
    ) -> tuple[AtPi | None, Mode | None]:
        """The state at the first arrival at pi, and the folding mode; None where there is none."""
        if math.pi not in gamma:
            return None, None
        k = int(np.argmax(gamma == math.pi))
        at = self.points[k].solution
        folded = self.three_covered(at)
        without_load = abs(at.moment) <= NO_MOMENT * float(np.abs(moment).max())
        free = index_free(planar(self.system, at)) if folded and without_load else None
        at_pi = AtPi(at.moment, at.slope, at.energy, None, None, free)
        mode = folding_mode(gamma[: k + 1], moment[: k + 1], special, at_pi, three_covered=folded)
        return at_pi, mode

    def _numerics(self) -> dict[str, object]:
        """How the path was solved."""
        scene, system = self.scene, self.system
        meshes = [point.solution.mesh for point in self.points]
        return {
            "method": "Gauss collocation",
            "stages": len(system.rule.points),
            "intervals": max((len(mesh.h) for mesh in meshes), default=0),
            "sector": "quarter" if system.sector.piece.quarter else "half",
            "tolerance": self.tolerance,
            "gamma_max": scene.gamma_max,
            "until": scene.until,
            "save_at": None if scene.save_at is None else list(scene.save_at),
            "version": release(),
        }

    def _kept(self) -> dict[str, Any]:
        """The shapes and forces that were asked for, by their entries."""
        scene, solutions = self.scene, [point.solution for point in self.points]
        kept: dict[str, Any] = {}
        if scene.shapes and solutions:
            kept["shapes"] = self._shapes(solutions)
        if scene.forces and solutions:
            from der.bvp.forces import forces, internal

            found = kept["forces"] = forces(self.system, solutions)
            if scene.shapes:
                inside = internal(self.system, solutions, found, scene.n_edges)
                kept["shapes"] = replace(kept["shapes"], internal=inside)
        return kept

    def _shapes(self, solutions: Sequence[Solution]) -> Shapes:
        """Vertices and frames of the full ring at every point."""
        n_edges = self.scene.n_edges
        shapes = [full_ring(self.system, at, n_edges) for at in solutions]
        x, frames = (np.array(parts) for parts in zip(*shapes, strict=True))
        return Shapes(x, frames, arc_length=sites(self.scene.ring, n_edges, "full")[:-1])
