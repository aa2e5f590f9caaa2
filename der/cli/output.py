"""Writes records and pictures to files and to standard output, so that no result is lost."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path as File
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from der.records.path import Path
    from der.utils.files import Saved

UNSAVED = File("der-unfinished.json")  # for an unfinished record, if no file was named
OUTPUT = File("-")  # standard output
DRAWN = ("plot", "rrd", "html", "movie")  # the quick ones first

Targets: TypeAlias = dict[str, list[File]]  # by option, that of --out first
Writers: TypeAlias = Mapping[str, Callable[[File], object] | str]  # or why there is nothing to draw


def open_streams() -> None:
    """Put something in the place of closed streams, so that no file takes their numbers.

    What is said on standard error is then lost; the loss of an answer on standard output is told.
    """
    if sys.stdout is None:
        unread = os.open(os.devnull, os.O_RDONLY)  # to write to it is an error
        sys.stdout = os.fdopen(unread, "w", encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8")


def say(line: str) -> None:
    """Print on standard error, if that can be written to."""
    with suppress(OSError):
        print(line, file=sys.stderr)


def show(text: str) -> bool:
    """Print on standard output; False, and a line on standard error, if it takes no more."""
    encoding = sys.stdout.encoding or "utf-8"
    try:  # names of files may be no text
        print(text.encode(encoding, "backslashreplace").decode(encoding), flush=True)
    except OSError as wrong:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing more to flush
        if isinstance(wrong, BrokenPipeError):
            return True  # the reader of the output has closed it
        say(f"der: could not write to standard output: {wrong.strerror}")
        return False
    return True


# --- Files -----------------------------------------------------------------------------------


def keep_somewhere(targets: Targets) -> None:
    """Name files for the record and its shapes where the user has named none."""
    file = targets.setdefault("json", [UNSAVED])[-1]
    targets.setdefault("shapes", [(UNSAVED if file == OUTPUT else file).with_suffix(".npz")])


def places(targets: Targets, *, shapes: bool = False) -> str:
    """Where the record is, and the shapes."""
    words = ["on standard output" if file == OUTPUT else f"in {file}" for file in targets["json"]]
    where = " and ".join(words)
    return f"{where}, shapes in {_listed(targets['shapes'])}" if shapes else where


def whereabouts(path: Path, targets: Targets) -> str:
    """Where an unfinished path went, and how far it got."""
    if not len(path):
        return f"the record, without any state, is {places(targets)}"
    last = f"at gamma = {path.gamma[-1]:.8g}"
    return (
        f"the path up to its last good state, {last}, is {places(targets)}, "
        f"its shapes in {_listed(targets['shapes'])}"
    )


def deliver(record: Saved, targets: Targets, writers: Writers) -> int:
    """Write the record first, then its pictures, name what could not be written; the exit code.

    A record that no file takes goes to standard output, which ``targets`` then names. Where Ctrl-C
    stops the drawing, a record without a file is saved, too.
    """
    from der.utils.interrupts import interrupts_between_states

    with interrupts_between_states() as pressed:
        done = _keep(record, targets, writers)
    missing = [(name, file) for name in DRAWN for file in targets.get(name, ())]
    drawn: list[File] = []
    while missing and not pressed:
        name, file = missing[0]
        writer = writers[name]
        try:
            if isinstance(writer, str):
                say(f"der: {file} was not drawn: {writer}")
            elif _written(writer, file):
                drawn.append(file)
            else:
                done = False
            del missing[0]
        except KeyboardInterrupt:
            pressed.append(1)
    if not missing:
        return 0 if done else 3
    with interrupts_between_states():
        if "json" not in targets:
            keep_somewhere(targets)
            _keep(record, targets, writers)
    also = f"; written: {_listed(drawn)}" if drawn else ""
    lost = _listed(file for _, file in missing)
    say(f"der: stopped by the user; the record is {places(targets)}{also}; not written: {lost}")
    return 130


def _keep(record: Saved, targets: Targets, writers: Writers) -> bool:
    """Write the record and its shapes."""
    files = targets.get("json", [])
    good = [file for file in files if file == OUTPUT or _written(record.save, file)]
    done = len(good) == len(files)
    if files:
        targets["json"] = good or [OUTPUT]
        if OUTPUT in targets["json"]:
            done = show(record.to_json().rstrip()) and done
    writer = writers.get("shapes")
    if callable(writer):
        for file in targets.get("shapes", ()):
            done = _written(writer, file) and done
    return done


def _written(write: Callable[[File], object], file: File) -> bool:
    """Whether a file could be written; if not, a line on standard error says why."""
    try:
        write(file)
    except (OSError, ValueError) as wrong:
        if _stopped(wrong):
            raise KeyboardInterrupt from wrong
        say(f"der: could not write {file}: {wrong}")
        return False
    return True


def _stopped(wrong: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: it also stops programs that draw for us."""
    while wrong is not None:
        if isinstance(wrong, KeyboardInterrupt):
            return True
        wrong = wrong.__context__
    return False


def _listed(files: Iterable[File]) -> str:
    return ", ".join(str(file) for file in files)
