"""Boundaries of folding modes, followed in two parameters."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from validation.cases import solve_case
from validation.conditions import KINDS, Lost
from validation.crossings import seeds
from validation.edges import Corner, Curve
from validation.families import family
from validation.following import follow, unexplained
from validation.polygons import meetings
from validation.scan import Scan, scan
from validation.store import Store
from validation.tracing import corrected, trace

# of circles: the fold at pi, the cusp, the slope of the folded ring; closed form the last
THRESHOLDS = {"foldability": 1.5075766, "snap-back": 1.839582, "stability": 3.4699278}


CORNERS = {  # of ellipses about y: b/a, h/t, gamma; a dense bisection of labels agrees to 4e-6
    ("exchange", "stability"): (0.784157664, 2.99846829, 2.66796943),
    ("snap-back", "stability"): (0.924023364, 3.40999610, 2.04633864),
    ("exchange", "foldability"): (0.775746065, 2.09776142, math.pi),
}


class AboutY(NamedTuple):
    """A part of fig. 3a, about y alone."""

    scan: Scan
    curves: list[Curve]
    corners: list[Corner]


@pytest.fixture(scope="module")
def about_y(tmp_path_factory):
    """Fig. 3a from where boundaries meet to the circle, on a coarse grid."""
    of = family("fig3a", ranges={"b_over_a": (0.75, 1.0), "h_over_t": (1.4, 4.0)}, finest=8)
    of = replace(of, sheets=("y",), coarse=8)
    crew = SimpleNamespace(executor=ThreadPoolExecutor(1), width=1)
    with Store(tmp_path_factory.mktemp("about_y") / "c.jsonl") as store:
        found = scan(of, store, crew, progress=False)
        return AboutY(found, *follow(found, store, crew, solve_case))


@pytest.mark.parametrize("kind", THRESHOLDS)
def test_boundaries_pass_the_circle_at_its_thresholds(about_y, kind):
    """On the edge of the diagram, b/a = 1, to 1e-6."""
    ends = [
        point
        for curve in about_y.curves
        if curve.kind == kind
        for point in curve.points
        if point.case.b_over_a == 1.0
    ]
    assert [end.case.h_over_t for end in ends] == pytest.approx([THRESHOLDS[kind]], abs=1e-6)
    assert max(end.error for end in ends) < 1e-6


def test_curves_explain_the_scan(about_y):
    """Every edge between unlike cases of the scan has a boundary within a cell and a half."""
    assert unexplained(about_y.scan, about_y.curves) == 0
    assert unexplained(about_y.scan, about_y.curves[1:]) > 0


def test_stability_is_the_same_about_both_axes(about_y):
    """The folded ring is the same, and so is the mode that it loses.

    A place on the curve about y, of which that about x must be less than 1e-6 away.
    """
    (curve,) = [curve for curve in about_y.curves if curve.kind == "stability"]
    of = family("fig3a")
    for point in curve.points[3::6]:
        place = np.array(of.unit(point.case))
        state = next(seeds("stability", solve_case(of.case("x", place + np.array([0.0, 0.01])))))

        def slope(u, seed):
            found = KINDS["stability"].condition(of.case("x", u).scene(), seed)
            return found.value, found

        on_it = corrected(slope, place, state)
        assert np.linalg.norm(on_it.u - place) < 1e-6


def test_corners_are_solved_for(about_y):
    """Two conditions at once, to 1e-7 in both parameters; and no more corners than there are."""
    found = {corner.kinds: corner.point for corner in about_y.corners}
    assert set(found) == set(CORNERS)
    for kinds, expected in CORNERS.items():
        point = found[kinds]
        place = (point.case.b_over_a, point.case.h_over_t, point.gamma)
        assert place == pytest.approx(expected, abs=1e-7)
        assert point.error < 1e-7


def test_curves_meet_in_their_corners(about_y):
    """Each corner is a point of a curve of either kind."""
    for corner in about_y.corners:
        for kind in corner.kinds:
            places = [
                (point.case.b_over_a, point.case.h_over_t)
                for curve in about_y.curves
                if curve.kind == kind
                for point in curve.points
            ]
            assert (corner.point.case.b_over_a, corner.point.case.h_over_t) in places


def test_ends_of_curves_are_corners_or_on_the_edge(about_y):
    """No curve ends in the middle of nowhere, and the edge is met exactly."""
    corners = {(c.point.case.b_over_a, c.point.case.h_over_t) for c in about_y.corners}
    for curve in about_y.curves:
        for point in (curve.points[0], curve.points[-1]):
            b, h = point.case.b_over_a, point.case.h_over_t
            assert b in (0.75, 1.0) or h in (1.4, 4.0) or (b, h) in corners


def test_exchange_of_paths_has_errors_like_the_others(about_y):
    """Below 1e-7 in h/t, where bisection of labels gives 4e-6; gamma far from pi."""
    points = [p for c in about_y.curves if c.kind == "exchange" for p in c.points]
    assert len(points) > 10
    assert max(point.error for point in points) < 1e-7
    assert points[0].gamma == pytest.approx(math.pi, abs=1e-9) or points[-1].gamma == pytest.approx(
        math.pi, abs=1e-9
    )
    assert min(point.gamma for point in points) == pytest.approx(2.508011, abs=1e-5)


@pytest.mark.parametrize(("beside", "foldable"), [(1e-4, True), (-1e-4, False)])
def test_infinite_slope_bounds_foldability(beside, foldable):
    """Triangle of 90 degrees, r/a from 0.033 to R_C by 3/8: a root of the slope's inverse.

    The label of paths followed afresh changes there, without a fold on the foldable side.
    """
    of = family("fig8a")

    def case(u):
        return of.case("x", (2 / 3, 0.375, float(u[1])))

    row = solve_case(case((0.0, 0.35)))
    seed = next(seeds("infinite slope", row))

    def value(u, state):
        found = KINDS["infinite slope"].condition(case(u).scene(), state)
        return found.value, found

    low, high, state = 0.24, 0.35, seed
    for u in np.linspace(high, low, 12):
        below, state = value((0.0, u), state)
    assert below < 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        now, _ = value((0.0, middle), state)
        low, high = (middle, high) if now < 0.0 else (low, middle)
    assert high - low < 1e-9
    row = solve_case(case((0.0, low + beside)))
    assert (row.foldable, row.folds) == (foldable, ())


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2])
def test_polygons_cross_once(angle):
    """Two lines at right angles, turned: in their known point, after the known corners."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    one = np.array([(0.0, 0.1), (0.5, 0.1), (1.0, 0.1)]) @ turn.T
    other = np.array([(0.7, -1.0), (0.7, 0.0), (0.7, 1.0)]) @ turn.T
    found = list(meetings(one, other))
    assert [(m.first, m.second) for m in found] == [(1, 1)]
    np.testing.assert_allclose(found[0].place, turn @ (0.7, 0.1), atol=1e-15)


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
