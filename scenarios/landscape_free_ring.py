"""How easily a released folded ring opens: ellipse, b/a = 0.6, over h/t.

In grips that turn freely, an energy barrier keeps the ellipse folded; the path of twisting shows
it. The released ring can open in another way: a saddle without the symmetry of twisting is far
lower. At h/t = 4 the barrier is 0.01068 GJ/a instead of 0.6713. Below h/t = 3.636 the released ring
opens by itself, where twisting shows a well down to 2.197. A circle's saddle is the same with and
without grips.

    python -m scenarios.landscape_free_ring [DIR]

writes pass.json and pass.png (h/t = 4), barriers.json and barriers.png to DIR (default:
out/landscape_free_ring).
"""

from __future__ import annotations

import numpy as np

import der
from der.analysis.landscape.over_thickness import barriers_over
from scenarios.output import folder, keep, usage

if __name__ == "__main__":
    usage(__file__, __doc__)

H_OVER_T = np.geomspace(1.8, 30.0, 24)
ring = der.ellipse(b_over_a=0.6)

scene = der.Scene(ring, der.rectangular_section(4.0), error_bars=True)
twisted = der.landscape(scene)
found = der.barrier(scene)

if __name__ == "__main__":
    place = folder("landscape_free_ring")
    keep(found, place, "pass")
    curves = barriers_over(ring, H_OVER_T, free=True)
    keep(curves, place, "barriers")
    for name, one in (("released", found), ("by twisting", twisted)):
        value, error = one.extrapolated["open"]
        print(f"to open, {name}: {value:.5f} +- {error:.0e} GJ/a")
    print(f"written to {place}")
