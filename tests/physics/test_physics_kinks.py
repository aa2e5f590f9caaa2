"""Rings whose natural curvature has kinks: error bars hold at every resolution.

Right values: the boundary-value problem, whose mesh points sit on every kink, to 1e-10; where a
ring lies in its plane, `der.packing_ratio` and the elastica on 2,048 edges, extrapolated.
"""

import math

import numpy as np
import pytest
from shapes import kinked, scene, through_points

import der
from der.analysis.compare import compare

FORCES = {"kinks": -3.602950948, "ellipse of 8": -3.236259779, "three lobes of 24": -4.807870834}


def ellipse_of_8() -> der.Ring:
    """Return the spline through 8 points of an ellipse of semi-axes 1 and 0.6."""
    theta = math.pi * np.arange(8) / 4
    return der.profile(points=np.column_stack([np.sin(theta), -0.6 * np.cos(theta)]))


def three_lobes(count: int) -> der.Ring:
    """Return the spline through points of r = 1 + 0.1 cos 3 theta."""
    return through_points(count, lambda theta: 1.0 + 0.1 * np.cos(3.0 * theta))


RINGS = {
    "kinks": kinked(),
    "ellipse of 8": ellipse_of_8(),
    "three lobes of 24": three_lobes(24),
}


@pytest.mark.parametrize("n_edges", [64, 128, 256, 512])
def test_error_bars_of_a_kinked_ring_hold_at_every_resolution(n_edges):
    """h/t = 4: 100 % of the states; limits at gamma = 0.65359089 and 2.87109442."""
    wants = {"n_edges": n_edges, "error_bars": True, "stability": False, "self_crossings": False}
    found = compare(scene(kinked(), 4.0, **wants))
    assert (found.within, found.unmatched) == (1.0, 0)
    assert [pair.bvp_gamma for pair in found.pairs] == pytest.approx([0.65359089, 2.87109442])
    assert all(pair.difference <= pair.bar for pair in found.pairs)


def test_extrapolated_values_of_a_kinked_ring_are_of_order_six():
    """M at gamma = pi/2 on 64, 128 and 256 edges."""
    errors = []
    reference = der.solve_bvp(scene(kinked(), 4.0, save_at=(0.5 * math.pi,)), tolerance=1e-11)
    right = reference.moment[reference.gamma.tolist().index(0.5 * math.pi)]
    for n_edges in (64, 128, 256):
        wants = {"n_edges": n_edges, "error_bars": True, "stability": False}
        path = der.fold(scene(kinked(), 4.0, save_at=(0.5 * math.pi,), **wants))
        errors.append(abs(path.moment[path.gamma.tolist().index(0.5 * math.pi)] - right))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 5.0)


@pytest.mark.parametrize("n_edges", [64, 128, 256])
@pytest.mark.parametrize("name", ["ellipse of 8", "three lobes of 24"])
def test_error_bars_of_rings_through_points_hold(name, n_edges):
    """More kinks than cells: 95 % of the states and every limit."""
    wants = {"n_edges": n_edges, "error_bars": True, "stability": False, "self_crossings": False}
    found = compare(scene(RINGS[name], 4.0, **wants))
    assert found.within >= 0.95
    assert all(pair.difference <= pair.bar for pair in found.pairs)


@pytest.mark.parametrize("n_edges", [128, 256])
@pytest.mark.parametrize("name", RINGS)
def test_a_kinked_ring_in_its_plane(name, n_edges):
    """The force at a distance of 0.6 and the packing ratio lie within their error bars."""
    statement = scene(RINGS[name], 4.0, n_edges=n_edges, error_bars=True)
    path = der.squeeze(statement, 0.6)
    assert abs(path.force[-1] - FORCES[name]) <= path.force_error[-1] + 1e-8
    shapes = [state for state in der.planar(statement).states if state.turning == 3]
    right = der.packing_ratio(RINGS[name])
    assert min(abs(one.packing - right) - one.packing_error for one in shapes) <= 1e-8
