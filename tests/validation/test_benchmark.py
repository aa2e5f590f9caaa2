"""The bench runs, and writes what it measured; how fast this machine is, is not tested."""

import json
import math
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from importlib.metadata import PackageNotFoundError

import numpy as np
import pytest
from here import Here

import der
from der.analysis.curve_distance import read_reference
from validation.benchmark import (
    elastica,
    methods,
    needs,
    orders,
    paths,
    rings,
    run,
    start,
    state,
    sweep,
)
from validation.benchmark.extent import Extent
from validation.benchmark.rows import Measured, Row, Trial, front, measured, peak_memory
from validation.benchmark.stepping import stepped
from validation.stress.random_rings import random_rings

CIRCLE, RECTANGLE = rings.RINGS[0], rings.RINGS[4]
TINY = Extent(
    repeats=1,
    rings=(CIRCLE,),
    states=48,
    edges=(32,),
    tolerances=(1e-3,),
    relaxed=(16,),
    stepping=(),
    elements=(),
    orders=(32, 64),
    scales=(16, 32),
    commands=1,
    cold=False,
)


# --- The command's run -----------------------------------------------------------------------


def test_run_writes_what_it_prints(tmp_path, capsys, monkeypatch):
    """Strict JSON: the machine, all rows, trials and scales that were printed; two pictures."""
    monkeypatch.setattr(run, "QUICK", TINY)
    parts = ("orders", "error", "state", "scaling")
    found = run.run(tmp_path / "own.json", out=tmp_path, quick=True, only=parts)
    record = json.loads((tmp_path / "bench.json").read_text(), parse_constant=pytest.fail)
    assert (tmp_path / "own.json").read_text() == (tmp_path / "bench.json").read_text()
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert record["machine"] in lines[0]
    for one in (*found.rows, *found.trials):
        assert str(one) in lines
    assert [row["value"] for row in record["rows"]] == [row.value for row in found.rows]
    assert all(math.isfinite(row.value) for row in found.rows)
    assert {trial["method"] for trial in record["trials"]} >= {*state.METHODS}
    assert [scale["n"] for scale in record["scales"]] == [16, 32]
    for name in ("bench_error.png", "bench_cost.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert "not by this command" in printed
    assert "not by this command" in record["cited"]["source"]


def test_run_keeps_what_it_has_at_ctrl_c(tmp_path, monkeypatch):
    """Rows measured before the interruption are in the file."""

    def interrupted(*_):
        yield Row("path", "first", 1.0, "ms")
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "measure", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.run(tmp_path / "bench.json")
    assert len(json.loads((tmp_path / "bench.json").read_text())["rows"]) == 1


@pytest.mark.parametrize("only", [("errors",), ("paths", "memory"), ()])
def test_run_refuses_parts_that_there_are_not(only):
    """By name, before anything is measured."""
    with pytest.raises(ValueError, match="only must be some of paths, needs, orders"):
        run.run(only=only)


def test_a_peer_that_is_not_there_is_skipped_by_name(monkeypatch):
    """One line says so, and no trial is made up."""

    def missing(_):
        raise PackageNotFoundError

    monkeypatch.setattr(elastica, "version", missing)
    extent = Extent(repeats=1, edges=(), relaxed=(), tolerances=(1e-3,), stepping=(), elements=(8,))
    found = run.Found()
    for one in state.rows(extent):
        found.add(one)
    assert found.skipped == ["PyElastica: not installed, skipped"]
    assert [trial.method for trial in found.trials] == ["boundary value"]


def test_a_peer_that_is_there_agrees_to_its_order():
    """PyElastica's M on 8 and 16 elements at a small angle: the error falls like h^2."""
    pytest.importorskip("elastica")
    section, gamma = der.rectangular_section(4.0), 0.2
    scene = CIRCLE.scene(gamma_max=gamma, save_at=(gamma,))
    exact = float(der.solve_bvp(scene).moment[-1])
    coarse, fine = (elastica.moment(section, n, gamma) - exact for n in (8, 16))
    assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.3)


# --- Rows ------------------------------------------------------------------------------------


def test_measured_does_not_count_the_first_runs():
    """One loads and compiles, one is watched for memory: two runs more than are timed."""
    runs = []
    done = measured(lambda: runs.append(1), 3)
    assert len(runs) == 5
    assert done.cpu >= 0.0
    assert done.wall >= 0.0


def test_peak_memory_is_what_was_held_at_once():
    """Two arrays of a megabyte one after the other are one at a time; 5 % for Python's own."""

    def work():
        for _ in range(2):
            np.ones(125_000)

    assert peak_memory(work) == pytest.approx(1e6, rel=0.05)


def trial(cpu, error):
    return Trial("ring", "method", "N", cpu, cpu, None, error, None, None)


def test_front_holds_what_none_beats():
    """Faster, or better, than every other; a trial without error is on no front."""
    trials = [trial(3.0, 1e-3), trial(1.0, 1e-1), trial(2.0, 1e-3), trial(2.5, 1e-2)]
    best = front([*trials, trial(0.1, None)])
    assert [(t.cpu, t.error) for t in best] == [(1.0, 1e-1), (2.0, 1e-3)]


def test_start_up_measures_whole_commands():
    """One row each for help, for a fold, and for the other solver, in seconds of wall time."""
    rows = list(start.compiled(1))
    asked = "circle --h-over-t 4 --quiet"
    assert [row.case for row in rows] == ["der --help", f"der fold {asked}", f"der bvp {asked}"]
    assert all(row.value > 0.0 for row in rows)


def test_start_up_is_not_measured_of_a_command_that_fails(monkeypatch):
    """A command that ends with an error is no measurement."""
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(subprocess.CalledProcessError):
        list(start.compiled(1))


def test_compiling_is_charged_to_the_kernel_itself():
    """What a kernel calls is taken off; a second signature is added; the costliest comes first."""
    told = [
        ("outer", 0.0, True),
        ("inner", 1.0, True),
        ("inner", 4.0, False),
        ("other", 4.0, True),
        ("inner", 4.5, True),
        ("inner", 5.5, False),
        ("other", 6.0, False),
        ("outer", 8.0, False),
    ]
    found = start.own_times(start.Report(*one) for one in told)
    assert found == [("inner", 2, 4.0), ("outer", 1, 3.0), ("other", 1, 1.0)]


def test_cold_start_has_rows():
    """Commands in processes of their own, which tell of their kernels: here some without any."""
    rows = list(start.compiling(("--help",), ("--help",)))
    assert {row.group for row in rows} == {"start-up"}
    assert [row.value > 0.0 for row in rows] == [True] * 4 + [False, True, False]


def test_needs_have_a_row_each(monkeypatch):
    """In times of the path without; here every need is done once, and costs what is put in."""
    done = []

    def cost(work, _, *, memory=True):
        result = work()
        if memory:
            done.append(result)
        return Measured(result, float(len(done)), 0.0, 1000 * len(done))

    monkeypatch.setattr(needs, "measured", cost)
    rows = {row.case: row for row in needs.rows(1, 32)}
    assert set(needs.NEEDS) <= set(rows)
    assert rows["stability of every state"].value == pytest.approx(2.0)
    assert rows["stability of every state"].note == "+1000.0 ms, +1 kB"
    assert len(done) == len(needs.NEEDS) + 6  # three paths without that are no need, three outputs


def test_relaxation_and_snaps_have_rows():
    """States by relaxation and by Newton; a snap on a quarter and on the full ring."""
    rows = [*paths.relaxation((16,), 1), *paths.snaps(1)]
    assert [row.group for row in rows] == ["relaxation", "relaxation", "snap", "snap"]
    assert all(row.value > 0.0 for row in rows)


# --- The truth, and the series ---------------------------------------------------------------


def test_reference_tables_are_there():
    """Every ring of the bench that names a table has one, with as many folds as it says."""
    for case in rings.RINGS:
        if case.table:
            table = read_reference(rings.TABLES / f"{case.table}.csv")
            assert len(table.folds) == case.folds


@pytest.mark.parametrize(
    ("case", "sizes"), [(CIRCLE, (64, 128, 256)), (RECTANGLE, (128, 256, 512))]
)
def test_error_series_is_even(case, sizes):
    """h^2 plain, h^4 Richardson, h^6 Romberg, for a smooth and for a segmented ring.

    Fitted to three meshes; the next term of the series leaves 0.2 of the order of the last.
    """
    truth = rings.known(case, 160)
    found = {row.case: row.value for row in orders.rows(truth, sizes) if row.group == "order"}
    for name, order in zip(orders.NAMES, orders.ORDERS, strict=True):
        assert found[f"{case.name}, {name}"] == pytest.approx(order, abs=0.03 * order + 0.05)


def test_orders_are_fitted_above_the_floor():
    """A power law is found to rounding; what lies at the floor of the reference is left out."""
    sizes = np.array([8.0, 16.0, 32.0, 64.0, 128.0])
    values = np.maximum(sizes**-4.0, 1e-6)
    assert orders.fitted(sizes, values, 2e-6) == pytest.approx((4.0, 8.0, 16.0))
    assert orders.fitted(sizes, values, 1e-4) is None


def test_stepping_follows_the_path():
    """solve_bvp to its tolerance of 1e-4 at gamma = 0.4; M and U within ten times that."""
    scene = CIRCLE.scene(gamma_max=0.4, save_at=(0.4,))
    ours, theirs = der.solve_bvp(scene), stepped(scene, 1e-4)
    assert theirs.moment[-1] == pytest.approx(ours.moment[-1], rel=1e-3)
    assert theirs.energy[-1] == pytest.approx(ours.energy[-1], rel=1e-3)


def test_a_trial_that_fails_says_why(monkeypatch):
    """It has no error, stands on no front, and the bench goes on."""

    def stuck(*_):
        raise ValueError("gamma cannot be stepped beyond 1.0")

    monkeypatch.setattr(methods, "stepped", stuck)
    extent = replace(TINY, edges=(), relaxed=(), tolerances=(), stepping=(1e-3, 1e-4))
    trials = [one for one in methods.rows(extent) if isinstance(one, Trial)]
    assert [one.note for one in trials] == ["gamma cannot be stepped beyond 1.0"] * 2
    assert front(trials) == []


def test_stepping_refuses_a_ring_without_quarter():
    """By name."""
    with pytest.raises(ValueError, match="ring must have a quarter to be stepped here"):
        stepped(rings.RINGS[5].scene(), 1e-3)


# --- The sweep -------------------------------------------------------------------------------


def test_sweep_counts_rings_and_holds_its_bars(monkeypatch):
    """Every ring is accounted for, and the true error of M is within what was asked for."""
    monkeypatch.setattr(sweep, "workers", lambda number: nullcontext(Here(number)))
    rows = {row.case: row.value for row in sweep.rows(2, 1)}
    for method in sweep.METHODS:
        assert rows[f"{method}, rings with M to 0.0001"] == 2
    assert rows["rod, error of M in truth, 1 rings, largest"] <= sweep.ASKED


def test_sweep_takes_more_edges_for_less_error():
    """A bar ten times under that of the first mesh is not met there."""
    ring, section = next(random_rings(1, 0))
    plain = sweep.swept(ring, section)
    finer = sweep.swept(ring, section, 0.1 * plain.error)
    assert finer.n > plain.n
    assert finer.error <= 0.1 * plain.error
