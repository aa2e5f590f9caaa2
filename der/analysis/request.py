"""The request of a path of a gripped ring: where it ends, and which events are located."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from der.analysis.self_crossing import SelfCrossing
from der.continuation.arclength import follow
from der.continuation.events import Events, regular
from der.problem import Increment, Options, Point, Solution, Statistics
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.rod import State
from der.scene import Scene

# rad between tangents, if nothing is counted between states: the folds and limits of 280 rings were
# the same as with the default
LOOSE_TURN = 5.0 / 3.0 * Options.aimed_turn
_SAME = 1e-6  # of s: two states that are one
EIGHTH = math.pi / 8.0  # states are solved for at its multiples if no targets are given


@dataclass(frozen=True)
class Request:
    """What is computed on the path of a gripped ring.

    Parameters
    ----------
    gamma_max : the path ends there, or at its negative.
    until_folded : whether it ends at the folded state at pi, too.
    targets : values of gamma at which states are wanted; None: multiples of pi/8.
    limits : whether limits of the moment are wanted.
    stability : whether index and branch points are.
    self_crossings : whether self-crossings are.
    options : steps and tolerances.
    """

    gamma_max: float = math.pi
    until_folded: bool = False
    targets: tuple[float, ...] | None = None
    limits: bool = True
    stability: bool = True
    self_crossings: bool = True
    options: Options = field(default_factory=Options)

    @property
    def tolerance(self) -> float:
        """Of the residual of an equilibrium, GJ/a."""
        return self.options.tolerance

    def events(self, ring: GrippedRing) -> Events[State]:
        """Return the events of the path."""

        def stop(at: Solution[State]) -> bool:
            if abs(at.parameter) == self.gamma_max:  # also of a path that has turned back for good
                return True
            if at.parameter == 0.0 and is_start(ring, at.state):  # of a closed path
                return True
            return self.until_folded and at.parameter == math.pi and ring.folded(at.state)

        return Events(
            targets=(*(self.targets or ()), 0.0, math.pi, self.gamma_max, -self.gamma_max),
            spacing=EIGHTH if self.targets is None else 0.0,
            stop=stop,
            limits=("moment",) if self.limits else (),
            stability=self.stability,
            further=(SelfCrossing(ring, self.stability),) if self.self_crossings else (),
        )

    def point(self, ring: GrippedRing, at: Solution[State], **entries: Any) -> Point[Equilibrium]:
        """Return a point of a solution, with its index if that is wanted."""
        return regular(ring, Events(stability=self.stability), at, **entries)

    def follow(
        self,
        ring: GrippedRing,
        statistics: Statistics | None = None,
        *,
        start: State | None = None,
        along: Increment | None = None,
    ) -> Iterator[Point[Equilibrium]]:
        """Yield the points of the path from the flat ring, or another state."""
        begin, events = ring.start if start is None else start, self.events(ring)
        return follow(ring, begin, events, along=along, options=self.options, statistics=statistics)


def is_start(ring: GrippedRing, state: State) -> bool:
    """Whether an equilibrium is that of the flat ring, where paths start."""
    apart = ring.difference(ring.correct(ring.start).state, state)
    return ring.inner(apart, apart) < _SAME**2


def ring_of(scene: Scene, sector: str | None = None, n_edges: int | None = None) -> GrippedRing:
    """Return the gripped ring of a scene, on the scene's sector and mesh or on others."""
    return gripped_ring(
        scene.ring,
        scene.section,
        scene.n_edges if n_edges is None else n_edges,
        name=scene.sector if sector is None else sector,
        measure=scene.curvature,
        stretching=scene.stretching,
        finest=scene.finest or scene.n_edges,
    )
