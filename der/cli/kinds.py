"""How each kind of record is told on the terminal, and drawn: one table.

What a kind needs is imported when a record of it is written.
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
    text : what is printed
    empty : why there is nothing to draw; "" where there is
    unfinished : what is said where it is not complete, and where it is
    moving : what shows it in motion, by option
    """

    text: Callable[[Any], str]
    empty: Callable[[Any], str]
    unfinished: Callable[[Any, Targets], str]
    moving: Mapping[str, Moving] = field(default_factory=dict)


def _lazy(place: str) -> Callable[..., Any]:
    """The function at module:function of `der`, imported when it is called."""
    module, name = place.split(":")

    def call(*given: Any, **more: Any) -> Any:
        return getattr(import_module(f"der.{module}"), name)(*given, **more)

    return call


# --- Paths -----------------------------------------------------------------------------------


def _together(place: str) -> Moving:
    """The writer of a path, and of another where there is one."""
    write = _lazy(place)
    return lambda path, other, file: write(path if other is None else [path, other], file)


_PATH = Kind(
    _lazy("records.text:summary"),
    lambda path: "" if len(path) > 1 else "there is no path of two states",
    lambda path, targets: f"{path.message}; {whereabouts(path, targets)}",
    {
        "rrd": _together("viz.rerun.recording:save_recording"),
        "html": _together("viz.html:save_html"),
        "movie": _together("viz.movie:save_movie"),
    },
)
_COMPARISON = Kind(
    _lazy("records.text:summary"),
    lambda comparison: "",
    lambda comparison, targets: "",
)

# --- Landscapes ------------------------------------------------------------------------------


def _text_of_landscape(found: Any) -> str:
    # what is not done says why on standard error
    text: str = _lazy("records.text:summary")(found, why=found.status == "done")
    return text


def _unfinished_landscape(found: Any, targets: Targets) -> str:
    return f"{_lazy('records.text:reason')(found)}; what was found is {places(targets)}"


def _play_landscape(found: Any, along: Callable[[], Any] | None, file: File) -> None:
    """Record a landscape; a surface with the landscape along its path, which is found now."""
    save = _lazy("viz.rerun.recording:save_landscape")
    if along is None:
        save(found, file)
        return
    landscape = along()
    if landscape.status == "interrupted":
        raise KeyboardInterrupt
    save(landscape, file, surface=found)


def _landscape(empty: Callable[[Any], str]) -> Kind:
    moving = {"rrd": _play_landscape}
    return Kind(_text_of_landscape, empty, _unfinished_landscape, moving)


# --- States ----------------------------------------------------------------------------------


def _unfinished_states(found: Any, targets: Targets) -> str:
    where = places(targets, shapes=found.shapes is not None)
    return f"{found.message}; states that were found: {len(found)}, {where}"


def _states() -> Kind:
    return Kind(
        _lazy("records.text:summary"),
        lambda found: "" if len(found) else "there is no state",
        _unfinished_states,
    )


_PLANAR = _states()

KINDS = {  # by the name of the record's class
    "Path": _PATH,
    "Comparison": _COMPARISON,
    "Landscape": _landscape(
        lambda found: "" if len(found.path) else "there is no state",
    ),
    "Surface": _landscape(
        lambda found: "" if found.count.any() else "there is no minimum in any cell",
    ),
    "Pass": _landscape(
        lambda found: "" if found.saddle is not None else "there is no saddle to cross",
    ),
    "LeastPush": _landscape(
        lambda found: "" if found.best is not None else "there is no push that opens the ring",
    ),
    "States": _states(),
    "PlanarStates": _PLANAR,
    "Squeeze": _PLANAR,
}


def kind(record: object) -> Kind:
    """The kind of a record."""
    return KINDS[type(record).__name__]


def writers(record: Any, beside: Any = None) -> Writers:
    """What is written of a record besides its JSON, by option.

    Parameters
    ----------
    record : of one of the KINDS.
    beside : what is shown with it: another path; of a surface, what makes the landscape along it.
    """
    own = kind(record)
    moving = {option: partial(write, record, beside) for option, write in own.moving.items()}
    reason = own.empty(record)
    drawn: Writers = dict.fromkeys(DRAWN, reason) if reason else {"plot": record.plot, **moving}
    save_shapes = getattr(getattr(record, "shapes", None), "save", None)
    return drawn if save_shapes is None else {**drawn, "shapes": save_shapes}
