"""The record comes back from disk bit for bit, and refuses what is not a record."""

import dataclasses
import json
import os
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest

from der.records.configurations import Shapes
from der.records.path import AtPi, Mode, Path, Point, Timing, counts, folding_mode

GAMMA = np.array([0.0, 0.1 + 0.2, 2.0, np.pi])


def fold(position=1, kind="fold", **changes):
    entries = {
        "kind": kind,
        "gamma": 1 / 3,
        "moment": -1e-300,
        "energy": 7.1,
        "index_before": 0,
        "index_after": None,
        "position": position,
        "details": {"symmetry": "odd", "linking_before": 0, "linking_after": 2},
    }
    return Point(**(entries | changes))


def path(**changes):
    entries = {
        "solver": "der",
        "ring": {"shape": "ellipse", "b_over_a": 0.85, "twist_axis": "y"},
        "section": {"h_over_t": 4, "nu": 0.3, "alpha": 0.771569332, "beta": 12.345},
        "numerics": {"n_edges": np.int64(64), "save_at": (0.1, np.float64(0.2)), "sector": None},
        "gamma": GAMMA,
        "moment": np.array([-0.0, 5e-324, 1 / 3, 1e-12]),
        "energy": np.array([0.0, 1e17 / 3, np.nextafter(1.0, 2.0), 9.7]),
        "index": counts([0, None, 2, 0]),
        "index_moment": counts([None, 1, 3, 0]),
        "points": (fold(), fold(2, kind="limit")),
        "at_pi": AtPi(1e-12, 0.0814673, 9.7, 0, 0, None),
        "mode": Mode(foldable=True, stable=True, snapping="snap-back", stable_3d=True),
        "error": None,
        "timing": Timing(solve_s=0.25, newton_iterations=31, steps=12),
    }
    return Path(**(entries | changes))


def altered(**changes):
    """JSON of a good path with entries replaced, or left out where the value is ... ."""
    entries = json.loads(path().to_json()) | changes
    return json.dumps({name: value for name, value in entries.items() if value is not ...})


# --- there and back -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gamma", "moment", "energy"])
def test_floats_come_back_bit_for_bit(name, tmp_path):
    """The repr of a double is exact: denormals, -0.0 and last bits survive the file."""
    before = path()
    before.save(tmp_path / "path.json")
    after = Path.load(tmp_path / "path.json")
    assert getattr(after, name).tobytes() == getattr(before, name).tobytes()


def test_every_entry_comes_back(tmp_path):
    """A loaded path says the same JSON, and the same objects, as the saved one."""
    bars = {
        "gamma": [0, None, 1e-9, 0.0],
        "moment": [None] * 4,
        "energy": [1e-9] * 4,
        "how": "64/32",
    }
    before = path(
        status="not converged", message="Newton stalled at 2.1", error=bars, raw={"moment": [1.5]}
    )
    before.save(tmp_path / "path.json")
    after = Path.load(tmp_path / "path.json")
    assert after.to_json() == before.to_json()
    for name in ("points", "at_pi", "mode", "timing", "numerics", "error", "raw", "message"):
        assert getattr(after, name) == getattr(before, name), name


def test_unknown_index_is_null_in_the_file_and_masked_in_memory():
    """Index entries are null where stability was not asked for."""
    text = path().to_json()
    assert json.loads(text)["index"] == [0, None, 2, 0]
    index = Path.from_json(text).index
    assert index.mask.tolist() == [False, True, False, False]
    assert index.dtype == np.int64


def test_json_has_the_entries_of_the_contract():
    """The record is a contract: the names and the nesting, readable without this package."""
    record = json.loads(path().to_json())
    assert record["schema"] == 1
    assert set(record) == {
        *(
            "schema",
            "solver",
            "status",
            "message",
            "reason",
            "ring",
            "section",
            "numerics",
            "gamma",
            "moment",
        ),
        *("energy", "index", "index_moment", "points", "at_pi", "mode", "error", "timing"),
    }
    assert record["error"] is None
    assert set(record["at_pi"]) == {
        *("moment", "slope", "energy", "index", "index_moment", "index_free")
    }
    assert set(record["mode"]) == {"foldable", "stable", "snapping", "stable_3d", "stable_free"}
    assert set(record["timing"]) == {"solve_s", "newton_iterations", "steps"}


def test_details_of_a_point_are_flat_in_the_json():
    """A contact's linking numbers stand beside its gamma, not in an object of their own."""
    point = json.loads(path().to_json())["points"][0]
    assert point["linking_after"] == 2
    assert "details" not in point


def test_path_that_never_reached_pi_has_null_at_pi_and_mode():
    text = path(at_pi=None, mode=None).to_json()
    record = json.loads(text)
    assert (record["at_pi"], record["mode"]) == (None, None)
    assert Path.from_json(text).mode is None


def test_file_without_status_is_a_done_path():
    """The contract lists neither status nor message: a file without them is complete."""
    assert Path.from_json(altered(status=..., message=...)).status == "done"


def test_file_without_a_reason_has_none():
    """Files that were written before the entry was there."""
    assert Path.from_json(altered(reason=...)).reason == ""


def test_reason_comes_back():
    """By the name of the enum, not by its sentence."""
    assert Path.from_json(path(reason="turned_back").to_json()).reason == "turned_back"
    with pytest.raises(ValueError, match="reason must be one of"):
        path(reason="gamma turns back")


def test_path_survives_pickling():
    """Paths travel between the workers of a phase diagram."""
    assert pickle.loads(pickle.dumps(path())).to_json() == path().to_json()


# --- the object -----------------------------------------------------------------------------


def test_points_are_sorted_by_kind():
    kinds = ("fold", "limit", "branch", "contact", "snap", "fold")
    subject = path(points=[fold(kind=kind) for kind in kinds])
    found = [len(getattr(subject, name)) for name in ("folds", "limits", "branches", "contacts")]
    assert found == [2, 1, 1, 1]


def test_length_is_the_number_of_states():
    assert len(path()) == 4


@pytest.mark.parametrize("name", ["gamma", "index", "index_moment"])
def test_arrays_are_read_only(name):
    with pytest.raises(ValueError, match="read-only"):
        getattr(path(), name)[0] = 1


def test_unknown_index_cannot_be_unmasked():
    with pytest.raises(ValueError, match="read-only"):
        path().index[0] = np.ma.masked


def test_arrays_of_the_caller_stay_his_own():
    """The record copies: what the solver goes on doing with its arrays is not recorded."""
    gamma = GAMMA.copy()
    subject = path(gamma=gamma)
    gamma[1] = 1.0
    assert subject.gamma[1] == GAMMA[1]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["gamma", "moment", "energy"])
def test_number_that_is_not_finite_is_refused_by_name_and_place(name, bad):
    values = np.array([0.0, 1.0, bad, 2.0])
    with pytest.raises(ValueError, match=rf"{name}\[2\]"):
        path(**{name: values})


@pytest.mark.parametrize(
    ("build", "named"),
    [
        (lambda: fold(gamma=np.nan), "gamma"),
        (lambda: fold(details={"released": [1.0, np.inf]}), r"details\.released\[1\]"),
        (lambda: AtPi(0.0, np.nan, 1.0, None, None, None), "slope"),
        (lambda: Timing(np.inf, 1, 1), "solve_s"),
        (lambda: path(numerics={"tolerance": np.nan}), r"numerics\.tolerance"),
        (lambda: path(ring={"profile": {"k": np.array([np.inf])}}), r"ring\.profile\.k\[0\]"),
        (lambda: path(raw={"energy": [np.nan]}), r"raw\.energy\[0\]"),
        (lambda: Shapes(np.full((1, 2, 3), np.nan), np.zeros((1, 2, 3, 3))), r"x\[0, 0, 0\]"),
    ],
)
def test_number_that_is_not_finite_is_refused_wherever_it_hides(build, named):
    with pytest.raises(ValueError, match=named):
        build()


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"solver": "abaqus"}, "solver"),
        ({"status": "finished"}, "status"),
        ({"moment": np.zeros(3)}, "moment"),
        ({"energy": np.zeros((4, 1))}, "energy"),
        ({"gamma": np.array(["0", "1", "2", "3"])}, "gamma"),
        ({"gamma": np.ma.masked_equal(GAMMA, 2.0)}, "gamma"),
        ({"index": counts([0, 1])}, "index"),
        ({"index": np.ma.array([0.0, 1.0, 2.0, 0.0])}, "index"),
        ({"index_moment": np.ma.array([0, -1, 0, 0])}, r"index_moment\[1\]"),
        ({"points": (fold(position=4),)}, r"points\[0\]"),
        ({"ring": {"shape": object()}}, r"ring\.shape"),
        ({"numerics": {3: 1}}, "numerics"),
        ({"error": {"gamma": [0.0] * 4}}, "error"),
        (
            {"error": {"gamma": [0.0] * 3, "moment": [0.0] * 4, "energy": [0.0] * 4, "how": ""}},
            r"error\.gamma",
        ),
    ],
)
def test_path_with_a_wrong_entry_is_refused_by_name(changes, named):
    with pytest.raises(ValueError, match=named):
        path(**changes)


def test_error_bars_must_be_numbers():
    bars = {"gamma": ["small"] * 4, "moment": [None] * 4, "energy": [None] * 4, "how": ""}
    with pytest.raises(ValueError, match=r"error\.gamma\[0\]"):
        path(error=bars)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"kind": "cusp"}, "kind"),
        ({"index_before": -1}, "index_before"),
        ({"index_after": 1.0}, "index_after"),
        ({"position": True}, "position"),
        ({"moment": "1"}, "moment"),
        ({"details": {"gamma": 1.0}}, "gamma"),
    ],
)
def test_point_with_a_wrong_entry_is_refused_by_name(changes, named):
    with pytest.raises(ValueError, match=named):
        fold(**changes)


def test_mode_has_one_of_three_snappings():
    with pytest.raises(ValueError, match="snapping"):
        Mode(foldable=True, stable=True, snapping="sometimes", stable_3d=None)


def test_records_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        path().status = "done"


# --- broken files ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not JSON"),
        (path().to_json()[:200], "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[1]", "list"),
        (altered(schema=2), "schema is 2"),
        (altered(schema=...), "schema"),
        (altered(gamma=...), "gamma"),
        (altered(gamma=[0, None, 1, 2]), r"gamma\[1\]"),
        (altered(gamma=[0, "1", 1, 2]), r"gamma\[1\]"),
        (altered(moment=[0, float("nan"), 1, 2]), r"moment\[1\]"),
        (path().to_json().replace("0.85", "1e999"), r"ring\.b_over_a"),
        (altered(energy=[0, 10**400, 1, 2]), r"energy\[1\]"),
        (altered(index=[0, 0.5, 1, 2]), r"index\[1\]"),
        (altered(index=[0, 10**30, 1, 2]), r"index\[1\]"),
        (altered(index_moment=...), "index_moment"),
        (altered(at_pi=...), "at_pi"),
        (altered(at_pi={"moment": 0.0}), "at_pi"),
        (
            altered(mode={"foldable": 1, "stable": 1, "snapping": "none", "stable_3d": 1}),
            "foldable",
        ),
        (altered(points=[{"kind": "fold"}]), r"points\[0\]"),
        (altered(points=[3]), r"points\[0\]"),
        (altered(timing=None), "timing"),
        (altered(gama=[]), "gama"),
        (altered(shapes=None), "shapes"),
        (altered(ring=7), "ring"),
    ],
)
def test_broken_file_is_refused_by_name_and_reason(text, said, tmp_path):
    """One sentence that names the file and what is wrong with it, for whatever is in the file."""
    file = tmp_path / "broken.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=rf"broken\.json: .*{said}"):
        Path.load(file)


def test_file_that_is_not_text_is_refused_by_name(tmp_path):
    file = tmp_path / "broken.json"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"broken\.json"):
        Path.load(file)


def test_absent_file_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"absent\.json"):
        Path.load(tmp_path / "absent.json")


# --- saving ---------------------------------------------------------------------------------


def test_saving_replaces_the_file_and_leaves_nothing_else(tmp_path):
    file = tmp_path / "path.json"
    file.write_text("old")
    path().save(file)
    assert Path.load(file).solver == "der"
    assert os.listdir(tmp_path) == ["path.json"]


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_failed_saving_keeps_the_old_file_and_leaves_nothing_else(tmp_path, monkeypatch, failure):
    """A full disk or Ctrl-C in the middle costs nothing already saved."""

    def fail(_):
        raise failure

    file = tmp_path / "path.json"
    file.write_text("old")
    monkeypatch.setattr("der.utils.files.os.fsync", fail)
    with pytest.raises(type(failure)):
        path().save(file)
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["path.json"]


def test_absent_folder_is_named(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        path().save(tmp_path / "nowhere" / "path.json")


def test_saved_file_has_the_permissions_of_any_other(tmp_path):
    """The temporary file is renamed into place: it must not bring a private mode with it."""
    (tmp_path / "other").write_text("")
    path().save(tmp_path / "path.json")
    assert (tmp_path / "path.json").stat().st_mode == (tmp_path / "other").stat().st_mode


def test_threads_that_save_to_one_file_leave_one_whole_file(tmp_path):
    file = tmp_path / "path.json"
    threads = [threading.Thread(target=path().save, args=(file,)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert Path.load(file).to_json() == path().to_json()
    assert os.listdir(tmp_path) == ["path.json"]


# --- shapes ---------------------------------------------------------------------------------


def shapes(n=4):
    rng = np.random.default_rng(1)
    return Shapes(x=rng.normal(size=(n, 5, 3)), frames=rng.normal(size=(n, 5, 3, 3)))


def test_shapes_belong_to_every_state():
    with pytest.raises(ValueError, match="shapes"):
        path(shapes=shapes(3))


# --- folding mode ---------------------------------------------------------------------------

UP = np.linspace(0.0, np.pi, 9)


def mode(points=(), gamma=UP, at_pi=None, three_covered=True):
    at_pi = at_pi or AtPi(1e-9, 0.3, 9.7, 0, 0, 0)
    return folding_mode(gamma, np.sin(gamma), points, at_pi, three_covered=three_covered)


def test_folded_ring_with_positive_slope_is_stable():
    """Foldable is M = 0 and three-covered at pi, stable is dM/dgamma > 0 there."""
    assert mode() == Mode(
        foldable=True, stable=True, snapping="none", stable_3d=True, stable_free=True
    )


def test_folded_ring_with_negative_slope_is_unstable():
    assert mode(at_pi=AtPi(0.0, -0.647448, 9.7, 0, 1, None)).stable is False


def test_ring_with_a_moment_at_pi_is_not_foldable_and_its_stability_not_asked():
    """A path can arrive at pi elsewhere than at the folded state: h/t below 1.507577."""
    found = mode(at_pi=AtPi(2.4456, 0.3, 9.7, 0, 0, None))
    assert (found.foldable, found.stable) == (False, None)


def test_ring_without_moment_that_is_not_three_covered_is_not_foldable():
    assert not mode(three_covered=False).foldable


def test_index_with_the_moment_held_decides_stability_in_space():
    found = [mode(at_pi=AtPi(0.0, 1.0, 9.7, 0, index, None)).stable_3d for index in (0, 2, None)]
    assert found == [True, False, None]


def test_index_without_grips_decides_whether_a_folded_ring_stays_so():
    """Null where the index is not known, and of a ring that is not folded."""
    found = [mode(at_pi=AtPi(0.0, 1.0, 9.7, 0, 0, index)).stable_free for index in (0, 1, None)]
    assert found == [True, False, None]
    assert mode(three_covered=False).stable_free is None


def test_a_mode_of_an_older_record_does_not_say_whether_the_ring_stays_folded():
    """Its entry is null when it is read."""
    record = json.loads(path().to_json())
    del record["mode"]["stable_free"]
    assert Path.from_json(json.dumps(record)).mode.stable_free is None


def test_fold_on_the_path_is_a_snap_back_even_beside_limits():
    assert mode([fold(3, kind="limit"), fold(5)]).snapping == "snap-back"


def test_limit_alone_is_a_snap_through():
    assert mode([fold(3, kind="limit"), fold(4, kind="branch")]).snapping == "snap-through"


def test_points_beyond_the_first_arrival_do_not_count():
    """The mode is judged on the path up to its first arrival at pi; paths go on (Appendix C.1)."""
    beyond = np.append(UP, [3.5, 4.0, 3.5, np.pi])
    points = [fold(3, kind="limit"), fold(10)]
    assert mode(points, gamma=beyond).snapping == "snap-through"


def test_path_that_never_reaches_pi_has_no_mode():
    with pytest.raises(ValueError, match="never reaches pi"):
        mode(gamma=UP[:-1])


# --- the module -----------------------------------------------------------------------------


def test_importing_the_record_imports_no_kernel():
    """The answer is free of kernels, so that reading a file costs nothing."""
    heavy = ("numba", "scipy", "matplotlib", "rerun", "typer")
    script = f"import sys, der.records.path; print([m for m in {heavy} if m in sys.modules])"
    shown = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert shown.stdout.strip() == "[]"
