"""Turn the grips of a ring up to pi and back: at h/t = 1.6 it snaps both ways.

Where the angle is controlled, the state follows its minimum of energy until that ends at a fold.
Then the ring snaps to another equilibrium at the same angle, here by dynamic relaxation. Loading
and unloading snap at different folds; the work of the loop between them is what the snaps release.

    python -m scenarios.fold_by_angle_with_snap [DIR]

writes path.json, shapes.npz, path.png and path.rrd to DIR (default: out/fold_by_angle_with_snap).
"""

from __future__ import annotations

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

scene = der.Scene(
    der.circle(),
    der.rectangular_section(h_over_t=1.6),
    control="angle",
    unload=True,
    shapes=True,
    history=True,
    modes=True,
)
path = der.fold(scene)

snaps = [point for point in path.points if point.kind == "snap"]
released = [snap.details["energy_released"] for snap in snaps]

if __name__ == "__main__":
    write(path, "fold_by_angle_with_snap")
