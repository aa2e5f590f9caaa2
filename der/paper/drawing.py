"""Figures drawn side by side: one process each, one thread a process."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path as File

from der.diagram.workers import one_thread_each, processes
from der.utils.files import FilePath


@dataclass(frozen=True)
class Drawn:
    """The results of drawing figures, by name.

    Attributes
    ----------
    written : their files
    failed : their errors, in a sentence each
    """

    written: Mapping[str, list[File]]
    failed: Mapping[str, str]


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while figures are drawn; its text says what is kept of one that was not finished.

    Attributes
    ----------
    drawn : those that were finished.
    """

    def __init__(self, drawn: Drawn, kept: str = "") -> None:
        super().__init__(kept)
        self.drawn = drawn


def draw_all(
    figures: Mapping[str, Callable[[FilePath], list[File]]],
    folder: FilePath,
    workers: int | None = None,
) -> Drawn:
    """Draw figures, each a function that pickles and returns the files that it wrote.

    Raises
    ------
    ValueError
        For a number of workers below 1, or a folder that does not exist and cannot be made.
    Interrupted
        At Ctrl-C; it has the figures that were finished.
    """
    workers = processes(workers)
    _make(folder)
    written: dict[str, list[File]] = {}
    failed: dict[str, str] = {}
    drawn = Drawn(written, failed)
    if not figures:
        return drawn
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        min(workers, len(figures)), multiprocessing.get_context("spawn"), _ignore_ctrl_c
    )
    try:
        with one_thread_each():
            tasks = {pool.submit(figure, folder): name for name, figure in figures.items()}
        for task in _with_progress(tasks):
            problem = task.exception()
            if problem is None:
                written[tasks[task]] = task.result()
            else:
                failed[tasks[task]] = f"{type(problem).__name__}: {problem}"
    except KeyboardInterrupt:
        for worker in set(multiprocessing.active_children()) - others:
            worker.terminate()
        raise Interrupted(drawn) from None
    finally:
        pool.shutdown(cancel_futures=True)
    return drawn


def _make(folder: FilePath) -> None:
    """Make the folder unless it exists."""
    try:
        File(folder).mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(
            f"folder must be one that can be made, got {os.fspath(folder)!r}: {reason}"
        ) from problem


def _ignore_ctrl_c() -> None:
    """Ignore Ctrl-C, which the parent handles; end by an exception, so that files are removed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))


def _with_progress(tasks: Mapping[Future[list[File]], str]) -> Iterator[Future[list[File]]]:
    """The tasks as they finish, with a progress bar on a terminal."""
    if not sys.stderr.isatty():
        yield from as_completed(tasks)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("figures"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    last = TextColumn("{task.description}")
    with Progress(*columns, last, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("", total=len(tasks))
        for task in as_completed(tasks):
            progress.update(bar, advance=1, description=tasks[task])
            yield task
