"""Comparison of the rod with the boundary-value problem, at every state of the rod.

A state of the rod has errors in gamma, M and U. It is compared by its normal distance from the
curve of the boundary-value problem, in (gamma/pi, M/max|M|) and in (gamma/pi, U/max U), so states
need not be matched. The curve is solved for at every gamma of the rod's states, with exact slopes
(dM/dgamma from the linearised problem, dU/dgamma = 4 M). The distance is that from a tangent,
without interpolation. A state beside a fold may lie beyond the last gamma of the curve: it is
compared with the tangent at the fold. Folds and limits are compared one by one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from der.bvp.events import Point
from der.bvp.solve import solve_with_points
from der.records.comparison import ComparedPoint, ComparedState, Comparison
from der.records.path import Path
from der.scene import Scene

TOLERANCE = 1e-10  # of the boundary-value problem: below the rod's error bars
SAME = 1e-9  # rad: two crossings of the same gamma
FAR = 0.05  # of the scaled plane; a state farther away belongs to another branch


def compare(
    scene: Scene,
    rod: Path | None = None,
    *,
    tolerance: float = TOLERANCE,
    progress: Callable[[float], object] | None = None,
) -> Comparison:
    """Compare the path of a scene by the rod with that by the boundary-value problem.

    Parameters
    ----------
    scene : controlled by arc length.
    rod : its path, if `der.fold` has found it already. With error bars (`Scene.error_bars`) the
        comparison tells whether both agree.
    tolerance : of the boundary-value problem, see `solve_bvp`.
    progress : called with gamma [rad] after every state of either path.

    Raises
    ------
    ValueError
        For a scene that the boundary-value solver cannot solve, or a path that is not of a rod.
    NotConverged
        If a path cannot be followed to its end.
    """
    if rod is None:
        from der.analysis.fold import fold

        rod = fold(scene, progress=progress)
    if rod.solver != "der":
        raise ValueError(f"rod must be a path of a rod (solver 'der'), got {rod.solver!r}")
    wanted = replace(
        scene,
        error_bars=False,
        shapes=False,
        save_at=tuple(sorted({g for g in rod.gamma.tolist() if 0.0 <= g <= _last(scene)})),
    )
    bvp, points = solve_with_points(wanted, tolerance=tolerance, progress=progress)
    scales = {name: float(np.abs(getattr(bvp, name)).max()) for name in ("moment", "energy")}
    folds = {point.position for point in rod.folds}
    states = [
        found
        for k in range(len(rod))
        if k not in folds and (found := _state(rod, k, points, scales, tolerance)) is not None
    ]
    pairs, alone = _pairs(rod, bvp)
    missing = len(rod) - len(rod.folds) - len(states)
    return Comparison(rod, bvp, tuple(states), tuple(pairs), alone + missing)


def _last(scene: Scene) -> float:
    return math.inf if scene.until == "folded" else scene.gamma_max


def _state(
    rod: Path, k: int, points: Sequence[Point], scales: Mapping[str, float], tolerance: float
) -> ComparedState | None:
    """State k of the rod, and the nearest solution: at its gamma, or a fold."""
    gamma = float(rod.gamma[k])
    values = {name: float(getattr(rod, name)[k]) for name in scales}

    def apart(point: Point) -> float:
        others = {name: getattr(point.solution, name) for name in scales}
        away = (point.solution.gamma - gamma) / math.pi
        return math.hypot(away, *((others[n] - values[n]) / scales[n] for n in scales))

    here = [one for one in points if one.kind == "fold" or abs(one.solution.gamma - gamma) < SAME]
    if not here:
        return None
    point, errors = min(here, key=apart), _errors(rod, k)
    if point.kind == "fold" and apart(point) > FAR:
        return None
    kinds = {special.position: special.kind for special in rod.points}
    entries: dict[str, Any] = {"gamma": gamma, "kind": kinds.get(k, "")}
    for name, scale in scales.items():
        distance, bar = _distance(name, (gamma, values[name]), point, scale, errors)
        entries |= {
            f"rod_{name}": values[name],
            f"bvp_{name}": getattr(point.solution, name),
            f"{name}_distance": distance,
            f"{name}_bar": None if bar is None else bar + tolerance,
        }
    far = max(entries[f"{name}_distance"] for name in scales) > FAR
    return None if far else ComparedState(**entries)


def _distance(
    name: str,
    place: tuple[float, float],
    point: Point,
    scale: float,
    errors: Mapping[str, float] | None,
) -> tuple[float, float | None]:
    """Normal distance of a place from the tangent at a solution, in the scaled plane, and its bar.

    Parameters
    ----------
    name : "moment" or "energy".
    place : gamma and value of the rod.
    """
    at = point.solution
    # rates of gamma and of the value: the moment's is not dM/dgamma, which a fold has not
    rates = (at.parameter_rate, at.moment_rate) if name == "moment" else (1.0, 4.0 * at.moment)
    flat, steep = rates[0] / math.pi, rates[1] / scale
    flat, steep = flat / math.hypot(flat, steep), steep / math.hypot(flat, steep)
    away = (place[0] - at.gamma) / math.pi, (place[1] - getattr(at, name)) / scale
    distance = abs(away[1] * flat - away[0] * steep)
    if errors is None:
        return distance, None
    vertical = (errors[name] + getattr(point.error, name)) / scale
    horizontal = (errors["gamma"] + point.error.gamma) / math.pi
    return distance, vertical * abs(flat) + horizontal * abs(steep)


def _errors(rod: Path, k: int) -> Mapping[str, float] | None:
    """Error bars of state k; None: one is not known."""
    if rod.error is None:
        return None
    bars: Mapping[str, Any] = rod.error
    errors = {name: bars[name][k] for name in ("gamma", "moment", "energy")}
    return None if None in errors.values() else errors


def _pairs(rod: Path, bvp: Path) -> tuple[list[ComparedPoint], int]:
    """Folds and limits of both, matched in path order; and the number of unmatched ones."""
    pairs: list[tuple[int, ComparedPoint]] = []
    alone = 0
    for kind in ("fold", "limit"):
        ours, theirs = ([p for p in path.points if p.kind == kind] for path in (rod, bvp))
        alone += abs(len(ours) - len(theirs))
        if len(ours) != len(theirs):
            continue
        for a, b in zip(ours, theirs, strict=True):
            errors = _errors(rod, a.position)
            solved: Mapping[str, Any] = bvp.error or {}
            bar = None if errors is None else errors["gamma"] + solved["gamma"][b.position]
            pairs.append((a.position, ComparedPoint(kind, a.gamma, b.gamma, bar)))
    return [pair for _, pair in sorted(pairs, key=lambda one: one[0])], alone
