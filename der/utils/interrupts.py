"""Ctrl-C while compiled kernels run: put off, taken down between states, or ignored."""

from __future__ import annotations

import _thread
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

# Functions in which an exception is lost or ends the process: numba's wrappers call the first while
# they hand a kernel's results over, and do not look whether it succeeded; that is where a signal
# arrives that came while the kernel ran. LLVM calls the others from C, which ignores exceptions.
UNHEARD = ("_numba_unpickle", "_raw_object_cache_notify", "_raw_object_cache_getbuffer")
MOMENT = 1e-3  # s
COMPILING = "_compile_for_args"  # numba's, below which kernels are compiled or loaded


def put_off(number: int, frame: FrameType | None) -> bool:
    """Whether a signal's handler may not raise here; the signal then comes again, a moment later.

    To be asked by every handler that raises. Numba's wrappers answer an exception with a
    SystemError, or die of it.
    """
    if not any(name in UNHEARD for name in _callers(frame)):
        return False
    # from another thread: at once it would arrive in this handler, and so on
    _thread.start_new_thread(_again, (number,))
    return True


def _again(number: int) -> None:
    """Send a signal's handler to the main thread once more."""
    time.sleep(MOMENT)
    _thread.interrupt_main(signal.Signals(number))


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt as Python's own handler does, but where it will be heard."""
    if not put_off(number, frame):
        signal.default_int_handler(number, frame)


def _callers(frame: FrameType | None) -> Iterator[str]:
    """Names of the functions being called, the innermost first."""
    while frame is not None:
        yield frame.f_code.co_name
        frame = frame.f_back


@contextmanager
def interrupts_heard() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt where kernels run, too, for a program that then ends."""
    with _answered_by(interrupt):
        yield


@contextmanager
def interrupts_between_states() -> Iterator[list[int]]:
    """Take down Ctrl-C in a list, instead of raising; a second one raises at once.

    In a program that then ends so does the first while kernels are being compiled, which takes
    long; elsewhere compiling goes on, for numba cannot take up again what was broken off.
    """
    pressed: list[int] = []
    ends = signal.getsignal(signal.SIGINT) is interrupt

    def take_down(number: int, frame: FrameType | None) -> None:
        if pressed or (ends and COMPILING in _callers(frame)):
            interrupt(number, frame)
        else:
            pressed.append(number)

    with _answered_by(take_down):
        yield pressed


@contextmanager
def _answered_by(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Have a function answer Ctrl-C, unless somebody else already does."""
    usual = signal.getsignal(signal.SIGINT)
    ours = threading.current_thread() is threading.main_thread()
    if not ours or usual not in (signal.default_int_handler, interrupt):
        yield
        return
    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)


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
