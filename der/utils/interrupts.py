"""Ctrl-C while compiled kernels run: delayed, noted between states, or ignored."""

from __future__ import annotations

import _thread
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

# Functions in which an exception is lost or ends the process. Numba's wrappers call the first when
# they return a kernel's results, and do not check whether it succeeded; a signal sent while the
# kernel ran arrives there. LLVM calls the others from C, which ignores exceptions.
UNHEARD = ("_numba_unpickle", "_raw_object_cache_notify", "_raw_object_cache_getbuffer")
MOMENT = 1e-3  # s
COMPILING = "_compile_for_args"  # numba's, below which kernels are compiled or loaded


def put_off(number: int, frame: FrameType | None) -> bool:
    """Whether a signal's handler must not raise here; the signal is then sent again soon after.

    Every handler that raises has to call this. An exception in numba's wrappers becomes a
    SystemError, or ends the process.
    """
    if not any(name in UNHEARD for name in _callers(frame)):
        return False
    # from another thread: sent at once, it would arrive in this handler again
    _thread.start_new_thread(_again, (number,))
    return True


def _again(number: int) -> None:
    """Send a signal's handler to the main thread once more."""
    time.sleep(MOMENT)
    _thread.interrupt_main(signal.Signals(number))


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt as Python's own handler does, but only where it is not lost."""
    if not put_off(number, frame):
        signal.default_int_handler(number, frame)


def _callers(frame: FrameType | None) -> Iterator[str]:
    """Names of the functions being called, the innermost first."""
    while frame is not None:
        yield frame.f_code.co_name
        frame = frame.f_back


@contextmanager
def interrupts_heard() -> Iterator[None]:
    """Let Ctrl-C raise KeyboardInterrupt while kernels run, for a program that then ends.

    A request to end, as batch systems send it, does the same: what is solved is kept.
    """
    ends = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    with (
        _handled_by(interrupt, allowed=_replaceable()),
        _handled_by(lambda *_: signal.raise_signal(signal.SIGINT), signal.SIGTERM, allowed=ends),
    ):
        yield


@contextmanager
def interrupts_between_states() -> Iterator[list[int]]:
    """Note Ctrl-C in a list, instead of raising; a second one raises at once.

    While kernels are compiled, which takes long, the first one also raises in a program that then
    ends. In other programs compilation continues, because numba cannot resume it.
    """
    pressed: list[int] = []
    ends = signal.getsignal(signal.SIGINT) is interrupt

    def take_down(number: int, frame: FrameType | None) -> None:
        if pressed or (ends and COMPILING in _callers(frame)):
            interrupt(number, frame)
        else:
            pressed.append(number)

    with _handled_by(take_down, allowed=_replaceable()):
        yield pressed


@contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Ignore Ctrl-C while workers are closed: a second one would leave semaphores behind."""
    # None: a handler that Python cannot set again
    with _handled_by(signal.SIG_IGN, allowed=signal.getsignal(signal.SIGINT) is not None):
        yield


@contextmanager
def _handled_by(
    handler: Callable[[int, FrameType | None], object] | signal.Handlers,
    number: int = signal.SIGINT,
    *,
    allowed: bool,
) -> Iterator[None]:
    """Set the handler of a signal, if that is allowed and in the main thread."""
    if not allowed or threading.current_thread() is not threading.main_thread():
        yield
        return
    usual = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, usual)


def _replaceable() -> bool:
    """Whether Python or `interrupt` handles Ctrl-C, and no handler of another program."""
    return signal.getsignal(signal.SIGINT) in (signal.default_int_handler, interrupt)
