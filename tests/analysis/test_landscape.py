"""Landscapes as records, what they say where something is missing, and their pictures."""

import dataclasses
import functools
import json
import math
import os
import signal
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text

import der
from der.analysis.landscape.barrier import barrier
from der.analysis.landscape.landscape import landscape
from der.analysis.landscape.over_thickness import barriers_over
from der.analysis.landscape.surface import energy_surface
from der.analysis.request import Request
from der.records.barriers import BarrierCurves
from der.records.energy_surface import Surface
from der.records.landscape import Landscape, Pass
from der.records.text import summary
from der.viz.plots.style import save


def scene(h_over_t=4.0, ring=None, **numerics):
    return der.Scene(
        ring or der.circle(), der.rectangular_section(h_over_t), **{"n_edges": 32, **numerics}
    )


@functools.cache
def along(h_over_t=8.0):
    return landscape(scene(h_over_t))


@functools.cache
def sheet():
    return energy_surface(scene(1.6), shape=(9, 8))


@functools.cache
def alone(h_over_t=5.0):
    return barrier(scene(h_over_t, der.ellipse(0.6)))


def test_json_of_a_landscape(tmp_path):
    """The keys that were promised; arrays of one length; what is null has a sentence."""
    along(8.0).save(tmp_path / "one.json")
    entries = json.loads((tmp_path / "one.json").read_text())
    promised = "schema ring section numerics gamma energy moment index rests barriers"
    assert set(promised.split()) <= set(entries)
    assert entries["schema"] == 1
    assert len({len(entries[name]) for name in ("gamma", "energy", "moment", "index")}) == 1
    for rest in entries["rests"]:
        assert {"gamma", "energy", "index_moment", "index_free", "kind"} <= set(rest)
        assert entries["gamma"][rest["position"]] == rest["gamma"]
    assert entries["barriers"]["open"] > 0.0
    low = json.loads(along(3.0).to_json())
    assert low["barriers"]["open"] is None
    assert len(low["why"]["open"]) > 20


def test_text_says_what_the_barrier_is_worth_without_grips():
    """An ellipse of h/t = 3 has a barrier to open in its grips, and opens when released."""
    opens = summary(landscape(scene(3.0, der.ellipse(0.6))))
    assert "stays folded when released: no, index 1: this barrier holds in the grips only" in opens
    assert "stays folded when released: yes" in summary(along())


def test_a_path_that_does_not_fold_has_no_barriers():
    """h/t = 0.5 never comes back to the folded state: kept as far as it goes, and said."""
    one = landscape(scene(0.5, n_edges=16, stability=False))
    assert not one.folded
    assert one.path.status == "not converged"
    assert one.barriers.fold is one.barriers.open is one.barriers.saddle is None
    assert one.barriers.why["fold"] == one.path.message
    assert len(one.path.message) > 20
    assert one.rests[0].kind == "well"


def test_without_stability_only_rests_have_an_index():
    """What was not asked for is not computed; rests are few."""
    one = landscape(scene(8.0, stability=False))
    at = [rest.position for rest in one.rests]
    assert [rest.index_free for rest in one.rests] == [0, 1, 0]
    assert one.path.index[at].tolist() == [0, 0, 0]
    assert np.ma.getmaskarray(one.path.index).sum() == len(one.path) - len(at)


def test_ctrl_c_keeps_the_landscape_so_far():
    """Pressed at the tenth state: status interrupted, ten states, no barrier."""
    seen = []

    def press(gamma):
        seen.append(gamma)
        if len(seen) == 10:
            os.kill(os.getpid(), signal.SIGINT)

    one = landscape(scene(), progress=press)
    assert one.path.status == "interrupted"
    assert len(one.path) == 10
    assert one.barriers.fold is None


def test_interrupting_between_meshes_keeps_the_landscape(monkeypatch):
    """Pressed while the rests are looked for: they are found, and coarser meshes are left out."""
    from der.analysis.landscape import landscape as landscape_curve

    look = landscape_curve.with_rests

    def pressed(*given):
        signal.raise_signal(signal.SIGINT)
        return look(*given)

    monkeypatch.setattr(landscape_curve, "with_rests", pressed)
    bar = der.rectangular_section(h_over_t=4.0)
    one = landscape(der.Scene(der.circle(), bar, n_edges=64, error_bars=True))
    assert one.status == "interrupted"
    assert one.barriers.open is not None
    assert not one.extrapolated


def test_errors_of_a_landscape_need_the_frames_of_its_finest_mesh():
    """A ring through 24 points, whose coarse meshes chose other frames: 12 times outside.

    Held against 512 edges.
    """
    t = 2.0 * np.pi * np.arange(24) / 24
    r = 1.0 + 0.05 * np.cos(4.0 * t)
    ring = der.profile(points=np.column_stack([r * np.cos(t), r * np.sin(t)]))
    scene = der.Scene(ring, der.rectangular_section(5.0), error_bars=True, stability=False)
    one, fine = (
        landscape(replace(scene, n_edges=n), index_free=False).extrapolated for n in (128, 512)
    )
    assert set(one) == set(fine) == {"fold", "open", "gamma", "folded", "slope"}
    for name, (value, error) in one.items():
        assert abs(value - fine[name][0]) < error + fine[name][1], name


def test_json_of_barriers_has_null_for_nan():
    """NaN is not JSON."""
    curves = barriers_over(der.circle(), [3.0, 8.0], n_edges=32)
    entries = json.loads(curves.to_json())
    assert entries["open"][0] is None
    assert entries["open"][1] > 0.2
    assert entries["index_free"] == [2, 1]
    assert "no well" in entries["why"][0]


def test_json_of_a_surface(tmp_path):
    """Maps of (n, m), minima of every cell, path, folds, rests and snaps."""
    sheet().save(tmp_path / "one.json")
    entries = json.loads((tmp_path / "one.json").read_text())
    for name in ("energy", "moment", "force", "index", "minima"):
        assert np.array(entries[name], dtype=object).shape[:2] == (9, 8)
    assert len(entries["folds"]) == 2
    assert len(entries["snaps"]) == 2
    assert entries["rests"][-1][0] == math.pi


def test_ctrl_c_keeps_the_surface_so_far():
    """Cells that were not reached say so."""

    def press(share):
        if share > 0.3:
            os.kill(os.getpid(), signal.SIGINT)

    try:
        one = energy_surface(scene(4.0), shape=(12, 12), progress=press, snaps=False)
    except KeyboardInterrupt:  # pressed twice before it was seen
        pytest.fail("the first Ctrl-C must not raise")
    assert one.status == "interrupted"
    empty = one.count == 0
    assert 0 < empty.sum() < empty.size
    assert len(one.reasons) == empty.sum()
    assert "stopped" in one.reasons[0].why


def test_ctrl_c_on_the_way_fills_no_cells(monkeypatch):
    """Pressed while the path is followed: it is kept, and nothing is computed from it."""
    follow = Request.follow

    def pressed(*given, **more):
        for k, point in enumerate(follow(*given, **more)):
            if k == 5:
                signal.raise_signal(signal.SIGINT)
            yield point

    monkeypatch.setattr(Request, "follow", pressed)
    one = energy_surface(scene(4.0), shape=(12, 12))
    assert (one.status, len(one.path), len(one.snaps)) == ("interrupted", 6, 0)
    assert one.count.sum() == 0


def test_cells_beyond_reach_have_a_reason():
    """At 99.9 % of full stretch, and gamma from 2 on, Newton and relaxation may find nothing."""
    one = energy_surface(
        scene(4.0),
        gamma=np.linspace(0.0, math.pi, 5),
        shape=(5, 6),
        distance_range=(2.0, math.pi),
        snaps=False,
    )
    empty = one.count == 0
    assert len(one.reasons) == empty.sum() > 0
    assert all(len(cell.why) > 20 for cell in one.reasons)
    assert np.isnan(one.energy[empty]).all()


@pytest.mark.parametrize("bad", [(2.0, 4.0), (2.0, 1.0)])
def test_a_range_beyond_full_stretch_is_refused(bad):
    """Half the ring's length is the most."""
    with pytest.raises(ValueError, match="distance_range must rise"):
        energy_surface(scene(), distance_range=bad)


def test_the_full_ring_has_no_surface():
    """It would need both arms' distances."""
    with pytest.raises(ValueError, match="sector must be auto, half or quarter"):
        energy_surface(scene(sector="full"))


def test_json_of_a_pass():
    """Barriers of both kinds, the saddle with its certificate, and the way."""
    entries = json.loads(alone().to_json())
    assert entries["barriers"]["open"] < entries["twisting"]["open"]
    assert entries["saddle"]["index"] == 1
    assert len(entries["way"]["energy"]) == len(entries["way"]["progress"]) > 20


def test_pictures_show_extrapolated_barriers():
    """Where there are error bars; the mesh's value beside them, else it alone. GJ/a throughout."""
    plain, sure = along(8.0), {"open": (0.0210883, 5.2e-4), "fold": (9.7169, 5.2e-4)}
    said = "|".join(t.get_text() for t in plain.plot().findobj(Text))
    assert f"to open\n{plain.barriers.open:.4g} GJ/a" in said
    assert "extrapolated" not in said
    figure = replace(plain, extrapolated=sure).plot()
    said = "|".join(t.get_text() for t in figure.findobj(Text))
    assert f"0.02109\n± 0.00052 GJ/a\nextrapolated\n(mesh {plain.barriers.open:.5g})" in said
    figure = replace(alone(), extrapolated=sure).plot()
    said = figure.axes[0].texts[0].get_text()
    assert "to open: 0.02109 ± 0.00052 GJ/a, extrapolated" in said
    assert "in clamped grips, by twisting: " in said


def test_pictures(tmp_path):
    """Each is drawn and saved; what cannot be drawn is refused in a sentence."""
    curves = barriers_over(der.circle(), [3.0, 4.0, 8.0], n_edges=32)
    figures = {
        "landscape": along(8.0).plot(),
        "without": along(3.0).plot(),
        "barriers": curves.plot(),
        "surface": sheet().plot(),
        "pass": alone().plot(),
    }
    for name, figure in figures.items():
        save(figure, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000
    with pytest.raises(ValueError, match="plot must end in"):
        save(figures["pass"], tmp_path / "pass.txt")
    with pytest.raises(ValueError, match="no well"):
        alone(3.0).plot()


# --- on disk and back ------------------------------------------------------------------------


@functools.cache
def curves():
    return barriers_over(der.circle(), [3.0, 8.0], n_edges=32)


def records():
    """One of each kind; with rests that are no wells, cells without a minimum, and NaN."""
    beyond = energy_surface(
        scene(4.0),
        gamma=np.linspace(0.0, math.pi, 4),
        shape=(4, 5),
        distance_range=(2.0, math.pi),
        snaps=False,
    )
    return [along(8.0), along(3.0), sheet(), beyond, curves(), alone(), alone(3.0)]


def same(one, other):
    """Whether two records, or parts of them, are equal to the last bit."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert one.shape == other.shape
        assert one.dtype == other.dtype
        assert np.ma.getmaskarray(one).tobytes() == np.ma.getmaskarray(other).tobytes()
        assert np.array_equal(
            np.ma.getdata(one), np.ma.getdata(other), equal_nan=one.dtype == float
        )
    elif dataclasses.is_dataclass(one):
        for entry in dataclasses.fields(one):
            if entry.name != "shapes":
                same(getattr(one, entry.name), getattr(other, entry.name))
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            same(a, b)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        for name in one:
            same(one[name], other[name])
    else:
        assert one == other


def test_landscapes_come_back_as_they_were(tmp_path):
    """Every entry bit for bit, but for the shapes of a pass, which are not in the JSON."""
    for one in records():
        one.save(tmp_path / "one.json")
        other = type(one).load(tmp_path / "one.json")
        same(one, other)
        assert other.to_json() == one.to_json()


@pytest.mark.parametrize(
    ("one", "old", "new", "message"),
    [
        (along, '"schema": 1', '"schema": 2', "schema is 2, this version reads 1"),
        (along, '"gamma": [', '"gamma": [0.5, ', r"has \d+ entries"),
        (along, '"rests": [{', '"rests": [{"mood": 1, ', r"rests\[0\].mood is no entry"),
        (along, '"kind": "well"', '"kind": "saddle"', r"rests\[\d\].kind must be well"),
        (along, '"folded": true', '"folded": 1', "folded must be true or false"),
        (along, '"slope"', '"grade"', r"rests\[0\].slope is missing"),
        (curves, '"fold": [', '"fold": [1.0, ', "fold has 3 entries, h_over_t has 2"),
        (curves, '"timing"', '"time"', "timing is missing"),
        (sheet, '"energy": [[', '"energy": [[1.0, ', r"energy\[0\] has 9 entries, distance has 8"),
        (sheet, '"minima": [[', '"minima": [[[], ', r"minima\[0\] has 9 entries, distance has 8"),
        (alone, '"index": 1', '"index": -1', r"saddle.index must be an integer >= 0, got -1"),
        (alone, '"ends": ["', '"ends": [3, "', r"ends\[0\] must be a text, got 3"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path, one, old, new, message):
    """In one line with the file's name and the place of what is wrong."""
    record, file = one(), tmp_path / "one.json"
    text = record.to_json()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=message) as refused:
        type(record).load(file)
    assert str(refused.value).startswith(f"{file}: ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "{}", "null", '{"schema": 1}', "\x00"])
def test_what_is_no_record_is_refused(text):
    """Whatever it is: one line."""
    for kind in (Landscape, BarrierCurves, Pass, Surface):
        with pytest.raises(ValueError, match=r"not JSON|not a record|schema|missing"):
            kind.from_json(text)


def test_a_torn_file_is_refused(tmp_path):
    """As a disk that was full leaves it."""
    text = alone().to_json()
    (tmp_path / "torn.json").write_text(text[: len(text) // 2])
    with pytest.raises(ValueError, match="not JSON"):
        Pass.load(tmp_path / "torn.json")
    (tmp_path / "torn.json").write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match=r"torn\.json: "):
        Pass.load(tmp_path / "torn.json")


# --- scenarios --------------------------------------------------------------------------------


def test_landscape_along_the_path():
    """The barrier to open vanishes where the folded circle loses its stability, h/t = 3.469928."""
    from scenarios.landscape_along_the_path import one, threshold

    assert threshold == pytest.approx(3.469928, abs=1e-4)
    assert one.extrapolated["open"][0] == pytest.approx(0.25946861, abs=3e-5)


def test_landscape_over_twist_and_distance():
    """One valley before the folds, two between them; every cell has its one minimum."""
    from scenarios.landscape_over_twist_and_distance import before, between, sheet

    assert set(before) == {1}
    assert set(between) == {2}
    assert np.all(sheet.count == 1)


def test_landscape_free_ring():
    """0.010682 GJ/a open the folded ellipse, a sixtieth of what twisting shows.

    The limits are those of 128 and 256 edges, extrapolated; 64 edges leave 2.5e-5 of the second.
    """
    from scenarios.landscape_free_ring import found, twisted

    value, error = found.extrapolated["open"]
    assert value == pytest.approx(0.010682, abs=3e-6)
    assert error < 2e-3
    assert twisted.extrapolated["open"][0] == pytest.approx(0.671334, abs=5e-5)
    assert found.saddle.index == 1
