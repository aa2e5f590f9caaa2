"""Searches that ask: what a search needs is done for it, many things at a time and anywhere.

A search is a generator. It yields questions, a case or a call of a function, and is sent their
answers, the row of the case or what the function returns. So one thread of one process leads the
searches of all slices, and workers have their questions.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

from der.diagram.cases import Case, Row, solve_case

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Call:
    """A call of a function; both must pickle. No two are equal."""

    work: Callable[..., Any]
    given: tuple[Any, ...]

    def __call__(self) -> Any:
        """Do it."""
        return self.work(*self.given)


Question: TypeAlias = Case | Call
Search: TypeAlias = Generator[Sequence[Question], list[Any], T]


def call(work: Callable[..., T], *given: Any) -> Search[T]:
    """Ask for a call."""
    (answer,) = yield [Call(work, given)]
    result: T = answer
    return result


def rows_of(cases: Sequence[Case]) -> Search[list[Row]]:
    """Ask for the rows of cases."""
    return (yield cases) if cases else []


def answer(solve: Callable[[Case], Row], question: Question) -> Any:
    """What a worker does."""
    return question() if isinstance(question, Call) else solve(question)


def answered(search: Search[T], solve: Callable[[Case], Row] = solve_case) -> T:
    """What a search finds, in this process."""
    answers: Any = None
    while True:
        try:
            asked = search.send(answers)
        except StopIteration as end:
            found: T = end.value
            return found
        answers = [answer(solve, question) for question in asked]
