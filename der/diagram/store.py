"""Finished cases on disk: one line of JSON each, appended and synced, so that none is lost."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterable
from pathlib import Path as File
from typing import Self

from der.diagram.cases import Row
from der.utils.files import FilePath


class Store:
    """The rows of finished cases by key, in memory and in a file that only grows.

    An incomplete line, after a crash or on a full disk, is cut off when the file is opened.
    One process at a time.

    Parameters
    ----------
    file : made if it is not there

    Raises
    ------
    ValueError
        If another process has the file open.
    OSError
        If it cannot be read or written.
    """

    def __init__(self, file: FilePath) -> None:
        self.file = File(file)
        self.rows: dict[str, Row] = {}
        self._open = os.open(self.file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            self._lock()
            self._read()
        except BaseException:
            os.close(self._open)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._open)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def safe(self) -> int:
        """How many cases are on disk: at Ctrl-C in the midst of `add`, more than are in `rows`."""
        return self.file.read_bytes().count(b"\n")

    def add(self, rows: Iterable[Row]) -> None:
        """Keep rows, on disk before anything else happens.

        Raises
        ------
        OSError
            If they cannot be written, on a full disk for one; what was there before is unharmed.
        """
        rows = list(rows)
        lines = [
            json.dumps({"key": row.case.key, **row.to_json()}, allow_nan=False) + "\n"
            for row in rows
        ]
        try:
            self._write("".join(lines).encode())
        except OSError as problem:
            os.ftruncate(self._open, self._end)
            raise OSError(
                problem.errno, f"{problem.strerror}; {len(self)} cases are safe", str(self.file)
            ) from problem
        self.rows.update((row.case.key, row) for row in rows)

    def _lock(self) -> None:
        try:
            fcntl.flock(self._open, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f"{self.file} is in use by another run") from None

    def _read(self) -> None:
        """Read all complete lines, and cut off the rest."""
        content = self.file.read_bytes()
        self._end = content.rfind(b"\n") + 1
        os.ftruncate(self._open, self._end)
        for line in content[: self._end].splitlines():
            try:
                entries = json.loads(line)
                key = entries.pop("key")
                self.rows[key] = Row.from_json(entries)
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # the case of a line that cannot be read is solved again

    def _write(self, content: bytes) -> None:
        os.lseek(self._open, self._end, os.SEEK_SET)
        rest = memoryview(content)
        while rest:
            rest = rest[os.write(self._open, rest) :]
        os.fsync(self._open)
        self._end += len(content)
