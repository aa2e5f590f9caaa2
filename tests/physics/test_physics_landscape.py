"""Energy landscapes: what their wells, saddles and barriers have to be."""

import functools
import math

import numpy as np
import pytest
from rods import dense, on_conditions, richardson
from scipy.interpolate import CubicSpline
from shapes import scene

import der
from der.analysis.landscape.barrier import barrier
from der.analysis.landscape.landscape import landscape, scene_sector
from der.analysis.landscape.over_thickness import barriers_over
from der.analysis.landscape.saddle_search import climb, downhill_modes
from der.analysis.landscape.surface import energy_surface
from der.rod.equilibrium import Direction
from der.rod.free_ring import left_alone, shift
from der.rod.relaxation import relax
from der.rod.stability import all_modes, softest_modes

SHAPES = [
    (der.circle(), 4.0),
    (der.ellipse(0.6), 4.0),
    (der.ellipse(0.85, "y"), 4.0),
    (der.rectangle(0.6, 0.3), 4.0),
    (der.triangle(math.pi / 2, 1 / 15), 8.0),
]


@functools.cache
def along(ring, h_over_t, **numerics):
    return landscape(scene(ring, h_over_t, **numerics))


@functools.cache
def alone(ring, h_over_t, n_edges=64):
    return barrier(scene(ring, h_over_t, n_edges=n_edges))


@functools.cache
def sheet(ring, h_over_t, n):
    return energy_surface(scene(ring, h_over_t), shape=(n, n))


def rest_left_alone(ring, h_over_t, which):
    """A rest of the twisting path, and the same configuration without grips."""
    one = along(ring, h_over_t)
    rest = one.rests[which]
    asked = scene(ring, h_over_t)
    piece, whole = scene_sector(asked, "auto"), scene_sector(asked, "full")
    state = _state_at(asked, piece, rest)
    return rest, left_alone(piece, whole, state), whole


def _state_at(asked, piece, rest):
    """The state of a rest, from the path once more."""
    from der.analysis.landscape.landscape import FARTHEST
    from der.analysis.landscape.rest_states import with_rests
    from der.continuation.arclength import follow
    from der.continuation.events import Wanted
    from der.continuation.step import Tally

    wanted = Wanted(load_max=FARTHEST, until_folded=True, stability=False, contacts=False)
    tally = Tally()
    visits, at = with_rests(piece, wanted, list(follow(piece, wanted, tally)), tally)
    nearest = min(at, key=lambda k: abs(visits[k].at.state.load - rest.gamma))
    return visits[nearest].at.state


# --- along the path ---------------------------------------------------------------------------


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_rests_are_equilibria_without_moment(ring, h_over_t):
    """M = 0 to 1e-10 at every rest: they are solved for, not interpolated."""
    one = along(ring, h_over_t)
    assert one.folded
    for rest in one.rests:
        assert abs(one.path.moment[rest.position]) < 1e-10
        assert one.path.gamma[rest.position] == rest.gamma
        assert one.path.energy[rest.position] == rest.energy


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_every_zero_of_the_moment_is_a_rest(ring, h_over_t):
    """M changes its sign nowhere else; wells and saddles follow each other."""
    one = along(ring, h_over_t)
    there = {rest.position for rest in one.rests}
    moment = one.path.moment
    for k in range(len(moment) - 1):
        if not {k, k + 1} & there:
            assert moment[k] * moment[k + 1] > 0.0
    assert [rest.kind for rest in one.rests] == ["well", "saddle", "well"]


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_barriers_are_differences_of_energy(ring, h_over_t):
    """Of U at the states with M = 0, to 1e-8: U there by a solve of its own at that gamma."""
    one = along(ring, h_over_t)
    saddle = one.rests[one.barriers.saddle].gamma
    path = der.fold(
        scene(ring, h_over_t, self_crossings=False, stability=False, save_at=[saddle, math.pi])
    )
    (at,) = [k for k in range(len(path)) if abs(path.gamma[k] - saddle) < 1e-13][-1:]
    assert abs(path.moment[at]) < 1e-8
    flat, folded = path.energy[0], path.energy[-1]
    assert one.barriers.fold == pytest.approx(path.energy[at] - flat, abs=1e-8)
    assert one.barriers.open == pytest.approx(path.energy[at] - folded, abs=1e-8)


def test_the_barrier_is_the_work_of_the_moment():
    """U(saddle) - U(folded) is the integral of -4 M dgamma from one to the other: M = (dU/dg)/4.

    By a spline through 65 states; to 1e-8 of it.
    """
    one = along(der.circle(), 8.0)
    start = one.rests[one.barriers.saddle].gamma
    gammas = np.linspace(start, math.pi, 65)
    path = der.fold(
        scene(der.circle(), 8.0, self_crossings=False, stability=False, save_at=tuple(gammas))
    )
    between = (path.gamma >= start - 1e-13) & np.isin(path.gamma, gammas)
    spline = CubicSpline(path.gamma[between], path.moment[between])
    work = -4.0 * float(spline.integrate(start, math.pi))
    assert one.barriers.open == pytest.approx(work, rel=1e-6)


@pytest.mark.parametrize("h_over_t", [1.6, 4.0, 20.0])
def test_energy_of_the_folded_circle(h_over_t):
    """U(pi) = 4 pi alpha: curvature 3 instead of 1 over the length 2 pi."""
    one = along(der.circle(), h_over_t)
    alpha = der.rectangular_section(h_over_t).alpha
    assert one.rests[-1].energy == pytest.approx(4 * math.pi * alpha, abs=1e-9)
    fold, opening = one.barriers.fold, one.barriers.open
    if opening is not None:
        assert fold - opening == pytest.approx(4 * math.pi * alpha, abs=1e-9)


def test_the_barrier_to_open_vanishes_with_the_square_of_the_distance():
    """Pitchfork, M = s d - c d^3: the saddle is s^2/c high, and s grows like h/t - 3.469928.

    The exponent over s = dM/dgamma of the folded ring tends to 2; where sqrt(barrier) vanishes,
    from 64, 128 and 256 edges by Romberg's scheme, is the threshold of stability.
    """
    thresholds = []
    h_over_t = np.array([3.5, 3.52, 3.56, 3.6, 3.7])
    for n_edges in (64, 128, 256):
        ones = [along(der.circle(), h, n_edges=n_edges) for h in h_over_t]
        barrier = np.array([one.barriers.open for one in ones])
        slope = np.array([one.rests[-1].slope for one in ones])
        exponents = np.diff(np.log(barrier)) / np.diff(np.log(slope))
        assert exponents == pytest.approx(2.0, abs=0.015)
        thresholds.append(float(np.polyval(np.polyfit(np.sqrt(barrier), h_over_t, 3), 0.0)))
    assert richardson(*thresholds) == pytest.approx(3.469928, abs=2e-5)


def test_below_the_threshold_the_folded_ring_is_no_well():
    """h/t = 3: no barrier to open, and a sentence; the saddle is the folded ring itself."""
    one = along(der.circle(), 3.0)
    assert one.barriers.open is None
    assert "no well" in one.barriers.why["open"]
    assert one.barriers.saddle == len(one.rests) - 1


def test_barriers_converge_with_the_square_of_the_cell():
    """Circle, h/t = 8, from 64, 128 and 256 edges: order 2, to open 0.259469."""
    found = [along(der.circle(), 8.0, n_edges=n).barriers.open for n in (64, 128, 256)]
    order = math.log2((found[0] - found[1]) / (found[1] - found[2]))
    assert order == pytest.approx(2.0, abs=0.03)
    assert richardson(*found) == pytest.approx(0.2594686, abs=1e-6)


@pytest.mark.parametrize(("h_over_t", "opening"), [(4.0, 0.02108715), (8.0, 0.25946861)])
def test_error_bars_of_barriers(h_over_t, opening):
    """From 128, 64 and 32 edges to 1e-6, within the error; truth: 256, 128 and 64 edges."""
    section = der.rectangular_section(h_over_t)
    one = landscape(der.Scene(der.circle(), section, n_edges=128, error_bars=True))
    value, error = one.extrapolated["open"]
    assert value == pytest.approx(opening, abs=1e-6)
    assert abs(value - opening) < error < 1e-4


def test_a_well_of_the_mesh_alone_has_no_barrier():
    """h/t = 3.45 lies between the thresholds of 64 edges, 3.434, and of none, 3.470."""
    (on_mesh,) = barriers_over(der.circle(), [3.45], error_bars=False).open
    extrapolated = barriers_over(der.circle(), [3.45])
    assert on_mesh > 0.0
    assert np.isnan(extrapolated.open[0])
    assert extrapolated.fold[0] == pytest.approx(extrapolated.folded_energy[0], abs=1e-9)
    assert "but for the mesh" in extrapolated.why[0]


def test_the_barrier_to_open_exists_above_the_threshold_only_and_grows():
    """Forty landscapes over h/t: none below 3.4 (3.4699 in the limit), increasing above 3.5."""
    curves = barriers_over(der.circle(), np.geomspace(1.0, 30.0, 40))
    assert len(curves.fold) == 40
    assert np.isnan(curves.open[curves.h_over_t < 3.4]).all()
    assert np.all(np.diff(curves.open[curves.h_over_t > 3.5]) > 0.0)


# --- the free ring ----------------------------------------------------------------------------


@pytest.mark.parametrize(("ring", "h_over_t"), SHAPES, ids=str)
def test_every_rest_is_an_equilibrium_of_the_ring_left_alone(ring, h_over_t):
    """At M = 0 the grips exert nothing, bending moments included: the half-turn about the axis.

    Residual of the full ring without grips, in units of its largest bending stiffness.
    """
    for which in range(3):
        _, free, whole = rest_left_alone(ring, h_over_t, which)
        stiffest = float(whole.body.stiffness.max() / whole.body.cell.min())
        assert free.residual < 1e-12 * stiffest


@pytest.mark.parametrize(("ring", "h_over_t", "ways"), [(*SHAPES[0], 1), (*SHAPES[1], 2)], ids=str)
def test_index_left_alone_by_dense_eigenvalues(ring, h_over_t, ways):
    """Truth: eigenvalues of the dense Hessian; a circle has one more of 0, the material shift.

    Factored with that shift pinned the index is certified; the shift's rates are its null vector.
    """
    rest, free, _ = rest_left_alone(ring, h_over_t, 1)
    values = on_conditions(*dense(free.body, free.held, free.state))
    zero = int(np.sum(np.abs(values) < 1e-10))
    assert zero == free.zero_modes == int(ring.shape == "circle")
    assert int(np.sum(values < -1e-10)) == free.index() == rest.index_free == ways
    if zero:
        modes = all_modes(free.held)
        _, (mode,) = softest_modes(free.body, free.held, modes, free.state)
        rates = shift(free.body, free.state)
        cosine = abs(np.vdot(mode, rates)) / np.linalg.norm(mode) / np.linalg.norm(rates)
        assert cosine == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("h_over_t", [3.6, 8.0])
def test_the_saddle_of_a_circle_is_the_same_in_grips_and_alone(h_over_t):
    """Index 1 without grips, material shift taken out: barriers of twisting are the ring's own."""
    found = alone(der.circle(), h_over_t)
    assert found.saddle.twisted
    assert found.saddle.index == found.saddle.zero_modes == 1
    assert found.saddle.residual < 1e-9
    assert found.open == pytest.approx(found.twisting.open, abs=1e-12)


def test_a_free_ellipse_opens_far_more_easily():
    """b/a = 0.6, h/t = 4: 0.0107 GJ/a beside 0.671 by twisting, of order 2 in the cell.

    The saddle of twisting has index 2; beside it is one of index 1, residual below 1e-9.
    """
    ones = [alone(der.ellipse(0.6), 4.0, n) for n in (32, 64, 128)]
    for one in ones:
        assert not one.saddle.twisted
        assert one.saddle.index == 1
        assert one.saddle.residual < 1e-9
    found = [one.open for one in ones]
    order = math.log2((found[0] - found[1]) / (found[1] - found[2]))
    assert order == pytest.approx(2.0, abs=0.4)
    assert richardson(*found) == pytest.approx(0.010682, abs=2e-6)
    assert richardson(*(one.twisting.open for one in ones)) == pytest.approx(0.671334, abs=2e-5)


def test_twisting_about_either_axis_leads_to_one_free_saddle():
    """Ellipse b/a = 0.85: a free ring knows no axis. From two meshes, to their rounding.

    The saddle of twisting is the same about either axis as well, with index 2.
    """
    about_x, about_y = (alone(der.ellipse(0.85, axis), 4.0) for axis in "xy")
    assert about_x.open == pytest.approx(about_y.open, abs=1e-9)
    assert about_x.twisting.open == pytest.approx(about_y.twisting.open, abs=1e-9)
    assert about_x.open < 0.5 * about_x.twisting.open


@pytest.mark.parametrize("h_over_t", [4.0, 30.0])
def test_a_free_saddle_leads_to_flat_and_to_folded(h_over_t):
    """The energy rises from flat to the saddle and falls to the folded ring, at every step."""
    found = alone(der.ellipse(0.6), h_over_t)
    assert set(found.saddle.ends) == {"flat", "folded"}
    energy = found.way[:, 1]
    top = int(np.argmax(energy))
    assert energy[top] == found.saddle.energy
    assert energy[[0, -1]] == pytest.approx([0.0, found.fold - found.open], abs=1e-6)
    assert np.all(np.diff(energy[: top + 1]) > -1e-9)
    assert np.all(np.diff(energy[top:]) < 1e-9)


def test_climbs_from_both_sides_meet_in_one_saddle():
    """From the saddle of twisting along its other unstable mode, and from the folded ring uphill.

    Dynamic relaxation, which knows no Hessian, leads from there to flat and to folded.
    """
    ring = der.ellipse(0.6)
    _, saddle, _ = rest_left_alone(ring, 4.0, 1)
    _, folded, _ = rest_left_alone(ring, 4.0, 2)
    size = 0.05 * math.sqrt(ring.length)
    along_it, aside = downhill_modes(saddle)
    down = climb(saddle, along_it, kick=size * aside)
    held = folded.pinned()
    _, (soft,) = softest_modes(folded.body, held, all_modes(held), folded.state)
    up = climb(folded, soft, kick=size * soft)
    assert down.is_saddle
    assert up.is_saddle
    assert down.at.energy == pytest.approx(up.at.energy, abs=1e-10)
    (way,) = downhill_modes(down.alone)
    ends = []
    for sign in (1.0, -1.0):
        kick = Direction(sign * size * way, np.zeros(3), 0.0)
        rest = relax(down.alone.body, down.alone.held, down.alone.state, kick=kick)
        assert rest.rests
        ends.append(rest.energy)
    wells = [one.energy for one in along(ring, 4.0).wells]
    assert sorted(ends) == pytest.approx(wells, abs=1e-6)


def test_a_ring_that_is_no_well_left_alone_has_no_barrier():
    """Ellipse b/a = 0.6 at h/t = 3: a well in grips, index 1 without; null, and a sentence."""
    found = alone(der.ellipse(0.6), 3.0)
    assert found.fold is None
    assert found.open is None
    assert "no well" in found.why
    assert found.twisting.open > 0.3


# --- twist and distance -----------------------------------------------------------------------


def test_forces_are_the_slopes_of_the_surface():
    """4 M = dU/dgamma and F = dU/dd, against central differences on a fine patch."""
    one = energy_surface(
        scene(der.circle(), 1.6),
        gamma=1.2 + 1e-3 * np.arange(5),
        shape=(5, 5),
        distance_range=(1.9, 1.904),
        snaps=False,
    )
    step = one.distance[1] - one.distance[0]
    over_gamma = (one.energy[2:, 2] - one.energy[:-2, 2]) / 2e-3
    over_distance = (one.energy[2, 2:] - one.energy[2, :-2]) / (2 * step)
    assert 4 * one.moment[1:-1, 2] == pytest.approx(over_gamma, rel=1e-5)
    assert one.force[2, 1:-1] == pytest.approx(over_distance, rel=1e-4, abs=1e-6)


def test_the_path_runs_where_no_axial_force_acts():
    """Between cells where F changes its sign there is a state of the path, and none elsewhere."""
    one = sheet(der.circle(), 4.0, 24)
    gamma, distance, _ = one.path.T
    for i in range(1, len(one.gamma) - 1):
        (places,) = np.nonzero(one.force[i, :-1] * one.force[i, 1:] < 0.0)
        on_path = distance[gamma == one.gamma[i]]
        assert len(places) == len(on_path) == 1
        assert one.distance[places[0]] <= on_path[0] <= one.distance[places[0] + 1]


def test_a_stable_state_of_the_path_is_a_valley_of_the_surface():
    """No cell at its gamma has less energy, but for the cell's own size."""
    one = sheet(der.circle(), 4.0, 24)
    gamma, _, energy = one.path.T
    for i, here in enumerate(one.gamma):
        least = np.nanmin(one.energy[i])
        assert energy[gamma == here][0] <= least + 1e-9


def test_the_index_says_where_the_symmetry_breaks():
    """h/t = 1.6, far corner: a mode out of the surface is unstable; a kick along it leads lower."""
    one = sheet(der.circle(), 1.6, 24)
    assert np.all(one.index[:20] == 0)
    assert one.index.max() == 2
    assert np.all(one.count == 1)


def test_snaps_fall_along_the_surface_and_land_on_the_path():
    """Two at h/t = 1.6, up and down, each at one gamma; energies are not below the surface's."""
    one = sheet(der.circle(), 1.6, 24)
    assert len(one.snaps) == 2
    for snap, fold in zip(one.snaps, one.folds, strict=True):
        assert np.ptp(snap[:, 0]) == 0.0
        assert snap[0] == pytest.approx(fold, abs=1e-6)
        assert snap[-1, 2] < snap[0, 2]


@pytest.mark.parametrize(
    ("ring", "h_over_t"),
    [(der.rectangle(0.2, 0.2), 1.5), (der.triangle(math.pi / 2, 1 / 30), 4.0)],
    ids=str,
)
def test_cells_with_several_minima_show_them(ring, h_over_t):
    """Two shapes at one gamma and distance, the lower one first, in 3 to 15 of a hundred cells."""
    one = sheet(ring, h_over_t, 16)
    several = one.count > 1
    assert 0.03 < several.mean() < 0.15
    for i, j in np.argwhere(several):
        found = one.minima[i][j]
        assert list(found) == sorted(found)
        assert found[0] == one.energy[i, j]
        assert found[-1] <= one.numerics["ceiling"]


def test_a_sheet_that_ends_is_found_from_all_sides():
    """Cells of one second sheet hang together: what the flood finds does not stop within it."""
    one = sheet(der.rectangle(0.2, 0.2), 1.5, 16)
    several = one.count > 1
    neighbours = np.zeros(several.shape, dtype=int)
    neighbours[1:] += several[:-1]
    neighbours[:-1] += several[1:]
    neighbours[:, 1:] += several[:, :-1]
    neighbours[:, :-1] += several[:, 1:]
    assert np.all(neighbours[several] > 0)
