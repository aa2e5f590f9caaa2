"""The few lines that a user reads first."""

import math

import pytest

from der.geometry.scale import Scale
from der.records.path import AtPi, Mode, Path, Point, Timing, counts
from der.records.text import summary


def path(**changes):
    entries = {
        "solver": "der",
        "ring": {"shape": "ellipse", "b_over_a": 0.85, "twist_axis": "y"},
        "section": {"alpha": 0.75, "beta": 12.0, "h_over_t": 4.0, "nu": 0.3},
        "numerics": {"n_edges": 64},
        "gamma": [0.0, 2.5, math.pi],
        "moment": [0.0, 1.5, 0.0],
        "energy": [0.0, 7.0, 9.5],
        "index": counts([0, None, 1]),
        "index_moment": counts([0, None, 2]),
        "points": (Point("fold", 2.5, 1.5, 7.0, 0, 1, 1, {"symmetry": "even"}),),
        "at_pi": AtPi(0.0, -0.5, 9.5, 1, 2, None),
        "mode": Mode(foldable=True, stable=False, snapping="snap-back", stable_3d=False),
        "error": None,
        "timing": Timing(0.25, 31, 12),
    }
    return Path(**(entries | changes))


def lines(**changes):
    return summary(path(**changes)).splitlines()


def test_headline_has_ring_section_and_mesh():
    """Enough to know which run it was."""
    expected = "ellipse (b/a 0.85) about y, h/t 4, nu 0.3 (alpha 0.75, beta 12), 64 edges"
    assert lines()[0] == expected


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"alpha": 0.75, "beta": 12.0, "h_over_t": None, "nu": None}, "alpha 0.75, beta 12"),
        ({"alpha": 0.75, "beta": 12.0}, "alpha 0.75, beta 12"),
        ({"alpha": 0.75, "beta": 12.0, "h_over_t": 4.0, "nu": None}, "h/t 4 (alpha 0.75, beta 12)"),
    ],
)
def test_headline_says_what_is_known_of_the_section(section, words):
    """Not every section is a rectangle of known material."""
    assert lines(section=section)[0] == f"ellipse (b/a 0.85) about y, {words}, 64 edges"


def test_headline_of_a_profile():
    """A ring without a number of its own has no empty brackets."""
    ring = {"shape": "profile", "arc_length": [0.0, 1.0], "curvature": [1.0, 1.0]}
    assert lines(ring=ring)[0].startswith("profile, h/t 4")


def test_headline_of_a_solution_without_edges():
    """The boundary-value solver has none."""
    assert lines(solver="bvp", numerics={})[0].endswith("beta 12)")


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        (
            Mode(True, True, "none", True, True),
            "foldable, no snap, stays folded when released: yes, stable at pi at fixed moment",
        ),
        (
            Mode(True, True, "snap-through", True, False),
            "snap-through, stays folded when released: no, stable at pi at fixed moment",
        ),
        (
            Mode(True, False, "snap-back", None),
            "snap-back, stays folded when released: unknown, unstable at pi at fixed moment",
        ),
        (
            Mode(True, True, "snap-back", False, False),
            "unstable at pi at fixed moment, although dM/dgamma > 0",
        ),
        (Mode(False, None, "none", True), "not foldable, no snap, stable at pi at fixed moment"),
        (Mode(False, None, "snap-through", None), "not foldable, snap-through"),
    ],
)
def test_mode_in_words(mode, words):
    """Stable is said with what is held; a released ring of which nothing is known is unknown."""
    assert lines(mode=mode)[1].endswith(words)


def test_a_point_is_a_row():
    """Kind, gamma, gamma/pi, M, U, index on both sides, details."""
    row = next(line for line in lines() if line.startswith("fold "))
    expected = ["fold", "2.50000000", "0.795775", "1.5000000", "7.0000000", "0", "->", "1",
                "symmetry", "even"]  # fmt: skip
    assert row.split() == expected


def test_columns_stand_under_their_heads():
    """Numbers end where their heads end."""
    head, row = next((a, b) for a, b in zip(lines(), lines()[1:], strict=False) if "gamma/pi" in a)
    for name, number in (("gamma ", "2.50000000 "), ("U a/GJ ", "7.0000000 ")):
        assert head.index(name) + len(name) == row.index(number) + len(number)


def test_an_unknown_index_is_a_question_mark():
    """Not 0 and not None."""
    row = lines(points=(Point("limit", 2.5, 1.5, 7.0, None, None, 1),))[4]
    assert row.endswith("7.0000000  ?")


def test_a_path_without_points_has_no_table():
    """Nothing under a heading would be noise."""
    assert "gamma/pi" not in summary(path(points=()))


def test_state_at_pi():
    """Moment, slope, energy and the three indices."""
    expected = (
        "at pi: M = 0, dM/dgamma = -0.5, U = 9.5; index 1, moment held 2, grips removed unknown"
    )
    assert expected in lines()


def test_a_path_that_ends_early_says_where():
    """Before pi there is no mode."""
    words = lines(at_pi=None, mode=None, gamma=[0.0, 1.0, 2.0], points=())
    assert words[1] == "ends at gamma = 2, before pi"


@pytest.mark.parametrize("status", ["not converged", "interrupted"])
def test_an_unfinished_path_says_so(status):
    """With the reason; also where a mode is known already."""
    assert f"{status}: it broke off" in lines(status=status, message="it broke off")


@pytest.mark.parametrize("status", ["done", "interrupted"])
def test_a_path_without_a_state_has_a_summary(status):
    """Stopped before the first state."""
    nothing = {name: [] for name in ("gamma", "moment", "energy")}
    nothing |= {name: counts([]) for name in ("index", "index_moment")}
    words = lines(**nothing, points=(), at_pi=None, mode=None, status=status)
    assert words[-1].startswith("0 states")


def test_the_last_line_is_the_cost():
    """States, steps, iterations, time."""
    assert lines()[-1] == "3 states, 12 steps, 31 Newton iterations, 250 ms"


def test_a_record_from_disk_has_the_same_summary():
    """Numbers that were whole, and masks, come back as they were."""
    assert summary(Path.from_json(path().to_json())) == summary(path())


def test_a_snap_says_what_it_releases_and_where_it_began():
    """Under a dead moment gamma moves far; with the angle held there is nothing to add."""
    for start, end in ((0.5, "releases 2 GJ/a, from gamma = 0.5"), (2.5, "releases 2 GJ/a")):
        details = {"energy_released": 2.0, "gamma_fold": start}
        rows = lines(points=(Point("snap", 2.5, 1.5, 7.0, 0, 0, 1, details),))
        assert any(row.endswith(end) for row in rows)


def test_a_snap_with_units_says_them_and_shows_no_rounding():
    """It ends without load: moment and energy there are digits of rounding."""
    details = {"energy_released": 2.0, "gamma_fold": 2.5}
    snap = Point("snap", 0.0, 3e-14, 9e-28, 0, 0, 1, details)
    words = lines(points=(snap,), scale=Scale(0.1, 0.004, "N,mm"))
    assert [row.split()[3:5] for row in words if row.startswith("snap")] == [["0", "0"]]
    assert any("releases 80 N mm, from gamma = 2.5" in row for row in words)


def test_a_moment_below_the_tolerance_is_zero():
    """Its digits are rounding."""
    words = lines(at_pi=AtPi(-1.9e-15, -0.5, 9.5, 1, 2, None), numerics={"tolerance": 1e-10})
    assert any(line.startswith("at pi: M = 0, ") for line in words)
    words = lines(at_pi=AtPi(-1.9e-5, -0.5, 9.5, 1, 2, None), numerics={"tolerance": 1e-10})
    assert any(line.startswith("at pi: M = -1.9e-05, ") for line in words)
