"""Where the command's answers go: files, checked before the work is done, and standard output."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path as File
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from der.record import Path

UNSAVED = File("der-unfinished.json")  # where an unfinished path goes if no file was named
OUTPUT = File("-")  # standard output


def say(line: str) -> None:
    """Print on standard error."""
    print(line, file=sys.stderr)


def show(text: str) -> bool:
    """Print on standard output; False, in words, where it takes no more."""
    try:
        print(text, flush=True)
    except OSError as wrong:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing more to flush
        if isinstance(wrong, BrokenPipeError):
            return True  # whoever read our output has had enough
        say(f"der: could not write to standard output: {wrong.strerror}")
        return False
    return True


def targets(
    json: str | None,
    plot: str | None,
    rrd: str | None,
    out: str | None,
    *,
    movie: str | None = None,
    html: str | None = None,
    stem: str = "path",
) -> dict[str, File]:
    """The files to write, after making sure that they can be written."""
    files: dict[str, File] = {}
    if out is not None:
        folder = File(out)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as wrong:
            raise ValueError(f"out must be a folder, got {out!r}: {wrong.strerror}") from None
        files = {
            "json": folder / f"{stem}.json",
            "plot": folder / f"{stem}.png",
            "shapes": folder / "shapes.npz",
        }
    if json is not None:
        files["json"] = File(json)
    if plot is not None:
        from der.view_plots import FORMATS

        if File(plot).suffix not in FORMATS:
            raise ValueError(f"plot must end in {', '.join(FORMATS)}, got {plot!r}")
        files["plot"] = File(plot)
    if rrd is not None:
        if File(rrd).suffix != ".rrd":
            raise ValueError(f"rrd must end in .rrd, got {rrd!r}")
        files["rrd"] = File(rrd)
    if movie is not None:
        from der.view_movie import check_movie

        check_movie(movie)
        files["movie"] = File(movie)
    if html is not None:
        from der.view_html import check_html

        check_html(html)
        files["html"] = File(html)
    if files.get("json") in [files[name] for name in files if name != "json"]:
        raise ValueError(f"json must be a file of its own, got {json!r} twice")
    for name, file in files.items():
        if file != OUTPUT:
            check_writable(name if name != "shapes" else "out", file)
    return files


def check_writable(name: str, file: File) -> None:
    """Raise ValueError where ``file`` cannot be written, before hours are spent on it."""
    if file.is_dir():
        raise ValueError(f"{name} must be a file, got the folder {str(file)!r}")
    if file.exists() and not file.is_file():  # it would be replaced by a file: /dev/null!
        raise ValueError(f"{name} must be a regular file, got {str(file)!r}")
    try:
        with tempfile.TemporaryFile(dir=file.parent):
            pass
    except OSError as wrong:
        raise ValueError(
            f"{name} must be a file in a folder that can be written to, got {str(file)!r}: "
            f"{wrong.strerror}"
        ) from None


def whereabouts(path: Path, targets: dict[str, File]) -> str:
    """Where an unfinished path went, and how far it got."""
    file = targets["json"]
    place = "on standard output" if file == OUTPUT else f"in {file}"
    if not len(path):
        return f"the record, without any state, is {place}"
    last = f"at gamma = {path.gamma[-1]:.8g}"
    return (
        f"the path up to its last good state, {last}, is {place}, its shapes in {targets['shapes']}"
    )


def kept(folder: str) -> Path:
    """The path that an earlier command has kept in its --out folder, with its shapes.

    Raises
    ------
    ValueError
        If there is none, or none with shapes.
    """
    from dataclasses import replace

    from der.record import Path
    from der.shapes import Shapes

    try:
        path = Path.load(File(folder) / "path.json")
        path = replace(path, shapes=Shapes.load(File(folder) / "shapes.npz"))
    except OSError as wrong:
        raise ValueError(
            f"beside must be a folder with path.json and shapes.npz, as --out writes, "
            f"got {folder!r}: {wrong.strerror}"
        ) from None
    except ValueError as wrong:
        raise ValueError(
            f"beside must be a folder as --out writes, got {folder!r}: {wrong}"
        ) from None
    if len(path) < 2:
        raise ValueError(f"beside must hold a path of two states at least, got {folder!r}")
    return path


def write(path: Path, targets: dict[str, File], other: Path | None = None) -> bool:
    """Write the record first, then what goes with it; say what could not be written.

    Where there is an ``other`` path, what moves shows it, too.

    A record that cannot be written where it should goes to standard output, also in ``targets``:
    nothing already computed is lost.
    """
    done = True
    shown = path if other is None else [path, other]
    for name in ("json", "shapes", "plot", "rrd", "html", "movie"):
        file = targets.get(name)
        if file is None:
            continue
        try:
            if name == "json" and file != OUTPUT:
                path.save(file)
            elif name == "shapes" and path.shapes is not None:
                path.shapes.save(file)
            elif name == "plot" and len(path) > 1:
                from der.view_plots import save_plot

                save_plot(path, file)
            elif name == "rrd" and len(path) > 1:
                from der.view_rerun import save_recording

                save_recording(shown, file)
            elif name == "html" and len(path) > 1:
                from der.view_html import save_html

                save_html(shown, file)
            elif name == "movie" and len(path) > 1:
                from der.view_movie import save_movie

                save_movie(shown, file)
        except (OSError, ValueError) as wrong:
            done = False
            say(f"der: could not write {file}: {wrong}")
            if name == "json":
                targets["json"] = OUTPUT
        if name == "json" and targets["json"] == OUTPUT:
            done = show(path.to_json()) and done
    return done
