"""The h/t above which a folded ring is stable: in its grips, at fixed moment, when released.

The planar three-covered shape does not depend on the section, and its forces are proportional to
EI1. So the shape is computed once for every h/t. Each index, and the slope dM/dgamma, is then a
function of h/t. Above its last change of sign, the threshold, the state is stable. The released
ring has more freedom, so that its index is never below that at fixed moment.

    python -m scenarios.folded_stability [--out DIR] [--quick]

writes thresholds.csv to DIR (default: out/folded_stability): on 64 and 128 edges, and extrapolated;
the error of the extrapolated value is about a tenth of its distance from the finer mesh.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import der
from der.analysis.request import Request
from der.problem import total_index
from der.rod.equilibrium import Equilibrium
from der.rod.free_ring import balance
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.rod import State
from scenarios.output import Arguments, write_table

EDGES = 128
FLATTEST, SLENDEREST = 0.8, 100.0  # h/t between which thresholds are sought
SCAN = 60  # sections between them, in equal ratios
EXACT = 1e-7  # of h/t, a bisection's last bracket
LARGEST_CIRCLE = 0.5 * math.tan(math.pi / 12)  # r/a at which a triangle of 120 degrees is a circle


@dataclass(frozen=True)
class Folded:
    """A ring's planar three-covered state on one mesh, for a section with EI1/GJ = alpha."""

    ring: der.Ring
    n_edges: int
    alpha: float
    state: State  # of the ring's smallest sector

    @classmethod
    def of(cls, ring: der.Ring, n_edges: int = EDGES, h_over_t: float = 4.0) -> Folded:
        """The state that twisting reaches at ``h_over_t``; for a D2 ring it is the only one.

        Raises
        ------
        ValueError
            Where twisting does not lead to it.
        """
        section = der.rectangular_section(h_over_t)
        gripped = gripped_ring(ring, section, n_edges)
        if ring.symmetry == "D2":
            at = gripped.correct(_evenly_bent(ring, gripped))
            if at.converged and gripped.folded(at.state):
                return cls(ring, n_edges, section.alpha, at.state)
        *_, last = Request(stability=False, self_crossings=False).follow(gripped)
        state = last.solution.state
        if not gripped.folded(state):
            raise ValueError(f"ring {ring!r} is not folded by twisting at h/t = {h_over_t}")
        return cls(ring, n_edges, section.alpha, state)

    def gripped(self, h_over_t: float, name: str = "auto") -> tuple[GrippedRing, Equilibrium]:
        """The state in the grips, with another section, on a sector."""
        section = der.rectangular_section(h_over_t)
        own = gripped_ring(self.ring, section, self.n_edges)
        if name == "auto":
            ring, quat = own, self.state.quat
            force = self.state.force * (section.alpha / self.alpha)
        else:
            ring = gripped_ring(self.ring, section, self.n_edges, name=name)
            quat = own.full_frames(self.state)[: ring.rod.n_edges]
            force = np.zeros(len(ring.supports.target))
        start = State(quat, np.zeros(len(quat)), force, math.pi)
        at = ring.correct(start, iterations=30)
        if not at.converged:
            raise ValueError(f"ring {self.ring!r} at h/t = {h_over_t}: {at.advice}")
        return ring, at

    def index(self, h_over_t: float) -> int:
        """Index with the grips held at pi."""
        ring, at = self.gripped(h_over_t)
        counts, _ = ring.indices(at.state)
        return total_index(ring, tuple(count or 0 for count in counts)) or 0

    def slope(self, h_over_t: float) -> float:
        """dM/dgamma [GJ/a]."""
        ring, at = self.gripped(h_over_t)
        return ring.arm_moment(at.slope)

    def index_moment(self, h_over_t: float) -> int:
        """Index at fixed moment."""
        return self.index(h_over_t) + (self.slope(h_over_t) < 0.0)

    def released(self, h_over_t: float) -> tuple[der.RodSystem, State]:
        """The released ring, and the state with the forces that close it."""
        section = der.rectangular_section(h_over_t)
        own = gripped_ring(self.ring, section, self.n_edges)
        full = gripped_ring(self.ring, section, self.n_edges, name="full")
        free = balance(full.rod, own.full_frames(self.state), np.zeros(self.n_edges))
        at = free.unpinned.correct(free.state)
        return free.unpinned, at.state if at.converged else free.state

    def index_free(self, h_over_t: float) -> int:
        """Index of the released ring."""
        free, state = self.released(h_over_t)
        count = free.index(state)
        return -1 if count is None else count  # unknown at a threshold, to rounding

    def softest_free(self, h_over_t: float, count: int = 3) -> list[float]:
        """Stiffnesses nearest to zero of the released ring [GJ/a^2]."""
        free, state = self.released(h_over_t)
        return free.softest_modes(state, count)[0].tolist()


def _evenly_bent(ring: der.Ring, gripped: GrippedRing) -> State:
    """A D2 ring's folded state: the curvature is the natural one and 4 pi/L (paper, Eq. B.1)."""
    s = gripped.arc_length
    angle = ring.natural_angle(s) - ring.natural_angle(s[-1])
    angle += 4.0 * np.pi / ring.length * (s - s[-1])
    a = 0.5 * (angle + ring.angle(s[-1]) - 0.5 * np.pi)
    # about E1 by the angle, then about E3 by -pi: (0, 0, 0, -1) o (cos a, sin a, 0, 0)
    quat = np.stack([0.0 * a, 0.0 * a, -np.sin(a), -np.cos(a)], axis=1)
    return gripped.start.but(quat=quat, load=math.pi)


def threshold(is_stable: Callable[[float], bool]) -> float | None:
    """The h/t above which a state is stable; None: never stable, 0: always.

    The last change in a scan is refined by bisection.
    """
    ratios = np.geomspace(SLENDEREST, FLATTEST, SCAN)
    high = None
    for h_over_t in ratios:
        if not is_stable(float(h_over_t)):
            break
        high = float(h_over_t)
    else:
        return 0.0
    if high is None:
        return None
    low = float(h_over_t)
    while high - low > EXACT * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if is_stable(middle) else (middle, high)
    return 0.5 * (low + high)


CRITERIA: dict[str, Callable[[Folded, float], bool]] = {
    "slope": lambda ring, h_over_t: ring.slope(h_over_t) > 0.0,
    "index": lambda ring, h_over_t: ring.index(h_over_t) == 0,
    "index_moment": lambda ring, h_over_t: ring.index_moment(h_over_t) == 0,
    "index_free": lambda ring, h_over_t: ring.index_free(h_over_t) == 0,
}


def thresholds(ring: der.Ring, n_edges: int = EDGES) -> dict[str, float | None]:
    """Thresholds of h/t by the name of the criterion."""
    state = Folded.of(ring, n_edges)
    return {
        name: threshold(lambda h_over_t, stable=stable: stable(state, h_over_t))  # type: ignore[misc]
        for name, stable in CRITERIA.items()
    }


def extrapolated(coarse: float | None, fine: float | None) -> float | None:
    """Limit for cells of no length, whose square is the error."""
    if coarse is None or fine is None:
        return None
    return fine + (fine - coarse) / 3.0


def rings(*, quick: bool = False) -> Iterator[tuple[str, float, der.Ring]]:
    """Family, parameter and ring."""
    yield "circle", 1.0, der.circle()
    if quick:
        return
    for axis in "xy":
        for b in (0.5, 0.6, 0.7, 0.8, 0.9, 0.95):
            yield f"ellipse {axis}, b/a", b, der.ellipse(b, axis)
        for b in (0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8):
            yield f"stadium {axis}, b/a", b, der.rectangle(b, b, axis)
        for r in (0.1, 0.3, 0.5):
            yield f"rectangle b/a = 0.6 {axis}, r/a", r, der.rectangle(0.6, r, axis)
    for r in (0.1, 0.3, 0.6, 0.8):
        yield "square, r/a", r, der.rectangle(1.0, r)
    for degrees, largest in ((60.0, math.sqrt(3) / 6), (120.0, LARGEST_CIRCLE)):
        for share in (0.25, 0.5, 0.75, 0.9):
            r = share * largest
            yield f"triangle {degrees:g} deg, r/a", r, der.triangle(math.radians(degrees), r)


def main() -> None:
    """Print and write the table."""
    asked = Arguments(__file__, __doc__).parse(quick=False)
    rows: list[list[object]] = []
    for family, parameter, ring in rings(quick=asked.quick):
        coarse, fine = (thresholds(ring, n_edges) for n_edges in (EDGES // 2, EDGES))
        limit = {name: extrapolated(coarse[name], fine[name]) for name in CRITERIA}
        for n_edges, found in ((EDGES // 2, coarse), (EDGES, fine), ("extrapolated", limit)):
            rows.append([family, f"{parameter:.6g}", n_edges, *found.values()])
        words = ", ".join(f"{name} {_word(value)}" for name, value in limit.items())
        print(f"{family} {parameter:.4g}: {words}", flush=True)
    write_table(asked.out / "thresholds.csv", ["family", "parameter", "n_edges", *CRITERIA], rows)
    print(f"written to {asked.out}")


def _word(value: float | None) -> str:
    return "never" if value is None else "always" if value == 0.0 else f"{value:.4f}"


if __name__ == "__main__":
    main()
