"""Phase diagrams from the scan to the files: regions, boundaries, tables, check by the rod."""

import csv
import math
import multiprocessing
import re
import time
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import typer
from here import Here

import der
from der.cli.figures import PhaseOptions
from der.cli.figures import phase as command
from der.diagram.cases import LABELS, Row
from der.diagram.curves.slices import Boundaries
from der.diagram.diagram import phase_diagram
from der.diagram.families import family
from der.diagram.picture import picture
from der.diagram.rod_check import rod_check, table
from der.diagram.scan import scan
from der.diagram.scanned_boundaries import BoundaryPoint, Curve, scanned_boundaries
from der.diagram.store import Store
from der.paper import draw
from der.viz.plots.phase_diagram import draw as draw_diagram
from der.viz.plots.regions import pixels
from der.viz.plots.style import save
from validation.benchmark import phase as bench_phase
from validation.stress import kill_and_resume as killed

FORMAT = b"\x89PNG\r\n"
CIRCLES = {"b_over_a": (0.9, 1.0), "h_over_t": (1.25, 2.25)}
THRESHOLDS = {"foldability": 1.5076, "snap-back": 1.8396, "stability": 3.4699}  # h/t of circles


def scanned(of, folder, solve=None):
    options = {} if solve is None else {"solve": solve}
    with Store(folder / "cases.sqlite") as store:
        return scan(of, store, Here(1), progress=False, **options)


def rows_of(file):
    with open(file, newline="") as opened:
        return list(csv.DictReader(opened))


@pytest.fixture(scope="module")
def without_curves():
    """Boundaries as the scan sees them: following them is tested by itself."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "der.diagram.distributed.follow",
            lambda found, *rest: Boundaries(scanned_boundaries(found), []),
        )
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("phase")


@pytest.fixture(scope="module")
def diagram(folder, without_curves):
    """A small part of fig3a round the circle, with the rod asked about some of it."""
    options = {"ranges": CIRCLES, "finest": 4, "check": der.fold, "sample": 8}
    return phase_diagram("fig3a", folder, workers=1, progress=False, **options)


# --- The files -------------------------------------------------------------------------------


def test_files_are_written(diagram, folder):
    """Tables and picture; the store beside them."""
    names = {file.name for file in diagram.files}
    assert names == {"cases.csv", "boundaries.csv", "corners.csv", "check.csv", "fig3a.png"}
    assert {file.name for file in folder.iterdir()} == names | {"cases.sqlite"}
    assert (folder / "fig3a.png").read_bytes().startswith(FORMAT)


def test_a_diagram_is_short_in_print_and_draws_itself(diagram, tmp_path):
    """As records do."""
    assert repr(diagram).startswith(f"PhaseDiagram(fig3a, {len(diagram.rows)} cases, ")
    assert diagram.plot(tmp_path / "x.png").axes
    assert (tmp_path / "x.png").read_bytes().startswith(FORMAT)


def test_table_of_cases_holds_every_case_once(diagram, folder):
    """By the parameters' Python names, with label, moment and slope at pi."""
    table_of = rows_of(folder / "cases.csv")
    assert len(table_of) == len(diagram.rows) == len({row.case for row in diagram.rows})
    for cells, row in zip(table_of, diagram.rows, strict=True):
        assert (float(cells["b_over_a"]), cells["r_over_a"]) == (row.case.b_over_a, "")
        assert (cells["label"], float(cells["slope"])) == (row.label, row.slope)


def test_table_of_boundaries_holds_every_point(diagram, folder):
    """In the order of the curves."""
    table_of = rows_of(folder / "boundaries.csv")
    points = [(curve.kind, point) for curve in diagram.curves for point in curve.points]
    assert len(table_of) == len(points)
    for cells, (kind, point) in zip(table_of, points, strict=True):
        assert (cells["boundary"], float(cells["h_over_t"])) == (kind, point.case.h_over_t)
    assert list(table_of[0]) == [
        *("boundary", "twist_axis", "b_over_a", "r_over_a", "vertex_angle"),
        *("natural_curvature", "h_over_t", "nu", "gamma", "moment", "error", "curve"),
    ]


def test_folder_with_cases_is_refused_unless_resumed(diagram, folder):
    """Nothing that is finished is ever overwritten by mistake."""
    options = {"ranges": CIRCLES, "finest": 4, "workers": 1, "progress": False}
    with pytest.raises(ValueError, match="resume must be asked for in a folder that has cases"):
        phase_diagram("fig3a", folder, **options)
    before = (folder / "cases.csv").read_bytes()
    again = phase_diagram("fig3a", folder, resume=True, **options)
    assert again.scan.solved == 0
    assert (folder / "cases.csv").read_bytes() == before


def options_of(folder, **more):
    """Options of the command for the diagram of these tests."""
    span = ["b_over_a=0.9:1", "h-over-t=1.25:2.25"]
    return PhaseOptions("fig3a", str(folder), workers=1, resume=True, span=span, finest=4, **more)


def test_command_says_what_it_did(diagram, folder, capsys):
    """Cases by label, boundaries and files."""
    assert command(options_of(folder)) == 0
    text = capsys.readouterr().out
    assert f"{len(diagram.rows)} cases, 0 solved now" in text
    assert "unstable at fixed moment, snap-back" in text
    assert str(folder / "fig3a.png") in text


def test_what_is_left_open_is_told_also_quietly(diagram, folder, monkeypatch, capsys):
    """Without boundaries, edges of the scan; with one that ends in the middle, that end."""
    half = [replace(curve, points=curve.points[:2]) for curve in diagram.curves]
    for curves in ([], half):
        monkeypatch.setattr(
            "der.diagram.distributed.follow", lambda *_, c=curves: Boundaries(c, [])
        )
        command(options_of(folder, quiet=True))
    output = capsys.readouterr()
    assert output.out == ""
    told = [line.removeprefix("der: ") for line in output.err.splitlines()]
    monkeypatch.setattr(
        "der.diagram.diagram.phase_diagram", lambda *_, **__: replace(diagram, curves=half)
    )
    drawn = []
    draw(["fig3a"], folder, warn=drawn.append)
    assert drawn == told[-2:]
    assert re.fullmatch(r"fig3a: edges of the scan without a boundary .*: \d+", told[0])
    assert re.fullmatch(
        r"fig3a: loose ends of boundaries: \d+, the first with b_over_a = .*", told[-1]
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ranges": {"r_over_a": (0.1, 1.0)}}, "ranges of fig3a must be of b_over_a, h_over_t"),
        ({"sample": 0}, "sample must be an integer from 1, got 0"),
        ({"workers": 0}, "workers must be an integer from 1, got 0"),
        ({"workers": 2, "scheduler": "tcp://x:1"}, "workers cannot be given together with a"),
    ],
)
def test_what_is_not_allowed_is_refused_by_name(tmp_path, options, message):
    with pytest.raises(ValueError, match=message):
        phase_diagram("fig3a", tmp_path / "new", **options)


def test_range_needs_two_numbers(tmp_path):
    """The message names the option and shows its form."""
    with pytest.raises(typer.TyperException, match=r"must be like b_over_a=0\.7:1, got 'b_over_a'"):
        command(PhaseOptions("fig3a", str(tmp_path / "new"), span=["b_over_a"]))


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"folder must be one that can be made, got .*file'"):
        phase_diagram("fig3a", tmp_path / "file")


def test_no_worker_is_left_behind(diagram):
    """The pool ends with the scan."""
    assert not multiprocessing.active_children()


def test_figure_has_a_folder_of_its_own(diagram, tmp_path, monkeypatch):
    """Else the diagrams of `der figure all` would share their tables."""
    asked = []

    def note(name, folder, **options):
        asked.append((name, folder, options["resume"]))
        return replace(diagram, files=(tmp_path / "fig3a" / "fig3a.png",))

    monkeypatch.setattr("der.diagram.diagram.phase_diagram", note)
    drawn = draw(["fig3a"], tmp_path)
    assert drawn.written == {"fig3a": [tmp_path / "fig3a" / "fig3a.png"]}
    assert asked == [("fig3a", tmp_path / "fig3a", True)]


# --- Boundaries of a scan --------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["foldability", "snap-back"])
def test_scanned_boundaries_pass_the_circle_where_they_should(diagram, kind):
    """Within the error that each point states, on both sides of b/a = 1."""
    for axis in "xy":
        near = [
            point
            for curve in diagram.curves
            if curve.kind == f"{kind} (scan)" and curve.twist_axis == axis
            for point in curve.points
            if point.case.b_over_a == 1.0
        ]
        assert len(near) == 1
        assert near[0].case.h_over_t == pytest.approx(THRESHOLDS[kind], abs=near[0].error)


def test_stability_of_circles_is_interpolated(tmp_path):
    """The slope at pi is smooth: a tenth of a cell, where h/t = 3 to 4 in eight cells."""
    of = replace(
        family("fig3a", ranges={"b_over_a": (0.98, 1.0), "h_over_t": (3.0, 4.0)}, finest=8),
        coarse=2,
    )
    curves = scanned_boundaries(scanned(of, tmp_path))
    assert {curve.kind for curve in curves} == {"stability (scan)", "stays folded (scan)"}
    slopes = [curve for curve in curves if curve.kind == "stability (scan)"]
    at = [p.case.h_over_t for c in slopes for p in c.points if p.case.b_over_a == 1.0]
    assert at == pytest.approx([THRESHOLDS["stability"]] * 2, abs=0.0125)


def disc(case):
    """Foldable within a disc, stable in its upper half, snapping back in its right half."""
    x, y = (case.r_over_a - 0.1) / 0.9, (case.h_over_t - 1.0) / 3.0
    if math.hypot(x - 0.5, y - 0.5) > 0.3:
        return Row(case, LABELS[0], moment=1.0, slope=-5.0)
    stable, back = y > 0.5, x > 0.5
    words = LABELS[1 + 2 * stable + back]
    folds = (2.0, 1.0) if back else ()
    return Row(
        case, words, True, stable, words.split(", ")[1], moment=0.0, slope=y - 0.5, folds=folds
    )


@pytest.fixture(scope="module")
def disc_scan(tmp_path_factory):
    return scanned(family("fig5c", finest=64), tmp_path_factory.mktemp("disc"), disc)


def test_closed_boundary_is_one_closed_curve(disc_scan):
    """A circle of radius 0.3, in order: neighbours are at most a cell's diagonal apart."""
    curves = [c for c in scanned_boundaries(disc_scan) if c.kind == "foldability (scan)"]
    assert len(curves) == 1
    unit = np.array([disc_scan.family.unit(point.case) for point in curves[0].points])
    np.testing.assert_allclose(np.linalg.norm(unit - 0.5, axis=1), 0.3, atol=0.75 / 64)
    np.testing.assert_array_equal(unit[0], unit[-1])
    assert np.linalg.norm(np.diff(unit, axis=0), axis=1).max() <= math.sqrt(2) / 64 + 1e-9


def test_boundaries_within_the_foldable_are_not_drawn_outside(disc_scan):
    """Stability and snapping are asked of foldable rings only: two diameters."""
    curves = [c for c in scanned_boundaries(disc_scan) if c.kind != "foldability (scan)"]
    assert Counter(curve.kind for curve in curves) == {"stability (scan)": 1, "snap-back (scan)": 1}
    for curve in curves:
        unit = np.array([disc_scan.family.unit(point.case) for point in curve.points])
        along = 0 if curve.kind.startswith("stab") else 1
        assert np.ptp(unit[:, along]) == pytest.approx(0.6, abs=3 / 64)
        assert np.ptp(unit[:, 1 - along]) < 1.01 / 64


def test_colours_change_where_the_boundary_is(tmp_path):
    """With the exact circle given, between nodes too.

    On a lattice of 16 no pixel a tenth of a cell away from it is wrong; by nodes alone, many are.
    """
    of = family("fig5c", finest=16)
    found = scanned(of, tmp_path, disc)
    turn = np.linspace(0.0, 2.0 * math.pi, 200)
    places = zip(0.5 + 0.3 * np.cos(turn), 0.5 + 0.3 * np.sin(turn), strict=True)
    points = [BoundaryPoint(of.case("x", place), math.pi, 0.0, 0.0) for place in places]
    curves = [Curve("foldability", "x", tuple(points))]
    wrong = []
    for lines in (curves, []):
        (plane,) = picture(found, lines).slices
        colours = pixels(plane.sheets[0], plane.boundaries)
        at = (np.arange(len(colours)) + 0.5) / len(colours) - 0.5
        radius = np.hypot(*np.meshgrid(at, at, indexing="ij"))
        clear = np.abs(radius - 0.3) > 0.1 / 16
        wrong.append(((colours > 0) != (radius < 0.3)) & clear)
    assert [int(pixels.sum()) > 0 for pixels in wrong] == [False, True]


@pytest.mark.parametrize("name", ["fig5a", "fig8a"])
def test_cube_is_drawn_in_slices(tmp_path, name):
    """With boundaries in them that stay in their slice."""

    def wedge(case):
        foldable = case.h_over_t > 2.2 + case.r_over_a
        label = LABELS[3] if foldable else LABELS[0]
        return Row(case, label, foldable, foldable, "snap-through", moment=0.0, slope=1.0)

    of = replace(family(name, finest=8), coarse=4)
    found = scanned(of, tmp_path, wedge)
    curves = scanned_boundaries(found)
    for curve in curves:
        parts = [of.unit(point.case)[1] for point in curve.points]
        assert parts == pytest.approx([round(4 * parts[0]) / 4] * len(parts), abs=1e-9)
    file = tmp_path / f"{name}.png"
    save(draw_diagram(picture(found, curves)), file)
    assert file.read_bytes().startswith(FORMAT)


def test_failed_cases_have_a_colour_of_their_own(tmp_path):
    """White, and a word in the legend."""

    def fails(case):
        return (
            Row(case, "failed", status="failed", message="no")
            if case.r_over_a > 0.5
            else disc(case)
        )

    found = scanned(family("fig5c", finest=16), tmp_path, fails)
    figure = draw_diagram(picture(found, []))
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "failed" in said


def test_a_wedge_between_nodes_is_coloured(tmp_path):
    """A band of a fifth of a cell that no node lies in: by the cases solved beside its curves."""
    of = family("fig5c", finest=16)

    def band(case):
        y = (case.h_over_t - 1.0) / 3.0 * 16
        k = int(y > 8.4) + int(y > 8.6)
        names = (LABELS[0], LABELS[2], LABELS[1])
        return Row(case, names[k], k > 0, False, "none", moment=0.0, slope=-1.0)

    found = scanned(of, tmp_path, band)
    curves, beside = [], []
    for kind, y in (("foldability", 8.4), ("snap-back", 8.6)):
        points = [BoundaryPoint(of.case("x", (x, y / 16)), 3.0, 0.0, 0.0) for x in (0.0, 1.0)]
        curves.append(Curve(kind, "x", tuple(points)))
    places = [((k + 0.5) / 16, y / 16) for k in range(16) for y in (8.35, 8.45, 8.55, 8.65)]
    beside = [band(of.case("x", place)) for place in places]
    wrong = []
    for rows in (beside, []):
        (plane,) = picture(found, curves, rows).slices
        colours = pixels(plane.sheets[0], plane.boundaries)
        y = (np.arange(len(colours)) + 0.5) / len(colours) * 16
        expected = np.array([0, 2, 1])[(y > 8.4).astype(int) + (y > 8.6)]
        wrong.append(int((colours != expected).sum()))
    assert wrong[0] == 0
    assert wrong[1] > 0


# --- What it takes ---------------------------------------------------------------------------


def test_bench_adds_up_what_cases_take():
    """Every case once; the CPU time of this process is not more than it has had."""
    before = time.process_time()
    cases = bench_phase._cases(3)
    wall, cpu = bench_phase._wall(cases, Here(1), bench_phase.timed)
    assert len(set(cases)) == 9
    assert 0.0 < cpu <= time.process_time() - before
    assert wall > 0.0


def test_killed_command_refuses_what_it_cannot_do(tmp_path, capsys):
    """A folder with files in it, and no kills at all."""
    (tmp_path / "file").write_text("")
    for options, words in (
        (["--out", str(tmp_path)], "out must be an empty folder"),
        (["--times", "0"], "times must be an integer from 1, got 0"),
    ):
        with pytest.raises(SystemExit):
            killed.main(options)
        assert words in capsys.readouterr().err


# --- The rod ---------------------------------------------------------------------------------


def test_rod_agrees_away_from_boundaries(diagram):
    """der.fold with error bars, on 128 edges, four cases each; beside boundaries it may differ."""
    away = [pair for pair in diagram.compared if not pair.near]
    near = [pair for pair in diagram.compared if pair.near]
    assert (len(away), len(near)) == (4, 4)
    assert all(pair.agrees for pair in away)
    for pair in diagram.compared:
        assert pair.rod.moment == pytest.approx(pair.bvp.moment, abs=1e-4)


def test_sample_is_the_same_every_time(diagram):
    """The cases are drawn by the family's name."""

    def refuse(scene):
        raise ValueError("no rod")

    again = rod_check(diagram.scan, refuse, 8)
    assert [pair.bvp for pair in again] == [pair.bvp for pair in diagram.compared]
    assert {pair.rod.message for pair in again} == {"ValueError: no rod"}
    assert "0 of 4 labels agree" in table(again)


def test_the_bench_shows_its_usage_instead_of_running(monkeypatch, capsys):
    """Exit 0 with words; exit 2 with a line for what is not known."""
    for word, code in (("--help", 0), ("--fast", 2)):
        monkeypatch.setattr("sys.argv", ["bench_phase", word])
        with pytest.raises(SystemExit) as left:
            bench_phase.main()
        assert left.value.code == code
    said = capsys.readouterr()
    assert said.out.startswith("usage: python -m validation.benchmark.phase")
    assert said.err == "python -m validation.benchmark.phase: unrecognized arguments: --fast\n"
