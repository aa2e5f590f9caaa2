"""The table of all figures, and their drawing side by side.

The module of a figure imports the solver and matplotlib. It is imported when the figure is drawn,
so that the table costs no time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path as File
from typing import TypeAlias

from der.paper.drawing import Drawn, Interrupted, draw_all
from der.utils.files import FilePath

Draw: TypeAlias = Callable[[FilePath], list[File]]

_MODULES = {  # of this package, by figure; the function has the figure's name in small letters
    "fig2b": "manifold",
    "fig2c": "snapshots",
    "fig3b": "packing",
    "fig4b": "curves",
    "fig4c": "snapshots",
    "fig6": "packing",
    "fig7b": "curves",
    "fig7c": "snapshots",
    "fig9": "packing",
    "fig10b": "curves",
    "fig10c": "curves",
    "fig10d": "snapshots",
    "fig10e": "snapshots",
    "fig11": "curves",
    "figC1": "beyond_pi",
    "figC2": "curves",
    "figD1": "profiles",
    "figD2": "profiles",
    "figD3": "profiles",
    "hysteresis": "hysteresis",
}


def _draw_figure(name: str, folder: FilePath) -> list[File]:
    """Draw a figure, and return its files."""
    module = import_module(f"der.paper.{_MODULES[name]}")
    return [File(file) for file in getattr(module, name.lower())(folder)]


def _draw_diagram(
    name: str, folder: FilePath, workers: int | None, warn: Callable[[str], object]
) -> list[File]:
    """Draw a phase diagram in its own folder; cases that are solved there are not repeated."""
    from der.diagram.diagram import doubts, phase_diagram

    diagram = phase_diagram(name, File(folder) / name, workers=workers, resume=True)
    for words in doubts(diagram):
        warn(f"{name}: {words}")
    return list(diagram.files)


FIGURES: dict[str, Draw] = {name: partial(_draw_figure, name) for name in _MODULES}
DIAGRAMS = {  # these have workers of their own, so they are drawn one after the other
    name: partial(_draw_diagram, name)
    for name in ("fig3a", "fig5a", "fig5b", "fig5c", "fig8a", "fig8b", "fig8c")
}


def draw(
    names: list[str] | tuple[str, ...],
    folder: FilePath,
    workers: int | None = None,
    *,
    warn: Callable[[str], object] = lambda words: None,
) -> Drawn:
    """Draw figures side by side, one thread each, and return the files.

    New Python processes are started, so a script calls this under ``if __name__ == "__main__"``.

    Parameters
    ----------
    names : of FIGURES, and of DIAGRAMS, which take half a minute each, those of cubes four minutes
    folder : of the files; it is made if it does not exist
    workers : how many figures at a time; None: as many as there are cores
    warn : called with a line for each open question about the boundaries of a diagram

    Returns
    -------
    Drawn
        A figure that fails is in `failed`; the others are drawn.

    Raises
    ------
    ValueError
        For an unknown name, a number of workers below 1, or a folder that cannot be made.
    Interrupted
        At Ctrl-C; it has the figures that were finished. No incomplete file is left.
    """
    known = {**FIGURES, **DIAGRAMS}
    for name in names:
        if name not in known:
            raise ValueError(f"name must be one of {', '.join(known)}, got {name!r}")
    drawn = draw_all({name: FIGURES[name] for name in names if name in FIGURES}, folder, workers)
    written = dict(drawn.written)
    try:
        for name in names:
            if name in DIAGRAMS:
                written[name] = DIAGRAMS[name](folder, workers, warn)
    except KeyboardInterrupt as stopped:
        raise Interrupted(Drawn(written, drawn.failed), str(stopped)) from None
    return Drawn(written, drawn.failed)
