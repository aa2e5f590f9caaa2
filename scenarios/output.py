"""What every scenario leaves behind: the record, the shapes, the picture and the playback."""

from __future__ import annotations

import sys
from pathlib import Path as File

from der.records.path import Path
from der.records.text import summary
from validation.arguments import Arguments


def usage(file: str, text: str | None) -> None:
    """Answer `--help` and refuse what is not known, before anything is solved.

    Parameters
    ----------
    file, text : the scenario's `__file__` and docstring.
    """
    parser = Arguments(file, text)
    where = f"where the results go (out/{File(file).stem})"
    parser.add_argument("folder", metavar="DIR", nargs="?", help=where)
    parser.parse_args()


def folder(name: str) -> File:
    """The folder named on the command line, or out/NAME; made if it is not there."""
    place = File(sys.argv[1] if len(sys.argv) > 1 else f"out/{name}")
    place.mkdir(parents=True, exist_ok=True)
    return place


def write(path: Path, name: str, *, stem: str = "path") -> None:
    """Write STEM.json, shapes.npz, STEM.png and STEM.rrd, and say so.

    They go to the `folder` of the scenario; the shapes are STEM.npz where STEM is not "path".
    """
    from der.viz.rerun.recording import save_recording

    place = folder(name)
    path.save(place / f"{stem}.json")
    if path.shapes is not None:
        path.shapes.save(place / ("shapes.npz" if stem == "path" else f"{stem}.npz"))
        save_recording(path, place / f"{stem}.rrd")
    path.plot(place / f"{stem}.png")
    print(summary(path))
    print(f"written to {place}")
