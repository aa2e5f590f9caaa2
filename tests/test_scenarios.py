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
