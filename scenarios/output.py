"""What scenarios share: arguments of the command line, folders, and files of results."""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    import der
    from der.records.record import Record


class Arguments(argparse.ArgumentParser):
    """The parser of a module: its docstring is the help; an error is one line and exit code 2.

    Parameters
    ----------
    file, text : the module's `__file__` and docstring.
    """

    def __init__(self, file: str, text: str | None) -> None:
        place = File(file).resolve().relative_to(File(__file__).resolve().parents[1])
        self.name = place.stem
        super().__init__(
            prog=f"python -m {'.'.join(place.with_suffix('').parts)}",
            description=text,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    def error(self, message: str) -> NoReturn:
        """Leave with one line."""
        self.exit(2, f"{self.prog}: {message}\n")

    def parse(self, **options: object) -> argparse.Namespace:
        """Integers and flags by name with their defaults, and --out, a folder, which is made."""
        for name, default in options.items():
            if default is False:
                self.add_argument(f"--{name}", action="store_true")
            else:
                self.add_argument(f"--{name}", type=int, default=default)
        self.add_argument("--out", type=File, default=File(f"out/{self.name}"))
        asked = self.parse_args()
        asked.out.mkdir(parents=True, exist_ok=True)
        return asked


def usage(file: str, text: str | None) -> None:
    """Answer `--help` and refuse unknown arguments, before anything is solved.

    Parameters
    ----------
    file, text : the scenario's `__file__` and docstring.
    """
    parser = Arguments(file, text)
    where = f"where the results go (out/{parser.name})"
    parser.add_argument("folder", metavar="DIR", nargs="?", help=where)
    parser.parse_args()


def folder(name: str) -> File:
    """The folder named on the command line, or out/NAME; made if it is not there."""
    place = File(sys.argv[1] if len(sys.argv) > 1 else f"out/{name}")
    place.mkdir(parents=True, exist_ok=True)
    return place


def keep(record: Record, place: File, stem: str) -> None:
    """Write a record and its picture to STEM.json and STEM.png in a folder."""
    record.save(place / f"{stem}.json")
    record.plot(place / f"{stem}.png")


def write(path: der.Path, name: str, *, stem: str = "path") -> None:
    """Write STEM.json, shapes.npz, STEM.png and STEM.rrd, and say so.

    They go to the `folder` of the scenario; the shapes are STEM.npz where STEM is not "path".
    """
    from der.records.text import summary
    from der.viz.rerun.recording import save_recording

    place = folder(name)
    keep(path, place, stem)
    if path.shapes is not None:
        path.shapes.save(place / ("shapes.npz" if stem == "path" else f"{stem}.npz"))
        save_recording(path, place / f"{stem}.rrd")
    print(summary(path))
    print(f"written to {place}")


def write_table(file: File, columns: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Write rows as CSV."""
    with file.open("w", newline="") as opened:
        table = csv.writer(opened)
        table.writerow(columns)
        table.writerows(rows)
