"""Files that are written completely or not at all, and records kept in them as JSON."""

from __future__ import annotations

import glob
import json
import os
import pathlib
import secrets
import stat
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, BinaryIO, TypeAlias

FORGOTTEN = 3600.0  # s without a change: nobody writes any more
FilePath: TypeAlias = str | os.PathLike[str]


def opened(path: FilePath) -> BinaryIO:
    """A file to be read; a named pipe that nobody writes to is empty, and not waited for."""
    at_once: int = getattr(os, "O_NONBLOCK", 0)  # Windows has no such pipes

    def opener(name: str, flags: int) -> int:
        number = os.open(name, flags | at_once)
        if at_once:
            os.set_blocking(number, True)
        return number

    return open(path, "rb", opener=opener)


def content(path: FilePath, most: int) -> bytes:
    """What is in a file, whatever it says its size is: devices are endless.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it has more than ``most`` bytes.
    """
    with opened(path) as file:
        found = file.read(most + 1)
    if len(found) > most:
        raise ValueError(f"must have at most {most} bytes")
    return found


class Saved:
    """A record that writes itself as JSON."""

    def to_json(self) -> str:
        """JSON text."""
        raise NotImplementedError

    def save(self, path: FilePath) -> None:
        """Write JSON, completely or not at all.

        Raises
        ------
        OSError
            If the file cannot be written; a file already there is then unchanged.
        """
        content = self.to_json().encode()
        write_whole(path, lambda file: file.write(content))


def json_lines(entries: Mapping[str, object]) -> str:
    """JSON text of a record, one entry a line; NaN and infinities are refused."""
    lines = [f'"{name}": {json.dumps(entry, allow_nan=False)}' for name, entry in entries.items()]
    return "{\n  " + ",\n  ".join(lines) + "\n}\n"


def json_entries(text: str) -> dict[str, Any]:
    """Entries of a record by its JSON text; ValueError if it is not JSON, or no record."""
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise ValueError(f"not JSON: {problem}") from problem
    if not isinstance(entries, dict):
        raise ValueError(f"not a record but a JSON {type(entries).__name__}")
    return entries


def write_whole(path: FilePath, write: Callable[[BinaryIO], object]) -> None:
    """Write a file beside its target and rename it, so that the target is never incomplete.

    A symbolic link stays one: what it points to is replaced. The rights of a file that is replaced
    are kept. What a killed process leaves is removed when the file is written an hour later.

    Raises
    ------
    OSError
        If it cannot be written; a file already there is then unchanged.
    """
    target = pathlib.Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot save {target}: there is no folder {target.parent}")
    # not tempfile: its files are readable by their owner alone, whatever the umask is
    stem = f".{target.name[:100]}"
    beside = target.with_name(f"{stem}.{secrets.token_hex(8)}.tmp")
    for left in target.parent.glob(f"{glob.escape(stem)}.{'[0-9a-f]' * 16}.tmp"):
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > FORGOTTEN:
                left.unlink()
    try:
        with beside.open("xb") as file:
            with suppress(FileNotFoundError):
                os.chmod(beside, stat.S_IMODE(target.stat().st_mode))
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    except BaseException:  # Ctrl-C, too, leaves no file behind
        beside.unlink(missing_ok=True)
        raise
