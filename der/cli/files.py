"""Options for files, and the files themselves, checked before the work begins.

Every command has its own group of them; `targets` turns any group into files by option.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

from der.cli.output import OUTPUT, Targets
from der.cli.parsing import file_option, folder_option, option

if TYPE_CHECKING:
    from der.records.path import Path


@dataclass(frozen=True)
class PathFiles:
    """What is written of a path."""

    json: str | None = file_option("Write the record here ('-': output).")
    plot: str | None = file_option("Draw the path: .png, .pdf or .svg.")
    rrd: str | None = file_option("Record for playback with rerun: .rrd.")
    movie: str | None = file_option("Animate it: .gif, or .mp4 (needs ffmpeg).")
    html: str | None = file_option("A page to scrub in any browser: .html.")
    beside: str | None = folder_option("Show the ring of this --out DIR, too, where it moves.")
    forces: bool = option("Forces and moments of grips and arms: record, picture, shapes.", False)
    out: str | None = folder_option("Write path.json, path.png and shapes.npz here.")
    quiet: bool = option("No progress and no summary.", False)

    @property
    def moving(self) -> bool:
        """Whether something is written that shows how the ring moves."""
        return any(file is not None for file in (self.rrd, self.movie, self.html))

    @property
    def drawn(self) -> bool:
        """Whether shapes are needed."""
        return self.moving or any(file is not None for file in (self.plot, self.out))

    def other(self) -> Path | None:
        """The path that is to be shown beside this one."""
        if self.beside is None:
            return None
        if not self.moving:
            raise ValueError(
                f"beside must go with --rrd, --movie or --html, got {self.beside!r} alone"
            )
        return kept(self.beside)


@dataclass(frozen=True)
class ComparisonFiles:
    """What a comparison writes."""

    json: str | None = file_option("Write both records and differences here.")
    plot: str | None = file_option("Draw both: .png, .pdf or .svg.")
    out: str | None = folder_option("Write comparison.json and .png here.")
    quiet: bool = option("No progress and no table.", False)


@dataclass(frozen=True)
class LandscapeFiles:
    """What is written of a landscape."""

    json: str | None = file_option("Write it here ('-': output).")
    plot: str | None = file_option("Draw it: .png, .pdf, .svg.")
    rrd: str | None = file_option("Record it with the ring for playback with rerun: .rrd.")
    out: str | None = folder_option("Write landscape.json and .png here.")
    quiet: bool = option("No progress and no summary.", False)


@dataclass(frozen=True)
class StatesFiles:
    """What is written of states."""

    json: str | None = file_option("Write it here ('-': output).")
    plot: str | None = file_option("Draw it: .png, .pdf, .svg.")
    out: str | None = folder_option("Write states.json, .png and shapes.npz here.")
    quiet: bool = option("No progress and no summary.", False)


@dataclass(frozen=True)
class PlanarFiles:
    """What is written of planar states."""

    json: str | None = file_option("Write it here ('-': output).")
    plot: str | None = file_option("Draw it: .png, .pdf, .svg.")
    out: str | None = folder_option("Write planar.json, .png and shapes.npz here.")
    quiet: bool = option("No summary.", False)


# --- Before the work -------------------------------------------------------------------------


def targets(options: Any, stem: str, *, shapes: bool = False) -> Targets:
    """The files to write, after making sure that they can be written.

    Parameters
    ----------
    options : of files, one of the groups above.
    stem : name of the files in the folder of --out, which are complete whatever else is named.
    shapes : whether shapes.npz is one of them.

    Raises
    ------
    ValueError
        If a file has not the suffix that is needed, or cannot be written.
    """
    names = ("json", "plot", "rrd", "movie", "html")
    named = {name: getattr(options, name, None) for name in names}
    check_named(**named, out=options.out)
    _check_suffixes(named)
    if options.out is None:
        return _checked(named, {})
    with made_folder(options.out) as folder:
        files: Targets = {"json": [folder / f"{stem}.json"], "plot": [folder / f"{stem}.png"]}
        if shapes:
            files["shapes"] = [folder / "shapes.npz"]
        return _checked(named, files)


def _checked(named: dict[str, str | None], files: Targets) -> Targets:
    """The files of a folder and those named, after making sure that they can be written."""
    for name, given in named.items():
        if given is not None and File(given) not in files.setdefault(name, []):
            files[name].append(File(given))
    others = [file for name, some in files.items() if name != "json" for file in some]
    for file in files.get("json", []):
        if file in others:
            raise ValueError(f"json must be a file of its own, got {str(file)!r} twice")
    for name, some in files.items():
        for file in some:
            if file != OUTPUT:
                check_writable(name if name != "shapes" else "out", file)
    return files


def check_named(**given: str | None) -> None:
    """Raise ValueError where there is no name, or the next option was taken for one."""
    for name, value in given.items():
        if value is None or (name, value) == ("json", "-"):
            continue
        if not value or value.startswith("-"):
            raise ValueError(f"{name} must be a file name, got {value!r}")


@contextmanager
def made_folder(out: str) -> Iterator[File]:
    """The folder of --out, made if it is not there, and not left behind where it is refused."""
    folder = File(out)
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as wrong:
        raise ValueError(f"out must be a folder, got {out!r}: {wrong.strerror}") from None
    try:
        yield folder
    except ValueError:
        with suppress(OSError):  # of one that is not empty
            for one in made:
                one.rmdir()
        raise


def _check_suffixes(named: dict[str, str | None]) -> None:
    """Raise ValueError where a name does not say the format that is written."""
    plot, rrd, movie, html = (named[name] for name in ("plot", "rrd", "movie", "html"))
    if plot is not None:
        from der.viz.plots.style import FORMATS

        if File(plot).suffix not in FORMATS:
            raise ValueError(f"plot must end in {', '.join(FORMATS)}, got {plot!r}")
    if rrd is not None and File(rrd).suffix != ".rrd":
        raise ValueError(f"rrd must end in .rrd, got {rrd!r}")
    if movie is not None:
        from der.viz.movie import check_movie

        check_movie(movie)
    if html is not None:
        from der.viz.html import check_html

        check_html(html)


def check_writable(name: str, file: File) -> None:
    """Raise ValueError where ``file`` cannot be written, before hours are spent on it."""
    if file.is_dir():
        raise ValueError(f"{name} must be a file, got the folder {str(file)!r}")
    if file.exists() and not file.is_file():  # it would be replaced by a file: /dev/null!
        raise ValueError(f"{name} must be a regular file, got {str(file)!r}")
    try:
        with suppress(FileNotFoundError):
            file.stat()  # not of a link to itself, nor with too long a name
        with tempfile.TemporaryFile(dir=File(os.path.realpath(file)).parent):
            pass
    except OSError as wrong:
        raise ValueError(
            f"{name} must be a file in a folder that can be written to, got {str(file)!r}: "
            f"{wrong.strerror}"
        ) from None


def kept(folder: str) -> Path:
    """The path that an earlier command has kept in its --out folder, with its shapes.

    Raises
    ------
    ValueError
        If there is none, or none with shapes.
    """
    from dataclasses import replace

    from der.records.configurations import Shapes
    from der.records.path import Path

    check_named(beside=folder)
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
