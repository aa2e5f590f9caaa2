"""A fold of the path is a double well in the distance of the grips: circle, h/t = 1.6.

Where the distance of the grips is prescribed besides their rotation, the state is a single-valued
function of both: over the plane (gamma, d) the energy is one smooth surface. Between the two folds
of the path it has two valleys at the same gamma, and the unstable branch is the ridge between them.
At each fold one of the valleys ends, and the ring snaps to the other.

    python -m scenarios.landscape_over_twist_and_distance [DIR]

writes surface.json and surface.png to DIR (default: out/landscape_over_twist_and_distance).
"""

from __future__ import annotations

import numpy as np

import der
from scenarios.output import folder, keep, usage

if __name__ == "__main__":
    usage(__file__, __doc__)

sheet = der.energy_surface(der.Scene(der.circle(), der.rectangular_section(1.6)), shape=(48, 48))


def valleys(energy: np.ndarray) -> int:
    """Local minima of a row of energies over the distance, inside it."""
    return int(np.sum((energy[1:-1] < energy[:-2]) & (energy[1:-1] < energy[2:])))


first, second = sheet.folds[:, 0]  # gamma turns back at the first, and on again at the second
rows = [valleys(row) for row in sheet.energy]
between = [n for gamma, n in zip(sheet.gamma, rows, strict=True) if second < gamma < first]
before = [n for gamma, n in zip(sheet.gamma, rows, strict=True) if gamma < second]
least = [float(sheet.energy[:, j].min()) for j in range(len(sheet.distance))]

if __name__ == "__main__":
    place = folder("landscape_over_twist_and_distance")
    keep(sheet, place, "surface")
    print(f"{sheet.energy.size} cells in {sheet.solve_s:.1f} s, {np.sum(sheet.count == 0)} empty")
    print(f"valleys before the folds {set(before)}, between them {set(between)}")
    print(f"written to {place}")
