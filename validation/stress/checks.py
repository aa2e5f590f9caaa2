"""What must hold for every record of every ring: faults by name, without exceptions.

Only the record and the scene are used, and nothing of either solver.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from der.errors import Reason
from der.geometry.mesh import sites
from der.records.configurations import Shapes
from der.records.path import NUMBERS, Path, Point
from der.scene import Scene
from der.utils.checks import Array
from validation.stress.random_rings import DENSE, largest_error, work_missing

Fault = tuple[str, str]  # a name, which is the reason in the summary, and a sentence

SAME = 1e-9  # rad: two gammas that are one
MONOTONIC = 1e-7  # of the largest |M|: differences that are rounding
GEOMETRY = 1e-10  # of a frame, an edge, a gap, in units of 1 and of a
FEWEST = 4  # states in a row of which the work can be summed
STABLE_KINDS = ("fold", "branch", "snap")  # across which the index may change


def not_converged(reason: str) -> str:
    """Name of the fault that a solver has given up; ``reason`` as in the record."""
    return f"NotConverged {reason}"


def faults(scene: Scene, path: Path) -> Iterator[Fault]:
    """Faults of a path, finished or not."""
    if not len(path):
        return
    yield from _start(path)
    if path.status == "done":
        yield from _end(scene, path)
    yield from _points(path)
    if scene.control == "arclength" and path.error is None:
        yield from _monotonic(path, scene.tolerance)
    yield from _indices(path)
    if path.error is not None:
        yield from _errors(path)
    if path.shapes is not None and path.solver == "der":
        yield from geometry(scene, path, path.shapes)


def _start(path: Path) -> Iterator[Fault]:
    if path.gamma[0] != 0.0:
        yield "start", f"the path starts at gamma = {path.gamma[0]}"
    if abs(path.moment[0]) > 1e-6 * max(1.0, float(np.abs(path.moment).max())):
        yield "start", f"the flat ring has a moment of {path.moment[0]}"


def _end(scene: Scene, path: Path) -> Iterator[Fault]:
    """A finished path ends where it should, and has every state that was asked for."""
    last = float(path.gamma[-1])
    expected = {0.0} if scene.unload else {scene.gamma_max}
    if path.reason == Reason.TURNED_BACK.word:
        expected = {-scene.gamma_max}
    elif path.reason == Reason.CLOSED.word:
        expected = {0.0}
    elif scene.until == "folded":
        expected |= {math.pi, -math.pi}
    if last not in expected:
        yield "end", f"the path is done but ends at gamma = {last!r}"
    if scene.control == "moment":  # under a dead moment gamma jumps
        return
    targets = scene.save_at
    if targets is None:
        eighth = math.pi / 8.0
        targets = [k * eighth for k in range(int(float(path.gamma.max()) / eighth) + 1)]
    met = {gamma for gamma in targets if gamma <= float(path.gamma.max())}
    if missing := sorted(met - set(path.gamma.tolist())):
        yield "save_at", f"gamma = {missing[0]} was asked for and is not there"


def _points(path: Path) -> Iterator[Fault]:
    """Points are states of the arrays, in order, and a fold changes the index by one."""
    places = [point.position for point in path.points]
    if places != sorted(places):
        yield "points", f"the points are not in path order: {places}"
    for point in path.points:
        k = point.position
        if any(getattr(point, name) != getattr(path, name)[k] for name in NUMBERS):
            yield "points", f"the {point.kind} at gamma = {point.gamma} is not state {k}"
        known = point.index_before is not None and point.index_after is not None
        if point.kind == "fold" and known and path.numerics.get("control") == "arclength":
            change = (point.index_after or 0) - (point.index_before or 0)
            if abs(change) != 1:
                yield "fold index", f"the index changes by {change} at the fold {point.gamma}"


def _monotonic(path: Path, tolerance: float) -> Iterator[Fault]:
    """Gamma turns back at folds only, and M at limits only."""
    crossings = {point.position for point in path.contacts}
    cuts = _cuts(path, path.folds)
    same = max(SAME, tolerance)  # residuals leave gamma as uncertain as they are large
    for low, high in pairwise(cuts):
        rise = np.diff(path.gamma[low : high + 1])
        if not rise.size or min(rise.max(), -rise.min()) <= same:
            continue
        back = low + np.flatnonzero(rise * np.sign(rise.sum()) < 0.0)
        if all({k, k + 1} & crossings for k in back.tolist()):
            place = path.gamma[back[0]]
            yield "out of order", f"a self-crossing stands in the wrong place at {place}"
            return
        yield "missed fold", f"gamma turns between {path.gamma[low]} and {path.gamma[high]}"
    rounding = max(MONOTONIC * float(np.abs(path.moment).max()), 100.0 * tolerance)
    for low, high in pairwise(_cuts(path, path.limits)):
        rise = np.diff(path.moment[low : high + 1])
        if rise.size and min(rise.max(), -rise.min()) > rounding:
            yield "missed limit", f"M turns between gamma = {path.gamma[low]}, {path.gamma[high]}"


def _cuts(path: Path, points: tuple[Point, ...]) -> list[int]:
    return [0, *(point.position for point in points), len(path) - 1]


def _indices(path: Path) -> Iterator[Fault]:
    """Between neighbours without a singular state, the index does not change."""
    singular = {point.position for point in path.points if point.kind in STABLE_KINDS}
    index = path.index.tolist()
    for k, (a, b) in enumerate(pairwise(index)):
        if {k, k + 1} & singular or a is None or b is None:
            continue
        if a != b:
            yield "index", f"the index is {a}, then {b} after gamma = {path.gamma[k]}, unexplained"
            return


def _errors(path: Path) -> Iterator[Fault]:
    """Error bars are numbers >= 0."""
    entries: Any = path.error
    for name in NUMBERS:
        known = [bar for bar in entries[name] if bar is not None]
        if any(bar < 0.0 for bar in known):
            yield "error bar", f"an error of {name} is {min(known)}"


# --- Energy is work --------------------------------------------------------------------------


def work_lost(path: Path, *, asked: bool = False) -> float:
    """Largest part of U that the work 4 M dgamma does not account for, snaps left out.

    With ``asked``, only up to where gamma turns negative: no states can be asked for there.
    """
    negative = np.flatnonzero(path.gamma < 0.0)
    end = int(negative[0]) if asked and len(negative) else len(path)
    snaps = [p.position for p in path.points if p.kind == "snap" and p.position < end]
    scale = float(np.abs(path.energy).max())
    worst = 0.0
    for low, high in pairwise([0, *snaps, end]):
        part = _part(path, low, high)
        if len(part) < FEWEST or not np.abs(part.moment).max() > 0.0 or np.ptp(part.gamma) < SAME:
            continue
        missing = work_missing(part) * float(part.energy.max()) / scale
        # on a very short path, U is rounding
        if missing * scale > 1e-9:
            worst = max(worst, missing)
    return worst


def denser(path: Path, last: float) -> tuple[float, ...]:
    """Values of gamma up to ``last``, `DENSE` to a half turn, at which to ask for states again.

    As many between any two neighbours as the curve of M is long there, and as the follower needed
    steps: the moment of a stiff ring can rise and fall within a hundredth of a radian.
    """
    count = DENSE * max(1, round(last / math.pi))
    scaled = np.column_stack([path.gamma / math.pi, path.moment / np.abs(path.moment).max()])
    length = np.linalg.norm(np.diff(scaled, axis=0), axis=1)
    shares = 0.5 * count * (length / length.sum() + 1.0 / len(length))
    found = [
        np.linspace(a, b, math.ceil(share) + 1)
        for (a, b), share in zip(pairwise(path.gamma), shares, strict=True)
    ]
    gammas = np.concatenate(found).round(6)  # where a path turns back, not twice
    return tuple(np.unique(gammas.clip(0.0, last)).tolist())


def _part(path: Path, low: int, high: int) -> Path:
    """The states from ``low`` up to ``high`` as a path of their own."""
    keep = slice(low, high)
    columns = (*NUMBERS, "index", "index_moment")
    entries: dict[str, Any] = {name: getattr(path, name)[keep] for name in columns}
    return replace(path, **entries, points=(), error=None, raw=None, shapes=None)


def too_uncertain(path: Path, tolerance: float) -> Iterator[Fault]:
    """Errors of the states of the boundary-value problem above the tolerance."""
    # on a very short path, errors are relative to the small values there
    if len(path) > 1 and np.ptp(path.gamma) > 0.05:
        largest = largest_error(path)
        if not largest <= tolerance:
            yield "error above tolerance", f"an error of {largest:.2g} is estimated"


# --- Shapes ----------------------------------------------------------------------------------


def geometry(scene: Scene, path: Path, shapes: Shapes) -> Iterator[Fault]:
    """The ring is closed, keeps its lengths, and its grips have the prescribed angle."""
    places = sites(scene.ring, scene.n_edges, "full")
    cell = np.diff(places)
    length = 0.5 * (cell + np.roll(cell, 1))
    gram = shapes.frames @ shapes.frames.swapaxes(2, 3) - np.eye(3)
    if (worst := float(np.abs(gram).max())) > GEOMETRY:
        yield "frames", f"a frame is off orthonormal by {worst:.2g}"
    edge = shapes.x - np.roll(shapes.x, 1, axis=1)
    d3 = shapes.frames[:, :, 2]
    present = np.sum(edge * d3, axis=2)
    beside = np.abs(edge - present[:, :, None] * d3).max()
    # positions are as good as the residual, whose rounding is that of the shortest cell
    stiffest = max(scene.section.alpha, scene.section.beta, 1.0)
    noise = 1e-15 * stiffest / float(cell.min())
    tolerance = max(GEOMETRY, 10.0 * scene.tolerance, 10.0 * noise) * scene.ring.length
    if (shortest := float(present.min())) <= 0.0:
        yield "inside out", f"an edge has a length of {shortest:.2g} a"
        return
    if beside > tolerance:  # the closing edge is a difference of all the others
        yield "closure", f"the ring gapes by {beside:.2g} a"
    if scene.stretch == "inextensible" and (worst := np.abs(present - length).max()) > tolerance:
        yield "length", f"an edge is {worst:.2g} a too long"
    gamma = path.gamma if path.raw is None else np.array(path.raw["gamma"])
    for j, sign in ((0, 1.0), (scene.n_edges // 2, -1.0)):
        turned = sign * np.stack(
            [-sign * np.sin(gamma), np.cos(gamma), np.zeros_like(gamma)], axis=1
        )
        if (worst := float(np.abs(d3[:, j] - turned).max())) > 1e-9:
            yield "grip", f"a grip is turned wrongly by {worst:.2g} rad"


def asymmetry(scene: Scene, shapes: Shapes) -> Array:
    """How far each state (n,) is from the symmetry of its ring, a.

    The half-turn about E3 maps vertex j to N - 1 - j; that about E2, of a D2 ring, to N/2 - 1 - j.
    """
    x = shapes.x
    about_e3 = x[:, ::-1] * [-1.0, -1.0, 1.0]
    off = np.abs(x - about_e3).max(axis=(1, 2))
    if scene.ring.symmetry == "D2":
        about_e2 = np.roll(x[:, ::-1], x.shape[1] // 2, axis=1) * [-1.0, 1.0, -1.0]
        off = np.maximum(off, np.abs(x - about_e2).max(axis=(1, 2)))
    return np.asarray(off)


# --- Two records of one ring -----------------------------------------------------------------


def unlike(a: Path, b: Path, tolerance: float) -> Iterator[Fault]:
    """Where two paths of one ring differ: in their folds and limits, or at equal gamma."""
    for kind in ("fold", "limit"):
        pair = [[p.gamma for p in path.points if p.kind == kind] for path in (a, b)]
        if len(pair[0]) != len(pair[1]):
            yield "other points", f"{len(pair[0])} and {len(pair[1])} points of kind {kind}"
            return
        away = float(np.abs(np.array(pair[0]) - np.array(pair[1])).max(initial=0.0))
        # a fold or limit is where a rate vanishes: its place is soft
        if away > max(1e-5, math.sqrt(tolerance)):
            yield "other points", f"a {kind} is {away:.2g} rad away"
    scales = {
        name: float(np.abs(getattr(a, name)).max(initial=0.1)) for name in ("moment", "energy")
    }
    for gamma, ours, theirs in _at_equal_gamma(a, b):
        if len(ours) != len(theirs):
            if not _at_a_turn(a, gamma):
                yield "other states", f"{len(ours)} and {len(theirs)} at gamma = {gamma}"
            continue
        for i, k in zip(ours, theirs, strict=True):
            for name, scale in scales.items():
                off = abs(getattr(a, name)[i] - getattr(b, name)[k]) / scale
                if not off <= tolerance:
                    yield "other values", f"{name} differs by {off:.2g} at gamma = {gamma}"
                    return
            known = a.index[i] is not np.ma.masked and b.index[k] is not np.ma.masked
            if known and a.index[i] != b.index[k]:
                yield "other index", f"{a.index[i]} and {b.index[k]} at gamma = {gamma}"
                return


def _at_equal_gamma(a: Path, b: Path) -> Iterator[tuple[float, list[int], list[int]]]:
    """Every gamma that both paths have, and the positions of its states; no special points."""
    tables: list[dict[float, list[int]]] = [{}, {}]
    for path, table in zip((a, b), tables, strict=True):
        special = {point.position for point in path.points}
        for k, gamma in enumerate(path.gamma.tolist()):
            if k not in special:
                table.setdefault(gamma, []).append(k)
    for gamma in sorted(set(tables[0]) & set(tables[1])):
        yield gamma, tables[0][gamma], tables[1][gamma]


def _at_a_turn(path: Path, gamma: float) -> bool:
    return any(abs(point.gamma - gamma) < 1e-6 for point in path.folds)


def outside_error_bars(rod: Path, reference: Path, times: float) -> Iterator[Fault]:
    """Where the other solver's values lie outside ``times`` the sum of both errors.

    Where the rod knows no error, neither its values nor the number of its states are checked.
    """
    errors: list[Any] = [rod.error, reference.error]
    for name in ("moment", "energy"):
        scale = float(np.abs(getattr(reference, name)).max())
        for gamma, ours, theirs in _at_equal_gamma(rod, reference):
            if len(ours) != len(theirs):
                sure = all(errors[0][name][i] is not None for i in ours)
                if sure and not _at_a_turn(reference, gamma):
                    yield "other states", f"{len(ours)}, {len(theirs)} at gamma = {gamma}"
                continue
            for i, k in zip(ours, theirs, strict=True):
                bars = errors[0][name][i], errors[1][name][k]
                if None in bars:
                    continue
                off = abs(getattr(rod, name)[i] - getattr(reference, name)[k])
                if off > times * sum(bars) + 1e-8 * scale:
                    times_off = f"{off / sum(bars):.1f} times its error off"
                    yield "outside error bars", f"{name} at gamma = {gamma} is {times_off}"
                    return
