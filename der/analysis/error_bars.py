"""Error bars: the path on N, N/2 and N/4 edges, extrapolated state by state (Richardson, Romberg).

The states of the three meshes are matched one by one, and moved to their places on the extrapolated
curve (`extrapolation.curve`). An error is the last correction of the extrapolation, and an estimate
of what is left after it (`extrapolation.remaining_error`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from der.analysis.extrapolation.arrival import first_arrival, fold_near_pi
from der.analysis.extrapolation.curve import Family, Place, placed
from der.analysis.extrapolation.folds import all_asked, arc_lengths
from der.analysis.extrapolation.located import located, marked, merged
from der.analysis.extrapolation.remaining_error import Corrections, scales_of
from der.analysis.path_record import COLUMNS, columns
from der.analysis.request import EIGHTH, LOOSE_TURN, Request
from der.errors import ContinuationFailed, Reason
from der.kernels.quaternions import Array
from der.problem import Point
from der.records.path import AtPi, Mode
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing


@dataclass(frozen=True)
class ErrorBars:
    """The extrapolated points of a path, in path order, and their entries in the record.

    If a level has no state, errors are None and the values are those of N edges.
    """

    points: tuple[Point[Equilibrium], ...]  # (n,) see `error_bars` for those left out
    values: dict[str, Array]  # gamma, moment, energy (n,)
    raw: dict[str, list[float]]  # the same on N edges
    error: dict[str, object]  # the record's entry
    slope: float | None = None  # dM/dgamma at the first arrival at pi, GJ/a; None: no such state
    note: Reason | None = None  # what a reader should know

    def at_pi(self, at_pi: AtPi | None, mode: Mode | None) -> dict[str, AtPi | Mode | None]:
        """Return the entries of the record at pi, with the extrapolated values."""
        if self.note is Reason.FOLD_NEAR_PI:
            return {"at_pi": None, "mode": None}
        if at_pi is None or mode is None or self.slope is None:
            return {"at_pi": at_pi, "mode": mode}
        k = self.values["gamma"].tolist().index(math.pi)
        moment, energy = (float(self.values[name][k]) for name in ("moment", "energy"))
        falls = self._falls(self.slope)
        held = None if at_pi.index is None or falls is None else at_pi.index + falls
        stable_3d = None if held is None else held == 0
        # released without a load, a ring is free to move as at fixed moment, too
        free, stays = at_pi.index_free, mode.stable_free
        if stays and falls is not False:
            free, stays = None, False if falls else None
        there = replace(at_pi, moment=moment, energy=energy, slope=self.slope)
        return {
            "at_pi": replace(there, index_moment=held, index_free=free),
            "mode": replace(
                mode,
                stable=None if falls is None or not mode.foldable else not falls,
                stable_3d=False if at_pi.index else stable_3d,
                stable_free=stays,
            ),
        }

    def _falls(self, slope: float) -> bool | None:
        """Whether M falls with gamma at pi; None: the error leaves it open."""
        error = self.error["slope_at_pi"]
        return slope < 0.0 if isinstance(error, float) and abs(slope) > error else None


def error_bars(
    rings: Sequence[GrippedRing], request: Request, points: Sequence[Point[Equilibrium]]
) -> ErrorBars:
    """Return extrapolated values and errors of a path followed on the finest of three meshes.

    Parameters
    ----------
    rings : the sector at the three levels, finest first (`scene.meshes`).
    request : that of the path. A gamma that was asked for is kept; moment and energy become those
        at this gamma on the extrapolated curve.
    points : the path on the finest mesh.

    Notes
    -----
    Folds and limits move to those of the extrapolated curve, a little forward or backward on the
    path. States that were not asked for and that they pass are left out: their index would be that
    of the other side. Branch points and self-crossings that a coarser mesh lacks have values on the
    extrapolated curve, but no errors. Indices, and the mode apart from its slope, are those of N
    edges, and unknown if the extrapolation moves a state past a fold or branch point. If the path
    of the coarsest mesh ends elsewhere, values are not extrapolated, and errors unknown.
    """
    end = _end(rings[-1], request, max_steps=4 * len(points) + 100)
    if end != points[-1].solution.parameter:
        return _without_errors(rings, points, end)
    return _extrapolated(rings, request, points)


def _extrapolated(
    rings: Sequence[GrippedRing], request: Request, points: Sequence[Point[Equilibrium]]
) -> ErrorBars:
    """The same, for a path whose end the coarsest mesh may not reach."""
    asked = _asked(request, points)
    family = Family(tuple(rings), request.tolerance)
    points = all_asked(family, request, points, asked)
    scales = scales_of(family, points)
    places = [
        place if place is None or place.sought else located(family, point, place, scales)
        for point, place in zip(points, placed(family, points, asked), strict=True)
    ]
    points = [marked(*one) for one in zip(points, places, strict=True)]
    order = _order(arc_lengths(rings[0], points), places)
    points, places = merged(_certain(points, order), [places[k] for k in order])
    return _bars(family, points, places, scales)


def _asked(request: Request, points: Sequence[Point[Equilibrium]]) -> set[float]:
    """Values of gamma that states were solved for [rad]."""
    asked = {0.0, math.pi, request.gamma_max, -request.gamma_max}
    if request.targets is not None:
        return asked | set(request.targets)
    most = math.ceil(max(abs(one.solution.parameter) for one in points) / EIGHTH)
    return asked | {k * EIGHTH for k in range(-most, most + 1)}


def _end(ring: GrippedRing, request: Request, *, max_steps: int) -> float | None:
    """The gamma at which a path ends; None: it cannot be followed."""
    options = replace(request.options, aimed_turn=LOOSE_TURN, max_steps=max_steps)
    bare = replace(
        request, targets=(), limits=False, stability=False, self_crossings=False, options=options
    )
    try:
        return [one.solution.parameter for one in bare.follow(ring)][-1]
    except ContinuationFailed:
        return None


def _without_errors(
    rings: Sequence[GrippedRing], points: Sequence[Point[Equilibrium]], end: float | None
) -> ErrorBars:
    """Error bars without errors: the path of the coarsest mesh has another ``end``."""
    where = "cannot be followed to an end" if end is None else f"ends at gamma = {end:.6g}"
    values = columns(rings[0], points)
    how = (
        f"null, and values not extrapolated: on {rings[-1].n_edges} edges the path {where}, so that"
        " the meshes are not yet of one kind; use more edges"
    )
    raw = {name: column.tolist() for name, column in values.items()}
    unknown: dict[str, object] = {name: [None] * len(points) for name in values}
    return ErrorBars(tuple(points), values, raw, unknown | {"slope_at_pi": None, "how": how})


def _certain(
    points: Sequence[Point[Equilibrium]], order: Sequence[int]
) -> list[Point[Equilibrium]]:
    """Points in another order; those that have passed a singular one have no index."""
    place = {k: i for i, k in enumerate(order)}
    singular = [k for k in place if points[k].kind in ("fold", "branch")]
    # a point that was on the other side of a singular one: its index depends on the mesh
    passed = {k for k in place if any((place[s] < place[k]) != (s < k) for s in singular)}
    return [replace(points[k], index=None, sides=None) if k in passed else points[k] for k in order]


def _bars(
    family: Family,
    points: Sequence[Point[Equilibrium]],
    places: Sequence[Place | None],
    scales: Array,
) -> ErrorBars:
    """Values and errors of points at their places on the extrapolated curve."""
    corrections = Corrections.of(family, places, scales)
    bounds = [corrections.bound(k) for k in range(len(places))]
    arrival = first_arrival(points)
    unsure = fold_near_pi(family, points, places, corrections)
    if unsure and arrival is not None:
        bounds[arrival] = None
    raw = columns(family.rings[0], points)
    table = np.array(list(raw.values()))
    for k, place in enumerate(places):
        if place is not None:
            table[:, k] = place.values
    values = dict(zip(COLUMNS, table, strict=True))
    slope, slope_error = corrections.slope(None if unsure else arrival)
    error: dict[str, object] = {
        name: [None if b is None else float(b[c]) for b in bounds] for c, name in enumerate(COLUMNS)
    }
    note = Reason.FOLD_NEAR_PI if unsure else None
    how = _how(family.rings, bounds) + (f"; at pi unknown: {note.value}" if note else "")
    error |= {"slope_at_pi": slope_error, "how": how}
    plain = {name: column.tolist() for name, column in raw.items()}
    return ErrorBars(tuple(points), values, plain, error, slope, note)


def _order(lengths: Array, places: Sequence[Place | None]) -> list[int]:
    """Positions of the points in their order on the extrapolated curve, without passed ones."""
    at = [s + (0.0 if p is None else p.s) for s, p in zip(lengths, places, strict=True)]
    fixed = [p is not None and p.fixed for p in places]
    before = accumulate((a if f else -math.inf for a, f in zip(at, fixed, strict=True)), max)
    backward = zip(reversed(at), reversed(fixed), strict=True)
    after = reversed(list(accumulate((a if f else math.inf for a, f in backward), min)))
    kept = []
    for k, (low, high) in enumerate(zip(before, after, strict=True)):
        if places[k] is None:
            at[k] = min(max(at[k], low), high)  # known on N edges only: between its old neighbours
        if at[k] > at[-1]:
            continue  # a branch point or self-crossing that has moved beyond the end of the path
        if fixed[k] or places[k] is None or low < at[k] < high:
            kept.append(k)
    return sorted(kept, key=lambda k: at[k])


def _how(rings: Sequence[GrippedRing], bounds: Sequence[Array | None]) -> str:
    """How the errors were computed, in a sentence."""
    sizes = ", ".join(str(ring.n_edges) for ring in rings)
    text = (
        f"Romberg extrapolation from {sizes} edges, states matched in the planes normal to the path"
        " of the finest; an error is the last correction and an estimate of those to come"
    )
    missing = sum(bound is None for bound in bounds)
    if missing:
        text += (
            f"; null at {missing} of {len(bounds)} states: a coarser mesh has no such state or"
            " point"
        )
    return text
