"""Landscapes, energy surfaces and barriers of the free ring in a few lines of text."""

from __future__ import annotations

from der.records.energy_surface import Surface
from der.records.landscape import Barriers, Heights, Landscape, Pass
from der.records.text.table import column, count, floor, form, number, table, title
from der.records.units import unit


def lines(found: Landscape | Surface | Pass) -> list[str]:
    """M = 0 states and barriers, or what a surface has to say."""
    if isinstance(found, Landscape):
        return _landscape(found)
    return _surface(found) if isinstance(found, Surface) else _pass(found)


def _landscape(found: Landscape) -> list[str]:
    least = floor(found.path)
    slope = "dM/dgamma" if found.scale is None else f"dM/dgamma [{unit(found.scale, 'moment')}]"
    heads = (
        ("M = 0", -8),
        ("gamma", 12),
        column(found, "U", "energy", 14),
        (slope, 12 if found.scale is None else 20),
        ("  index, moment held", 0),
    )
    rows = [
        (
            rest.kind,
            f"{rest.gamma:.8f}",
            number(rest.energy, form(found, ".8f"), least),
            number(rest.slope, form(found, ".6f")),
            f"  {count(rest.index_moment)}, grips removed {count(rest.index_free)}",
        )
        for rest in found.rests
    ]
    barriers = found.barriers
    known = barriers_text(found, barriers)
    if found.folded:
        known.append(_released(found.rests[-1].index_free))
    told = [title(found.path), *(["", *table(heads, rows)] if rows else []), "", *known]
    for said in dict.fromkeys(barriers.why.values()):
        if said != found.path.message:
            names = [name for name, why in barriers.why.items() if why == said]
            told.append(f"{' and '.join(names)}: {said}")
    return told


def _released(index: int | None) -> str:
    """What the barrier to open is worth when the grips are taken away."""
    if index is None:
        return "stays folded when released: unknown"
    if index:
        return (
            f"stays folded when released: no, index {index}: this barrier holds in the grips only"
        )
    return "stays folded when released: yes; its barrier (--free) is then at most this one"


def barriers_text(
    found: Landscape | Pass, barriers: Barriers | Heights, how: str = "", *, mesh: bool = False
) -> list[str]:
    """Barriers, extrapolated where that was done; ``how`` the ring is held.

    ``mesh``: of the mesh alone.
    """
    told, energy = [], unit(found.scale, "energy")
    for name in ("fold", "open"):
        value = getattr(barriers, name)
        text = "none" if value is None else f"{value:.8g} {energy} on the mesh"
        if name in found.extrapolated and not mesh:
            height, error = found.extrapolated[name]
            text += f", {height:.8g} +- {error:.1e} {energy} extrapolated"
        told.append(f"barrier to {name}{how}: {text}")
    return told


def _surface(found: Surface) -> list[str]:
    n, m = found.energy.shape
    length = "" if found.scale is None else f" {unit(found.scale, 'length')}"
    several, none = int((found.count > 1).sum()), int((found.count == 0).sum())
    return [
        f"{n} x {m} cells, gamma to {found.gamma[-1]:.4g}, "
        f"distance {found.distance[0]:.4g} to {found.distance[-1]:.4g}{length}: {several} "
        f"with several minima, {none} with none, {found.solve_s:.1f} s"
    ]


def _pass(found: Pass) -> list[str]:
    told = barriers_text(found, found.barriers, " of the free ring")
    saddle = found.saddle
    if saddle is not None:
        energy = f"{saddle.energy:.8g} {unit(found.scale, 'energy')}"
        told.append(
            f"saddle: U = {energy}, index {count(saddle.index)}, "
            f"residual {saddle.residual:.1e}, between {' and '.join(saddle.ends)}"
            + (", that of twisting" if saddle.twisted else "")
        )
    twisting = barriers_text(found, found.twisting, mesh=True)
    return [*told, "in clamped grips that turn freely:", *(f"  {line}" for line in twisting)]
