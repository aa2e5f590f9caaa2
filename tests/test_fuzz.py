"""Anything at all, at every door: an answer, or a sentence that says what is wrong with it.

Nothing is said here about numbers being right; only that nothing falls over, hangs, or lets a NaN
through. The examples are always the same.
"""

import io
import json
import math
import string
from contextlib import redirect_stderr, redirect_stdout
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import der
import validation
from der.cli.commands import main
from der.geometry.profile_csv import read_profile
from der.records.configurations import Shapes
from der.records.path import Path
from der.scene import MEASURES
from validation.stress.inputs import arguments, refusal

EXAMPLES = {"quick": 200, "path": 25, "command": 60}
FILES = [HealthCheck.function_scoped_fixture]


def fuzz(count, **more):
    return settings(
        max_examples=EXAMPLES[count],
        deadline=None,
        derandomize=True,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        **more,
    )


numbers = st.one_of(
    st.floats(),  # NaN, infinities and subnormal numbers among them
    st.floats(0.0, 10.0),
    st.integers(-(10**400), 10**400),
    st.sampled_from([0.0, -0.0, 1.0, math.pi, 5e-324, 1e-310, 1.7976931348623157e308]),
    st.fractions(),
)
junk = st.one_of(
    numbers,
    st.none(),
    st.booleans(),
    st.text(max_size=8),
    st.binary(max_size=4),
    st.complex_numbers(),
    st.lists(numbers, max_size=3),
    st.dictionaries(st.text(max_size=3), numbers, max_size=2),
    st.sampled_from(["x", "y", "full", "quarter", "angle", "folded", "finite", "relaxation"]),
)


def said(call):
    """The sentence with which a call refuses; None where it gives an answer."""
    try:
        call()
    except ValueError as wrong:
        text = str(wrong)
        assert text
        assert "\n" not in text
        return text
    return None


# --- The statement ---------------------------------------------------------------------------

MAKERS = {
    der.circle: ("natural_curvature",),
    der.ellipse: ("b_over_a", "twist_axis"),
    der.rectangle: ("b_over_a", "r_over_a", "twist_axis"),
    der.triangle: ("vertex_angle", "r_over_a"),
    der.section: ("alpha", "beta"),
    der.rectangular_section: ("h_over_t", "nu"),
    der.Scale.of: ("young_modulus", "nu", "h", "t", "a"),
    der.Scale: ("a", "GJ"),
}
OTHERS = ("alpha", "beta", "GJ", "moment", "force")  # that may overflow


@fuzz("quick")
@given(make=st.sampled_from(sorted(MAKERS, key=str)), data=st.data())
def test_shapes_and_sections_are_made_or_refused_by_name(make, data):
    """A sentence begins with the argument that is wrong."""
    names = MAKERS[make]
    values = [data.draw(st.one_of(st.floats(0.01, 1.0), junk), name) for name in names]
    text = said(lambda: make(*values))
    assert text is None or text.startswith((*names, *OTHERS))


WANTS = {
    "n_edges": st.one_of(st.sampled_from([8, 16, 32, 64]), junk),
    "sector": st.one_of(st.sampled_from(["auto", "half", "full"]), junk),
    "control": st.one_of(st.sampled_from(["arclength", "angle"]), junk),
    "curvature": st.one_of(st.sampled_from(MEASURES), junk),
    "until": st.one_of(st.none(), junk),
    "save_at": st.one_of(st.none(), st.lists(numbers, max_size=4), junk),
}
FLAGS = (
    "stability",
    "self_crossings",
    "error_bars",
    "shapes",
    "history",
    "modes",
    "forces",
    "unload",
)
SIZES = ("gamma_max", "a_over_t", "tolerance")
WANTS |= {name: st.one_of(st.booleans(), junk) for name in FLAGS}
WANTS |= {name: st.one_of(st.floats(1e-6, 4.0), junk) for name in SIZES}


@fuzz("quick")
@given(wants=st.fixed_dictionaries({}, optional=WANTS))
def test_a_scene_is_stated_or_refused_by_name(wants):
    """Whatever is asked for, in whatever combination."""
    text = said(lambda: der.Scene(der.circle(), der.rectangular_section(4.0), **wants))
    assert text is None or text.split()[0] in {*WANTS, "solver", "stretch"}


@fuzz("quick")
@given(
    rows=st.lists(st.tuples(st.floats(), st.floats()), max_size=12),
    how=st.sampled_from(["knots", "points"]),
)
def test_a_profile_is_a_ring_or_refused(rows, how):
    """Any numbers: overflow does not come through as a warning, nor as a ring of NaN."""
    columns = [list(column) for column in zip(*rows, strict=True)] or [[], []]
    made = []
    call = {
        "knots": lambda: made.append(der.profile(*columns)),
        "points": lambda: made.append(der.profile(points=rows)),
    }[how]
    with np.errstate(all="ignore"):
        said(call)
    for ring in made:
        assert math.isfinite(ring.length)
        assert np.isfinite(ring.position(np.linspace(0.0, ring.length, 9))).all()


ARGUMENTS = arguments()


def received(argument, names):
    """What is wrong with how these values of an argument are received."""
    return [wrong for name in names if (wrong := refusal(argument, name)) is not None]


def left_open(argument):
    """Values that are known to be received wrongly."""
    if argument.where.startswith("Ring."):
        return set(argument.refused)
    also = {"0-d array"} if argument.names == ("save_at",) else set()
    return {"unprintable int"} | also


@pytest.mark.parametrize("argument", ARGUMENTS, ids=lambda one: f"{one.where} {one.names[0]}")
def test_what_must_be_refused_is_refused_by_name(argument):
    """Every argument of all that is public against every value that it must not take."""
    assert not received(argument, set(argument.refused) - left_open(argument))


@pytest.mark.parametrize("argument", ARGUMENTS, ids=lambda one: f"{one.where} {one.names[0]}")
def test_what_must_be_refused_is_refused_by_name_too(argument):
    """Numbers too long to print, arc lengths that are none, an array of no dimension."""
    assert not received(argument, set(argument.refused) & left_open(argument))


# --- The solvers -----------------------------------------------------------------------------

RINGS = st.one_of(
    st.builds(der.circle, st.floats(-2.0, 4.0)),
    st.builds(der.ellipse, st.floats(0.05, 1.0), st.sampled_from("xy")),
    st.builds(
        lambda b, share, axis: der.rectangle(b, max(0.005, b * share), axis),
        st.floats(0.05, 1.0),
        st.floats(0.01, 1.0),
        st.sampled_from("xy"),
    ),
    st.builds(der.triangle, st.floats(0.2, 2.5), st.floats(0.005, 0.05)),
)
SECTIONS = st.builds(der.rectangular_section, st.floats(0.05, 100.0), st.floats(0.0, 0.5))


def finished(solve):
    """The path of a solver, complete or not; the record checks that all numbers are finite."""
    try:
        path = solve()
    except der.NotConverged as failure:
        path = failure.path
    again = Path.from_json(path.to_json())
    assert again.to_json() == path.to_json()
    return path


@fuzz("path")
@given(
    ring=RINGS,
    section=SECTIONS,
    wants=st.fixed_dictionaries(
        {"n_edges": st.sampled_from([8, 16]), "gamma_max": st.floats(1e-6, 4.0)},
        optional={
            "sector": st.sampled_from(["auto", "half", "full"]),
            "control": st.sampled_from(["arclength", "angle", "moment"]),
            "curvature": st.sampled_from(MEASURES),
            "stretch": st.sampled_from(["inextensible", "finite"]),
            "tolerance": st.floats(1e-16, 1e-4),
            "stability": st.booleans(),
            "shapes": st.booleans(),
        },
    ),
)
def test_a_fold_ends_in_a_path_or_a_sentence(ring, section, wants):
    """On few edges: any ring, any section, any way of following."""
    path = finished(lambda: der.fold(der.Scene(ring, section, **wants)))
    assert not len(path) or path.gamma[0] == 0.0


@fuzz("path")
@given(
    ring=RINGS,
    section=SECTIONS,
    gamma_max=st.floats(1e-3, 4.0),
    tolerance=st.floats(-6.0, -3.0).map(lambda digits: min(10.0**digits, 1e-3)),
)
def test_a_boundary_value_problem_ends_in_a_path_or_a_sentence(ring, section, gamma_max, tolerance):
    """Likewise; a finished path ends at gamma_max, or says that it never gets there."""
    scene = der.Scene(ring, section, gamma_max=gamma_max)
    path = finished(lambda: validation.solve(scene, tolerance=tolerance))
    assert path.status != "done" or abs(path.gamma[-1]) == gamma_max


# --- Files -----------------------------------------------------------------------------------


@cache
def folded():
    """A short path with everything that a file can hold."""
    scene = der.Scene(
        der.circle(),
        der.rectangular_section(1.6),
        n_edges=8,
        control="angle",
        shapes=True,
        history=True,
        modes=True,
    )
    return der.fold(scene)


ANYTHING = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


@fuzz("quick")
@given(data=st.data())
def test_a_record_with_one_entry_exchanged_is_a_path_or_refused(data):
    """One entry, at any depth, becomes something else, or is gone; the rest is as it was."""
    record = json.loads(folded().to_json())
    place, key = record, data.draw(st.sampled_from(sorted(record)))
    while isinstance(place[key], dict | list) and place[key] and data.draw(st.booleans()):
        place = place[key]
        inner = sorted(place) if isinstance(place, dict) else range(len(place))
        key = data.draw(st.sampled_from(inner))
    if data.draw(st.booleans()):
        place[key] = data.draw(ANYTHING)
    else:
        del place[key]
    text = json.dumps(record)
    found = []
    if said(lambda: found.append(Path.from_json(text))) is None:
        assert Path.from_json(found[0].to_json()).to_json() == found[0].to_json()


@fuzz("quick")
@given(at=st.floats(0.0, 1.0), cut=st.integers(0, 9), put=st.text(max_size=9))
def test_a_torn_record_is_a_path_or_refused(at, cut, put):
    """Characters taken out of the text and others put in."""
    text = folded().to_json()
    place = int(at * len(text))
    said(lambda: Path.from_json(text[:place] + put + text[place + cut :]))


@fuzz("quick")
@given(content=st.binary(max_size=200))
def test_what_is_no_record_is_refused(tmp_path_factory, content):
    """Any bytes in the file, with the file named."""
    file = tmp_path_factory.getbasetemp() / "fuzz.json"
    file.write_bytes(content)
    assert said(lambda: Path.load(file)).startswith(str(file))


@fuzz("quick")
@given(at=st.floats(0.0, 1.0), size=st.integers(0, 4), put=st.binary(max_size=4))
def test_broken_shapes_are_shapes_or_refused(tmp_path_factory, at, size, put):
    """Bytes changed anywhere in the file, and a file cut short."""
    whole = tmp_path_factory.getbasetemp() / "whole.npz"
    if not whole.exists():
        folded().shapes.save(whole)
    content = whole.read_bytes()
    place = int(at * len(content))
    file = whole.with_name("broken.npz")
    file.write_bytes(content[:place] + put + content[place + size :])
    said(lambda: Shapes.load(file))


LINE = st.lists(
    st.one_of(st.floats().map(str), st.text(string.printable, max_size=4)), max_size=3
).map(",".join)


@fuzz("quick")
@given(
    first=st.sampled_from(["x,y", "arc_length,curvature", "# x", "x", ""]),
    rows=st.lists(LINE, max_size=12),
)
def test_a_table_of_a_profile_is_a_ring_or_refused(tmp_path_factory, first, rows):
    """Columns of anything."""
    file = tmp_path_factory.getbasetemp() / "fuzz.csv"
    file.write_text("\n".join([first, *rows]), encoding="utf-8")
    with np.errstate(all="ignore"):
        text = said(lambda: read_profile(str(file)))
    assert text is None or str(file) in text


@fuzz("quick")
@given(entries=st.one_of(ANYTHING, st.fixed_dictionaries({"points": ANYTHING})))
def test_an_object_of_a_profile_is_a_ring_or_refused(tmp_path_factory, entries):
    """JSON of anything."""
    file = tmp_path_factory.getbasetemp() / "profile.json"
    file.write_text(json.dumps(entries))
    assert str(file) in said(lambda: read_profile(str(file)))


# --- The command -----------------------------------------------------------------------------

WORD = st.text(string.ascii_letters + string.digits + "-.,=_/+ ", max_size=6)
NUMBER = st.one_of(
    st.floats().map(str), st.floats(0.1, 5.0).map(str), st.sampled_from(["nan", "1e400", "-0", ""])
)
OPTIONS = {
    **dict.fromkeys(
        ["--h-over-t", "--alpha", "--beta", "--nu", "--b-over-a", "--r-over-a", "--vertex-angle"],
        NUMBER,
    ),
    **dict.fromkeys(["--natural-curvature", "--a-over-t", "--gamma-max", "--tolerance"], NUMBER),
    "--edges": st.sampled_from(["8", "16", "12", "7", "0", "-8", "8.0", "x"]),
    "--axis": st.sampled_from(["x", "y", "z", ""]),
    "--until": st.sampled_from(["folded", "never"]),
    "--save-at": st.lists(NUMBER, max_size=3).map(",".join),
    "--curvature": st.sampled_from([*MEASURES, "sine"]),
    "--stretch": st.sampled_from(["finite", "inextensible", "some"]),
    "--control": st.sampled_from(["angle", "moment", "arclength", "will"]),
    "--solver": st.sampled_from(["newton", "relaxation", "prayer"]),
    "--sector": st.sampled_from(["auto", "full", "half", "quarter", "third"]),
    "--json": st.sampled_from(["-", "nowhere/at/all.json", "."]),
    "--plot": st.sampled_from(["p.gif", "nowhere/p.png"]),
}
SWITCHES = ["--unload", "--no-stability", "--stability", "--error-bars", "--nonsense"]


@st.composite
def command_lines(draw):
    """Mostly a command with a shape that fits; then options, of which some are wrong."""
    words = [draw(st.sampled_from(["fold", "fold", "bvp", "compare", "fould", ""]))]
    words.append(draw(st.one_of(st.sampled_from(["circle", "ellipse", "triangle"]), WORD)))
    if draw(st.booleans()):
        words += ["--h-over-t", str(draw(st.floats(0.5, 8.0)))]
    words += ["--edges", "8", "--quiet"]
    for name in draw(st.lists(st.sampled_from(sorted(OPTIONS)), max_size=3, unique=True)):
        words += [name, draw(OPTIONS[name])]
    words += draw(st.lists(st.sampled_from(SWITCHES), max_size=1))
    return words + draw(st.lists(WORD, max_size=1))


@fuzz("command", suppress_health_check=FILES)
@given(words=command_lines())
def test_a_command_line_is_done_or_refused_in_one_line(words, tmp_path, monkeypatch):
    """Exit code 0, 2 or 3; a wrong one with one line on standard error, and never a traceback."""
    monkeypatch.chdir(tmp_path)
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as left:
        main(words)
    assert left.value.code in (0, 2, 3)
    lines = err.getvalue().splitlines()
    assert all(line.startswith("der: ") for line in lines), lines
    if left.value.code == 2:
        assert len(lines) == 1
    assert "nan" not in out.getvalue().lower() or "--json" not in words
