"""Where frames sit: on every joint, mirror symmetric, nested, and closer where the ring is bent."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from shapes import egg, kinked, through_points

import der
from der.continuation.richardson import romberg
from der.geometry.mesh import kink_offsets, natural_turning, sites

RINGS = {
    "circle": der.circle(),
    "ellipse x": der.ellipse(0.6),
    "ellipse y": der.ellipse(0.6, "y"),
    "rectangle x": der.rectangle(0.6, 0.3),
    "rectangle y": der.rectangle(0.6, 0.3, "y"),
    "square": der.rectangle(1.0, 0.3),
    "stadium": der.rectangle(0.5, 0.5),
    "triangle 60": der.triangle(math.pi / 3, math.sqrt(3) / 12),
    "triangle 90": der.triangle(math.pi / 2, 1 / 30),
    "triangle 120": der.triangle(2 * math.pi / 3, 1 / 15),
    "profile": egg(),
    "kinks": kinked(),
}
SECTORS = {"full": 1, "half": 2, "quarter": 4}
PIECES = [
    (shape, name)
    for shape, ring in RINGS.items()
    for name in SECTORS
    if name != "quarter" or ring.symmetry == "D2"
]
EVERY_RING = pytest.mark.parametrize("shape", RINGS)
EVERY_PIECE = pytest.mark.parametrize(("shape", "name"), PIECES)


def joints(ring: der.Ring) -> list[float]:
    """Return grips, free points, jumps and kinks of curvature, from 0 to the ring's length."""
    length = ring.length
    own = [0.0, 0.5 * length, length, *ring.kinks]
    if ring.symmetry == "D2":
        own += [0.25 * length, 0.75 * length]
    return sorted(own)


@EVERY_PIECE
@pytest.mark.parametrize("n_edges", [64, 100, 128])
def test_a_sector_has_its_share_of_the_cells_and_both_ends(shape, name, n_edges):
    """N cells over the number of copies, strictly one after the other, from end to end."""
    length, copies = RINGS[shape].length, SECTORS[name]
    s = sites(RINGS[shape], n_edges, name)
    begin = 0.25 * length if name == "quarter" else 0.0
    assert len(s) == n_edges // copies + 1
    assert np.diff(s).min() > 0.0
    assert_allclose(s[[0, -1]], [begin, begin + length / copies], atol=1e-14 * length)


@EVERY_RING
@pytest.mark.parametrize("n_edges", [32, 52, 64, 128, 256])
def test_a_frame_sits_on_every_joint(shape, n_edges):
    """Grips, free points, jumps and kinks of the natural curvature, to rounding.

    The user's profile has eight knots for each point: more than cells, so that they lie inside.
    """
    ring = RINGS[shape]
    s = sites(ring, n_edges, "full")
    places = joints(ring)
    if len(places) > n_edges:
        places = [0.0, 0.5 * ring.length, ring.length]
    away = [np.abs(s - place).min() for place in places]
    assert max(away) < 1e-12 * ring.length


@pytest.mark.parametrize(
    ("shape", "name", "n_edges"),
    [(*piece, n) for piece in PIECES for n in (128, 256, 512)],
)
def test_twice_as_many_cells_are_the_same_cells_halved(shape, name, n_edges):
    """Every second site of N is a site of N/2, every fourth one of N/4: errors in even powers.

    From two cells a segment at N/4 on, which 128 edges have on every shape. Positions agree to
    rounding.
    """
    ring = RINGS[shape]
    fine = sites(ring, n_edges, name)
    for factor in (2, 4):
        coarse = sites(ring, n_edges // factor, name, finest=n_edges)
        assert_allclose(fine[::factor], coarse, rtol=0, atol=1e-13 * ring.length)


@EVERY_RING
def test_sites_are_mirror_symmetric(shape):
    """About the twisting axis, s -> L - s; about the other one too where the ring is."""
    ring = RINGS[shape]
    s = sites(ring, 64, "full")
    assert_allclose(ring.length - s[::-1], s, atol=1e-14 * ring.length)
    if ring.symmetry == "D2":
        half = sites(ring, 64, "half")
        assert_allclose(0.5 * ring.length - half[::-1], half, atol=1e-14 * ring.length)


@EVERY_RING
def test_sectors_are_pieces_of_the_ring(shape):
    """A half has the first sites of the full ring, a quarter the last of the half, bit for bit."""
    ring = RINGS[shape]
    half = sites(ring, 64, "half")
    assert_array_equal(sites(ring, 64, "full")[:33], half)
    if ring.symmetry == "D2":
        assert_array_equal(sites(ring, 64, "quarter"), half[16:])


def test_a_circle_is_divided_evenly():
    """Nothing is graded where the curvature is the same everywhere."""
    cells = np.diff(sites(der.circle(), 64, "full"))
    assert_allclose(cells, 2 * math.pi / 64, rtol=1e-13)


@pytest.mark.parametrize("shape", ["rectangle x", "triangle 90", "triangle 120", "triangle 60"])
def test_cells_share_the_curvature_of_the_flat_and_the_folded_ring(shape):
    """Integrals of |k1u| + 4 pi/L over cells are alike, but for rounding to a number of cells.

    Segments have two cells or more at the coarsest level: one more or less changes a share by half.
    """
    ring = RINGS[shape]
    s = sites(ring, 256, "full")
    middle = 0.5 * (s[1:] + s[:-1])
    share = (np.abs(ring.curvature(middle)) + 4 * math.pi / ring.length) * np.diff(s)
    assert share.max() / share.min() < 2.25


def test_an_ellipse_is_graded_smoothly():
    """Cells are shortest at the sharp ends, and neighbours differ in proportion to 1/N."""
    ring = der.ellipse(0.3)
    ratios = []
    for n_edges in (128, 256):
        cells = np.diff(sites(ring, n_edges, "quarter"))
        assert cells[0] < 0.5 * cells[-1]  # from the sharp end to the grip
        ratios.append(np.abs(np.diff(cells) / cells[1:]).max())
    assert ratios[1] < 0.6 * ratios[0] < 0.1


@EVERY_RING
@pytest.mark.parametrize("n_edges", [8, 12, 16])
def test_few_cells_are_divided_all_the_same(shape, n_edges):
    """Even where there are fewer cells than segments; the ends are held, the order is kept."""
    ring = RINGS[shape]
    s = sites(ring, n_edges, "full")
    assert len(s) == n_edges + 1
    assert np.diff(s).min() > 0.0
    assert s[0] == 0.0
    assert abs(s[n_edges // 2] - 0.5 * ring.length) < 1e-14 * ring.length


@pytest.mark.parametrize("shape", ["triangle 90", "rectangle y", "profile"])
def test_natural_turning_of_all_cells_is_one_turn(shape):
    """The natural curvature is integrated over each cell exactly, at any resolution."""
    ring = RINGS[shape]
    for n_edges in (16, 64):
        turning = np.diff(ring.natural_angle(sites(ring, n_edges, "half"))).sum()
        assert turning == pytest.approx(math.pi, abs=1e-12)


@pytest.mark.parametrize("n_edges", [32, 64])
def test_meshes_of_error_bars_are_nested_where_cells_are_few(n_edges):
    """Two segments in a quarter of the ring, and N/4 edges have two cells for them, or four."""
    ring = RINGS["kinks"]
    fine = sites(ring, n_edges, "quarter")
    for factor in (2, 4):
        coarse = sites(ring, n_edges // factor, "quarter", finest=n_edges)
        assert_allclose(fine[::factor], coarse, rtol=0, atol=1e-14)


def test_knots_on_a_line_are_no_kinks():
    """A circle of 32 knots has the mesh and the natural turning of the circle."""
    s = np.linspace(0.0, 2.0 * math.pi, 33)
    ring = der.profile(s, np.ones(33))
    found = sites(ring, 64, "half")
    assert_allclose(found, sites(der.circle(), 64, "half"), atol=1e-13)
    assert_array_equal(natural_turning(ring, found), np.diff(ring.natural_angle(found)))


def chord(ring: der.Ring, n_edges: int, finest: int, *, plain: bool) -> float:
    """Return the distance between the grips as a sum of edges, less the exact one."""
    s = sites(ring, n_edges, "half", finest)
    angle = ring.natural_angle(s) + (0.0 if plain else kink_offsets(ring, s))
    cell = np.append(0.0, np.diff(s))
    length = 0.5 * (cell + np.roll(cell, -1))
    exact = ring.position(0.5 * ring.length)[2] - ring.position(0.0)[2]
    return float(length @ np.sin(angle) - exact)


def test_turned_frames_make_up_for_kinks_inside_of_cells():
    """48 points: what is left of the chord's error after two extrapolations, over ten meshes.

    Without the small turns of the frames it is of third order and of no fixed sign; with them it is
    of fourth order, and ten times smaller.
    """
    ring = through_points(48, lambda theta: 1.0 + 0.1 * np.cos(3.0 * theta))

    def left(*, plain: bool) -> float:
        tables = [
            [chord(ring, n // k, n, plain=plain) for k in (1, 2, 4)] for n in range(96, 176, 8)
        ]
        return float(np.linalg.norm(romberg(np.transpose(tables))[2]))

    assert left(plain=False) < 0.1 * left(plain=True)
