"""What it takes to push a ring open in a few lines of text."""

from __future__ import annotations

from der.records.opening import EVENTS, Instant, LeastPush, Push
from der.records.text.table import count, floor, number
from der.records.units import unit


def lines(found: LeastPush) -> list[str]:
    """The pushes of least work, by kind, and the barriers beside them."""
    energy = unit(found.scale, "energy")
    told = [f"{len(found.pushes)} pushes at pairs of {found.numerics['points']} points and between"]
    for name, places in (("quasi-static", found.least), ("dead", found.least_dead)):
        dead = name == "dead"
        for kind, k in places.items():
            one = found.pushes[k]
            instant = one.dead if dead else one.held
            if instant is not None:
                told.append(_push(f"{name} {kind}", one, instant, found))
                key = f"{kind} dead" if dead else kind
                if key in found.extrapolated:
                    work, error = found.extrapolated[key]
                    told.append(f"    work extrapolated {work:.8g} +- {error:.1e} {energy}")
    for name, value in (("of the free ring", found.barrier), ("by twisting", found.twisting)):
        text = "none" if value is None else f"{value:.8g} {energy} on the mesh"
        told.append(f"barrier to open {name}: {text}")
    return told


def _push(name: str, one: Push, at: Instant, found: LeastPush) -> str:
    is_force = one.kind == "force"
    quantities = ("energy", "force" if is_force else "moment", "length")
    work, load, length = (
        "" if found.scale is None else f" {unit(found.scale, name)}" for name in quantities
    )
    places = ", ".join(f"{s:.5g}" for s in one.points)
    return (
        f"{name + ':':20}work {at.work:.8g}{work}, "
        f"load {number(at.load, '.5g', floor(found))}{load} (largest {one.peak:.5g}{load}), "
        f"push {at.push:.5g}{length if is_force else ''}; s/L = {places}, {one.direction}; "
        f"{EVENTS[at.event]}, index {count(at.index_before)}/{count(at.index_after)}, "
        f"end state when released: {at.lands}"
    )
