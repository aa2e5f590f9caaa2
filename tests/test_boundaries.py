"""Boundaries of folding modes, followed in two parameters."""

import numpy as np
import pytest

from validation.conditions import Lost
from validation.phase import phase, unexplained
from validation.tracing import corrected, trace

# of circles: the fold at pi, the cusp, the slope of the folded ring; closed form the last
THRESHOLDS = {"foldability": 1.5075766, "snap-back": 1.839582, "stability": 3.4699278}


@pytest.fixture(scope="module")
def diagram(tmp_path_factory):
    """A part of fig3a at the circle, both axes."""
    ranges = {"b_over_a": (0.8, 1.0), "h_over_t": (1.0, 4.0)}
    folder = tmp_path_factory.mktemp("diagram")
    return phase("fig3a", folder, ranges=ranges, finest=8, workers=2, progress=False)


@pytest.mark.parametrize("kind", THRESHOLDS)
def test_boundaries_pass_the_circle_at_its_thresholds(diagram, kind):
    """From both sides, b/a = 1 about x and about y, to 1e-6."""
    ends = [
        point
        for curve in diagram.curves
        if curve.kind == kind
        for point in curve.points
        if point.case.b_over_a == 1.0
    ]
    assert [end.case.h_over_t for end in ends] == pytest.approx([THRESHOLDS[kind]] * 2, abs=1e-6)
    assert max(end.error for end in ends) < 1e-6


def test_curves_explain_the_scan(diagram):
    """Every edge between unlike cases of the scan has a boundary within a cell and a half."""
    assert unexplained(diagram.scan, diagram.curves) == 0
    assert unexplained(diagram.scan, diagram.curves[1:]) > 0


def test_stability_is_the_same_about_both_axes(diagram):
    """The folded ring is the same, and so is the mode that it loses: h/t at b/a = 0.8 to 1e-6."""
    ends = [
        point.case.h_over_t
        for curve in diagram.curves
        if curve.kind == "stability"
        for point in curve.points
        if point.case.b_over_a == 0.8
    ]
    assert ends == pytest.approx([3.060680] * 2, abs=1e-6)


def circle(u, state):
    """A circle of radius 0.3 about the middle; the state counts the calls."""
    return float(np.sum((u - 0.5) ** 2) - 0.09), state + 1


def test_a_closed_curve_is_followed_once_round():
    """Turning back in both parameters on the way: every point at its radius, no gap, no overlap."""
    points = np.array([at.u for at in trace(circle, np.array([0.85, 0.5]), 0)])
    assert np.linalg.norm(points - 0.5, axis=1) == pytest.approx(0.3, abs=1e-8)
    angles = np.unwrap(np.arctan2(*(points - 0.5).T[::-1]))
    assert abs(angles[-1] - angles[0]) == pytest.approx(2 * np.pi, abs=0.3)
    assert (np.diff(angles) > 0).all() or (np.diff(angles) < 0).all()


def test_an_open_curve_ends_on_the_edges_of_the_square():
    """A parabola, from one side to the other, its ends exactly on the sides."""
    found = trace(lambda u, s: (float(u[1] - 0.2 - u[0] ** 2 / 2), s), np.array([0.5, 0.4]), None)
    ends = sorted(tuple(at.u) for at in (found[0], found[-1]))
    np.testing.assert_allclose(ends, [(0.0, 0.2), (1.0, 0.7)], atol=1e-7)


def test_where_there_is_no_curve_nothing_is_found():
    """A positive function."""
    with pytest.raises(Lost):
        corrected(lambda u, s: (1.0 + float(u @ u), s), np.array([0.5, 0.5]), None)
