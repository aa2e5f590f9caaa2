"""Files of pictures, movies, pages and recordings: their suffixes, and writing them atomically."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path as File
from typing import BinaryIO

from der.utils.files import FilePath, write_whole


def checked_suffix(kind: str, file: FilePath, formats: Sequence[str]) -> str:
    """The suffix of a file, in small letters.

    Raises
    ------
    ValueError
        If it is not one of the formats.
    """
    suffix = File(file).suffix.lower()
    if suffix not in formats:
        raise ValueError(f"{kind} must end in {', '.join(formats)}, got {str(file)!r}")
    return suffix


def write(kind: str, file: FilePath, content: bytes | Callable[[BinaryIO], object]) -> None:
    """Write a file atomically: bytes, or what a function writes.

    Raises
    ------
    ValueError
        If it cannot be written.
    """
    put = content if callable(content) else lambda opened: opened.write(content)
    with refused(kind, file):
        write_whole(file, put)


@contextmanager
def refused(kind: str, file: FilePath) -> Iterator[None]:
    """Give an error of the system, while a file is written, as a ValueError that names the file."""
    try:
        yield
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(f"{kind} {str(file)!r} cannot be written: {reason}") from problem
