"""What a path that could not be finished leaves behind; the same for both solvers."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from der.record import Path


class NotConverged(RuntimeError):
    """A path that could not be followed to its end.

    Attributes
    ----------
    path : what was found, up to and with the last good state.
    """

    def __init__(self, message: str, path: Path) -> None:
        super().__init__(message)
        self.path = path


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in the middle of a path.

    Attributes
    ----------
    path : what was found, up to and with the last good state.
    """

    def __init__(self, path: Path) -> None:
        super().__init__("interrupted")
        self.path = path


@contextmanager
def interrupts_between_states() -> Iterator[list[int]]:
    """Take down Ctrl-C in a list, instead of raising; a second one raises at once.

    Numba's wrappers do not look for exceptions while they hand results over, so that one raised
    there would end the process, and all that was computed with it.
    """
    pressed: list[int] = []

    def take_down(number: int, frame: FrameType | None) -> None:
        if pressed:
            signal.default_int_handler(number, frame)
        pressed.append(number)

    usual = threading.current_thread() is threading.main_thread()
    if not usual or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield pressed
        return
    signal.signal(signal.SIGINT, take_down)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Ignore Ctrl-C while workers are put away: a second one would leave semaphores behind."""
    usual = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    if not usual or before is None:  # None: whoever set it can set it again, we cannot
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
