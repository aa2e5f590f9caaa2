"""Rings: closed, symmetric, of known length, and exact in arc length."""

import json
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import ellipe

from der.geometry.profile import CLOSED
from der.geometry.ring import Ring
from der.geometry.shapes import circle, ellipse, profile, rectangle, ring_from_json, triangle


def inscribed(vertex_angle: float) -> float:
    """R_C / a of the sharp triangle (paper, section 3.4)."""
    return math.tan(math.pi / 4 - vertex_angle / 4) / 2


def egg(n: int) -> np.ndarray:
    """Points of a smooth ring without the symmetry of an ellipse, blunt end at the second grip."""
    tau = 2 * np.pi * np.arange(n) / n
    radius = 1 - 0.15 * np.cos(tau) + 0.05 * np.cos(2 * tau)
    return np.column_stack([radius * np.sin(tau), -radius * np.cos(tau)])


def as_knots(ring: Ring) -> tuple[np.ndarray, np.ndarray]:
    """Arc length and curvature of a ring of straights and arcs, as a user would type them."""
    corners = np.array([0.0, *ring.breaks, ring.length])
    middle = (corners[1:] + corners[:-1]) / 2
    return np.repeat(corners, 2)[1:-1], np.repeat(ring.curvature(middle), 2)


RINGS = {
    "circle": circle(),
    "straight bar": circle(0.0),
    "ellipse x": ellipse(0.6),
    "ellipse y": ellipse(0.85, "y"),
    "slender x": ellipse(0.2),
    "slender y": ellipse(0.2, "y"),
    "rectangle x": rectangle(0.6, 0.3),
    "rectangle y": rectangle(0.6, 0.3, "y"),
    "square": rectangle(1.0, 0.1),
    "stadium": rectangle(0.2, 0.2),
    "rectangle as circle": rectangle(1.0, 1.0),
    "triangle 60": triangle(math.pi / 3, math.sqrt(3) / 12),
    "triangle 90": triangle(math.pi / 2, 1 / 30),
    "triangle 120": triangle(2 * math.pi / 3, 1 / 15),
    "triangle as circle": triangle(1.0, inscribed(1.0)),
    "profile": profile(*as_knots(triangle(1.2, 0.1))),
    "points": profile(points=egg(80)),
}
EVERY = pytest.mark.parametrize("ring", RINGS.values(), ids=RINGS.keys())
D2 = {name: ring for name, ring in RINGS.items() if ring.symmetry == "D2"}
EVERY_D2 = pytest.mark.parametrize("ring", D2.values(), ids=D2.keys())


def around(ring: Ring, n: int = 1001) -> np.ndarray:
    return np.linspace(0, ring.length, n)


# --- What holds for every ring -------------------------------------------------------------------


@EVERY
def test_ring_closes(ring):
    """The last point of the outline is the first; 1e-13 is the promise of the module."""
    end = ring.outline.place(np.array(ring.length))
    assert abs(end - ring.outline.place(np.array(0.0))) < 1e-13


@EVERY
def test_ring_turns_once(ring):
    """Hopf: the tangent of a simple closed curve turns by 2 pi."""
    assert float(ring.outline.angle(np.array(ring.length))) == pytest.approx(2 * np.pi, abs=1e-14)


@EVERY
def test_halves_join_with_one_tangent(ring):
    """Theta = pi at the second grip, seen from either side: a kink would be rounding only."""
    before, after = ring.angle(ring.length / 2 * np.array([1 - 1e-15, 1 + 1e-15]))
    assert (before, after) == pytest.approx((np.pi, np.pi), abs=1e-13)


@EVERY
def test_angle_grows_by_a_turn_each_time_around(ring):
    """Theta(s + L) = Theta(s) + 2 pi; arc length rounds to 1e-15, the angle to kappa times it."""
    s = around(ring, 57)
    sharpest = np.max(np.abs(ring.outline.curvature(s)))
    turned = ring.angle(s - 3 * ring.length) + 6 * np.pi - ring.angle(s)
    assert_allclose(turned, 0, atol=1e-14 * (1 + sharpest))


@EVERY
def test_tangent_is_the_derivative_of_position(ring):
    """The tangent r' is (0, cos Theta, sin Theta): checked cell by cell with Gauss points."""
    s = np.unique(np.append(around(ring), ring.breaks))
    node, weight = np.polynomial.legendre.leggauss(8)
    step = np.diff(s)
    angle = ring.angle(s[:-1, None] + np.multiply.outer(step, (1 + node) / 2))
    chord = (step / 2)[:, None] * np.column_stack([np.cos(angle) @ weight, np.sin(angle) @ weight])
    assert_allclose(np.diff(ring.position(s)[:, 1:], axis=0), chord, atol=2e-14)


@EVERY
def test_angle_is_the_integral_of_curvature(ring):
    """Theta_natural' = k1u over each cell, by Gauss points, breaks being cell ends."""
    s = np.unique(np.concatenate([around(ring), ring.breaks, knots_of(ring)]))
    node, weight = np.polynomial.legendre.leggauss(8)
    step = np.diff(s)
    inside = s[:-1, None] + np.multiply.outer(step, (1 + node) / 2)
    turned = step / 2 * (ring.curvature(inside) @ weight)
    assert_allclose(np.diff(ring.natural_angle(s)), turned, atol=3e-13)


def knots_of(ring: Ring) -> np.ndarray:
    """Kinks of a user's curvature, at which a quadrature has to stop."""
    return np.array(ring.parameters.get("arc_length", []))


@EVERY
def test_ring_is_its_mirror_image(ring):
    """Mirror symmetry about E3: r(L - s) = (0, -r2(s), r3(s))."""
    s = around(ring)
    mirrored = ring.position(ring.length - s) * [1, -1, 1]
    assert_allclose(mirrored, ring.position(s), atol=1e-13)


@EVERY_D2
def test_d2_ring_is_its_mirror_image_about_e2(ring):
    """D2: r(L/2 - s) = (0, r2(s), -r3(s))."""
    s = around(ring)
    mirrored = ring.position(ring.length / 2 - s) * [1, 1, -1]
    assert_allclose(mirrored, ring.position(s), atol=1e-13)


def test_triangles_and_eggs_are_c2():
    """An isosceles triangle has one axis of symmetry."""
    assert {name for name, ring in RINGS.items() if ring.symmetry == "C2"} == {
        "triangle 60",
        "triangle 90",
        "triangle 120",
        "triangle as circle",
        "profile",
        "points",
    }


@EVERY
def test_grips_are_on_the_axis_about_the_origin(ring):
    """The grips sit at r2 = 0, r3 = -+ half their distance; the first tangent is +E2."""
    first, second = ring.position([0, ring.length / 2])
    assert_allclose([first[1], second[1], first[2] + second[2]], 0, atol=1e-13)
    assert second[2] > 0
    assert float(ring.angle(0.0)) == 0.0


@EVERY
def test_methods_follow_the_shape_of_their_argument(ring):
    """A scalar gives a scalar, an array its own shape; position appends the components."""
    s = np.full((2, 3), 0.1)
    assert np.shape(ring.angle(0.1)) == np.shape(ring.curvature(0.1)) == ()
    assert ring.natural_angle(s).shape == (2, 3)
    assert ring.position(0.1).shape == (3,)
    assert ring.position(s).shape == (2, 3, 3)


@EVERY
def test_json_gives_the_ring_back(ring):
    """Reading what was written gives an equal ring of the same geometry, to the last bit."""
    back = ring_from_json(json.loads(json.dumps(ring.to_json())))
    assert back == ring
    assert np.array_equal(back.position(around(ring, 57)), ring.position(around(ring, 57)))
    assert back.breaks == ring.breaks


@EVERY
def test_rings_travel_between_processes(ring):
    """A worker gets the ring by pickle; equal rings are one key of a dictionary."""
    back = pickle.loads(pickle.dumps(ring))
    assert {ring: "here"}[back] == "here"


# --- Reference solutions -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ring", "curvature", "free", "grip"),
    [
        (circle(), 1.0, 1.0, 1.0),
        (ellipse(0.6, "x"), 6.0000000000e-01, 1.0, 0.6),
        (ellipse(0.85, "y"), 1.3840830450e00, 0.85, 1.0),
        (rectangle(0.6, 0.3, "x"), 0.0, 1.0, 0.6),
    ],
)
def test_flat_ring_is_that_of_the_reference(ring, curvature, free, grip):
    """Row gamma = 0 of reference/*.csv (AUTO-07p): k1 and r3 at the grip, r2 of the free point."""
    place = ring.position([ring.length / 4, ring.length / 2])
    values = [ring.curvature(ring.length / 2), place[0, 1], place[1, 2]]
    assert_allclose(values, [curvature, free, grip], atol=1e-10)


@pytest.mark.parametrize(
    ("ring", "curvature", "height"),
    [
        (triangle(math.pi / 3, math.sqrt(3) / 12), 6.9282032303e00, 7.2168783649e-01),
        (triangle(math.pi / 2, 1 / 30), 3.0000000000e01, 4.8619288127e-01),
    ],
)
def test_flat_triangle_is_that_of_the_reference(ring, curvature, height):
    """Row gamma = 0 of reference/tri_*.csv: k1 at the apex, and its height above the base."""
    first, second = ring.position([0, ring.length / 2])
    values = [ring.curvature(ring.length / 2), second[2] - first[2], ring.curvature(0.0)]
    assert_allclose(values, [curvature, height, 0.0], atol=1e-10)


# --- Each shape ----------------------------------------------------------------------------------


def test_circle_is_a_circle():
    """Position (0, sin s, -cos s), Theta = s."""
    s = np.linspace(-10, 10, 101)
    exact = np.column_stack([0 * s, np.sin(s), -np.cos(s)])
    assert_allclose(circle().position(s), exact, atol=5e-15)
    assert_allclose(circle().angle(s), s, atol=5e-15)


@pytest.mark.parametrize("natural_curvature", [0.0, 2.666667, -1.777778])
def test_natural_curvature_changes_the_bar_not_the_ring(natural_curvature):
    """The flat ring with changed kappa0; its natural turning is kappa0 s."""
    ring, s = circle(natural_curvature), np.linspace(0, 2 * np.pi, 9)
    assert_allclose(ring.natural_angle(s), natural_curvature * s, atol=2e-14)
    assert_allclose(ring.curvature(s), natural_curvature)
    assert_allclose(ring.angle(s), s, atol=2e-15)


@pytest.mark.parametrize("b", [1.0, 0.85, 0.2, 0.01])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_ellipse_has_its_perimeter(b, axis):
    """L = 4 E(1 - b^2), whichever axis is twisted."""
    assert ellipse(b, axis).length == pytest.approx(4 * ellipe(1 - b**2), rel=1e-15)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_points_of_the_ellipse_are_on_it(axis):
    """(r2/p)^2 + (r3/q)^2 = 1, with E3 the short semi-axis about x and the long one about y."""
    ring = ellipse(0.6, axis)
    p, q = (1.0, 0.6) if axis == "x" else (0.6, 1.0)
    _, r2, r3 = ring.position(around(ring)).T
    assert_allclose((r2 / p) ** 2 + (r3 / q) ** 2, 1, atol=2e-15)


@pytest.mark.parametrize(("axis", "curvature"), [("x", [0.6, 1 / 0.36]), ("y", [1 / 0.36, 0.6])])
def test_ellipse_has_its_vertex_curvatures(axis, curvature):
    """Eq. (1): b/a^2 at the ends of the short semi-axis, a/b^2 at those of the long one."""
    ring = ellipse(0.6, axis)
    assert_allclose(ring.curvature([0, ring.length / 4]), curvature, rtol=1e-13)


@pytest.mark.parametrize("b", [0.85, 0.2, 0.01])
def test_ellipse_about_x_is_that_about_y_turned(b):
    """The two differ by a quarter turn; 1e-15 of arc length is 1e-15/b^2 of angle."""
    about_x, about_y = ellipse(b, "x"), ellipse(b, "y")
    s = around(about_x)
    turned = about_x.angle(s + about_x.length / 4) - np.pi / 2
    assert_allclose(turned, about_y.angle(s), atol=4e-15 / b**2)


def test_round_ellipse_is_the_circle():
    """The limit b = a."""
    s = np.linspace(0, 2 * np.pi, 101)
    assert_allclose(ellipse(1.0).angle(s), s, atol=2e-15)


def test_ellipse_as_slender_as_allowed_is_solved():
    """Newton's method starts far from the root there and must still arrive: r is on the curve."""
    ring = ellipse(1e-6)
    _, r2, r3 = ring.position(around(ring)).T
    assert_allclose(r2**2 + (r3 / 1e-6) ** 2, 1, atol=1e-14)
    assert_allclose(np.abs(np.diff(r2)), ring.length / 1000, rtol=1e-6)


@pytest.mark.parametrize(("b", "r"), [(0.6, 0.3), (1.0, 0.1), (0.2, 0.2)])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_rectangle_has_its_length(b, r, axis):
    """L = 4 (a + b) - (8 - 2 pi) r."""
    length = 4 * (1 + b) - (8 - 2 * np.pi) * r
    assert rectangle(b, r, axis).length == pytest.approx(length, rel=1e-14)


@pytest.mark.parametrize(("axis", "extents"), [("x", (1.0, 0.6)), ("y", (0.6, 1.0))])
def test_rectangle_has_its_extents(axis, extents):
    """About x the twisting axis E3 is the short one, about y the long one."""
    ring = rectangle(0.6, 0.3, axis)
    place = ring.position([ring.length / 4, ring.length / 2])
    assert (place[0, 1], place[1, 2]) == pytest.approx(extents, abs=1e-14)


def test_rectangle_breaks_where_fillets_begin_and_end():
    """Straights of 0.7 a and 2 x 0.3 a, fillets of pi/2 r: eight jumps."""
    quarter = [0.7, 0.7 + 0.15 * np.pi]
    half = 1.0 + 0.15 * np.pi
    half_ring = [*quarter, 2 * half - quarter[1], 2 * half - quarter[0]]
    expected = [*half_ring, *(2 * half + np.array(half_ring))]
    assert_allclose(rectangle(0.6, 0.3).breaks, expected, rtol=1e-15)


@pytest.mark.parametrize("name", ["rectangle x", "square", "stadium", "triangle 60", "profile"])
def test_curvature_is_right_continuous_at_breaks(name):
    """At a break, exactly, the curvature is that of the piece that begins there."""
    ring = RINGS[name]
    breaks = np.array(ring.breaks)
    assert_allclose(ring.curvature(breaks), ring.curvature(breaks + 1e-6), rtol=1e-12)
    assert np.all(np.abs(ring.curvature(breaks) - ring.curvature(breaks - 1e-6)) > 1)


def test_fillets_that_meet_leave_no_break():
    """A stadium jumps four times, and a ring all of fillets of one radius is smooth."""
    assert len(RINGS["stadium"].breaks) == 4
    assert RINGS["triangle as circle"].breaks == RINGS["rectangle as circle"].breaks == ()


@pytest.mark.parametrize("degrees", [30, 60, 90, 120])
def test_triangle_has_its_length(degrees):
    """L = L_sharp - 2 r sum cot(angle/2) + 2 pi r over the three corners."""
    apex, r = math.radians(degrees), 1 / 30
    base = (math.pi - apex) / 2
    sharp = 1 + 1 / math.sin(apex / 2)
    cut = 2 / math.tan(base / 2) + 1 / math.tan(apex / 2)
    length = sharp - 2 * r * cut + 2 * math.pi * r
    assert triangle(apex, r).length == pytest.approx(length, rel=1e-14)


def test_triangle_sits_on_its_base():
    """The base is the straight at the first grip; the widest place is at the base's corners."""
    ring = triangle(math.pi / 3, 0.1)
    s = around(ring)
    _, r2, r3 = ring.position(s).T
    assert r3.min() == pytest.approx(r3[0], abs=1e-15)
    assert r3[np.argmax(r2)] < 0


def test_largest_fillets_make_a_circle_of_a_triangle():
    """R_C of section 3.4: the inscribed circle."""
    ring = RINGS["triangle as circle"]
    assert ring.length == pytest.approx(2 * np.pi * inscribed(1.0), rel=1e-13)


@pytest.mark.parametrize("off", [-5e-13, 0.0, 5e-13])
@pytest.mark.parametrize("degrees", [10.0, 60.0, 157.714334984678, 179.0])
def test_rounding_of_the_largest_fillet_leaves_no_straights(degrees, off):
    """The angle is rounded to 1e-12 degrees, and so is the radius that a user computes from it.

    A straight of 1e-13 on one side of a frame in one arm, on the other in the other, would bend the
    two unequally.
    """
    angle = math.radians(degrees)
    ring = triangle(angle, inscribed(angle) * (1.0 + off))
    assert ring.breaks == ()
    turn = np.diff(ring.natural_angle(np.linspace(0.0, ring.length, 129)))
    assert_allclose(turn, 2.0 * np.pi / 128.0, rtol=1e-12)


def test_vertex_angle_is_in_degrees_in_the_record():
    """Radians in Python, degrees in files."""
    assert triangle(math.pi / 3, 0.1).to_json() == {
        "shape": "triangle",
        "vertex_angle": 60.0,
        "r_over_a": 0.1,
        "twist_axis": "x",
    }


def test_record_of_an_ellipse():
    """The record names a shape and its parameters."""
    record = {"shape": "ellipse", "b_over_a": 0.85, "twist_axis": "y"}
    assert ellipse(0.85, "y").to_json() == record


def test_repr_says_how_to_make_it():
    """A ring prints as its parameters, a profile without its thousand numbers."""
    assert repr(ellipse(0.6)) == "Ring(ellipse, b_over_a=0.6, twist_axis=x)"
    assert len(repr(RINGS["points"])) < 50


def test_rings_differ_by_axis_and_parameter():
    """Equality is that of the statement."""
    assert ellipse(0.6) == ellipse(0.6)
    assert ellipse(0.6) != ellipse(0.6, "y")
    assert ellipse(0.6) != ellipse(0.7)


# --- The user's profile --------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["circle", "rectangle x", "square", "stadium", "triangle 90"])
def test_profile_of_a_known_shape_is_that_shape(name):
    """Straights and arcs typed as knots, jumps as repeated ones, give the ring they came from."""
    known = RINGS[name]
    ring = profile(*as_knots(known))
    assert_allclose(ring.position(around(known)), known.position(around(known)), atol=1e-13)
    assert_allclose(ring.breaks, known.breaks, atol=1e-14)
    assert ring.symmetry == known.symmetry


def test_profile_closes_rounded_input():
    """Eight decimals leave a gap of 1e-8, which is closed by a change of that size."""
    s, k = as_knots(triangle(1.2, 0.1))
    ring = profile(np.round(s, 8), np.round(k, 8))
    end = ring.position(ring.length / 2)
    assert abs(end[1]) <= CLOSED * ring.length
    assert_allclose(ring.angle(around(ring)), profile(s, k).angle(around(ring)), atol=1e-6)


def test_points_on_an_ellipse_converge_to_it():
    """A cubic spline's angle is off by h^3: twice the points, an eighth of the error."""
    errors = []
    for n in (80, 160):
        tau = 2 * np.pi * np.arange(n) / n
        ring = profile(points=np.column_stack([3 * np.sin(tau), -1.8 * np.cos(tau)]))
        exact = ellipse(0.6)
        errors.append(np.max(np.abs(ring.angle(around(exact)) - exact.angle(around(exact)))))
    assert errors[1] < 1e-5
    assert 6 < errors[0] / errors[1] < 10


def test_points_may_be_moved_turned_scaled_and_reversed():
    """Only the shape counts: a similarity, or going round the other way, changes rounding only."""
    points = egg(80)
    turn = np.array([[math.cos(0.7), math.sin(0.7)], [-math.sin(0.7), math.cos(0.7)]])
    other = 5 * np.roll(points[::-1], 1, axis=0) @ turn + [3, -2]
    ring = RINGS["points"]
    assert_allclose(profile(points=other).angle(around(ring)), ring.angle(around(ring)), atol=1e-12)


def test_points_are_scaled_by_half_the_larger_extent():
    """The reference length a of a profile of points: here the height, the grips being points."""
    ring = RINGS["points"]
    assert float(np.ptp(egg(80), axis=0)[1] / 2) == pytest.approx(1.05)
    assert ring.position(ring.length / 2)[2] == pytest.approx(1.0, abs=1e-5)


def test_natural_curvature_of_a_long_piece_is_integrated_exactly():
    """A circle of two knots turns by 2 pi in one piece; positions stay exact to rounding."""
    ring, s = profile([0, 2 * np.pi], [1, 1]), np.linspace(0, 6, 61)
    assert_allclose(ring.position(s), circle().position(s), atol=5e-15)


# --- Bad input -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: circle(math.inf), r"natural_curvature must be .* -1e\+08 to 1e\+08, got inf"),
        (lambda: circle("1"), r"natural_curvature must be .* -1e\+08 to 1e\+08, got '1'"),
        (lambda: circle(-1e9), r"natural_curvature must be .*, got -1000000000.0"),
        (lambda: rectangle(1e-6, 1e-6), r"b_over_a must be .*, at least 1e-05, got 1e-06"),
        (lambda: rectangle(0.5, 1e-6), r"r_over_a must be .*, at least 1e-05 .*, got 1e-06"),
        (lambda: ellipse(0), r"b_over_a must be a number in \(0, 1\], .*, got 0"),
        (lambda: ellipse(1.01), r"b_over_a must be .*, got 1.01"),
        (lambda: ellipse(math.nan), r"b_over_a must be .*, got nan"),
        (lambda: ellipse(True), r"b_over_a must be .*, got True"),
        (lambda: ellipse(0.5, "z"), "twist_axis must be 'x' or 'y', got 'z'"),
        (lambda: ellipse(0.5, 1), "twist_axis must be 'x' or 'y', got 1"),
        (lambda: rectangle(0.5, 0.6), r"r_over_a must be a number in \(0, 0.5\], .*b_over_a, got"),
        (lambda: rectangle(0.5, 0), r"r_over_a must be .*, got 0"),
        (lambda: triangle(math.pi, 0.1), r"vertex_angle must be an angle in \(0, pi\) rad, got 3"),
        (lambda: triangle(60, 0.1), r"vertex_angle must be .*, got 60"),
        (lambda: triangle(1, 0.3), r"r_over_a must be .* inscribed circle's radius, got 0.3"),
        (lambda: circle().angle([0, math.nan]), "s must be finite arc lengths, got"),
    ],
)
def test_bad_input_is_named(make, message):
    """A ValueError names the argument, what is allowed and the value."""
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, r"arc_length must be an array of numbers, shape \(n,\), got None"),
        ({"arc_length": [0, 1]}, "curvature must be an array of numbers"),
        ({"arc_length": [0, 1], "curvature": [1, "a"]}, "curvature must be an array of numbers"),
        ({"arc_length": [[0, 1], [2]], "curvature": [1, 1]}, "arc_length must be an array"),
        ({"arc_length": [0, 3, 6], "curvature": [1, math.nan, 1]}, "curvature must be finite"),
        ({"arc_length": [0, 1], "curvature": [1, 1, 1]}, "of one length >= 2, got 2 and 3"),
        ({"arc_length": [0, 2, 1], "curvature": [1, 1, 1]}, "must start at 0 and not decrease"),
        ({"arc_length": [0, 5], "curvature": [1, 1]}, r"2 pi -1.28 rad and a gap of 0.239"),
        ({"arc_length": [0, 10], "curvature": [5, -5]}, "got 50 rad after arc length 0"),
        ({"arc_length": [0, 1], "curvature": [1, 1], "points": egg(9)}, "points must be given w"),
        ({"points": egg(6)}, "points must be at least 8, each unlike its neighbour, got 6"),
        ({"points": np.zeros((9, 2))}, "points must have an extent .*, got 0"),
        ({"points": np.zeros((9, 4))}, r"shape \(n, 2\) or \(n, 3\), got \(9, 4\)"),
        ({"points": 1e200 * egg(80)}, r"points\[0, 1\] must be at most 1e\+30 in size"),
        ({"points": egg(80)[np.argsort(egg(80)[:, 0])]}, "once round a closed ring, in order"),
        ({"points": egg(80), "twist_axis": "z"}, "twist_axis must be 'x' or 'y', got 'z'"),
        ({"points": egg(80), "twist_axis": "y"}, "twist_axis must be 'x' for a profile with one"),
        ({"arc_length": [0, 7e6], "curvature": [0, 0]}, "must be in units of a and end between"),
    ],
)
def test_bad_profile_is_named(arguments, message):
    """A ValueError names what is wrong with the user's arrays, the gap included."""
    with pytest.raises(ValueError, match=message):
        profile(**arguments)


def test_the_axis_is_found():
    """An ellipse that starts off its axes: the ring begins at the nearer end of one of them."""
    exact = ellipse(0.6)
    s = around(exact, 4001)
    points = exact.position(s[:-1])[:, 1:]
    for ring in (
        profile(s, exact.curvature(s + 0.3)),
        profile(points=np.roll(points, 700, axis=0)),
    ):
        assert ring.symmetry == "D2"
        assert_allclose(ring.angle(around(ring)), exact.angle(around(exact)), atol=1e-5)


def test_what_has_no_axis_is_refused():
    """With its distance from the mirror image: of waves in 2 t and 3 t without a common axis.

    About the second axis, one of those of the larger wave, the smaller wave and its image differ by
    4 cos(0.8) cos(3 t) of a radius of 100. The best axis, in mean squares, is turned a little.
    """
    t = 2 * np.pi * np.arange(400) / 400
    r = 100 + 10 * np.cos(2 * t) + 2 * np.cos(3 * t + 0.8)
    points = np.column_stack([r * np.cos(t), r * np.sin(t)])
    with pytest.raises(ValueError, match=r"points must be mirror symmetric .* distance of") as no:
        profile(points=points)
    told = float(str(no.value).split("a distance of ")[1].split()[0])
    assert 0.7 < told / (4 * math.cos(0.8)) < 1.3


@pytest.mark.parametrize(
    ("record", "message"),
    [
        ({}, "shape must be one of circle, .*, got None"),
        ({"shape": "oval"}, "shape must be one of circle, .*, got 'oval'"),
        ({"shape": "ellipse", "b_over_a": 0.5}, r"must have entries \['b_over_a', 'twist_axis'\]"),
        ({"shape": "circle", "natural_curvature": 1, "twist_axis": "y"}, "must be 'x', got 'y'"),
        ({"shape": "triangle", "vertex_angle": 180, "r_over_a": 0.1}, r"in \(0, 180\) degrees"),
    ],
)
def test_bad_record_is_named(record, message):
    """A record that is not a ring is refused by the name of the entry."""
    with pytest.raises(ValueError, match=message):
        ring_from_json(record)


def test_statement_imports_neither_scipy_nor_numba():
    """The statement holds no kernels; scipy is loaded by the shape that needs it."""
    code = "import sys, der.geometry.shapes; print({'scipy', 'numba'} & set(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "set()"
