"""Scenarios run on import; one physical number of each is pinned."""

import numpy as np


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
