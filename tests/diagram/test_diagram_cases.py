"""Cases and families of phase diagrams: what is solved, how it is named, and where it lies."""

import json
import math
from dataclasses import replace

import pytest

from der.diagram.cases import LABELS, Case, Row, solve_case
from der.diagram.families import FAMILIES, family

CIRCLE = Case("circle", 2.0, natural_curvature=1.0)
ONE_OF_EACH = [
    CIRCLE,
    Case("ellipse", 3.0, "y", b_over_a=0.7),
    Case("rectangle", 3.0, b_over_a=0.7, r_over_a=0.2),
    Case("triangle", 3.0, vertex_angle=60.0, r_over_a=0.2),
]


# --- Cases -----------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ONE_OF_EACH, ids=lambda case: case.shape)
def test_case_comes_back_from_json(case):
    """Equal, with the same hash and key."""
    again = Case(**json.loads(json.dumps(case.to_json())))
    assert (again, hash(again), again.key) == (case, hash(case), case.key)


def test_key_tells_cases_apart():
    """Every parameter, and the tolerance, is part of it."""
    others = [
        replace(CIRCLE, h_over_t=2.0000001),
        replace(CIRCLE, natural_curvature=0.9),
        replace(CIRCLE, nu=0.2),
        replace(CIRCLE, tolerance=1e-7),
        Case("ellipse", 2.0, b_over_a=1.0),
        Case("ellipse", 2.0, "y", b_over_a=1.0),
    ]
    assert len({case.key for case in [CIRCLE, *others]}) == 7


def test_key_depends_on_the_version(monkeypatch):
    """What another version of this package has found is solved again."""
    before = CIRCLE.key
    monkeypatch.setattr("der.diagram.cases._version", lambda: "0.0.0")
    assert before != replace(CIRCLE).key  # each case computes it once


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"shape": "square"}, "shape must be one of circle, .*, got 'square'"),
        ({"shape": "ellipse"}, "b_over_a must be given for shape 'ellipse', got None"),
        (
            {"shape": "circle", "natural_curvature": 1.0, "r_over_a": 0.1},
            "r_over_a must be left out for shape 'circle', got 0.1",
        ),
    ],
)
def test_parameters_of_another_shape_are_refused(wrong, message):
    """So that a key cannot name a ring that is not the one solved."""
    with pytest.raises(ValueError, match=message):
        Case(h_over_t=1.0, **wrong)


@pytest.mark.parametrize(
    ("threshold", "below", "above"),
    [
        (1.5076, "unfoldable", "unstable at fixed moment, snap-back"),
        (1.8396, "unstable at fixed moment, snap-back", "unstable at fixed moment, snap-through"),
        (
            3.4699,
            "unstable at fixed moment, snap-through",
            "stays folded when released, snap-through",
        ),
    ],
)
def test_labels_of_circles_change_at_known_thresholds(threshold, below, above):
    """1.5076, 1.8396, 3.4699, from the boundary-value problem by AUTO-07p, to their last digit.

    As a circle, an ellipse with b = a, a square with r = b, and a triangle's inscribed circle.
    """
    rings = [
        {"shape": "circle", "natural_curvature": 1.0},
        {"shape": "ellipse", "b_over_a": 1.0},
        {"shape": "rectangle", "b_over_a": 1.0, "r_over_a": 1.0},
        {"shape": "triangle", "vertex_angle": 60.0, "r_over_a": math.tan(math.pi / 6) / 2},
    ]
    for ring in rings:
        labels = [solve_case(Case(h_over_t=threshold + d, **ring)).label for d in (-1e-4, 1e-4)]
        assert labels == [below, above]


def test_a_ring_that_is_stable_at_fixed_moment_and_opens_has_a_label_of_its_own():
    """Ellipse 0.6 about x: released, it stays folded from h/t = 3.636062 on (truth_next.md)."""
    rows = [solve_case(Case("ellipse", h, b_over_a=0.6)) for h in (2.1, 3.0, 3.63606, 3.63607)]
    assert [row.label for row in rows] == [LABELS[1], LABELS[3], LABELS[3], LABELS[5]]
    assert [row.stable for row in rows] == [False, True, True, True]
    assert [row.stays_folded for row in rows] == [False, False, False, True]


def test_a_ring_that_opens_by_turning_its_grips_alone_has_no_label_between():
    """Rectangle 0.6, 0.3: unstable up to h/t = 3.283444 at fixed moment and when released."""
    case = Case("rectangle", 1.0, b_over_a=0.6, r_over_a=0.3)
    rows = [solve_case(replace(case, h_over_t=h)) for h in (3.28344, 3.28345)]
    assert [row.label for row in rows] == [LABELS[1], LABELS[5]]


def test_a_row_with_labels_of_another_version_is_not_read():
    """So that its case is solved again."""
    entries = solve_case(CIRCLE).to_json() | {"label": "stable, snap-through"}
    with pytest.raises(ValueError, match="not a row: label is 'stable, snap-through'"):
        Row.from_json(entries)


def test_row_holds_what_is_known_of_the_path():
    """h/t = 1.6: two folds, no moment at pi, and a slope there below zero."""
    row = solve_case(replace(CIRCLE, h_over_t=1.6))
    assert (row.label, row.status, row.message) == ("unstable at fixed moment, snap-back", "ok", "")
    assert (row.foldable, row.stable, row.snapping) == (True, False, "snap-back")
    assert row.moment == pytest.approx(0.0, abs=1e-9)
    assert row.slope == pytest.approx(-1.29367163, abs=1e-5)
    assert len(row.folds) == 2
    assert 0.0 < row.error <= 1e-6
    assert row.seconds > 0.0


@pytest.mark.parametrize("case", [CIRCLE, replace(CIRCLE, h_over_t=-1.0)])
def test_row_comes_back_from_json(case):
    """Bit for bit, whether solved or failed."""
    row = solve_case(case)
    assert Row.from_json(json.loads(json.dumps(row.to_json()))) == row


def test_case_that_cannot_be_stated_is_a_row():
    """With the reason, which names the parameter."""
    row = solve_case(Case("rectangle", 2.0, b_over_a=0.4, r_over_a=0.5))
    assert (row.status, row.label, row.moment) == ("failed", "failed", None)
    assert row.message.startswith("ValueError: r_over_a must be a number in (0, 0.4]")


def test_case_that_cannot_be_solved_is_a_row():
    """A value that no ring has: said in the row, not raised."""
    row = solve_case(replace(CIRCLE, h_over_t=-1.0))
    assert row.status == "failed"
    assert row.message


# --- Families --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FAMILIES)
def test_cases_of_a_family_can_be_stated_and_found_again(name):
    """At corners, on sides and inside; unit coordinates come back."""
    of = FAMILIES[name]
    for sheet in of.sheets:
        for u in (0.0, 0.3, 1.0):
            for v in (0.0, 0.7, 1.0):
                unit = (u, v, 0.4)[: of.dimension]
                case = of.case(sheet, unit)
                case.scene()
                assert of.unit(case) == pytest.approx(unit, abs=1e-9)


@pytest.mark.parametrize("name", FAMILIES)
def test_marked_cases_lie_in_their_diagram(name):
    """Every one, and there is at least one."""
    assert FAMILIES[name].marks
    assert all(FAMILIES[name].unit(case) is not None for case in FAMILIES[name].marks)


def test_axes_are_joined_where_they_are_the_same():
    """A ring with b = a is one case, whichever axis it is looked at from."""
    for name in ("fig3a", "fig5b"):
        x, y = (FAMILIES[name].case(axis, (1.0, 0.5)) for axis in "xy")
        assert x == y
        assert FAMILIES[name].case("y", (0.5, 0.5)).twist_axis == "y"


def test_fillets_reach_from_side_to_side_of_the_prism():
    """From 0.1 a to b; from 0.033 a to the inscribed circle."""
    case = FAMILIES["fig5a"].case("x", (0.25, 1.0, 0.0))
    assert (case.b_over_a, case.r_over_a) == (0.4, 0.4)
    assert FAMILIES["fig5a"].case("x", (0.25, 0.0, 0.0)).r_over_a == 0.1
    for part, angle in ((0.0, 30.0), (1.0, 120.0)):
        case = FAMILIES["fig8a"].case("x", (part, 1.0, 0.0))
        inscribed = math.tan(math.radians(45 - angle / 4)) / 2
        assert (case.vertex_angle, case.r_over_a) == (angle, pytest.approx(inscribed, abs=1e-12))


def test_finer_lattices_have_the_cases_of_coarser_ones():
    """To the last bit, so that a finer scan goes on with the cases of a coarser one."""
    coarse, fine = family("fig5a", finest=8), family("fig5a", finest=64)
    for i in range(9):
        unit = (i / 8, 1 - i / 8, i / 8)
        assert coarse.case("y", unit) == fine.case("y", [8 * round(8 * u) / 64 for u in unit])


def test_options_reach_the_cases():
    """nu, and ranges in place of the paper's."""
    of = family("fig3a", nu=0.2, ranges={"h_over_t": (2.0, 3.0)})
    case = of.case("y", (0.0, 1.0))
    assert (case.b_over_a, case.h_over_t, case.nu) == (0.5, 3.0, 0.2)
    assert {mark.nu for mark in of.marks} == {0.2}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "fig4"}, "name must be one of fig3a, .*, got 'fig4'"),
        ({"nu": 0.6}, "nu must be a number in"),
        ({"finest": 3}, "finest must be a power of two from 2 to 1024, got 3"),
        ({"ranges": {"r_over_a": (0.1, 0.2)}}, "ranges of fig3a must be of b_over_a, h_over_t"),
        ({"ranges": {"h_over_t": (2.0, 1.0)}}, "h_over_t must have a first value below its last"),
        ({"ranges": {"h_over_t": (0.0, 1.0)}}, "h_over_t must be"),
        ({"ranges": {"b_over_a": (0.5, 1.5)}}, "b_over_a must be"),
        (
            {"name": "fig5a", "ranges": {"r_over_a": (0.3, 1.0)}},
            "r_over_a must begin below the widest fillet of all rings, got 0.3",
        ),
    ],
)
def test_what_is_not_allowed_is_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        family(**{"name": "fig3a"} | options)


def test_labels_are_those_of_the_paper_with_the_released_ring():
    """Un-foldable, and unstable or stable at fixed moment or released, with either snap."""
    assert len(LABELS) == 7
