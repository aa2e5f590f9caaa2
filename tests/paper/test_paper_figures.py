"""The paper's figures: their tables have known values, and a failure affects no other figure."""

import csv
import json
import math
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import der
from der.paper import FIGURES, draw
from der.paper.cases import Case, curve_of, smooth

CLONE = Path(__file__).parents[2]
STATE = ["gamma", "moment", "energy", "error_gamma", "error_moment", "error_energy"]
RING = ["case", "ring", "twist_axis", "b_over_a", "r_over_a", "vertex_angle", "h_over_t"]


def table(file):
    """Rows of a table as dicts, and the lines that begin with #."""
    lines = file.read_text().splitlines()
    words = [line for line in lines if line.startswith("#")]
    return list(csv.DictReader(lines[len(words) :])), words


def broken(folder):
    """A figure that fails."""
    raise RuntimeError(f"no ink for {Path(folder).name}")


def quick(folder):
    """A figure that is drawn at once."""
    file = Path(folder) / "quick.png"
    file.write_bytes(b"drawn")
    return [file]


@pytest.fixture(scope="module")
def fig11(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fig11")
    return FIGURES["fig11"](folder)


def test_register_has_the_figures_of_the_paper_that_are_curves_or_shapes():
    """Figs. 2, 3b, 4, 6, 7, 9, 10, 11, C1, C2, D1 to D3, and loops; diagrams are sweeps."""
    known = "2b 2c 3b 4b 4c 6 7b 7c 9 10b 10c 10d 10e 11 C1 C2 D1 D2 D3 hysteresis"
    assert " ".join(FIGURES).replace("fig", "") == known


def test_names_cost_nothing():
    """The register is read without solver and matplotlib: a wrong name is refused at once."""
    ask = (
        "import json, sys\nfrom der.paper import FIGURES\n"
        "print(json.dumps([n for n in ('numba', 'numpy', 'matplotlib') if n in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []


def test_an_unknown_name_is_refused_before_anything_is_drawn(tmp_path):
    with pytest.raises(
        ValueError, match=r"name must be one of fig2b, .*figD3, hysteresis, .*fig8c, got 'fig99'"
    ):
        draw(["fig2c", "fig99"], tmp_path / "new")
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("workers", [0, -1, True, 1.5, "2"])
def test_a_wrong_number_of_workers_is_refused(tmp_path, workers):
    with pytest.raises(ValueError, match=r"workers must be an integer from 1, got "):
        draw(["fig2c"], tmp_path, workers)


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match=r"folder must be one that can be made, got .*file'"):
        draw(["fig2c"], tmp_path / "file")


def test_curves_are_written_as_picture_and_table(fig11):
    """One row a state, with the ring's columns, those of the state and the kind of point."""
    picture, states = fig11
    assert picture.name == "fig11.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows, words = table(states)
    assert list(rows[0]) == [*RING, *STATE, "point"]
    assert all(name in words[1] for name in [*RING, *STATE, "point"])
    assert "not foldable" in words[2]
    assert "stable at fixed M, opens when released, snap-back" in words[2]
    assert {row["vertex_angle"] for row in rows} == {"120.0", "90.0"}


def test_fig11_marks_the_folds_of_both_triangles(fig11):
    """gamma at the folds of two independent solvers (a rod model and AUTO-07p), four digits."""
    rows, _ = table(fig11[1])
    folds = [float(row["gamma"]) for row in rows if row["point"] == "fold"]
    assert folds == pytest.approx([2.7540, 1.8476, 1.2156, 0.4001], abs=6e-5)


def test_fig4b_ends_at_the_energy_of_the_folded_ring(tmp_path):
    """U(pi) = 8 pi^2 alpha / L for every foldable ring with two axes of symmetry (paper, B.1)."""
    rows, _ = table(FIGURES["fig4b"](tmp_path)[1])
    last = [row for row in rows if float(row["gamma"]) == math.pi]
    assert len(last) == 8
    length = der.ellipse(0.6).length
    for row in last:
        alpha = der.rectangular_section(h_over_t=float(row["h_over_t"])).alpha
        folded = 8 * math.pi**2 * alpha / length
        foldable = row["twist_axis"] == "x" and float(row["h_over_t"]) >= 2
        assert (float(row["energy"]) == pytest.approx(folded, rel=1e-8)) is foldable


def test_snapshots_are_written_with_the_places_of_the_vertices(tmp_path):
    """The flat circle has radius 1, the folded one 1/3, and d1 is a unit vector."""
    picture, shapes = FIGURES["fig2c"](tmp_path)
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows, _ = table(shapes)
    assert list(rows[0]) == [*RING, *STATE, "arc_length", "r1", "r2", "r3", "d11", "d12", "d13"]

    def vectors(gamma, *names):
        chosen = [r for r in rows if r["h_over_t"] == "4.0" and float(r["gamma"]) == gamma]
        return np.array([[float(row[name]) for name in names] for row in chosen])

    for gamma, radius in ((0.0, 1.0), (math.pi, 1 / 3)):
        r = vectors(gamma, "r1", "r2", "r3")
        middle = r.mean(axis=0)
        np.testing.assert_allclose(np.linalg.norm(r - middle, axis=1), radius, rtol=1e-3)
        np.testing.assert_allclose(r[:, 0], 0.0, atol=1e-6)
    s, r2, r3 = vectors(0.0, "arc_length", "r2", "r3").T
    np.testing.assert_allclose(
        np.column_stack([r2, r3]), np.column_stack([np.sin(s), -np.cos(s)]), atol=1e-4
    )
    d1 = vectors(math.pi / 2, "d11", "d12", "d13")
    np.testing.assert_allclose(np.linalg.norm(d1, axis=1), 1.0, rtol=1e-9)


def test_what_is_drawn_between_states_lies_on_the_path():
    """Splines through the figures' states and through 8 times as many: 1e-3 of the panel at most.

    The triangle of Fig. 11b has the sharpest corners of all; a line is 3e-3 of the panel wide.
    """
    case = Case("sharp", der.triangle(math.pi / 2, 1 / 30), 4.0)
    many = [math.pi * i / 512 for i in range(513)]
    drawn, true = (smooth(curve_of(case, case.solve(save_at=at))) for at in (None, many))
    span = np.ptp(true, axis=0)
    start, step = true[:-1] / span, np.diff(true, axis=0) / span
    squared = np.einsum("ij,ij->i", step, step)
    for point in drawn / span:
        way = np.clip(np.einsum("ij,ij->i", point - start, step) / squared, 0.0, 1.0)
        nearest = start + way[:, None] * step
        assert np.linalg.norm(nearest - point, axis=1).min() < 1e-3


def test_a_figure_that_fails_is_named_and_the_others_are_drawn(tmp_path, monkeypatch):
    monkeypatch.setitem(FIGURES, "broken", broken)
    monkeypatch.setitem(FIGURES, "quick", quick)
    drawn = draw(["broken", "quick"], tmp_path / "deep" / "down", workers=1)
    assert drawn.failed == {"broken": "RuntimeError: no ink for down"}
    assert drawn.written == {"quick": [tmp_path / "deep" / "down" / "quick.png"]}
    assert [file.name for file in (tmp_path / "deep" / "down").iterdir()] == ["quick.png"]


def test_ctrl_c_ends_what_is_being_drawn_and_keeps_what_is_finished(tmp_path):
    """Only the parent is interrupted; it ends its workers, which remove their files."""
    script = tmp_path / "script.py"
    script.write_text(
        "import time\nfrom pathlib import Path\n"
        "from der.utils.files import write_whole\n"
        "from der.paper.drawing import Interrupted, draw_all\n"
        "def quick(folder):\n"
        "    write_whole(Path(folder) / 'quick.png', lambda file: file.write(b'drawn'))\n"
        "    return [Path(folder) / 'quick.png']\n"
        "def slow(folder):\n"
        "    write_whole(Path(folder) / 'slow.png', lambda file: time.sleep(60))\n"
        "    return []\n"
        "if __name__ == '__main__':\n"
        "    try:\n"
        f"        draw_all({{'quick': quick, 'slow': slow}}, {str(tmp_path / 'out')!r}, 1)\n"
        "    except Interrupted as stopped:\n"
        "        print(sorted(stopped.drawn.written), stopped.drawn.failed)\n"
    )
    process = subprocess.Popen(
        [sys.executable, script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=CLONE,
        env={"PYTHONPATH": str(CLONE)},
    )
    with process:
        started = time.monotonic()
        while len(list(tmp_path.glob("out/*"))) < 2:  # quick.png, and slow.png's beginning
            assert time.monotonic() - started < 30
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        said, complaints = process.communicate(timeout=30)
    assert said == "['quick'] {}\n"
    assert complaints == ""
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["quick.png"]
