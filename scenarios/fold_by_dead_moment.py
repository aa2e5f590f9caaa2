"""Hang a growing weight on the grips of a ring, h/t = 4, and take it off again.

The moment is dead: it stays what it is while gamma moves. At its first limit the ring snaps through
to its stop at gamma = pi, folded; taken off, the folded ring stays, held by itself, down to a small
moment the other way, where it pops open.

    python -m scenarios.fold_by_dead_moment [DIR]

writes path.json, shapes.npz, path.png and path.rrd to DIR (default: out/fold_by_dead_moment).
"""

from __future__ import annotations

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

scene = der.Scene(
    der.circle(),
    der.rectangular_section(h_over_t=4.0),
    n_edges=128,
    control="moment",
    unload=True,
    shapes=True,
    history=True,
    modes=True,
)
path = der.fold(scene)

upper_limit, lower_limit = path.limits
snaps = [point for point in path.points if point.kind == "snap"]
released = [snap.details["energy_released"] for snap in snaps]

if __name__ == "__main__":
    write(path, "fold_by_dead_moment")
