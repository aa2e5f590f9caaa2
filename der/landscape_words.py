"""Landscapes in a few lines of text, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from der.landscape_record import Landscape, Pass, Surface
from der.summary import headline


def words(found: Landscape | Surface | Pass) -> str:
    """Rests and barriers, or what a surface or a pass has to say."""
    if isinstance(found, Landscape):
        return _landscape(found)
    if isinstance(found, Surface):
        return _surface(found)
    return _pass(found)


def _landscape(found: Landscape) -> str:
    lines = [headline(found.path)]
    lines += ["", f"{'rest':8}{'gamma':>12}{'U a/GJ':>14}{'dM/dgamma':>12}  ways down"]
    for rest in found.rests:
        alone = "?" if rest.index_free is None else rest.index_free
        under = "?" if rest.index_moment is None else rest.index_moment
        lines.append(
            f"{rest.kind:8}{rest.gamma:12.8f}{rest.energy:14.8f}{rest.slope:12.6f}"
            f"  {under}, grips removed {alone}"
        )
    barriers = found.barriers
    lines += ["", *_barriers(barriers.fold, barriers.open, found.extrapolated)]
    lines += [f"{name}: {why}" for name, why in barriers.why.items()]
    if found.path.message:
        lines.append(found.path.message)
    return "\n".join(lines)


def _barriers(
    fold: float | None, opened: float | None, sure: Mapping[str, tuple[float, float]]
) -> list[str]:
    """Barriers, extrapolated where that was done."""
    lines = []
    for name, value in (("fold", fold), ("open", opened)):
        text = "none" if value is None else f"{value:.8g} on the mesh"
        if name in sure:
            height, error = sure[name]
            text += f", {height:.8g} +- {error:.1e} without"
        lines.append(f"barrier to {name}: {text}")
    return lines


def _surface(found: Surface) -> str:
    count = found.count
    lines = [
        f"{found.energy.shape[0]} x {found.energy.shape[1]} cells, gamma to {found.gamma[-1]:.4g}, "
        f"distance {found.distance[0]:.4g} to {found.distance[-1]:.4g}: {int((count > 1).sum())} "
        f"with several minima, {int((count == 0).sum())} with none, {found.solve_s:.1f} s"
    ]
    if found.message:
        lines.append(found.message)
    return "\n".join(lines)


def _pass(found: Pass) -> str:
    lines = _barriers(found.fold, found.open, found.extrapolated)
    saddle = found.saddle
    if saddle is not None:
        index = "?" if saddle.index is None else saddle.index
        lines.append(
            f"saddle: U = {saddle.energy:.8g}, index {index}, residual {saddle.residual:.1e}, "
            f"between {' and '.join(saddle.ends)}"
            + (", that of twisting" if saddle.twisted else "")
        )
    lines.append("in clamped grips that turn freely:")
    lines += [f"  {line}" for line in _barriers(found.twisting.fold, found.twisting.open, {})]
    if found.why:
        lines.append(found.why)
    return "\n".join(lines)
