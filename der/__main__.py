"""The command `der`, also as `python -m der`."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType


def main() -> None:
    """Run the command and leave with its exit code.

    While its modules load there is nothing to be saved, and imports may lose an exception: Ctrl-C,
    or a request to end, ends at once.
    """
    usual = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in usual.items():
        if handler in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, _end)
    from der.cli.commands import main as run

    for number, handler in usual.items():
        signal.signal(number, handler)
    run()


def _end(number: int, frame: FrameType | None) -> None:
    """Say so in one line, and end the process."""
    if sys.stderr is not None:
        os.write(sys.stderr.fileno(), b"der: stopped by the user\n")
    os._exit(130)


if __name__ == "__main__":
    main()
