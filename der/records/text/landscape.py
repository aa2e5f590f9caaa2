"""Landscapes, energy surfaces and barriers of the free ring in a few lines of text."""

from __future__ import annotations

from collections.abc import Mapping

from der.records.energy_surface import Surface
from der.records.landscape import Landscape, Pass
from der.records.text.table import count, floor, number, table, title

_HEADS = (
    ("M = 0", -8),
    ("gamma", 12),
    ("U a/GJ", 14),
    ("dM/dgamma", 12),
    ("  index, moment held", 0),
)


def lines(found: Landscape | Surface | Pass) -> list[str]:
    """M = 0 states and barriers, or what a surface has to say."""
    if isinstance(found, Landscape):
        return _landscape(found)
    return _surface(found) if isinstance(found, Surface) else _pass(found)


def _landscape(found: Landscape) -> list[str]:
    least = floor(found.path)
    rows = [
        (
            rest.kind,
            f"{rest.gamma:.8f}",
            number(rest.energy, ".8f", least),
            number(rest.slope, ".6f"),
            f"  {count(rest.index_moment)}, grips removed {count(rest.index_free)}",
        )
        for rest in found.rests
    ]
    barriers = found.barriers
    known = barriers_text(barriers.fold, barriers.open, found.extrapolated)
    told = [title(found.path), *(["", *table(_HEADS, rows)] if rows else []), "", *known]
    for said in dict.fromkeys(barriers.why.values()):
        if said != found.path.message:
            names = [name for name, why in barriers.why.items() if why == said]
            told.append(f"{' and '.join(names)}: {said}")
    return told


def barriers_text(
    fold: float | None,
    opened: float | None,
    extrapolated: Mapping[str, tuple[float, float]],
    how: str = "",
) -> list[str]:
    """Barriers, extrapolated where that was done; ``how`` the ring is held."""
    told = []
    for name, value in (("fold", fold), ("open", opened)):
        text = "none" if value is None else f"{value:.8g} GJ/a on the mesh"
        if name in extrapolated:
            height, error = extrapolated[name]
            text += f", {height:.8g} +- {error:.1e} GJ/a extrapolated"
        told.append(f"barrier to {name}{how}: {text}")
    return told


def _surface(found: Surface) -> list[str]:
    n, m = found.energy.shape
    several, none = int((found.count > 1).sum()), int((found.count == 0).sum())
    return [
        f"{n} x {m} cells, gamma to {found.gamma[-1]:.4g}, "
        f"distance {found.distance[0]:.4g} to {found.distance[-1]:.4g}: {several} "
        f"with several minima, {none} with none, {found.solve_s:.1f} s"
    ]


def _pass(found: Pass) -> list[str]:
    told = barriers_text(found.fold, found.open, found.extrapolated, " of the free ring")
    saddle = found.saddle
    if saddle is not None:
        told.append(
            f"saddle: U = {saddle.energy:.8g} GJ/a, index {count(saddle.index)}, "
            f"residual {saddle.residual:.1e}, between {' and '.join(saddle.ends)}"
            + (", that of twisting" if saddle.twisted else "")
        )
    twisting = barriers_text(found.twisting.fold, found.twisting.open, {})
    return [*told, "in clamped grips that turn freely:", *(f"  {line}" for line in twisting)]
