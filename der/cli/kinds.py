"""What is printed and written of each kind of record: one table.

Modules that draw a kind of record are imported when one is drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path as File
from typing import TYPE_CHECKING, Any, TypeAlias

from der.cli.output import DRAWN, places, whereabouts

if TYPE_CHECKING:
    from der.cli.output import Targets, Writers

# writes a record, and what is shown beside it, to a file
Moving: TypeAlias = Callable[[Any, Any, File], object]


@dataclass(frozen=True)
class Kind:
    """What is done with one kind of record.

    Attributes
    ----------
    empty : why there is nothing to draw; "" where there is
    unfinished : what was found of a record that is not complete, and where it is
    moving : what shows it in motion, by option
    repeats : whether the summary repeats why it is not complete
    """

    empty: Callable[[Any], str]
    unfinished: Callable[[Any, Targets], str]
    moving: Mapping[str, Moving] = field(default_factory=dict)
    repeats: bool = True


def _together(module: str, save: str) -> Moving:
    """The writer of a path, and of another where there is one."""

    def write(path: Any, other: Any, file: File) -> None:
        shown = path if other is None else [path, other]
        getattr(import_module(f"der.viz.{module}"), save)(shown, file)

    return write


def _play(found: Any, along: Callable[[], Any] | None, file: File) -> None:
    """Record a landscape, or a surface with the landscape along its path, computed now."""
    from der.viz.rerun.recording import save_landscape

    if along is None:
        save_landscape(found, file)
        return
    landscape = along()
    if landscape.status == "interrupted":
        raise KeyboardInterrupt
    save_landscape(landscape, file, surface=found)


def _states_found(found: Any, targets: Targets) -> str:
    where = places(targets, shapes=found.shapes is not None)
    return f"states that were found: {len(found)}, {where}"


def _landscape(empty: Callable[[Any], str]) -> Kind:
    def found(_: Any, targets: Targets) -> str:
        return f"what was found is {places(targets)}"

    return Kind(empty, found, {"rrd": _play}, repeats=False)


_STATES = Kind(lambda found: "" if len(found) else "there is no state", _states_found)

KINDS = {  # by the name of the record's class
    "Path": Kind(
        lambda path: "" if len(path) > 1 else "there is no path of two states",
        whereabouts,
        {
            "rrd": _together("rerun.recording", "save_recording"),
            "html": _together("html", "save_html"),
            "movie": _together("movie", "save_movie"),
        },
    ),
    "Comparison": Kind(lambda found: "", lambda found, targets: ""),
    "Landscape": _landscape(lambda found: "" if len(found.path) else "there is no state"),
    "Surface": _landscape(
        lambda found: "" if found.count.any() else "there is no minimum in any cell"
    ),
    "Pass": _landscape(
        lambda found: "" if found.saddle is not None else "there is no saddle to cross"
    ),
    "LeastPush": _landscape(
        lambda found: "" if found.best is not None else "there is no push that opens the ring"
    ),
    "States": _STATES,
    "PlanarStates": _STATES,
    "Squeeze": _STATES,
}


def unfinished(record: Any, targets: Targets) -> str:
    """Why a record is not complete, and where what was found of it is."""
    from der.records.text import reason

    return f"{reason(record)}; {KINDS[type(record).__name__].unfinished(record, targets)}"


def text(record: Any) -> str:
    """What is printed of a record."""
    from der.records.text import summary

    done = getattr(record, "status", "done") == "done"
    return summary(record, why=done or KINDS[type(record).__name__].repeats)


def writers(record: Any, beside: Any = None) -> Writers:
    """What is written of a record besides its JSON, by option.

    Parameters
    ----------
    record : of one of the KINDS.
    beside : what is shown with it: another path; of a surface, what makes the landscape along it.
    """
    kind = KINDS[type(record).__name__]
    moving = {option: partial(write, record, beside) for option, write in kind.moving.items()}
    reason = kind.empty(record)
    drawn: Writers = dict.fromkeys(DRAWN, reason) if reason else {"plot": record.plot, **moving}
    save_shapes = getattr(getattr(record, "shapes", None), "save", None)
    return drawn if save_shapes is None else {**drawn, "shapes": save_shapes}
