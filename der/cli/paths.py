"""Commands that follow a path: `fold`, `bvp` and `compare`."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass

import der
from der.cli.files import ComparisonFiles, PathFiles, targets
from der.cli.options import PathOptions, RingOptions
from der.cli.parsing import option, options_named
from der.cli.run import Tick, keep_showing, over_gamma, run, served


@dataclass(frozen=True)
class LiveOptions:
    """How to watch the ring while it is computed."""

    live: bool = option("Serve what --rrd records for watching, until Ctrl-C.", False)
    port: int = option("Where --live serves.", 9876)


def fold(ring: RingOptions, path: PathOptions, files: PathFiles, watch: LiveOptions) -> int:
    """Fold a ring: the path of equilibria from flat on, its folds, and the index of every state."""
    with options_named():
        playback = watch.live or files.rrd is not None
        other = files.other()
        scene = path.scene(
            ring,
            shapes=playback or files.drawn,
            history=playback or files.moving,
            modes=playback and path.stability and path.solver == "newton",
            forces=files.forces,
        )
        serving = served(watch.port) if watch.live else nullcontext()
        written = targets(files, "path", shapes=True)
    with serving as live:

        def solve(tick: Tick) -> der.Path:
            return der.fold(scene, progress=tick, watch=None if live is None else live.show)

        bar = over_gamma(scene)
        found, code = run(solve, written, bar=bar, beside=other, quiet=files.quiet)
        if live is not None and len(found) and found.status != "interrupted":
            keep_showing(live, found)
    return code


def bvp(ring: RingOptions, path: PathOptions, files: PathFiles) -> int:
    """Solve the boundary-value problem: the same path, to the error that you ask for."""
    with options_named():
        from der.bvp.solve import TOLERANCE, check

        tolerance = TOLERANCE if path.tolerance is None else path.tolerance
        kept = {"shapes": files.drawn, "forces": files.forces}
        scene = path.scene(ring, **kept, error_bars=False, tolerance=1e-10)
        check(scene, tolerance)
        other = files.other()
        written = targets(files, "path", shapes=True)

    def solve(tick: Tick) -> der.Path:
        return der.solve_bvp(scene, tolerance=tolerance, progress=tick)

    return run(solve, written, bar=over_gamma(scene), beside=other, quiet=files.quiet)[1]


def compare(ring: RingOptions, path: PathOptions, files: ComparisonFiles) -> int:
    """Compare the rod with the boundary-value problem, state by state, with their error bars."""
    with options_named():
        from der.bvp.solve import TOLERANCE, check

        check(path.scene(ring, error_bars=False), TOLERANCE)  # what the other solver cannot do
        scene = path.scene(ring, error_bars=True)
        written = targets(files, "comparison")

    def solve(tick: Tick) -> der.Comparison:
        return der.compare(scene, progress=tick)

    # the files named are for a comparison: an unfinished path goes to a file of its own
    found, code = run(solve, written, bar=over_gamma(scene), partial={}, quiet=files.quiet)
    return max(code, 3) if getattr(found, "disagrees", False) else code
