"""Energy barriers to fold a circular ring and to open it again, over h/t: 40 landscapes.

A folded circle is a well from h/t = 3.469928 on. At this threshold the barrier to open it is zero,
and grows like the square of the distance from it: the saddle leaves the folded state in a
pitchfork, M = s d - c d^3 with d = pi - gamma, and its height is s^2/c. The barrier to fold is
larger than that to open by the energy of the folded ring, 4 pi alpha.

    python -m scenarios.landscape_along_the_path [DIR]

writes landscape.json and landscape.png (h/t = 8), barriers.json and barriers.png to DIR
(default: out/landscape_along_the_path).
"""

from __future__ import annotations

import numpy as np

import der
from der.analysis.landscape.over_thickness import barriers_over
from scenarios.output import folder, keep, usage

if __name__ == "__main__":
    usage(__file__, __doc__)

H_OVER_T = np.geomspace(1.0, 30.0, 40)
BESIDE = (3.55, 3.6, 3.7, 3.8)  # sections near the threshold, which is extrapolated from them

one = der.landscape(der.Scene(der.circle(), der.rectangular_section(8.0), error_bars=True))
curves = barriers_over(der.circle(), H_OVER_T)


# the barrier grows like a square, so its root is smooth in h/t: a cubic through four
beside = barriers_over(der.circle(), BESIDE, n_edges=128)
threshold = float(np.polyval(np.polyfit(np.sqrt(beside.open), BESIDE, 3), 0.0))

if __name__ == "__main__":
    place = folder("landscape_along_the_path")
    keep(one, place, "landscape")
    keep(curves, place, "barriers")
    for name in ("fold", "open"):
        value, error = one.extrapolated[name]
        print(f"h/t = 8: to {name} {value:.5f} +- {error:.0e} GJ/a")
    print(f"{len(curves.h_over_t)} landscapes in {curves.solve_s:.2f} s")
    print(f"the barrier to open vanishes at h/t = {threshold:.4f}; written to {place}")
