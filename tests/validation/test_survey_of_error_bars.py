"""The survey of error bars: it judges what has a bar, and finds out a rod that is wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest

import der
from validation import error_bars as survey


@pytest.fixture(scope="module")
def bar():
    """A ring with a fold, a limit and a state at pi."""
    return der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=64, error_bars=True)


def test_a_good_rod_is_inside(bar):
    """The circle: every kind but branch points, all within their error bars."""
    things = list(survey.judged(bar))
    assert {thing.kind for thing in things} == {"state", "fold", "limit", "at pi", "slope"}
    assert max(thing.times for thing in things if thing.times is not None) < 1.0


def test_a_wrong_rod_is_outside(bar, monkeypatch):
    """Moments are one per mille too large: states, folds and limits say so, with their ring."""
    rod = der.fold(bar)
    monkeypatch.setattr(der, "fold", lambda scene: replace(rod, moment=1.001 * rod.moment))
    done = survey.Survey()
    done.add("paper", bar)
    rows = [r for r in json.loads(survey.saved(done))["judged"] if r["times"] not in (None, "nan")]
    outside = {row["kind"] for row in rows if float(row["times"]) > 1.0}
    assert {"state", "fold", "limit"} <= outside
    assert all(("ring" in row) == (float(row["times"]) > 1.0) for row in rows)
    assert " 0.0 %" in str(done)


def test_branch_points_are_held_against_finer_rods():
    """Ellipse 0.6 about x, h/t = 1.3: gamma = 3.0139356173."""
    scene = der.Scene(der.ellipse(0.6), der.rectangular_section(1.3))
    ((values, error),) = survey._branch_points(scene)
    assert values[0] == pytest.approx(3.0139356173, abs=1e-9)
    assert error[0] < 1e-8


def test_rings_are_drawn_from_the_seed():
    """Two of five are profiles, closed and mirror symmetric; the same seed gives the same rings."""
    first, again = (list(survey.rings(10, 3)) for _ in range(2))
    assert [shape for shape, *_ in first].count("paper") == 6
    for (shape, ring, section), (_, ring_again, section_again) in zip(first, again, strict=True):
        assert (ring, section) == (ring_again, section_again)
        assert (ring.shape == "profile") == (shape != "paper")
        assert np.abs(ring.position(ring.length * (1.0 - 1e-15)) - ring.position(0.0)).max() < 1e-9
