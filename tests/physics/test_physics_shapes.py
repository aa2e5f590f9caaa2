"""Rings of every shape against their boundary-value problem: curves, folds, orders, error bars."""

import math

import numpy as np
import pytest
from shapes import egg

import der
from der.analysis.curve_distance import ReferenceCurve, curve_error
from validation import compare, solve

R, DEGREE = der.rectangular_section, math.pi / 180
TRIANGLES = {
    60: der.triangle(60 * DEGREE, math.sqrt(3) / 12),
    90: der.triangle(90 * DEGREE, 1 / 30),
    120: der.triangle(120 * DEGREE, 1 / 15),
}
# every curve that the paper shows: Figs. 2, 4, 7, 10, 11, D.1
CURVES = [
    *((der.circle(), h) for h in (1.0, 1.6, 2.0, 4.0, 8.0)),
    *((der.ellipse(0.6, axis), h) for axis in "xy" for h in (1.0, 2.0, 4.0)),
    (der.ellipse(0.85, "y"), 4.0),
    *((der.rectangle(0.6, 0.3, axis), h) for axis in "xy" for h in (1.0, 2.0, 4.0)),
    *((TRIANGLES[angle], h) for angle in (60, 120) for h in (1.0, 2.0, 4.0)),
    (TRIANGLES[90], 4.0),
]
ORDERS = {
    "ellipse x": (der.ellipse(0.6), 4.0),
    "ellipse y": (der.ellipse(0.85, "y"), 4.0),
    "rectangle": (der.rectangle(0.6, 0.3), 4.0),
    "square": (der.rectangle(1.0, 0.3), 4.0),
    "stadium": (der.rectangle(0.5, 0.5), 4.0),
    "triangle 60": (TRIANGLES[60], 4.0),
    "triangle 90": (TRIANGLES[90], 4.0),
    "triangle 120": (TRIANGLES[120], 1.0),
}
MESHES = (64, 128, 256)


def reference(ring: der.Ring, h_over_t: float) -> ReferenceCurve:
    """Return the curve of the boundary-value problem, through 201 states and what lies between.

    States within 2e-4 of the one before, as folds and limits may be, make no good knots.
    """
    scene = der.Scene(ring, R(h_over_t), save_at=tuple(np.linspace(0.0, math.pi, 201)))
    path = solve(scene)
    columns = (path.gamma, path.moment, path.energy)
    scaled = np.column_stack([c / np.abs(c).max() for c in columns])
    kept = [0]
    for k in range(1, len(path)):
        if np.linalg.norm(scaled[k] - scaled[kept[-1]]) > 2e-4:
            kept.append(k)
    folds = tuple(fold.gamma for fold in path.folds)
    return ReferenceCurve(*(c[kept] for c in columns), np.empty((len(kept), 0)), folds)


def order(errors: list[float]) -> float:
    """Fitted power of 1/N."""
    return float(-np.polyfit(np.log(MESHES), np.log(errors), 1)[0])


@pytest.mark.parametrize("case", ORDERS)
def test_curves_and_folds_converge_with_the_square_of_the_edges(case):
    """Largest normal distance of the path in (gamma, M) and (gamma, U), and every fold.

    Order 2 +- 0.15 over N = 64, 128, 256: frames sit on all joints, cells are nested, so that
    errors have even powers of 1/N. (Where M turns a sharp corner the distance of a coarse curve
    saturates: the rectangle about y at h/t = 4 has 1.78 over these N, and 1.99 at its folds.)
    """
    ring, h_over_t = ORDERS[case]
    exact = reference(ring, h_over_t)
    errors, folds = [], []
    for n_edges in MESHES:
        path = der.fold(
            der.Scene(ring, R(h_over_t), n_edges=n_edges, stability=False, self_crossings=False)
        )
        errors.append(curve_error(path.gamma, path.moment, path.energy, exact))
        assert len(path.folds) == len(exact.folds)
        folds.append([abs(a.gamma - b) for a, b in zip(path.folds, exact.folds, strict=True)])
    measured = [order(list(e)) for e in (*zip(*errors, strict=True), *zip(*folds, strict=True))]
    np.testing.assert_allclose(measured, 2.0, atol=0.15)


@pytest.mark.parametrize(
    ("ring", "h_over_t"), CURVES, ids=[f"{ring} {h:g}"[5:] for ring, h in CURVES]
)
def test_every_curve_of_the_paper_agrees_within_its_error_bars(ring, h_over_t):
    """128 edges, extrapolated: distance <= 3e-4, folds within 5e-4 rad, 95 % inside their bars.

    Measured: all inside; distances of 4e-9 to 1e-5 but for one state of 1.4e-4 that has no bar and
    is not extrapolated (triangle 120 degrees, h/t = 1, at pi); folds 7e-9 to 1e-5 rad.
    """
    scene = der.Scene(ring, R(h_over_t), n_edges=128, error_bars=True, stability=False)
    found = compare(scene, der.fold(scene))
    assert found.unmatched == 0
    assert max(found.largest) <= 3e-4
    assert found.within >= 0.95
    folds = [pair.difference for pair in found.pairs if pair.kind == "fold"]
    assert max(folds, default=0.0) <= 5e-4


def test_points_along_an_ellipse_fold_like_the_ellipse():
    """A user's 128 points, joined by splines: the curve is that of the shape to 1e-4 of its size.

    The spline's curvature is off by O(1/128^2).
    """
    t = np.arange(128) * math.pi / 64
    drawn = der.profile(points=np.column_stack([np.sin(t), -0.6 * np.cos(t)]))
    ours, exact = (der.fold(der.Scene(ring, R(4.0))) for ring in (drawn, der.ellipse(0.6)))
    gamma = np.arange(1, 9) * math.pi / 8
    for name in ("moment", "energy"):
        a, b = (
            [getattr(path, name)[path.gamma.tolist().index(g)] for g in gamma]
            for path in (ours, exact)
        )
        np.testing.assert_allclose(a, b, atol=2e-3 * np.abs(b).max())
    assert ours.mode == exact.mode


def test_a_user_s_profile_folds_as_its_boundary_value_problem_says():
    """An egg at h/t = 4 folds into three loops; distances fall as 1/N^2 from 256 to 512 edges.

    Both meshes have their nodes on the points, where its curvature has kinks.

    A planar ring that covers itself three times has M = 0 at gamma = pi (paper, Eq. B.1).
    """
    errors = []
    for n_edges in (256, 512):
        scene = der.Scene(egg(), R(4.0), n_edges=n_edges, self_crossings=False)
        path = der.fold(scene)
        assert path.mode is not None
        assert path.mode.foldable
        assert abs(path.at_pi.moment) < 1e-6
        errors.append(compare(scene, path, tolerance=1e-6).largest)
    assert np.log2(np.divide(*errors)) == pytest.approx(2.0, abs=0.15)
