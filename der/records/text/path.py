"""A path in a few lines of text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from der.records.forces import Forces
from der.records.path import AtPi, Mode, Path, Point
from der.records.text.table import change, column, floor, form, number, table, title
from der.records.units import unit

_FAR = 1e-2  # rad: a snap over more, under a dead moment, says where it began
ONE_ARM = "M: moment of one arm; a torque cell on one grip reads 2 M"


def lines(path: Path) -> list[str]:
    """The ring, its mode, the special points, and the cost."""
    found = [title(path)]
    if path.mode is not None:
        found.append(mode_text(path.mode))
    elif path.status == "done" and not path.reason and path.at_pi is None and len(path):
        found.append(f"ends at gamma = {path.gamma[-1]:.6g}, before pi")
    if path.message:
        found.append(path.message if path.status == "done" else f"{path.status}: {path.message}")
    if path.points:
        heads = (
            ("", -9),
            ("gamma", 12),
            ("gamma/pi", 10),
            column(path, "M", "moment", 12),
            column(path, "U", "energy", 12),
            ("  index", 0),
        )
        found += ["", *table(heads, [_row(point, path) for point in path.points])]
    if path.at_pi is not None:
        found += ["", _at_pi(path.at_pi, path)]
    if path.points or path.at_pi is not None:
        found.append(ONE_ARM)
    if path.forces is not None and len(path):
        found += _forces(path, path.forces)
    if path.error is not None:
        found.append(_errors(path))
    t = path.timing
    found.append(
        f"{len(path)} states, {t.steps} steps, {t.newton_iterations} Newton iterations, "
        f"{1e3 * t.solve_s:.0f} ms"
    )
    return found


def mode_text(mode: Mode) -> str:
    """The folding mode as a phrase."""
    snap = "no snap" if mode.snapping == "none" else mode.snapping
    parts = ["foldable" if mode.foldable else "not foldable", snap]
    if mode.foldable:
        stays = {True: "yes", False: "no", None: "unknown"}[mode.stable_free]
        parts.append(f"stays folded when released: {stays}")
    # by the index, which sees every motion; the slope dM/dgamma sees one
    stable = mode.stable if mode.stable_3d is None else mode.stable_3d
    if stable is not None:
        parts.append(f"{'stable' if stable else 'unstable'} at pi at fixed moment")
    if mode.stable and stable is False:
        parts.append("although dM/dgamma > 0")
    return ", ".join(parts)


def _row(point: Point, path: Path) -> tuple[str, ...]:
    digits, least = form(path, ".7f"), floor(path)
    index = change(point.index_before, point.index_after)
    extra = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in point.details.items())
    if point.kind == "snap":
        energy: Any = point.details["energy_released"]
        released = number(energy, ".7g", least)
        extra = f"releases {released} {unit(path.scale, 'energy')}"
        start = point.details.get("gamma_fold")
        if isinstance(start, float) and abs(start - point.gamma) > _FAR:
            extra += f", from gamma = {start:.7g}"
    return (
        point.kind,
        number(point.gamma, ".8f"),
        number(point.gamma / math.pi, ".6f"),
        number(point.moment, digits, least),
        number(point.energy, digits, least),
        f"  {index:7} {extra}",
    )


def _at_pi(at: AtPi, path: Path) -> str:
    names = {"index": at.index, "moment held": at.index_moment, "grips removed": at.index_free}
    index = ", ".join(f"{n} {'unknown' if i is None else i}" for n, i in names.items())
    least = floor(path)
    moment, energy = number(at.moment, ".7g", least), number(at.energy, ".10g", least)
    in_moment, in_energy = (
        ("", "")
        if path.scale is None
        else (f" {unit(path.scale, name)}" for name in ("moment", "energy"))
    )
    return (
        f"at pi: M = {moment}{in_moment}, dM/dgamma = {at.slope:.7g}{in_moment}, "
        f"U = {energy}{in_energy}; {index}"
    )


def _forces(path: Path, forces: Forces) -> list[str]:
    """The largest force and moment in the arms at the grips."""
    told = []
    for name, values, kind in (
        ("force in an arm", forces.arm_force, "force"),
        ("moment in an arm at its grip", forces.arm_moment, "moment"),
    ):
        sizes = np.linalg.norm(values, axis=2).max(axis=1)
        k = int(np.argmax(sizes))
        size = f"{sizes[k]:.6g} {unit(path.scale, kind)}"
        told.append(f"largest {name}: {size} at gamma = {path.gamma[k]:.6g}")
    return told


def _errors(path: Path) -> str:
    """The largest error bars, and how many states have none."""
    bars: Mapping[str, Any] = path.error or {}
    largest = {n: max((e for e in bars[n] if e is not None), default=0.0) for n in _BARS}
    missing = sum(e is None for e in bars["moment"])
    units = {} if path.scale is None else {n: f" {unit(path.scale, n)}" for n in _BARS[1:]}
    parts = [f"{n} {e:.1e}{units.get(n, '')}" for n, e in largest.items()]
    none = f"; none at {missing} of {len(path)} states" if missing else ""
    return f"error bars, at most: {', '.join(parts)}{none}"


_BARS = ("gamma", "moment", "energy")
