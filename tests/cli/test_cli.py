"""The command `der`: what it refuses, what it writes, and what it saves when things go wrong."""

import errno
import json
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path as File

import numpy as np
import pytest

import der
import der.analysis.fold
import der.analysis.landscape.opening
from der.analysis.request import Request
from der.cli.commands import main
from der.records.configurations import Shapes
from der.records.path import Path

CLONE = File(__file__).parents[2]
EIGHTH = math.pi / 8
SMALL = ("fold", "circle", "--h-over-t", "4", "--edges", "16")
SNAPS = ("fold", "circle", "--h-over-t", "1.6", "--edges", "32")  # two folds in gamma


@pytest.fixture(scope="module", autouse=True)
def kernels():
    """Kernels are loaded before any test breaks something in the engine."""
    der.fold(der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=16, gamma_max=0.1))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty working directory."""
    place = tmp_path / "here"
    place.mkdir()
    monkeypatch.chdir(place)
    return place


@pytest.fixture
def run(capsys):
    """The command in this process: exit code, standard output, lines of standard error."""

    def command(*words):
        with pytest.raises(SystemExit) as left:
            main([str(word) for word in words])
        out, err = capsys.readouterr()
        return left.value.code, out, err.splitlines()

    return command


def shape(*words):
    """A fold of this shape."""
    return ("fold", *words, "--h-over-t", "4")


def shell(*words, **options):
    """The command in a process of its own."""
    command = [sys.executable, "-m", "der", *words]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.run(command, text=True, check=False, **options)


def entries(text):
    """A JSON text's content; NaN and infinities, which JSON has not, are refused."""

    def refuse(name):
        raise AssertionError(f"{name} in JSON")

    return json.loads(text, parse_constant=refuse)


def saved(name="der-unfinished.json"):
    """A record on disk, after making sure that it is strict JSON."""
    entries(File(name).read_text())
    return Path.load(name)


# --- Bad input -------------------------------------------------------------------------------

GOOD = {"--h-over-t": "4", "--edges": "16"}


def line(*words, without=()):
    """A good command line with something wrong appended, or taken away."""
    good = [word for option, value in GOOD.items() if option not in without
            for word in (option, value)]  # fmt: skip
    return ("fold", "circle", *good, *words)


PLANAR = ("planar", "circle", "--h-over-t", "4")
BAR = ("fold", "circle", "--young", "3.5GPa", "--height", "4mm", "--thickness", "1mm",
       "--size", "100mm")  # fmt: skip
WRONG = [
    # words, and what the line must hold: option, value, what is allowed
    (line("--h-over-t", "0"), "--h-over-t", "0.0", "finite number > 0"),
    (line("--h-over-t", "-1"), "--h-over-t", "-1", "finite number > 0"),
    (line("--h-over-t", "nan"), "--h-over-t", "nan", "finite number > 0"),
    (line("--h-over-t", "inf"), "--h-over-t", "inf", "finite number > 0"),
    (line("--h-over-t", "-inf"), "--h-over-t", "-inf", "finite number > 0"),
    (line("--h-over-t", "four"), "--h-over-t", "'four'", "a number"),
    (line("--h-over-t", "1e300"), "--h-over-t", "1e+300", "finite number > 0"),
    (line("--h-over-t", "1e-300"), "--h-over-t", "1e-300", "finite number > 0"),
    (line(without=["--h-over-t"]), "--h-over-t", "neither", "--alpha and --beta"),
    (line("--alpha", "1", without=["--h-over-t"]), "--beta", "none", "with --alpha 1"),
    (line("--beta", "1", without=["--h-over-t"]), "--alpha", "none", "with --beta 1"),
    (line("--alpha", "1", "--beta", "2"), "--h-over-t", "4.0", "--alpha and --beta"),
    (line("--alpha", "1"), "--h-over-t", "4.0", "--alpha and --beta"),
    (line("--alpha", "0", "--beta", "2", without=["--h-over-t"]), "--alpha", "0.0", "> 0"),
    (line("--alpha", "1", "--beta", "nan", without=["--h-over-t"]), "--beta", "nan", "> 0"),
    (line("--nu", "0.7"), "--nu", "0.7", "(-1, 0.5]"),
    (line("--nu", "-1"), "--nu", "-1", "(-1, 0.5]"),
    (line("--natural-curvature", "nan"), "--natural-curvature", "nan", "finite number"),
    (line("--a-over-t", "0"), "--a-over-t", "0.0", "finite number > 0"),
    (line("--axis", "z"), "--axis", "'z'", "x or y"),
    (line("--edges", "17"), "--edges", "17", "divisible by 4"),
    (line("--edges", "66"), "--edges", "66", "divisible by 4 for the sector 'quarter'"),
    (line("--edges", "17", "--sector", "full"), "--edges", "17", "divisible by 2"),
    (line("--edges", "6"), "--edges", "6", "from 8 to 65536"),
    (line("--edges", "0"), "--edges", "0", "from 8 to 65536"),
    (line("--edges", "-64"), "--edges", "-64", "from 8 to 65536"),
    (line("--edges", "9" * 30), "--edges", "9" * 30, "from 8 to 65536"),
    (line("--edges", "6.5"), "--edges", "'6.5'", "an integer"),
    (line("--edges", "many"), "--edges", "'many'", "an integer"),
    (line("--gamma-max", "0"), "--gamma-max", "0.0", "finite number > 0"),
    (line("--gamma-max", "-1"), "--gamma-max", "-1", "finite number > 0"),
    (line("--gamma-max", "nan"), "--gamma-max", "nan", "finite number > 0"),
    (line("--gamma-max", "pi"), "--gamma-max", "'pi'", "a number"),
    (line("--until", "never"), "--until", "'never'", "folded"),
    (line("--save-at", "soon"), "--save-at", "'soon'", "numbers separated by commas"),
    (line("--save-at", ""), "--save-at", "''", "numbers separated by commas"),
    (line("--save-at", "0.5,4"), "--save-at", "4.0", "from 0 to"),
    (line("--save-at=-0.1"), "--save-at", "-0.1", "from 0 to"),
    (line("--save-at", "nan"), "--save-at", "nan", "from 0 to"),
    (line("--save-at", "2", "--gamma-max", "1"), "--save-at", "2.0", "= 1.0"),
    (line("--curvature", "sine"), "--curvature", "'sine'", "logarithm, angle, tangent"),
    (line("--stretch", "some"), "--stretch", "'some'", "inextensible, finite"),
    (line("--tolerance", "0"), "--tolerance", "0.0", "finite number > 0"),
    (line("--tolerance", "1"), "--tolerance", "1.0", "at most 1e-4"),
    (line("--sector", "third"), "--sector", "'third'", "auto, full, half, quarter"),
    (line("--json", "no/such/f.json"), "--json", "'no/such/f.json'", "folder"),
    (line("--json", "."), "--json", "'.'", "must be a file"),
    (line("--json", ""), "--json", "''", "must be a file"),
    (line("--json", "p.png", "--plot", "./p.png"), "--json", "'p.png' twice", "of its own"),
    (line("--plot", "p.xyz"), "--plot", "'p.xyz'", ".png, .pdf, .svg"),
    (line("--plot", "p"), "--plot", "'p'", ".png, .pdf, .svg"),
    (line("--plot", "no/such/p.png"), "--plot", "'no/such/p.png'", "folder"),
    (("fold", "square"), "SHAPE", "'square'", "circle"),
    (("fold",), "SHAPE", "Missing", "argument"),
    (line("circle"), "FILE", "'circle'", "profile"),
    (line("circle", "circle"), "argument", "(circle)", "unexpected"),
    (("fold", "ellipse", "--h-over-t", "4"), "--b-over-a", "none", "SHAPE ellipse"),
    (line("--b-over-a", "0.5"), "--b-over-a", "0.5", "SHAPE ellipse or rectangle"),
    (shape("ellipse", "--b-over-a", "1.2"), "--b-over-a", "1.2", "in (0, 1]"),
    (shape("ellipse", "--b-over-a", "0.5", "--axis", "z"), "--axis", "'z'", "x or y"),
    (shape("rectangle", "--b-over-a", "0.5", "--r-over-a", "0.6"), "--r-over-a", "0.6", "0.5]"),
    (
        shape("triangle", "--vertex-angle", "180", "--r-over-a", "0.1"),
        "--vertex-angle",
        "180",
        "180) d",
    ),
    (
        shape("triangle", "--vertex-angle", "0", "--r-over-a", "0.1"),
        "--vertex-angle",
        "0",
        "(0, 180)",
    ),
    (
        shape("triangle", "--vertex-angle", "60", "--r-over-a", "0.3"),
        "--r-over-a",
        "0.3",
        "0.288675",
    ),
    (
        shape("triangle", "--vertex-angle", "60", "--r-over-a", "0.1", "--axis", "y"),
        "--axis",
        "'y'",
        "x for",
    ),
    (shape("triangle", "--r-over-a", "0.1"), "--vertex-angle", "none", "given"),
    (shape("profile"), "FILE", "none", "profile"),
    (shape("profile", "no.csv"), "FILE", "'no.csv'", "readable"),
    (("bvp", *line()[1:], "--tolerance", "1"), "--tolerance", "1.0", "1e-11 to 0.001"),
    (("bvp", *line()[1:], "--control", "angle"), "--control", "'angle'", "'arclength'"),
    (("bvp", *line()[1:], "--sector", "full"), "--sector", "'full'", "half or quarter"),
    (("bvp", *line()[1:], "--stretch", "finite"), "--stretch", "'finite'", "'inextensible'"),
    (("compare", *line()[1:], "--control", "angle"), "--control", "'angle'", "'arclength'"),
    (("compare", *line()[1:], "--edges", "24"), "--edges", "24", "divisible by 16"),
    (("landscape", *line()[1:], "--edges", "20"), "--edges", "20", "divisible by 16"),
    (("landscape", *line()[1:], "--free", "--two-dimensional"), "--free", "both", "together"),
    (("landscape", *line()[1:], "--push", "--free"), "--push", "both", "--free"),
    (("landscape", *line()[1:], "--push", "--two-dimensional"), "--push", "both", "together"),
    (("landscape", *line()[1:], "--cells", "2"), "--cells", "2", "from 3 to 1000"),
    (("landscape", *line()[1:], "--cells", "7"), "--cells", "7", "--two-dimensional"),
    (("landscape", *line()[1:], "--push", "--rrd", "f.rrd"), "--rrd", "'f.rrd'", "with --push"),
    (("landscape", *line()[1:], "--push", "--save-at", "1"), "--save-at", "'1'", "with --push"),
    (("landscape", *line()[1:], "--push", "--until", "folded"), "--until", "'folded'", "--push"),
    (("landscape", *line()[1:], "--gamma-max", "1"), "--gamma-max", "1.0", "for a landscape"),
    (("landscape", *line()[1:], "--control", "angle"), "--control", "'angle'", "'arclength'"),
    *(
        (line(option, value), option, repr(value), "must be a file name")
        for option in ("--json", "--plot", "--rrd", "--movie", "--html", "--out")
        for value in ("--quiet", "")
    ),
    (line("--html", "x.html", "--beside", "--quiet"), "--beside", "'--quiet'", "a file name"),
    (("states", *line()[1:], "--json", "--quiet"), "--json", "'--quiet'", "a file name"),
    (("states", *line()[1:], "--edges", "66"), "--edges", "66", "divisible by 4, as the path"),
    (("planar", "circle"), "--h-over-t", "got neither", "must be given"),
    ((*PLANAR, "--distance", "3.2"), "--distance", "3.2", "3.14159 (the ring drawn"),
    ((*PLANAR, "--edges", "40"), "--edges", "40", "divisible by 16"),
    ((*PLANAR, "--turns", "99"), "--turns", "99", "from 1 to 12 on 256 edges"),
    ((*PLANAR, "--turns", "2", "--distance", "1"), "--turns", "2", "--distance"),
    (("phase", "square", "--out", "d"), "SHAPE", "'square'", "ellipse"),
    (("phase", "ellipse", "--out", "d", "--check", "rod"), "--check", "'rod'", "'der'"),
    (("phase", "ellipse", "--out", "d", "--finest", "5"), "--finest", "5", "power of two"),
    (("phase", "ellipse", "--out", "d", "--range", "x=1:2"), "--range", "'x'", "h_over_t"),
    (("figure", "fig2b", "--out", ""), "--out", "''", "must be a file name"),
    (("phase", "ellipse", "--out", ""), "--out", "''", "must be a file name"),
    (("fold", "profile", "--h-over-t", "4"), "FILE", "got none", "SHAPE profile"),
    (("figure", "fig99", "--out", "."), "NAME", "'fig99'", "fig2b"),
    ((*BAR, "--young", "3.5"), "--young", "'3.5'", "such as 3.5GPa"),
    ((*BAR, "--size", "100"), "--size", "'100'", "such as 100mm"),
    ((*BAR, "--size", "0.5mm"), "--size", "'0.5mm'", "times the thickness"),
    ((*BAR[:-2], "--units", "N,mm"), "--size", "none", "such as 100mm"),
    ((*BAR, "--units", "N,mile"), "--units", "'N,mile'", "such as N,mm"),
    ((*BAR, "--h-over-t", "4"), "--h-over-t", "4.0", "together with --young"),
    ((*BAR, "--alpha", "1"), "--alpha", "1.0", "together with --young"),
    ((*BAR, "--a-over-t", "50"), "--a-over-t", "50.0", "--size over --thickness"),
    (line("--units", "N,mm"), "--units", "'N,mm'", "must go with --young"),
    (("planar", *BAR[1:], "--distance", "1"), "--distance", "'1'", "such as 120mm"),
    ((*PLANAR, "--distance", "1mm"), "--distance", "'1mm'", "must be a number"),
    (line("--egdes", "16"), "--egdes", "No such option", "--edges"),
    (("fold", "circle", "--h-over-t"), "--h-over-t", "requires", "argument"),
    (("bend",), "'bend'", "No such command", ""),
    (("flod",), "'flod'", "No such command", "'fold'"),
]


@pytest.mark.parametrize(
    ("words", "option", "value", "allowed"), WRONG, ids=[" ".join(w[0][-2:])[:40] for w in WRONG]
)
def test_bad_input_is_refused_in_one_line(run, folder, words, option, value, allowed):
    """Code 2; one line names option, value and what is allowed; nothing printed, nothing made."""
    code, out, err = run(*words)
    assert (code, out, len(err)) == (2, "", 1)
    assert err[0].startswith("der: ")
    assert option in err[0]
    assert value in err[0]
    assert allowed in err[0]
    assert not list(folder.iterdir())


EVIDENCE = [
    (("stress", "--quick", "--long"), "--quick", "both", "together"),
    (("stress", "--seed", "-1"), "--seed", "-1", "an integer >= 0"),
    (("bench", "--json", "no/such/f.json"), "--json", "'no/such/f.json'", "folder"),
    (("bench", "--only", "speed"), "--only", "'speed'", "paths, needs"),
]


@pytest.mark.parametrize(("words", "option", "value", "allowed"), EVIDENCE)
def test_bad_input_of_the_evidence_is_refused_in_one_line(
    run, capsys, monkeypatch, words, option, value, allowed
):
    """In the folder of a clone, where `python -m validation` refuses it with the same words."""
    from der.cli.commands import leave
    from validation.__main__ import app

    monkeypatch.chdir(CLONE)
    monkeypatch.setattr(sys, "path", [*sys.path])
    code, out, err = run(*words)
    assert (code, out, len(err)) == (2, "", 1)
    assert err[0].startswith("der: ")
    assert option in err[0]
    assert value in err[0]
    assert allowed in err[0]
    with pytest.raises(SystemExit) as left:
        leave(app, "der", [words[0].replace("bench", "benchmark"), *words[1:]])
    assert (left.value.code, capsys.readouterr().err.splitlines()) == (2, err)


@pytest.mark.parametrize("name", ["bench", "stress"])
def test_the_evidence_is_in_a_clone_only(run, name):
    """Elsewhere one line says how to get it; the options are shown all the same."""
    code, out, err = run(name, "--quick")
    assert (code, out) == (2, "")
    assert err == [
        f"der: '{name}' runs in a clone of the repository of der only: "
        "clone it, change into its folder, and repeat the command"
    ]
    assert "--quick" in run(name, "--help")[1]


def test_evidence_is_run_as_a_module():
    """`python -m validation` names its parts, and says its own name in errors."""
    command = [sys.executable, "-m", "validation"]
    options = {"capture_output": True, "text": True, "check": False, "cwd": CLONE}
    done = subprocess.run(command, **options)
    assert (done.returncode, done.stderr) == (0, "")
    assert "benchmark" in done.stdout
    done = subprocess.run([*command, "stress", "--seed", "x"], **options)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("python -m validation: ")


@pytest.mark.parametrize("command", ["fold", "bvp"])
def test_names_of_a_users_own_modules_are_free(command):
    """`python -m der` imports no module of the folder in which it is called."""
    for name in ("validation", "scenarios", "tests", "reference"):
        File(f"{name}.py").write_text("raise SystemExit('not der')")
    words = (command, "circle", "--h-over-t", "4", "--edges", "16", "--gamma-max", "0.1")
    done = shell(*words, "--plot", "p.png", env=os.environ | {"PYTHONPATH": str(CLONE)})
    assert (done.returncode, done.stderr) == (0, "")
    assert File("p.png").exists()


def test_a_folder_below_a_file_is_refused(run):
    """--out must be a folder that can be made."""
    File("file").write_text("")
    code, out, err = run(*SMALL, "--out", "file/below")
    assert (code, out) == (2, "")
    assert err == ["der: --out must be a folder, got 'file/below': Not a directory"]


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ((*SMALL, "--out", ""), "--out"),
        ((*SMALL, "--json", ""), "--json"),
        (("phase", "fig3a", "--out", ""), "--out"),
        (("figure", "fig2b", "--out", ""), "--out"),
    ],
)
def test_no_name_is_not_the_folder_one_is_in(run, folder, words, name):
    code, out, err = run(*words)
    assert (code, out, err) == (2, "", [f"der: {name} must be a file name, got ''"])
    assert not list(folder.iterdir())


@pytest.mark.parametrize("target", ["link", "nowhere/x.json"])
def test_a_link_to_no_place_is_refused_before_the_work(run, target):
    """To itself, or into a folder that is not there."""
    File("link").symlink_to(target)
    code, out, err = run(*SMALL, "--json", "link")
    assert (code, out, len(err)) == (2, "", 1)
    assert err[0].startswith("der: --json must be a file in a folder that can be written to, got")


def test_what_is_no_regular_file_is_not_replaced_by_one(run, folder):
    """A record is renamed into its place: --json /dev/null would take the device away."""
    os.mkfifo("pipe")
    code, out, err = run(*SMALL, "--json", "pipe")
    assert (code, out) == (2, "")
    assert err == ["der: --json must be a regular file, got 'pipe'"]
    assert (folder / "pipe").is_fifo()


def test_shell_sees_code_two_and_one_line():
    """As a process: exit code 2, one line, no traceback."""
    done = shell("fold", "circle", "--h-over-t", "0")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "der: --h-over-t must be a finite number > 0, got 0.0\n"


# --- Good runs -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def record_file(tmp_path_factory):
    """The record of a path with two folds."""
    file = tmp_path_factory.mktemp("record") / "path.json"
    with pytest.raises(SystemExit) as left:
        main([*SNAPS, "--quiet", "--json", str(file)])
    assert left.value.code == 0
    return file


@pytest.fixture(scope="module")
def record(record_file):
    """Its content."""
    return entries(record_file.read_text())


NUMBER, COUNT, WORD = (int, float), (int, type(None)), (str,)
CONTRACT = {  # "The record": every key and its type
    "schema": (int,),
    "solver": WORD,
    "ring.shape": WORD,
    "ring.twist_axis": WORD,
    "section.h_over_t": NUMBER,
    "section.nu": NUMBER,
    "section.alpha": NUMBER,
    "section.beta": NUMBER,
    "numerics.n_edges": (int,),
    "numerics.sector": WORD,
    "numerics.curvature": WORD,
    "numerics.tolerance": NUMBER,
    "gamma.*": NUMBER,
    "moment.*": NUMBER,
    "energy.*": NUMBER,
    "index.*": COUNT,
    "index_moment.*": COUNT,
    "points.*.kind": WORD,
    "points.*.gamma": NUMBER,
    "points.*.moment": NUMBER,
    "points.*.energy": NUMBER,
    "points.*.index_before": COUNT,
    "points.*.index_after": COUNT,
    "at_pi.moment": NUMBER,
    "at_pi.slope": NUMBER,
    "at_pi.energy": NUMBER,
    "at_pi.index": COUNT,
    "at_pi.index_moment": COUNT,
    "at_pi.index_free": COUNT,
    "mode.foldable": (bool,),
    "mode.stable": (bool, type(None)),
    "mode.snapping": WORD,
    "mode.stable_3d": (bool, type(None)),
    "mode.stable_free": (bool, type(None)),
    "error": (type(None),),  # no error bars were asked for
    "timing.solve_s": NUMBER,
    "timing.newton_iterations": (int,),
    "timing.steps": (int,),
}


def values(content, key):
    """All values at a dotted key, * standing for every entry of a list."""
    here = [content]
    for word in key.split("."):
        here = [v for h in here for v in (h if word == "*" else [h[word]])]
    return here


@pytest.mark.parametrize("key", CONTRACT)
def test_record_holds_the_contract(record, key):
    """Every key of the contract is there, with its type; a bool is no number."""
    found = values(record, key)
    assert found
    assert {type(value) for value in found} <= set(CONTRACT[key])


def test_record_says_which_solver_and_schema(record):
    """Schema 1, solver der."""
    assert (record["schema"], record["solver"]) == (1, "der")


def test_arrays_have_one_entry_a_state(record):
    """gamma, moment, energy, index and index_moment have equal lengths."""
    names = ("gamma", "moment", "energy", "index", "index_moment")
    assert len({len(record[name]) for name in names}) == 1


def test_path_starts_flat_and_ends_at_pi_exactly(record):
    """From gamma = 0 to its first arrival at pi, to the last bit."""
    assert record["gamma"][0] == 0.0
    assert [k for k, g in enumerate(record["gamma"]) if g == math.pi] == [len(record["gamma"]) - 1]


def branches(record):
    """Values of gamma from turning point to turning point: pieces that are monotonic."""
    cuts = [p["position"] for p in record["points"] if p["kind"] == "fold"]
    ends = [0, *cuts, len(record["gamma"]) - 1]
    return [record["gamma"][a : b + 1] for a, b in pairwise(ends)]


@pytest.mark.parametrize("k", range(1, 8))
def test_every_crossing_of_a_multiple_of_pi_over_eight_is_solved_for(record, k):
    """As often as the path crosses it, folds included, and exactly there; 7 pi/8: three times."""
    crossed = sum(min(piece) < k * EIGHTH < max(piece) for piece in branches(record))
    assert record["gamma"].count(k * EIGHTH) == crossed
    assert crossed == (3 if k == 7 else 1)


def test_gamma_is_monotonic_between_folds(record):
    """Arrays are in path order: only folds turn gamma round."""
    for piece in branches(record):
        steps = np.diff(piece)
        assert np.all(steps > 0) or np.all(steps < 0)


def test_points_lie_on_their_states(record):
    """A special point's numbers are those of its state in the arrays."""
    for point in record["points"]:
        for name in ("gamma", "moment", "energy"):
            assert point[name] == record[name][point["position"]]


def test_record_comes_back_bit_for_bit(record_file):
    """Path.load reads what --json wrote, and writes the same again."""
    assert Path.load(record_file).to_json() == record_file.read_text()


def test_numerics_are_those_asked_for(run):
    """What was asked for is on record."""
    options = ("--sector", "half", "--curvature", "angle", "--tolerance", "1e-9", "--edges", "18")
    code, out, _ = run(*SMALL, *options, "--json", "-")
    numerics = entries(out)["numerics"]
    assert code == 0
    assert {name: numerics[name] for name in ("sector", "curvature", "tolerance", "n_edges")} == {
        "sector": "half",
        "curvature": "angle",
        "tolerance": 1e-9,
        "n_edges": 18,
    }


def test_defaults_are_those_of_the_contract(run):
    """The defaults: 64 edges of the full ring, smallest sector, inextensible, nu 0.3, until pi."""
    _, out, _ = run("fold", "circle", "--h-over-t", "4", "--json", "-")
    content = entries(out)
    numerics = content["numerics"]
    assert (numerics["n_edges"], numerics["sector"]) == (64, "quarter")
    assert (numerics["stretch"], numerics["a_over_t"]) == ("inextensible", 200.0)
    assert (content["section"]["nu"], numerics["gamma_max"]) == (0.3, math.pi)


def test_json_to_output_is_alone(run):
    """`--json - | jq` works: no summary around the record."""
    code, out, err = run(*SMALL, "--json", "-")
    assert (code, err) == (0, [])
    assert entries(out)["status"] == "done"


def test_quiet_is_quiet(run):
    """Not a word, on either output."""
    assert run(*SMALL, "--quiet") == (0, "", [])


def test_summary_is_printed_otherwise(run):
    """The ring, its mode and the state at pi in words, on standard output only."""
    code, out, err = run(*SMALL)
    assert (code, err) == (0, [])
    assert out.startswith("circle (natural curvature 1), h/t 4, nu 0.3 (alpha 0.771569, ")
    assert "foldable, snap-through, stays folded when released: yes, stable at pi at fixed" in out


def test_stiffness_ratios_can_be_given(run):
    """--alpha and --beta in place of a rectangle, whose h/t and nu are then not known."""
    words = ("fold", "circle", "--alpha", "0.5", "--beta", "0.75", "--edges", "16")
    _, out, _ = run(*words, "--gamma-max", "0.5", "--json", "-")
    section = {"alpha": 0.5, "beta": 0.75, "h_over_t": None, "nu": None}
    assert entries(out)["section"] == section


def test_save_at_replaces_the_multiples_of_pi_over_eight(run):
    """States asked for are there exactly; those not asked for are not solved for."""
    _, out, _ = run(*SMALL, "--save-at", "1.1,0.3,1.1", "--json", "-")
    content = entries(out)
    assert [content["gamma"].count(g) for g in (0.3, 1.1, math.pi)] == [1, 1, 1]
    assert not {k * EIGHTH for k in range(1, 8)} & set(content["gamma"])
    assert content["numerics"]["save_at"] == [0.3, 1.1]


def test_no_stability_leaves_every_index_unknown(run):
    """Null, not zero, where stability was not asked for."""
    _, out, _ = run(*SNAPS, "--no-stability", "--json", "-")
    content = entries(out)
    keys = ("index.*", "index_moment.*", "points.*.index_before", "points.*.index_after",
            "at_pi.index", "at_pi.index_moment", "at_pi.index_free", "mode.stable_3d")  # fmt: skip
    assert {value for key in keys for value in values(content, key)} == {None}


def test_a_path_that_ends_before_pi_has_no_mode(run):
    """--gamma-max 1.0 ends there to the last bit; nothing is known of pi."""
    _, out, _ = run(*SMALL, "--gamma-max", "1.0", "--json", "-")
    content = entries(out)
    assert content["gamma"][-1] == max(content["gamma"]) == 1.0
    assert (content["at_pi"], content["mode"]) == (None, None)


def test_a_path_can_go_beyond_pi(run):
    """--gamma-max 4 ends at 4, with the state at pi solved for on the way."""
    _, out, _ = run(*SMALL, "--gamma-max", "4", "--json", "-")
    content = entries(out)
    assert content["gamma"][-1] == 4.0
    assert content["moment"][content["gamma"].index(math.pi)] == content["at_pi"]["moment"]


def test_until_folded_goes_on_to_three_loops(run):
    """h/t 1 folds only by way of 1.74 pi; three loops have U = pi alpha (3 - 1)^2, and M = 0."""
    words = ("fold", "circle", "--h-over-t", "1", "--edges", "32", "--until", "folded")
    code, out, _ = run(*words, "--json", "-")
    content = entries(out)
    assert code == 0
    assert content["gamma"][-1] == math.pi
    assert max(content["gamma"]) > 1.7 * math.pi
    assert content["energy"][-1] == pytest.approx(4 * math.pi * content["section"]["alpha"], 1e-9)
    assert content["moment"][-1] == pytest.approx(0.0, abs=1e-7)


def test_mode_is_judged_at_the_first_arrival_at_pi(run):
    """h/t 1 is not foldable, though its path ends folded."""
    words = ("fold", "circle", "--h-over-t", "1", "--edges", "32", "--until", "folded")
    content = entries(run(*words, "--json", "-")[1])
    assert content["mode"]["foldable"] is False
    assert content["at_pi"]["moment"] == content["moment"][content["gamma"].index(math.pi)] > 1.0


def test_out_holds_record_picture_and_shapes(run):
    """--out DIR makes the folder and writes three files that fit each other."""
    code, _, err = run(*SMALL, "--gamma-max", "0.5", "--out", "a/b")
    assert (code, err) == (0, [])
    assert {f.name for f in File("a/b").iterdir()} == {"path.json", "path.png", "shapes.npz"}
    path = Path.load("a/b/path.json")
    assert Shapes.load("a/b/shapes.npz").x.shape == (len(path), 16, 3)


@pytest.mark.parametrize(
    ("name", "start"), [("p.png", b"\x89PNG\r\n"), ("p.pdf", b"%PDF"), ("p.svg", b"<?xml")]
)
def test_plot_is_of_the_kind_its_name_says(run, folder, name, start):
    """--plot writes that one file."""
    code, _, err = run(*SMALL, "--gamma-max", "0.5", "--plot", name)
    assert (code, err) == (0, [])
    assert File(name).read_bytes().startswith(start)
    assert [f.name for f in folder.iterdir()] == [name]


def test_progress_is_shown_on_a_terminal(run, monkeypatch):
    """A bar with gamma and the states so far, on standard error; the record stays clean."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    code, out, err = run(*SMALL, "--json", "-")
    assert code == 0
    assert entries(out)["status"] == "done"
    assert "gamma = 3.142" in " ".join(err)


def test_version_is_said():
    """`python -m der --version`."""
    done = shell("--version")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("der ")


def test_without_words_there_is_help(run):
    """`der` alone names its commands and is no error."""
    code, out, err = run()
    assert (code, err) == (0, [])
    assert "fold" in out


# --- When things go wrong --------------------------------------------------------------------


def follow_with(monkeypatch, **options):
    """Paths are followed with other options."""
    usual = der.analysis.fold._request

    def request(scene):
        asked = usual(scene)
        return replace(asked, options=replace(asked.options, **options))

    monkeypatch.setattr(der.analysis.fold, "_request", request)


@pytest.fixture
def stuck(monkeypatch):
    """Paths stop after six steps."""
    follow_with(monkeypatch, max_steps=6)


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "end"])
def interrupted(request, monkeypatch):
    """The user presses Ctrl-C, or a batch system ends the process, after the fifth state."""
    usual = der.analysis.fold._points

    def points(*arguments):
        for k, point in enumerate(usual(*arguments)):
            if k == 5:
                signal.raise_signal(request.param)
            yield point

    monkeypatch.setattr(der.analysis.fold, "_points", points)


def full(*_):
    """What a full disk does."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.usefixtures("stuck")
def test_a_path_that_gets_stuck_saves_what_it_has(run):
    """Code 3; one line names the reason, the last good state and the file that holds it."""
    code, out, err = run(*SMALL, "--quiet", "--json", "f.json")
    path = saved("f.json")
    assert (code, out) == (3, "")
    assert err == [
        f"der: {path.message}; the path up to its last good state, "
        f"at gamma = {path.gamma[-1]:.8g}, is in f.json, its shapes in f.npz"
    ]
    assert (path.status, path.timing.steps) == ("not converged", 6)


@pytest.mark.usefixtures("stuck")
def test_without_a_named_file_the_rest_is_saved_in_the_working_directory(run, folder):
    """der-unfinished.json and .npz, so that nothing computed is lost."""
    code, _, err = run(*SMALL, "--quiet")
    assert code == 3
    assert err[0].endswith("is in der-unfinished.json, its shapes in der-unfinished.npz")
    assert {f.name for f in folder.iterdir()} == {"der-unfinished.json", "der-unfinished.npz"}
    assert len(saved()) > 6


@pytest.mark.usefixtures("stuck")
def test_an_unfinished_summary_says_so(run):
    """Also where standard error went elsewhere."""
    _, out, _ = run(*SMALL)
    assert "not converged: the path has not ended after 6 steps" in out.splitlines()


@pytest.mark.usefixtures("stuck")
def test_an_unfinished_record_for_output_is_alone_there(run, folder):
    """`--json -`: the record, and nothing else, on standard output; the shapes in a file."""
    code, out, err = run(*SMALL, "--json", "-")
    assert code == 3
    assert err[0].endswith("is on standard output, its shapes in der-unfinished.npz")
    assert entries(out)["status"] == "not converged"
    assert [f.name for f in folder.iterdir()] == ["der-unfinished.npz"]


@pytest.mark.usefixtures("stuck")
def test_unfinished_shapes_have_a_file_of_their_own(run, folder):
    """Beside the record that went to standard output, under a name that says npz."""
    code, _, _ = run(*SMALL, "--json", "-", "--plot", "p.png")
    assert code == 3
    assert {f.name for f in folder.iterdir()} == {"p.png", "der-unfinished.npz"}
    assert len(Shapes.load("der-unfinished.npz").x) > 6


@pytest.mark.usefixtures("stuck")
def test_an_unfinished_path_fills_its_folder(run):
    """--out has record, picture and shapes of what there is."""
    code, _, _ = run(*SMALL, "--quiet", "--out", "d")
    assert code == 3
    assert {f.name for f in File("d").iterdir()} == {"path.json", "path.png", "shapes.npz"}
    assert saved("d/path.json").status == "not converged"


def test_where_newton_fails_the_flat_state_is_saved(run, monkeypatch):
    """No step forward at all: one state is on record, and the reason names the place."""
    follow_with(monkeypatch, smallest_step=10.0)
    code, _, err = run(*SMALL, "--quiet", "--json", "f.json")
    assert code == 3
    assert "no step forward from gamma = 0" in err[0]
    assert saved("f.json").gamma.tolist() == [0.0]


@pytest.mark.usefixtures("interrupted")
def test_ctrl_c_saves_what_there_is(run):
    """Code 130; status interrupted; the states so far, the one in work included, in the file."""
    code, out, err = run(*SMALL, "--quiet", "--json", "f.json")
    path = saved("f.json")
    assert (code, out, path.status, len(path)) == (130, "", "interrupted", 6)
    assert err == [
        "der: stopped by the user; the path up to its last good state, "
        f"at gamma = {path.gamma[-1]:.8g}, is in f.json, its shapes in f.npz"
    ]


@pytest.mark.usefixtures("interrupted")
def test_ctrl_c_without_a_named_file(run):
    """der-unfinished.json in the working directory."""
    code, _, _ = run(*SMALL, "--quiet")
    assert (code, saved().status) == (130, "interrupted")


@pytest.mark.parametrize("quiet", [(), ("--quiet",)])
def test_on_a_full_disk_the_record_goes_to_output(run, monkeypatch, quiet):
    """Not lost: alone on standard output, loadable; the line names the file; the code is not 0."""
    monkeypatch.setattr(Path, "save", full)
    code, out, err = run(*SMALL, "--json", "f.json", *quiet)
    assert code == 3
    assert err == ["der: could not write f.json: [Errno 28] No space left on device"]
    assert Path.from_json(out).status == "done"


@pytest.mark.usefixtures("stuck")
def test_on_a_full_disk_an_unfinished_record_is_not_said_to_be_in_its_file(run, monkeypatch):
    """The line says where the record really is."""
    monkeypatch.setattr(Path, "save", full)
    code, out, err = run(*SMALL, "--json", "f.json")
    assert code == 3
    assert err[-1].endswith("is on standard output, its shapes in f.npz")
    assert entries(out)["status"] == "not converged"


def test_a_plot_that_cannot_be_written_does_not_cost_the_record(run, monkeypatch):
    """The record comes first; what failed is named, and the code is not 0."""
    monkeypatch.setattr("der.viz.plots.style.save", full)
    code, _, err = run(*SMALL, "--gamma-max", "0.5", "--json", "f.json", "--plot", "p.png")
    assert code == 3
    assert err == ["der: could not write p.png: [Errno 28] No space left on device"]
    assert saved("f.json").status == "done"


def test_a_reader_that_has_gone_is_no_error():
    """`der ... | head` ends quietly, with code 0."""
    reader, writer = os.pipe()
    os.close(reader)
    done = shell(*SMALL, "--gamma-max", "0.1", "--json", "-", stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not File("/dev/full").exists(), reason="no full device here")
def test_an_output_that_is_full_is_said_in_one_line():
    """Code 3 and no traceback."""
    with open("/dev/full", "w") as output:
        done = shell(*SMALL, "--gamma-max", "0.1", stdout=output)
    assert done.returncode == 3
    assert done.stderr == "der: could not write to standard output: No space left on device\n"


def test_landscape_says_what_folding_and_opening_cost(run, tmp_path):
    """The circle at h/t = 4: flat and folded wells and a saddle; barriers are differences of U."""
    file = tmp_path / "landscape.json"
    code, out, err = run("landscape", "circle", "--h-over-t", "4", "--json", file)
    assert (code, err) == (0, [])
    assert "barrier to open" in out
    found = entries(file.read_text())
    flat, saddle, folded = (rest["energy"] for rest in found["rests"])
    assert found["barriers"]["fold"] == pytest.approx(saddle - flat, abs=1e-12)
    assert found["barriers"]["open"] == pytest.approx(saddle - folded, abs=1e-12)
    assert [rest["index_free"] for rest in found["rests"]] == [0, 1, 0]


def test_two_dimensional_landscape_is_written(run, tmp_path):
    """Data and picture of a small one."""
    words = ("landscape", "circle", "--h-over-t", "1.6", "--two-dimensional", "--cells", "5")
    code, out, err = run(*words, "--edges", "16", "--out", tmp_path / "new")
    assert (code, err) == (0, [])
    assert "5 x 5 cells" in out
    assert len(entries((tmp_path / "new" / "landscape.json").read_text())["energy"]) == 5
    assert (tmp_path / "new" / "landscape.png").read_bytes().startswith(b"\x89PNG")


def test_a_push_at_a_ring_that_opens_by_itself(run, tmp_path):
    """At h/t = 3 there is nothing to push: said, written, and no failure."""
    file = tmp_path / "push.json"
    words = ("landscape", "circle", "--h-over-t", "3", "--edges", "32", "--push", "--json", file)
    code, out, err = run(*words)
    assert (code, err) == (0, [])
    assert "the free folded ring is no well" in out
    assert entries(file.read_text())["pushes"] == []


def test_a_folder_is_complete_whatever_else_is_named(run):
    """--json and --plot come besides; --beside takes such a folder and names what is bad."""
    words = (*SMALL, "--gamma-max", "0.5", "--quiet")
    code, _, err = run(*words, "--out", "d", "--json", "f.json", "--plot", "p.png")
    assert (code, err) == (0, [])
    assert {f.name for f in File("d").iterdir()} == {"path.json", "path.png", "shapes.npz"}
    assert File("f.json").read_text() == File("d/path.json").read_text()
    assert File("p.png").read_bytes().startswith(b"\x89PNG")
    assert run(*words, "--beside", "d", "--html", "x.html")[0] == 0
    for name, why in (("shapes.npz", "no shapes.npz as --out writes"), ("path.json", "no text")):
        File("d", name).write_bytes(b"\xff\xfe\x00")
        code, _, err = run(*words, "--beside", "d", "--html", "x.html")
        assert code == 2
        assert err[0].startswith("der: --beside must be a folder as --out writes")
        assert why in err[0]


def test_a_landscape_fills_its_folder_and_the_named_files(run):
    """Likewise."""
    words = ("landscape", "circle", "--h-over-t", "4", "--edges", "32", "--quiet")
    code, _, err = run(*words, "--out", "d", "--json", "f.json")
    assert (code, err) == (0, [])
    assert {f.name for f in File("d").iterdir()} == {"landscape.json", "landscape.png"}
    assert File("f.json").read_text() == File("d/landscape.json").read_text()


def test_a_profile_of_few_points_is_warned_of(run):
    """Eight points of an ellipse: by name, and in the summary and the record."""
    t = 2 * np.pi * np.arange(8) / 8
    np.savetxt("p.csv", np.column_stack([np.cos(t), 0.6 * np.sin(t)]), delimiter=";")
    words = ("--h-over-t", "4", "--edges", "16", "--json", "p.json")
    code, out, err = run("fold", "profile", "p.csv", "--axis", "x", *words)
    assert code == 0
    assert "profile (reference length 1, curvature error 0.1" in out
    assert [line for line in err if "natural curvature known to +-1" in line]
    assert json.loads(File("p.json").read_text())["ring"]["reference_length"] == pytest.approx(1)


def test_a_binary_profile_is_named(run):
    """Without a word about codecs."""
    File("p.csv").write_bytes(b"\xff\xfe\x00")
    code, _, err = run(*shape("profile", "p.csv"))
    assert (code, err) == (2, ["der: FILE must be a text file, got 'p.csv'"])


@pytest.mark.parametrize("kind", [(), ("--push",), ("--free",)])
def test_a_ring_that_cannot_be_twisted_has_no_landscape(run, kind):
    """Code 3; the reason once, on standard error, with the file that holds what was found."""
    ring = ("circle", "--natural-curvature", "1e7", "--h-over-t", "4", "--edges", "32")
    words = ("landscape", *ring, *kind)
    code, out, err = run(*words)
    assert code == 3
    assert len(err) == 1
    assert err[0].startswith("der: no step forward from gamma = 0.00000000: Newton's method")
    assert err[0].endswith("; what was found is in der-unfinished.json")
    assert "no step" not in out
    assert entries(File("der-unfinished.json").read_text())["kind"] == (kind or ["--landscape"])[0][
        2:
    ].replace("free", "pass")


def test_states_say_why_none_was_found(run):
    """What the solver said of the flat ring."""
    ring = ("circle", "--natural-curvature", "1e7", "--h-over-t", "4", "--edges", "16")
    words = ("states", *ring, "--gamma", "1", "--quiet")
    code, _, err = run(*words)
    assert code == 3
    assert "no state was found from any start; the flat ring is no equilibrium: " in err[0]


def test_planar_states_fill_their_folder(run):
    """A table with error bars, the record, a picture and shapes."""
    words = ("planar", "ellipse", "--b-over-a", "0.5", "--h-over-t", "4", "--edges", "64")
    code, out, err = run(*words, "--out", "d")
    assert (code, err) == (0, [])
    assert "folded: packing ratio 0.294424" in out
    assert {f.name for f in File("d").iterdir()} == {"planar.json", "planar.png", "shapes.npz"}
    assert File("d/planar.png").read_bytes().startswith(b"\x89PNG")
    assert entries(File("d/planar.json").read_text())["kind"] == "planar"


def test_a_ring_is_squeezed_in_its_plane(run):
    """To where its points touch, drawn; and one that is lost on the way says how far it got."""
    code, out, err = run(*PLANAR, "--edges", "64", "--distance", "0", "--plot", "p.png")
    assert (code, err) == (0, [])
    assert "squeezed in its plane" in out
    assert "  0.00000000    -6.19" in out
    assert File("p.png").read_bytes().startswith(b"\x89PNG")
    code, _, err = run(*PLANAR, "--edges", "32", "--distance", "3.14159", "--quiet")
    assert code == 3
    assert "no step forward from distance = 2.945" in err[0]  # 15 of 16 edges of a half are taut
    assert "der-unfinished.json" in err[0]
    assert entries(File("der-unfinished.json").read_text())["status"] == "not converged"


@pytest.mark.parametrize("more", [(), ("--plot", "p.png")])
def test_where_there_is_no_push_there_is_no_picture(run, more):
    """Said in one line; the code is that of the answer, which is no failure."""
    words = ("landscape", "circle", "--h-over-t", "1", "--edges", "32", "--push", *more)
    code, out, err = run(*words)
    assert code == 0
    assert "the free folded ring is no well" in out
    assert err == ["der: p.png was not drawn: there is no push that opens the ring"] * bool(more)


def stop(*_):
    """What Ctrl-C does, and a program that draws for us, too."""
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt:
        raise ValueError("ffmpeg ended") from None


@pytest.mark.parametrize("how", ["itself", "behind another"])
@pytest.mark.parametrize(("named", "place"), [((), "der-unfinished.json"), (("--out", "d"), "d")])
def test_ctrl_c_while_files_are_written_keeps_the_record(run, monkeypatch, named, place, how):
    """Code 130; one line says where the record is, what else was written and what was not."""

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("der.viz.movie.save_movie", interrupt if how == "itself" else stop)
    code, out, err = run(*SMALL, "--gamma-max", "0.5", "--movie", "m.gif", *named, "--quiet")
    assert (code, out) == (130, "")
    file = "d/path.json" if named else place
    also = "; written: d/path.png" if named else ""
    assert err == [f"der: stopped by the user; the record is in {file}{also}; not written: m.gif"]
    assert saved(file).status == "done"
    assert len(Shapes.load(File("d/shapes.npz" if named else "der-unfinished.npz")).x) > 1


@pytest.mark.parametrize("kind", [(), ("--push",)])
def test_an_interrupted_landscape_names_its_file(run, monkeypatch, kind):
    """As states do."""
    home, name = (der.analysis.landscape.opening, "scan") if kind else (Request, "follow")
    real = getattr(home, name)

    def pressed(*arguments):
        signal.raise_signal(signal.SIGINT)
        return [] if kind else real(*arguments)

    monkeypatch.setattr(home, name, pressed)
    words = ("landscape", "circle", "--h-over-t", "4", "--edges", "32", "--quiet", *kind)
    code, out, err = run(*words)
    assert (code, out, len(err)) == (130, "", 1)
    assert err[0].startswith("der: stopped by the user")
    assert err[0].endswith("; what was found is in der-unfinished.json")
    assert entries(File("der-unfinished.json").read_text())["status"] == "interrupted"


def test_ctrl_c_before_the_command_begins_is_told(run, monkeypatch):
    """While options are read: typer itself would leave without a word."""

    def press(*_):
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("typer.core.TyperGroup.resolve_command", press)
    assert run(*SMALL) == (130, "", ["der: stopped by the user"])


def test_a_dimensional_ring_is_told_in_its_units(run):
    """Headers with units, values times GJ/a, and a non-dimensional record with its scale."""
    more = ("--edges", "16", "--no-stability", "--json", "p.json", "--plot", "p.png")
    code, out, _ = run(*BAR, "--units", "N,mm", *more)
    path = der.Path.load("p.json")
    assert code == 0
    assert path.scale.units == "N,mm"
    assert "M [N mm]" in out
    assert "a = 100 mm" in out
    at_pi = path.at_pi.slope * path.scale.unit("moment")[0]
    assert f"dM/dgamma = {at_pi:.7g} N mm" in out
    plain = run("fold", "circle", "--h-over-t", "4", "--a-over-t", "100", *more[:3], "--json", "-")
    np.testing.assert_array_equal(json.loads(plain[1])["moment"], path.moment)


def test_a_distance_with_a_unit_is_one_in_a(run):
    """120 mm of a ring of a = 100 mm."""
    code, out, _ = run("planar", *BAR[1:], "--edges", "32", "--distance", "120mm", "--json", "-")
    assert code == 0
    assert json.loads(out)["goal"] == pytest.approx(1.2, rel=1e-15)


@pytest.mark.parametrize("command", ["fold", "bvp"])
def test_forces_are_kept_on_request(run, command):
    """In the record and, with --out, in the shapes; in the summary, too."""
    given = ("circle", "--h-over-t", "4", "--edges", "16", "--gamma-max", "1", "--forces")
    code, out, _ = run(command, *given, "--out", "d")
    path, shapes = der.Path.load("d/path.json"), der.Shapes.load("d/shapes.npz")
    assert code == 0
    assert path.forces.arm_force.shape == (len(path), 2, 3)
    assert shapes.internal.moment.shape == (len(path), 16, 3)
    largest = np.linalg.norm(path.forces.arm_force, axis=2).max()
    assert f"largest force in an arm: {largest:.6g} GJ/a^2" in out
