"""Files that are written whole or not at all."""

import os
import pathlib
import secrets
from collections.abc import Callable
from typing import BinaryIO, TypeAlias

FilePath: TypeAlias = str | os.PathLike[str]


def decoded(content: bytes) -> str:
    """Text of a file's content.

    Raises
    ------
    ValueError
        If it is none.
    """
    try:
        return content.decode()
    except UnicodeDecodeError:
        raise ValueError("no text file") from None


def write_whole(path: FilePath, write: Callable[[BinaryIO], object]) -> None:
    """Write a file beside its target and rename it, so that the target is never half written.

    Raises
    ------
    OSError
        If it cannot be written; a file already there is then unharmed.
    """
    target = pathlib.Path(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot save {target}: there is no folder {target.parent}")
    # not tempfile: its files are closed to everyone else, whatever the umask says
    beside = target.parent / f".{secrets.token_hex(8)}.tmp"
    try:
        with beside.open("xb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, target)
    except BaseException:  # Ctrl-C leaves nothing behind either
        beside.unlink(missing_ok=True)
        raise
