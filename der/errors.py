"""What can go wrong: one enum of reasons for every solver, and the exceptions that carry them."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # which takes long to load
    from der.records.path import Path


class Reason(Enum):
    """Why a solve, a step or a path ended; the value is advice for the reader, never parsed."""

    CONVERGED = "converged"
    TOO_MANY_ITERATIONS = "Newton's method did not converge; try a closer start"
    DIVERGED = "Newton's method left the neighbourhood of its start; try a smaller step"
    OUT_OF_RANGE = "turns or twists by more than 160 degrees; use more edges"
    SINGULAR = "the tangent matrix is singular to the last digit"
    TOO_SHARP = "the path turns too sharply"
    OTHER_BRANCH = "the path changes its orientation"
    NO_START = "the start is no equilibrium, or no minimum"
    TOO_MANY_STEPS = "the path has not ended after the steps allowed"
    BREAKS_SYMMETRY = "a mode breaks the symmetry of the sector; the sector 'full' follows it"
    NOT_AT_REST = "dynamic relaxation did not come to rest"
    NO_MINIMUM = "the ring came to rest in no minimum"
    INACCURATE = "the error left is above the tolerance"
    TURNED_BACK = (
        "gamma turns back before gamma_max, and the path runs to -gamma_max without arriving"
    )
    CLOSED = "the path is closed: it has returned to its start without arriving at gamma_max"
    UNFOLDED = (
        "gamma has left -4 pi to 4 pi, and the ring has not folded at pi; "
        "a larger gamma_max goes on"
    )
    FOLD_NEAR_PI = (
        "a fold lies within its error of pi, and which state arrives there first depends on the"
        " mesh; use more edges"
    )
    INTERRUPTED = "stopped by the user"

    @property
    def word(self) -> str:
        """The name as records have it: "turned_back"."""
        return self.name.lower()


# how the kernels of Newton's method end, by their numbers
REASONS = (
    Reason.CONVERGED,
    Reason.TOO_MANY_ITERATIONS,
    Reason.DIVERGED,
    Reason.OUT_OF_RANGE,
    Reason.SINGULAR,
)


class ContinuationFailed(RuntimeError):
    """A path that cannot be continued.

    Attributes
    ----------
    reason : why.
    """

    def __init__(self, message: str, reason: Reason) -> None:
        super().__init__(message)
        self.reason = reason


class NotConverged(RuntimeError):
    """A path that could not be followed to its end.

    Attributes
    ----------
    path : what was found, up to and with the last good state; ``path.reason`` says why it ended.
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
