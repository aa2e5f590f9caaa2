"""Cost over the number of edges: a Newton iteration, a path, and the memory of both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import der
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from validation.benchmark.extent import Extent
from validation.benchmark.rings import BARE, circle
from validation.benchmark.rows import Row, cpu_time, measured

AS_A_BATCH = 2048  # edges: short solves are repeated up to so many, for the clock


@dataclass(frozen=True)
class Scale:
    """The cost of N edges."""

    n: int  # edges of the full ring
    newton: float  # s, CPU: one iteration on the full ring
    residual: float  # GJ/a, at which Newton's method ends
    held: int  # B, that one iteration holds at once
    path: float  # s, CPU: 0 to pi on a quarter
    path_memory: int  # B, largest that Python and numpy hold meanwhile
    iterations: int  # of the path

    def __str__(self) -> str:
        return f"N {self.n}: {1e6 * self.newton / self.n:.2f} us an edge, path {self.path:.3g} s"

    def table(self) -> Iterator[Row]:
        """The same as rows."""
        n = self.n
        goal = 0.15 if n == 64 else None
        note = f"{1e6 * self.newton / n:.2f} us an edge, residual {self.residual:.1e}"
        yield Row("newton", f"full ring, N {n}", 1e3 * self.newton, "ms", goal, note)
        yield Row("memory", f"iteration, full ring, N {n}", self.held / n, "B/edge", 4096.0)
        note = f"{self.iterations} Newton iterations"
        yield Row("path over N", f"quarter, N {n}", 1e3 * self.path, "ms", note=note)
        kept = 4 * self.path_memory / n
        note = f"{1e-6 * self.path_memory:.2f} MB; an edge of the quarter"
        yield Row("memory", f"path, quarter, N {n}", kept, "B/edge", note=note)


def rows(extent: Extent) -> Iterator[Scale | Row]:
    """Each number of edges, and the same as rows."""
    for n in extent.scales:
        found = scale(n, min(extent.repeats, 5))
        yield found
        yield from found.table()


def scale(n: int, repeats: int) -> Scale:
    """Measure N edges; paths above 4,096 edges are long enough to be timed once."""
    newton, residual, ring = _newton(n, repeats)
    scene = circle(4.0, n_edges=n, **BARE)
    path = measured(lambda: der.fold(scene), repeats if n <= 4096 else 1, warm=n <= 4096)
    iterations = path.result.timing.newton_iterations
    return Scale(n, newton, residual, _bytes(ring), path.cpu, path.memory or 0, iterations)


def _newton(n: int, repeats: int) -> tuple[float, float, GrippedRing]:
    """CPU time of one iteration of the full ring, the residual it ends with, and the ring.

    Complete solves at a given gamma are timed; the last pass, for tangent and index, costs
    as much as an iteration, and so does the call itself.
    """
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), n, name="full")
    flat = ring.correct(ring.start)
    ahead = 0.1 * flat.tangent
    ahead[-1] = 0.1
    start = ring.retract(flat.state, ahead)

    def solve() -> Equilibrium:
        return ring.correct(start)

    solved = solve()
    many = max(1, AS_A_BATCH // n)
    seconds = cpu_time(lambda: [solve() for _ in range(many)], repeats)
    return seconds / (many * (solved.iterations + 1)), solved.residual, ring


def _bytes(ring: GrippedRing) -> int:
    """Bytes that one iteration holds at once: state, derivatives and factors."""
    arrays = [*ring.start, *ring.supports, *ring.rod, ring.work]
    return sum(a.nbytes for a in arrays if isinstance(a, np.ndarray))
