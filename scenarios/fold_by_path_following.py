"""Fold a circular ring by following its equilibria, through the snap-back at h/t = 1.6.

The ring is twisted at two opposite points. At h/t = 1.6 the path turns back in gamma between two
folds: with gamma controlled, a real ring would snap. Following the arclength, nothing is skipped.

    python -m scenarios.fold_by_path_following [DIR]

writes path.json, path.png and shapes.npz to DIR (default: out/fold_by_path_following).
"""

from __future__ import annotations

import sys
from pathlib import Path

import der
from der.summary import summary
from der.view_plots import save_plot

scene = der.Scene(der.circle(), der.rectangular_section(h_over_t=1.6), n_edges=128, shapes=True)
path = der.fold(scene)

first_fold, second_fold = path.folds
unstable = path.index[first_fold.position + 1 : second_fold.position]

if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/fold_by_path_following")
    folder.mkdir(parents=True, exist_ok=True)
    path.save(folder / "path.json")
    if path.shapes is not None:
        path.shapes.save(folder / "shapes.npz")
    save_plot(path, folder / "path.png")
    print(summary(path))
    print(f"written to {folder}")
