"""Every kind of record: files of earlier versions, pictures, and what is shown of one."""

import json
import pathlib
import re
import subprocess
import sys

import pytest

import der
from der.records.text import summary

FILES = pathlib.Path(__file__).parent / "files"  # as version 0.1 wrote them, two of them shortened
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
every_kind = pytest.mark.parametrize("name", KINDS)


def loaded(name):
    return KINDS[name].load(FILES / f"{name}.json")


def without_new(entries):
    """Entries without those that are new since."""
    nested = (
        {k: without_new(v) if k in ("rod", "bvp", "mode") and v else v} for k, v in entries.items()
    )
    return {k: v for one in nested for k, v in one.items() if k not in ("reason", "stable_free")}


@every_kind
def test_a_file_of_an_earlier_version_comes_back(name):
    """Bit for bit, with its entries in their order, but for the new entries."""
    old = json.loads((FILES / f"{name}.json").read_text())
    new = without_new(json.loads(loaded(name).to_json()))
    assert json.dumps(new) == json.dumps(old)


@every_kind
def test_a_record_draws_itself(name, tmp_path):
    """Into a file, or as a figure to go on with."""
    record = loaded(name)
    figure = record.plot(tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    assert figure.axes


@every_kind
def test_a_record_is_short_in_print(name):
    """What it is and its main numbers, in one line."""
    said = repr(loaded(name))
    assert said.startswith(f"{KINDS[name].__name__}(")
    assert len(said) < 160
    assert "\n" not in said


@pytest.mark.parametrize("name", ["states", "barriers"])
def test_a_notebook_shows_a_table_and_a_picture(name):
    shown = loaded(name)._repr_html_()
    assert shown.startswith("<table>")
    assert 'src="data:image/png;base64,' in shown


def test_what_a_file_says_is_escaped_in_a_notebook():
    """A file from a stranger is data."""
    text = (FILES / "states.json").read_text()
    evil = der.States.from_json(text.replace('"shape": "circle"', '"shape": "<script>"'))
    assert "<script>" not in evil._repr_html_()


@pytest.mark.parametrize("name", sorted({*KINDS} - {"barriers"}))
def test_every_record_has_a_text(name):
    said = summary(loaded(name))
    assert len(said) > 60
    assert not re.search(r"ways down|left alone|let go", said)


@every_kind
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda e: e.pop("schema"), "schema is None"),
        (lambda e: e.update(mood=1), "mood is no entry of such a record"),
        (lambda e: e.update(kind="poem"), "kind"),
        (lambda e: e.pop("timing", e.pop("unmatched", None)), "(timing|unmatched) is missing"),
        (lambda e: e.update({list(e)[-2]: "?"}), "must be|no entry"),
    ],
)
def test_a_damaged_record_is_refused(name, change, words):
    """In one line."""
    entries = json.loads((FILES / f"{name}.json").read_text())
    change(entries)
    with pytest.raises(ValueError, match=words) as refused:
        KINDS[name].from_json(json.dumps(entries))
    assert "\n" not in str(refused.value)


def test_the_place_of_what_is_wrong_is_named():
    """Down to the entry of the list of the object."""
    entries = json.loads((FILES / "push.json").read_text())
    entries["pushes"][1]["held"]["work"] = "much"
    with pytest.raises(ValueError, match=r"^pushes\[1\]\.held\.work must be a finite number, got"):
        der.LeastPush.from_json(json.dumps(entries))


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    file = tmp_path / "large.json"
    with file.open("wb") as opened:
        opened.truncate(2**29)  # takes no room on the disk
    with pytest.raises(ValueError, match=r"large\.json: must have at most"):
        der.Path.load(file)


def test_a_device_without_end_is_not_read_to_its_end():
    """Its size is said to be 0."""
    if not pathlib.Path("/dev/zero").exists():
        pytest.skip("no such device")
    with pytest.raises(ValueError, match=r"^/dev/zero: must have at most"):
        der.Path.load("/dev/zero")


def test_reading_is_what_imports_cattrs():
    """Making and writing records costs nothing more."""
    script = "import sys, der.records.path, der.records.landscape; print('cattrs' in sys.modules)"
    shown = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert shown.stdout.strip() == "False"
