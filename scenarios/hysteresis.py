"""Turn four rings up to pi and back: each snaps both ways, at different folds.

The rings are those of `der figure hysteresis`, which draws the loops. Three claims are checked:

    loop      4 times the loop integral of M dgamma is what the snaps release together
    landing   every snap ends in a state of the path of equilibria, followed by arclength
    folds     every snap begins at one of its folds

    python -m scenarios.hysteresis [DIR]

writes hysteresis.png and .csv, and json, png, npz and rrd of each ring, to DIR (out/hysteresis).
"""

from __future__ import annotations

from der.paper.hysteresis import loop, write_loops
from der.paper.snapping_rings import SNAPPING
from scenarios.output import folder, usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

loops = {name: loop(name) for name in SNAPPING}


def table() -> str:
    """Folds, end states of snaps, and energies in a few lines of text."""
    rows = [
        f"{'':14}{'gamma':>9}{'M before':>10}{'M after':>10}{'released':>10}"
        f"{'to the path':>13}  ends after"
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
        apart = f"{abs(one.work - released):.1e} apart"
        rows.append(f"{'':14}loop {one.work:.8f}, released {released:.8f}, {apart}")
    return "\n".join(rows)


if __name__ == "__main__":
    for one in loops.values():
        write(one.turned, "hysteresis", stem=one.name)
    write_loops(list(loops.values()), folder("hysteresis"))
    print(table())
