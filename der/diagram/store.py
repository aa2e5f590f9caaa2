"""Finished cases on disk: an SQLite database, in which each is complete or absent."""

from __future__ import annotations

import errno
import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path as File
from typing import Self

from der.diagram.cases import Row
from der.utils.files import FilePath

SCHEMA = "CREATE TABLE cases (key TEXT PRIMARY KEY, row TEXT NOT NULL) WITHOUT ROWID"
IN_USE = ("SQLITE_BUSY", "SQLITE_LOCKED")


class Store:
    """The rows of finished cases by key, in memory and in a file; one process at a time.

    SQLite syncs each change before it counts and takes back one that is incomplete, after a crash
    or on a full disk. A new store takes over the cases of an older version's: the file of the same
    name that ends in .jsonl, a case a line.

    Parameters
    ----------
    file : made if it is not there

    Raises
    ------
    ValueError
        If another process has the file open, or it is no store, or none of its cases can be read.
    OSError
        If it cannot be read or written.
    """

    def __init__(self, file: FilePath) -> None:
        self.file = File(file)
        self.rows: dict[str, Row] = {}
        with self._named():
            self._open = sqlite3.connect(self.file, timeout=0.0)
        try:
            with self._named():
                self._open.text_factory = partial(str, encoding="utf-8", errors="replace")
                self._lock()
                lines = self._open.execute("SELECT row FROM cases").fetchall()
            self.rows.update(_some_readable(self.file, (line for (line,) in lines)))
            if not lines and (older := self.file.with_suffix(".jsonl")).is_file():
                with older.open(encoding="utf-8", errors="replace") as content:
                    self.add(_some_readable(older, content).values())
        except BaseException:
            self._open.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def safe(self) -> int:
        """How many cases are on disk: at Ctrl-C in the midst of `add`, more than are in `rows`."""
        return int(self._open.execute("SELECT count(*) FROM cases").fetchone()[0])

    def add(self, rows: Iterable[Row]) -> None:
        """Keep rows, on disk before anything else happens.

        Raises
        ------
        OSError
            If they cannot be written, on a full disk for one; what was there before is unharmed.
        """
        new = {row.case.key: row for row in rows}
        lines = [
            (key, json.dumps({"key": key, **row.to_json()}, allow_nan=False))
            for key, row in new.items()
        ]
        with self._named(), self._open:  # a transaction
            self._open.executemany("INSERT OR REPLACE INTO cases VALUES (?, ?)", lines)
        self.rows.update(new)

    def _lock(self) -> None:
        """Keep other processes out until the end, and make the table unless it is there."""
        self._open.execute("PRAGMA locking_mode = EXCLUSIVE")
        self._open.execute("BEGIN EXCLUSIVE")
        tables = self._open.execute("SELECT sql FROM sqlite_master").fetchall()
        if not tables:
            self._open.execute(SCHEMA)
        elif tables != [(SCHEMA,)]:  # a stranger's views and triggers would run as programs
            raise ValueError(f"{self.file} is no store of cases")
        self._open.commit()

    @contextmanager
    def _named(self) -> Iterator[None]:
        """Give an error of SQLite as one that names the file."""
        try:
            yield
        except sqlite3.Error as problem:
            code = getattr(problem, "sqlite_errorname", "")
            if code in IN_USE:
                raise ValueError(f"{self.file} is in use by another run") from None
            if code in ("SQLITE_NOTADB", "SQLITE_CORRUPT"):
                raise ValueError(f"{self.file} is no store of cases: {problem}") from None
            number = errno.ENOSPC if code == "SQLITE_FULL" else errno.EIO
            words = f"{problem}; {len(self)} cases are safe"
            raise OSError(number, words, str(self.file)) from problem


def _some_readable(file: File, lines: Iterable[str]) -> dict[str, Row]:
    """Rows by their keys; of many lines some must be such, or all would be solved again."""
    kept = list(lines)
    rows = dict(_readable(kept))
    if len(kept) > 1 and not rows:
        words = f"none of its {len(kept)} lines is a case; move it away to solve all of them"
        raise ValueError(f"{file} is no store of cases: {words}")
    return rows


def _readable(lines: Iterable[str]) -> Iterator[tuple[str, Row]]:
    """Rows with their keys; the case of a line that cannot be read is solved again."""
    for line in lines:
        try:
            entries = json.loads(line)
            yield entries.pop("key"), Row.from_json(entries)
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            continue
