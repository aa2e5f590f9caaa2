"""The paper's figures, each a picture NAME.png and the table NAME.csv of what it shows.

    drawn = draw(["fig2b", "fig11"], "figures")   # files by name, and what went wrong by name

What draws and solves is imported when a figure is drawn, so that the names cost nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path as File
from typing import TypeAlias

from der.paper.drawing import Drawn, Interrupted
from der.paper.drawing import draw as _draw
from der.utils.files import FilePath

__all__ = ["DIAGRAMS", "FIGURES", "Drawn", "Interrupted", "draw"]

Draw: TypeAlias = Callable[[FilePath], list[File]]


def draw(
    names: list[str] | tuple[str, ...],
    folder: FilePath,
    workers: int | None = None,
    *,
    warn: Callable[[str], object] = lambda words: None,
) -> Drawn:
    """Draw figures side by side, one thread each, and say what was written.

    New Python processes are started, so a script calls this under ``if __name__ == "__main__"``.

    Parameters
    ----------
    names : of FIGURES, and of DIAGRAMS, which take half a minute each, those of cubes four minutes
    folder : where the files go; made if it is not there
    workers : how many figures at a time; None: as many as there are cores
    warn : told, in a line each, what the boundaries of a diagram leave open

    Returns
    -------
    Drawn
        A figure that fails is in `failed`, and the others are drawn all the same.

    Raises
    ------
    ValueError
        For a name that is not one of FIGURES, a number of workers below 1, or a folder that is
        none and cannot be made.
    Interrupted
        At Ctrl-C; has what was finished until then. No half-written file is left.
    """
    for name in names:
        if name not in FIGURES and name not in DIAGRAMS:
            words = ", ".join([*FIGURES, *DIAGRAMS])
            raise ValueError(f"name must be one of {words}, got {name!r}")
    drawn = _draw({name: FIGURES[name] for name in names if name in FIGURES}, folder, workers)
    diagrams = {
        name: _diagram(name, File(folder) / name, workers, warn)
        for name in names
        if name in DIAGRAMS
    }
    return Drawn({**drawn.written, **diagrams}, drawn.failed)


def _diagram(
    name: str, folder: File, workers: int | None, warn: Callable[[str], object]
) -> list[File]:
    """A phase diagram, in a folder of its own; it goes on with the cases that are there."""
    from der.diagram.diagram import doubts, phase

    diagram = phase(name, folder, workers=workers, resume=True)
    for words in doubts(diagram):
        warn(f"{name}: {words}")
    return list(diagram.files)


def _curves(name: str, folder: FilePath) -> list[File]:
    from der.paper import curves

    return _written(curves, name, folder)


def _snapshots(name: str, folder: FilePath) -> list[File]:
    from der.paper import snapshots

    return _written(snapshots, name, folder)


def _profiles(name: str, folder: FilePath) -> list[File]:
    from der.paper import profiles

    return _written(profiles, name, folder)


def _manifold(name: str, folder: FilePath) -> list[File]:
    from der.paper import manifold

    return _written(manifold, name, folder)


def _beyond_pi(name: str, folder: FilePath) -> list[File]:
    from der.paper import beyond_pi

    return _written(beyond_pi, name, folder)


def _packing(name: str, folder: FilePath) -> list[File]:
    from der.paper import packing as packing_figures

    return _written(packing_figures, name, folder)


def _written(module: object, name: str, folder: FilePath) -> list[File]:
    """The files of a figure; its function has its name in small letters."""
    return [File(file) for file in getattr(module, name.lower())(folder)]


_HOME: dict[str, Callable[[str, FilePath], list[File]]] = {
    "fig2b": _manifold,
    "fig2c": _snapshots,
    "fig3b": _packing,
    "fig4b": _curves,
    "fig4c": _snapshots,
    "fig6": _packing,
    "fig7b": _curves,
    "fig7c": _snapshots,
    "fig9": _packing,
    "fig10b": _curves,
    "fig10c": _curves,
    "fig10d": _snapshots,
    "fig10e": _snapshots,
    "fig11": _curves,
    "figC1": _beyond_pi,
    "figC2": _curves,
    "figD1": _profiles,
    "figD2": _profiles,
    "figD3": _profiles,
}
FIGURES: dict[str, Draw] = {name: partial(home, name) for name, home in _HOME.items()}
DIAGRAMS = ("fig3a", "fig5a", "fig5b", "fig5c", "fig8a", "fig8b", "fig8c")
