"""What the playback says in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from der.film import Playback
from der.record import Path, Point

GAMMA = "\N{GREEK SMALL LETTER GAMMA}"
WORDS = {
    "fold": "fold",
    "limit": "limit of M",
    "branch": "branch point",
    "snap": "snap",
    "contact": "self-crossing",
}


def in_words(point: Point) -> str:
    """A special point as a line of the log."""
    line = f"{WORDS[point.kind]}, gamma {point.gamma:.8g} ({point.gamma / math.pi:.4g} π)"
    if point.index_before is not None or point.index_after is not None:
        before, after = ("?" if i is None else i for i in (point.index_before, point.index_after))
        line += f", index {before}" if before == after else f", index {before} -> {after}"
    line += f", M {point.moment:.6g}, U {point.energy:.6g}"
    for name, value in point.details.items():
        shown = f"{value:.6g}" if isinstance(value, float) else value
        line += f", {name.replace('_', ' ')} {shown}"
    return line


def title(path: Path, film: Playback) -> str:
    """The ring in a few words."""
    return f"{path.ring['shape']}, h/t = {film.section.h / film.section.t:.4g}"


def names(paths: Sequence[Path]) -> list[str]:
    """A few words for each of several paths, that tell them apart: what differs between them."""
    said = [
        {"shape": path.ring["shape"], **path.ring, **path.section, **path.numerics}
        | {"solver": {"der": "rod", "bvp": "boundary-value problem"}[path.solver]}
        for path in paths
    ]
    words = [
        f"{s['shape']}, h/t = {s['h_over_t']:.4g}" if s.get("h_over_t") else str(s["shape"])
        for s in said
    ]
    if len(paths) == 1:
        return words
    for name in sorted({name for one in said for name in one} - {"shape", "h_over_t", "version"}):
        values = [one.get(name) for one in said]
        if len(set(words)) == len(words):
            break
        if all(isinstance(v, str | int | float) for v in values) and len(set(values)) > 1:
            label = "" if name == "solver" else f"{name.replace('_over_', '/').replace('_', ' ')} "
            words = [
                f"{w}, {label}{v:.4g}" if isinstance(v, float) else f"{w}, {label}{v}"
                for w, v in zip(words, values, strict=True)
            ]
    if len(set(words)) < len(words):
        words = [f"{word} ({k})" for k, word in enumerate(words, 1)]
    return words


@dataclass(frozen=True)
class Caption:
    """What is said of one step of a film."""

    numbers: str  # gamma, M and U
    stability: str  # how many ways down, or that the ring falls; "" where nothing is known
    stable: bool | None  # None: not known
    event: str  # the special point that was passed last; "" before the first


def captions(path: Path, film: Playback) -> list[Caption]:
    """What is said of every step, also of one between two states."""
    index = path.index.tolist()
    steps = [(film.step_of(point.position), point) for point in path.points]
    said = []
    for step, k in enumerate(film.position.tolist()):
        gamma, energy, moment = film.gamma[step], film.energy[step], film.moment[step]
        moment_too = "" if math.isnan(moment) else f"M = {_shown(moment)}   "
        numbers = f"{GAMMA} = {_shown(gamma / math.pi)} π   {moment_too}U = {_shown(energy)}"
        ways = None
        if k >= 0:  # a singular state leaves it to the one after it
            ways = index[k] if index[k] is not None else index[min(k + 1, len(index) - 1)]
        if k < 0:
            words = "the ring snaps (slow motion)"
        else:
            words = "" if ways is None else "stable" if ways == 0 else f"unstable, index {ways}"
        passed = [point for at, point in steps if at <= step]
        event = ""
        if passed:
            last = passed[-1]
            event = f"{WORDS[last.kind]} at {GAMMA} = {last.gamma / math.pi:.4f} π"
        said.append(Caption(numbers, words, None if ways is None else ways == 0, event))
    return said


def _shown(value: float) -> str:
    """Three digits, and no -0.000."""
    return f"{value + 0.0:z.3f}"


def about(path: Path, film: Playback) -> str:
    """What is to be seen, and the parameters, in Markdown."""
    drawn = film.section
    h, t = drawn.h / drawn.factor, drawn.t / drawn.factor
    scale = "to scale" if drawn.factor == 1.0 else f"**{drawn.factor:g} times as large as it is**"
    falling = len(film.x) - len(path)
    words = [
        f"# {title(path, film)}",
        f"The section is drawn {scale}: h = {h:.4g} a, t = {t:.4g} a.",
        "Colour: energy of bending (left) and of twisting (right) per length, from 0 to "
        f"{film.top:.4g} GJ/a².",
        "Black arrows: how far the grips have turned. Vermilion arrows: the moment on each, along "
        "the twisting axis. Green: the way of the free points.",
    ]
    if film.u is not None:
        words.append("Thin vermilion line: the softest mode, its size exaggerated.")
    words.append(f"{len(path)} equilibria.")
    if falling:
        words[-1] += f" {falling} steps between them are snaps in slow motion, no equilibria."
    words.append(f"Status: {path.status}. {path.message}".rstrip())
    rows = ["| parameter | value |", "|---|---|"]
    for part in (path.ring, path.section, path.numerics):
        rows += [f"| {name.replace('_', ' ')} | {value} |" for name, value in part.items()]
    return "\n\n".join([*words, "\n".join(rows)]) + "\n"
