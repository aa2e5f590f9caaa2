"""The command `der`: the list of its commands, and how it ends.

Exit codes: 0 done; 2 bad input, in one line that names the option, the value and what is allowed;
3 not converged, 130 stopped by Ctrl-C: the path up to its last good state is saved and named.
`compare` also ends with 3 where less than 90 % of the states are inside their error bars.
"""

from __future__ import annotations

import atexit
import signal
import sys
from typing import Annotated

import typer

from der.cli.clone import bench, stress
from der.cli.figures import figure, phase
from der.cli.landscapes import landscape
from der.cli.output import open_streams, say
from der.cli.parsing import add_command, application
from der.cli.paths import bvp, compare, fold
from der.cli.states import planar, states

COMMANDS = (fold, bvp, compare, figure, landscape, states, planar, phase, bench, stress)

app = application("Discrete elastic rods for rings that fold by twisting.")


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"der {version('ring-origami')}")
        raise typer.Exit


@app.callback()
def _top(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Discrete elastic rods for rings that fold by twisting."""


# options of a path that only `fold` takes, but for their default values
_OF_FOLD = ("control", "unload", "solver", "error_bars")
_REFUSED = {
    "bvp": (*_OF_FOLD, "stretch"),
    "compare": (*_OF_FOLD, "stretch"),
    "landscape": (*_OF_FOLD, "gamma_max"),
}
for _command in COMMANDS:
    add_command(app, _command, _REFUSED.get(_command.__name__, ()))


def main(arguments: list[str] | None = None) -> None:
    """Run the command and leave with its exit code."""
    leave(app, "der", sys.argv[1:] if arguments is None else arguments)


def leave(commands: typer.Typer, name: str, arguments: list[str]) -> None:
    """Run one of the commands and leave with its exit code; an error is one line."""
    from der.utils.interrupts import interrupts_heard

    open_streams()
    try:
        with interrupts_heard():
            code = _run(commands, name, arguments or ["--help"])
    except typer.TyperException as wrong:
        formatted = getattr(wrong, "format_message", None)
        text = formatted() if formatted else getattr(wrong, "message", str(wrong))
        say(f"{name}: {' '.join(text.split())}")
        code = 2
    except (typer.Abort, KeyboardInterrupt) as stopped:
        # a second Ctrl-C while the process ends would leave semaphores behind
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
        say(f"{name}: {str(stopped) or 'stopped by the user'}")
        code = 130
    except (OSError, RuntimeError) as wrong:  # a full disk; workers that cannot work
        say(f"{name}: {wrong}")
        code = 3
    sys.exit(code)


def _run(commands: typer.Typer, name: str, arguments: list[str]) -> int:
    """Run the command as typer does, which says nothing about Ctrl-C."""
    command = typer.main.get_command(commands)
    try:
        with command.make_context(name, list(arguments)) as context:
            code: int | None = command.invoke(context)
    except typer.Exit as done:
        code = done.exit_code
    return code or 0
