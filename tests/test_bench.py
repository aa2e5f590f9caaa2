"""The bench runs, and writes what it measured; how fast this machine is, is not tested."""

import json
import math
import subprocess
import sys

import pytest

from validation import bench


@pytest.fixture
def tiny(monkeypatch):
    """The smallest sizes, each measured once."""
    sizes = {"_relaxation": (16,), "_errors": (16, 32), "_newton": (16,)}
    for name, size in (
        dict.fromkeys(("_paths", "_needs", "_snaps", "_recording"), 1) | sizes
    ).items():
        whole = getattr(bench, name)
        monkeypatch.setattr(bench, name, lambda _, whole=whole, size=size: whole(size))
    monkeypatch.setattr(bench, "_start_up", lambda _: iter(()))


@pytest.mark.usefixtures("tiny")
def test_measure_yields_rows_of_every_group():
    """Finite numbers, with all that the project sets itself goals for among them."""
    rows = list(bench.measure(quick=True))
    groups = {"path", "need", "relaxation", "snap", "recording", "curve error", "order", "newton"}
    groups |= {"memory"}
    assert groups <= {row.group for row in rows}
    assert all(math.isfinite(row.value) for row in rows)


@pytest.mark.usefixtures("tiny")
def test_run_writes_what_it_prints(tmp_path, capsys):
    """Strict JSON: the machine, and a row for every line of the table."""
    rows = bench.run(tmp_path / "bench.json", quick=True)
    record = json.loads((tmp_path / "bench.json").read_text(), parse_constant=pytest.fail)
    lines = capsys.readouterr().out.splitlines()
    assert len(record["rows"]) == len(rows) == len(lines) - 1
    assert [row["value"] for row in record["rows"]] == [row.value for row in rows]
    assert record["machine"] in lines[0]


def test_order_of_the_default_measure_is_two():
    """Fitted to the distance from AUTO's curve; 0.2 allows for two sizes this small."""
    orders = [row for row in bench._errors((32, 64)) if row.group == "order"]
    assert orders[0].value == pytest.approx(2.0, abs=0.2)


def test_reference_curves_are_there():
    """Every case names a table that can be read."""
    for name in bench.CASES.values():
        assert len(bench.read_reference(bench.REFERENCE / f"{name}.csv").gamma) > 10


def test_cpu_time_does_not_count_the_first_run():
    """It compiles and fills caches: one run more than is measured."""
    runs = []
    seconds = bench.cpu_time(lambda: runs.append(1), 3)
    assert len(runs) == 4
    assert seconds >= 0.0


def test_start_up_measures_whole_commands():
    """One row each for help and for a fold, in seconds of wall time."""
    rows = list(bench._start_up(1))
    assert [row.case for row in rows] == ["der --help", "der fold circle --h-over-t 4 --quiet"]
    assert all(row.value > 0.0 for row in rows)


def test_start_up_is_not_measured_of_a_command_that_fails(monkeypatch):
    """A command that ends with an error is no measurement."""
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(subprocess.CalledProcessError):
        list(bench._start_up(1))
