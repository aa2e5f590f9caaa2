"""Scenarios run on import; one physical number of each is pinned."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

CLONE = Path(__file__).parents[2]
RUN = [f for f in sorted((CLONE / "scenarios").glob("*.py")) if "__main__" in f.read_text()]


@pytest.mark.parametrize("file", RUN, ids=lambda file: file.stem)
def test_every_scenario_reads_its_arguments_before_it_solves(file):
    """By the shared parser, before anything of der is called."""
    text = file.read_text()
    asked = 'if __name__ == "__main__":\n    usage(__file__, __doc__)\n'
    assert "Arguments(__file__, __doc__)" in text or text.count(asked) == 1
    head = text.split(asked)[0]
    assert "der.Scene(" not in head or "Arguments(" in text


def test_a_usage_and_one_line_for_what_is_not_known(tmp_path):
    """Exit 0 with the docstring; exit 2 with a line; nothing solved or written by either."""
    command = [sys.executable, "-m", "scenarios.fold_rectangle"]
    where = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(CLONE)}}
    text = {"capture_output": True, "text": True, "check": False}
    done = subprocess.run([*command, "--help"], **text, **where)
    assert done.returncode == 0
    assert done.stdout.startswith("usage: python -m scenarios.fold_rectangle [-h] [DIR]")
    done = subprocess.run([*command, "--frobnicate"], **text, **where)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines() == [
        "python -m scenarios.fold_rectangle: unrecognized arguments: --frobnicate"
    ]
    assert not list(tmp_path.iterdir())


def test_fold_by_path_following():
    """At h/t = 1.6 the folds of the boundary-value problem lie at gamma = 2.7720 and 2.6137.

    128 edges are 1.2e-3 and 6.8e-4 rad off, falling as 1/N^2; the index is 1 just between them.
    """
    from scenarios.fold_by_path_following import first_fold, path, second_fold, unstable

    np.testing.assert_allclose(first_fold.gamma, 2.7719967717, atol=2e-3)
    np.testing.assert_allclose(second_fold.gamma, 2.6137181793, atol=2e-3)
    assert (unstable == 1).all()
    assert len(unstable) > 0
    assert path.mode.snapping == "snap-back"


def test_fold_by_angle_with_snap():
    """Up and down at h/t = 1.6 the ring snaps twice, and releases energy each time.

    0.5122738 and 0.1439666 GJ/a at 64 edges: differences of two equilibria at one gamma each.
    """
    from scenarios.fold_by_angle_with_snap import path, released

    np.testing.assert_allclose(released, [0.5122738, 0.1439666], atol=1e-6)
    assert path.gamma[-1] == 0.0


def test_fold_by_dynamic_relaxation():
    """At h/t = 4 forces alone lead to the three-covered ring, U = 4 pi alpha."""
    from scenarios.fold_by_dynamic_relaxation import path

    np.testing.assert_allclose(path.energy[-1], 4 * np.pi * 0.7715693320, atol=1e-6)
    assert path.mode.foldable
    assert path.timing.newton_iterations == 0


def test_fold_ellipse():
    """About x it folds, about y it does not; limits of M by the boundary-value problem.

    2.50010 and -0.26829, and M(pi) = 2.47484 about y: 128 edges are 2e-3, 4e-4 and 3e-3 off.
    """
    from scenarios.fold_ellipse import about_y, path

    limits = [limit.moment for limit in path.limits]
    np.testing.assert_allclose(limits, [2.50010419, -0.26829387], atol=3e-3)
    assert path.mode.foldable
    assert path.mode.stable
    np.testing.assert_allclose(about_y.at_pi.moment, 2.474836026, atol=4e-3)
    assert not about_y.mode.foldable


def test_fold_rectangle():
    """Folds of the boundary-value problem: 2.48830, 2.18039; 128 edges are 3.5e-3, 1.2e-3 off."""
    from scenarios.fold_rectangle import first_fold, path, second_fold

    np.testing.assert_allclose(first_fold.gamma, 2.488295037, atol=4e-3)
    np.testing.assert_allclose(second_fold.gamma, 2.180386018, atol=2e-3)
    assert path.mode.snapping == "snap-back"
    assert path.mode.stable


def test_fold_triangle():
    """Folds of the boundary-value problem: 1.215578 and 0.400086; 128 edges, 1.5e-4, 6e-4 off."""
    from scenarios.fold_triangle import first_fold, path, second_fold

    np.testing.assert_allclose(first_fold.gamma, 1.215578365, atol=3e-4)
    np.testing.assert_allclose(second_fold.gamma, 0.400085796, atol=1e-3)
    assert path.mode.foldable


def test_fold_by_dead_moment():
    """At h/t = 4 limits of 1.4787 going up and -0.0160 coming down; 128 edges are 1e-3 off."""
    from scenarios.fold_by_dead_moment import lower_limit, path, upper_limit

    np.testing.assert_allclose(upper_limit.moment, 1.4787, atol=2e-3)
    np.testing.assert_allclose(lower_limit.moment, -0.0160, atol=1e-3)
    assert path.gamma[-1] == 0.0


def test_hysteresis():
    """Four rings up and down: two snaps each, at the folds of the boundary-value problem.

    Energy conserved between snaps, so 4 times the loop integral of M dgamma is the sum of the
    releases, to the quadrature's 1e-5; every landing is a state of the path of equilibria, to
    1e-9 a (measured 2e-11): the first past both folds, the second before them.
    """
    from scenarios.hysteresis import loops

    folds = {
        "triangle_120": (2.754028657, 1.847603389),
        "triangle_90": (1.215578365, 0.400085796),
        "ellipse": (2.171790142, 2.046987264),
        "rectangle": (2.488295037, 2.180386018),
    }
    released = {"triangle_120": 14.286572, "triangle_90": 3.319654, "ellipse": 0.582251}
    released["rectangle"] = 2.443737
    for name, loop in loops.items():
        np.testing.assert_allclose([snap.gamma for snap in loop.snaps], folds[name], atol=4e-3)
        np.testing.assert_allclose(sum(loop.released), released[name], atol=1e-5)
        assert min(loop.released) > 0.0
        assert abs(loop.work - sum(loop.released)) < 2e-5
        assert max(landing.distance for landing in loop.landings) < 1e-9
        assert [landing.folds for landing in loop.landings] == [2, 0]


def test_picture_of_hysteresis(tmp_path):
    """Equilibria, loading and unloading of every ring, M above U; one row a state in the table."""
    from der.paper.hysteresis import write_loops
    from der.paper.hysteresis_plot import figure_of_loops
    from scenarios.hysteresis import loops

    figure = figure_of_loops(list(loops.values()))
    assert len(figure.axes) == 2 * len(loops)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "equilibria",
        "loading",
        "unloading",
        "end state of a snap",
    ]
    (first, *_) = loops.values()
    picture, table = write_loops([first], tmp_path)
    assert picture.read_bytes().startswith(b"\x89PNG")
    states = len(first.equilibria) + len(first.turned) + 1  # the top is on both ways
    assert len(table.read_text().splitlines()) == 1 + states


def test_three_ways_to_fall():
    """From ten folds three ways land in one state, to 1e-8 rad in every edge: minima, index 0.

    M of the circle's landing at h/t = 1.6 is 0.5271 at 64 edges, on the path of equilibria. Under
    a dead moment inertia makes a difference: the ellipse passes gamma = 1.981, and folds.
    """
    from scenarios.three_ways_to_fall import falls, overshoot

    assert len(falls) == 30
    assert max(fall.apart for fall in falls) < 1e-8
    assert all(fall.at.converged and set(fall.index) == {0} for fall in falls)
    np.testing.assert_allclose(falls[0].moment, 0.527103, atol=1e-6)
    np.testing.assert_allclose([overshoot["relax"], overshoot["flow"]], 1.980768, atol=1e-5)
    assert overshoot["move"] == np.pi


def test_landscape_push():
    """A strut that lifts a strand off the other two takes the barrier of twisting, 48 edges.

    The circle's saddle is the same with and without grips; two solves to 1e-10 apart.
    """
    from scenarios.landscape_push import lifted, twisting

    assert lifted.last.kind == "pass"
    np.testing.assert_allclose(lifted.last.work, twisting.open, atol=1e-9)
    assert lifted.dead.work < 0.7 * twisting.open
