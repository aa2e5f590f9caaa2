"""Work along a path: closed forms of a curve that turns back, and a path of the rod."""

import math
from dataclasses import replace

import numpy as np

import der
from der.analysis.work import work, work_missing


def test_work_of_a_curve_with_folds_is_the_integral_of_its_parametrisation():
    """Of gamma = t - 2 t^2 + t^3, M = 1 + t^2: 4 (t - 2 t^2 + 4/3 t^3 - t^4 + 3/5 t^5).

    gamma turns back at t = 1/3 and on again at t = 1; the spline's error falls like h^4.
    """
    t = np.linspace(0.0, 2.0, 401)
    gamma, moment = t - 2 * t**2 + t**3, 1 + t**2
    exact = 4 * (t - 2 * t**2 + 4 / 3 * t**3 - t**4 + 3 / 5 * t**5)
    np.testing.assert_allclose(work(gamma, moment), exact, atol=1e-6)


def test_a_state_that_is_there_twice_counts_once():
    """As at a fold that is also a state asked for."""
    gamma = np.linspace(0.0, math.pi, 101)
    twice = np.insert(gamma, 50, gamma[50])
    done = work(twice, np.sin(twice))
    np.testing.assert_allclose(done[50], done[51], atol=0.0)
    np.testing.assert_allclose(done, 4 * (1 - np.cos(twice)), atol=1e-6)


def test_energy_of_a_folded_ring_is_the_work_done_on_it():
    """dU = 4 M dgamma; energy that is wrong by 1 % is noticed."""
    gammas = tuple(np.linspace(0.0, math.pi, 65).tolist())
    section = der.rectangular_section(4.0)
    path = der.fold(der.Scene(der.circle(), section, n_edges=32, save_at=gammas))
    assert work_missing(path) < 1e-4
    assert work_missing(replace(path, energy=1.01 * path.energy)) > 5e-3
