"""Error bars: what is returned, in which order, and what is said where a mesh has no state."""

import dataclasses
import functools
import math

import numpy as np
import pytest

import der
import der.records.path
from der.analysis.error_bars import ErrorBars, error_bars
from der.analysis.matching import GAMMA, Family, Goal, Matched, _found, romberg
from der.continuation.arclength import follow
from der.continuation.events import Visit, Wanted
from der.continuation.step import Tally
from der.rod.gripped_ring import Sector, sector
from der.scene import meshes

EIGHTHS = tuple(k * math.pi / 8.0 for k in range(17))
FINITE = 12.0 * der.rectangular_section(4.0).alpha * 200.0**2  # EA of a_over_t = 200


@functools.cache
def solved(
    h_over_t: float, n_edges: int, name: str = "quarter", stretching: float = 0.0, **wants: object
) -> tuple[list[Sector], list[Visit], ErrorBars]:
    """Sectors, visits and error bars of a circle, by default without stability and contacts."""
    section = der.rectangular_section(h_over_t)
    pieces = [
        sector(der.circle(), section, n, name=name, stretching=stretching)
        for n in meshes(n_edges, name)
    ]
    wanted = Wanted(**{"stability": False, "contacts": False, **wants})
    visits = list(follow(pieces[0], wanted, Tally()))
    return pieces, visits, error_bars(pieces, visits, EIGHTHS)


def kinds(visits: list[Visit], bars: ErrorBars) -> list[str]:
    return [visits[k].kind for k in bars.order]


def is_asked(visit: Visit) -> bool:
    return visit.kind == "" and visit.at.state.load in EIGHTHS


# --- the extrapolation ------------------------------------------------------------------------


def test_romberg_takes_out_second_and_fourth_order():
    """1 + 2 h^2 + 3 h^4 at h, 2h, 4h becomes (4 f(h) - f(2h))/3 = 1 - 12 h^4, and then 1.

    By hand. Tolerance: rounding.
    """
    h = np.array([0.1, 0.2, 0.4])
    plain, once, twice = romberg(1.0 + 2.0 * h**2 + 3.0 * h**4)
    assert [plain, once, twice] == pytest.approx([1.0203, 1.0 - 12.0e-4, 1.0], abs=1e-15)


@pytest.mark.parametrize("column", ["gamma", "moment", "energy"])
def test_last_correction_falls_with_the_fourth_power_of_the_cell(column):
    """Matched states have an error series in even powers of h: errors of a limit fall 16-fold.

    A limit's error contains the corrections of gamma, M, U and of their rates. Measured 17 to 21
    from 128 to 256 edges; without the grips' part of the normal it is 2 to 8.
    """
    largest = []
    for n in (128, 256):
        _, visits, bars = solved(4.0, n)
        k = kinds(visits, bars).index("limit")
        largest.append(getattr(bars, f"{column}_error")[k])
    assert 14.0 < largest[0] / largest[1] < 24.0


@pytest.mark.parametrize("place", [5, 15, 25])
def test_rates_are_derivatives_along_the_path(place):
    """d(gamma, M, U)/ds on the finest mesh, U by dU = 4 M dgamma, against central differences.

    Differences of 1e-4 err by their square, 1e-8 times third derivatives of up to 100.
    """
    pieces, visits, _ = solved(4.0, 64)
    family, base = Family(tuple(pieces), 1e-12), visits[place].at
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
    assert other.gamma == pytest.approx(quarter.gamma, abs=1e-8)
    assert other.moment == pytest.approx(quarter.moment, abs=1e-8)


def test_extensible_ring_has_error_bars():
    """A ring of finite EA extrapolates to the inextensible one within a_over_t^-2 = 2.5e-5.

    Its raw slope at pi on 64 edges is off by 5e-3.
    """
    _, _, bars = solved(4.0, 64, "quarter", FINITE)
    assert bars.slope == pytest.approx(0.0814673, abs=2.5e-5)


# --- what is returned -------------------------------------------------------------------------


def test_gamma_that_was_asked_for_stays_to_the_last_digit():
    """At multiples of pi/8, pi among them, gamma is what was asked, and its error is 0."""
    _, visits, bars = solved(4.0, 128)
    at = [i for i, k in enumerate(bars.order) if is_asked(visits[k])]
    assert bars.gamma[at].tolist() == list(EIGHTHS[:9])
    assert {bars.gamma_error[i] for i in at} == {0.0}


def test_state_that_was_not_asked_for_lies_in_place():
    """Without anything asked for, gamma moves: the raw gamma of 64 edges is off by up to 4e-3."""
    pieces, visits, _ = solved(4.0, 64)
    bars = error_bars(pieces, visits, ())
    assert 1e-3 < np.abs(bars.gamma - bars.raw["gamma"]).max() < 2e-2


def test_raw_values_are_those_of_the_visits():
    """``raw`` is the path on N edges, state by state, energies of the full ring."""
    _, visits, bars = solved(1.6, 64)
    expected = [4.0 * visits[k].at.energy for k in bars.order]
    assert bars.raw["energy"] == expected
    assert len(bars.raw["moment"]) == len(bars.raw["gamma"]) == len(bars.gamma)


@pytest.mark.parametrize("n_edges", [32, 48, 64, 128])
def test_order_of_the_path_is_kept(n_edges):
    """Gamma grows, falls and grows again between the two folds at h/t = 1.6, on every mesh.

    On 32 edges folds and limits move past four states that nobody asked for: those are left out.
    """
    _, visits, bars = solved(1.6, n_edges)
    first, second = (i for i, kind in enumerate(kinds(visits, bars)) if kind == "fold")
    up, down, again = bars.gamma[: first + 1], bars.gamma[first : second + 1], bars.gamma[second:]
    assert np.all(np.diff(up) > 0.0)
    assert np.all(np.diff(down) < 0.0)
    assert np.all(np.diff(again) > 0.0)


def test_only_states_that_nobody_asked_for_are_left_out():
    """On 32 edges at h/t = 1.6 states are overtaken; all asked ones and special points are kept."""
    _, visits, bars = solved(1.6, 32)
    missing = [visit for k, visit in enumerate(visits) if k not in bars.order]
    assert missing
    assert not any(visit.kind or is_asked(visit) for visit in missing)


def test_moment_is_stationary_at_a_limit():
    """The record's limit is the summit of the extrapolated curve: its neighbours lie below."""
    _, visits, bars = solved(4.0, 128)
    k = kinds(visits, bars).index("limit")
    assert bars.moment[k] > max(bars.moment[k - 1], bars.moment[k + 1])


# --- what is not known ------------------------------------------------------------------------


def test_state_that_a_mesh_lacks_is_null_and_said_so():
    """8 edges have no counterpart to the far loop of h/t = 1: null there, and values of N edges."""
    _, visits, bars = solved(1.0, 32, load_max=math.inf, until_folded=True)
    lost = [i for i, error in enumerate(bars.moment_error) if error is None]
    assert lost
    assert [bars.gamma[i] for i in lost] == [visits[bars.order[i]].at.state.load for i in lost]
    assert f"null at {len(lost)} of {len(bars.order)} states" in bars.how


def test_gamma_beyond_the_fold_of_the_extrapolated_curve_is_null():
    """A gamma between the fold of 64 edges and that of the extrapolated curve has no state there.

    At h/t = 1.6 the second fold lies at 2.61197 on 64 edges and at 2.61372 extrapolated.
    """
    pieces, _, _ = solved(1.6, 64)
    wanted = Wanted(targets=(2.6130,), stability=False, contacts=False)
    visits = list(follow(pieces[0], wanted, Tally()))
    bars = error_bars(pieces, visits, (0.0, 2.6130, math.pi))
    found = [i for i, k in enumerate(bars.order) if visits[k].at.state.load == 2.6130]
    near = [bars.moment_error[i] for i in found if 1.0 < bars.raw["moment"][i] < 1.2]
    assert near == [None, None]


def test_states_without_values_stay_among_their_neighbours():
    """Two states right before and after a fold of 64 edges stay before and after it.

    The extrapolated fold at h/t = 1.6 lies 5e-3 further, too far for Newton's method from a state
    where gamma hardly changes, so that they have no errors.
    """
    pieces, visits, _ = solved(1.6, 64)
    fold = next(visit.at.state.load for visit in visits if visit.kind == "fold")
    asked = fold - 1e-7
    wanted = Wanted(targets=(asked,), stability=False, contacts=False)
    visits = list(follow(pieces[0], wanted, Tally()))
    bars = error_bars(pieces, visits, (0.0, asked, math.pi))
    special = [
        k for k in bars.order if visits[k].kind == "fold" or visits[k].at.state.load == asked
    ]
    assert special == sorted(special)
    assert [visits[k].kind for k in special[:3]] == ["", "fold", ""]


def test_gamma_is_not_sought_round_a_fold():
    """A root on the other side of a fold, where gamma falls, is not the state that was asked for.

    By hand: three equal meshes with dgamma/ds = 1.
    """
    table = np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 0.0], (3, 1))
    here, bend = Matched(table, 0.0), np.zeros((3, 3))
    assert _found(Goal(GAMMA, 0.0, direction=1.0), 0.0, here, 1.0, bend) is not None
    assert _found(Goal(GAMMA, 0.0, direction=-1.0), 0.0, here, 1.0, bend) is None


def test_contact_points_have_no_errors():
    """They are placed on N edges only: values on the extrapolated curve, errors null."""
    _, visits, bars = solved(4.0, 64, contacts=True)
    at = kinds(visits, bars).index("contact")
    assert bars.gamma_error[at] is None
    assert "contact" in bars.how


def test_how_names_the_meshes():
    """A reader of the record learns where the numbers come from."""
    assert "128, 64, 32 edges" in solved(4.0, 128)[2].how


def test_path_that_never_reached_pi_has_no_slope_there():
    """A path to gamma = 1 ends without a slope at pi."""
    _, _, bars = solved(4.0, 64, load_max=1.0)
    assert bars.slope is None
    assert bars.slope_error is None


def test_path_without_states():
    """A path that was interrupted at once has empty error bars."""
    pieces, _, _ = solved(4.0, 64)
    assert error_bars(pieces, [], EIGHTHS).gamma.shape == (0,)


def test_error_fits_the_record():
    """A record takes the arrays, the errors and the raw values, and comes back from its JSON."""
    _, _, bars = solved(4.0, 128)
    path = der.fold(der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=128))
    none = der.records.path.counts([None] * len(bars.order))
    entries = {name: getattr(bars, name) for name in ("gamma", "moment", "energy", "error", "raw")}
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
