"""Where numba keeps compiled kernels: a temporary folder, where no other can be written to."""

from __future__ import annotations

import os
import sys
from pathlib import Path as File

FOLDER = "NUMBA_CACHE_DIR"  # environment: numba's folder, before its others


def keep_kernels(package: File) -> None:
    """Name a temporary folder to numba if it has no other: without one it refuses to compile.

    Called before numba is imported. Processes that are started here use the same folder; it is
    private, because what is in it is run, and removed at the end.
    """
    if os.access(package / "kernels" / "__pycache__", os.W_OK):
        return  # the usual case
    given = os.environ.get(FOLDER)
    places = [package / "kernels" / "__pycache__", _of_user() / "numba"]
    if any(map(_writable, [File(given), *places] if given else places)):
        return
    import atexit
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="der-kernels-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[FOLDER] = folder
    if sys.stderr is not None:
        print(
            "der: compiled kernels cannot be kept, they are compiled in each run: "
            f"set {FOLDER} to a folder that can be written to",
            file=sys.stderr,
        )


def _of_user() -> File:
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
