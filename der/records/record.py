"""What every record can do: be saved and loaded, drawn, and shown in a line or a small table.

A record has the name of the module that draws it, which is imported when the record is drawn: to
read a file loads no matplotlib, and this package imports nothing of `der.viz`.
"""

from __future__ import annotations

import base64
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from der.geometry.scale import Scale
from der.records.codec import record_of
from der.records.entries import Checked, plain
from der.records.units import in_units
from der.records.values import (
    Number,
    NumericsEntry,
    RingEntry,
    ScaleEntry,
    SectionEntry,
    Text,
    one_of,
)
from der.utils.checks import shown
from der.utils.files import FilePath, Saved, content, json_entries, json_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA = 1
STATUSES = ("done", "not converged", "interrupted")
LARGEST = 2**28  # bytes of a file that is read: a thousand times what a long path takes
SPARSE = ("raw", "scale", "forces")  # entries that are left out of a file where they are None
Status = Annotated[str, one_of(STATUSES)]


@dataclass(frozen=True)
class SolveTime(Checked):
    """What a solve has cost."""

    solve_s: Number


class Shown:
    """An answer that can be drawn, and shown in a line or in a notebook."""

    NAME: ClassVar[str]  # what it is, in a word

    def facts(self) -> list[str]:
        """The main facts of this kind, each in a few words."""
        raise NotImplementedError

    def figure(self) -> Figure:
        """The matplotlib figure of it."""
        raise NotImplementedError

    def plot(self, file: FilePath | None = None) -> Figure:
        """Draw the record.

        Parameters
        ----------
        file : where to write the picture, by its suffix .png, .pdf or .svg; None: nowhere.

        Returns
        -------
        matplotlib Figure
            To be shown or changed further.

        Raises
        ------
        ValueError
            If there is nothing to draw, or the file cannot be written.
        """
        figure = self.figure()
        if file is not None:
            import_module("der.viz.plots.style").save(figure, file)
        return figure

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self._all_facts())})"

    def _repr_html_(self) -> str:
        """A table of the main facts, and the picture, for notebooks."""
        cells = "".join(f"<td>{escape(text)}</td>" for text in self._all_facts())
        table = f"<table><tr><th>{escape(self.NAME)}</th>{cells}</tr></table>"
        return table + self._picture()

    def _all_facts(self) -> list[str]:
        return self.facts()

    def _picture(self) -> str:
        """The picture as an element of HTML; "" where there is nothing to draw."""
        try:
            figure = self.figure()
        except ValueError:
            return ""
        png = io.BytesIO()
        figure.savefig(png, format="png", dpi=90)
        data = base64.b64encode(png.getvalue()).decode()
        return f'<img alt="{escape(self.NAME)}" src="data:image/png;base64,{data}">'


class Record(Checked, Shown, Saved):
    """An answer: written as JSON with one entry a line, and read again."""

    KIND: ClassVar[str] = ""  # the first entry; "": the file has none
    PLOT: ClassVar[str]  # the module of der.viz.plots whose function `draw` makes the figure

    OPTIONAL: ClassVar[tuple[str, ...]] = ("scale",)

    ring: Mapping[str, object]
    timing: SolveTime
    scale: Scale | None = None  # None: not dimensional

    def __init_subclass__(cls, *, name: str = "", kind: str = "", plot: str = "") -> None:
        super().__init_subclass__()
        cls.NAME, cls.KIND, cls.PLOT = name, kind, plot

    def to_json(self) -> str:
        """JSON text of schema 1, one entry a line."""
        return json_lines(plain(self))

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Record of a JSON text.

        Raises
        ------
        ValueError
            If it is not JSON, of another kind or schema, or not such a record; the message says
            where and what is allowed there.
        """
        return record_of(cls, json_entries(text))

    @classmethod
    def load(cls, path: FilePath) -> Self:
        """Record of a JSON file.

        Raises
        ------
        OSError
            If the file cannot be read.
        ValueError
            If it is too large, broken or of another kind or schema; the message names the file and
            what is wrong.
        """
        try:
            return cls.from_json(_decoded(content(path, LARGEST)))
        except ValueError as problem:
            raise ValueError(f"{os.fspath(path)}: {problem}") from problem

    def on_disk(self, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries after kind and schema."""
        first = {"kind": self.KIND} if self.KIND else {}
        for name in SPARSE:
            if entries.get(name, self) is None:
                del entries[name]
        return first | {"schema": SCHEMA} | super().on_disk(entries)

    @classmethod
    def from_disk(cls, entries: dict[str, Any]) -> dict[str, Any]:
        """The entries without kind and schema, which are checked."""
        kind = entries.pop("kind", "")
        if kind != cls.KIND:
            if not cls.KIND:
                raise ValueError(f"not a {cls.NAME} but a record of kind {shown(kind)}")
            if not kind:
                raise ValueError(f"not a record of {cls.KIND}")
            raise ValueError(f"kind is {shown(kind)}, not {cls.KIND!r}")
        if (schema := entries.pop("schema", None)) != SCHEMA:
            raise ValueError(f"schema is {shown(schema)}, this version reads {SCHEMA}")
        return super().from_disk(entries)

    @property
    def solve_s(self) -> float:
        """Seconds that the solver took."""
        return self.timing.solve_s

    def figure(self) -> Figure:
        """The matplotlib figure of the record."""
        figure: Figure = import_module(f"der.viz.plots.{self.PLOT}").draw(in_units(self))
        return figure

    def _all_facts(self) -> list[str]:
        """The ring, what is special, and the status."""
        return [
            str(self.ring.get("shape")),
            *in_units(self).facts(),
            getattr(self, "status", "done"),
        ]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RingRecord(Record):
    """A record that begins with how it ended, and with the ring, its section and the numerics."""

    status: Status = "done"
    message: Text = ""  # a sentence about the status
    ring: RingEntry
    section: SectionEntry
    numerics: NumericsEntry
    scale: ScaleEntry | None = None


def _decoded(read: bytes) -> str:
    try:
        return read.decode()
    except UnicodeDecodeError:
        raise ValueError("no text file") from None
