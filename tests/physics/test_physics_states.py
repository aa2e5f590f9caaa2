"""States of free and gripped rings against closed forms."""

import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import der
from der.analysis.multistability.deflation import solved
from der.analysis.multistability.initial_guesses import covered, eight, gripped_starts
from der.analysis.multistability.states import Search
from der.analysis.multistability.symmetry_images import images
from der.analysis.multistability.transitions import descents
from der.analysis.request import ring_of
from der.rod.gripped_ring import free_supports, gripped_ring
from scenarios import states_of_natural_curvature as over_curvature
from scenarios.states_of_natural_curvature import continuum_index


@cache
def full(kappa0, bar, n_edges=64):
    """The full ring on its mesh."""
    return gripped_ring(der.circle(kappa0), bar, n_edges, name="full")


def known(free):
    """A verified state."""
    return solved(free, images(free.rod, free.supports, free.state.load))


def raw_index(free):
    """Index by the signs of the pivots alone."""
    return free.unpinned.count(free.state, "all")


def bisected(index, low, high, tolerance=1e-10):
    """Where an index changes between two values."""
    before = index(low)
    assert index(high) != before
    while high - low > tolerance:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if index(middle) == before else (low, middle)
    return 0.5 * (low + high)


def extrapolated(fine, coarse):
    """Limit from N and N/2 edges, and what is left: the next power of h^2 on a tenth of it."""
    limit = fine + (fine - coarse) / 3.0
    return limit, 0.1 * abs(fine - limit)


# --- The closed form of the index ------------------------------------------------------------


@pytest.mark.parametrize(
    ("n", "h_over_t", "below", "above"),
    [(3, 1.298935, 4, 2), (3, 3.469928, 2, 0), (2, 1.247757, 2, 0)],
)
def test_closed_form_has_the_known_thresholds_over_the_section(n, h_over_t, below, above):
    """kappa0 = 1, nu = 0.3: thresholds of the n-covered circle to their last digit."""
    bars = [der.rectangular_section(h_over_t + d) for d in (-1e-6, 1e-6)]
    assert [continuum_index(n, 1.0, bar.alpha, bar.beta) for bar in bars] == [below, above]


@pytest.mark.parametrize("kappa0", [2.666667, -1.777778])
def test_closed_form_has_the_known_thresholds_of_the_flat_ring(kappa0):
    """alpha 0.9, beta 2.5: (1 + y)(beta + y) = 4 beta, y = alpha (kappa0 - 1); and the flip."""
    inside, outside = (continuum_index(1, kappa0 * (1.0 + d), 0.9, 2.5) for d in (-1e-6, 1e-6))
    assert inside == 0
    assert outside > 0


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("h_over_t", [0.9, 1.6, 4.0])
def test_indices_of_covered_circles_are_the_closed_form(n, h_over_t):
    """kappa0 from -2 to 4, where 64 edges cannot be in doubt: thresholds are off by 2e-2."""
    bar = der.rectangular_section(h_over_t)
    seen = 0
    for kappa0 in np.arange(-2.0, 4.1, 0.5).tolist():
        near = {continuum_index(n, kappa0 + d, bar.alpha, bar.beta) for d in (-0.06, 0.0, 0.06)}
        if len(near) > 1:
            continue
        one = known(covered(full(kappa0, bar), n))
        assert one.free.index() == near.pop()
        assert one.energy == pytest.approx(math.pi * bar.alpha * (n - kappa0) ** 2, abs=1e-10)
        seen += 1
    assert seen >= 10


@pytest.mark.parametrize("n", over_curvature.COVERS)
def test_thresholds_over_natural_curvature_are_found_again(n):
    """h/t = 2, kappa0 from 0 to 4: errors fall as h^2, a tenth of that is left extrapolated."""
    exact, on_mesh = over_curvature.exact[n], over_curvature.on_mesh
    assert [len(on_mesh[edges][n]) for edges in (32, 64)] == [len(exact)] * 2
    assert exact
    for k, truth in enumerate(exact):
        limit, left = extrapolated(on_mesh[64][n][k], on_mesh[32][n][k])
        assert limit == pytest.approx(truth, abs=left)


@pytest.mark.parametrize(
    ("n", "low", "high", "truth"),
    [(3, 3.2, 3.7, 3.469928), (3, 1.25, 1.4, 1.298935), (2, 1.2, 1.35, 1.247757)],
)
def test_thresholds_over_the_section_are_found_again(n, low, high, truth):
    """kappa0 = 1, nu = 0.3."""

    def index(h_over_t, n_edges):
        return raw_index(covered(full(1.0, der.rectangular_section(h_over_t), n_edges), n))

    coarse, fine = (bisected(lambda h, N=N: index(h, N), low, high, 1e-8) for N in (64, 128))
    limit, left = extrapolated(fine, coarse)
    assert limit == pytest.approx(truth, abs=left)


@pytest.mark.parametrize(
    ("low", "high", "truth"), [(2.3, 3.0, 2.0 + 2.0 / 3.0), (-2.0, -1.5, -1.0 - 7.0 / 9.0)]
)
def test_the_flat_ring_buckles_and_flips_where_it_should(low, high, truth):
    """alpha 0.9, beta 2.5; the flip is a mode of the mesh as well and has no error at all."""

    def index(kappa0, n_edges):
        return raw_index(covered(full(kappa0, der.section(0.9, 2.5), n_edges), 1))

    coarse, fine = (bisected(lambda k, n=n: index(k, n), low, high) for n in (32, 64))
    limit, left = extrapolated(fine, coarse)
    assert limit == pytest.approx(truth, abs=max(left, 1e-8))


# --- Other shapes ----------------------------------------------------------------------------


@pytest.mark.parametrize("kappa0", [0.0, 1.5])
def test_energy_of_the_figure_eight(kappa0):
    """L times the integral of k^2 is 112.439610; natural curvature adds alpha pi kappa0^2.

    From 32, 64 and 128 edges by Romberg's scheme: the last stage changes the tenth digit.
    """
    bar = der.rectangular_section(4.0)
    values = [known(eight(full(kappa0, bar, n))).energy for n in (32, 64, 128)]
    once = [(4.0 * fine - coarse) / 3.0 for coarse, fine in pairwise(values)]
    limit = (16.0 * once[1] - once[0]) / 15.0
    truth = bar.alpha * (112.439610 / (4.0 * math.pi) + math.pi * kappa0**2)
    assert limit == pytest.approx(truth, abs=1e-6)
    assert [abs(v - limit) for v in values] == sorted(
        (abs(v - limit) for v in values), reverse=True
    )


def test_the_tilted_ring_lies_between_flat_and_flipped():
    """cos phi = -alpha kappa0/((beta - alpha) n): a state while it exists; it relaxes to both."""
    bar = der.section(0.9, 2.5)
    kappa0 = 1.0
    ring = full(kappa0, bar)
    cosine = -0.9 / 1.6
    one = known(covered(ring, 1, math.acos(cosine)))
    sine = math.sqrt(1.0 - cosine**2)
    exact = math.pi * (0.9 * (cosine - kappa0) ** 2 + 2.5 * sine**2)
    assert one.energy == pytest.approx(exact, abs=1e-10)
    index = one.free.index()
    found = descents(one, index, images_of(ring))
    ends = {round(descent.rests[-1].energy, 9) for descent in found}
    flipped = math.pi * 0.9 * (1.0 + kappa0) ** 2
    assert index >= 1
    assert ends == {0.0, round(flipped, 9)}


def images_of(ring):
    return images(ring.rod, free_supports(ring.rod), 0.0)


# --- The search ------------------------------------------------------------------------------


def test_states_of_the_ring_at_h_over_t_2():
    """Covers by energies pi alpha (n - 1)^2 and indices; at rest; descents lower the energy."""
    found, alpha = over_curvature.found, over_curvature.bar.alpha
    for name, n, index in (("flat", 1, 0), ("two-covered", 2, 0), ("three-covered", 3, 2)):
        assert found[name].energy == pytest.approx(math.pi * alpha * (n - 1) ** 2, abs=1e-10)
        assert (found[name].index, found[name].covering) == (index, n)
        assert found[name].needs_cut is (n == 2)
    assert found["flipped"].energy == pytest.approx(4.0 * math.pi * alpha, abs=1e-10)
    assert max(state.residual for state in found.states) < 1e-8
    assert found.falls_to("three-covered") == ("flat",)
    for fall in found.transitions:
        start, end = found[fall.start], found[fall.end]
        assert end.stable
        assert fall.released == pytest.approx(start.energy - end.energy, abs=1e-8)
        assert fall.released > 0.0
        assert start.needs_cut is end.needs_cut  # no motion changes that


def test_the_saddle_of_twisting_joins_the_flat_and_the_folded_ring():
    """At h/t = 4 the folded ring is a well of its own; over the saddle of twisting it opens."""
    found = der.states(der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=32), count=9)
    joins = [
        state
        for state in found.states
        if state.index == 1 and set(found.falls_to(state.name)) == {"flat", "three-covered"}
    ]
    assert len(joins) == 1
    assert joins[0].repeats == 2  # both arms alike
    assert found["three-covered"].stable


def test_deflation_finds_the_three_states_between_the_folds_from_one():
    """h/t = 1.6, gamma = 2.7, between the folds at 2.6137 and 2.7720: two stable, one not.

    The path knows them in its order, with all others that it passes; the search knows the first.
    """
    scene = der.Scene(der.circle(), der.rectangular_section(1.6))
    gamma = 2.7
    ring = ring_of(scene, "full")
    on_path = [known(free) for free in gripped_starts(scene, ring, gamma)][:3]
    search = Search(images(ring.rod, ring.supports, gamma), count=3)
    for _ in search.run(iter([on_path[0].free])):
        pass
    assert [one.energy for one in search.known] != [one.energy for one in on_path]
    np.testing.assert_allclose(
        sorted(one.energy for one in search.known),
        sorted(one.energy for one in on_path),
        atol=1e-9,
    )
    assert sorted(search.indices) == [0, 0, 1]
