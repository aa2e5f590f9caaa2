"""Fold a ring by dynamic relaxation alone: no Hessian, no factorisation, only forces.

The grips turn in steps of pi/64; after each the ring, given fictitious masses, moves until it comes
to rest, stopped at every peak of its kinetic energy. Each state agrees with Newton's equilibrium.

    python -m scenarios.fold_by_dynamic_relaxation [DIR]

writes path.json, shapes.npz, path.png and path.rrd to DIR (default:
out/fold_by_dynamic_relaxation).
"""

from __future__ import annotations

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

scene = der.Scene(
    der.circle(),
    der.rectangular_section(h_over_t=4.0),
    control="angle",
    solver="relaxation",
    shapes=True,
)
path = der.fold(scene)

if __name__ == "__main__":
    write(path, "fold_by_dynamic_relaxation")
