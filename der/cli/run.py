"""Runs a solver under a progress bar, writes its record, and prints the summary."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TypeAlias

from der.cli.kinds import text, unfinished, writers
from der.cli.output import OUTPUT, deliver, keep_somewhere, say, show

if TYPE_CHECKING:
    from der.cli.output import Targets
    from der.records.path import Path
    from der.scene import Scene
    from der.viz.rerun.recording import Live

Bar: TypeAlias = Callable[[Any, int], dict[str, Any]]  # of a value and the number of values so far
Tick: TypeAlias = Callable[[Any], object] | None  # None where nobody would see it
CODES = {"done": 0, "interrupted": 130}  # by status; 3: not converged


def run(
    solve: Callable[[Tick], Any],
    targets: Targets,
    *,
    bar: Bar | None = None,
    beside: Any = None,
    partial: Targets | None = None,
    quiet: bool,
) -> tuple[Any, int]:
    """Find a record, write it and what is drawn of it, and print its summary.

    Parameters
    ----------
    solve : finds the record; called with what moves the progress bar.
    targets : the files to write, by option.
    bar : what the progress bar shows; None: there is none.
    beside : what is shown with the record, see `writers`.
    partial : where a path goes that was left on the way; None: to the targets.

    Returns
    -------
    record, exit code
    """
    from der.errors import Interrupted, NotConverged

    try:
        with _progress(bar, quiet=quiet) as tick:
            found = solve(tick)
    except (NotConverged, Interrupted) as stopped:
        found = stopped.path
        targets = targets if partial is None else partial
    status = getattr(found, "status", "done")
    if status != "done":
        keep_somewhere(targets)
    code = max(CODES.get(status, 3), deliver(found, targets, writers(found, beside)))
    if status != "done":
        say(f"der: {unfinished(found, targets)}")
    if quiet or OUTPUT in targets.get("json", ()):
        return found, code
    return found, code if show(text(found)) else max(code, 3)


# --- Progress --------------------------------------------------------------------------------


def over_gamma(scene: Scene) -> Bar:
    """A bar over gamma."""
    return lambda gamma, states: {
        "completed": gamma,
        "total": scene.gamma_max,
        "description": f"gamma = {gamma:.3f}, {states} states",
    }


def counted(what: str, most: int) -> Bar:
    """A bar over things found."""
    return lambda found, _: {"completed": found, "total": most, "description": f"{found} {what}"}


@contextmanager
def _progress(bar: Bar | None, *, quiet: bool) -> Iterator[Tick]:
    """A progress bar on standard error, where that is a terminal: what moves it."""
    if bar is None or quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("loading kernels (compiled once, in half a minute)", total=None)
        count = 0

        def tick(value: float) -> None:
            nonlocal count
            count += 1
            progress.update(task, **bar(value, count))

        yield tick


# --- Watching --------------------------------------------------------------------------------


def served(port: int) -> Live:
    """A recording that can be watched while it is made; prints its address."""
    from der.viz.rerun.recording import Live

    live = Live(port)
    say(f"der: to watch, run: rerun {live.address}")
    return live


def keep_showing(live: Live, path: Path) -> None:
    """Serve the complete path until Ctrl-C."""
    with suppress(KeyboardInterrupt):
        live.finish(path)
        say("der: the recording can be watched until Ctrl-C")
        while True:
            time.sleep(3600.0)
