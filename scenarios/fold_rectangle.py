"""Fold a rounded rectangle, b/a = 0.6, r/a = 0.3, h/t = 4, about its long axis: it snaps back.

Frames sit on the ends of all fillets. Between two folds the path runs back in gamma by a tenth of
pi; a ring whose angle is controlled jumps over that (see `scenarios.hysteresis`; paper, Fig. 7b).

    python -m scenarios.fold_rectangle [DIR]

writes path.json, shapes.npz, path.png and path.rrd to DIR (default: out/fold_rectangle).
"""

from __future__ import annotations

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

scene = der.Scene(
    der.rectangle(0.6, 0.3, "y"),
    der.rectangular_section(h_over_t=4.0),
    n_edges=128,
    shapes=True,
    modes=True,
)
path = der.fold(scene)

first_fold, second_fold = path.folds

if __name__ == "__main__":
    write(path, "fold_rectangle")
