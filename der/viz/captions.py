"""Texts of an animation: captions of its steps, events, and what is shown."""

from __future__ import annotations

import math
from dataclasses import dataclass

from der.geometry.scale import Scale
from der.records.path import Path, Point
from der.records.units import unit
from der.viz.animation import Motion
from der.viz.palette import POINTS
from der.viz.titles import names, plain

STAYS = 0.12  # share of the steps during which a caption names a special point
SHOWN = """\
Colour: energy of bending (left) and of twisting (right) per length, from 0 to {top:.4g} {unit}.

Black arrows: rotations of the grips. Vermilion arrows: the moment on each grip, along the \
twisting axis. Green: the path of the free points."""


def density_unit(scale: Scale | None) -> str:
    """The unit of energy per length."""
    return "GJ/a²" if scale is None else unit(scale, "force")


def event_text(point: Point, scale: Scale | None) -> str:
    """A special point as a line of the log."""
    line = f"{POINTS[point.kind]}, gamma {point.gamma:.8g} ({point.gamma / math.pi:.4g} π)"
    if point.index_before is not None or point.index_after is not None:
        before, after = ("?" if i is None else i for i in (point.index_before, point.index_after))
        line += f", index {before}" if before == after else f", index {before} -> {after}"
    line += f", M {point.moment:.6g} {unit(scale, 'moment')}"
    line += f", U {point.energy:.6g} {unit(scale, 'energy')}"
    for name, value in point.details.items():
        line += f", {plain(name)} {f'{value:.6g}' if isinstance(value, float) else value}"
    return line


@dataclass(frozen=True)
class Caption:
    """The texts of one step of a motion."""

    numbers: str  # gamma, M and U
    stability: str  # stable, unstable with its index, or snapping; "" where it is not known
    stable: bool | None  # None: not known
    event: str  # the last special point, for STAYS of the steps; else ""
    way: str = ""  # "loading" or "unloading", where the ring is also unloaded

    @property
    def line(self) -> str:
        """Way and stability in one."""
        return ", ".join(part for part in (self.way, self.stability) if part)


def captions(path: Path, motion: Motion) -> list[Caption]:
    """The caption of every step, also of steps between two states."""
    index = path.index.tolist()
    stays = max(1, round(STAYS * len(motion.x)))
    turn = _turned_back(path)
    passed = [(motion.step_of(point.position), point) for point in path.points]
    found, reached = [], -1
    for step, k in enumerate(motion.position.tolist()):
        reached = max(reached, k)
        known = None
        if k >= 0:  # a singular state has no index: that of the next one is taken
            known = index[k] if index[k] is not None else index[min(k + 1, len(index) - 1)]
        last = [point for at, point in passed if at <= step < at + stays][-1:]
        found.append(
            Caption(
                _numbers(motion, step),
                "snap (slow motion)" if k < 0 else _stability(known),
                None if known is None else known == 0,
                "".join(f"{POINTS[p.kind]} at γ = {p.gamma / math.pi:.4f} π" for p in last),
                "" if turn is None else "loading" if reached < turn else "unloading",
            )
        )
    return found


def _numbers(motion: Motion, step: int) -> str:
    """Gamma, M and U of a step."""
    moment, scale = motion.moment[step], motion.scale
    shown = _digits if scale is None else "{:.4g}".format
    parts = [
        f"γ = {_digits(motion.gamma[step] / math.pi)} π",
        "" if math.isnan(moment) else f"M = {shown(moment)} {unit(scale, 'moment')}",
        f"U = {shown(motion.energy[step])} {unit(scale, 'energy')}",
    ]
    return "   ".join(filter(None, parts))


def _stability(index: int | None) -> str:
    """Stability at fixed gamma as text."""
    if index is None:
        return ""
    return "stable at fixed γ" if index == 0 else f"unstable at fixed γ, index {index}"


def _turned_back(path: Path) -> int | None:
    """Position of the state at which unloading begins; None for a path that is not unloaded."""
    if not path.numerics.get("unload"):
        return None
    driven = path.moment if path.numerics.get("control") == "moment" else path.gamma
    turn = int(driven.argmax())
    return turn if turn < len(path) - 1 else len(path)  # interrupted before


def _digits(value: float) -> str:
    """Three decimals, without -0.000."""
    return f"{value + 0.0:z.3f}"


def about(path: Path, motion: Motion) -> str:
    """What is shown, and the parameters, in Markdown."""
    drawn = motion.section
    h, t = drawn.h / drawn.factor, drawn.t / drawn.factor
    scale = "to scale" if drawn.factor == 1.0 else f"**{drawn.factor:g} times as large as it is**"
    states = f"{len(path)} equilibria."
    if len(motion.x) > len(path):
        transient = len(motion.x) - len(path)
        states += f" {transient} steps between them are snaps in slow motion, not equilibria."
    parts = [
        f"# {names([path])[0]}",
        f"The section is drawn {scale}: h = {h:.4g} a, t = {t:.4g} a.",
        SHOWN.format(top=motion.top, unit=density_unit(motion.scale)),
    ]
    if motion.u is not None:
        parts.append("Thin vermilion line: the softest mode, its size exaggerated.")
    rows = ["| parameter | value |", "|---|---|"]
    for entries in (path.ring, path.section, path.numerics):
        rows += [f"| {plain(name)} | {value} |" for name, value in entries.items()]
    status = f"Status: {path.status}. {path.message}".rstrip()
    return "\n\n".join([*parts, states, status, "\n".join(rows)]) + "\n"
