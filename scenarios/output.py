"""What every scenario leaves behind: the record, the shapes, the picture and the playback."""

from __future__ import annotations

import sys
from pathlib import Path as File

from der.record import Path
from der.summary import summary


def write(path: Path, name: str) -> None:
    """Write path.json, shapes.npz, path.png and path.rrd, and say so.

    They go to the folder named on the command line, or to out/NAME.
    """
    from der.view_plots import save_plot
    from der.view_rerun import save_recording

    folder = File(sys.argv[1] if len(sys.argv) > 1 else f"out/{name}")
    folder.mkdir(parents=True, exist_ok=True)
    path.save(folder / "path.json")
    if path.shapes is not None:
        path.shapes.save(folder / "shapes.npz")
        save_recording(path, folder / "path.rrd")
    save_plot(path, folder / "path.png")
    print(summary(path))
    print(f"written to {folder}")
