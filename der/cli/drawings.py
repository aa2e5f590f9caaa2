"""What is drawn of each answer of the command: writers by the option that asks for them.

Views are imported when they draw. A sentence in place of a writer says why there is nothing to see.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

from der.cli.output import DRAWN

if TYPE_CHECKING:
    from der.cli.output import Writers
    from der.records.landscape import Landscape
    from der.records.path import Path
    from der.records.planar import PlanarStates, Squeeze
    from der.records.states import States


def of_path(path: Path, other: Path | None = None) -> Writers:
    """Of a path; where there is another, what moves shows it, too."""
    shown = path if other is None else [path, other]

    def plot(file: File) -> None:
        from der.viz.plots.path import save_plot

        save_plot(path, file)

    def rrd(file: File) -> None:
        from der.viz.rerun.recording import save_recording

        save_recording(shown, file)

    def html(file: File) -> None:
        from der.viz.html import save_html

        save_html(shown, file)

    def movie(file: File) -> None:
        from der.viz.movie import save_movie

        save_movie(shown, file)

    drawn: Writers = {"plot": plot, "rrd": rrd, "html": html, "movie": movie}
    if len(path) < 2:
        drawn = dict.fromkeys(DRAWN, "there is no path of two states")
    return {**drawn, **_shapes(path)}


def of_landscape(found: Any, along: Callable[[], Landscape]) -> Writers:
    """Of any landscape; ``along``: the one along the path of twisting, for what is played back."""
    from der.records import energy_surface as landscape_surface_record
    from der.records import landscape as landscape_record
    from der.records.opening import LeastPush

    empty = ""
    if isinstance(found, landscape_record.Landscape) and not len(found.path):
        empty = "there is no state"
    elif isinstance(found, landscape_surface_record.Surface) and not found.count.any():
        empty = "there is no minimum in any cell"
    elif isinstance(found, LeastPush) and found.best is None:
        empty = "there is no push that opens the ring"
    elif isinstance(found, landscape_record.Pass) and found.saddle is None:
        empty = "there is no saddle to cross"

    def plot(file: File) -> None:
        from der.viz.plots.style import save_figure

        save_figure(_figure(found), file)

    def rrd(file: File) -> None:
        from der.viz.rerun.recording import save_landscape

        one = along()
        if one is not found and one.status == "interrupted":
            raise KeyboardInterrupt
        save_landscape(one, file, surface=None if one is found else found)

    return {"plot": empty or plot, "rrd": empty or rrd}


def _figure(found: Any) -> Any:
    from der.records.energy_surface import Surface
    from der.records.landscape import Landscape
    from der.records.opening import LeastPush
    from der.viz.plots import landscape as view

    if isinstance(found, Landscape):
        return view.figure_of_landscape(found)
    if isinstance(found, Surface):
        from der.viz.plots.energy_surface import figure_of_surface

        return figure_of_surface(found)
    if isinstance(found, LeastPush):
        from der.viz.plots.opening import figure_of_push

        return figure_of_push(found)
    return view.figure_of_pass(found)


def of_states(found: States) -> Writers:
    """Of the states of a ring."""

    def plot(file: File) -> None:
        from der.viz.plots.states import figure_of_states
        from der.viz.plots.style import save_figure

        save_figure(figure_of_states(found), file)

    drawn: Writers = {"plot": plot if len(found) else "there is no state"}
    return {**drawn, **_shapes(found)}


def of_planar(found: PlanarStates | Squeeze) -> Writers:
    """Of the states of a ring in its plane, or of how it is squeezed there."""

    def plot(file: File) -> None:
        from der.viz.plots.planar import figure_of_planar
        from der.viz.plots.style import save_figure

        save_figure(figure_of_planar(found), file)

    drawn: Writers = {"plot": plot if len(found) else "there is no state"}
    return {**drawn, **_shapes(found)}


def _shapes(found: Path | States | PlanarStates | Squeeze) -> Writers:
    return {} if found.shapes is None else {"shapes": found.shapes.save}
