"""Records of dimensional rings: non-dimensional in the file, with units in texts and pictures."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text

import der
from der.geometry.scale import Scale
from der.records.text import summary
from der.records.units import in_units
from der.viz.captions import captions, event_text
from der.viz.html import _layout
from der.viz.resampling import in_step, one_or_two
from tests.records.test_records import FILES, KINDS, without_new

SCALE = {"a": 0.5, "GJ": 8.0, "units": "N,m"}  # GJ/a is 16 N m, GJ/a^2 is 32 N: exact in binary
SCALED = [name for name in KINDS if name != "barriers"]  # of which the section varies
every_kind = pytest.mark.parametrize("name", SCALED)


def entries_of(name):
    """A file's entries, with a scale."""
    entries = json.loads((FILES / f"{name}.json").read_text())
    for one in [entries["rod"], entries["bvp"]] if name == "comparison" else [entries]:
        one["scale"] = SCALE
    return entries


def dimensional(name):
    return KINDS[name].from_json(json.dumps(entries_of(name)))


@every_kind
def test_a_scale_is_one_more_entry(name):
    """It comes back, and no other entry of the file changes its meaning."""
    record = dimensional(name)
    assert without_new(json.loads(record.to_json())) == entries_of(name)
    assert record.scale == Scale(**SCALE)


@every_kind
def test_every_text_has_units(name):
    """Where a is known no number is in GJ/a, in GJ/a^2 or in a; the title alone names GJ."""
    said = summary(dimensional(name)).replace("GJ = 8 N m^2", "")
    assert "GJ" not in said
    assert "distance a" not in said
    units = {"comparison": "[N m]", "pass": " J ", "push": " J", "surface": " m:"}
    assert units.get(name, "[J]") in said


@every_kind
def test_every_picture_has_units(name):
    """The same of all texts of a picture; without a scale the same picture is non-dimensional."""

    def texts(record):
        return " ".join(one.get_text() for one in record.figure().findobj(Text))

    shown = texts(dimensional(name))
    assert "GJ" not in shown
    assert "d/a" not in shown
    assert "J" in shown
    assert "GJ" in texts(KINDS[name].load(FILES / f"{name}.json"))


def same(shown, plain, factor):
    np.testing.assert_array_equal(np.asarray(shown, dtype=float), factor * np.asarray(plain, float))


def test_a_path_is_shown_in_its_units():
    """M and dM/dgamma times GJ/a, U likewise, angles as they are, error bars with their values."""
    record = dimensional("path")
    shown = in_units(record)
    same(shown.gamma, record.gamma, 1.0)
    for name in ("moment", "energy"):
        same(getattr(shown, name), getattr(record, name), 16.0)
    for one, other in zip(shown.points, record.points, strict=True):
        assert (one.gamma, one.moment, one.energy) == (
            other.gamma,
            16.0 * other.moment,
            16.0 * other.energy,
        )
    if record.error is not None:
        known = [k for k, value in enumerate(record.error["moment"]) if value is not None]
        for name, factor in (("gamma", 1.0), ("moment", 16.0), ("energy", 16.0)):
            values = [[one.error[name][k] for k in known] for one in (shown, record)]
            same(*values, factor)
    assert in_units(replace(record, scale=None)).moment is not None


def test_a_squeeze_is_shown_in_its_units():
    """Distances in m, forces in N, energies in J, errors likewise."""
    record = dimensional("squeeze")
    shown = in_units(record)
    factors = {"distance": 0.5, "force": 32.0, "energy": 16.0, "force_error": 32.0, "goal": 0.5}
    for name, factor in factors.items():
        same(getattr(shown, name), getattr(record, name), factor)
    for one, other in zip(shown.points, record.points, strict=True):
        assert (one.distance, one.force) == (0.5 * other.distance, 32.0 * other.force)


def test_pushes_are_shown_in_their_units():
    """A force acts along a length, a couple through an angle; positions are no energies."""
    record = dimensional("push")
    shown = in_units(record)
    units = {"force": (0.5, 32.0), "couple": (1.0, 16.0)}
    assert {one.kind for one in record.pushes} == set(units)
    for one, other in zip(shown.pushes, record.pushes, strict=True):
        push, load = units[one.kind]
        assert (one.held.push, one.held.load) == (push * other.held.push, load * other.held.load)
        assert (one.held.work, one.peak) == (16.0 * other.held.work, load * other.peak)
        same(one.curve, other.curve * [push, load, 16.0], 1.0)
    assert shown.least == record.least
    for name, (value, error) in record.extrapolated.items():
        factor = {"force dead load": 32.0}.get(name, 16.0)
        assert shown.extrapolated[name] == (factor * value, factor * error)


def test_landscapes_are_shown_in_their_units():
    """Barriers and extrapolated values with them; whether the ring has folded stays a truth."""
    record = dimensional("landscape")
    shown = in_units(record)
    assert shown.barriers.fold == 16.0 * record.barriers.fold
    assert shown.folded is record.folded
    for one, other in zip(shown.rests, record.rests, strict=True):
        assert (one.slope, one.distance) == (16.0 * other.slope, 0.5 * other.distance)
    surface = dimensional("surface")
    same(in_units(surface).path, surface.path * [1.0, 0.5, 16.0], 1.0)


@pytest.mark.parametrize(
    ("scale", "message"),
    [
        ({"a": 1.0, "GJ": 1.0}, "scale must have the entries a, GJ, units"),
        ({**SCALE, "a": -1.0}, "scale.a must be a finite number > 0, got -1.0"),
        ({**SCALE, "GJ": "x"}, "scale.GJ must be a finite number > 0, got 'x'"),
        ({**SCALE, "units": "N,mile"}, "scale.units must be one of force"),
        ({**SCALE, "a": 1e-300}, "scale.force must be a finite number > 0"),
        (3.0, "scale must be an object, got 3.0"),
    ],
)
def test_a_bad_scale_is_refused_by_name(scale, message):
    """A file of a stranger is data."""
    with pytest.raises(ValueError) as error:  # noqa: PT011
        der.Path.from_json(json.dumps(entries_of("path") | {"scale": scale}))
    assert str(error.value).startswith(message)


def folded(units, **wants):
    given = {"young": "3.5GPa", "height": "4mm", "thickness": "1mm", "size": "100mm"}
    made = der.dimensional(**given, units=units) | wants
    return der.fold(der.Scene(der.circle(), **made, n_edges=16, shapes=True, stability=False))


def test_films_have_units():
    """Captions, events, axes and the energy per length, of the units asked for."""
    path = folded("N,mm")
    (shown,) = one_or_two(path)
    (motion,), (plain,) = in_step([shown], 10), in_step([replace(path, scale=None)], 10)
    moment, energy = (path.scale.unit(name)[0] for name in ("moment", "energy"))
    np.testing.assert_allclose(motion.moment, moment * plain.moment, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(motion.energy, energy * plain.energy, rtol=1e-12, atol=1e-12)
    force = path.scale.unit("force")[0]  # energy per length
    np.testing.assert_allclose(motion.density, force * plain.density, rtol=1e-9, atol=1e-12)
    said = captions(shown, motion)[3].numbers
    assert "GJ" not in said
    assert said.count("N mm") == 2
    assert "N mm" in event_text(shown.points[0], shown.scale)
    axes = _layout([shown], [motion])
    assert axes["yaxis"]["title"]["text"] == "moment M [N mm]"


def test_rings_of_different_units_are_shown_without():
    """Beside each other they share axes: these are then non-dimensional."""
    one, other = one_or_two([folded("N,mm"), folded("N,m")])
    assert (one.scale, other.scale) == (None, None)
    assert math.isclose(one.energy[-1], other.energy[-1], rel_tol=1e-12)


def test_a_summary_says_whose_moment_it_is():
    """A torque cell on a grip carries two arms."""
    for name in ("path", "comparison"):
        said = summary(KINDS[name].load(FILES / f"{name}.json"))
        assert "a torque cell on one grip reads 2 M" in said


def test_a_record_in_print_has_units():
    """Its facts, too."""
    for name, unit in (("landscape", " J"), ("pass", " J"), ("push", " J "), ("squeeze", " m")):
        assert unit in repr(dimensional(name))
        assert "GJ" not in repr(dimensional(name))
