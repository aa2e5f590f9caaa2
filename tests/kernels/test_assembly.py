"""The Lagrangian of a supported rod and its derivatives, each term alone."""

from typing import NamedTuple

import classical
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rods import Derivatives, derivatives, turned_all

from der.kernels.assembly import hold
from der.kernels.quaternions import rotation
from der.rod.rod import Rod, State, discrete_rod, edges, strains
from der.rod.supports import Supports, supported

MEASURES = ("logarithm", "angle", "tangent")
NEGLIGIBLE = 1e-30  # a stiffness that leaves the other terms alone
N = 5

# EI1, EI2, GJ, EA; position conditions, dead load
TERMS = {
    "EI1": ((1.3, NEGLIGIBLE, NEGLIGIBLE, NEGLIGIBLE), 0, 0.0),
    "EI2": ((NEGLIGIBLE, 4.1, NEGLIGIBLE, NEGLIGIBLE), 0, 0.0),
    "GJ": ((NEGLIGIBLE, NEGLIGIBLE, 0.9, NEGLIGIBLE), 0, 0.0),
    "EA": ((NEGLIGIBLE, NEGLIGIBLE, NEGLIGIBLE, 7.0), 0, 0.0),
    "forces": ((NEGLIGIBLE, NEGLIGIBLE, NEGLIGIBLE, NEGLIGIBLE), 3, 0.0),
    "pull": ((NEGLIGIBLE, NEGLIGIBLE, NEGLIGIBLE, NEGLIGIBLE), 0, 1.7),
    "all": ((1.3, 4.1, 0.9, 7.0), 3, 1.7),
}
ELASTIC = ("EI1", "EI2", "GJ", "all")
CASES = [
    pytest.param(term, measure, block, closed, id=f"{term}-{measure}-{block}-{ends}")
    for term in TERMS
    for measure in (MEASURES if term in ELASTIC else MEASURES[:1])
    for block in ((4,) if term == "EA" else (3, 4))
    for closed, ends in ((False, "open"), (True, "closed"))
]
EVERY_CASE = pytest.mark.parametrize(("term", "measure", "block", "closed"), CASES)
EVERY_MEASURE = pytest.mark.parametrize("measure", MEASURES)
BLOCKS = pytest.mark.parametrize("block", [3, 4])
OPEN_AND_CLOSED = pytest.mark.parametrize("closed", [False, True], ids=["open", "closed"])


class Problem(NamedTuple):
    """A rod, its supports and a state, bent, twisted and, with blocks of 4, stretched."""

    rod: Rod
    supports: Supports
    state: State

    def at(self, state: State) -> Derivatives:
        """Lagrangian's derivatives at a state."""
        return derivatives(self.rod, self.supports, state)


def problem(
    term: str, measure: str, block: int, closed: bool, *, grips: bool = False, seed: int = 0
) -> Problem:
    """Random rod with random natural strains, conditions, pulls and, where asked, turning grips."""
    rng = np.random.default_rng(seed)
    frames = classical.bent_and_twisted(rng, N, closed=closed)
    n_s = len(frames.ref_twist)
    (EI1, EI2, GJ, EA), n_c, load = TERMS[term]
    rod = discrete_rod(
        rng.uniform(0.5, 1.5, size=n_s),
        rng.uniform(-0.4, 0.4, size=(n_s, 3)),
        (EI1, EI2, GJ),
        stretching=EA if block == 4 else 0.0,
        measure=measure,
        closed=closed,
    )
    conditions = tuple(
        (rng.uniform(-1.0, 1.0, size=N), rng.normal(size=3), rng.normal()) for _ in range(n_c)
    )
    supports = supported(
        rod,
        clamped=(0, 1, N - 1) if grips else (),
        turn={0: 1.0, 1: -0.6, N - 1: -1.0} if grips else None,
        turn_axis=tuple(classical.unit(rng.normal(size=3))),
        held=conditions,
        pull=rng.normal(size=(N, 3)),
    )
    stretch = rng.uniform(-0.2, 0.2, size=N) if block == 4 else np.zeros(N)
    return Problem(
        rod, supports, State(classical.quaternions(frames), stretch, rng.normal(size=n_c), load)
    )


def lagrangian(it: Problem, state: State) -> float:
    """L from strains and edge vectors, as the docstring of assembly.py has it."""
    e = edges(it.rod, state)
    gap = np.einsum("kj,ji,ki->k", it.supports.weight, e, it.supports.axis) - it.supports.target
    return (
        strains(it.rod, state)[1].sum()
        + 0.5 * it.rod.stretching * it.rod.length @ state.stretch**2
        + state.force @ gap
        - state.load * np.sum(it.supports.pull * e)
    )


def displaced(state: State, q: np.ndarray) -> State:
    """``state`` with frames turned by q[:, :3] and, with blocks of 4, stretched by q[:, 3]."""
    stretch = state.stretch + q[:, 3] if q.shape[1] == 4 else state.stretch
    return state.but(quat=turned_all(state.quat, np.ascontiguousarray(q[:, :3])), stretch=stretch)


def loaded(it: Problem, dload: float) -> State:
    """State under more load: grips turned about the fixed axis, by SciPy."""
    w = it.supports.turn[:, None] * dload * it.supports.turn_axis
    return it.state.but(quat=classical.spun(it.state.quat, w), load=it.state.load + dload)


def dense(system: Derivatives, closed: bool) -> np.ndarray:
    """Hessian (n b, n b) of the blocks."""
    n, b, _ = system.diag.shape
    H = np.zeros((n, b, n, b))
    for j in range(n):
        H[j, :, j] += system.diag[j]
    for j in range(n if closed else n - 1):
        H[j, :, (j + 1) % n] += system.off[j]
        H[(j + 1) % n, :, j] += system.off[j].T
    return H.reshape(n * b, n * b)


def slopes(f, n: int, b: int) -> np.ndarray:
    """Differences of ``f`` (q) in each of the unknowns q (n, b), stacked first."""
    unknowns = np.eye(n * b).reshape(n * b, n, b)
    return np.array([classical.difference(lambda h, u=u: f(h * u)) for u in unknowns])


@EVERY_CASE
def test_gradient(term, measure, block, closed):
    """dL/dq against a stencil of fourth order, h = 1e-3.

    Its error is h^4/30 and 1e-16/h, some 1e-13 of the size of L: 1e-9 of the largest entry leaves
    room for an L larger than its gradient.
    """
    it = problem(term, measure, block, closed)
    grad = it.at(it.state).grad
    expected = slopes(lambda q: lagrangian(it, displaced(it.state, q)), N, block)
    assert_allclose(grad.ravel(), expected, rtol=0, atol=1e-9 * np.abs(grad).max())


@EVERY_CASE
def test_hessian(term, measure, block, closed):
    """Blocks of d2L/dq2 along q o exp(w/2) against differences of the gradient; 1e-9, as for it.

    The gradient at q o exp(w/2) is taken in the turned frames; the transposed right Jacobian of w
    brings it to the coordinates w.
    """
    it = problem(term, measure, block, closed)
    system = it.at(it.state)

    def gradient(q: np.ndarray) -> np.ndarray:
        g = it.at(displaced(it.state, q)).grad.copy()
        for j in range(N):
            g[j, :3] = classical.right_jacobian(q[j, :3]).T @ g[j, :3]
        return g.ravel()

    H = dense(system, closed)
    assert_allclose(H, slopes(gradient, N, block), rtol=0, atol=1e-9 * np.abs(H).max())


@EVERY_CASE
def test_diagonal_blocks_are_exactly_symmetric(term, measure, block, closed):
    """The index reads the signs of H, so it is symmetric by construction: to the last digit."""
    it = problem(term, measure, block, closed)
    diag = it.at(it.state).diag
    assert np.array_equal(diag, diag.swapaxes(1, 2))


@EVERY_CASE
def test_energy_is_the_elastic_part(term, measure, block, closed):
    """Bending, twisting and stretching, no work of forces; the same sums in another order."""
    it = problem(term, measure, block, closed)
    elastic = lagrangian(it, it.state.but(force=0.0 * it.state.force, load=0.0))
    assert it.at(it.state).energy == pytest.approx(elastic, rel=1e-14)


@BLOCKS
def test_gap_is_what_the_position_conditions_miss(block):
    """Sum_j weight_kj e_j . axis_k - target_k; a few roundings of a sum of five."""
    it = problem("all", "angle", block, closed=False)
    e = edges(it.rod, it.state)
    gap = np.einsum("kj,ji,ki->k", it.supports.weight, e, it.supports.axis) - it.supports.target
    assert_allclose(it.at(it.state).gap, gap, rtol=0, atol=2e-15)


@BLOCKS
def test_border_is_the_derivative_of_the_gap(block):
    """D gap/dq against a stencil of fourth order; 1e-11: h^4/30 and 1e-16/h of entries near 1."""
    it = problem("forces", "angle", block, closed=False)
    expected = slopes(lambda q: it.at(displaced(it.state, q)).gap, N, block)
    border = it.at(it.state).border.reshape(N * block, -1)
    assert_allclose(border, expected, rtol=0, atol=1e-11)


LOADED = pytest.mark.parametrize("term", ["EI1", "EI2", "GJ", "forces", "pull", "all"])


@LOADED
@BLOCKS
@OPEN_AND_CLOSED
def test_load_gradient(term, block, closed):
    """Generalised force dL/dload: grips turning about a skew axis and dead pull; 1e-9, as above.

    Two of the three turning edges are neighbours, at unequal rates.
    """
    it = problem(term, "angle", block, closed, grips=True)
    expected = classical.difference(lambda h: lagrangian(it, loaded(it, h)))
    assert it.at(it.state).load_grad == pytest.approx(expected, rel=1e-9)


@LOADED
@BLOCKS
@OPEN_AND_CLOSED
def test_load_hessian(term, block, closed):
    """d2L/dload2 against differences of dL/dload; 1e-9 of its size, or of the force's."""
    it = problem(term, "angle", block, closed, grips=True)
    system = it.at(it.state)
    expected = classical.difference(lambda h: it.at(loaded(it, h)).load_grad)
    assert system.load_hess == pytest.approx(expected, rel=1e-9, abs=1e-9 * abs(system.load_grad))


@LOADED
@BLOCKS
@OPEN_AND_CLOSED
def test_load_column(term, block, closed):
    """d2L/dq dload of the unknowns that are free, against differences of the gradient; 1e-9."""
    it = problem(term, "angle", block, closed, grips=True)
    system = it.at(it.state)
    free = it.supports.free
    expected = classical.difference(lambda h: it.at(loaded(it, h)).grad)
    size = max(np.abs(system.load_column[free]).max(), np.abs(system.grad[free]).max())
    assert_allclose(system.load_column[free], expected[free], rtol=0, atol=1e-9 * size)


@BLOCKS
def test_load_border(block):
    """D gap/dload of grips that turn; 1e-11 of entries near 1."""
    it = problem("all", "angle", block, closed=False, grips=True)
    expected = classical.difference(lambda h: it.at(loaded(it, h)).gap)
    assert_allclose(it.at(it.state).load_border, expected, rtol=0, atol=1e-11)


@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_rigid_rotation_leaves_the_elastic_derivatives(closed, measure):
    """Objectivity: energy, gradient and Hessian live in the frames; 1e-13 of the largest entry."""
    it = problem("EI1", measure, 3, closed)
    it = it._replace(rod=it.rod._replace(stiffness=np.array([1.3, 4.1, 0.9])))
    before = it.at(it.state)
    quat = classical.spun(it.state.quat, np.array([1.0, -2.0, 0.5]))
    after = it.at(it.state.but(quat=quat))
    for name in ("energy", "grad", "diag", "off"):
        one, other = np.asarray(getattr(before, name)), np.asarray(getattr(after, name))
        assert_allclose(other, one, rtol=0, atol=1e-13 * np.abs(one).max(), err_msg=name)


@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_sign_of_a_quaternion_says_nothing(closed, measure):
    """q and -q are one frame: every entry agrees to the last digit."""
    it = problem("all", measure, 4, closed, grips=True)
    sign = np.where(np.arange(N) % 2 == 0, -1.0, 1.0)[:, None]
    for one, other in zip(
        it.at(it.state), it.at(it.state.but(quat=sign * it.state.quat)), strict=True
    ):
        assert np.array_equal(one, other)


@EVERY_MEASURE
@OPEN_AND_CLOSED
def test_elastic_moments_balance(closed, measure):
    """A free rod's gradient has no net moment, as energy does not see rigid rotations: 1e-13."""
    it = problem("EI1", measure, 3, closed)
    it = it._replace(rod=it.rod._replace(stiffness=np.array([1.3, 4.1, 0.9])))
    grad = it.at(it.state).grad
    net = np.einsum("jik,jk->i", rotation(it.state.quat), grad)
    assert_allclose(net, np.zeros(3), rtol=0, atol=1e-13 * np.abs(grad).max())


@EVERY_MEASURE
@pytest.mark.parametrize("shift", [1, 3])
def test_renumbering_round_a_ring(shift, measure):
    """A ring is topology: rolled arrays give rolled derivatives; resummed: 1e-14."""
    it = problem("EI1", measure, 3, closed=True)
    rod = it.rod._replace(stiffness=np.array([1.3, 4.1, 0.9]))
    rolled = rod._replace(
        **{name: np.roll(getattr(rod, name), shift, axis=0) for name in ("cell", "length", "rest")}
    )
    before = it._replace(rod=rod).at(it.state)
    after = it._replace(rod=rolled).at(it.state.but(quat=np.roll(it.state.quat, shift, axis=0)))
    assert after.energy == pytest.approx(before.energy, rel=1e-14)
    for name in ("grad", "diag", "off"):
        one, other = np.roll(getattr(before, name), shift, axis=0), getattr(after, name)
        assert_allclose(other, one, rtol=0, atol=1e-14 * np.abs(one).max(), err_msg=name)


@EVERY_MEASURE
def test_straight_rod_has_a_finite_hessian(measure):
    """Phi = 0 at every vertex: the chain of springs K_k/cell, to a few roundings."""
    cell = np.array([0.5, 1.0, 2.0])
    rod = discrete_rod(cell, np.zeros(3), (1.3, 4.1, 0.9), measure=measure)
    start = State(np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)), np.zeros(4), np.zeros(0), 0.0)
    system = Problem(rod, supported(rod), start).at(start)
    for s in range(3):
        assert_allclose(system.off[s], -np.diag(rod.stiffness) / cell[s], rtol=0, atol=2e-15)
    assert_allclose(system.grad, np.zeros((4, 3)), rtol=0, atol=1e-15)


def bent_at(vertices: dict[int, float], axis: int, closed: bool) -> Problem:
    """Six edges in line but for turns [degrees] about one of their directors at some vertices."""
    n_s = 6 if closed else 5
    rod = discrete_rod(np.ones(n_s), np.zeros(n_s), (1.0, 1.0, 1.0), closed=closed)
    angle = np.cumsum([0.0, *(np.deg2rad(vertices.get(s, 0.0)) for s in range(5))])
    quat = np.zeros((6, 4))
    quat[:, 0], quat[:, 1 + axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return Problem(rod, supported(rod), State(quat, np.zeros(6), np.zeros(0), 0.0))


@pytest.mark.parametrize("axis", [0, 1, 2], ids=["d1", "d2", "twist"])
@pytest.mark.parametrize("vertex", [0, 3, 4])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turning_or_twisting_beyond_160_degrees_is_reported(axis, vertex, sign):
    """The vertex by its number, 0.1 degrees past the limit, and the first one where two are."""
    it = bent_at({vertex: sign * 160.1, 4: sign * 160.1}, axis, closed=False)
    assert it.at(it.state).bent_too_far == vertex


@pytest.mark.parametrize("axis", [0, 1, 2], ids=["d1", "d2", "twist"])
def test_turning_or_twisting_up_to_160_degrees_is_allowed(axis):
    """-1, no vertex, 0.1 degrees short of the limit at each."""
    it = bent_at(dict.fromkeys(range(5), 159.9), axis, closed=False)
    assert it.at(it.state).bent_too_far == -1


def test_closing_vertex_of_a_ring_is_reported():
    """Six edges, five vertices of 32.1 degrees and so one, the last, of 160.5 the other way."""
    it = bent_at(dict.fromkeys(range(5), 32.1), 0, closed=True)
    assert it.at(it.state).bent_too_far == 5


@BLOCKS
def test_hold_leaves_the_identity_where_nothing_moves(block):
    """Rows and columns of held unknowns are those of the identity, the others are untouched."""
    it = problem("all", "angle", block, closed=False, grips=True)
    it.supports.free[2, 1] = False
    system = it.at(it.state)
    diag, off, border = system.diag.copy(), system.off.copy(), system.border.copy()
    hold(it.supports.free, diag, off, border)
    free = it.supports.free.ravel()
    expected = np.where(np.outer(free, free), dense(system, closed=False), np.eye(N * block))
    assert np.array_equal(dense(system._replace(diag=diag, off=off), closed=False), expected)
    assert np.array_equal(border, np.where(it.supports.free[:, :, None], system.border, 0.0))
