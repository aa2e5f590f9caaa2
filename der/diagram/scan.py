"""Adaptive scans: a coarse grid of cases, refined where the labels of neighbours differ.

Nodes are points of the lattice of the finest level, (sheet, i, j) or (sheet, i, j, k); a cell is
its lowest node and its edge, a power of two. Where cells are refined depends only on
labels. So the result is the same for every order of the cases and number of workers, and after any
number of interruptions.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TypeAlias

from der.diagram.cases import Case, Row, failed, solve_case
from der.diagram.families import Family
from der.diagram.jobs import DEATHS, Jobs
from der.diagram.store import Store
from der.diagram.workers import Workers

Node: TypeAlias = tuple[str, tuple[int, ...]]
Cell: TypeAlias = tuple[Node, int]
Solve: TypeAlias = Callable[[Case], Row]
Batch: TypeAlias = tuple[Case, ...]
Level: TypeAlias = Callable[[int, int, int], Callable[[int], object] | None]

BATCH = 16  # cases a task: sending one costs as much as half a case, and a crash loses these


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in the middle of a scan; what was finished is in the store."""


@dataclass(frozen=True)
class Scan:
    """A finished scan.

    Attributes
    ----------
    family : what was scanned
    rows : of every node
    cells : that were not refined any further; those at the finest level may hold a boundary
    solved : how many cases were solved for it just now, the others having been in the store
    """

    family: Family
    rows: Mapping[Node, Row]
    cells: tuple[Cell, ...]
    solved: int = 0

    @cached_property
    def sorted_rows(self) -> tuple[Row, ...]:
        """Every case once, in the order of the nodes."""
        once = {self.rows[node].case: self.rows[node] for node in sorted(self.rows)}
        return tuple(once.values())

    @cached_property
    def mixed(self) -> tuple[Cell, ...]:
        """Cells of the finest level whose corners have different labels."""
        return tuple(cell for cell in self.cells if cell[1] == 1 and _mixed(cell, self.rows))


def scan(
    family: Family, store: Store, crew: Workers, *, solve: Solve = solve_case, progress: bool = True
) -> Scan:
    """Scan a family; cases that the store has are not solved again.

    Parameters
    ----------
    family : what to scan
    store : where every finished case is kept, at once
    crew : who solves
    solve : the row of a case; must pickle, and never raise
    progress : whether to show a bar, on a terminal

    Raises
    ------
    Interrupted
        At Ctrl-C.
    OSError
        If a row cannot be written.
    RuntimeError
        If workers die before they solve anything.
    """
    rows: dict[Node, Row] = {}
    leaves: set[Cell] = set()
    new = _first_cells(family)
    before = len(store)
    try:
        with _progress(family, shown=progress) as level:
            while new:
                nodes = sorted({node for cell in new for node in corners(cell)} - set(rows))
                cases = {node: _case(family, node) for node in nodes}
                todo = [
                    case for case in dict.fromkeys(cases.values()) if case.key not in store.rows
                ]
                tick = level(new[0][1], len(cases), len(todo))
                solve_all(todo, store, crew, solve=solve, tick=tick)
                rows.update((node, store.rows[case.key]) for node, case in cases.items())
                leaves.update(new)
                split = _to_split(family, leaves, new, nodes, rows)
                leaves -= split
                new = sorted(child for cell in split for child in _children(cell))
    except KeyboardInterrupt:
        crew.stop()
        raise Interrupted(f"{store.safe} cases are in {store.file}") from None
    return Scan(family, rows, tuple(sorted(leaves)), len(store) - before)


# --- The lattice -----------------------------------------------------------------------------


def corners(cell: Cell) -> list[Node]:
    """The 4 or 8 nodes at the corners of a cell; the last index varies fastest."""
    (sheet, low), edge = cell
    return [
        (sheet, tuple(i + edge * d for i, d in zip(low, offset, strict=True)))
        for offset in itertools.product((0, 1), repeat=len(low))
    ]


def _first_cells(family: Family) -> list[Cell]:
    edge = family.finest // family.coarse
    places = range(0, family.finest, edge)
    return [
        ((sheet, low), edge)
        for sheet in family.sheets
        for low in itertools.product(places, repeat=family.dimension)
    ]


def _children(cell: Cell) -> list[Cell]:
    half = cell[1] // 2
    return [(node, half) for node in corners((cell[0], half))]


def _to_split(
    family: Family, leaves: set[Cell], new: list[Cell], nodes: list[Node], rows: Mapping[Node, Row]
) -> set[Cell]:
    """Cells to refine: new ones that are mixed, and those with another label on their edges.

    The latter are larger than their neighbours, whose new nodes lie in the middle of their edges.
    """
    split = {cell for cell in new if cell[1] > 1 and _mixed(cell, rows)}
    for node in nodes:
        if rows[node].ok:
            for cell in _around(family, node):
                if cell in leaves and any(_differ(rows[node], rows[c]) for c in corners(cell)):
                    split.add(cell)
    return split


def _around(family: Family, node: Node) -> Iterator[Cell]:
    """All cells above the finest level that a node could touch."""
    sheet, place = node
    edge = family.finest // family.coarse
    while edge > 1:
        lows = [{i // edge * edge, (i - 1) // edge * edge} for i in place]
        for low in itertools.product(*lows):
            yield (sheet, low), edge
        edge //= 2


def _differ(one: Row, other: Row) -> bool:
    """Whether labels differ; a failed case says nothing."""
    return one.ok and other.ok and one.label != other.label


def _mixed(cell: Cell, rows: Mapping[Node, Row]) -> bool:
    """Whether the labels at the corners differ; a failed case says nothing."""
    found = [rows[node] for node in corners(cell)]
    return len({row.label for row in found if row.ok}) > 1


def _case(family: Family, node: Node) -> Case:
    sheet, place = node
    return family.case(sheet, [i / family.finest for i in place])


# --- Solving ---------------------------------------------------------------------------------


def solve_all(
    cases: Sequence[Case],
    store: Store,
    crew: Workers,
    *,
    solve: Solve = solve_case,
    tick: Callable[[int], object] | None = None,
) -> None:
    """Solve cases side by side; each row is in the store as soon as it is known.

    Where a worker dies, the cases that it may have had are solved again, one at a time; a case that
    ends its worker then, DEATHS times, is a failed row.

    Raises
    ------
    OSError
        If a row cannot be written.
    RuntimeError
        If workers die before they solve anything, or the executor has stopped.
    """
    jobs: Jobs[Case, list[Row]] = Jobs(crew, partial(_solve_batch, solve))
    jobs.add(batches(cases, crew.width))
    for batch, rows in jobs.done():
        store.add(given_up(batch) if rows is None else rows)
        if tick is not None:
            tick(len(batch))


def batches(cases: Sequence[Case], width: int) -> list[Batch]:
    """Cases in tasks: few enough that all workers end together."""
    size = min(BATCH, max(1, len(cases) // (4 * width)))
    return [tuple(cases[i : i + size]) for i in range(0, len(cases), size)]


def given_up(cases: Iterable[Case]) -> list[Row]:
    """Rows of cases that end their workers."""
    return [failed(case, f"its worker died, {DEATHS} times") for case in cases]


def _solve_batch(solve: Solve, batch: Batch) -> list[Row]:
    """What a worker does."""
    return [solve(case) for case in batch]


# --- Progress --------------------------------------------------------------------------------


@contextmanager
def _progress(family: Family, *, shown: bool) -> Iterator[Level]:
    """A progress bar with the time left, on a terminal; it yields what starts a level."""
    if not (shown and sys.stderr.isatty()):
        yield lambda edge, nodes, todo: None
        return
    from rich import progress
    from rich.console import Console

    columns = (
        *("{task.description}", progress.BarColumn(), progress.MofNCompleteColumn(), "cases,"),
        *(progress.TimeElapsedColumn(), "gone,", progress.TimeRemainingColumn(), "left"),
    )
    with progress.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(family.name, total=None)
        done = 0

        def level(edge: int, nodes: int, todo: int) -> Callable[[int], object]:
            rest = _ahead(family, edge, nodes)
            words = f"{family.name}, grid of 1/{family.finest // edge}"
            bar.update(task, total=done + todo + rest, description=words)
            return tick

        def tick(cases: int) -> None:
            nonlocal done
            done += cases
            bar.update(task, completed=done)

        yield level


def _ahead(family: Family, edge: int, nodes: int) -> int:
    """Cases of the levels to come, as a guess: boundaries are of one dimension less."""
    growth = 2 ** (family.dimension - 1)
    first = edge == family.finest // family.coarse
    levels = range(1, edge.bit_length())
    return sum((nodes // 2 * growth ** (k - 1)) if first else nodes * growth**k for k in levels)
