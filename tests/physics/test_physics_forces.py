"""Forces and moments: balance along the rod and at the grips, and the other solver's values."""

import math
from dataclasses import replace

import numpy as np
import pytest

import der
from tests.shapes import egg, scene

WANTED = {"forces": True, "shapes": True, "stability": False, "self_crossings": False}
RINGS = {"circle": der.circle(), "bent": der.circle(0.3), "egg": egg()}


def solved(ring, **more):
    return der.fold(scene(ring, 4.0, save_at=(1.0, 2.0), gamma_max=2.0, **WANTED | more))


def at_one(path):
    """Position of the state at gamma = 1."""
    return path.gamma.tolist().index(1.0)


@pytest.mark.parametrize("stretch", ["inextensible", "finite"])
@pytest.mark.parametrize("sector", ["auto", "full"])
@pytest.mark.parametrize("name", RINGS)
def test_every_free_edge_is_in_balance(name, sector, stretch):
    """m_j - m_(j-1) + e_j x F = 0 on every edge between two vertices, to the path's tolerance.

    The grips hold edges 0 and N/2; no other load acts on the ring.
    """
    path = solved(RINGS[name], sector=sector, stretch=stretch, a_over_t=30.0, n_edges=32)
    inside, x = path.shapes.internal, path.shapes.x
    edges = x - np.roll(x, 1, axis=1)
    rest = inside.moment - np.roll(inside.moment, 1, axis=1) + np.cross(edges, inside.force)
    assert np.abs(np.delete(rest, [0, 16], axis=1)).max() < 1e-9
    assert np.abs(inside.moment).max() > 1.0
    if stretch == "finite":  # EA times the strain is the tension
        tension = np.einsum("kni,kni->kn", inside.force, path.shapes.frames[:, :, 2])
        stiffness = 12.0 * path.section["alpha"] * 30.0**2
        free = np.delete(np.arange(32), [0, 16])
        np.testing.assert_allclose(
            stiffness * inside.stretch[:, free], tension[:, free], rtol=1e-8, atol=1e-9
        )


@pytest.mark.parametrize("name", RINGS)
def test_a_grip_carries_the_torque_of_two_arms_and_no_force(name):
    """About E3 the grips exert +2M and -2M; all else cancels in a ring symmetric about E3.

    M is defined by work, (1/4) dU/dgamma: no force enters there. The grips slide: F . E3 = 0.
    """
    path = solved(RINGS[name], sector="full", n_edges=32)
    torque = np.zeros((len(path), 2, 3))
    torque[:, 0, 2], torque[:, 1, 2] = 2.0 * path.moment, -2.0 * path.moment
    np.testing.assert_allclose(path.forces.grip_moment, torque, atol=1e-9)
    assert np.abs(path.forces.grip_force).max() < 1e-9
    assert np.abs(path.forces.arm_force[:, :, 2]).max() < 1e-9
    assert np.abs(path.forces.arm_force).max() > 0.1


@pytest.mark.parametrize("name", RINGS)
def test_forces_do_not_depend_on_the_sector(name):
    """A half-turn maps the ring on itself with its sense reversed."""
    one, full = (solved(RINGS[name], sector=sector, n_edges=32) for sector in ("auto", "full"))
    for entry in ("grip_force", "grip_moment", "arm_force", "arm_moment"):
        values = [getattr(path.forces, entry)[at_one(path)] for path in (one, full)]
        np.testing.assert_allclose(*values, atol=1e-8)
    for entry in ("force", "moment", "curvature", "stretch"):
        values = [getattr(path.shapes.internal, entry)[at_one(path)] for path in (one, full)]
        np.testing.assert_allclose(*values, atol=1e-8)


@pytest.mark.parametrize("name", RINGS)
def test_forces_converge_to_those_of_the_boundary_value_problem(name):
    """Differences fall by four with the edges' length; extrapolated they all but vanish.

    There F and m are unknowns of the equations themselves.
    """
    exact = der.solve_bvp(
        scene(RINGS[name], 4.0, save_at=(1.0,), gamma_max=1.0, forces=True), tolerance=1e-10
    )
    there = at_one(exact)
    sizes = (256, 512) if name == "egg" else (128, 256)  # with nodes on all of its points
    paths = [solved(RINGS[name], n_edges=n) for n in sizes]
    for entry in ("grip_moment", "arm_force", "arm_moment"):
        coarse, fine = (getattr(path.forces, entry)[at_one(path)] for path in paths)
        right = getattr(exact.forces, entry)[there]
        ratio = np.linalg.norm(coarse - right) / np.linalg.norm(fine - right)
        assert ratio == pytest.approx(4.0, rel=0.02)
        extrapolated = (4.0 * fine - coarse) / 3.0
        assert np.abs(extrapolated - right).max() < 0.02 * np.abs(fine - right).max()


def test_what_is_inside_is_that_of_the_boundary_value_problem():
    """Force, moment and curvatures at the same vertices of both solvers, to second order."""
    differences, ring = [], der.ellipse(0.6)
    for n in (64, 128):
        rod = solved(ring, n_edges=n)
        other = der.solve_bvp(scene(ring, 4.0, n_edges=n, save_at=(1.0,), gamma_max=1.0, **WANTED))
        pairs = [
            [getattr(path.shapes.internal, name)[at_one(path)] for path in (rod, other)]
            for name in ("force", "moment", "curvature")
        ]
        differences.append([np.abs(one - two).max() for one, two in pairs])
    coarse, fine = differences
    assert np.all(np.array(fine) < 0.01)
    np.testing.assert_allclose(np.divide(coarse, fine), 4.0, rtol=0.15)


def test_a_flat_ring_that_was_bent_carries_a_moment_alone():
    """A circle of natural curvature 0.3 closed to 1: m = alpha (1 - 0.3) d1 everywhere, F = 0.

    d1 of a flat ring is normal to its plane: E1.
    """
    path = solved(RINGS["bent"])
    moment = 0.7 * path.section["alpha"]
    np.testing.assert_allclose(path.shapes.internal.force[0], 0.0, atol=1e-9)
    expected = np.broadcast_to([moment, 0.0, 0.0], path.shapes.internal.moment[0].shape)
    np.testing.assert_allclose(path.shapes.internal.moment[0], expected, atol=1e-9)
    np.testing.assert_allclose(path.shapes.internal.curvature[0, :, 0], 1.0, rtol=1e-12)


def test_forces_come_back_from_files(tmp_path):
    """Bit for bit: those of grips and arms from the record, what is inside from the shapes."""
    path = solved(RINGS["circle"], n_edges=16)
    again = der.Path.from_json(path.to_json())
    assert again.to_json() == path.to_json()
    path.shapes.save(tmp_path / "shapes.npz")
    kept = der.Shapes.load(tmp_path / "shapes.npz").internal
    for name in ("force", "moment", "curvature", "stretch"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(path.shapes.internal, name))


def test_forces_of_another_number_of_states_are_refused():
    """The entry is named."""
    path = solved(RINGS["circle"], n_edges=16)
    few = replace(path.forces, arm_force=path.forces.arm_force[1:])
    with pytest.raises(ValueError, match=r"forces.arm_force has \d+ entries, gamma has \d+"):
        replace(path, forces=few)


# --- With units --------------------------------------------------------------------------------


def hexagon(corners):
    """Return a rounded hexagon of circumradius 1, fillets 0.2, grips on corners or on sides."""
    arc, straight = 0.2 * math.pi / 3, 1.0 - 0.4 * math.tan(math.pi / 6)
    pieces = [(straight, 0.0), (arc, 5.0)] * 6
    if corners:
        pieces = [(arc, 5.0), (straight, 0.0)] * 6
    length, _ = pieces[0]
    pieces = [(length / 2, pieces[0][1]), *pieces[1:], (length / 2, pieces[0][1])]
    ends = np.append(0.0, np.cumsum([length for length, _ in pieces]))
    return der.profile(np.repeat(ends, 2)[1:-1], np.repeat([k for _, k in pieces], 2))


@pytest.mark.parametrize(
    ("corners", "largest", "gamma", "newton_mm", "foldable"),
    [
        (True, 2.0296708, 2.8814, 82.1744, False),
        (False, 1.45892, 0.7628, 59.0668, True),
    ],
)
def test_a_rounded_hexagon_of_plastic(corners, largest, gamma, newton_mm, foldable):
    """Circumradius a = 100 mm, fillets 20 mm, E = 3.5 GPa, nu = 0.35, a strip of 10 mm by 1 mm.

    A case that users brought, with the largest M over 0 to pi. GJ/a = 40.4866 N mm with
    J = 0.312325 h t^3 (Timoshenko and Goodier: 0.312 for h/t = 10); with the thin strip's
    (1 - 0.63 t/h)/3 of tables it is 40.488, and the largest M is 82.18 N mm.
    """
    bar = {"young": "3.5GPa", "height": "10mm", "thickness": "1mm", "size": "100mm", "nu": 0.35}
    made = der.dimensional(**bar, units="N,mm")
    path = der.solve_bvp(der.Scene(hexagon(corners), **made))
    top = max(path.limits, key=lambda point: point.moment)
    assert top.moment == pytest.approx(largest, abs=1e-5)
    assert top.gamma == pytest.approx(gamma, abs=1e-4)
    factor, unit = path.scale.unit("moment")
    assert (factor * top.moment, unit) == (pytest.approx(newton_mm, abs=1e-3), "N mm")
    assert path.mode.foldable is foldable
