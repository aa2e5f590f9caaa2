"""A page for any browser: complete in one file, and tested in a browser where one is found."""

import base64
import errno
import html
import importlib.util
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import der
from der.utils import files
from der.viz.html import check_html, page, save_html
from der.viz.palette import STRETCHES
from der.viz.resampling import in_step, resampled
from der.viz.ribbon import ribbon, triangles

EDGES, FRAMES = 16, 20
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)


@pytest.fixture(scope="module")
def path():
    scene = der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=EDGES, shapes=True)
    return der.fold(scene)


@pytest.fixture(scope="module")
def other():
    scene = der.Scene(der.ellipse(0.6), der.rectangular_section(4), n_edges=EDGES, shapes=True)
    return der.fold(scene)


@pytest.fixture(scope="module")
def text(path):
    return page(path, frames=FRAMES)


def data(text):
    """What the page carries."""
    return json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL)[1])


def unpacked(packed, kind="<f4"):
    return np.frombuffer(base64.b64decode(packed), kind)


# --- What is in it ---------------------------------------------------------------------------


def test_page_loads_nothing_from_anywhere(text):
    """No element of it asks for another file; plotly's own code is in it."""
    shell = text.replace(view_html_code(), "")
    assert len(text) - len(shell) > 1e6
    assert not re.search(r"(src|href|url)\s*[=(]", shell)
    assert "%" + "DATA%" not in text


def view_html_code():
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()


HOSTILE = "%DATA%%PLOTLY%%ABOUT%</script><script>alert(1)</script><!--<script><b>"


def test_a_page_of_a_stranger_is_data(path, text):
    """What looks like a place of the template stays as it is, and markup is escaped."""
    evil = replace(path, ring={**path.ring, "shape": HOSTILE})
    one = page(evil, frames=FRAMES)
    both = page([evil, path], frames=FRAMES)
    for made, usual in ((one, text), (both, page([path, path], frames=FRAMES))):
        assert len(made) - len(usual) < 40 * len(HOSTILE)
        for word in ("<script", "</script", "<!--"):
            assert made.count(word) == usual.count(word)
        assert data(made)["rings"][0]["name"].startswith(HOSTILE)
    labels = [trace["name"] for trace in data(both)["figure"]["data"]]
    assert any(html.escape(HOSTILE) in label for label in labels)
    assert not any("<" in label for label in labels)


def test_page_has_every_step_of_the_film(path, text):
    """Positions in float32, numbers bit for bit."""
    motion = resampled(path, FRAMES)
    (ring,) = data(text)["rings"]
    positions, _ = ribbon(motion.x, motion.frames, motion.section)
    assert_array_equal(unpacked(ring["positions"]), positions[:, ::2].astype("f4").ravel())
    for name in ("moment", "energy"):
        assert_array_equal(unpacked(ring[name], "<f8"), getattr(motion, name))
    assert_array_equal(unpacked(ring["gamma"], "<f8"), motion.gamma / np.pi)
    assert len(ring["numbers"]) == len(ring["stability"]) == len(motion.x)
    assert ring["marks"] == sorted({motion.step_of(point.position) for point in path.points})


def test_curves_and_special_points_are_those_of_the_record(path, text):
    traces = data(text)["figure"]["data"]
    (marks, _) = [t for t in traces if t["name"] == "special points"]
    assert_allclose(np.pi * np.array(marks["x"]), [point.gamma for point in path.points])
    assert_allclose(marks["y"], [point.moment for point in path.points])
    kinds = [t["name"] for t in traces if t.get("mode") == "lines" and t["type"] == "scatter"]
    assert kinds == [STRETCHES[key].label for key in (True, False, True)] * 2
    mesh = traces[0]
    assert_array_equal(np.column_stack([mesh[k] for k in "ijk"]), triangles(EDGES))


def test_limits_hold_all_that_moves(path, other):
    text = page([path, other], frames=FRAMES)
    layout, motions = data(text)["figure"]["layout"], in_step([path, other], FRAMES)
    for name, axis in (("gamma", "xaxis"), ("moment", "yaxis"), ("energy", "yaxis2")):
        low, high = layout[axis]["range"]
        values = [getattr(motion, name) / (np.pi if name == "gamma" else 1.0) for motion in motions]
        assert low < min(v.min() for v in values) < max(v.max() for v in values) < high
    reach = layout["scene"]["xaxis"]["range"][1]
    assert layout["scene2"]["zaxis"]["range"] == [-reach, reach]
    assert max(np.abs(motion.x).max() for motion in motions) < reach


# --- In a browser ----------------------------------------------------------------------------

LISTEN = """<script>
window.wrong = [];
addEventListener("error", (event) => wrong.push(String(event.message)));
addEventListener("unhandledrejection", (event) => wrong.push(String(event.reason)));
for (const name of ["error", "warn"]) console[name] = (...words) => wrong.push(words.join(" "));
</script>"""
ASK = """<script>
const until = async (done) => { while (!done()) await new Promise((go) => setTimeout(go, 20)); };
const now = () => ({
  step: Number(document.getElementById("stage").dataset.step),
  x: document.getElementById("stage").data.map((trace) => Array.from(trace.x)),
  y: document.getElementById("stage").data.map((trace) => Array.from(trace.y)),
  words: document.querySelector(".numbers").textContent,
});
(async () => {
  const said = { wrong, webgl: !!document.createElement("canvas").getContext("webgl") };
  await ready;
  said.first = now();
  const slider = document.getElementById("step");
  slider.value = 7;
  slider.dispatchEvent(new Event("input"));
  await until(() => now().step === 7);
  said.moved = now();
  document.getElementById("after").click();
  await until(() => now().step !== 7);
  said.next = now();
  document.getElementById("play").click();
  await until(() => now().step > said.next.step + 1);
  document.getElementById("play").click();
  said.played = now();
  return said;
})().catch((problem) => ({ wrong: [...wrong, String(problem)] })).then((said) => {
  const out = document.createElement("pre");
  out.id = "said";
  out.textContent = JSON.stringify(said);
  document.body.append(out);
});
</script>"""


@pytest.fixture(scope="module")
def seen(text, tmp_path_factory):
    """What a headless browser makes of the page while the slider and buttons are used."""
    if BROWSER is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is installed here")
    folder = tmp_path_factory.mktemp("html")
    whole = text.replace("<head>", f"<head>{LISTEN}", 1)
    end = whole.rindex("</body>")
    (folder / "page.html").write_text(whole[:end] + ASK + whole[end:])
    command = [BROWSER, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage"]
    command += [
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--dump-dom",
        "--window-size=400,300",
    ]
    command += [f"--user-data-dir={folder / 'profile'}", "--virtual-time-budget=10000"]
    command.append((folder / "page.html").as_uri())
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    said = re.search(r'<pre id="said">(.*?)</pre>', done.stdout, re.DOTALL)
    assert said, "the page never became ready"
    found = json.loads(html.unescape(said[1]))
    if not found.get("webgl", True):
        pytest.skip("the browser found here has no WebGL")
    return found


def test_browser_finds_nothing_wrong(seen):
    assert seen["wrong"] == []


@pytest.mark.parametrize("when", ["first", "moved", "next", "played"])
def test_ring_and_dots_are_at_the_step_of_the_slider(path, seen, when):
    """The mesh in float32, each corner twice; dots on M and U."""
    motion, at = resampled(path, FRAMES), seen[when]
    step = at["step"]
    positions, _ = ribbon(motion.x, motion.frames, motion.section)
    assert_array_equal(np.array(at["x"][0], dtype="f4"), positions[step, :, 0].astype("f4"))
    for trace, values in ((-2, motion.moment), (-1, motion.energy)):
        assert at["x"][trace] == [motion.gamma[step] / np.pi]
        assert at["y"][trace] == [values[step]]
    assert f"{motion.energy[step]:.3f}" in at["words"]


def test_slider_and_buttons_move_to_where_they_say(path, seen):
    """Slider: step 7; next: the special point after it; play: onwards."""
    motion = resampled(path, FRAMES)
    marks = sorted(motion.step_of(point.position) for point in path.points)
    assert [seen[when]["step"] for when in ("first", "moved")] == [0, 7]
    assert seen["next"]["step"] == next(mark for mark in marks if mark > 7)
    assert seen["played"]["step"] > seen["next"]["step"] + 1


# --- What is refused -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["page.htm", "page", "html"])
def test_other_suffix_is_refused(path, tmp_path, name):
    with pytest.raises(ValueError, match=rf"html must end in .html, got '.*{name}'"):
        save_html(path, tmp_path / name)


def test_missing_plotly_is_named_with_its_remedy(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"html 'a.html' needs .* plotly.*: pip install plotly$"):
        check_html("a.html")


def test_bad_numbers_are_named(path):
    with pytest.raises(ValueError, match="frames must be at least 2, got 1"):
        page(path, frames=1)
    with pytest.raises(ValueError, match="path must be one or two, got 3"):
        page([path] * 3)


def test_full_disk_leaves_the_old_file_and_nothing_else(path, tmp_path, monkeypatch):
    file = tmp_path / "some.html"
    file.write_bytes(b"before")

    def fill(place, write):
        def full(opened):
            opened.write(b"<!DOC")
            raise OSError(errno.ENOSPC, "No space left on device")

        files.write_whole(place, full)

    monkeypatch.setattr("der.viz.files.write_whole", fill)
    with pytest.raises(ValueError, match=r"some\.html' cannot be written: No space left"):
        save_html(path, file, frames=2)
    assert file.read_bytes() == b"before"
    assert [found.name for found in tmp_path.iterdir()] == ["some.html"]
