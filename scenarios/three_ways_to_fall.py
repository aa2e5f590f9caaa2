"""Does the motion of a snap matter? Relaxed, overdamped and inertial motion from ten folds.

At a fold the ring loses its stability and snaps to another equilibrium. The motion could decide to
which one. Here each snap is computed in three ways, from the same kick along the softest mode:

    relax   dynamic relaxation, stopped at every peak of kinetic energy (what `der.fold` uses)
    flow    overdamped: down the gradient, by implicit steps in time
    move    inertial: lightly damped, the ring swings dozens of times before it rests

With the grips held, all three end in one state, which is on the path of equilibria and a minimum in
three dimensions. Under a dead moment they can differ: an ellipse that swings passes the state in
which it comes to rest without inertia (`overshoot`).

    python -m scenarios.three_ways_to_fall [DIR]

writes falls.txt, the table below, to DIR (default: out/three_ways_to_fall).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import der
from der.analysis.loading import follow_angle, follow_moment
from der.analysis.request import Request
from der.analysis.snap import KICK, Landing
from der.kernels.quaternions import rotation_vector
from der.paper.snapping_rings import SNAPPING
from der.problem import Increment, Statistics
from der.rod.dynamics import EndState, flow, swing
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.rod.relaxation import Relaxed, Rest, relax
from scenarios.output import folder, usage

if __name__ == "__main__":
    usage(__file__, __doc__)

EDGES = 64
RINGS = {"circle": (der.circle(), 1.6), **SNAPPING}
WAYS: dict[str, Callable[..., Relaxed | EndState]] = {"relax": relax, "flow": flow, "move": swing}
REQUEST = Request(self_crossings=False)


@dataclass(frozen=True)
class Fall:
    """A snap and its end state."""

    ring: str
    gamma: float  # of the fold, rad
    way: str
    end: Rest
    at: Equilibrium  # after Newton's method
    moment: float  # there, of one arm, GJ/a
    energy: float  # there, of the full ring, GJ/a
    index: tuple[int | None, ...]  # there, by symmetry class
    apart: float  # from the end state of the relaxed ring: largest rotation of an edge, rad
    cost: str
    seconds: float


def _kick(ring: GrippedRing, at: Equilibrium, *, load: bool) -> Increment:
    """The displacement with which a snap begins."""
    kick = ring.displacement(at.tangent, KICK)
    kick[-1] *= load
    return kick


def _falls(name: str) -> Iterator[Fall]:
    """Snaps from both folds of a ring that is loaded and unloaded by the angle."""
    shape, h_over_t = RINGS[name]
    ring = gripped_ring(shape, der.rectangular_section(h_over_t), EDGES)
    for point in follow_angle(ring, REQUEST, Statistics(), unload=True):
        if point.kind != "fold":
            continue
        before = point.solution
        first: Equilibrium | None = None
        for way, fall in WAYS.items():
            started = time.perf_counter()
            kick = _kick(ring, before, load=False)
            found = fall(ring, before.state, kick=kick, tolerance=1e-6)
            seconds = time.perf_counter() - started
            at = ring.correct(found.state)
            first = at if first is None else first
            yield Fall(
                name,
                before.parameter,
                way,
                found.outcome,
                at,
                *ring.values(at)[1:],
                REQUEST.point(ring, at).index or (),
                float(np.abs(rotation_vector(first.state.quat, at.state.quat)).max()),
                _cost(found),
                seconds,
            )


def _cost(found: Relaxed | EndState) -> str:
    if isinstance(found, EndState):
        return f"{found.steps} steps, {found.factorisations} factorisations"
    return f"{found.evaluations} gradients"


def _overshoot() -> dict[str, float]:
    """Where an ellipse snaps to from its first limit of the dead moment: gamma by kind of motion.

    b/a = 0.85 about y, h/t = 4. Those that pass a stop at pi end at the folded ring, whose own
    moment, 0, is below the dead one: it stays there.
    """
    shape, h_over_t = RINGS["ellipse"]
    ring = gripped_ring(shape, der.rectangular_section(h_over_t), EDGES)
    points = list(follow_moment(ring, REQUEST, Statistics()))
    landing = next(k for k, one in enumerate(points) if isinstance(one, Landing))
    before = points[landing - 1].solution
    ends = {"relax": points[landing].solution.parameter}
    for way in ("flow", "move"):
        found = WAYS[way](
            ring,
            before.state,
            kick=_kick(ring, before, load=True),
            moment=before.moment,
            stops=(-np.inf, math.pi),
            tolerance=1e-6,
        )
        ends[way] = math.pi if found.outcome is Rest.AT_STOP else _rest(ring, before, found)
    return ends


def _rest(ring: GrippedRing, before: Equilibrium, found: Relaxed | EndState) -> float:
    """Gamma at rest under the moment of the state that was left."""
    return ring.correct(found.state, hold="moment", value=before.moment).parameter


falls = [fall for name in RINGS for fall in _falls(name)]
overshoot = _overshoot()


def table() -> str:
    """The end states, and the cost of computing them."""
    rows = [
        f"{'':14}{'from gamma':>11}  {'way':6}{'M':>11}{'U':>12}{'index':>7}{'apart':>9}"
        f"{'time':>9}  cost"
    ]
    for fall in falls:
        index = sum(count or 0 for count in fall.index)
        rows.append(
            f"{fall.ring:14}{fall.gamma:11.6f}  {fall.way:6}{fall.moment:11.6f}{fall.energy:12.6f}"
            f"{index:7}{fall.apart:9.0e}{1e3 * fall.seconds:6.0f} ms  {fall.cost}"
        )
    ends = ", ".join(f"{way} {gamma:.4f}" for way, gamma in overshoot.items())
    rows.append(f"ellipse under the dead moment of its first limit, gamma where it ends: {ends}")
    return "\n".join(rows)


if __name__ == "__main__":
    place = folder("three_ways_to_fall") / "falls.txt"
    place.write_text(table() + "\n")
    print(table())
    print(f"written to {place}")
