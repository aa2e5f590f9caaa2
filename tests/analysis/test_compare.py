"""Rod against boundary-value problem: the comparison, from Python and on the command line."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from shapes import KINKS

import der
from der.analysis.compare import _distance, compare
from der.bvp.solve import solve_bvp
from der.cli.commands import main
from der.records.path import Path
from der.records.text import summary

SECTION = der.rectangular_section(1.6)


@pytest.fixture(scope="module")
def scene():
    """A ring with two folds, with error bars."""
    return der.Scene(
        der.circle(), SECTION, n_edges=128, error_bars=True, self_crossings=False, stability=False
    )


@pytest.fixture(scope="module")
def rod(scene):
    """The rod's path."""
    return der.fold(scene)


@pytest.fixture(scope="module")
def comparison(scene, rod):
    """Both."""
    return compare(scene, rod)


def test_the_rod_agrees_within_its_own_error_bars(comparison):
    """At 95 % of its states or more, and everything finds its counterpart."""
    assert comparison.within >= 0.95
    assert comparison.unmatched == 0
    assert max(comparison.largest) < 1e-6


def test_folds_and_limits_are_compared_one_by_one(comparison):
    """Two folds and three limits at h/t = 1.6, each within the rod's bar."""
    assert [pair.kind for pair in comparison.pairs].count("fold") == 2
    assert [pair.kind for pair in comparison.pairs].count("limit") == 3
    assert all(pair.difference <= pair.bar for pair in comparison.pairs)


def test_a_wrong_rod_is_found_out(scene, rod):
    """One per mille in M is a distance of that size, and beyond every bar but those at M = 0."""
    wrong = compare(scene, replace(rod, moment=1.001 * rod.moment))
    assert 2e-4 < wrong.largest[0] < 1.1e-3
    assert wrong.within < 0.2
    assert "beyond" in summary(wrong)
    assert "The two solvers disagree: less than 90 % of the states are inside" in summary(wrong)


def test_a_fold_too_many_has_no_counterpart(scene, rod):
    """A point that only one of the two paths has is counted, not dropped."""
    assert compare(scene, replace(rod, points=rod.points[1:])).unmatched > 0


def test_without_error_bars_there_is_no_verdict(scene):
    """Distances all the same."""
    plain = replace(scene, error_bars=False, n_edges=64)
    found = compare(plain, der.fold(plain))
    assert math.isnan(found.within)
    assert 1e-5 < found.largest[0] < 1e-2


def test_a_path_that_is_not_a_rods_is_refused(scene):
    """Comparing the boundary-value problem with itself would say nothing."""
    with pytest.raises(ValueError, match=r"rod must be a path of a rod .* got 'bvp'"):
        compare(scene, solve_bvp(replace(scene, error_bars=False)))


def run(*words):
    """Exit code of the command."""
    with pytest.raises(SystemExit) as left:
        main(list(words))
    return left.value.code


def test_bvp_writes_the_record_of_the_other_solver(tmp_path, capsys):
    """The same record as from fold, indices unknown; summary on standard output."""
    file = tmp_path / "path.json"
    words = ("bvp", "ellipse", "--b-over-a", "0.85", "--axis", "y", "--h-over-t", "4")
    assert run(*words, "--tolerance", "1e-6", "--json", str(file)) == 0
    path = Path.load(file)
    assert (path.solver, path.mode.snapping, len(path.folds)) == ("bvp", "snap-back", 2)
    assert path.index.mask.all()
    assert "snap-back" in capsys.readouterr().out


def test_compare_writes_table_picture_and_data(tmp_path, capsys):
    """--out DIR holds both records with their differences, and the picture."""
    words = ("compare", "rectangle", "--b-over-a", "0.6", "--r-over-a", "0.3", "--h-over-t", "4")
    assert run(*words, "--no-stability", "--out", str(tmp_path / "new")) == 0
    entries = json.loads((tmp_path / "new" / "comparison.json").read_text())
    assert (entries["rod"]["solver"], entries["bvp"]["solver"]) == ("der", "bvp")
    assert entries["within"] >= 0.9
    assert np.isfinite([state["moment_distance"] for state in entries["states"]]).all()
    assert (tmp_path / "new" / "comparison.png").read_bytes().startswith(b"\x89PNG")
    assert "agree within their error bars" in capsys.readouterr().out


def test_compare_ends_with_3_where_the_two_disagree(tmp_path, capsys, monkeypatch, comparison):
    """The record is written all the same; with --quiet, too, and at 90 % the code is 0."""
    rod = comparison.rod
    wrong = replace(rod, moment=1.001 * rod.moment)
    monkeypatch.setattr("der.analysis.fold.fold", lambda scene, progress=None: wrong)
    words = ("compare", "circle", "--h-over-t", "1.6", "--edges", "128")
    assert run(*words, "--json", str(tmp_path / "c.json")) == 3
    assert "The two solvers disagree" in capsys.readouterr().out
    assert json.loads((tmp_path / "c.json").read_text())["within"] < 0.9
    assert run(*words, "--quiet") == 3


def test_compare_of_a_kinked_profile(tmp_path, capsys):
    """All states are inside at 128 edges; they were 27 % with kinks inside of cells."""
    file = tmp_path / "kink.csv"
    rows = [("arc_length", "curvature"), *KINKS]
    file.write_text("".join(f"{s},{k}\n" for s, k in rows))
    words = ("compare", "profile", str(file), "--h-over-t", "4", "--edges", "128")
    assert run(*words, "--no-stability") == 0
    assert "100.0 % of the states agree within their error bars" in capsys.readouterr().out


def test_a_state_beyond_the_last_gamma_is_held_against_the_fold(scene, rod):
    """A state moved half a bar beyond a fold: it agrees, and has a counterpart."""
    fold = rod.folds[0]
    k = fold.position - 1
    gamma = rod.gamma.copy()
    moment, energy = rod.moment.copy(), rod.energy.copy()
    away = math.copysign(0.5 * rod.error["gamma"][fold.position], gamma[fold.position] - gamma[k])
    gamma[k] = fold.gamma + away
    moment[k], energy[k] = fold.moment + 1e-7, fold.energy
    found = compare(scene, replace(rod, gamma=gamma, moment=moment, energy=energy))
    (state,) = [one for one in found.states if one.gamma == gamma[k]]
    assert state.agrees
    assert found.unmatched == 0


def test_a_state_at_a_fold_is_held_against_its_vertical_tangent():
    """There dM/dgamma does not exist: the distance is that in gamma."""
    at = SimpleNamespace(gamma=1.0, moment=2.0, energy=5.0, parameter_rate=0.0, moment_rate=0.3)
    point = SimpleNamespace(solution=at, error=SimpleNamespace(gamma=0.0, moment=0.0, energy=0.0))
    errors = {"gamma": 0.2 * math.pi, "moment": 1.0, "energy": 1.0}
    found = _distance("moment", (1.0 + 0.1 * math.pi, 9.0), point, 2.0, errors)
    assert found == pytest.approx((0.1, 0.2))
