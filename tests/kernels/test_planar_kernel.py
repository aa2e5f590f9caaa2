"""The rod in a plane: derivatives, the band of one unknown an edge, and the rod in space."""

import math

import numpy as np
import pytest
from shapes import crescent

import der
from der.analysis.landscape.actuators import struts
from der.analysis.request import ring_of
from der.continuation.arclength import follow
from der.continuation.events import Events
from der.errors import ContinuationFailed, Reason
from der.kernels.planar import PlanarRod, assemble_planar, negative_planar
from der.problem import Options
from der.rod.free_ring import balance
from der.rod.planar_ring import covered, eight, planar_ring, shapes
from der.rod.planar_system import PlanarRodSystem, solved

SECTION = der.rectangular_section(4.0)


def mesh(ring, n=32):
    return planar_ring(der.Scene(ring, SECTION, n_edges=n))


def some_rod(seed=1):
    """A triangle with a strut in it, whose natural angles change with the load, too."""
    rng = np.random.default_rng(seed)
    ring = mesh(der.triangle(math.radians(70), 0.05))
    rod = ring.strutted()._replace(rest_rate=rng.normal(size=32), closing=4.0 * math.pi)
    phi = np.append(covered(ring, 2), 1.0) + 0.2 * rng.normal(size=33)
    phi[0] = 0.0
    return rod, phi, rng.normal(size=4), 0.7


def lagrangian(rod, phi, force, load):
    system = assemble_planar(rod, phi, force, load)
    return system.energy + force @ system.gap


def differences(f, x, h=1e-6):
    """Central differences of ``f`` with respect to ``x`` (n,), a row for each entry."""
    steps = h * np.eye(len(x))
    return np.array([(f(x + e) - f(x - e)) / (2.0 * h) for e in steps])


# --- Derivatives -----------------------------------------------------------------------------


def test_gradient_is_that_of_the_lagrangian():
    """Angles, forces and load, by central differences; held angles are taken out."""
    rod, phi, force, load = some_rod()
    system = assemble_planar(rod, phi, force, load)
    grad = differences(lambda x: lagrangian(rod, x, force, load), phi)
    assert system.grad[0] == 0.0
    np.testing.assert_allclose(system.grad[1:], grad[1:], atol=1e-6)
    gap = differences(lambda x: lagrangian(rod, phi, x, load), force)
    np.testing.assert_allclose(system.gap, gap, atol=1e-8)
    rate = differences(lambda x: lagrangian(rod, phi, force, x[0]), np.array([load]))
    assert system.load_grad == pytest.approx(rate[0], abs=1e-6)


def test_hessian_is_that_of_the_gradient():
    """Band, border and the column of the load, by central differences of the gradient."""
    rod, phi, force, load = some_rod()
    system = assemble_planar(rod, phi, force, load)
    n = len(phi)
    band = np.diag(system.diag[:, 0, 0])
    for j in range(n - 1):
        band[j, j + 1] = band[j + 1, j] = system.off[j, 0, 0]
    hess = differences(lambda x: assemble_planar(rod, x, force, load).grad, phi)
    np.testing.assert_allclose(band[1:, 1:], hess[1:, 1:], atol=1e-5)
    border = differences(lambda x: assemble_planar(rod, phi, x, load).grad, force)
    np.testing.assert_allclose(system.border[:, 0].T, border, atol=1e-8)

    def of_load(name):
        return differences(
            lambda x: getattr(assemble_planar(rod, phi, force, x[0]), name), np.array([load])
        )[0]

    np.testing.assert_allclose(system.load_column[:, 0], of_load("grad"), atol=1e-6)
    np.testing.assert_allclose(system.load_border, of_load("gap"), atol=1e-8)
    assert system.load_hess == pytest.approx(of_load("load_grad"), rel=1e-8)


def test_tangent_leads_along_the_path():
    """The next state, its load given, lies on the tangent, to second order of the step."""
    ring = mesh(der.ellipse(0.6))
    rod = ring.strutted()
    flat = solved(ring.rod(1), covered(ring, 1), np.zeros(2))
    first = float(ring.chord() @ (ring.length * np.sin(flat.phi)))
    at = solved(rod, np.append(flat.phi, 0.5 * math.pi), np.zeros(4), 0.8 * first)
    assert at.converged
    step = 1e-4
    there = solved(rod, at.phi, at.force, at.parameter + step)
    rate = step / at.parameter_rate
    jump = PlanarRodSystem(rod).difference(at.state, there.state)
    np.testing.assert_allclose(jump[:33], rate * at.tangent[:33], atol=1e-6)
    moment_rate = at.observables["moment"][1]
    assert there.moment - at.moment == pytest.approx(rate * moment_rate, rel=1e-3)
    assert there.energy - at.energy == pytest.approx(0.5 * step * (at.moment + there.moment), 1e-6)


# --- The rod in space ------------------------------------------------------------------------


@pytest.mark.parametrize("ring", [der.circle(), der.triangle(math.radians(50), 0.1)])
def test_a_squeezed_ring_is_that_of_the_rod_in_space(ring):
    """Energy and force of both, to rounding: one is the other with two of three angles zero."""
    scene = der.Scene(ring, SECTION, n_edges=32)
    here = planar_ring(scene)
    flat = solved(here.rod(1), covered(here, 1), np.zeros(2))
    first = float(here.chord() @ (here.length * np.sin(flat.phi)))
    rod, half = here.strutted(), 0.5 * math.pi
    middle = solved(rod, np.append(flat.phi, half), np.append(flat.force, [0, 0]), 0.9 * first)
    plane = solved(rod, middle.phi, middle.force, 0.8 * first)
    full = ring_of(scene, "full")
    start = balance(full.rod, full.start.quat, full.start.stretch)
    actuator = struts(start, (0, 16))[-1]
    state = actuator.start
    for share in (0.1, 0.2):
        there = actuator.first - (1.0 - share) * first
        space = actuator.system.correct(state.but(load=there))
        state = space.state
    assert plane.converged
    assert space.converged
    assert SECTION.alpha * plane.energy == pytest.approx(space.energy, rel=1e-11)
    assert SECTION.alpha * plane.moment == pytest.approx(-space.moment, rel=1e-11)


def test_shapes_are_those_of_the_flat_ring():
    """Frames sit where the ring says, to the mesh's error; normals point outwards."""
    ring = der.rectangle(0.5, 0.2)
    here = mesh(ring, 128)
    at = solved(here.rod(1), covered(here, 1), np.zeros(2))
    found = shapes(here, [at.phi])
    x = found.x[0]
    middle = x - 0.5 * here.cell[:, None] * found.frames[0, :, 2]  # where frames sit
    assert np.abs(middle - ring.position(here.places[:-1])).max() < 1e-3
    assert np.all(np.sum(found.frames[0, :, 1] * middle, axis=1) > 0.0)
    np.testing.assert_allclose(np.linalg.det(found.frames[0]), 1.0)


# --- Newton and the path ---------------------------------------------------------------------


def test_one_unknown_an_edge():
    """Blocks of a single entry, and no edge more than the ring has and the strut."""
    here = mesh(der.circle(), 16)
    for rod, n in ((here.rod(1), 16), (here.strutted(), 17)):
        system = assemble_planar(rod, np.zeros(n), np.zeros(2 * len(rod.weight)), 1.0)
        assert system.diag.shape == system.off.shape == (n, 1, 1)


def test_an_eight_shifts_at_no_cost():
    """One eigenvalue within 1e-6 of the others, found by shifts to either side."""
    here = mesh(der.circle(), 64)
    phi = eight(here, 0.1)
    at = solved(here.rod(0), phi, np.zeros(2))
    counts = [negative_planar(here.rod(0), at.phi, at.force, 0.0, s) - 2 for s in (1e-6, -1e-6)]
    assert at.converged
    assert counts == [0, 1]


def test_too_few_edges_are_named():
    """A vertex that turns by more than 160 degrees is refused, and named."""
    here = mesh(der.circle(), 8)
    at = solved(here.rod(5), covered(here, 5), np.zeros(2))
    assert at.reason is Reason.OUT_OF_RANGE
    assert at.detail.startswith("vertex ")
    assert "use more edges" in at.advice


def softening(k=1.0):
    """A vertex of stiffness k between an edge that is held and one that is free.

    Its natural angle is the load; nothing is said about places.
    """
    return PlanarRod(
        np.array([k, 0.0]),
        np.zeros(2),
        np.array([1.0, 0.0]),
        0.0,
        np.array([0.0, 1.0]),
        np.zeros(2),
        np.array([0.0, 1.0]),
        np.zeros((0, 2)),
        np.array([False, True]),
    )


def test_a_linear_spring_follows_its_load():
    """phi = load, without energy: what the kernels say of the least rod there is."""
    at = solved(softening(), np.zeros(2), np.zeros(0), 0.5)
    assert at.reason is Reason.CONVERGED
    assert at.phi[1] == pytest.approx(0.5, abs=1e-14)
    *_, last = to_goal(PlanarRodSystem(softening()), at, 1.0)
    assert last.solution.parameter == 1.0
    assert last.solution.energy == pytest.approx(0.0, abs=1e-20)


def to_goal(system, start, goal, **options):
    """Points of the path from a state to a load above its own."""
    events = Events(
        targets=(goal,),
        stop=lambda at: at.parameter == goal,
        limits=("moment",),
        stability=True,
    )
    steps = Options(first_step=0.02, largest_step=0.08, sharpest_turn=0.45, **options)
    return follow(system, start.state, events, options=steps)


def pulled(ring, n, goal, **options):
    """Rod and path of a flat ring whose points are drawn apart, to so many a."""
    here = mesh(ring, n)
    flat = solved(here.rod(1), covered(here, 1), np.zeros(2))
    first = float(here.chord() @ (here.length * np.sin(flat.phi)))
    force = np.append(flat.force, [0.0, 0.0])
    start = solved(here.strutted(), np.append(flat.phi, 0.5 * math.pi), force, first)
    return here.strutted(), to_goal(PlanarRodSystem(here.strutted()), start, goal, **options)


def eigenvalues(rod, at):
    """Of the Hessian among changes that keep the ring closed and the points apart, dense."""
    system = assemble_planar(rod, at.phi, at.force, at.parameter)
    band = np.diag(system.diag[:, 0, 0])
    band += np.diag(system.off[:-1, 0, 0], 1) + np.diag(system.off[:-1, 0, 0], -1)
    free = np.linalg.qr(system.border[1:, 0], mode="complete")[0][:, len(at.force) :]
    return np.linalg.eigvalsh(free.T @ band[1:, 1:] @ free)


def test_index_and_special_points_are_those_of_dense_matrices():
    """A thin crescent pulled open: all kinds of points, where the Hessian and rates say they are.

    Its symmetry breaks and is mended (branch points: an eigenvalue is zero, the distance goes on),
    the force has two limits, and between them the distance turns back and forth again.
    """
    rod, path = pulled(crescent(0.01, 2.5), 256, 1.6)
    points = list(path)
    special = [point.kind for point in points if point.kind]
    assert special == ["branch", "limit", "fold", "fold", "branch", "limit"]
    force = np.array([point.solution.moment for point in points])
    for point in points[::8]:
        if not point.kind:
            at = point.solution
            assert point.index == (at.index,)
            assert at.index == np.sum(eigenvalues(rod, at) < 0.0)
    for k, point in enumerate(points):
        if not point.kind:
            continue
        at = point.solution
        gone = np.abs(eigenvalues(rod, at)).min() < 1e-6
        assert gone == (point.kind != "limit")
        if point.kind == "fold":
            assert abs(at.parameter_rate) < 1e-6
        if point.kind == "limit":
            assert point.sides is None
            assert abs(at.observables["moment"][1]) < 1e-5 * np.abs(force).max()
            assert (force[k - 1] - force[k]) * (force[k + 1] - force[k]) > 0.0
        else:
            (before,), (after,) = point.sides
            assert abs(after - before) == 1


def test_a_path_that_does_not_arrive_says_so():
    """In a sentence with the number of steps, and by its reason."""
    with pytest.raises(ContinuationFailed, match="not ended after 3 steps") as caught:
        list(pulled(crescent(0.05), 64, 1.0, max_steps=3)[1])
    assert caught.value.reason is Reason.TOO_MANY_STEPS
