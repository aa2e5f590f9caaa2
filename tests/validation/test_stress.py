"""The stress suite: it finds what it is made to find, keeps what it found, and ends by itself."""

import json
import math
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

import der
from der.errors import Reason
from validation.stress import checks as stress_checks
from validation.stress import kinds
from validation.stress import run as suite
from validation.stress.cases import KINDS, Case, case_from_json, cases, noisy_points, scene_of
from validation.stress.inputs import Argument, arguments, refusal
from validation.stress.random_rings import DENSE

SOME = 36  # cases of the quick level that are run here

silent = partial(suite.stress, progress=lambda line: None)


@pytest.fixture(scope="module")
def summary():
    """The first cases of the quick level, every kind among them."""
    return silent(count=SOME, seed=3)


@pytest.fixture(scope="module")
def bar():
    """A ring with one snap-through, and its path with shapes."""
    scene = der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=32, shapes=True)
    return scene, der.fold(scene)


def names(found):
    return {name for name, _ in found}


# --- The summary -----------------------------------------------------------------------------


def test_summary_counts_every_case_once(summary):
    """Cases, failures and reasons add up."""
    assert summary.cases == SOME == sum(summary.by_kind.values())
    assert set(summary.by_kind) == set(KINDS)
    assert summary.failures == len(summary.failed) == sum(summary.by_reason.values())
    assert summary.unexplained == sum(not failure.explained for failure in summary.failed)


def test_solvers_and_statement_stand_a_few_dozen_cases(summary):
    """Nothing happens that the documentation does not explain."""
    strange = [f for f in summary.failed if not f.explained]
    assert not [(failure.reason, failure.case.to_json()) for failure in strange]


def test_json_has_the_keys_that_others_read(summary, tmp_path):
    """Strict JSON; a failure comes with its case, which can be done again."""
    summary.save(tmp_path / "stress.json")
    record = json.loads((tmp_path / "stress.json").read_text(), parse_constant=pytest.fail)
    assert {"cases", "failures", "unexplained", "by_reason"} <= set(record)
    assert record["cases"] == SOME
    assert len(record["failed"]) == record["failures"]
    for failure in record["failed"]:
        assert case_from_json(failure["case"]).to_json() == failure["case"]


def test_a_failure_can_be_repeated(summary):
    """From its JSON, with the same reason."""
    for failure in [f for f in summary.failed if f.seconds < 0.5][:3]:
        again = suite.repeat(json.loads(json.dumps(failure.case.to_json())))
        assert failure.reason in {one.reason for one in again}


def test_cases_depend_on_the_seed_alone():
    """The same seed gives the same cases; another does not."""
    first, second, other = (list(cases(40, seed)) for seed in (5, 5, 6))
    assert [case.to_json() for case in first] == [case.to_json() for case in second]
    assert [case.to_json() for case in first] != [case.to_json() for case in other]


def test_file_and_progress(tmp_path):
    """The file is written at the end, and every case is told."""
    lines = []
    found = suite.stress(file=tmp_path / "s.json", count=3, seed=1, progress=lines.append)
    assert json.loads((tmp_path / "s.json").read_text())["cases"] == found.cases == 3
    assert len(lines) == 3
    assert lines[-1].startswith("3 of 3 cases")
    assert str(found).startswith("3 cases in ")


def circle_case(kappa0, h_over_t, **wants):
    ring = {"shape": "circle", "natural_curvature": kappa0, "twist_axis": "x"}
    return Case("path", {"ring": ring, "h_over_t": h_over_t, "nu": 0.3, "wants": wants})


@pytest.mark.parametrize(
    "case",
    [
        # tolerances that rounding cannot meet beside a branch point: it stays on the path
        circle_case(4.0, 0.5080407396020141, n_edges=16, sector="full", tolerance=1.9e-15),
        # and a path that cannot go on says why
        circle_case(-2.0, 4.11628, n_edges=32, sector="full", curvature="tangent", tolerance=1e-16),
        # a step whose curve leads to another branch is repeated shorter
        circle_case(1.0, 0.9913999493697175, n_edges=8, curvature="tangent", stretch="finite"),
    ],
)
def test_cases_that_broke_it_once(case):
    """What is not finished has a reason that is known."""
    assert [failure for failure in suite.repeat(case) if not failure.explained] == []


def test_workers_find_the_same(summary):
    """Two processes, the first cases in the same order, the same failures."""
    shared = silent(count=len(KINDS), seed=3, workers=2)
    assert (shared.cases, shared.by_kind) == (len(KINDS), dict.fromkeys(KINDS, 1))
    tried = [case.to_json() for case in cases(len(KINDS), 3, most_edges=128)]
    alone = [one.message for one in summary.failed if one.case.to_json() in tried]
    assert [one.message for one in shared.failed] == alone


def test_interrupt_keeps_what_there_is(tmp_path, monkeypatch):
    """Ctrl-C in the third case: two are counted, and written."""
    done = []

    def stopping(case):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(case)
        return ()

    monkeypatch.setattr(suite, "repeat", stopping)
    found = silent(file=tmp_path / "s.json", count=9)
    assert (found.cases, found.interrupted) == (2, True)
    assert json.loads((tmp_path / "s.json").read_text())["interrupted"] is True


@pytest.mark.parametrize("level", ["short", "", None, 1])
def test_unknown_level_is_refused(level):
    """In a sentence that names it."""
    with pytest.raises(ValueError, match="level must be one of quick, long, got"):
        suite.stress(level)


@pytest.mark.parametrize("entries", [None, {}, {"kind": "path"}, {"kind": "x", "parameters": {}}])
def test_what_is_no_case_is_refused(entries):
    """Rather than run as something else."""
    with pytest.raises(ValueError, match=r"case must be|kind must be"):
        suite.repeat(entries)


# --- What counts as what ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "reason", "explained"),
    [
        (kinds.Refused("r_over_a must be a number, got 3"), "ValueError", True),
        (ValueError("no"), "unexpected ValueError", False),
        (ZeroDivisionError("float division"), "unexpected ZeroDivisionError", False),
        (RuntimeWarning("overflow"), "unexpected RuntimeWarning", False),
        (FloatingPointError("invalid"), "unexpected FloatingPointError", False),
        (SystemExit(1), "unexpected SystemExit", False),
    ],
)
def test_reasons_of_exceptions(monkeypatch, wrong, reason, explained):
    """A refusal by the statement is explained; any other exception is not."""

    def run(parameters):
        raise wrong
        yield

    monkeypatch.setitem(kinds.RUN, "path", run)
    (failure,) = suite.repeat(Case("path", {}))
    assert (failure.reason, failure.message) == (reason, str(wrong))
    assert failure.explained is explained


def test_every_reason_is_explained_or_not_on_purpose():
    """A new one has to be written down in the suite, too."""
    assert set(Reason) == suite.EXPLAINED | suite.NOT_EXPLAINED
    assert not suite.EXPLAINED & suite.NOT_EXPLAINED


@pytest.mark.parametrize("reason", Reason)
def test_a_path_that_ends_early_is_explained_by_its_reason(monkeypatch, bar, reason):
    """Whether it is raised, or read from the record; the sentence does not matter."""
    path = replace(bar[1], status="not converged", message="a sentence", reason=reason.word)

    def run(parameters):
        yield from kinds.unfinished(path)
        raise der.NotConverged("a sentence", path)

    monkeypatch.setitem(kinds.RUN, "path", run)
    read, raised = suite.repeat(Case("path", {}))
    assert read.explained is raised.explained is (reason in suite.EXPLAINED)
    assert read.reason == raised.reason == f"NotConverged {reason.word}"


def test_what_takes_too_long_is_no_answer(monkeypatch):
    """A case that hangs is ended and kept."""

    def run(parameters):
        while True:
            yield from ()

    monkeypatch.setitem(kinds.RUN, "path", run)
    monkeypatch.setattr(suite, "TIME_LIMIT", 0.05)
    (failure,) = suite.repeat(Case("path", {}))
    assert failure.reason == "unexpected TimeoutError"
    assert not failure.explained


def test_a_warning_is_a_failure(monkeypatch):
    """Numpy's complaints about numbers are not overlooked."""

    def run(parameters):
        np.float64(1.0) / np.float64(0.0)
        yield "not", "reached"

    monkeypatch.setitem(kinds.RUN, "path", run)
    (failure,) = suite.repeat(Case("path", {}))
    assert failure.reason == "unexpected FloatingPointError"


# --- The checks can fail ---------------------------------------------------------------------


def test_a_good_path_has_no_faults(bar):
    """Neither in the record nor in its balance, and energy is work."""
    scene, path = bar
    assert not list(stress_checks.faults(scene, path))
    assert not list(kinds.balanced(scene, path, path.shapes))
    assert stress_checks.work_lost(path) < 1e-3


def test_states_are_asked_for_where_the_curve_is_long_and_where_steps_were_short(bar):
    """In order, up to the end, about `DENSE` to half a turn, and a share between any two states."""
    _, path = bar
    found = np.array(stress_checks.denser(path, math.pi))
    assert np.all(np.diff(found) > 0.0)
    assert (found[0], found[-1]) == (0.0, math.pi)
    passes = 1 + len(path.folds)
    assert DENSE / passes < len(found) < DENSE + 2 * len(path)
    least = math.floor(0.5 * DENSE / len(path))
    for low, high in pairwise(path.gamma):
        low, high = sorted((low, high))
        if high - low > 1e-4:
            assert np.count_nonzero((found >= low - 1e-6) & (found <= high + 1e-6)) >= least


def test_energy_that_is_not_work_is_seen(bar):
    """A moment that is 1% too large."""
    _, path = bar
    assert stress_checks.work_lost(replace(path, moment=1.01 * path.moment)) > 1e-3


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("missed fold", lambda p: {"points": p.limits}),
        ("missed limit", lambda p: {"points": p.folds}),
        ("points", lambda p: {"points": p.points[::-1]}),
        ("start", lambda p: {"gamma": p.gamma + 1e-3, "points": ()}),
        ("end", lambda p: {"gamma": np.append(p.gamma[:-1], 3.0)}),
        ("save_at", lambda p: {"gamma": np.where(p.gamma == math.pi / 2, 1.57, p.gamma)}),
        ("index", lambda p: {"index": np.arange(len(p)), "points": ()}),
    ],
)
def test_a_record_that_contradicts_itself_is_seen(bar, name, changed):
    """One thing changed, and its name comes up."""
    scene, path = bar
    assert name in names(stress_checks.faults(scene, replace(path, **changed(path), shapes=None)))


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("closure", lambda s: {"x": s.x + np.linspace(0, 1e-6, 32)[None, :, None]}),
        ("length", lambda s: {"x": 1.00001 * s.x}),
        ("frames", lambda s: {"frames": 1.00001 * s.frames}),
        ("grip", lambda s: {"frames": np.roll(s.frames, 1, axis=1)}),
    ],
)
def test_a_shape_that_is_no_ring_is_seen(bar, name, changed):
    """A gap, a stretch, a frame that is none, a grip that is not where it was turned to."""
    scene, path = bar
    shapes = replace(path.shapes, **changed(path.shapes))
    assert name in names(stress_checks.geometry(scene, path, shapes))


def test_a_state_out_of_balance_is_seen(bar):
    """Frames of one state with the gamma, moment and energy of its neighbour."""
    scene, path = bar
    shapes = replace(path.shapes, x=path.shapes.x[::-1], frames=path.shapes.frames[::-1])
    found = names(kinds.balanced(scene, path, shapes))
    assert {"energy of the full ring", "moment of the full ring"} <= found


def test_an_asymmetric_state_is_seen(bar):
    """Moved by 1e-4 at one vertex; the path's own states are symmetric to the tolerance."""
    scene, path = bar
    assert stress_checks.asymmetry(scene, path.shapes).max() < 1e-9
    x = path.shapes.x.copy()
    x[3, 5, 0] += 1e-4
    assert np.argmax(stress_checks.asymmetry(scene, replace(path.shapes, x=x))) == 3


def test_paths_of_two_rings_are_unlike(bar):
    """At another h/t values differ; the path is like itself."""
    scene, path = bar
    other = der.fold(replace(scene, section=der.rectangular_section(1.61)))
    assert not list(stress_checks.unlike(path, path, 1e-12))
    assert list(stress_checks.unlike(path, other, 1e-7))


def test_values_outside_error_bars_are_seen():
    """The reference against error bars that are too small by far."""
    scene = der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=32, error_bars=True)
    path = der.fold(scene)
    reference = der.solve_bvp(scene, tolerance=1e-9)
    assert not list(stress_checks.outside_error_bars(path, reference, kinds.TIMES))
    assert list(stress_checks.outside_error_bars(path, reference, 1e-6))


@pytest.mark.parametrize("known", [True, False])
def test_a_state_too_few_is_seen_where_errors_are_known(known):
    """Where they are null the rod has claimed nothing."""
    scene = der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=64, error_bars=True)
    reference = der.solve_bvp(replace(scene, save_at=(2.7,)), tolerance=1e-9)
    one = der.fold(replace(scene, save_at=(2.7,)))
    states = [k for k, gamma in enumerate(one.gamma) if gamma == 2.7]
    assert len(states) == 3
    moved = one.gamma.copy()
    moved[states[-1]] += 1e-3  # no longer at 2.7
    errors = dict(one.error)
    if not known:
        errors |= {name: [None] * len(one) for name in ("moment", "energy")}
    few = replace(one, gamma=moved, error=errors)
    found = list(stress_checks.outside_error_bars(few, reference, kinds.TIMES))
    assert bool(found) is known


def test_input_that_is_taken_but_must_not_be_is_seen():
    """And a refusal that names nothing, and one in many lines."""

    def refuse(text):
        raise ValueError(text)

    taking = Argument("f", ("x",), lambda value: None, {"bad": -1})
    assert "takes bad" in refusal(taking, "bad")
    assert "is not named" in refusal(taking._replace(call=lambda v: refuse("no")), "bad")
    assert "no sentence" in refusal(taking._replace(call=lambda v: refuse("x\n")), "bad")
    assert refusal(taking._replace(call=lambda v: refuse("x must be > 0, got -1")), "bad") is None


def test_every_argument_has_a_list_of_wrong_values():
    """So that none is tried with nothing but good ones."""
    without = [one.where for one in arguments() if not one.refused]
    assert without == ["ring_from_json"]


# --- Cases -----------------------------------------------------------------------------------


def test_cases_cover_what_they_are_meant_to():
    """Over 600 cases: both ends of h/t and nu, all shapes, sectors, measures, stretch, controls."""
    drawn = [case for case in cases(600, 0) if "wants" in case.parameters]
    ratios = [case.parameters["h_over_t"] for case in drawn]
    assert min(ratios) < 0.06
    assert max(ratios) > 90.0
    assert {0.0, 0.3, 0.5} <= {case.parameters["nu"] for case in drawn}
    wants = [case.parameters["wants"] for case in drawn]
    assert max(w.get("gamma_max", math.pi) for w in wants) > 8.0 * math.pi
    for name, values in {
        "sector": {"auto", "full", "half", "quarter"},
        "curvature": {"logarithm", "angle", "tangent"},
        "stretch": {"inextensible", "finite"},
        "control": {"angle", "moment"},
        "unload": {True, False},
        "error_bars": {True},
    }.items():
        assert values <= {w[name] for w in wants if name in w}, name
    assert {w["n_edges"] for w in wants if "n_edges" in w} >= {8, 16, 32}


def test_points_without_noise_are_the_rings_own():
    """And symmetric noise keeps the mirror symmetry."""
    ring = der.ellipse(0.6)
    quiet = noisy_points(ring, 24, 0.0, 0, symmetric=False)
    np.testing.assert_allclose(quiet[1:], quiet[:0:-1] * [-1.0, 1.0], atol=1e-12)
    loud = noisy_points(ring, 24, 1e-2, 0, symmetric=True)
    np.testing.assert_allclose(loud[1:], loud[:0:-1] * [-1.0, 1.0], atol=1e-12)
    assert np.abs(loud - quiet).max() > 1e-3


def test_scene_of_a_case_is_the_scene_it_was():
    """Through JSON and back, to the last bit."""
    case = next(case for case in cases(5, 0) if case.kind == "path")
    again = case_from_json(json.loads(json.dumps(case.to_json())))
    assert scene_of(again.parameters) == scene_of(case.parameters)
