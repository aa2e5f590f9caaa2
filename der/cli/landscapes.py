"""The command `landscape`: energies, barriers, and what opens a folded ring."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import der
from der.cli.files import LandscapeFiles, targets
from der.cli.options import PathOptions, RingOptions
from der.cli.parsing import option, options_named
from der.cli.run import Tick, over_gamma, run

CELLS = 60  # along each side of a surface


@dataclass(frozen=True)
class LandscapeOptions:
    """Which landscape."""

    two_dimensional: bool = option("Over twist and grip distance.", False)
    free: bool = option("The barrier with the grips removed.", False)
    push: bool = option("The forces or couples that open it with least work.", False)
    cells: int = option("Along each side, with --two-dimensional.", CELLS)

    def solver(self, scene: der.Scene) -> Callable[[Tick], Any]:
        """What finds the landscape of a scene."""
        if self.two_dimensional:
            shape = (self.cells, self.cells)
            return lambda tick: der.energy_surface(scene, shape=shape, progress=tick)
        if self.push:
            return lambda tick: der.least_push(scene, progress=tick)
        if self.free:
            return lambda tick: der.barrier(scene)
        return lambda tick: der.landscape(scene, progress=tick)

    def check(self, path: PathOptions, files: LandscapeFiles) -> None:
        """Refuse options that have no effect on a landscape of this kind."""
        given = {
            "--two-dimensional": self.two_dimensional,
            "--free": self.free,
            "--push": self.push,
        }
        kinds = [name for name, is_given in given.items() if is_given]
        if len(kinds) > 1:
            raise ValueError(f"{kinds[-1][2:]} cannot be given together with {kinds[0]}, got both")
        if not 3 <= self.cells <= 1000:
            raise ValueError(f"cells must be from 3 to 1000, got {self.cells}")
        if self.cells != CELLS and not self.two_dimensional:
            raise ValueError(f"cells must go with --two-dimensional, got {self.cells} alone")
        if files.rrd is not None and (self.free or self.push):
            raise ValueError(f"rrd cannot be given together with {kinds[0]}, got {files.rrd!r}")
        if path.control != "arclength":
            raise ValueError(f"control must be 'arclength' for a landscape, got {path.control!r}")
        if path.gamma_max != math.pi:
            raise ValueError(
                "gamma_max cannot be given for a landscape, which ends where the ring has folded, "
                f"got {path.gamma_max}"
            )
        for name in ("until", "save_at") if kinds else ():
            value = getattr(path, name)
            if value is not None:
                raise ValueError(f"{name} cannot be given together with {kinds[0]}, got {value!r}")


def landscape(
    ring: RingOptions, path: PathOptions, wanted: LandscapeOptions, files: LandscapeFiles
) -> int:
    """Map the energy: states without load, wells, saddles, and barriers to folding and opening."""
    with options_named():
        wanted.check(path, files)
        scene = path.scene(ring, error_bars=not wanted.two_dimensional)
        drawn = replace(scene, shapes=True, modes=True)  # the ring at every state, to be played
        if files.rrd is not None and not wanted.two_dimensional:
            scene = drawn
        written = targets(files, "landscape")

        def along() -> Any:
            return der.landscape(drawn, index_free=False)

        return run(
            wanted.solver(scene),
            written,
            bar=over_gamma(scene),
            beside=along if wanted.two_dimensional else None,
            quiet=files.quiet,
        )[1]
