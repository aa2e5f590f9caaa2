"""What is kept of the full ring: shapes, snaps and softest modes, from the states of a sector."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

import der
from der.analysis.full_ring import STEPS, displacements
from der.analysis.request import Request
from der.kernels.linking import unfold
from der.rod.gripped_ring import gripped_ring

EDGES = 32


def circle(name, **more):
    return gripped_ring(der.circle(), der.rectangular_section(1.6), EDGES, name=name, **more)


@pytest.fixture(scope="module", params=[0.0, 1e3], ids=["inextensible", "extensible"])
def states(request):
    """A quarter, and a state on its unstable branch; and the same on a half and the full ring."""
    quarter, *others = (
        circle(name, stretching=request.param) for name in ("quarter", "half", "full")
    )
    points = Request().follow(quarter)
    at = next(point.solution for point in points if not point.kind and sum(point.index) == 1)
    found = [(quarter, at.state)]
    frames, lengths = quarter.full_frames(at.state), quarter.full_lengths(at.state)
    for ring in others:
        n = len(ring.start.quat)
        stretch = lengths[:n] / (2 * np.pi / EDGES) - 1.0
        guess = ring.start.but(
            quat=np.ascontiguousarray(frames[:n]), stretch=stretch, load=at.state.load
        )
        found.append((ring, ring.correct(guess).state))
    return found


def softest(ring, state, label, count=1):
    """Eigenvalues and displacements of the softest modes of a class."""
    values, modes = ring.softest_modes(state, count, label)
    return values, [displacements(ring, state, label, mode) for mode in modes]


@pytest.mark.parametrize("label", ["in phase", "odd"])
def test_modes_of_a_sector_are_modes_of_the_full_ring(states, label):
    """The same eigenvalue, and a displacement in the span of the full ring's own softest modes."""
    full_values, full = softest(*states[2], "all", 3)
    for ring, state in states[:2]:
        label_here = {"odd": "out of phase"}.get(label, label) if ring.copies == 2 else label
        (value,), (u,) = softest(ring, state, label_here)
        assert np.abs(full_values - value).min() < 1e-8
        basis = np.reshape(full, (3, -1)).T
        best, *_ = np.linalg.lstsq(basis, u.ravel(), rcond=None)
        assert_allclose(basis @ best, u.ravel(), atol=1e-6 * np.abs(u).max())


def test_displacement_is_the_rate_of_the_shape(states):
    """Central differences along an in-phase mode, which the sector itself can follow."""
    for ring, state in states:
        label = next(iter(ring.classes))
        _, (mode,) = ring.softest_modes(state, symmetry=label)
        shift = ring.increment(1e-4 * mode)
        ends = [ring.shape(ring.retract(state, way))[0] for way in (shift, -shift)]
        rate = (ends[0] - ends[1]) / 2e-4
        assert_allclose(displacements(ring, state, label, mode), rate, atol=1e-6)


@pytest.mark.parametrize("label", ["in phase", "out of phase", "odd"])
def test_every_class_keeps_the_ring_closed_and_the_grips_on_their_axis(states, label):
    """Displacements of the grips' middles have no component across E3, and opposite ones along."""
    ring, state = states[0]
    _, (u,) = softest(ring, state, label)
    grips = 0.5 * (u + np.roll(u, 1, axis=0))[[0, EDGES // 2]]
    assert_allclose(grips[:, :2], 0.0, atol=1e-8 * np.abs(u).max())
    assert_allclose(grips.sum(axis=0), 0.0, atol=1e-8 * np.abs(u).max())


def test_the_rings_above_are_at_one_state(states):
    """Newton moved nothing of the quarter's unfolded frames."""
    (_, state), _, (_, same) = states
    assert_allclose(np.abs(np.sum(unfold(state.quat, 4) * same.quat, axis=1)), 1.0, atol=1e-12)


# --- What a scene keeps ----------------------------------------------------------------------


def folded(**wants):
    wants = {"control": "angle", "shapes": True} | wants
    scene = der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=EDGES, **wants)
    return der.fold(scene)


@pytest.fixture(scope="module")
def snapped():
    return folded(history=True, modes=True)


def test_nothing_is_kept_that_was_not_asked_for():
    shapes = folded().shapes
    assert (shapes.falls, shapes.softest) == ((), None)


def test_a_fall_leads_from_the_fold_to_the_landing(snapped):
    """It leaves the fold by the kick, loses energy, and is at rest where the snap has landed."""
    (snap,) = (point.position for point in snapped.points if point.kind == "snap")
    (fall,) = snapped.shapes.falls
    assert fall.after == snap - 1
    assert 20 < len(fall.x) <= STEPS
    assert_allclose(fall.gamma, snapped.gamma[snap], rtol=1e-12)
    assert np.abs(fall.x[0] - snapped.shapes.x[snap - 1]).max() < 0.1
    assert_allclose(fall.x[-1], snapped.shapes.x[snap], atol=1e-3)
    assert fall.energy[-1] == pytest.approx(snapped.energy[snap], abs=1e-4)
    assert fall.energy[-1] <= fall.energy.min() + 1e-4 < fall.energy[0]


def test_a_fall_is_told_in_even_steps(snapped):
    """None longer than three times the mean, so that slow motion has no jump."""
    (fall,) = snapped.shapes.falls
    steps = [np.linalg.norm(b - a, axis=1).max() for a, b in pairwise(fall.x)]
    assert max(steps) < 3.0 * np.mean(steps)


def test_gamma_of_a_fall_under_a_dead_moment_moves():
    """The ring falls through at a moment held: gamma goes with it, to the landing."""
    path = folded(control="moment", history=True)
    assert path.shapes.falls
    for fall in path.shapes.falls:
        assert np.ptp(fall.gamma) > 0.1
        assert fall.gamma[-1] == pytest.approx(path.gamma[fall.after + 1], abs=1e-2)


def test_relaxation_alone_keeps_its_snap_too():
    (fall,) = folded(solver="relaxation", history=True).shapes.falls
    assert len(fall.x) > 20


def test_eigenvalues_have_the_signs_of_the_index():
    """On the unstable branch the softest mode is in phase and unstable; none elsewhere."""
    path = folded(control="arclength", modes=True)
    softest = path.shapes.softest
    assert softest.classes == ("in phase", "out of phase", "odd")
    for index, values in zip(path.index.tolist(), softest.eigenvalues, strict=True):
        if index is not None:
            assert np.sum(values < 0.0) == index
    folds = [fold.position for fold in path.folds]
    assert_allclose(softest.eigenvalues[folds, 0], 0.0, atol=1e-7)


def test_softest_modes_do_not_flip_from_state_to_state(snapped):
    """Each is turned to the side of the one before."""
    u = snapped.shapes.softest.u
    assert all(np.vdot(a, b) >= 0.0 for a, b in pairwise(u))
