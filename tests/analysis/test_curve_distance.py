"""Reference curves are interpolated far better than what is measured against them."""

import math
from pathlib import Path

import numpy as np
import pytest

from der.analysis.curve_distance import ReferenceCurve, curve_error, fold_error, read_reference

TABLES = Path(__file__).parents[2] / "validation" / "reference"
ALPHA = 0.7715693320  # closed form, h/t = 4


def table(name):
    return read_reference(TABLES / f"{name}.csv")


def polynomial_path(gamma, moment, s):
    """Path with polynomials for gamma(s) and M(s), and the energy that is exactly its work."""
    energy = (4 * moment * gamma.deriv()).integ()
    return gamma(s), moment(s), energy(s)


def as_reference(arrays, folds=()):
    return ReferenceCurve(*arrays, others=np.empty((len(arrays[0]), 0)), folds=folds)


CROSSING = (-1.271679, 1.171679)


def looped(s):
    """Path with two folds that crosses itself in (gamma, M), where s^2 + 0.1 s = 1.49."""
    gamma = np.polynomial.Polynomial([1.5, -0.75, 0.0, 0.5])
    moment = np.polynomial.Polynomial([0.5, 0.1, 1.0])
    return polynomial_path(gamma, moment, s)


# --- reading --------------------------------------------------------------------------------


def test_energy_of_a_quarter_is_read_as_that_of_the_full_ring():
    """The folded circle has U = 4 pi alpha; a quarter of it has 11 digits here."""
    assert table("circ_ht4").energy[-1] == pytest.approx(4 * np.pi * ALPHA, rel=1e-9)


def test_energy_of_a_half_is_doubled(tmp_path):
    """The triangles' tables hold the energy of the half ring."""
    text = (TABLES / "circ_ht4.csv").read_text()
    (tmp_path / "half.csv").write_text(text.replace("quarter model", "half model"))
    half = read_reference(tmp_path / "half.csv")
    np.testing.assert_allclose(half.energy, table("circ_ht4").energy / 2, rtol=1e-15)


def test_folds_are_the_rows_of_type_lp():
    """The folds at h/t = 1.6, from a second continuation."""
    assert table("circ_ht1.6").folds == (2.7719967717, 2.6137181793)


def test_moment_is_of_one_arm():
    """Closed form: dM/dgamma(0) = 4.708129 at h/t = 4; a chord of 0.0056 rad, curved by 1e-4."""
    reference = table("circ_ht4")
    assert reference.moment[1] / reference.gamma[1] == pytest.approx(4.708129, rel=2e-4)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("quarter model", "model", "header"),
        ("idx,type,gamma,M,U", "idx,type,M,gamma,U", "columns"),
        ("5.6320750700e-03", "five", "five"),
        ("5.6320750700e-03", "nan", "finite"),
        (",3.0000000000e+00,3.3333333333e-01,3.3333333333e-01", "", "numbers"),
    ],
)
def test_broken_table_is_refused_by_name(tmp_path, old, new, said):
    text = (TABLES / "circ_ht4.csv").read_text()
    assert old in text
    (tmp_path / "broken.csv").write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=rf"broken\.csv.*{said}"):
        read_reference(tmp_path / "broken.csv")


def test_empty_table_is_refused_by_name(tmp_path):
    (tmp_path / "empty.csv").write_text("# quarter model\n")
    with pytest.raises(ValueError, match=r"empty\.csv"):
        read_reference(tmp_path / "empty.csv")


def test_energy_of_a_part_of_the_ring_is_refused():
    """The balance dU = 4 M dgamma holds for the full ring alone: a quarter is found out."""
    good = table("circ_ht4")
    bad = ReferenceCurve(good.gamma, good.moment, good.energy / 4, good.others)
    with pytest.raises(ValueError, match="full ring"):
        curve_error(good.gamma, good.moment, good.energy / 4, bad)


@pytest.mark.parametrize("n", [0, 7])
def test_too_short_a_reference_is_refused(n):
    s = np.linspace(0.0, 1.0, n)
    with pytest.raises(ValueError, match="points"):
        as_reference((s, s, 2 * s**2))


# --- interpolation --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "measured"),
    [
        ("circ_ht4", (2.2e-9, 4.4e-11)),
        ("circ_ht1.6", (3.3e-6, 5.0e-8)),
        ("circ_ht1_beyond_pi", (1.1e-8, 3.7e-10)),
    ],
)
def test_every_other_point_predicts_the_points_between(name, measured):
    """Half of the points give the dropped ones; the whole table is 16 times better and more.

    The limits are twice the values measured when this was written.
    """
    full = table(name)
    n = len(full.gamma)
    kept = np.union1d(np.arange(0, n, 2), n - 1)
    dropped = np.setdiff1d(np.arange(n), kept)
    columns = (full.gamma, full.moment, full.energy, full.others)
    half = ReferenceCurve(*(column[kept] for column in columns))
    errors = curve_error(full.gamma[dropped], full.moment[dropped], full.energy[dropped], half)
    assert errors[0] < 2 * measured[0]
    assert errors[1] < 2 * measured[1]


@pytest.mark.parametrize("name", ["circ_ht4", "circ_ht1.6", "circ_ht1_beyond_pi"])
def test_interpolant_obeys_the_energy_balance_between_the_points(name):
    """The balance dU = 4 M dgamma holds at every state, to 1e-7 of the scales."""
    reference = table(name)
    curve = reference.interpolant
    s = np.linspace(0.0, curve.parameter[-1], 5001)
    gamma, moment, energy = np.moveaxis(curve.spline(s)[:, :3] * reference.scales, 1, 0)
    d_gamma, _, d_energy = np.moveaxis(curve.spline(s, 1)[:, :3] * reference.scales, 1, 0)
    assert np.abs(d_energy - 4 * moment * d_gamma).max() < 1e-7 * energy.max()
    assert gamma.max() == pytest.approx(reference.gamma.max(), abs=1e-6)


@pytest.mark.parametrize("name", ["circ_ht4", "circ_ht1.6", "circ_ht1_beyond_pi"])
def test_reference_has_no_error_against_itself(name):
    """The curve passes through its points: nothing but rounding is left."""
    reference = table(name)
    errors = curve_error(reference.gamma, reference.moment, reference.energy, reference)
    assert max(errors) < 1e-14


# --- distance -------------------------------------------------------------------------------


def test_states_on_a_known_curve_between_its_points_have_no_error():
    """M = sin gamma, U = 4 (1 - cos gamma): 41 points give the rest to 1e-10."""
    gamma = np.linspace(0.0, np.pi, 41)
    reference = as_reference((gamma, np.sin(gamma), 4 * (1 - np.cos(gamma))))
    gamma = np.linspace(0.0, np.pi, 977)
    assert max(curve_error(gamma, np.sin(gamma), 4 * (1 - np.cos(gamma)), reference)) < 1e-10


@pytest.mark.parametrize("offset", [1e-9, 1e-5, 3e-3])
def test_error_is_the_distance_along_the_normal(offset):
    """States moved along the curve's normal in (gamma/pi, M/max M) are that far off it."""
    s = np.linspace(-1.4, 1.4, 120)
    reference = as_reference(looped(s))
    s = np.linspace(-1.3, 1.3, 53)
    gamma, moment, energy = looped(s)
    scale = reference.scales
    h = 1e-6
    tangent = np.array([b - a for a, b in zip(looped(s - h), looped(s + h), strict=True)])[:2]
    tangent = tangent / scale[:2, None]
    normal = np.array([-tangent[1], tangent[0]]) / np.linalg.norm(tangent, axis=0)
    # away from the crossing, where the other branch may be nearer than the own one
    away = np.all([np.abs(s - crossing) > 0.15 for crossing in CROSSING], axis=0)
    moved = np.array([gamma, moment]) + offset * normal * scale[:2, None]
    error, _ = curve_error(*moved[:, away], energy[away], reference)
    assert error == pytest.approx(offset, rel=1e-3, abs=1e-11)


def test_state_near_a_crossing_belongs_to_the_branch_it_lies_on():
    """The nearest sample there may lie on the other branch: both must be looked at."""
    reference = as_reference(looped(np.linspace(-1.4, 1.4, 120)))
    near = np.concatenate([s + np.linspace(-0.05, 0.05, 2001) for s in CROSSING])
    assert curve_error(*looped(near), reference)[0] < 1e-10


def test_error_at_a_fold_is_second_order_in_gamma():
    """At a vertical tangent a shift of M slides along the curve; a shift of gamma does not."""
    reference = table("circ_ht1.6")
    at = int(np.argmin(np.abs(reference.gamma - reference.folds[0])))
    gamma, moment, energy = (
        np.array([a[at]]) for a in (reference.gamma, reference.moment, reference.energy)
    )
    along, _ = curve_error(gamma, moment + 1e-4 * reference.scales[1], energy, reference)
    across, _ = curve_error(gamma + 1e-4 * np.pi, moment, energy, reference)
    assert across == pytest.approx(1e-4, rel=1e-3)
    assert along < 1e-5


def test_energy_has_an_error_of_its_own():
    reference = table("circ_ht4")
    shifted = reference.energy + 1e-3 * reference.scales[2]
    moment_error, energy_error = curve_error(reference.gamma, reference.moment, shifted, reference)
    assert moment_error < 1e-14
    assert energy_error == pytest.approx(1e-3, rel=1e-2)


def test_state_beyond_the_end_is_measured_from_the_end():
    """A path that overshoots pi by 0.01 rad at M = 0, U unchanged."""
    reference = table("circ_ht4")
    error, _ = curve_error([np.pi + 0.01], [0.0], [reference.energy[-1]], reference)
    slope = 0.0814673 * np.pi / reference.scales[1]  # closed form; the normal there is nearly M's
    assert error == pytest.approx(0.01 / np.pi, rel=slope)


def test_largest_error_counts():
    reference = table("circ_ht4")
    moment = reference.moment.copy()
    moment[50] += 0.01 * reference.scales[1]
    assert curve_error(reference.gamma, moment, reference.energy, reference)[0] > 1e-3


@pytest.mark.parametrize(
    "states",
    [([0.0, 1.0], [0.0], [0.0, 1.0]), ([], [], []), ([0.0], [np.nan], [0.0])],
)
def test_states_that_make_no_path_are_refused(states):
    with pytest.raises(ValueError, match="gamma, moment"):
        curve_error(*states, table("circ_ht4"))


# --- folds ----------------------------------------------------------------------------------


def test_fold_error_is_the_largest_difference_in_path_order():
    first, second = table("circ_ht1.6").folds
    found = fold_error([first + 1e-4, second - 3e-4], table("circ_ht1.6"))
    assert found == pytest.approx(3e-4, rel=1e-9)


@pytest.mark.parametrize("folds", [[], [2.7719967717], [2.772, 2.614, 2.5]])
def test_missing_or_surplus_fold_is_an_infinite_error(folds):
    assert fold_error(folds, table("circ_ht1.6")) == math.inf


def test_path_without_folds_has_no_fold_error_where_none_is_expected():
    assert fold_error([], table("circ_ht4")) == 0.0
