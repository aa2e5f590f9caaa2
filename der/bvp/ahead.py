"""The states of a path on one mesh: a kernel goes ahead, several steps at a time."""

from __future__ import annotations

from der.bvp.collocation import REASONS, Collocation, Error, Solution, solution_of, states_from
from der.bvp.events import Point, Wanted
from der.bvp.march import COSINE, ERROR, OTHER_BRANCH, TOO_SHARP, States, march
from der.bvp.step import Statistics, Step
from der.errors import ContinuationFailed, Reason

MOST = 16  # steps on one mesh, unless an error asks for another before
NO_STEP = REASONS | {TOO_SHARP: Reason.TOO_SHARP, OTHER_BRANCH: Reason.OTHER_BRANCH}


class Ahead:
    """The states from one on, on its mesh, and the length of the step after the last."""

    def __init__(self, system: Collocation, here: Solution, length: float) -> None:
        self.system, self.here, self.length = system, here, length
        self._states = states_from(here, MOST + 1)
        self._at, self._known = 0, 1

    @property
    def full(self) -> bool:
        """Whether there is no room for another step."""
        return self._at == MOST

    def step(
        self, wanted: Wanted, scale: tuple[float, float], statistics: Statistics
    ) -> tuple[Step, Point]:
        """The step from here, and its end.

        Parameters
        ----------
        scale : moment and energy that errors are relative to.

        Raises
        ------
        ContinuationFailed
            Where there is none.
        """
        k, states = self._at + 1, self._states
        if k == self._known:
            self._go(wanted, scale, statistics)
        end = solution_of(self.here.mesh, States._make(part[k] for part in states))
        *error, length, cosine = states.numbers[k, ERROR : COSINE + 1].tolist()
        step = Step(self.system, self.here, end, length, cosine, states, k, statistics)
        return step, Point(end, Error(*error))

    def _go(self, wanted: Wanted, scale: tuple[float, float], statistics: Statistics) -> None:
        """Go ahead from the last state, at least one step."""
        mesh = self.here.mesh
        meshes = mesh.h, mesh.rest, mesh.halved.h, mesh.halved.rest
        asked = self._known, self.length, wanted.tolerance, *scale, wanted.stops
        found = march(*self.system.sector.piece, *meshes, *asked, *self._states)
        known, status, self.length, iterations = found
        statistics.newton_iterations += iterations
        if known == self._known:
            reason = NO_STEP[status]
            message = f"no step forward from gamma = {self.here.gamma:.8f}: {reason.value}"
            raise ContinuationFailed(message, reason)
        self._known = known

    def move(self, end: Solution) -> None:
        """Go to the end of the step."""
        self._at, self.here = self._at + 1, end

    def repeat(self, length: float) -> None:
        """Forget what lies ahead, and go on with a step of another length."""
        self._known, self.length = self._at + 1, length
