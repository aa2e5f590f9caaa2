"""One run loop for every analysis: Ctrl-C, failure, time and status.

with Run() as run:
    points = run.collect(follow(...), progress)
run.status, run.message, run.reason, run.seconds
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from der.errors import ContinuationFailed, Interrupted, NotConverged, Reason
from der.utils.interrupts import interrupts_between_states

if TYPE_CHECKING:
    from der.records.path import Path

T = TypeVar("T")
R = TypeVar("R", bound=Any)


class Run:
    """The status of an analysis: "done", "not converged" or "interrupted", and why.

    Ctrl-C is noted and takes effect between two states; a second one takes effect at once. Points
    found before are always kept.
    """

    def __init__(self) -> None:
        self.status = "done"
        self.message = ""
        self.reason: Reason | None = None
        self.started = time.perf_counter()
        self._pressed: list[int] = []
        self._stack = ExitStack()

    def __enter__(self) -> Run:
        self._pressed = self._stack.enter_context(interrupts_between_states())
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        if self._pressed:
            self.stop(Reason.INTERRUPTED)

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return time.perf_counter() - self.started

    @property
    def pressed(self) -> bool:
        """Whether Ctrl-C was pressed and has not taken effect yet."""
        return bool(self._pressed)

    @property
    def done(self) -> bool:
        """Whether the analysis has not been stopped so far."""
        return self.status == "done" and not self._pressed

    def stop(self, reason: Reason, message: str = "") -> None:
        """Note why the analysis has ended early."""
        self.status = "interrupted" if reason is Reason.INTERRUPTED else "not converged"
        self.reason, self.message = reason, message or reason.value

    def note(self, reason: Reason) -> None:
        """Note something that a reader should know of an analysis that is done."""
        self.reason, self.message = reason, reason.value

    def prepare(self, work: Callable[[], object]) -> None:
        """Do work that does not count as time of the analysis, such as loading kernels."""
        self.attempt(work)
        self.started = time.perf_counter()

    def answer(self, path: Path) -> Path:
        """Return the record of a path that was followed to its end.

        Raises
        ------
        Interrupted, NotConverged
            With the path so far.
        """
        if self.status == "interrupted":
            raise Interrupted(self.marked(path))
        if self.status == "not converged":
            raise NotConverged(self.message, path)
        return path

    def marked(self, record: R) -> R:
        """Return a record with the present status of the analysis."""
        assert self.reason is not None
        ending = {"status": self.status, "message": self.message, "reason": self.reason.word}
        return replace(record, **ending)

    def collect(self, found: Iterable[T], progress: Callable[[T], object] | None = None) -> list[T]:
        """Return everything that ``found`` yields, until it fails or Ctrl-C is pressed."""
        kept: list[T] = []
        if self.status != "done":
            return kept

        def keep() -> None:
            for one in found:
                kept.append(one)
                if progress is not None:
                    progress(one)
                if self._pressed:
                    raise KeyboardInterrupt

        self.attempt(keep)
        return kept

    def attempt(self, work: Callable[[], T]) -> T | None:
        """Return the result of ``work``; None, with a status, if it fails or is stopped."""
        try:
            return work()
        except ContinuationFailed as failed:
            self.stop(failed.reason, str(failed))
        except KeyboardInterrupt:
            self._pressed.clear()  # one more must not lose the points found
            self.stop(Reason.INTERRUPTED)
        return None
