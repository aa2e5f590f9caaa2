"""Load the grips of a ring, h/t = 4, by a growing dead moment, and unload them again.

A dead moment keeps its value while gamma moves. At its first limit the ring snaps through to the
stop at gamma = pi, folded. Unloaded, the ring stays folded down to a small negative moment, at
which it snaps open.

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
