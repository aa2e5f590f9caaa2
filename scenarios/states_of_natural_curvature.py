r"""The states of a circular ring, free in space, over its natural curvature: h/t = 2.

A rod of natural curvature kappa0 is bent to a ring of curvature 1. At any kappa0 it has the states
flat, two-covered, three-covered, inside out and figure eight. n covers have the energy
pi alpha (n - kappa0)^2, the figure eight that of a planar elastica. Their index changes at
thresholds that are known in closed form (`continuum_index`). States in space between them have no
closed form, and are searched for.

    python -m scenarios.states_of_natural_curvature [DIR]

writes states_K.json and .png for a few natural curvatures K, and states.csv and states.png over all
of them, to DIR (default: out/states_of_natural_curvature). On import it solves one ring and the
thresholds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np

import der
from der.analysis.multistability.initial_guesses import covered
from der.rod.gripped_ring import gripped_ring
from scenarios.output import folder, keep, usage, write_table

if __name__ == "__main__":
    usage(__file__, __doc__)

H_OVER_T = 2.0
SPAN = (0.0, 4.0)  # of the natural curvature
COVERS = (1, 2, 3)
SCAN = 33  # natural curvatures between which thresholds are sought
EXACT = 1e-9  # last bracket of a bisection
SHOWN = (0.0, 1.0, 2.0, 3.0)  # natural curvatures whose states are drawn

bar = der.rectangular_section(H_OVER_T)


def continuum_index(n: int, kappa0: float, alpha: float, beta: float) -> int:
    """Index of the n-covered circle in the continuum.

    In Fourier mode m, rotations (a2 cos m s, a3 sin m s) about d2 and d3, the second variation is
    (beta m^2 + n^2 - c n, m (n (1 + beta) - c); .., m^2 + beta n^2 - c n), c = alpha (n - kappa0),
    once more with cosine and sine exchanged. Its determinant is beta (m^2 - n^2)(m^2 - p^2) with
    p^2 = (c - n)(c - beta n)/beta: at m = n one eigenvalue is 0, of a rigid rotation, and the other
    the trace. The bar flips, m = 0, where c > beta n.
    """
    c = alpha * (n - kappa0)
    p_squared = (c - n) * (c - beta * n) / beta
    count = int(c > beta * n)
    most = n + math.ceil(math.sqrt(max(p_squared, 0.0))) + math.ceil(abs(c)) + 1
    for m in range(1, most):
        determinant = (m * m - n * n) * (m * m - p_squared)
        trace = (beta + 1.0) * (m * m + n * n) - 2.0 * c * n
        if m == n:
            count += 2 * (trace < 0.0)
        elif determinant < 0.0:
            count += 2
        elif determinant > 0.0 and trace < 0.0:
            count += 4
    return count


def index_on_mesh(n: int, kappa0: float, n_edges: int = 64) -> int:
    """The index of the discrete ring, by the signs of the pivots only."""
    free = covered(gripped_ring(der.circle(kappa0), bar, n_edges, name="full"), n)
    return free.unpinned.count(free.state, "all")


def thresholds(n: int, index: Callable[[int, float], int]) -> Iterator[float]:
    """Natural curvatures in SPAN at which the index of the n-covered circle changes."""
    grid = np.linspace(*SPAN, SCAN).tolist()
    for low, high in pairwise(grid):
        before = index(n, low)
        if before == index(n, high):
            continue
        a, b = low, high
        while b - a > EXACT:
            middle = 0.5 * (a + b)
            a, b = (middle, b) if index(n, middle) == before else (a, middle)
        yield 0.5 * (a + b)


def in_the_continuum(n: int, kappa0: float) -> int:
    """`continuum_index` of this section."""
    return continuum_index(n, kappa0, bar.alpha, bar.beta)


def states_at(kappa0: float, count: int = 12) -> der.States:
    """The states of the ring with a natural curvature."""
    return der.states(der.Scene(der.circle(kappa0), bar), count=count)


found = states_at(1.0, count=8)
exact = {n: list(thresholds(n, in_the_continuum)) for n in COVERS}
on_mesh = {
    edges: {n: list(thresholds(n, partial(index_on_mesh, n_edges=edges))) for n in COVERS}
    for edges in (32, 64)
}


def main() -> None:
    """Search over the natural curvature, draw, and say how far the thresholds are off."""
    from der.viz.plots import style
    from scenarios.states_plot import figure_over_curvature

    place = folder("states_of_natural_curvature")
    sweep = []
    for kappa0 in np.linspace(*SPAN, 17).tolist():
        one = states_at(kappa0)
        sweep.append((kappa0, one))
        print(f"natural curvature {kappa0:g}: {len(one)} states, {len(one.minima)} minima")
        if kappa0 in SHOWN:
            keep(one, place, f"states_{kappa0:g}")
    write_table(
        place / "states.csv",
        ["natural_curvature", "name", "energy", "index", "needs_cut"],
        ([k, s.name, s.energy, s.index, s.needs_cut] for k, one in sweep for s in one.states),
    )
    style.save(figure_over_curvature(sweep, bar, exact), place / "states.png")
    for n in COVERS:
        for k, truth in enumerate(exact[n]):
            fine, coarse = on_mesh[64][n][k], on_mesh[32][n][k]
            limit = fine + (fine - coarse) / 3.0
            print(
                f"{n} covers, threshold {truth:.6f}: {fine - truth:+.1e} on 64 edges, "
                f"{limit - truth:+.1e} extrapolated from 32 and 64"
            )
    print(f"written to {place}")


if __name__ == "__main__":
    main()
