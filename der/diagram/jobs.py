"""Tasks done by workers that may die: what was in flight then is done again."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any, Generic, TypeVar

from der.diagram.workers import Workers, died

T = TypeVar("T")
R = TypeVar("R")

AHEAD = 2  # tasks that wait or run, for each worker: so all are busy
DEATHS = 2  # of workers, each by the same single thing: it is given up
MOST_DEATHS = 8  # of workers in a row without a result between: they cannot work here


class Jobs(Generic[T, R]):
    """Things to work on, in batches; batches in flight; and suspects: things whose worker died.

    Parameters
    ----------
    crew : who works
    work : what a worker does with a batch; must pickle
    batches : tuples of different things
    """

    def __init__(
        self,
        crew: Workers,
        work: Callable[[tuple[T, ...]], R],
        batches: Iterable[tuple[T, ...]] = (),
    ) -> None:
        self._crew = crew
        self._work = work
        self._waiting = deque(batches)
        self._flight: dict[Future[R], tuple[T, ...]] = {}
        self._suspects: deque[T] = deque()
        self._tried: T | None = None  # the only thing in flight, where that is a suspect
        self._deaths: Counter[T] = Counter()
        self._condemned: list[T] = []  # held back until it is known that workers can work at all
        self._in_a_row = 0

    def add(self, batches: Iterable[tuple[T, ...]]) -> None:
        """Take more batches, also while others are done."""
        self._waiting.extend(batches)

    def done(self) -> Iterator[tuple[tuple[T, ...], R | None]]:
        """Batches and their results, as they are finished.

        Where a worker dies, the things that it may have had are tried again, one at a time. The
        result of one that ends its worker DEATHS times is None.

        Raises
        ------
        RuntimeError
            If workers die before they have done anything, or the executor has stopped.
        """
        while self._submit() or self._condemned:
            if not self._flight:
                yield from self._given_up()
            for found in self._collect():
                yield from self._given_up()
                yield found

    def _given_up(self) -> Iterator[tuple[tuple[T, ...], None]]:
        """What is condemned, once."""
        condemned, self._condemned = self._condemned, []
        for thing in condemned:
            yield (thing,), None

    def _submit(self) -> bool:
        """Submit batches; return whether anything is in flight."""
        room = AHEAD * self._crew.width
        while (batch := self._next(room)) is not None:
            try:
                self._flight[self._crew.executor.submit(self._work, batch)] = batch
            except Exception as problem:
                if not died(problem):
                    raise
                self._lose(batch)
                self._mend()
        return bool(self._flight)

    def _collect(self) -> Iterator[tuple[tuple[T, ...], R]]:
        """Wait, and give all batches that are finished."""
        done = wait(self._flight, return_when=FIRST_COMPLETED).done
        if any(_lost(task) for task in done):  # the pool is lost, with everything in flight
            done = wait(self._flight).done
        broken = False
        for task in done:
            batch = self._flight.pop(task)
            if _lost(task):
                self._lose(batch)
                broken = True
                continue
            found = task.result()
            self._tried, self._in_a_row = None, 0
            yield batch, found
        if broken:
            self._mend()

    def _next(self, room: int) -> tuple[T, ...] | None:
        """The next batch to submit: a suspect only when nothing else is in flight."""
        if self._suspects:
            if self._flight:
                return None
            self._tried = self._suspects.popleft()
            return (self._tried,)
        if self._waiting and self._tried is None and len(self._flight) < room:
            return self._waiting.popleft()
        return None

    def _lose(self, batch: tuple[T, ...]) -> None:
        """Take note of a batch whose worker died."""
        if self._tried is None:
            self._suspects.extend(batch)
            return
        thing, self._tried = self._tried, None
        self._deaths[thing] += 1
        if self._deaths[thing] < DEATHS:
            self._suspects.appendleft(thing)
        else:
            self._condemned.append(thing)

    def _mend(self) -> None:
        self._in_a_row += 1
        if self._in_a_row >= MOST_DEATHS:
            raise RuntimeError("workers die before they have solved anything")
        self._crew.restart()


def _lost(task: Future[Any]) -> bool:
    """Whether a finished task's worker died.

    Raises
    ------
    RuntimeError
        If the executor has cancelled the task.
    """
    if task.cancelled():
        raise RuntimeError("the scheduler has stopped, or has cancelled tasks")
    problem = task.exception()
    return problem is not None and died(problem)
