"""What the playback says in words."""

from __future__ import annotations

import math

from der.film import Playback
from der.record import Path, Point

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
