"""Fold a sharp right-angled triangle, r/a = 1/30, h/t = 4: the path crosses itself on its way.

The ring has one mirror axis, so that half of it is solved. gamma turns back from 0.39 pi to 0.13 pi
before the corners tuck in and the ring folds, stably (paper, Fig. 11b). A third of the edges sit on
the fillets, which are a tenth of the length: where the ring is bent, the mesh puts frames close.

    python -m scenarios.fold_triangle [DIR]

writes path.json, shapes.npz, path.png and path.rrd to DIR (default: out/fold_triangle).
"""

from __future__ import annotations

import math

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

scene = der.Scene(
    der.triangle(math.pi / 2, 1 / 30),
    der.rectangular_section(h_over_t=4.0),
    n_edges=128,
    shapes=True,
    modes=True,
)
path = der.fold(scene)

first_fold, second_fold = path.folds

if __name__ == "__main__":
    write(path, "fold_triangle")
