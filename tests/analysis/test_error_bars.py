"""Error bars: what is returned, in which order, and what is said where a mesh has no state."""

import dataclasses
import functools
import math

import numpy as np
import pytest

import der
import der.records.path
from der.analysis.error_bars import ErrorBars, error_bars
from der.analysis.extrapolation import curve, located
from der.analysis.extrapolation.curve import GAMMA, Family, Goal, Matched, _found, placed
from der.analysis.request import Request
from der.continuation.richardson import limit, romberg
from der.problem import Point
from der.records.text.path import lines
from der.rod.equilibrium import Equilibrium
from der.rod.gripped_ring import GrippedRing, gripped_ring
from der.scene import meshes

EIGHTHS = tuple(k * math.pi / 8.0 for k in range(17))
FINITE = 12.0 * der.rectangular_section(4.0).alpha * 200.0**2  # EA of a_over_t = 200


@functools.cache
def solved(
    h_over_t: float, n_edges: int, name: str = "quarter", stretching: float = 0.0, **wants: object
) -> tuple[list[GrippedRing], list[Point[Equilibrium]], ErrorBars]:
    """Meshes, points and error bars of a circle, by default of nothing but its path."""
    section = der.rectangular_section(h_over_t)
    rings = [
        gripped_ring(der.circle(), section, n, name=name, stretching=stretching)
        for n in meshes(n_edges, name)
    ]
    request = Request(**{"stability": False, "self_crossings": False, **wants})
    points = list(request.follow(rings[0]))
    return rings, points, error_bars(rings, request, points)


def asking(*targets: float) -> Request:
    return Request(targets=targets, stability=False, self_crossings=False)


def kinds(bars: ErrorBars) -> list[str]:
    return [point.kind for point in bars.points]


def order(points: list[Point[Equilibrium]], bars: ErrorBars) -> list[int]:
    """Positions of the points that are kept, in path order."""
    position = {id(point.solution): k for k, point in enumerate(points)}
    return [position[id(point.solution)] for point in bars.points]


def is_asked(point: Point[Equilibrium]) -> bool:
    return point.kind == "" and point.solution.parameter in EIGHTHS


# --- the extrapolation ------------------------------------------------------------------------


def test_romberg_takes_out_second_and_fourth_order():
    """1 + 2 h^2 + 3 h^4 at h, 2h, 4h becomes (4 f(h) - f(2h))/3 = 1 - 12 h^4, and then 1.

    By hand. Tolerance: rounding.
    """
    h = np.array([0.1, 0.2, 0.4])
    plain, once, twice = romberg(1.0 + 2.0 * h**2 + 3.0 * h**4)
    assert [plain, once, twice] == pytest.approx([1.0203, 1.0 - 12.0e-4, 1.0], abs=1e-15)


def test_error_holds_what_is_left_of_a_geometric_series():
    """Coefficients of h^2, h^4, h^6 in a ratio of 1/20; and others whose last correction vanishes.

    By hand: 64 times the last coefficient is left, 1.6e-4 and 1.28e-4.
    """
    h2 = np.array([1.0, 4.0, 16.0])
    one = 1.0 + 1e-3 * h2 + 5e-5 * h2**2 + 2.5e-6 * h2**3
    other = 1.0 + 2e-3 * h2 - 4.2e-5 * h2**2 + 2e-6 * h2**3
    (values,), (errors,) = limit(np.column_stack([one, other])[:, None])
    assert values - 1.0 == pytest.approx([1.6e-4, 1.28e-4], abs=1e-15)
    assert np.ptp(romberg(other)[1:]) < 1e-15
    assert np.all(errors > values - 1.0)
    assert np.all(errors < 2e-3)


def test_the_error_of_a_state_is_that_of_the_least_resolved_beside_it():
    """A last correction that vanishes at a state, and not beside it; r is that of both.

    By hand: coefficients a of h^2 and b of h^4, first -a - 5 b, last 4 b.
    """
    h2 = np.array([1.0, 4.0, 16.0])[:, None]
    a, b = np.array([1e-1, 1e-1, 1e-3, 1e-3]), np.array([0.0, 0.0, 0.0, 1e-5])
    _, errors = limit((1.0 + a * h2 + b * h2**2)[:, :, None])
    last, r = 4e-5, 4e-5 / (1e-3 + 5e-5)
    assert errors[3, 0] == pytest.approx((1.0 + 4.0 * r) * last, rel=1e-8)
    assert errors[2, 0] == pytest.approx((1.0 + 4.0 * 4e-4) * last, rel=1e-3)  # beside 0.1
    _, errors = limit((1.0 + a * h2 + b * h2**2)[:, :, None], even=False)
    assert errors.min() == errors.max() > 1.8 * last


@pytest.mark.parametrize("column", ["gamma", "moment", "energy"])
def test_last_correction_falls_with_the_fourth_power_of_the_cell(column):
    """Matched states have an error series in even powers of h: errors of a limit fall 16-fold.

    A limit's error contains the corrections of gamma, M, U and of their rates. Measured 17 to 21
    from 128 to 256 edges; without the grips' part of the normal it is 2 to 8.
    """
    largest = []
    for n in (128, 256):
        _, _, bars = solved(4.0, n)
        k = kinds(bars).index("limit")
        largest.append(bars.error[column][k])
    assert 14.0 < largest[0] / largest[1] < 24.0


@pytest.mark.parametrize("place", [5, 15, 25])
def test_rates_are_derivatives_along_the_path(place):
    """d(gamma, M, U)/ds on the finest mesh, U by dU = 4 M dgamma, against central differences.

    Differences of 1e-4 err by their square, 1e-8 times third derivatives of up to 100.
    """
    rings, points, _ = solved(4.0, 64)
    family, base = Family(tuple(rings), 1e-12), points[place].solution
    here, behind, ahead = family.matched(base), family.near(base, -1e-4), family.near(base, 1e-4)
    differences = (ahead.table[0, :3] - behind.table[0, :3]) / 2e-4
    assert here.table[0, 3:] == pytest.approx(differences, abs=1e-6)


@pytest.mark.parametrize("name", ["half", "full"])
def test_sectors_agree(name):
    """The same ring on another sector has the same extrapolated states, folds included.

    Different unknowns, same discrete rod: to the accuracy of the root finding, 1e-9.
    """
    _, _, quarter = solved(1.6, 64)
    _, _, other = solved(1.6, 64, name)
    for name in ("gamma", "moment"):
        assert other.values[name] == pytest.approx(quarter.values[name], abs=1e-8)


def test_extensible_ring_has_error_bars():
    """A ring of finite EA extrapolates to the inextensible one within a_over_t^-2 = 2.5e-5.

    Its raw slope at pi on 64 edges is off by 5e-3.
    """
    _, _, bars = solved(4.0, 64, "quarter", FINITE)
    assert bars.slope == pytest.approx(0.0814673, abs=2.5e-5)


# --- what is returned -------------------------------------------------------------------------


def test_gamma_that_was_asked_for_stays_to_the_last_digit():
    """At multiples of pi/8, pi among them, gamma is what was asked, and its error is 0."""
    _, _, bars = solved(4.0, 128)
    at = [i for i, point in enumerate(bars.points) if is_asked(point)]
    assert bars.values["gamma"][at].tolist() == list(EIGHTHS[:9])
    assert {bars.error["gamma"][i] for i in at} == {0.0}


def test_state_that_was_not_asked_for_lies_in_place():
    """Without anything asked for, gamma moves: the raw gamma of 64 edges is off by up to 4e-3."""
    rings, points, _ = solved(4.0, 64)
    bars = error_bars(rings, asking(), points)
    assert 1e-3 < np.abs(bars.values["gamma"] - bars.raw["gamma"]).max() < 2e-2


def test_raw_values_are_those_of_the_visits():
    """``raw`` is the path on N edges, state by state, energies of the full ring."""
    _, _, bars = solved(1.6, 64)
    assert bars.raw["energy"] == [4.0 * point.solution.energy for point in bars.points]
    assert len(bars.raw["moment"]) == len(bars.raw["gamma"]) == len(bars.points)


@pytest.mark.parametrize("n_edges", [32, 48, 64, 128])
def test_order_of_the_path_is_kept(n_edges):
    """Gamma grows, falls and grows again between the two folds at h/t = 1.6, on every mesh.

    On 32 edges folds and limits move past four states that nobody asked for: those are left out.
    """
    _, _, bars = solved(1.6, n_edges)
    first, second = (i for i, kind in enumerate(kinds(bars)) if kind == "fold")
    gamma = bars.values["gamma"]
    up, down, again = gamma[: first + 1], gamma[first : second + 1], gamma[second:]
    assert np.all(np.diff(up) > 0.0)
    assert np.all(np.diff(down) < 0.0)
    assert np.all(np.diff(again) > 0.0)


def test_only_states_that_nobody_asked_for_are_left_out():
    """On 32 edges at h/t = 1.6 states are overtaken; all asked ones and special points are kept."""
    _, points, bars = solved(1.6, 32)
    kept = order(points, bars)
    missing = [point for k, point in enumerate(points) if k not in kept]
    assert missing
    assert not any(point.kind or is_asked(point) for point in missing)


def test_moment_is_stationary_at_a_limit():
    """The record's limit is the summit of the extrapolated curve: its neighbours lie below."""
    _, _, bars = solved(4.0, 128)
    k, moment = kinds(bars).index("limit"), bars.values["moment"]
    assert moment[k] > max(moment[k - 1], moment[k + 1])


# --- what is not known ------------------------------------------------------------------------


def test_state_that_a_mesh_lacks_is_null_and_said_so():
    """8 edges have no counterpart to the last states of h/t = 0.7: null, and values of N edges."""
    _, _, bars = solved(0.7, 32, gamma_max=5.0)
    lost = [i for i, error in enumerate(bars.error["moment"]) if error is None]
    assert lost
    raw = [bars.points[i].solution.parameter for i in lost]
    assert bars.values["gamma"][lost].tolist() == raw
    assert f"null at {len(lost)} of {len(bars.points)} states" in bars.error["how"]


def test_path_that_the_coarsest_mesh_does_not_follow_has_no_errors():
    """8 edges have no counterpart to the far loop of h/t = 1, and their path ends: all is null."""
    _, points, bars = solved(1.0, 32, gamma_max=math.inf, until_folded=True)
    assert list(bars.points) == points
    assert bars.values["moment"].tolist() == bars.raw["moment"]
    assert set(bars.error["moment"]) == {None}
    assert "on 8 edges the path cannot be followed to an end" in bars.error["how"]


def test_gamma_beyond_the_fold_of_the_extrapolated_curve_has_no_state():
    """A gamma between the fold of 64 edges and that of the extrapolated curve is left out.

    At h/t = 1.6 the second fold lies at 2.61197 on 64 edges and at 2.61372 extrapolated.
    """
    rings, _, _ = solved(1.6, 64)
    request = asking(2.6130)
    points = list(request.follow(rings[0]))
    family = Family(tuple(rings), request.tolerance)
    near = [
        point
        for point in points
        if point.solution.parameter == 2.6130
        and 1.0 < rings[0].arm_moment(point.solution.moment) < 1.2
    ]
    assert list(placed(family, near, (2.6130,))) == [None, None]
    kept = {id(point.solution) for point in error_bars(rings, request, points).points}
    assert kept.isdisjoint(id(point.solution) for point in near)


def test_states_without_values_stay_among_their_neighbours():
    """Two states right before and after a fold of 64 edges stay before and after it.

    The extrapolated fold at h/t = 1.6 lies 5e-3 further, too far for Newton's method from a state
    where gamma hardly changes, so that they have no errors.
    """
    rings, points, _ = solved(1.6, 64)
    fold = next(point.solution.parameter for point in points if point.kind == "fold")
    asked = fold - 1e-7
    request = asking(asked)
    points = list(request.follow(rings[0]))
    special = [
        k
        for k in order(points, error_bars(rings, request, points))
        if points[k].kind == "fold" or points[k].solution.parameter == asked
    ]
    assert special == sorted(special)
    assert [points[k].kind for k in special[:3]] == ["", "fold", ""]


def test_gamma_is_not_sought_round_a_fold():
    """A root on the other side of a fold, where gamma falls, is not the state that was asked for.

    By hand: three equal meshes with dgamma/ds = 1.
    """
    table = np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 0.0], (3, 1))
    here, bend = Matched(table, 0.0), np.zeros((3, 3))
    assert _found(Goal(GAMMA, 0.0, direction=1.0), 0.0, here, 1.0, bend) is not None
    assert _found(Goal(GAMMA, 0.0, direction=-1.0), 0.0, here, 1.0, bend) is None


def test_a_crossing_that_moves_fast_with_the_strands_has_its_error():
    """The second contact of a stiff strip on 64 edges, against that on 128, whose error is 2e-5.

    Where the rate of the strands was that of the middle of the step, Newton's method had not
    converged after 20 steps.
    """
    scene = der.Scene(der.circle(), der.section(0.7156528, 24.4156894), n_edges=64, error_bars=True)
    coarse, fine = der.fold(scene), der.fold(dataclasses.replace(scene, n_edges=128))
    found, better = coarse.contacts[1], fine.contacts[1]
    error, least = (p.error["gamma"][p.contacts[1].position] for p in (coarse, fine))
    assert least < 5e-5
    assert abs(found.gamma - better.gamma) < error < 2e-3


def test_a_self_crossing_without_an_error_says_why(monkeypatch):
    """A crossing of the polygon that is none of the smooth curve: errors null, and said so."""
    why = "because it was not found on every mesh"
    monkeypatch.setattr(located, "smooth_crossing", lambda *_, **__: None)
    path = der.fold(der.Scene(der.circle(), der.rectangular_section(4.0), error_bars=True))
    assert path.contacts
    for point in path.contacts:
        assert path.error["gamma"][point.position] is None
        assert point.details["no_error_bar"] == why
    none = len(path.contacts)
    assert f"null at {none} of" in path.error["how"]
    told = lines(path)
    assert sum(f"no error bar {why}" in line for line in told) == none
    assert any(f"none at {none} of" in line for line in told)


def test_a_fold_that_coarser_meshes_do_not_reach_says_why(monkeypatch):
    """Without matched states nothing is said of what coarser meshes have."""
    monkeypatch.setattr(curve, "restricted", lambda *_: None)
    points = solved(1.6, 64)[1]
    bars = error_bars(solved(1.6, 64)[0], asking(math.pi), points)
    folds = [point for point in bars.points if point.kind == "fold"]
    assert folds
    why = "because coarser meshes could not be compared"
    assert all(point.details["no_error_bar"] == why for point in folds)
    assert not any(point.details for point in bars.points if point.kind == "")


def test_how_names_the_meshes():
    """A reader of the record learns where the numbers come from."""
    assert "128, 64, 32 edges" in solved(4.0, 128)[2].error["how"]


def test_path_that_never_reached_pi_has_no_slope_there():
    """A path to gamma = 1 ends without a slope at pi."""
    _, _, bars = solved(4.0, 64, gamma_max=1.0)
    assert bars.slope is None
    assert bars.error["slope_at_pi"] is None


def test_error_fits_the_record():
    """A record takes the arrays, the errors and the raw values, and comes back from its JSON."""
    _, _, bars = solved(4.0, 128)
    path = der.fold(der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=128))
    none = der.records.path.counts([None] * len(bars.points))
    entries = {**bars.values, "error": bars.error, "raw": bars.raw}
    path = dataclasses.replace(path, index=none, index_moment=none, points=(), **entries)
    again = der.Path.from_json(path.to_json())
    assert again.error == bars.error
    assert again.raw == bars.raw


# --- meshes -----------------------------------------------------------------------------------


def test_meshes_are_halved_twice():
    """N, N/2, N/4 edges of the full ring."""
    assert meshes(48, "quarter") == (48, 24, 12)


@pytest.mark.parametrize(("n_edges", "name"), [(72, "quarter"), (16, "quarter"), (36, "half")])
def test_meshes_that_do_not_divide_are_refused(n_edges, name):
    """N/4 edges have to fit the sector, and be at least 8."""
    with pytest.raises(ValueError, match=f"n_edges must be .* got {n_edges}"):
        meshes(n_edges, name)


def test_a_state_that_passes_a_branch_point_has_no_index():
    """h/t = 1 beyond pi: a pair of odd modes at gamma = 5.42455 on 64 edges, 5.4273 on fine ones.

    Of the state asked for in between, 64 edges say index 1 and fine meshes 3: it is not known. Over
    every other stretch between folds and branch points the index stays.
    """
    wants = {"until": "folded", "self_crossings": False, "error_bars": True, "save_at": (5.425,)}
    path = der.fold(der.Scene(der.circle(), der.rectangular_section(1.0), **wants))
    singular = {p.position: p for p in path.points if p.kind in ("fold", "branch")}
    now, unknown = 0, []
    for k, index in enumerate(path.index):
        if k in singular:
            assert singular[k].index_before == now
            now = singular[k].index_after
        elif index is np.ma.masked:
            unknown.append(path.gamma[k])
        else:
            assert index == now
    assert unknown == [5.425]
