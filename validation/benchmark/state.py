"""One state of the circle, M at gamma = pi/2, by every code that can turn a ring: error over time.

A code that steps a rod through time has no path. So all codes compute one number, from the flat
ring on, before the ring folds or snaps.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import chain
from typing import Any

import der
from der.bvp.solve import FINEST
from validation.benchmark import elastica
from validation.benchmark.extent import Extent
from validation.benchmark.methods import RELAXATION, ROD, attempts
from validation.benchmark.rings import RINGS
from validation.benchmark.rows import Attempt, Trial, front_text

NAME = "circle, h/t 4, M at pi/2"
GAMMA = 0.5 * math.pi
CIRCLE = RINGS[0]
METHODS = {
    name: ROD[name] for name in ("rod, sector", "rod, full ring", "rod, extrapolated", RELAXATION)
}
PEER = "PyElastica, closed ring"


def rows(extent: Extent) -> Iterator[Trial | str]:
    """Errors over time of all methods, and of PyElastica where it is installed."""
    scene = partial(CIRCLE.scene, gamma_max=GAMMA, save_at=(GAMMA,))
    exact = float(der.solve_bvp(scene(), tolerance=FINEST).moment[-1])

    def errors(found: Any) -> Mapping[str, float]:
        moment = found if isinstance(found, float) else float(found.moment[-1])
        return {"moment": max(abs(moment / exact - 1.0), FINEST)}

    trials = []
    for attempt in chain(attempts(scene, extent, METHODS), _peer(extent)):
        trials.append(attempt.trial(NAME, errors))
        yield trials[-1]
    if not elastica.installed():
        yield "PyElastica: not installed, skipped"
    yield front_text(NAME, trials)


def _peer(extent: Extent) -> Iterator[Attempt]:
    section = CIRCLE.scene().section
    if elastica.installed() and extent.elements:
        elastica.moment(section, 8, 0.1)  # compiles or loads the kernels
        for n in extent.elements:
            work = partial(elastica.moment, section, n, GAMMA)
            yield Attempt(PEER, f"N {n}", work, 1, memory=False)
