"""From the scene to the record by the boundary-value problem: `der.bvp.solve.solve_bvp`."""

import math
import signal

import numpy as np
import pytest
from boundary_value import path
from shapes import scene

import der
from der.bvp.record import Followed
from der.bvp.solve import solve_bvp
from der.geometry.mesh import sites

EIGHTH = math.pi / 8
TURNS_BACK = (der.rectangle(0.46090256772792904, 0.3814496387454095, "y"), 3.3692299828162224, 0.0)
RINGS = [
    der.circle(),
    der.ellipse(0.6, "y"),
    der.rectangle(0.6, 0.3, "x"),
    der.triangle(math.pi / 3, 0.2),
]


# --- the record -------------------------------------------------------------------------------


def test_record_is_of_the_scene():
    """The statement, the method and the tolerance stand in the record."""
    record = path(der.ellipse(0.6, "y"), 3.0)
    assert record.solver == "bvp"
    assert record.ring == der.ellipse(0.6, "y").to_json()
    assert record.section["h_over_t"] == 3.0
    assert record.numerics["tolerance"] == 1e-8
    assert record.numerics["sector"] == "quarter"
    assert (record.status, record.message) == ("done", "")


def test_indices_in_the_grips_are_not_claimed():
    """They are masked, and None in the JSON; only that of the released folded ring is known."""
    record = path(der.circle(), 4.0)
    assert record.at_pi.index_free == 0
    assert record.mode.stable_free
    assert record.index.mask.all()
    assert record.index_moment.mask.all()
    assert record.at_pi.index is None
    assert record.mode.stable_3d is None


@pytest.mark.parametrize("ring", RINGS, ids=lambda ring: ring.shape)
def test_every_state_has_its_errors(ring):
    """n finite numbers each, all below the tolerance relative to the largest, and how."""
    record = path(ring, 3.0)
    scales = {
        "gamma": math.pi,
        "moment": np.abs(record.moment).max(),
        "energy": record.energy.max(),
    }
    for name, scale in scales.items():
        error = np.array(record.error[name])
        assert error.shape == record.gamma.shape
        assert 0.0 <= error.min() <= error.max() <= 1e-8 * scale
    assert "collocation" in record.error["how"]


def test_a_stiff_ring_keeps_its_first_errors_small():
    """Extended by 0.02 rad its first slope is far above any moment that it ever has."""
    ring = der.triangle(math.radians(130.8), 0.005)
    tolerance = 2e-6
    found = solve_bvp(der.Scene(ring, der.rectangular_section(53.0, nu=0.5)), tolerance=tolerance)
    assert 0.02 * found.moment[1] / found.gamma[1] > 5.0 * found.moment.max()
    assert max(found.error["moment"]) < tolerance * np.abs(found.moment).max()


def test_record_comes_back_from_json():
    """Bit for bit, masked indices included."""
    record = path(der.circle(), 1.6)
    assert der.Path.from_json(record.to_json()).to_json() == record.to_json()


def test_points_lie_at_their_states():
    """A point's numbers are those of the state at its position."""
    record = path(der.circle(), 1.6)
    assert [p.kind for p in record.points].count("fold") == 2
    for point in record.points:
        k = point.position
        state = record.gamma[k], record.moment[k], record.energy[k]
        assert (point.gamma, point.moment, point.energy) == state


@pytest.mark.parametrize(
    ("h_over_t", "foldable", "stable", "snapping"),
    [
        (1.0, False, None, "snap-through"),
        (1.6, True, False, "snap-back"),
        (2.0, True, False, "snap-through"),
        (4.0, True, True, "snap-through"),
    ],
)
def test_folding_modes_of_circles(h_over_t, foldable, stable, snapping):
    """The paper's four modes, one on each side of each of its thresholds 1.51, 1.84, 3.47."""
    mode = path(der.circle(), h_over_t).mode
    assert (mode.foldable, mode.stable, mode.snapping) == (foldable, stable, snapping)


def test_states_are_solved_for_where_they_are_asked_for():
    """All crossings: one of gamma = 1, three of 2.7 between the folds at h/t = 1.6."""
    record = path(der.circle(), 1.6, save_at=(1.0, 2.7))
    assert (record.gamma == 1.0).sum() == 1
    assert (record.gamma == 2.7).sum() == 3


@pytest.mark.parametrize("gamma_max", [0.5, math.pi, 4.0])
def test_path_ends_at_gamma_max(gamma_max):
    """Exactly and at the first arrival; pi is met on the way beyond, and judged."""
    record = path(der.circle(), 1.0, gamma_max=gamma_max)
    assert record.gamma[-1] == gamma_max
    assert record.gamma[:-1].max() < gamma_max
    assert (record.at_pi is None) == (gamma_max < math.pi)
    assert (record.mode is None) == (gamma_max < math.pi)


def test_ring_that_is_not_foldable_is_followed_until_it_is_folded():
    """The path of the circle at h/t = 1 ends at its third arrival at pi.

    Beyond pi to gamma = 5.459, back to 3.062, and to the three-covered state at the
    third arrival at pi (paper, appendix C.1). The mode is judged at the first.
    """
    record = path(der.circle(), 1.0, until="folded")
    assert record.gamma[-1] == math.pi
    assert (record.gamma == math.pi).sum() == 3
    assert record.moment[-1] == pytest.approx(0.0, abs=1e-8)
    assert record.at_pi.moment == pytest.approx(1.9449, abs=1e-4)
    assert not record.mode.foldable


def test_progress_is_told_of_every_state():
    """Called with gamma, in path order, folds included."""
    gammas: list[float] = []
    record = solve_bvp(scene(der.circle(), 1.6), progress=gammas.append)
    assert gammas == record.gamma.tolist()


def test_solving_twice_gives_the_same_bits():
    """Nothing is random, and no state is left behind."""
    first, second = (solve_bvp(scene(der.triangle(1.2, 0.1), 3.0)) for _ in range(2))
    np.testing.assert_array_equal(first.gamma, second.gamma)
    np.testing.assert_array_equal(first.energy, second.energy)


# --- shapes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("ring", RINGS, ids=lambda ring: ring.shape)
def test_frames_are_orthonormal_and_right_handed(ring):
    """To rounding: directors of unit quaternions."""
    frames = path(ring, 3.0, shapes=True).shapes.frames
    unit = np.einsum("...ij,...kj->...ik", frames, frames)
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(3), unit.shape), atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, atol=1e-13)


@pytest.mark.parametrize("ring", RINGS, ids=lambda ring: ring.shape)
def test_shapes_are_closed_rings_of_the_right_length(ring):
    """No chord is longer than its arc, nor shorter by more than (kappa h)^2 / 24 of it.

    The chord that closes the ring is one of them; 30 is above the curvature of any of these rings.
    Interpolation between mesh points lengthens a chord by 1e-7 of it.
    """
    shapes = path(ring, 3.0, shapes=True, n_edges=128).shapes
    middle = _middles(ring, 128)
    h = np.diff(np.append(middle, middle[0] + ring.length))
    chords = np.linalg.norm(np.roll(shapes.x, -1, axis=1) - shapes.x, axis=2)
    assert (chords <= h * (1.0 + 1e-6)).all()
    assert (chords >= h * (1.0 - (30.0 * h) ** 2 / 24.0)).all()


def _middles(ring: der.Ring, n_edges: int) -> np.ndarray:
    """Arc lengths (N,) of the vertices, in the middle between those of the frames."""
    s = sites(ring, n_edges, "full")
    return 0.5 * (s[:-1] + s[1:])


@pytest.mark.parametrize("ring", RINGS, ids=lambda ring: ring.shape)
def test_shapes_start_with_the_flat_ring(ring):
    """Vertices on the ring's own curve, the middle of the grips at the origin.

    Between mesh points shapes are of order 5 only: measured 6e-7 on the coarse first mesh.
    """
    x = path(ring, 3.0, shapes=True, n_edges=128).shapes.x[0]
    flat = ring.position(_middles(ring, 128))
    np.testing.assert_allclose(x, flat, atol=2e-6)


@pytest.mark.parametrize("ring", RINGS, ids=lambda ring: ring.shape)
def test_tangents_lie_along_the_chords(ring):
    """Edge j runs from vertex j - 1 to vertex j with its frame in the middle.

    The angle between d3 and the chord is of order h^2 where the curvature is smooth; less than h
    kappa at fillets.
    """
    shapes = path(ring, 3.0, shapes=True, n_edges=256).shapes
    chords = shapes.x - np.roll(shapes.x, 1, axis=1)
    chords /= np.linalg.norm(chords, axis=2, keepdims=True)
    off = np.linalg.norm(np.cross(chords, shapes.frames[:, :, 2]), axis=2)
    assert off.max() < 0.05
    assert np.median(off) < 3e-3


@pytest.mark.parametrize("ring", RINGS, ids=lambda ring: ring.shape)
def test_grips_turn_by_gamma_about_the_axis_and_slide_along_it(ring):
    """d2 of the grips stays along E3 and d3 is turned by +gamma at -E3, by -gamma at +E3."""
    record = path(ring, 3.0, shapes=True, n_edges=64)
    first, second = record.shapes.frames[:, 0], record.shapes.frames[:, 32]
    e3 = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(first[:, 1], np.tile(-e3, (len(record), 1)), atol=1e-7)
    np.testing.assert_allclose(second[:, 1], np.tile(e3, (len(record), 1)), atol=1e-7)
    sine, cosine = np.sin(record.gamma), np.cos(record.gamma)
    zero = np.zeros_like(sine)
    np.testing.assert_allclose(first[:, 2], np.column_stack([-sine, cosine, zero]), atol=1e-7)
    np.testing.assert_allclose(second[:, 2], -np.column_stack([sine, cosine, zero]), atol=1e-7)


def test_shapes_are_those_of_the_discrete_rod():
    """Vertices and frames of der.fold at equal gamma.

    The difference falls with h^2 (ratio 4 from 32 to 64 edges, within the next order). Two solvers,
    one convention.
    """
    gaps = []
    for n in (32, 64):
        wants = {"shapes": True, "n_edges": n, "gamma_max": 1.0, "save_at": (1.0,)}
        ours = path(der.circle(), 4.0, **wants)
        rod = der.fold(scene(der.circle(), 4.0, stability=False, self_crossings=False, **wants))
        assert ours.gamma[-1] == rod.gamma[-1] == 1.0
        gaps.append(
            [
                np.abs(ours.shapes.x[-1] - rod.shapes.x[-1]).max(),
                np.abs(ours.shapes.frames[-1] - rod.shapes.frames[-1]).max(),
            ]
        )
    assert np.max(gaps[1]) < 5e-3
    np.testing.assert_allclose(np.divide(*gaps), 4.0, atol=0.6)


def test_no_shapes_are_kept_unless_asked_for():
    """They are larger than all the rest."""
    assert path(der.circle(), 4.0).shapes is None


# --- failure ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "tolerance", [1e-12, 1e-2, 0.0, -1e-8, math.nan, math.inf, True, "1e-8", None]
)
def test_tolerances_that_cannot_be_kept_are_refused(tolerance):
    """By name, with what is allowed and what was given."""
    with pytest.raises(ValueError, match=r"^tolerance must be a number .*1e-11 to 0\.001.*, got "):
        solve_bvp(scene(der.circle(), 4.0), tolerance=tolerance)


@pytest.mark.parametrize(
    ("name", "wants"),
    [
        ("control", {"control": "angle"}),
        ("control", {"control": "moment"}),
        ("stretch", {"stretch": "finite"}),
        ("sector", {"sector": "full"}),
    ],
)
def test_what_this_solver_has_not_is_refused(name, wants):
    """One sentence that names the argument and its value."""
    value = wants[name]
    with pytest.raises(
        ValueError, match=f"^{name} must be .* boundary-value problem, got '{value}'$"
    ):
        solve_bvp(scene(der.circle(), 4.0, **wants))


@pytest.mark.parametrize("what", [None, "circle", der.circle()], ids=["none", "str", "ring"])
def test_only_scenes_are_solved(what):
    """A ring alone, or a word, is no scene."""
    with pytest.raises(ValueError, match=r"^scene must be a der\.Scene, got "):
        solve_bvp(what)


@pytest.mark.parametrize("states", [1, 9])
def test_interrupting_keeps_the_path(states):
    """Ctrl-C after some states: they are all there, and the record says so."""
    seen: list[float] = []

    def stop(gamma: float) -> None:
        seen.append(gamma)
        if len(seen) == states:
            raise KeyboardInterrupt

    with pytest.raises(der.Interrupted) as caught:
        solve_bvp(scene(der.circle(), 4.0), progress=stop)
    assert caught.value.path.status == "interrupted"
    assert caught.value.path.gamma.tolist() == seen


def test_ctrl_c_while_the_record_is_made_keeps_the_path(monkeypatch):
    """Pressed while the shapes are sampled, all states found: interrupted, and complete."""
    sampled = Followed._shapes

    def press_and_sample(*arguments):
        signal.raise_signal(signal.SIGINT)
        return sampled(*arguments)

    monkeypatch.setattr(Followed, "_shapes", press_and_sample)
    with pytest.raises(der.Interrupted) as caught:
        solve_bvp(scene(der.circle(), 4.0, shapes=True))
    path = caught.value.path
    assert (path.status, path.gamma[-1], len(path.shapes.x)) == ("interrupted", math.pi, len(path))


def test_a_path_that_never_arrives_is_not_foldable_and_says_so():
    """A ring whose path turns back before pi: done, with a mode, a sentence, and nothing at pi."""
    ring = der.rectangle(0.46090256772792904, 0.3814496387454095, "y")
    path = solve_bvp(der.Scene(ring, der.rectangular_section(3.3692299828162224, 0.0)))
    assert (path.status, path.at_pi) == ("done", None)
    assert (path.mode.foldable, path.mode.snapping) == (False, "snap-back")
    assert path.reason == "turned_back"
    assert "without arriving" in path.message
