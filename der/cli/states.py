"""Commands that search for states: `states` in space, `planar` in the plane of the ring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import der
from der.cli.files import PlanarFiles, StatesFiles, targets
from der.cli.options import RingOptions
from der.cli.parsing import option, options_named
from der.cli.run import Tick, counted, run


@dataclass(frozen=True)
class StatesOptions:
    """Which states."""

    gamma: float | None = option("Rotation of each grip, rad; the ring is free if not given.")
    count: int = option("States after which to stop; minima that these relax to are added.", 12)
    edges: int = option("Edges of the full ring.", 64)

    def scene(self, options: RingOptions) -> der.Scene:
        """The scene that the command line describes."""
        ring = options.ring()
        divisor, part = (4, "a quarter") if ring.symmetry == "D2" else (2, "half")
        if self.edges % divisor:
            raise ValueError(
                f"edges must be divisible by {divisor}, as the path of twisting, where the search "
                f"starts, is followed on {part} of the ring, got {self.edges}"
            )
        return der.Scene(ring, **options.stated(), n_edges=self.edges)


def states(ring: RingOptions, wanted: StatesOptions, files: StatesFiles) -> int:
    """Find the states of a ring, free or in its grips, and which of them relaxes to which."""
    with options_named():
        scene = wanted.scene(ring)
        written = targets(files, "states", shapes=True)

        def solve(tick: Tick) -> der.States:
            return der.states(scene, gamma=wanted.gamma, count=wanted.count, progress=tick)

        return run(solve, written, bar=counted("states", wanted.count), quiet=files.quiet)[1]


@dataclass(frozen=True)
class PlanarOptions:
    """What is sought in the plane."""

    distance: str | None = option(
        "Squeeze or pull the flat ring until the points of its axis are so far: in units of a, "
        "or with a unit where --young is given."
    )
    turns: int | None = option("Cover circles up to so many times.")
    edges: int = option("Edges of the full ring.", 256)

    def goal(self, scene: der.Scene) -> float | None:
        """The distance in units of a."""
        if self.distance is None:
            return None
        if scene.scale is None:
            try:
                return float(self.distance)
            except ValueError:
                raise ValueError(f"distance must be a number, got {self.distance!r}") from None
        from der.geometry.scale import LENGTHS, quantity

        return quantity("distance", self.distance, LENGTHS, "120mm") / scene.scale.a


def planar(ring: RingOptions, wanted: PlanarOptions, files: PlanarFiles) -> int:
    """Find the states of a ring in its plane, with its packing ratio; or squeeze it there."""
    with options_named():
        if wanted.distance is not None and wanted.turns is not None:
            raise ValueError(f"turns cannot be given together with --distance, got {wanted.turns}")
        scene = der.Scene(ring.ring(), **ring.stated(), n_edges=wanted.edges, error_bars=True)
        distance = wanted.goal(scene)
        written = targets(files, "planar", shapes=True)

        def solve(_: Tick) -> Any:
            if distance is None:
                return der.planar(scene, turns=wanted.turns)
            return der.squeeze(scene, distance)

        return run(solve, written, quiet=files.quiet)[1]
