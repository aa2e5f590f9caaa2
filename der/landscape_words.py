"""Landscapes in a few lines of text, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from der.landscape_push_record import Instant, LeastPush, Push
from der.landscape_record import Landscape, Pass
from der.landscape_surface_record import Surface
from der.summary import headline


def words(found: Landscape | Surface | Pass | LeastPush) -> str:
    """Rests and barriers, or what a surface, a pass or a push has to say."""
    if isinstance(found, Landscape):
        return _landscape(found)
    if isinstance(found, Surface):
        return _surface(found)
    if isinstance(found, LeastPush):
        return _pushes(found)
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


_EVENTS = {
    "pass": "carried to a pass",
    "fold": "snaps at a fold",
    "branch": "snaps at a branch point",
    "limit": "limit of the load",
    "end": "end",
}


def _pushes(found: LeastPush) -> str:
    lines = [
        f"{len(found.pushes)} pushes at pairs of {found.numerics['points']} points and between"
    ]
    for name, places, dead in (("slow", found.least, False), ("dead", found.least_dead, True)):
        for kind, k in places.items():
            one = found.pushes[k]
            instant = one.dead if dead else one.held
            if instant is not None:
                lines.append(_push(f"{name} {kind}", one, instant))
                key = f"{kind} dead" if dead else kind
                if key in found.extrapolated:
                    height, error = found.extrapolated[key]
                    lines.append(f"    work without mesh {height:.8g} +- {error:.1e}")
    for name, value in (("left alone", found.barrier), ("by twisting", found.twisting)):
        text = "none" if value is None else f"{value:.8g} on the mesh"
        lines.append(f"barrier to open {name}: {text}")
    if found.why:
        lines.append(found.why)
    return "\n".join(lines)


def _push(name: str, one: Push, at: Instant) -> str:
    ways = "/".join("?" if i is None else str(i) for i in (at.index_before, at.index_after))
    places = ", ".join(f"{s:.5g}" for s in one.points)
    return (
        f"{name + ':':13}work {at.work:.8g}, load {at.load:.5g} (largest {one.peak:.5g}), "
        f"push {at.push:.5g}; s/L = {places}, {one.direction}; {_EVENTS[at.event]}, "
        f"ways down {ways}, let go: {at.lands}"
    )
