"""Boundaries of folding modes, followed in two parameters."""

import math
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from der.diagram.cases import LABELS, Row, solve_case
from der.diagram.curves.asking import answered
from der.diagram.curves.boundaries import _around, _kept, boundaries
from der.diagram.curves.conditions import KINDS, NotFound, asymptotic, fresh, numbers
from der.diagram.curves.corners import Line, Met, mark_corners
from der.diagram.curves.corners import _has as reaches
from der.diagram.curves.corners import _solved as solved
from der.diagram.curves.infinite_slope import across, infinite_slope_near
from der.diagram.curves.label_changes import seeds
from der.diagram.curves.polylines import loose_ends as loose_lines
from der.diagram.curves.polylines import meetings
from der.diagram.curves.pruning import beside
from der.diagram.curves.slices import Slice
from der.diagram.curves.tracing import At, States, corrected, trace
from der.diagram.distributed import follow, loose_ends, unexplained
from der.diagram.families import family
from der.diagram.scan import Scan, scan
from der.diagram.scanned_boundaries import Corner, Curve
from der.diagram.store import Store
from der.errors import ContinuationFailed

# of circles: the fold at pi, the cusp, the slope of the folded ring; closed form the last
THRESHOLDS = {"foldability": 1.5075766, "snap-back": 1.839582, "stability": 3.4699278}
THRESHOLDS["stays folded"] = THRESHOLDS["stability"]  # two modes of a circle are one


CORNERS = {  # of ellipses about y: b/a, h/t, gamma; a dense bisection of labels agrees to 4e-6
    ("exchange", "stability"): (0.784157664, 2.99846829, 2.66796943),
    ("snap-back", "stability"): (0.924023364, 3.40999610, 2.04633864),
    ("exchange", "foldability"): (0.775746065, 2.09776142, math.pi),
    ("exchange", "stays folded"): (0.793386628, 3.50450884, 2.56974537),
    ("snap-back", "stays folded"): (0.924924694, 3.47387138, 2.03872878),
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
    with Store(tmp_path_factory.mktemp("about_y") / "c.sqlite") as store:
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
            found = KINDS["stability"](of.case("x", u).scene(), seed)
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
    """No curve has a loose end, and the edge is met exactly."""
    corners = {(c.point.case.b_over_a, c.point.case.h_over_t) for c in about_y.corners}
    for curve in about_y.curves:
        for point in (curve.points[0], curve.points[-1]):
            b, h = point.case.b_over_a, point.case.h_over_t
            assert b in (0.75, 1.0) or h in (1.4, 4.0) or (b, h) in corners


def test_a_missing_curve_is_noticed(about_y):
    """Without the fold at pi the exchange has one loose end; with all curves there is none."""
    of = about_y.scan.family
    assert loose_ends(of, about_y.curves, about_y.corners) == []
    rest = [curve for curve in about_y.curves if curve.kind != "foldability"]
    (end,) = loose_ends(of, rest, [c for c in about_y.corners if "foldability" not in c.kinds])
    assert end.gamma == pytest.approx(math.pi, abs=1e-9)


def test_exchange_of_paths_has_errors_like_the_others(about_y):
    """Below 1e-7 in h/t, where bisection of labels gives 4e-6; gamma far from pi."""
    points = [p for c in about_y.curves if c.kind == "exchange" for p in c.points]
    assert len(points) > 10
    assert max(point.error for point in points) < 1e-7
    assert points[0].gamma == pytest.approx(math.pi, abs=1e-9) or points[-1].gamma == pytest.approx(
        math.pi, abs=1e-9
    )
    assert min(point.gamma for point in points) == pytest.approx(2.508011, abs=1e-5)


def test_rings_stay_folded_from_the_slope_on_where_no_other_motion_is_softer():
    """Triangles of 120 degrees: up to r/a = 0.126047 another class bounds, and beyond the slope."""
    of = family("fig8c", ranges={"r_over_a": (0.12, 0.1339), "h_over_t": (3.4, 4.0)}, finest=4)
    grid = [(i / 4, j / 4) for i in range(5) for j in range(5)]
    found, corners = boundaries(of, [solve_case(of.case("x", u)) for u in grid])
    (corner,) = corners
    assert corner.kinds == ("stability", "stays folded")
    at = corner.point.case
    assert (at.r_over_a, at.h_over_t) == pytest.approx((0.126047341, 3.575549622), abs=1e-7)
    assert sorted(c.kind for c in found) == ["stability", "stays folded", "stays folded"]
    slope, own, shared = ([point.case for point in curve.points] for curve in found)
    assert at in (own[0], own[-1])
    assert min(case.r_over_a for case in own) == 0.12
    assert set(shared) == {case for case in slope if case.r_over_a >= at.r_over_a}
    assert len(shared) > 3


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
        found = KINDS["infinite slope"](case(u).scene(), state)
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


def test_infinite_slope_is_followed_where_folded_states_merge():
    """Triangles of about 60 degrees, r/a from 0.033 to R_C by 5/8: two states merge at 59.8547.

    The curve turns back there and goes on with the other state; beside, an upright line meets it
    twice. Each meeting is a root of the other condition, which follows the path, and the slope of
    the path is infinite in unlike states.
    """
    of = family("fig8a")

    @lru_cache
    def ring(x, y):
        return of.case("x", (x, 0.625, y)).scene()

    def scene(u):
        return ring(float(u[0]), float(u[1]))

    def value(u, state):
        if not (0.3312 < u[0] < 0.3322 and 0.2138 < u[1] < 0.2151):
            raise NotFound("outside")
        found = infinite_slope_near(scene, u, state)
        return found.value, found

    seed = next(seeds("infinite slope", solve_case(of.case("x", (0.336, 0.625, 0.2145)))))
    states = States(lambda state: across(scene, fresh(state)), numbers)
    curve = trace(value, np.array([0.3321, 0.2141]), seed, states=states)
    places = np.array([at.u for at in curve])
    turned = int(np.argmin(places[:, 0]))
    assert 2 < turned < len(curve) - 3
    assert 30.0 + 90.0 * places[turned, 0] == pytest.approx(59.8547, abs=2e-4)
    met = list(meetings(places, np.array([(0.33185, 0.0), (0.33185, 1.0)])))
    assert len(met) == 2
    found = [curve[meeting.first] for meeting in met]
    for at in found:
        slope = KINDS["infinite slope"](scene(at.u), at.state)
        assert slope.value == pytest.approx(0.0, abs=1e-6)
        assert slope.at.moment == pytest.approx(0.0, abs=1e-9)
    assert abs(found[0].state.at.p[0] - found[1].state.at.p[0]) > 0.02


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


def test_curves_of_two_states_are_not_joined():
    """Two straight lines, one ending where the other begins beside it: each ends where it ends.

    Without a look at the states the one is taken for the other.
    """

    def steps(u, state):
        state = state if (u[0] < 0.52) == (state == 0.0) or 0.48 < u[0] < 0.52 else 1.0 - state
        return float(u[1] - 0.4 - 0.002 * state), state

    alone = trace(steps, np.array([0.2, 0.4]), 0.0, states=States(numbers=lambda s: np.array([s])))
    joined = trace(steps, np.array([0.2, 0.4]), 0.0)
    assert max(at.u[0] for at in alone) == pytest.approx(0.52, abs=1e-4)
    assert max(at.u[0] for at in joined) == 1.0


def test_a_curve_that_turns_back_is_not_looked_across():
    """Labels beside a point are asked for nearer to it than the curve's own way back is."""
    places = [(0.2, 0.5), (0.5, 0.5), (0.8, 0.5), (0.8, 0.5005), (0.5, 0.5005), (0.2, 0.5005)]
    points = [At(np.array(place), None, 0.0, np.zeros(2)) for place in places]
    (up, down) = beside(Line("foldability", points, [None] * 6), 1, [])
    assert {round(float(up[1]), 5), round(float(down[1]), 5)} == {0.50015, 0.49985}


def state(gamma, moment=1.0):
    """A state of which corners look at gamma and M alone."""
    return SimpleNamespace(at=SimpleNamespace(gamma=gamma, moment=moment))


def line_of(kind, places, one):
    points = [At(np.array(place), one, 0.0, np.ones(2)) for place in places]
    return Line(kind, points, [None] * len(points))


def test_a_curve_that_passes_beside_a_corner_does_not_end_there():
    """Rectangles about y: another fold at pi, of like M, passes the corner at 0.015 of the side."""
    at = At(np.array([0.5, 0.5]), state(math.pi, 3.24), 0.0, np.ones(2))
    met = Met(("exchange", "foldability"), at, at, 1e-9)
    for places, has in (
        ([(0.3, 0.515), (0.495, 0.515), (0.7, 0.515)], False),
        ([(0.3, 0.501), (0.495, 0.501), (0.7, 0.501)], True),
        ([(0.3, 0.515), (0.495, 0.515)], True),
    ):
        assert reaches(line_of("foldability", places, state(math.pi, 3.11)), met) is has


def test_two_curves_of_a_kind_cross_in_a_corner(monkeypatch):
    """Cusps of unlike states, on two straight lines; one followed twice crosses nothing."""
    monkeypatch.setattr("der.diagram.curves.corners.on", lambda mesh, seed: seed)

    def condition(kind):
        def value(u, seed):
            slope = 1.0 if seed.at.gamma == 1.0 else -1.0
            return float(u[1] - 0.5 - slope * (u[0] - 0.5)), seed

        return value

    up, down = state(1.0), state(2.0)
    up.at.mesh = down.at.mesh = SimpleNamespace(halved=None)
    rising = [(0.11, 0.11), (0.4, 0.4), (0.9, 0.9)]
    lines = [
        line_of("snap-back", rising, up),
        line_of("snap-back", [(0.1, 0.9), (0.6, 0.4), (0.9, 0.1)], down),
    ]
    (corner,) = mark_corners(lines, condition)
    np.testing.assert_allclose(corner.first.u, 0.5, atol=1e-9)
    assert all(corner in line.corners for line in lines)
    again = [(0.1, 0.1001), (0.5, 0.4999), (0.9, 0.9)]
    assert mark_corners([lines[0], line_of("snap-back", again, up)], condition) == []


def test_an_exchange_touches_a_cusp():
    """Triangles of 84.6 degrees, r/a = 0.033: the corner, and beside it a cusp on its curve.

    By two conditions of the exchange alone, where the curve of cusps, followed until it is lost
    beside it, leads.
    """
    of = family("fig8a")

    def condition(kind):
        def value(u, seed):
            found = KINDS[kind](of.case("x", (float(u[0]), 0.0, float(u[1]))).scene(), seed)
            return found.value, found

        return value

    place = np.array([0.607, 0.537])
    row = solve_case(of.case("x", (place[0], 0.0, place[1])))
    near = tried(condition("exchange"), place, seeds("exchange", row))[0]
    corner = solved(("exchange", "snap-back"), near.u, (near.state,) * 2, condition, asymptotic)
    u = corner.first.u
    assert corner.error < 1e-7
    assert condition("exchange")(u, corner.first.state)[0] == pytest.approx(0.0, abs=1e-9)
    assert abs(asymptotic(corner.first.state)) < 1e-4 * abs(asymptotic(near.state))
    assert tuple(u) == pytest.approx((0.606546, 0.537567), abs=2e-6)


def tried(f, place, starts):
    """The points of a curve that are found from several states."""
    found = []
    for start in starts:
        with suppress(ContinuationFailed):
            found.append(corrected(f, place, start))
    return found


def test_ends_are_looked_round():
    """Labels that change on a circle of radius 0.3: two places where it leaves a small circle."""
    of = family("fig5c")

    def label(case):
        far = math.dist(of.unit(case), (0.5, 0.5))
        foldable = far < 0.3
        return Row(case, LABELS[2] if foldable else LABELS[0], foldable, False, "snap-back")

    part = Slice(of, "x", None, {})
    end = [np.array([0.8, 0.5])]
    found = answered(_around(part, end, []), label)
    assert [crossing.kind for crossing in found] == ["foldability"] * 2
    for crossing in found:
        assert np.linalg.norm(crossing.middle - 0.5) == pytest.approx(0.3, abs=1e-3)
    turn = np.linspace(-0.1, 0.1, 21)
    arc = 0.5 + 0.3 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    assert answered(_around(part, end, [line_of("foldability", arc, None)]), label) == []


def test_a_curve_ends_where_labels_say_so(monkeypatch):
    """A straight line that bounds something up to a place between two of its points, to 2e-3."""
    of = family("fig5c")

    def label(case):
        x, y = of.unit(case)
        foldable = y > 0.5 or x > 0.53
        return Row(case, LABELS[2] if foldable else LABELS[0], foldable, False, "snap-back")

    part = Slice(of, "x", None, {})
    monkeypatch.setattr(
        "der.diagram.curves.on_slices.condition_on",
        lambda part, kind: lambda u, s: (float(u[1] - 0.5), s),
    )
    line = line_of("foldability", [(0.1, 0.5), (0.4, 0.5), (0.9, 0.5), (0.95, 0.5)], None)
    ((kept,), met) = answered(_kept(part, [line]), label)
    assert met == []
    assert kept.places[0] == pytest.approx((0.1, 0.5))
    assert kept.places[-1][0] == pytest.approx(0.53, abs=2e-3)
    assert len(line.points) == 4


def test_loose_ends_of_lines():
    """A line into the middle has one; one to the edge, to another or closed has none."""
    turn = np.linspace(0.0, 2.0 * np.pi, 20)
    lines = {
        "open": [(0.0, 0.2), (0.5, 0.2)],
        "edge": [(0.0, 0.9), (1.0, 0.9)],
        "meets": [(0.3, 0.0), (0.3, 0.2)],
        "corner": [(0.3, 0.9), (0.3, 0.7)],
        "closed": 0.7 + 0.1 * np.stack([np.cos(turn), np.sin(turn)], axis=1),
    }
    known = [(False, name == "corner") for name in lines]
    assert loose_lines([np.array(line) for line in lines.values()], known) == [(0, -1)]


def test_where_there_is_no_curve_nothing_is_found():
    """A positive function."""
    with pytest.raises(ContinuationFailed):
        corrected(lambda u, s: (1.0 + float(u @ u), s), np.array([0.5, 0.5]), None)
