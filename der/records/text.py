"""A path in a few lines of text, for the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from der.records.path import AtPi, Mode, Path, Point

_KNOWN = 1e-10  # GJ/a: of numbers whose record says no tolerance
_FAR = 1e-2  # rad: a snap over more, under a dead moment, says where it began


def summary(path: Path) -> str:
    """What a user wants to know first: the ring, its mode, the special points, the cost."""
    lines = [headline(path)]
    if path.mode is not None:
        lines.append(mode_in_words(path.mode))
    elif path.status == "done" and path.at_pi is None and len(path):
        lines.append(f"ends at gamma = {path.gamma[-1]:.6g}, before pi")
    if path.message:
        lines.append(path.message if path.status == "done" else f"{path.status}: {path.message}")
    if path.points:
        lines += ["", f"{'':9}{'gamma':>12}{'gamma/pi':>10}{'M a/GJ':>12}{'U a/GJ':>12}  index"]
        lines += [_row(point) for point in path.points]
    if path.at_pi is not None:
        lines += ["", _at_pi(path.at_pi, known_to(path.numerics))]
    if path.error is not None:
        lines.append(_errors(path))
    t = path.timing
    lines.append(
        f"{len(path)} states, {t.steps} steps, {t.newton_iterations} Newton iterations, "
        f"{1e3 * t.solve_s:.0f} ms"
    )
    return "\n".join(lines)


def _errors(path: Path) -> str:
    """The largest error bars, and how many states have none."""
    error: Mapping[str, Any] = path.error or {}
    words = []
    for name in ("gamma", "moment", "energy"):
        known = [e for e in error[name] if e is not None]
        words.append(f"{name} {max(known, default=0.0):.1e}")
    missing = sum(e is None for e in error["moment"])
    none = f"; none at {missing} of {len(path)} states" if missing else ""
    return f"error bars, at most: {', '.join(words)}{none}"


def number(value: float, form: str, floor: float = 0.0) -> str:
    """A number as text: 0 without a sign where it is below ``floor`` or its last digit."""
    text = f"{value:{form}}"
    return f"{0.0:{form}}" if abs(value) <= floor or float(text) == 0.0 else text


def known_to(numerics: Mapping[str, Any]) -> float:
    """What moments and energies are known to, GJ/a, by the tolerance on record."""
    return float(numerics.get("tolerance", _KNOWN))


def headline(path: Path) -> str:
    """Ring, section and mesh in one line."""
    return titled(path.ring, path.section, path.numerics)


def titled(ring: Mapping[str, Any], section: Mapping[str, Any], numerics: Mapping[str, Any]) -> str:
    """Ring, section and mesh of a record in one line."""
    parameters = ", ".join(
        f"{name.replace('_over_', '/').replace('_', ' ')} {value:g}"
        for name, value in ring.items()
        if isinstance(value, int | float)
    )
    words = f"{ring['shape']} ({parameters})" if parameters else f"{ring['shape']}"
    if ring.get("twist_axis") == "y":
        words += " about y"
    bar = f"alpha {section['alpha']:.6g}, beta {section['beta']:.6g}"
    if section.get("h_over_t") is not None:
        nu = section.get("nu")
        given = "" if nu is None else f", nu {nu:g}"
        bar = f"h/t {section['h_over_t']:g}{given} ({bar})"
    edges = numerics.get("n_edges")  # a boundary-value solution has none
    return f"{words}, {bar}" + ("" if edges is None else f", {edges} edges")


def mode_in_words(mode: Mode) -> str:
    """The folding mode as a phrase."""
    words = ["foldable" if mode.foldable else "not foldable"]
    if mode.stable is not None:
        words.append("stable when folded" if mode.stable else "unstable when folded")
    words.append("no snap" if mode.snapping == "none" else mode.snapping)
    if mode.stable_3d is not None:
        stable = "stable" if mode.stable_3d else "unstable"
        words.append(f"{stable} in 3D at pi (moment held)")
    return ", ".join(words)


def _row(point: Point) -> str:
    before, after = ("?" if i is None else i for i in (point.index_before, point.index_after))
    index = f"{before}" if before == after else f"{before} -> {after}"
    extra = ", ".join(f"{k.replace('_', ' ')} {v}" for k, v in point.details.items())
    if point.kind == "snap":
        extra = f"releases {point.details['energy_released']:.7g}"
        start = point.details.get("gamma_fold")
        if isinstance(start, float) and abs(start - point.gamma) > _FAR:
            extra += f", from gamma = {start:.7g}"
    shown = ((point.gamma, "12.8f"), (point.gamma / math.pi, "10.6f"), (point.moment, "12.7f"))
    numbers = "".join(number(*one) for one in (*shown, (point.energy, "12.7f")))
    return f"{point.kind:9}{numbers}  {index:7} {extra}".rstrip()


def _at_pi(at: AtPi, floor: float) -> str:
    index = ", ".join(
        f"{name} {'unknown' if value is None else value}"
        for name, value in (
            ("index", at.index),
            ("moment held", at.index_moment),
            ("grips removed", at.index_free),
        )
    )
    moment, energy = number(at.moment, ".7g", floor), number(at.energy, ".10g", floor)
    return f"at pi: M = {moment}, dM/dgamma = {at.slope:.7g}, U = {energy}; {index}"
