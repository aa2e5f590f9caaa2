"""Random rings over the ranges of the paper's phase diagrams, and faults of their paths.

A path is suspect if it does not end at pi, if its energy is not the work done, or if an error is
above the tolerance. If the continuation jumps to another path, the energy is no longer the work
done.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from der.analysis.work import work_missing as work_missing
from der.bvp.solve import TOLERANCE, solve_bvp
from der.errors import NotConverged
from der.geometry.ring import Ring
from der.geometry.section import Section
from der.records.path import Path
from der.scene import Scene
from scenarios.random_folds import DENSE as DENSE
from scenarios.random_folds import LOOSE as LOOSE
from scenarios.random_folds import random_rings as random_rings
from scenarios.random_folds import work_faults


@dataclass(frozen=True)
class Suspect:
    """A ring whose path has a fault."""

    ring: Ring
    section: Section
    name: str  # "not converged", "not at pi", "work" or "error"
    message: str


@dataclass(frozen=True)
class Survey:
    """The results of a survey."""

    rings: int
    reached_pi: int
    suspects: tuple[Suspect, ...]
    seconds: tuple[float, ...]  # of each solve, as its record says

    def named(self, name: str) -> tuple[Suspect, ...]:
        """The suspects of one name."""
        return tuple(suspect for suspect in self.suspects if suspect.name == name)


def survey(count: int, seed: int, tolerance: float = TOLERANCE) -> Survey:
    """Solve random rings and judge their paths."""
    suspects: list[Suspect] = []
    seconds = []
    reached = 0
    for ring, section in islice(random_rings(count, seed), count):
        scene = Scene(ring, section)
        try:
            path = solve_bvp(scene, tolerance=tolerance)
            reached += path.at_pi is not None
            found = list(faults(scene, path, tolerance))
        except NotConverged as failure:
            path, found = failure.path, [("not converged", str(failure))]
        seconds.append(path.timing.solve_s)
        suspects += [Suspect(ring, section, name, message) for name, message in found]
    return Survey(count, reached, tuple(suspects), tuple(seconds))


def faults(scene: Scene, path: Path, tolerance: float) -> Iterator[tuple[str, str]]:
    """Names of what is wrong with a path to pi, each with a sentence."""
    if path.at_pi is None or path.gamma[-1] != math.pi:
        yield "not at pi", f"the path ends at gamma = {path.gamma[-1]:.9f}"
    largest = largest_error(path)
    if not largest <= tolerance:
        yield "error", f"an error of {largest:.2g} is estimated"
    for text in work_faults(scene, path, partial(solve_bvp, tolerance=tolerance)):
        yield "work", text


def largest_error(path: Path) -> float:
    """Largest estimated error of gamma/pi, M and U, relative to the largest on the path."""
    scales = {
        "gamma": math.pi,
        "moment": float(np.abs(path.moment).max()),
        "energy": float(path.energy.max()),
    }
    errors: Mapping[str, Any] = path.error or {}
    return max(float(np.max(errors[name])) / scale for name, scale in scales.items())
