"""Compares a phase diagram whose runs are killed and resumed with one that is drawn in one run.

    python -m validation.stress.kill_and_resume [--times N] [--diagram NAME] [--finest N]
        [--workers N] [--seed N] [--out DIR]

runs ``der phase`` to its end. Then it draws the same diagram in another folder: its processes are
killed (SIGKILL, the complete group) at random times, resumed each time, and the last run finishes.
It says whether the tables are the same to the last byte, and how many cases were solved more than
once. Every worker notes each case that it begins, so that the number of cases in flight at a kill
is known, not estimated.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path as File

from der.diagram.cases import Case, Row, solve_case
from der.diagram.diagram import STORE, phase_diagram
from der.diagram.store import Store
from scenarios.output import Arguments

NOTES = "RING_ORIGAMI_NOTES"  # environment: the file that workers write to
TABLES = ("cases.csv", "boundaries.csv", "corners.csv")
EARLY = 0.2  # of the kills: while the run is starting
CALM = 0.1  # s without a note, after which no worker is left
PATIENCE = 30  # of these

Process = subprocess.Popen[str]


@dataclass(frozen=True)
class Killed:
    """The cost of the kills.

    Attributes
    ----------
    kills : how many hit a run; a run that had ended before is not counted
    cases : different ones that were begun
    begun : how often one was begun
    in_flight : begun by the run that was killed and not yet in the store, at each kill
    stored : cases in the store
    same : which tables are the same as those of the run that was not killed, by name
    """

    kills: int
    cases: int
    begun: int
    in_flight: tuple[int, ...]
    stored: int
    same: dict[str, bool]

    @property
    def again(self) -> int:
        """Cases begun more than once."""
        return self.begun - self.cases

    @property
    def ok(self) -> bool:
        """Whether all tables are the same, and only cases in flight were solved again."""
        once = self.stored == self.cases and self.again <= sum(self.in_flight)
        return once and all(self.same.values())

    def __str__(self) -> str:
        flight = f"{min(self.in_flight, default=0)} to {max(self.in_flight, default=0)}"
        same = "".join(
            f"{name}: {'the same' if ok else 'DIFFERENT'}\n" for name, ok in self.same.items()
        )
        return (
            f"{self.kills} kills; in flight at one: {flight}, {sum(self.in_flight)} in all\n"
            f"{self.cases} cases, of which {self.again} were begun more than once; "
            f"{self.stored} cases in the store\n{same}"
            f"{'as if there had been no kill' if self.ok else 'NOT as it should be'}"
        )


# --- Notes -----------------------------------------------------------------------------------


def noted(case: Case) -> Row:
    """`solve_case`, with a note as it begins."""
    # one write to the end of a file is complete, whoever else writes
    file = os.open(os.environ[NOTES], os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    try:
        os.write(file, f"{case.key}\n".encode())
    finally:
        os.close(file)
    return solve_case(case)


def notes(file: File) -> Counter[str]:
    """How often each case was begun."""
    return Counter(file.read_text().split()) if file.exists() else Counter()


def calm(file: File) -> bool:
    """Whether workers whose parent was killed stop working."""
    sizes = [-1]
    for _ in range(PATIENCE):
        sizes.append(file.stat().st_size if file.exists() else 0)
        if sizes[-1] == sizes[-2]:
            return True
        time.sleep(CALM)
    return False


# --- Kills -----------------------------------------------------------------------------------


def kill(process: Process, *, workers_too: bool = True) -> bool:
    """Kill a process that leads its group, by SIGKILL; whether it was still there."""
    there = process.poll() is None
    if there:
        if workers_too:
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    process.wait()
    if process.stderr is not None:
        process.stderr.close()
    return there


def lost(store: File, notes_file: File, before: Counter[str]) -> int:
    """How many cases were begun since ``before``, and are not in the store."""
    begun = notes(notes_file) - before
    if not store.exists():
        return begun.total()
    with Store(store) as safe:
        return sum(times for key, times in begun.items() if key not in safe.rows)


def kill_and_resume(
    start: Callable[[], Process],
    moments: Sequence[Callable[[Process], object]],
    store: File,
    notes_file: File,
) -> tuple[int, ...]:
    """Start runs and kill each at its moment, then let one finish; what was in flight at kills.

    Parameters
    ----------
    start : of a run that resumes, in a session of its own
    moments : each returns when its run is to be killed, or has ended
    store, notes_file : the run's store and the notes of its workers

    Raises
    ------
    RuntimeError
        If a run fails.
    """
    flight = []
    for moment in moments:
        before = notes(notes_file)
        process = start()
        moment(process)
        if kill(process):
            flight.append(lost(store, notes_file, before))
    process = start()
    _, words = process.communicate()
    if process.returncode:
        raise RuntimeError(f"a resumed run has failed: {words}")
    return tuple(flight)


# --- The command -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Wanted:
    """A diagram to be drawn in a process of its own."""

    diagram: str
    finest: int
    workers: int

    def start(self, folder: File, notes_file: File) -> Process:
        """Draw it in a folder, resuming what is there, with notes."""
        return subprocess.Popen(
            [
                sys.executable,
                "-c",
                f"from {__spec__.name} import *; {self!r}.draw({str(folder)!r})",
            ],
            env={**os.environ, NOTES: str(notes_file)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def draw(self, folder: str) -> None:
        """Draw it in this process, which may be killed."""
        phase_diagram(
            self.diagram,
            folder,
            workers=self.workers,
            finest=self.finest,
            resume=True,
            progress=False,
            solve=noted,
        )

    def draw_in_one_run(self, folder: File) -> None:
        """Draw it in a folder by the command, from nothing."""
        options = ["--finest", str(self.finest), "--workers", str(self.workers), "--quiet"]
        command = [sys.executable, "-m", "der", "phase", self.diagram, "--out", str(folder)]
        subprocess.run([*command, *options], check=True)


def killed(wanted: Wanted, folder: File, *, times: int, seed: int) -> Killed:
    """A diagram drawn in one run and in one killed so often, in two folders of ``folder``."""
    undisturbed, apart, notes_file = folder / "one_run", folder / "killed", folder / "begun.txt"
    began = time.monotonic()
    wanted.draw_in_one_run(undisturbed)
    taken = time.monotonic() - began
    draws = random.Random(seed)
    ready = _time_to_start(wanted, folder)
    share = 2.0 * max(taken - ready, 1.0) / times  # twice the mean: the kills cover the run

    def moment(process: Process) -> None:
        early = draws.random() < EARLY
        wait = draws.uniform(0.0, ready) if early else ready + draws.uniform(0.0, share)
        with suppress(subprocess.TimeoutExpired):
            process.wait(wait)

    flight = kill_and_resume(
        lambda: wanted.start(apart, notes_file), [moment] * times, apart / STORE, notes_file
    )
    begun = notes(notes_file)
    return Killed(
        len(flight),
        len(begun),
        begun.total(),
        flight,
        _stored(apart / STORE),
        {name: _same(undisturbed / name, apart / name) for name in TABLES},
    )


def _time_to_start(wanted: Wanted, folder: File) -> float:
    """Seconds until a run begins its first case."""
    notes_file = folder / "first.txt"
    began = time.monotonic()
    process = wanted.start(folder / "first", notes_file)
    while not notes_file.exists() and process.poll() is None:
        time.sleep(0.01)
    ready = time.monotonic() - began
    kill(process)
    return ready


def _stored(file: File) -> int:
    with Store(file) as store:
        return len(store)


def _same(one: File, other: File) -> bool:
    return one.exists() and other.exists() and one.read_bytes() == other.read_bytes()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; 0 if all is as it should be."""
    parser = Arguments(__file__, __doc__)
    parser.add_argument("--times", type=int, default=20, help="kills (20)")
    parser.add_argument("--diagram", default="fig3a", help="see der phase (fig3a)")
    parser.add_argument("--finest", type=int, default=16, help="cells along a side (16)")
    parser.add_argument("--workers", type=int, default=2, help="processes (2)")
    parser.add_argument("--seed", type=int, default=1, help="of the random times (1)")
    parser.add_argument("--out", metavar="DIR", help="keep everything here")
    given = parser.parse_args(arguments)
    for name in ("times", "workers"):
        if getattr(given, name) < 1:
            parser.error(f"{name} must be an integer from 1, got {getattr(given, name)}")
    with tempfile.TemporaryDirectory() as beside:
        folder = File(given.out or beside)
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            parser.error(f"out must be an empty folder, got {given.out!r}")
        wanted = Wanted(given.diagram, given.finest, given.workers)
        found = killed(wanted, folder, times=given.times, seed=given.seed)
    print(f"{given.diagram}, finest {given.finest}, {given.workers} workers: {found}")
    return 0 if found.ok else 1


if __name__ == "__main__":
    sys.exit(main())
