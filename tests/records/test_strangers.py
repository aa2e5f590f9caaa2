"""Records and pages of strangers: an answer or one line, never a traceback, a flood or a program.

Every entry of every kind of record, at every depth, is replaced by what does not belong there.
"""

import copy
import json
import pathlib
import shutil
import time
from dataclasses import replace

import matplotlib.pyplot as plt
import pytest

import der
from der.cli.commands import main
from der.records.configurations import Shapes
from der.records.text import summary

FILES = pathlib.Path(__file__).parent / "files"
KINDS = {
    "path": der.Path,
    "landscape": der.Landscape,
    "barriers": der.BarrierCurves,
    "surface": der.Surface,
    "pass": der.Pass,
    "push": der.LeastPush,
    "states": der.States,
    "planar": der.PlanarStates,
    "squeeze": der.Squeeze,
    "comparison": der.Comparison,
}


def nested(levels):
    inner = []
    for _ in range(levels):
        inner = [inner]
    return inner


HOSTILE = [
    *({}, [], None, True, "", "NaN", [None], [[]], ["x"], {"shape": 3}, {"a": {"b": []}}),
    *(0, -1, 1e300, -1e300, 5e-324, 10**25, 10**400, [1e300] * 3, {"energy": 1e31}),
    *("x" * 100_000, {"x" * 100_000: 1}, nested(900), [nested(900)], {"a": nested(25)}),
    *("\ud800", {"\ud800": 1}, "a\nb", "\x1b[2J", "\u202e", {"a\nb": 1}, {"\x1b[2J": 1.0}),
    *("<script>alert(1)</script>", "%DATA%" * 300, "%PLOTLY%", "</script><!--"),
]


def places(entries, before=()):
    """Every place in a record: keys and numbers that lead there; of a list, the first two."""
    pairs = entries.items() if isinstance(entries, dict) else enumerate(entries[:2])
    for key, value in pairs:
        yield (*before, key)
        if isinstance(value, dict | list):
            yield from places(value, (*before, key))


def exchanged(entries, place, value):
    """The text of a record with another value at a place."""
    changed = copy.deepcopy(entries)
    at = changed
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return json.dumps(changed)


def read(kind, text):
    """The record, or None where it is refused in one line of limited length."""
    try:
        return KINDS[kind].from_json(text)
    except ValueError as refused:
        words = str(refused)
        assert words.isprintable()
        assert 0 < len(words) <= 400
        return None


def records_of_strangers(each):
    """Cases (kind, text), ``each`` of them for every place; values take turns."""
    turn = 0
    for kind in KINDS:
        entries = json.loads((FILES / f"{kind}.json").read_text())
        for place in places(entries):
            for _ in range(each):
                yield kind, exchanged(entries, place, HOSTILE[turn % len(HOSTILE)])
                turn += 1


def test_a_record_of_a_stranger_is_read_or_refused_in_one_line():
    """What is read can be printed, written again, and shown, and is short."""
    count = {True: 0, False: 0}
    for kind, text in records_of_strangers(2):
        record = read(kind, text)
        count[record is not None] += 1
        if record is None:
            continue
        assert len(repr(record)) < 3000
        if kind != "barriers":
            summary(record).encode()
        record.to_json().encode()
    assert min(count.values()) > 200


def test_a_record_of_a_stranger_is_drawn_or_refused_in_one_line(tmp_path):
    """Every twentieth of those that are read; warnings are errors."""
    drawn, refused = 0, []
    cases = [(kind, text) for kind, text in records_of_strangers(1) if read(kind, text) is not None]
    for kind, text in cases[::20]:
        try:
            read(kind, text).plot(tmp_path / "x.png")
        except ValueError as wrong:
            refused.append(str(wrong))
        else:
            drawn += 1
        plt.close("all")
    assert drawn > 5
    assert all(words.isprintable() for words in refused)


def test_wrong_entries_of_a_long_list_cost_no_more_than_the_list():
    """A million exceptions took 2 GB; the first one ends it."""
    entries = json.loads((FILES / "path.json").read_text())
    text = json.dumps(entries | {"points": [3] * 100_000})
    started = time.process_time()
    with pytest.raises(ValueError, match=r"^points\[0\] must be an object, got 3$"):
        der.Path.from_json(text)
    assert time.process_time() - started < 2.0  # 8 s before


# --- Pages and films of strangers ------------------------------------------------------------


@pytest.fixture(scope="module")
def folded(tmp_path_factory):
    """The folder of a path with shapes, as --out makes it."""
    folder = tmp_path_factory.mktemp("folded")
    path = der.fold(der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=8, shapes=True))
    path.save(folder / "path.json")
    path.shapes.save(folder / "shapes.npz")
    return folder


SHOWN = (
    *(("ring",), ("ring", "shape"), ("ring", "natural_curvature"), ("section",), ("message",)),
    *(("section", "alpha"), ("section", "h_over_t"), ("numerics",), ("numerics", "n_edges")),
    *(("numerics", "a_over_t"), ("numerics", "<b>"), ("ring", "%DATA%"), ("gamma", 1)),
    *(("moment", 1), ("energy", 1), ("points", 0, "gamma"), ("index", 1), ("mode",)),
)


def test_a_page_of_a_stranger_is_made_or_refused_in_one_line(folded):
    """Of about the usual size, without NaN, and with none of its words as markup."""
    from der.viz.html import page

    shapes = Shapes.load(folded / "shapes.npz")
    entries = json.loads((folded / "path.json").read_text())
    usual = page(replace(der.Path.load(folded / "path.json"), shapes=shapes), frames=4)
    made, refused = 0, []
    for turn, place in enumerate(SHOWN * 3):
        record = read("path", exchanged(entries, place, HOSTILE[turn * 5 % len(HOSTILE)]))
        if record is None:
            continue
        try:
            text = page(replace(record, shapes=shapes), frames=4)
        except ValueError as wrong:
            refused.append(str(wrong))
            continue
        made += 1
        assert len(text) < len(usual) + 20_000
        assert text.count("<script") == usual.count("<script")
    assert made > 5
    assert all(words.isprintable() for words in refused)


@pytest.mark.parametrize("value", HOSTILE, ids=lambda value: repr(value)[:12])
def test_a_ring_of_a_stranger_is_refused_in_one_line(value, folded, tmp_path, capsys):
    """Code 2, one line, and no file, where its folder holds something else than a ring."""
    entries = json.loads((folded / "path.json").read_text())
    (tmp_path / "path.json").write_text(exchanged(entries, ("ring",), value))
    shutil.copy(folded / "shapes.npz", tmp_path)
    words = [
        "fold",
        "circle",
        "--h-over-t",
        "4",
        "--edges",
        "8",
        "--html",
        str(tmp_path / "p.html"),
    ]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--quiet", "--beside", str(tmp_path)])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2
    assert line.startswith("der: --beside must be a folder as --out writes, got ")
    assert line.isprintable()
    assert len(line) < 1000
    assert not (tmp_path / "p.html").exists()
