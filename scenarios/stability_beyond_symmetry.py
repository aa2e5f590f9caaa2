"""Compare stability on a symmetric path with stability in three dimensions, for folded rings.

The paper computes a quarter or a half of the ring, which keeps its symmetry, and calls a folded
ring stable where dM/dgamma > 0. Here every curve of the paper, and the planes of profile and
section around them, are computed with the index of the full ring. Each ring is also loaded by the
angle, so that it snaps. Four kinds of disagreement are counted:

    a  a state that loading by the angle reaches is unstable in the grips
    b  the folded state is unstable at fixed moment, although its slope is positive
    c  the folded state is unstable when released, although its slope is positive
    d  at pi the ring has no moment but is not folded: it is flat and inside out

    python -m scenarios.stability_beyond_symmetry [--out DIR] [--edges N] [--quick]

writes survey.csv and survey.png to DIR (default: out/stability_beyond_symmetry).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import astuple, dataclass, fields
from pathlib import Path as File

import numpy as np

import der
from der.records.path import NO_MOMENT
from scenarios.folded_stability import LARGEST_CIRCLE
from scenarios.output import Arguments, write_table

EDGES = 64
INSCRIBED_60 = math.sqrt(3) / 6  # r/a at which a triangle of 60 degrees is a circle
# h/t of the planes
HEIGHTS = (1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0)
COLOURS = {
    "not folded": "#dddddd",
    "slope < 0": "#E69F00",
    "slope > 0, unstable released": "#D55E00",
    "stable": "#0072B2",
    "stuck": "#000000",
}
MARKS = {
    "a": ("o", "a: reached, unstable in the grips"),
    "b": ("D", "b: unstable at fixed moment"),
    "d": ("^", "d: inside out"),
}


@dataclass(frozen=True)
class Case:
    """A ring to be folded, and its place in the survey."""

    family: str
    parameter: float
    ring: der.Ring
    h_over_t: float


@dataclass(frozen=True)
class Verdict:
    """The results of one ring; None where they are not known."""

    family: str
    parameter: float
    h_over_t: float
    status: str
    foldable: bool | None
    slope_positive: bool | None  # of the folded state: the paper's stability
    snapping: str | None
    folds: int
    index_before_pi: int  # largest on the path
    index_reached: int  # largest among the states that turning the grips up reaches
    branches: str  # symmetry class at gamma, before and after
    index: int | None  # at pi, grips held
    index_moment: int | None
    index_free: int | None
    slope: float | None  # GJ/a
    folded_by_angle: bool | None  # turning the grips up ends in the three-covered state
    by_angle: str  # how that ended
    energy: float | None  # at pi, by the angle where it arrives there [GJ/a]
    wrong: str  # of a, b, c, d

    @property
    def colour(self) -> str:
        """The name of its colour in the picture."""
        if self.status != "done":
            return "stuck"
        if not self.foldable:
            return "not folded"
        if not self.slope_positive:
            return "slope < 0"
        return "stable" if self.index_free == 0 else "slope > 0, unstable released"


def curves() -> Iterator[Case]:
    """The rings whose curves the paper shows."""
    for h in (1.0, 1.6, 2.0, 4.0, 8.0):
        yield Case("circle", 1.0, der.circle(), h)
    for axis in "xy":
        for h in (1.0, 2.0, 3.0, 4.0):
            yield Case(f"ellipse {axis}, b/a", 0.6, der.ellipse(0.6, axis), h)
            ring = der.rectangle(0.6, 0.3, axis)
            yield Case(f"rectangle {axis} r/a = 0.3, b/a", 0.6, ring, h)
        for b in (0.7, 0.85):
            yield Case(f"ellipse {axis}, b/a", b, der.ellipse(b, axis), 4.0)
        for b in (0.4, 0.8, 1.0):
            ring = der.rectangle(b, 0.3, axis)
            yield Case(f"rectangle {axis} r/a = 0.3, b/a", b, ring, 4.0)
    for r in (0.1, 0.6, 1.0):
        yield Case("square, r/a", r, der.rectangle(1.0, r), 4.0)
    for h in (1.0, 2.0, 3.0, 4.0):
        r = math.sqrt(3) / 12
        yield Case("triangle 60 deg, r/a", r, _triangle(60.0, r), h)
        yield Case("triangle 120 deg, r/a", 1 / 15, _triangle(120.0, 1 / 15), h)
    for degrees in (60.0, 75.0, 90.0, 105.0, 120.0):
        yield Case("triangle r/a = 1/30, deg", degrees, _triangle(degrees, 1 / 30), 4.0)
    for r in (1 / 30, 0.1, LARGEST_CIRCLE):
        yield Case("triangle 120 deg, r/a", r, _triangle(120.0, r), 4.0)


def planes() -> Iterator[Case]:
    """The planes of profile and section around the paper's curves."""
    for h in HEIGHTS:
        for axis in "xy":
            for b in np.linspace(0.5, 1.0, 11).tolist():
                yield Case(f"ellipse {axis}, b/a", b, der.ellipse(b, axis), h)
            for b in np.linspace(0.2, 1.0, 17).tolist():
                yield Case(f"stadium {axis}, b/a", b, der.rectangle(b, b, axis), h)
            for b in np.linspace(0.2, 1.0, 17).tolist():
                yield Case(f"rectangle {axis} r/a = 0.1, b/a", b, der.rectangle(b, 0.1, axis), h)
            for r in np.linspace(0.05, 0.6, 12).tolist():
                ring = der.rectangle(0.6, r, axis)
                yield Case(f"rectangle {axis} b/a = 0.6, r/a", r, ring, h)
        for r in np.linspace(0.05, 1.0, 20).tolist():
            yield Case("square, r/a", r, der.rectangle(1.0, r), h)
        for degrees, largest in ((60.0, INSCRIBED_60), (120.0, LARGEST_CIRCLE)):
            for share in np.linspace(0.2, 1.0, 9).tolist():
                r = share * largest
                yield Case(f"triangle {degrees:g} deg, r/a", r, _triangle(degrees, r), h)
        for degrees in np.linspace(30.0, 150.0, 13).tolist():
            yield Case("triangle r/a = 1/30, deg", degrees, _triangle(degrees, 1 / 30), h)


def _triangle(degrees: float, r: float) -> der.Ring:
    return der.triangle(math.radians(degrees), r)


def judged(case: Case, n_edges: int = EDGES) -> Verdict:
    """Fold one ring by the path and by the angle, and judge it."""
    path, turned = (_folded(case, n_edges, control) for control in ("arclength", "angle"))
    at, mode = path.at_pi, path.mode
    positive = None if mode is None or at is None or not mode.foldable else at.slope > 0.0
    reached = _largest_index(turned)
    by_angle = None if turned.mode is None else turned.mode.foldable
    wrong = "a" if reached > 0 else ""
    if positive and at is not None:
        wrong += "b" * (at.index_moment != 0) + "c" * (at.index_free != 0)
    wrong += "d" * (_rests_unfolded(path) or _rests_unfolded(turned))
    end = turned.at_pi or at
    return Verdict(
        case.family,
        case.parameter,
        case.h_over_t,
        path.status if path.status == "done" else path.message,
        None if mode is None else mode.foldable,
        positive,
        None if mode is None else mode.snapping,
        len(path.folds),
        _largest_index(path),
        reached,
        "; ".join(
            f"{p.details['symmetry']} {p.gamma:.6f} ({p.index_before} to {p.index_after})"
            for p in path.branches
        ),
        None if at is None else at.index,
        None if at is None else at.index_moment,
        None if at is None else at.index_free,
        None if at is None else at.slope,
        by_angle,
        turned.status if turned.status == "done" else turned.message,
        None if end is None else end.energy,
        wrong,
    )


def _folded(case: Case, n_edges: int, control: str) -> der.Path:
    """The path, as far as it goes."""
    section = der.rectangular_section(case.h_over_t)
    scene = der.Scene(case.ring, section, n_edges=n_edges, self_crossings=False, control=control)
    try:
        return der.fold(scene)
    except der.NotConverged as failure:
        return failure.path


def _rests_unfolded(path: der.Path) -> bool:
    """Whether a ring without moment arrives at pi in another state than the three-covered one."""
    if path.at_pi is None or path.mode is None or path.mode.foldable:
        return False
    return abs(path.at_pi.moment) <= NO_MOMENT * float(np.abs(path.moment).max())


def _largest_index(path: der.Path) -> int:
    """Largest index of a path's states and beyond its branch points."""
    beyond = [p.index_after or 0 for p in path.branches]
    return int(max([*path.index.compressed().tolist(), *beyond], default=0))


def survey(*, quick: bool = False, n_edges: int = EDGES) -> list[Verdict]:
    """Judge every ring; ``quick``: four rings, one of each outcome."""
    if quick:
        cases = [
            Case("ellipse x, b/a", 0.6, der.ellipse(0.6), h_over_t)
            for h_over_t in (1.0, 2.0, 3.0, 4.0)
        ]
    else:
        cases = [*curves(), *planes()]
    return [judged(case, n_edges) for case in cases]


def write(verdicts: list[Verdict], folder: File) -> None:
    """Write the table and the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    columns = [entry.name for entry in fields(Verdict)]
    write_table(folder / "survey.csv", columns, map(astuple, verdicts))
    draw(verdicts, folder / "survey.png")


def draw(verdicts: list[Verdict], file: File) -> None:
    """Axes for each family, profile over h/t; open marks are a, b and d."""
    from der.paper.canvas import page, save

    families = list(dict.fromkeys(verdict.family for verdict in verdicts))
    columns = min(4, len(families))
    rows = -(-len(families) // columns)
    figure = page(3.3 * columns, 2.9 * rows + 0.5)
    for k, family in enumerate(families):
        axes = figure.add_subplot(rows, columns, k + 1)
        for name, colour in COLOURS.items():
            these = [v for v in verdicts if v.family == family and v.colour == name]
            x, y = [v.parameter for v in these], [v.h_over_t for v in these]
            axes.scatter(x, y, s=16, color=colour, marker="s", label=name)
        for letter, (marker, label) in MARKS.items():
            these = [v for v in verdicts if v.family == family and letter in v.wrong]
            x, y = [v.parameter for v in these], [v.h_over_t for v in these]
            axes.scatter(x, y, s=46, facecolor="none", edgecolor="k", marker=marker, label=label)
        axes.set_title(family.rpartition(", ")[0] or family, fontsize=9)
        axes.set_xlabel(family.rpartition(", ")[2], fontsize=8)
        axes.set_ylabel("h/t", fontsize=8)
        axes.tick_params(labelsize=7)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0.0, 0.5 / (2.9 * rows + 0.5), 1.0, 1.0))
    save(figure, file)


def main() -> None:
    """Run, write, and print what is wrong."""
    asked = Arguments(__file__, __doc__).parse(edges=EDGES, quick=False)
    verdicts = survey(quick=asked.quick, n_edges=asked.edges)
    write(verdicts, asked.out)
    for verdict in verdicts:
        if verdict.wrong or verdict.status != "done":
            print(
                f"{verdict.wrong or '-':3s} {verdict.family} {verdict.parameter:.4g}, "
                f"h/t = {verdict.h_over_t:g}: {verdict.status}, slope {verdict.slope}, index "
                f"{verdict.index}, {verdict.index_moment}, {verdict.index_free}, reached "
                f"{verdict.index_reached}, by the angle {verdict.by_angle}"
            )
    for letter in "abcd":
        print(f"{letter}: {sum(letter in v.wrong for v in verdicts)} of {len(verdicts)} rings")
    print(f"written to {asked.out}")


if __name__ == "__main__":
    main()
