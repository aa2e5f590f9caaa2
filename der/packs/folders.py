"""Where compiled kernels are kept: a temporary folder, where no other can be written to."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path as File

FOLDER = "NUMBA_CACHE_DIR"  # environment: numba's folder, before its others


def keep_kernels(package: File) -> None:
    """Name a temporary folder to numba if it has no other: without one it refuses to compile."""
    if os.access(package / "kernels" / "__pycache__", os.W_OK):
        return  # the usual case
    given = os.environ.get(FOLDER)
    places = [package / "kernels" / "__pycache__", user_folder() / "numba"]
    kept_folder([File(given), *places] if given else places, FOLDER)


def kept_folder(places: list[File], variable: str) -> File:
    """The first folder that can be written to, else a temporary one, named in the environment.

    Processes that are started here use the same one; it is private, because what is in it is run,
    and removed at the end.
    """
    for place in places:
        if _writable(place):
            return place
    import atexit
    import shutil

    folder = tempfile.mkdtemp(prefix="der-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[variable] = folder
    say(
        "compiled kernels cannot be kept, they are compiled in each run: "
        f"set {variable} to a folder that can be written to"
    )
    return File(folder)


def say(text: str) -> None:
    """A line for the user, where there is somebody to read it."""
    if sys.stderr is not None:
        print(f"der: {text}", file=sys.stderr)


def user_folder() -> File:
    """The user's folder of caches, in which numba has its own."""
    home = File(os.path.expanduser("~"))
    if sys.platform == "win32":
        return File(os.environ.get("LOCALAPPDATA", home))
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    return File(os.environ.get("XDG_CACHE_HOME") or home / ".cache")


def _writable(folder: File) -> bool:
    """Whether a folder can be written to, or made: tried as numba does, rights do not tell all."""
    import tempfile

    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
