"""Adaptive scans that lose nothing: whatever dies, resuming gives what an undisturbed run gives."""

import errno
import json
import math
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import pytest
from here import Here
from toy_cases import (
    CUBE,
    NOTES,
    POISON,
    TOY,
    along_that_dies_once,
    along_with_poison,
    deadly,
    toy,
    toy_that_dies_once,
    toy_with_notes,
    toy_with_poison,
    wedge,
)

from der.diagram.cases import Row, solve_case
from der.diagram.distributed import follow
from der.diagram.families import family
from der.diagram.jobs import AHEAD
from der.diagram.scan import BATCH, Interrupted, corners, scan, solve_all
from der.diagram.store import SCHEMA, Store
from der.diagram.workers import Cluster, Processes, workers
from validation.stress.kill_and_resume import Killed, calm, kill, kill_and_resume, notes

TESTS = Path(__file__).parent.parent
SMALL = {"b_over_a": (0.9, 1.0), "h_over_t": (1.4, 2.0)}  # of fig3a: three labels, both axes


def small():
    return replace(family("fig3a", ranges=SMALL, finest=4), coarse=2)


class Threads:
    """Threads, which finish in any order."""

    def __init__(self, number):
        self.width = number
        self.executor = ThreadPoolExecutor(number)


@pytest.fixture
def told(tmp_path, monkeypatch):
    """A file that workers know of."""
    monkeypatch.setenv(NOTES, str(tmp_path / "told"))
    return tmp_path / "told"


def scanned(of, file, crew, solve=toy):
    with Store(file) as store:
        return scan(of, store, crew, solve=solve, progress=False)


def timeless(rows):
    """Rows without what they took."""
    return [row.to_json() | {"seconds": 0.0} for row in rows]


# --- Where a scan looks ----------------------------------------------------------------------


def test_scan_finds_what_a_full_grid_finds(tmp_path):
    """All cells of the finest level that the boundary crosses, with a quarter of the cases."""
    of = family("fig3a", finest=64)
    found = scanned(of, tmp_path / "cases.sqlite", Here())
    labels = {
        (sheet, (i, j)): toy(of.case(sheet, (i / 64, j / 64))).label
        for sheet in of.sheets
        for i in range(65)
        for j in range(65)
    }
    mixed = {
        cell
        for node in labels
        for cell in [(node, 1)]
        if max(node[1]) < 64 and len({labels[corner] for corner in corners(cell)}) > 1
    }
    assert set(found.mixed) == mixed
    assert len(found.rows) < len(labels) / 4


def test_cells_tile_the_diagram(tmp_path):
    """Every unit of area once; nothing is refined twice."""
    found = scanned(family("fig3a", finest=64), tmp_path / "cases.sqlite", Here())
    assert sum(edge**2 for _, edge in found.cells) == 2 * 64**2


def test_cube_is_scanned_too(tmp_path):
    """Three parameters, 8 corners a cell."""

    def ball(case):
        far = math.dist((case.vertex_angle / 90, case.h_over_t / 3), (0.8, 0.8))
        return Row(case, "unfoldable" if far < 0.25 else "stable at fixed moment, snap-back")

    found = scanned(family("fig8a", finest=16), tmp_path / "cases.sqlite", Here(), ball)
    assert sum(edge**3 for _, edge in found.cells) == 16**3
    assert 9**3 < len(found.rows) < 17**3


def test_failed_cases_are_rows_and_refine_nothing(tmp_path):
    """They say nothing about the mode, and are often the dearest."""

    def fails(case):
        return (
            Row(case, "failed", status="failed", message="no") if case.h_over_t > 2 else toy(case)
        )

    found = scanned(
        family("fig3a", finest=32, ranges={"b_over_a": (0.95, 1.0)}),
        tmp_path / "cases.sqlite",
        Here(),
        fails,
    )
    assert len(found.rows) == 2 * 17**2
    assert sum(not row.ok for row in found.sorted_rows) > 100


def test_rows_do_not_depend_on_order(tmp_path):
    """1 or 5 threads that finish in any order."""
    one, five = (scanned(TOY, tmp_path / f"{n}.sqlite", Threads(n)) for n in (1, 5))
    assert timeless(one.sorted_rows) == timeless(five.sorted_rows)
    assert one.cells == five.cells


def test_finer_scan_goes_on_with_the_cases_of_a_coarser(tmp_path, told):
    """No case twice."""
    file = tmp_path / "cases.sqlite"
    first = scanned(TOY, file, Here(), toy_with_notes)
    second = scanned(family("fig3a", finest=64), file, Here(), toy_with_notes)
    keys = told.read_text().split()
    assert max(Counter(keys).values()) == 1
    assert len(keys) == first.solved + second.solved == len(second.sorted_rows)


# --- The store -------------------------------------------------------------------------------


def test_change_cut_short_by_a_crash_is_taken_back(tmp_path):
    """A journal beside the store, as `kill -9` leaves it in the midst of a change."""
    file, killed = tmp_path / "cases.sqlite", tmp_path / "killed.sqlite"
    cases = [row.case for row in scanned(TOY, file, Here()).sorted_rows]
    other = [replace(toy(case), message="x" * 2000) for case in cases]
    with Store(file) as store, suppress(KeyboardInterrupt):
        store._open.execute("PRAGMA cache_size = 1")  # so that pages go to the disk before the end

        def rows():
            yield from other
            journal = tmp_path / "cases.sqlite-journal"
            killed.write_bytes(file.read_bytes())
            journal_of_killed = tmp_path / "killed.sqlite-journal"
            journal_of_killed.write_bytes(journal.read_bytes())
            raise KeyboardInterrupt

        lines = ((row.case.key, json.dumps(row.to_json())) for row in rows())
        with store._open:
            store._open.executemany("INSERT OR REPLACE INTO cases VALUES (?, ?)", lines)
    assert b"x" * 500 in killed.read_bytes()
    for one in (file, killed):
        with Store(one) as store:
            assert len(store) == store.safe == len(cases)
            assert not any(row.message for row in store.rows.values())
    assert sorted(tmp_path.iterdir()) == [file, killed]


def test_unreadable_row_is_a_case_that_is_solved_again(tmp_path):
    """A bad row costs its own case only."""
    file = tmp_path / "cases.sqlite"
    scanned(TOY, file, Here())
    with Store(file) as store, store._open as opened:
        keys = sorted(store.rows)
        for key, row in zip(keys[:3], (b"\x00\xff", "[]", '{"key": "a", "case": 3}'), strict=True):
            opened.execute("UPDATE cases SET row = CAST(? AS TEXT) WHERE key = ?", (row, key))
    assert scanned(TOY, file, Here()).solved == 3


def test_store_is_in_use_by_one_run_at_a_time(tmp_path):
    """Two would solve everything twice."""
    file = tmp_path / "cases.sqlite"
    with Store(file), pytest.raises(ValueError, match="is in use by another run"):
        Store(file)
    with Store(file):
        pass


def test_full_disk_loses_only_the_cases_in_flight(tmp_path, monkeypatch):
    """The error says what is safe."""
    file = tmp_path / "cases.sqlite"

    class Small(Store):
        def _lock(self):
            super()._lock()
            self._open.execute("PRAGMA max_page_count = 8")

    with Small(file) as store:
        with pytest.raises(OSError, match=r"disk is full; (\d+) cases are safe") as caught:
            scan(TOY, store, Here(), solve=toy, progress=False)
        safe = store.safe
        assert safe == len(store) > 0
    assert caught.value.errno == errno.ENOSPC
    assert f"{safe} cases" in str(caught.value)
    again = scanned(TOY, file, Here())
    assert again.solved == len(again.sorted_rows) - safe


def test_cases_of_an_older_version_are_taken_over(tmp_path, undisturbed):
    """It kept lines of JSON, of which the last one may be torn."""
    rows = undisturbed.sorted_rows
    lines = [json.dumps({"key": row.case.key, **row.to_json()}) for row in rows]
    older = "\n".join(["\x00", "[" * 10_000, *lines])[:-40]
    (tmp_path / "cases.jsonl").write_text(older)
    assert scanned(TOY, tmp_path / "cases.sqlite", Here()).solved == 1
    assert scanned(TOY, tmp_path / "cases.sqlite", Here()).solved == 0


@pytest.mark.parametrize("junk", [b"junk\n" * 1000, b"{}\n[]\n", bytes(range(256)) * 9])
def test_older_cases_of_which_none_can_be_read_are_refused(tmp_path, junk):
    """All of them were solved again, without a word."""
    (tmp_path / "cases.jsonl").write_bytes(junk)
    with pytest.raises(ValueError, match=r"cases.jsonl is no store of cases: none of its \d+ line"):
        Store(tmp_path / "cases.sqlite")
    (tmp_path / "cases.jsonl").write_bytes(b'{"key": "torn')  # a run that was killed at once
    with Store(tmp_path / "cases.sqlite") as store:
        assert len(store) == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda file: file.write_text("{}\n" * 1000),
        lambda file: spoilt(file, "CREATE TABLE cases (key, row)"),
        lambda file: spoilt(file, "CREATE VIEW cases AS SELECT 'a' AS row"),
        lambda file: spoilt(file, SCHEMA, "CREATE TRIGGER t INSERT ON cases BEGIN SELECT 1; END"),
    ],
)
def test_file_that_is_no_store_is_refused(tmp_path, make):
    """Nor are a stranger's views and triggers run."""
    file = tmp_path / "cases.sqlite"
    make(file)
    before = file.read_bytes()
    with pytest.raises(ValueError, match="is no store of cases"):
        Store(file)
    assert file.read_bytes() == before


def spoilt(file, *statements):
    """A database of a stranger."""
    with closing(sqlite3.connect(file)) as database, database:
        for statement in statements:
            database.execute(statement)


# --- Workers that die ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return scanned(TOY, tmp_path_factory.mktemp("undisturbed") / "cases.sqlite", Here())


def test_worker_that_is_killed_is_replaced(tmp_path, told, undisturbed):
    """kill -9 of one of two; the run goes on, and its cases are solved after all."""
    with workers(2) as crew:
        found = scanned(TOY, tmp_path / "cases.sqlite", crew, toy_that_dies_once)
    assert told.exists()
    assert timeless(found.sorted_rows) == timeless(undisturbed.sorted_rows)


def test_case_that_kills_its_workers_is_a_failed_row(tmp_path, undisturbed):
    """And no other: those that died with it are tried again alone."""
    assert POISON in {row.case for row in undisturbed.sorted_rows}
    with workers(2) as crew:
        found = scanned(TOY, tmp_path / "cases.sqlite", crew, toy_with_poison)
    bad = [row for row in found.sorted_rows if not row.ok]
    assert [(row.case, row.message) for row in bad] == [(POISON, "its worker died, 2 times")]


@pytest.mark.parametrize(
    ("work", "kinds"),
    [
        (along_that_dies_once, ["foldability"] * 5),
        (along_with_poison, ["foldability"] * 2 + ["foldability (scan)"] + ["foldability"] * 2),
    ],
)
def test_worker_killed_on_a_boundary_is_replaced(tmp_path, told, monkeypatch, work, kinds):
    """Every slice of a cube has its curves, in order; one that kills has what the scan sees."""
    monkeypatch.setattr("der.diagram.distributed.located", work)
    with Store(tmp_path / "cases.sqlite") as store, workers(2) as crew:
        found = scan(CUBE, store, Here(), solve=wedge, progress=False)
        before = len(store)
        curves = follow(found, store, crew, wedge).curves
        assert len(store) - before == len(kinds)
    assert [curve.kind for curve in curves] == kinds
    planes = [CUBE.unit(curve.points[0].case)[1] for curve in curves]
    assert planes == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])


def test_workers_that_cannot_work_end_the_run(tmp_path):
    """Not a folder full of failed rows."""
    cases = [TOY.case("x", (i / 16, 0.0)) for i in range(16)]
    with Store(tmp_path / "cases.sqlite") as store, workers(1) as crew:
        with pytest.raises(RuntimeError, match="workers die before they have solved anything"):
            solve_all(cases, store, crew, solve=deadly)
        assert len(store) == 0


# --- Runs that die ---------------------------------------------------------------------------

SCRIPT = """
import sys
sys.path[:0] = [{root!r}, {tests!r}]
from toy_cases import TOY, slow
from der.diagram.scan import Interrupted, scan
from der.diagram.store import SCHEMA, Store
from der.diagram.workers import workers

if __name__ == "__main__":
    with Store({file!r}) as store, workers(2) as crew:
        try:
            scan(TOY, store, crew, solve=slow)
        except Interrupted as stopped:
            sys.exit(f"stopped: {{stopped}}")
"""


def run(folder, **env):
    """A run in a process of its own."""
    file = folder / "cases.sqlite"
    script = folder / "run.py"
    script.write_text(SCRIPT.format(root=str(TESTS.parent), tests=str(TESTS), file=str(file)))
    return subprocess.Popen(
        [sys.executable, str(script)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | env,
    )


@pytest.fixture
def no_unix(tmp_path):
    """A folder which, on the path, hides the modules that Windows has not."""
    folder = tmp_path / "windows"
    folder.mkdir()
    for name in ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"):
        (folder / f"{name}.py").write_text("raise ImportError(__name__)\n")
    return str(folder)


def test_stores_and_workers_need_no_module_of_unix_alone(tmp_path, told, no_unix, undisturbed):
    """A scan by workers, all of whose processes lack fcntl and its like."""
    process = run(tmp_path, PYTHONPATH=no_unix)
    _, words = process.communicate(timeout=60)
    assert (process.returncode, words) == (0, "")
    with Store(tmp_path / "cases.sqlite") as store:
        found = scan(TOY, store, Here(), solve=toy, progress=False)
    assert found.solved == 0
    assert timeless(found.sorted_rows) == timeless(undisturbed.sorted_rows)


def wait_for(file, lines, process):
    """Until a store has so many cases, about."""
    while (
        not file.exists() or file.read_bytes().count(b'"label"') < lines
    ):  # its run alone opens it
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.01)


def test_killed_twice_and_resumed_is_as_if_nothing_had_been(tmp_path, told, undisturbed):
    """kill -9 of all its processes in mid-run; what was in flight, and only that, is begun again.

    In flight are at most two tasks each of two workers. The command
    `validation.stress.kill_and_resume` does it twenty times to a real diagram.
    """
    file = tmp_path / "cases.sqlite"
    moments = [lambda process, n=lines: wait_for(file, n, process) for lines in (40, 100)]
    flight = kill_and_resume(lambda: run(tmp_path), moments, file, told)
    assert len(flight) == 2
    assert all(0 <= lost <= 2 * AHEAD * BATCH for lost in flight)
    with Store(file) as store:
        found = scan(TOY, store, Here(), solve=toy, progress=False)
        stored = len(store)
    assert found.solved == 0
    assert timeless(found.sorted_rows) == timeless(undisturbed.sorted_rows)
    times = notes(told)
    assert set(times) == {row.case.key for row in undisturbed.sorted_rows}
    assert times.total() - len(times) == sum(flight)
    assert stored == len(times)


def test_workers_leave_when_their_parent_is_killed(tmp_path, told):
    """They would wait for ever for tasks that no process sends."""
    process = run(tmp_path)
    wait_for(tmp_path / "cases.sqlite", 20, process)
    assert kill(process, workers_too=False)
    assert calm(told)


def test_killed_run_that_differs_is_not_ok():
    """A table that is another, a case that was solved though it was safe, or stored twice."""
    good = Killed(2, 10, 13, (1, 2), 10, {"cases.csv": True})
    assert good.ok
    assert good.again == 3
    assert not replace(good, same={"cases.csv": False}).ok
    assert not replace(good, begun=14).ok
    assert not replace(good, stored=11).ok
    assert "NOT as it should be" in str(replace(good, stored=11))


def test_ctrl_c_keeps_what_is_finished(tmp_path, told):
    """It says how much, and nothing is torn."""
    process = run(tmp_path)
    wait_for(tmp_path / "cases.sqlite", 20, process)
    process.send_signal(signal.SIGINT)
    process.wait(timeout=20)
    words = process.stderr.read()
    process.stderr.close()
    with Store(tmp_path / "cases.sqlite") as store:
        assert f"stopped: {len(store)} cases are in" in words
        assert "Traceback" not in words


def test_workers_are_put_away_whatever_is_pressed(monkeypatch):
    """A second Ctrl-C meanwhile would leave their semaphores behind; afterwards it works again."""
    with workers(1) as crew:
        shutdown = crew.executor.shutdown

        def pressed(**options):
            signal.raise_signal(signal.SIGINT)
            shutdown(**options)

        monkeypatch.setattr(crew.executor, "shutdown", pressed)
        crew.stop()
        monkeypatch.undo()
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_interrupted_is_a_keyboard_interrupt():
    """So that the command leaves with the exit code of Ctrl-C."""
    assert issubclass(Interrupted, KeyboardInterrupt)


# --- Real cases, real workers ----------------------------------------------------------------


@pytest.fixture(scope="module")
def real(tmp_path_factory):
    """A small part of fig3a, by this process."""
    return scanned(small(), tmp_path_factory.mktemp("real") / "c.sqlite", Here(), solve_case)


def test_real_scan_sees_the_three_modes(real):
    """Around the circle, h/t = 1.4 to 2: unfoldable, then snap-back, then snap-through."""
    labels = Counter(row.label for row in real.sorted_rows)
    assert set(labels) == {
        "unfoldable",
        "unstable at fixed moment, snap-back",
        "unstable at fixed moment, snap-through",
    }


def test_rows_do_not_depend_on_the_number_of_workers(tmp_path, real):
    """To the last bit, but for the time taken."""
    with workers(2) as crew:
        two = scanned(small(), tmp_path / "cases.sqlite", crew, solve_case)
    assert timeless(two.sorted_rows) == timeless(real.sorted_rows)


@pytest.mark.filterwarnings("default")  # not ours to mend
def test_dask_workers_do_the_same_and_may_be_killed(tmp_path, undisturbed, told):
    """A scheduler with two worker processes, one of them killed in mid-run."""
    distributed = pytest.importorskip("distributed", reason="needs the extra 'cluster'")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(**options, silence_logs=50) as cluster,
        workers(scheduler=cluster.scheduler_address) as crew,
    ):
        assert isinstance(crew, Cluster)
        assert crew.width == 2
        found = scanned(TOY, tmp_path / "cases.sqlite", crew, toy_that_dies_once)
    assert told.exists()
    assert timeless(found.sorted_rows) == timeless(undisturbed.sorted_rows)


@pytest.mark.filterwarnings("default")
def test_scheduler_that_does_not_answer_is_refused(monkeypatch):
    """By name, with its address."""
    distributed = pytest.importorskip("distributed", reason="needs the extra 'cluster'")
    client = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda a, **more: client(a, **more | {"timeout": 1}))
    with pytest.raises(ValueError, match=r"scheduler must be .*, got 'tcp://127.0.0.1:9'"):
        Cluster("tcp://127.0.0.1:9")


@pytest.mark.parametrize("number", [0, -1, True, 1.5])
def test_wrong_number_of_workers_is_refused(number):
    with (
        pytest.raises(ValueError, match="workers must be an integer from 1, got"),
        workers(number),
    ):
        pass


def test_processes_are_one_a_core_unless_told():
    """Of the cores that this process may use."""
    with workers() as crew:
        assert isinstance(crew, Processes)
        assert crew.width == len(os.sched_getaffinity(0))
