"""Animations resampled and in step: each step is a state of the path or lies between two."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import der
from der.records.configurations import Shapes
from der.viz.animation import animate, edges, grips
from der.viz.captions import captions
from der.viz.curve import smooth
from der.viz.resampling import aligned, in_step, resampled
from der.viz.titles import names

EDGES = 32
THICK = der.rectangular_section(h_over_t=1.6)  # two folds: snaps where the angle is controlled


def folded(section, **wanted):
    return der.fold(der.Scene(der.circle(), section, n_edges=EDGES, shapes=True, **wanted))


@pytest.fixture(scope="module")
def path():
    return folded(THICK)


@pytest.fixture(scope="module")
def loop():
    """Up and back, with two snaps and their histories."""
    return folded(THICK, control="angle", unload=True, history=True)


def test_steps_are_of_about_equal_motion(path):
    """In no step does a vertex move more than three times its average distance."""
    motion = resampled(path, 100)
    moved = np.linalg.norm(np.diff(motion.x, axis=0), axis=2).max(axis=1)
    assert moved.max() < 3 * moved.mean()


def test_states_that_are_shown_are_those_of_the_path(path):
    """First, last and special points, bit for bit."""
    motion = resampled(path, 50)
    for k in (0, *(point.position for point in path.points), len(path) - 1):
        step = motion.step_of(k)
        assert_array_equal(motion.x[step], path.shapes.x[k])
        assert_allclose(motion.frames[step], path.shapes.frames[k], atol=1e-12)
        assert motion.gamma[step] == pytest.approx(path.gamma[k], abs=1e-12)


def test_between_states_edges_keep_their_length(path):
    """The spline's error: under half a percent; on straight lines between states it is over one."""
    length = np.linalg.norm(edges(resampled(path, 100).x), axis=2)
    assert np.abs(length / length[0] - 1).max() < 5e-3


def test_between_states_frames_are_orthonormal_and_follow_the_edges(path):
    motion = resampled(path, 60)
    turn = motion.frames @ motion.frames.swapaxes(-1, -2)
    assert_allclose(turn, np.broadcast_to(np.eye(3), turn.shape), atol=1e-12)
    assert_allclose(np.linalg.det(motion.frames), 1.0)
    tangent = edges(motion.x) / np.linalg.norm(edges(motion.x), axis=2, keepdims=True)
    assert np.min(np.sum(tangent * motion.frames[:, :, 2], axis=2)) > 0.999


@pytest.mark.parametrize("name", ["moment", "energy"])
def test_present_state_is_on_the_drawn_curve(path, name):
    """To rounding: it moves on the same points."""
    motion = resampled(path, 60)
    curve = smooth(path, getattr(path, name))
    a, b = curve[:-1], curve[1:]
    for point in np.column_stack([motion.gamma / np.pi, getattr(motion, name)]):
        way = b - a
        share = np.sum((point - a) * way, axis=1) / np.maximum(np.sum(way**2, axis=1), 1e-30)
        nearest = a + np.clip(share, 0, 1)[:, None] * way
        assert np.linalg.norm(nearest - point, axis=1).min() < 1e-12


def test_a_snap_is_in_slow_motion_and_without_a_moment(loop):
    motion = resampled(loop, 100)
    falling = motion.position < 0
    assert 10 < np.count_nonzero(falling) < 90
    assert np.isnan(motion.moment[falling]).all()
    assert np.isfinite(motion.moment[~falling]).all()
    low, high = animate(loop).energy.min(), animate(loop).energy.max()
    assert np.all((motion.energy >= low - 1e-12) & (motion.energy <= high + 1e-12))


def test_a_snap_without_history_is_a_jump():
    """No picture of a ring in between: every one has edges of their length."""
    motion = resampled(folded(THICK, control="angle"), 100)
    length = np.linalg.norm(edges(motion.x), axis=2)
    assert np.abs(length / length[0] - 1).max() < 5e-3
    assert np.all(motion.position >= 0)


def test_one_state_is_a_film(path):
    bare = {name: getattr(path, name)[:1] for name in ("gamma", "moment", "energy")}
    bare |= {name: getattr(path, name)[:1] for name in ("index", "index_moment")}
    shapes = Shapes(path.shapes.x[:1], path.shapes.frames[:1])
    motion = resampled(replace(path, points=(), shapes=shapes, **bare), 20)
    assert_array_equal(motion.x, path.shapes.x[:1])


def test_two_films_are_at_equal_gamma_while_neither_turns_back(path):
    """Within the steps of the finer motions, pi/240; and both end at their ends."""
    slim = folded(der.rectangular_section(h_over_t=4))
    one, other = in_step([path, slim], 80)
    assert len(one.x) == len(other.x)
    first = one.step_of(path.folds[0].position)
    before = one.gamma < path.folds[1].gamma - 0.1
    before[first:] = False
    assert np.count_nonzero(before) > 40
    assert np.abs(one.gamma - other.gamma)[before].max() < 2 * np.pi / 240
    for motion, whole in ((one, path), (other, slim)):
        assert_array_equal(motion.x[-1], whole.shapes.x[-1])
        assert np.all(np.diff(motion.position[motion.position >= 0]) >= 0)


def test_while_one_ring_turns_back_the_other_waits(path):
    """A ring whose gamma rises does not turn back with it."""
    slim = folded(der.rectangular_section(h_over_t=4))
    _, other = in_step([path, slim], 80)
    assert np.all(np.diff(other.gamma) >= 0)


def test_equal_sequences_go_together_and_a_detour_is_waited_for():
    assert_array_equal(aligned(np.arange(4.0), np.arange(4.0)), np.column_stack([range(4)] * 2))
    pairs = aligned(np.array([0.0, 1, 2, 1, 2, 3]), np.array([0.0, 1, 2, 3]))
    assert pairs.tolist()[0] == [0, 0]
    assert pairs.tolist()[-1] == [5, 3]
    steps = np.diff(pairs, axis=0)
    assert set(map(tuple, steps.tolist())) <= {(1, 1), (1, 0), (0, 1)}
    assert np.abs(np.array([0, 1, 2, 1, 2, 3])[pairs[:, 0]] - pairs[:, 1]).sum() == 1


def test_a_grip_s_arc_ends_where_its_director_points(path):
    """gamma about the axis from the first, -gamma from the second."""
    motion = resampled(path, 30)
    arcs = grips(motion, 0.5, 9)
    for arc, edge in zip(arcs, (0, EDGES // 2), strict=True):
        out = (arc[:, -2] - arc[:, -1]) / (0.5 * motion.size)
        assert_allclose(out, motion.frames[:, edge, 0], atol=2e-3)


# --- Words -----------------------------------------------------------------------------------


def test_captions_say_what_the_record_says(path):
    motion = resampled(path, 100)
    said = captions(path, motion)
    first, second = (motion.step_of(fold.position) for fold in path.folds)
    assert said[0].event == ""
    assert [said[k].stable for k in (0, first - 1, first, second - 1, second, -1)] == [
        *(True, True, False, False, True, True)
    ]
    assert said[first].event.startswith("fold at ")
    assert f"{path.folds[0].gamma / np.pi:.4f}" in said[first].event
    assert "-0.000" not in said[-1].numbers


def test_captions_say_that_the_ring_snaps(loop):
    motion = resampled(loop, 100)
    falling = np.flatnonzero(motion.position < 0)
    said = captions(loop, motion)
    assert {said[k].stability for k in falling} == {"snap (slow motion)"}
    assert all("M =" not in said[k].numbers for k in falling)


def test_captions_say_which_way_the_grips_turn(path, loop):
    """Up to pi and back: loading, then unloading; nothing where there is no way back."""
    said = captions(loop, resampled(loop, 100))
    ways = [one.way for one in said]
    first = ways.index("unloading")
    assert set(ways[:first]) == {"loading"}
    assert set(ways[first:]) == {"unloading"}
    assert resampled(loop, 100).gamma.argmax() == first
    assert said[0].line == "loading, stable at fixed γ"
    assert {one.way for one in captions(path, resampled(path, 30))} == {""}


def test_an_event_is_said_for_a_while(path):
    """At its step and a little longer; not up to the next one."""
    motion = resampled(path, 100)
    said = captions(path, motion)
    last = motion.step_of(path.points[-1].position)
    assert said[last].event
    before = motion.step_of(path.points[0].position)
    assert not any(one.event for one in said[:before])
    shown = sum(bool(one.event) for one in said)
    assert 0 < shown <= 0.13 * len(said) * len(path.points)


def test_names_name_all_that_differs(path):
    """Shape, axis and solver, also where h/t alone distinguishes two paths."""
    ellipse = {"shape": "ellipse", "twist_axis": "x"}
    slim = {**path.section, "h_over_t": 4.0}
    one = replace(path, ring={**ellipse, "b_over_a": 0.6})
    other = replace(path, ring={**ellipse, "b_over_a": 0.8, "twist_axis": "y"}, section=slim)
    assert names([one, other]) == [
        "ellipse, b/a = 0.6, h/t = 1.6",
        "ellipse, b/a = 0.8, about y, h/t = 4",
    ]
    assert names([path, one]) == ["circle, h/t = 1.6", "ellipse, b/a = 0.6, h/t = 1.6"]
    assert names([path, replace(path, solver="bvp", numerics={"intervals": 14})])[1].startswith(
        "circle, h/t = 1.6, boundary-value problem"
    )


def test_names_tell_paths_apart(path, loop):
    slim = folded(der.rectangular_section(h_over_t=4))
    assert names([path]) == ["circle, h/t = 1.6"]
    assert names([path, slim]) == ["circle, h/t = 1.6", "circle, h/t = 4"]
    assert names([path, loop]) == [
        "circle, h/t = 1.6, control arclength",
        "circle, h/t = 1.6, control angle",
    ]
    assert names([path, path]) == ["circle, h/t = 1.6 (1)", "circle, h/t = 1.6 (2)"]
