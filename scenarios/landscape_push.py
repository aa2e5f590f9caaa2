"""Opening a folded ring with the least work: circle and ellipse, b/a = 0.6, h/t = 4.

A strut or a pair of couples that loads the ring slowly does at least the work of the barrier of the
released ring. It does exactly that work if it leads to the saddle without a snap. For a circle, a
strut does so between two strands that lie in each other, a third of the ring apart: it lifts one
off the other. For an ellipse, couples at the ends of the long axis turn against each other, across
the line between them. A dead load does less work until the ring snaps open: 0.0037 of 0.0211 GJ/a
where a circle is squeezed along a diameter of its folded shape.

    python -m scenarios.landscape_push [DIR]

writes push_circle.json, push_ellipse.json and a picture of each to DIR (default:
out/landscape_push), in two to four minutes; on import, one strut at a third of the circle.
"""

from __future__ import annotations

import math

import der
from der.analysis.landscape.actuators import struts
from der.analysis.landscape.barrier import ALIKE, twisted_states
from der.analysis.landscape.opening_path import opened
from scenarios.output import folder, keep, usage

if __name__ == "__main__":
    usage(__file__, __doc__)

N_EDGES = 48
SECTION = der.rectangular_section(4.0)

rests, free_rings, twisting, _ = twisted_states(der.Scene(der.circle(), SECTION, n_edges=N_EDGES))
lift = struts(free_rings[-1], (0, N_EDGES // 3))[0]
lifted = opened(lift, rests[-1].energy, ALIKE * rests[-1].energy)

if __name__ == "__main__":
    place = folder("landscape_push")
    for ring, n_edges in ((der.circle(), 96), (der.ellipse(b_over_a=0.6), 128)):
        found = der.least_push(der.Scene(ring, SECTION, n_edges=n_edges, error_bars=True))
        keep(found, place, f"push_{ring.shape}")
        for kind in found.least:
            value, error = found.extrapolated.get(kind, (math.nan, math.nan))
            slow, dead = found.pushes[found.least[kind]], found.pushes[found.least_dead[kind]]
            print(
                f"{ring.shape}, {kind}: {slow.direction} at {slow.points}, "
                f"work {slow.held.work:.6f} on the mesh, {value:.6f} +- {error:.0e} extrapolated; "
                f"barrier {found.barrier:.6f}"
            )
            if dead.dead is not None:
                value, error = found.extrapolated.get(f"{kind} dead", (math.nan, math.nan))
                print(
                    f"  dead: {dead.direction} at {dead.points}, load {dead.dead.load:.5f}, work "
                    f"{dead.dead.work:.6f} on the mesh, {value:.6f} +- {error:.0e} extrapolated"
                )
    print(f"written to {place}")
