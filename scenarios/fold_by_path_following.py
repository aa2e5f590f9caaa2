"""Fold a circular ring by following its equilibria, through the snap-back at h/t = 1.6.

The ring is twisted at two opposite points. At h/t = 1.6 the path turns back in gamma between two
folds: with gamma controlled, a real ring would snap. Following the arclength, nothing is skipped.

    python -m scenarios.fold_by_path_following [DIR]

writes path.json, shapes.npz, path.png and path.rrd to DIR (default: out/fold_by_path_following).
"""

from __future__ import annotations

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

scene = der.Scene(
    der.circle(), der.rectangular_section(h_over_t=1.6), n_edges=128, shapes=True, modes=True
)
path = der.fold(scene)

first_fold, second_fold = path.folds
unstable = path.index[first_fold.position + 1 : second_fold.position]

if __name__ == "__main__":
    write(path, "fold_by_path_following")
