"""Landscapes in a few lines of text, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from der.records.energy_surface import Surface
from der.records.landscape import Landscape, Pass
from der.records.opening import Instant, LeastPush, Push
from der.records.text import headline, known_to, number

Answer = Landscape | Surface | Pass | LeastPush


def words(found: Answer, *, why: bool = True) -> str:
    """Rests and barriers, or what a surface, a pass or a push has to say.

    ``why``: whether it is said in the end, too, why something is missing.
    """
    if isinstance(found, Landscape):
        lines = _landscape(found)
    elif isinstance(found, Surface):
        lines = _surface(found)
    elif isinstance(found, LeastPush):
        lines = _pushes(found)
    else:
        lines = _pass(found)
    last = [] if found.status == "done" else [found.status]
    if why and reason(found):
        last.append(reason(found))
    return "\n".join([*lines, *([": ".join(last)] if last else [])])


def reason(found: Answer) -> str:
    """Why something is missing, in a sentence; empty where nothing is."""
    if isinstance(found, Landscape):
        return found.path.message
    return found.message if isinstance(found, Surface) else found.why


def _landscape(found: Landscape) -> list[str]:
    floor = known_to(found.path.numerics)
    lines = [headline(found.path)]
    if found.rests:
        lines += ["", f"{'rest':8}{'gamma':>12}{'U a/GJ':>14}{'dM/dgamma':>12}  ways down"]
    for rest in found.rests:
        alone = "?" if rest.index_free is None else rest.index_free
        under = "?" if rest.index_moment is None else rest.index_moment
        lines.append(
            f"{rest.kind:8}{rest.gamma:12.8f}{number(rest.energy, '14.8f', floor)}"
            f"{number(rest.slope, '12.6f')}"
            f"  {under}, grips removed {alone}"
        )
    barriers = found.barriers
    lines += ["", *_barriers(barriers.fold, barriers.open, found.extrapolated)]
    for said in dict.fromkeys(barriers.why.values()):
        if said != found.path.message:
            names = [name for name, why in barriers.why.items() if why == said]
            lines.append(f"{' and '.join(names)}: {said}")
    return lines


def _barriers(
    fold: float | None,
    opened: float | None,
    sure: Mapping[str, tuple[float, float]],
    how: str = "",
) -> list[str]:
    """Barriers, extrapolated where that was done; ``how`` the ring is held."""
    lines = []
    for name, value in (("fold", fold), ("open", opened)):
        text = "none" if value is None else f"{value:.8g} GJ/a on the mesh"
        if name in sure:
            height, error = sure[name]
            text += f", {height:.8g} +- {error:.1e} GJ/a without a mesh"
        lines.append(f"barrier to {name}{how}: {text}")
    return lines


def _surface(found: Surface) -> list[str]:
    count = found.count
    return [
        f"{found.energy.shape[0]} x {found.energy.shape[1]} cells, gamma to {found.gamma[-1]:.4g}, "
        f"distance {found.distance[0]:.4g} to {found.distance[-1]:.4g}: {int((count > 1).sum())} "
        f"with several minima, {int((count == 0).sum())} with none, {found.solve_s:.1f} s"
    ]


def _pass(found: Pass) -> list[str]:
    lines = _barriers(found.fold, found.open, found.extrapolated, " without grips")
    saddle = found.saddle
    if saddle is not None:
        index = "?" if saddle.index is None else saddle.index
        lines.append(
            f"saddle: U = {saddle.energy:.8g} GJ/a, index {index}, residual {saddle.residual:.1e}, "
            f"between {' and '.join(saddle.ends)}"
            + (", that of twisting" if saddle.twisted else "")
        )
    lines.append("in clamped grips that turn freely:")
    lines += [f"  {line}" for line in _barriers(found.twisting.fold, found.twisting.open, {})]
    return lines


_EVENTS = {
    "pass": "carried to a pass",
    "fold": "snaps at a fold",
    "branch": "snaps at a branch point",
    "limit": "limit of the load",
    "end": "end",
}


def _pushes(found: LeastPush) -> list[str]:
    floor = known_to(found.numerics)
    lines = [
        f"{len(found.pushes)} pushes at pairs of {found.numerics['points']} points and between"
    ]
    for name, places, dead in (("slow", found.least, False), ("dead", found.least_dead, True)):
        for kind, k in places.items():
            one = found.pushes[k]
            instant = one.dead if dead else one.held
            if instant is not None:
                lines.append(_push(f"{name} {kind}", one, instant, floor))
                key = f"{kind} dead" if dead else kind
                if key in found.extrapolated:
                    height, error = found.extrapolated[key]
                    lines.append(f"    work without a mesh {height:.8g} +- {error:.1e} GJ/a")
    for name, value in (("left alone", found.barrier), ("by twisting", found.twisting)):
        text = "none" if value is None else f"{value:.8g} GJ/a on the mesh"
        lines.append(f"barrier to open {name}: {text}")
    return lines


def _push(name: str, one: Push, at: Instant, floor: float) -> str:
    ways = "/".join("?" if i is None else str(i) for i in (at.index_before, at.index_after))
    places = ", ".join(f"{s:.5g}" for s in one.points)
    return (
        f"{name + ':':13}work {at.work:.8g}, load {number(at.load, '.5g', floor)} "
        f"(largest {one.peak:.5g}), push {at.push:.5g}; s/L = {places}, {one.direction}; "
        f"{_EVENTS[at.event]}, ways down {ways}, let go: {at.lands}"
    )
