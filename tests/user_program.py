"""A small program of a user, with types: mypy checks it strictly, and test_user_program.py runs it.

A ring is folded, its record kept, drawn and read again, and two solvers are compared.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import der


@dataclass(frozen=True)
class Answer:
    """What the program wants to know of a ring."""

    foldable: bool
    fold_gammas: tuple[float, ...]
    peak_moment: float  # GJ/a
    barrier: float | None  # GJ/a, of the free ring, to open
    packing: float
    agreement: float  # share of the states on which both solvers agree
    minima: list[str]


def scene_of(ring: der.Ring, h_over_t: float) -> der.Scene:
    """The statement: a ring, its section, and what is asked."""
    section = der.rectangular_section(h_over_t=h_over_t, nu=0.3)
    return der.Scene(ring, section, n_edges=32, error_bars=True, self_crossings=False)


def kept(path: der.Path, folder: Path) -> der.Path:
    """The path, once it was written, drawn and read again."""
    path.save(folder / "path.json")
    figure = path.plot(folder / "path.png")
    figure.set_size_inches(6.0, 4.5)
    return der.Path.load(folder / "path.json")


def answer(ring: der.Ring, h_over_t: float, folder: Path) -> Answer:
    """Fold a ring and ask what a designer asks."""
    scene = scene_of(ring, h_over_t)
    try:
        path = kept(der.fold(scene), folder)
    except der.NotConverged as unfinished:
        raise SystemExit(f"{unfinished.path.reason}: {unfinished}") from unfinished
    moment: NDArray[np.float64] = path.moment
    comparison: der.Comparison = der.compare(scene, path)
    free: der.Pass = der.barrier(scene)
    states: der.States = der.states(scene, count=4)
    return Answer(
        foldable=path.mode is not None and path.mode.foldable,
        fold_gammas=tuple(point.gamma for point in path.folds),
        peak_moment=float(moment.max()),
        barrier=free.open,
        packing=der.packing_ratio(ring),
        agreement=comparison.within,
        minima=[state.name for state in states.minima],
    )


if __name__ == "__main__":
    print(f"der {der.__version__}")
    print(answer(der.circle(), 4.0, Path(sys.argv[1])))
