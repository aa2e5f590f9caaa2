"""One case of a phase diagram: a ring and its section, and the row that says how it folds."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property, partial
from importlib.metadata import version
from typing import Any

import numpy as np

from der.geometry.ring import Ring
from der.geometry.section import rectangular_section
from der.geometry.shapes import ring_from_json
from der.records.path import Path
from der.scene import Scene

UNFOLDABLE = "unfoldable"
HELD = ("unstable at fixed moment", "stable at fixed moment", "stays folded when released")
LABELS = (UNFOLDABLE, *(f"{held}, snap-{way}" for held in HELD for way in ("through", "back")))
FAILED = "failed"  # stands in place of a label
PARAMETERS = ("b_over_a", "r_over_a", "vertex_angle", "natural_curvature", "h_over_t", "nu")
OWN = {  # parameters of each shape, besides those of the section
    "circle": ("natural_curvature",),
    "ellipse": ("b_over_a",),
    "rectangle": ("b_over_a", "r_over_a"),
    "triangle": ("vertex_angle", "r_over_a"),
}
TOLERANCE = 1e-6  # solved to 1e-8, none of 180 cases beside boundaries had another label


@dataclass(frozen=True)
class Case:
    """A ring to be folded; parameters that its shape does not have are None.

    Parameters
    ----------
    shape : "circle", "ellipse", "rectangle" or "triangle"
    h_over_t : height over thickness of the section
    twist_axis : "x" or "y"
    b_over_a : short semi-axis over the long one
    r_over_a : radius of the fillets
    vertex_angle : of a triangle at the apex [degrees]
    natural_curvature : of a circle [1/a]
    nu : Poisson's ratio
    tolerance : of the boundary-value problem, see `validation.solve`

    Raises
    ------
    ValueError
        For an unknown shape, or a parameter that is missing or that the shape does not have. Values
        are checked where the case is solved.
    """

    shape: str
    h_over_t: float
    twist_axis: str = "x"
    b_over_a: float | None = None
    r_over_a: float | None = None
    vertex_angle: float | None = None
    natural_curvature: float | None = None
    nu: float = 0.3
    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        if self.shape not in OWN:
            raise ValueError(f"shape must be one of {', '.join(OWN)}, got {self.shape!r}")
        for name in PARAMETERS[:-2]:
            given, needed = getattr(self, name), name in OWN[self.shape]
            if (given is None) is needed:
                word = "given" if needed else "left out"
                raise ValueError(f"{name} must be {word} for shape {self.shape!r}, got {given!r}")

    def to_json(self) -> dict[str, Any]:
        """What is not None, by name; a JSON object."""
        entries = ((entry.name, getattr(self, entry.name)) for entry in fields(self))
        return {name: value for name, value in entries if value is not None}

    @cached_property
    def key(self) -> str:
        """Hash of the parameters, the tolerance and the version of this package."""
        text = json.dumps([self.to_json(), _version(), LABELS], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]

    def ring(self) -> Ring:
        """The ring.

        Raises
        ------
        ValueError
            If a value is not allowed.
        """
        own = {name: getattr(self, name) for name in OWN[self.shape]}
        return ring_from_json({"shape": self.shape, **own, "twist_axis": self.twist_axis})

    def scene(self, **wanted: Any) -> Scene:
        """The scene with ring and section, and what else is wanted of it.

        Raises
        ------
        ValueError
            If a value is not allowed.
        """
        return Scene(self.ring(), rectangular_section(self.h_over_t, self.nu), **wanted)


@dataclass(frozen=True)
class Row:
    """How a case folds; numbers are None, and truths False, where the case failed.

    Attributes
    ----------
    case : what was solved
    label : one of LABELS, or FAILED
    foldable, stable : see `der.records.path.folding_mode`; never stable if not foldable
    snapping : "none", "snap-through" or "snap-back", also of rings that are not foldable
    stays_folded : whether a ring that is stable at fixed moment stays folded when released
    moment, slope : M [GJ/a] and dM/dgamma at the first arrival at pi
    folds : gammas of the folds [rad], in path order
    error : largest estimated error on the path, of gamma/pi and of M over the largest |M|
    seconds : what it took
    status : "ok" or "failed"
    message : why it failed
    """

    case: Case
    label: str
    foldable: bool = False
    stable: bool = False
    snapping: str = "none"
    stays_folded: bool = False
    moment: float | None = None
    slope: float | None = None
    folds: tuple[float, ...] = ()
    error: float | None = None
    seconds: float = 0.0
    status: str = "ok"
    message: str = ""

    @property
    def ok(self) -> bool:
        """Whether the case was solved."""
        return self.status == "ok"

    def to_json(self) -> dict[str, Any]:
        """A JSON object."""
        entries = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        return entries | {"case": self.case.to_json(), "folds": list(self.folds)}

    @classmethod
    def from_json(cls, entries: Mapping[str, Any]) -> Row:
        """The row that `to_json` wrote.

        Raises
        ------
        ValueError
            If an entry is missing or not known.
        """
        try:
            known = {**entries, "case": Case(**entries["case"]), "folds": tuple(entries["folds"])}
            row = cls(**known)
        except (KeyError, TypeError) as problem:
            raise ValueError(f"not a row: {problem}") from problem
        if row.label not in (*LABELS, FAILED):  # of another version of this package
            raise ValueError(f"not a row: label is {row.label!r}")
        return row


def solve_case(case: Case) -> Row:
    """How a case folds, by the boundary-value problem.

    A case that cannot be stated or solved is a row that says why; nothing is raised.
    """
    from der.bvp.solve import solve_bvp  # kernels: only where cases are solved, not where counted

    started = time.perf_counter()
    row = row_by(case, partial(solve_bvp, tolerance=case.tolerance), save_at=())
    return replace(row, seconds=round(time.perf_counter() - started, 6))


def row_by(case: Case, solve: Callable[[Scene], Path], **wanted: Any) -> Row:
    """How a case folds by a solver, with further entries of its scene; nothing is raised."""
    try:
        return row_of(case, solve(case.scene(**wanted)))
    except Exception as problem:  # whatever it is, the other cases go on
        return failed(case, f"{type(problem).__name__}: {problem}")


def failed(case: Case, why: str) -> Row:
    """The row of a case that could not be solved."""
    return Row(case, FAILED, status="failed", message=why)


def row_of(case: Case, path: Path) -> Row:
    """The row of a path from gamma = 0 to pi, of either solver."""
    mode, at_pi = path.mode, path.at_pi
    if mode is None:
        return failed(case, path.message or "the path has not reached pi")
    stable, stays = bool(mode.stable), bool(mode.stable and mode.stable_free)
    label = label_of(mode.foldable, stable + stays, mode.snapping)
    if label == FAILED:
        return failed(case, "a foldable ring without a limit of M")
    # a path that turns back never arrives at pi
    moment, slope = (None, None) if at_pi is None else (at_pi.moment, at_pi.slope)
    how = (mode.foldable, stable, mode.snapping, stays)
    folds = tuple(point.gamma for point in path.folds)
    return Row(case, label, *how, moment, slope, folds, _error(path))


def label_of(foldable: bool, held: int, snapping: str) -> str:
    """The label of a folding mode; snapping is no part of it where the ring is not foldable.

    ``held`` : the number of what a folded ring is, in HELD.

    M vanishes at 0 and pi of a foldable ring, so that it has a limit at least: FAILED without.
    """
    if not foldable:
        return UNFOLDABLE
    if snapping == "none":
        return FAILED
    return f"{HELD[held]}, {snapping}"


def _error(path: Path) -> float | None:
    """Largest estimated error of a path, relative; None where one is not known."""
    bars: Any = path.error
    if bars is None or None in (*bars["gamma"], *bars["moment"]):
        return None
    largest = float(np.abs(path.moment).max())
    parts = [bar / math.pi for bar in bars["gamma"]] + [bar / largest for bar in bars["moment"]]
    return float(max(parts))


@cache
def _version() -> str:
    return version("ring-origami")
