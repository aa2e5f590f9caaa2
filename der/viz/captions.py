"""What the playback says in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from der.records.path import Path, Point
from der.viz.animation import Playback

GAMMA = "\N{GREEK SMALL LETTER GAMMA}"
WORDS = {
    "fold": "fold",
    "limit": "limit of M",
    "branch": "branch point",
    "snap": "snap",
    "contact": "self-crossing",
}
SOLVERS = {"der": "rod", "bvp": "boundary-value problem"}
STAYS = 0.12  # of a film: how long it is said that a special point was passed


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
    """A few words for each of several paths, that tell them apart.

    All that differs in what is solved and how; of the other numerics as much as that takes.
    """
    said = [
        {**path.ring, **path.section, **path.numerics}
        | {"shape": str(path.ring["shape"]), "solver": _solver(path, paths)}
        for path in paths
    ]
    words = [
        f"{s['shape']}, h/t = {s['h_over_t']:.4g}" if s.get("h_over_t") else f"{s['shape']}"
        for s in said
    ]
    if len(paths) == 1:
        return words
    done = {"shape", "h_over_t", "version"}
    if all(one.get("h_over_t") for one in said):
        done |= {"alpha", "beta"}  # these follow
    first = sorted({name for path in paths for name in path.ring} - {"twist_axis"})
    first += ["twist_axis", "alpha", "beta", "nu", "solver", "control"]
    for name in [name for name in first if name not in done]:
        words = _told(words, said, name)
    for name in sorted({name for one in said for name in one} - done - set(first)):
        if len(set(words)) < len(words):
            words = _told(words, said, name)
    if len(set(words)) < len(words):
        words = [f"{word} ({k})" for k, word in enumerate(words, 1)]
    return words


def _solver(path: Path, paths: Sequence[Path]) -> str:
    """What solved a path; of rods alone, how."""
    method = path.numerics.get("solver")
    if method is not None and all(one.solver == "der" for one in paths):
        return f"{SOLVERS['der']} by {method}"
    return SOLVERS[path.solver]


def _told(words: Sequence[str], said: Sequence[Mapping[str, object]], name: str) -> list[str]:
    """Words with a parameter put after them, where paths differ in it."""
    values = [one.get(name) for one in said]
    if name == "natural_curvature" and None in values:  # other shapes have none: 1 goes unsaid
        values = [None if value == 1.0 else value for value in values]
    if all(value == values[0] for value in values):
        return list(words)
    return [
        f"{word}, {_parameter(name, value)}" if isinstance(value, str | int | float) else word
        for word, value in zip(words, values, strict=True)
    ]


def _parameter(name: str, value: str | float) -> str:
    """One parameter as it stands in a title."""
    if name == "twist_axis":
        return f"about {value}"
    if name == "solver":
        return str(value)
    label = name.replace("_over_", "/").replace("_", " ")
    if isinstance(value, bool):
        return label if value else f"no {label}"
    return f"{label} {value:.4g}" if isinstance(value, float) else f"{label} {value}"


@dataclass(frozen=True)
class Caption:
    """What is said of one step of a film."""

    numbers: str  # gamma, M and U
    stability: str  # how many ways down, or that the ring falls; "" where nothing is known
    stable: bool | None  # None: not known
    event: str  # the special point that was just passed; "" a little after it
    way: str = ""  # "loading" or "unloading", where the ring is also unloaded

    @property
    def line(self) -> str:
        """Way and stability in one."""
        return ", ".join(part for part in (self.way, self.stability) if part)


def captions(path: Path, film: Playback) -> list[Caption]:
    """What is said of every step, also of one between two states."""
    index = path.index.tolist()
    stays = max(1, round(STAYS * len(film.x)))
    turn = _turned_back(path)
    steps = [(film.step_of(point.position), point) for point in path.points]
    said = []
    reached = -1
    for step, k in enumerate(film.position.tolist()):
        reached = max(reached, k)
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
        passed = [point for at, point in steps if at <= step < at + stays]
        event = ""
        if passed:
            last = passed[-1]
            event = f"{WORDS[last.kind]} at {GAMMA} = {last.gamma / math.pi:.4f} π"
        way = ""
        if turn is not None:
            way = "loading" if reached < turn else "unloading"
        said.append(Caption(numbers, words, None if ways is None else ways == 0, event, way))
    return said


def _turned_back(path: Path) -> int | None:
    """Position of the state at which unloading begins; None for a path that is not unloaded."""
    if not path.numerics.get("unload"):
        return None
    driven = path.moment if path.numerics.get("control") == "moment" else path.gamma
    turn = int(driven.argmax())
    return turn if turn < len(path) - 1 else len(path)  # interrupted before


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
