"""From a command's scene to its answer: solved under a progress bar, written, told."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING

from der.cli.output import OUTPUT, deliver, keep_somewhere, places, say, show, whereabouts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from der.cli.output import Record, Targets, Writers
    from der.records.path import Path
    from der.scene import Scene
    from der.viz.rerun.recording import Live


def follow(
    run: Callable[[Callable[[float], object] | None], Path],
    scene: Scene,
    written: Targets,
    other: Path | None,
    *,
    quiet: bool,
) -> tuple[Path, int]:
    """Follow the path, write what was asked for, and return it with the exit code.

    Where ``other`` is given, what moves shows it, too.
    """
    from der.errors import Interrupted, NotConverged

    code = 0
    try:
        with progress(scene, quiet=quiet) as tick:
            path = run(tick)
    except (NotConverged, Interrupted) as unfinished:
        path = unfinished.path
        code = 3 if isinstance(unfinished, NotConverged) else 130
    return path, finish(path, written, code, other, quiet=quiet)


def finish(
    path: Path, written: Targets, code: int, other: Path | None = None, *, quiet: bool
) -> int:
    """Write a path, finished or not, say what there is to say, and return the exit code."""
    from der.cli.drawings import of_path
    from der.records.text import summary

    if path.status != "done":
        keep_somewhere(written)
    code = max(code, deliver(path, written, of_path(path, other)))
    if path.status != "done":
        say(f"der: {path.message}; {whereabouts(path, written)}")
    return _tell(lambda: summary(path), written, code, quiet=quiet)


def hand_over(
    found: Record,
    written: Targets,
    code: int,
    writers: Writers,
    text: Callable[[], str],
    *,
    unfinished: str = "",
    quiet: bool,
) -> int:
    """Write an answer and what is drawn of it, say what there is to say; the exit code.

    ``unfinished`` begins the line that says where what was found of it is.
    """
    if code:
        keep_somewhere(written)
    written_code = deliver(found, written, writers)
    if code:
        say(f"der: {unfinished} {places(written, shapes='shapes' in writers)}")
    return _tell(text, written, max(code, written_code), quiet=quiet)


def _tell(text: Callable[[], str], written: Targets, code: int, *, quiet: bool) -> int:
    """Print the summary of an answer, where output is not the record's; the exit code."""
    if quiet or OUTPUT in written.get("json", ()):
        return code
    return code if show(text()) else max(code, 3)


def served(port: int) -> Live:
    """What is watched while it is made, its address told."""
    from der.viz.rerun.recording import Live

    live = Live(port)
    say(f"der: to watch, run: rerun {live.address}")
    return live


def keep_showing(live: Live, path: Path) -> None:
    """Serve the whole film until Ctrl-C."""
    with suppress(KeyboardInterrupt):
        live.finish(path)
        say("der: the film can be watched until Ctrl-C")
        while True:
            time.sleep(3600.0)


@contextmanager
def progress(scene: Scene, *, quiet: bool) -> Iterator[Callable[[float], object] | None]:
    """A progress bar over gamma, on a terminal only."""
    with _bar(None, quiet=quiet) as update:
        if update is None:
            yield None
            return
        states = 0

        def tick(gamma: float) -> None:
            nonlocal states
            states += 1
            text = f"gamma = {gamma:.3f}, {states} states"
            update(completed=gamma, total=scene.gamma_max, description=text)

        yield tick


@contextmanager
def counted(what: str, most: int, *, quiet: bool) -> Iterator[Callable[[int], object] | None]:
    """A progress bar over things found, on a terminal only."""
    with _bar(most, quiet=quiet) as update:
        if update is None:
            yield None
        else:
            yield lambda found: update(completed=found, description=f"{found} {what}")


@contextmanager
def _bar(total: float | None, *, quiet: bool) -> Iterator[Callable[..., object] | None]:
    """What moves a progress bar on standard error; None where nobody would see it."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("loading kernels (compiled once, in half a minute)", total=total)
        yield partial(bar.update, task)
