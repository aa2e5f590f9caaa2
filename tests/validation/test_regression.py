"""The regression command: a checkout agrees with itself, and what has changed is noticed.

One ring is solved by both solvers, in a process of its own; diagrams are made up.
"""

import json
import math
from pathlib import Path

import pytest

from validation.regression import main

ROOT = Path(__file__).parents[2]
RING = "circle_1.6"
FOLD = f"{RING}.fold.json"
ONLY = ["--tree", str(ROOT), "--only", "paper", "--match", RING]


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    """Records of a ring with two folds."""
    folder = tmp_path_factory.mktemp("old")
    assert main(["dump", str(folder), *ONLY]) == 0
    return folder


def changed(old, new, change):
    """A folder with the same records, of which one is changed."""
    (new / "paper").mkdir()
    for file in (old / "paper").iterdir():
        record = json.loads(file.read_text())
        if file.name == FOLD:
            change(record)
        (new / "paper" / file.name).write_text(json.dumps(record))
    return new


def fold_of(record, kind="fold"):
    return next(point for point in record["points"] if point["kind"] == kind)


def at_half_pi(record):
    return record["gamma"].index(math.pi / 2)


def step(record):
    """A state that nobody asked for and that is no special point."""
    return next(k for k, gamma in enumerate(record["gamma"]) if 0.0 < gamma < math.pi / 8)


def test_a_checkout_agrees_with_itself(old, capsys):
    assert {file.name for file in (old / "paper").iterdir()} == {FOLD, f"{RING}.bvp.json"}
    assert main(["compare", str(old), str(old)]) == 0
    assert capsys.readouterr().out.splitlines()[1].split()[:3] == ["paper", "2", "2"]


def test_a_dump_goes_on_where_it_was_stopped(old, tmp_path, capfd):
    changed(old, tmp_path, lambda record: None)
    (tmp_path / "paper" / FOLD).unlink()
    assert main(["dump", str(tmp_path), *ONLY]) == 0
    assert "1 cases written" in capfd.readouterr().err
    assert main(["compare", str(old), str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: fold_of(r).update(gamma=fold_of(r)["gamma"] + 1e-6), "gamma was 2.7"),
        (lambda r: fold_of(r).update(index_after=2), "index_after was 1, is 2"),
        (lambda r: r["index"].__setitem__(at_half_pi(r), 1), "was 0, is 1"),
        (lambda r: r["moment"].__setitem__(at_half_pi(r), r["moment"][0] + 1.0), "moment["),
        (lambda r: r["error"]["energy"].__setitem__(at_half_pi(r), 1e-3), "error.energy["),
        (lambda r: r["at_pi"].update(slope=r["at_pi"]["slope"] * (1 + 1e-8)), "at_pi.slope"),
        (lambda r: r["mode"].update(snapping="none"), "mode.snapping was 'snap-back', is 'none'"),
        (lambda r: r.update(status="not converged"), "status was 'done', is 'not converged'"),
        (lambda r: r.pop("raw"), "is missing"),
        (lambda r: r["points"].pop(), "points.length was"),
    ],
)
def test_what_has_changed_is_noticed(old, tmp_path, capsys, change, words):
    assert main(["compare", str(old), str(changed(old, tmp_path, change))]) == 3
    assert f"paper/{RING}.fold: " in (told := capsys.readouterr().out)
    assert words in told


@pytest.mark.parametrize(
    "change",
    [
        lambda r: r.update(temperature=300.0),
        lambda r: r["moment"].__setitem__(step(r), 7.0),
        lambda r: fold_of(r).update(gamma=fold_of(r)["gamma"] + 1e-9),
        lambda r: fold_of(r, "contact").update(gamma=fold_of(r, "contact")["gamma"] + 1e-5),
        lambda r: r["timing"].update(steps=1),
    ],
    ids=["a new entry", "where steps end", "rounding", "bisected", "what it took"],
)
def test_what_does_not_matter_is_not_judged(old, tmp_path, change):
    assert main(["compare", str(old), str(changed(old, tmp_path, change))]) == 0


def test_a_record_that_is_missing_is_noticed(old, tmp_path, capsys):
    changed(old, tmp_path, lambda record: None)
    (tmp_path / "paper" / FOLD).unlink()
    assert main(["compare", str(old), str(tmp_path)]) == 3
    assert "there is no such new record" in capsys.readouterr().out


def diagram(folder, *, shift=0.0, off=0.0, corner=0.5, label="unfoldable"):
    """A diagram with an arc for a boundary, its points shifted along it or off it."""
    empty = dict.fromkeys(("r_over_a", "vertex_angle", "natural_curvature"), "")
    empty |= {"twist_axis": "x", "shape": "ellipse", "nu": "0.3"}

    def row(x, y, **more):
        return empty | {"b_over_a": repr(x), "h_over_t": repr(y)} | more

    angles = [0.1 * (k + shift) for k in range(11)]
    arc = [((1.0 + off) * math.cos(a), (1.0 + off) * math.sin(a)) for a in angles]
    tables = {
        "cases": [
            row(0.0, 0.0, label=label),
            row(1.0, 1.0, label="stable at fixed moment, snap-back"),
        ],
        "boundaries": [row(*place, boundary="stability", curve="0") for place in arc],
        "corners": [row(corner, corner, boundary="stability", other="snap-back")],
    }
    (folder / "diagrams").mkdir(parents=True)
    (folder / "diagrams" / "fig3a.json").write_text(json.dumps(tables))
    return str(folder)


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ({}, 0, ""),
        ({"off": 1e-7}, 0, ""),
        ({"off": 1e-4}, 3, "stability"),
        ({"corner": 0.5 + 1e-6}, 3, "snap-back"),
        (
            {"label": "stable at fixed moment, snap-back"},
            3,
            "was 'unfoldable', is 'stable at fixed moment, snap-back'",
        ),
    ],
)
def test_diagrams_are_compared_as_curves(tmp_path, capsys, change, code, words):
    old, new = diagram(tmp_path / "old"), diagram(tmp_path / "new", **change)
    assert main(["compare", old, new]) == code
    assert words in capsys.readouterr().out


def test_points_may_shift_along_a_boundary(tmp_path):
    """By half a step of 0.1 rad: chords are 1.25e-3 off the arc, the spline is 5e-6; equal ends."""
    old, new = diagram(tmp_path / "old"), diagram(tmp_path / "new", shift=0.5)
    for folder in (old, new):
        file = Path(folder) / "diagrams" / "fig3a.json"
        tables = json.loads(file.read_text())
        first, last = (
            tables["boundaries"][0] | {"b_over_a": repr(math.cos(a)), "h_over_t": repr(math.sin(a))}
            for a in (-0.05, 1.1)
        )
        tables["boundaries"] = [first, *tables["boundaries"], last]
        file.write_text(json.dumps(tables))
    assert main(["compare", old, new]) == 0
