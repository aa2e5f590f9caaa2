"""Fold a ring by dynamic relaxation alone: no Hessian, no factorisation, only forces.

The grips turn in steps of pi/64; after each the ring, given fictitious masses, moves until it comes
to rest, stopped at every peak of its kinetic energy. Each state agrees with Newton's equilibrium.

    python -m scenarios.fold_by_dynamic_relaxation [DIR]

writes path.json, path.png and shapes.npz to DIR (default: out/fold_by_dynamic_relaxation).
"""

from __future__ import annotations

import sys
from pathlib import Path

import der
from der.summary import summary
from der.view_plots import save_plot

scene = der.Scene(
    der.circle(),
    der.rectangular_section(h_over_t=4.0),
    control="angle",
    solver="relaxation",
    shapes=True,
)
path = der.fold(scene)

if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/fold_by_dynamic_relaxation")
    folder.mkdir(parents=True, exist_ok=True)
    path.save(folder / "path.json")
    if path.shapes is not None:
        path.shapes.save(folder / "shapes.npz")
    save_plot(path, folder / "path.png")
    print(summary(path))
    print(f"written to {folder}")
