"""Twist, writhe and link of closed ribbons, and rings unfolded from their sectors."""

from collections.abc import Callable
from typing import NamedTuple

import classical
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from der.kernels.linking import (
    _quadrilateral,
    link,
    link_number,
    twist,
    unfold,
    unfold_lengths,
    vertices,
    writhe,
)
from der.kernels.quaternions import rotation

SEEDS = pytest.mark.parametrize("seed", range(6))
COPIES = pytest.mark.parametrize("copies", [1, 2, 4])
Curve = Callable[[np.ndarray], np.ndarray]


class Ribbon(NamedTuple):
    """A closed polygon, edge j ending at vertex j, and the frames of its edges."""

    x: np.ndarray  # (n, 3)
    d1: np.ndarray  # (n, 3)
    quat: np.ndarray  # (n, 4)
    length: np.ndarray  # (n,)

    @property
    def tw(self) -> float:
        """Total twist, in turns."""
        return twist(self.quat)

    @property
    def wr(self) -> float:
        """Writhe."""
        return writhe(self.x, 1)


def ribbon(x: np.ndarray, field: np.ndarray, angle: np.ndarray | float = 0.0) -> Ribbon:
    """Ribbon on vertices x with d1 the normal part of ``field``, turned about d3 by ``angle``."""
    e = x - np.roll(x, 1, axis=0)
    d3 = classical.unit(e)
    first = classical.unit(field - d3 * classical.dot(field, d3))
    c, s = (np.broadcast_to(f(angle), len(x))[:, None] for f in (np.cos, np.sin))
    d1 = c * first + s * np.cross(d3, first)
    frames = np.stack([d1, np.cross(d3, d1), d3], axis=-1)
    quat = np.roll(Rotation.from_matrix(frames).as_quat(), 1, axis=1)
    return Ribbon(x, d1, np.ascontiguousarray(quat), np.linalg.norm(e, axis=1))


def places(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Parameters of the n vertices and of the middles of the n edges, the first of these at 0."""
    middle = 2.0 * np.pi * np.arange(n) / n
    return middle + np.pi / n, middle


def blackboard(curve: Curve, n: int, turns: int = 0) -> Ribbon:
    """Ribbon seen edge-on from E3, with some turns more: Lk = signed crossings + turns."""
    at_vertices, at_edges = places(n)
    return ribbon(curve(at_vertices), np.tile([0.0, 0.0, 1.0], (n, 1)), turns * at_edges)


def random_ribbon(seed: int, n: int = 48) -> Ribbon:
    """Random smooth closed curve of three harmonics; frames transported, closed by even twist."""
    rng = np.random.default_rng(seed)
    t, middle = places(n)
    k = np.arange(1, 4)
    phases = np.concatenate([np.cos(np.outer(t, k)), np.sin(np.outer(t, k))], axis=1)
    x = phases @ (rng.normal(size=(6, 3)) / np.tile(k, 2)[:, None] ** 1.5)
    d3 = classical.unit(x - np.roll(x, 1, axis=0))
    d1 = [classical.unit(np.cross(d3[0], [0.3, -0.5, 0.8]))]
    for j in range(n):
        d1.append(classical.transported(d1[j], d3[j], d3[(j + 1) % n]))
    holonomy = np.arctan2(np.cross(d1[0], d1[n]) @ d3[0], d1[0] @ d1[n])
    turns = int(rng.integers(-3, 4))
    return ribbon(x, np.array(d1[:n]), (turns - holonomy / (2.0 * np.pi)) * middle)


def torus_knot(p: int, q: int, hand: int) -> Curve:
    """Knot p times round the axis E3 and q times round the core, right-handed for ``hand`` = 1.

    Seen from E3 it is a braid of p strands with (p - 1) q crossings of one sign.
    """

    def curve(t: np.ndarray) -> np.ndarray:
        radius = 2.0 + np.cos(q * t)
        z = -hand * np.sin(q * t)
        return np.column_stack([radius * np.cos(p * t), radius * np.sin(p * t), z])

    return curve


def solid_angles(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Gauss integral over each pair of edges of two closed polygons, over 4 pi.

    Areas of spherical quadrangles by arcsines (Banchoff 1976; Klenin & Langowski 2000, Eq. 16).
    """
    a, b = x[:, None], np.roll(x, -1, axis=0)[:, None]
    c, d = y[None], np.roll(y, -1, axis=0)[None]
    sides = [np.cross(c - a, d - a), np.cross(d - a, d - b), np.cross(d - b, c - b)]
    sides.append(np.cross(c - b, c - a))
    with np.errstate(invalid="ignore", divide="ignore"):
        n = [classical.unit(side) for side in sides]
        area = sum(
            np.arcsin(np.clip(np.sum(n[i] * n[(i + 1) % 4], axis=-1), -1.0, 1.0)) for i in range(4)
        )
    sign = np.sign(np.sum(np.cross(d - c, b - a) * (c - a), axis=-1))
    return np.nan_to_num(area) * sign / (4.0 * np.pi)


def gauss_link(it: Ribbon, offset: float) -> float:
    """Linking number of the polygon and one ``offset`` along d1, by the double sum."""
    d1 = classical.unit(it.d1 + np.roll(it.d1, -1, axis=0))
    return float(solid_angles(it.x, it.x + offset * d1).sum())


# --- integers -------------------------------------------------------------------------------


@SEEDS
def test_link_of_a_random_ribbon_is_an_integer(seed):
    """Calugareanu-White-Fuller, exact for a polygon: 2300 arctangents add up to 1e-12 or so."""
    it = random_ribbon(seed)
    number = link_number(it.quat, it.length, 1)
    assert abs(number - round(number)) < 1e-10


@SEEDS
def test_link_is_twist_and_writhe(seed):
    """Lk = Tw + Wr, of the polygon as given; 1e-11, as its vertices are summed up again."""
    it = random_ribbon(seed)
    assert link_number(it.quat, it.length, 1) == pytest.approx(it.tw + it.wr, abs=1e-11)


@SEEDS
def test_twist_and_writhe_are_the_linking_number_of_two_curves(seed):
    """Gauss's double sum over centreline and offset curve, by arcsines, which lose half the digits.

    Hence 1e-6; the number is an integer.
    """
    it = random_ribbon(seed)
    assert it.tw + it.wr == pytest.approx(gauss_link(it, 0.01), abs=1e-6)


@SEEDS
def test_writhe_is_the_gauss_integral(seed):
    """Against the sum by arcsines, which lose half the digits where edges align: 1e-6."""
    it = random_ribbon(seed)
    pairs = solid_angles(it.x, it.x)
    n = len(it.x)
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    expected = pairs[(apart > 1) & (apart < n - 1)].sum()
    assert it.wr == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("turns", [-2, 0, 3])
@pytest.mark.parametrize("hand", [1, -1], ids=["right", "left"])
@pytest.mark.parametrize(("p", "q"), [(1, 0), (2, 3), (3, 2), (2, 5)])
def test_link_of_a_torus_knot(p, q, hand, turns):
    """Seen edge-on, a ribbon's Lk is its signed crossings: +3 for the right-handed trefoil.

    Each right-handed turn of the frame adds one. The miss is rounding.
    """
    it = blackboard(torus_knot(p, q, hand), 60, turns)
    number, miss = link(it.quat, it.length)
    assert number == hand * (p - 1) * q + turns
    assert miss < 1e-10


def test_trefoil_by_gauss():
    """The double sum of the right-handed trefoil and its offset is 3 as well; arcsines: 1e-6."""
    assert gauss_link(blackboard(torus_knot(2, 3, 1), 60), 0.02) == pytest.approx(3.0, abs=1e-6)


@pytest.mark.parametrize("turns", [-2, 1, 4])
def test_right_handed_turns_of_a_flat_circle(turns):
    """Wr = 0 in a plane and Tw = turns, positive where d1 turns right-handed about d3: rounding."""
    it = blackboard(torus_knot(1, 0, 1), 24, turns)
    assert it.wr == pytest.approx(0.0, abs=1e-13)
    assert it.tw == pytest.approx(turns, abs=1e-13)


def lifted_eight(lift: float) -> Curve:
    """Figure eight in a plane, its strand along (1, 1) lifted above the other where they cross."""

    def curve(t: np.ndarray) -> np.ndarray:
        return np.column_stack([np.sin(t), 0.5 * np.sin(2.0 * t), lift * np.cos(t)])

    return curve


def seen_rectangle(x: tuple[float, float], y: tuple[float, float], h: float) -> float:
    """Solid angle of [x0, x1] x [y0, y1] at the distance h: sums of arctan(x y/(h r))."""
    corners = [(a, b, i == j) for i, a in enumerate(x) for j, b in enumerate(y)]
    return sum(
        (1.0 if even else -1.0) * np.arctan2(a * b, h * np.sqrt(a * a + b * b + h * h))
        for a, b, even in corners
    )


@pytest.mark.parametrize("h", [1.0, 1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("short", [1.0, 1e-3, 4e-6])
@pytest.mark.parametrize("beside", [0.0, 0.3, 2.0])
def test_edges_that_all_but_touch_keep_their_solid_angle(h, short, beside):
    """Directions between two edges at right angles fill a rectangle, whose area is known.

    One edge of any length passes another at the distance h, above it or beside. Van Oosterom and
    Strackee's formula loses 1e-16/h^2 there, all digits at 1e-8; what is left are roundings.
    """
    x, y = (-0.7 * short, 0.4 * short), (beside - 1.0, beside + 0.8)
    p, q = np.array([-x[1], 0.0, 0.0]), np.array([-x[0], 0.0, 0.0])
    r, s = np.array([0.0, y[0], h]), np.array([0.0, y[1], h])
    area = _quadrilateral(p, q, r, s)
    assert abs(area) == pytest.approx(seen_rectangle(x, y, h), abs=4e-15)
    assert _quadrilateral(q, p, r, s) == -area


@pytest.mark.parametrize("lift", [1e-5, 1e-7, 1e-9, -1e-9])
def test_link_of_strands_that_all_but_touch(lift):
    """Lk is known from the side on which they pass, to 1e-16/lift: roundings of the vertices."""
    it = blackboard(lifted_eight(lift), 50)
    number, miss = link(it.quat, it.length)
    assert number == np.sign(lift)
    assert miss < 1e-14 / abs(lift)


@SEEDS
def test_writhe_where_a_vertex_all_but_touches_an_edge(seed):
    """Against the quadrilaterals of all pairs, each by its arcsines: roundings, over the distance.

    A complex number may lose its digits there although its argument is small.
    """
    rng = np.random.default_rng(seed)
    for _ in range(10):
        x = random_ribbon(rng.integers(100)).x
        n = len(x)
        i = rng.integers(n)
        j = (i + rng.integers(5, n - 5)) % n
        lift = 1e-7 * classical.unit(rng.normal(size=3))
        x[i] = x[j] + rng.uniform(0.2, 0.8) * (x[j - 1] - x[j]) + lift
        pairs = [(a, b) for a in range(n) for b in range(a + 2, n) if (b + 1) % n != a]
        areas = [_quadrilateral(x[a - 1], x[a], x[b - 1], x[b]) for a, b in pairs]
        assert writhe(x, 1) == pytest.approx(-sum(areas) / (2.0 * np.pi), abs=2e-10)


@pytest.mark.parametrize("lift", [0.3, 0.01, -0.01, -0.3])
def test_figure_eight(lift):
    """One crossing, right-handed where the strand along (1, 1) passes above the one along (-1, 1).

    Lk = +1 there and -1 where it passes below: a self-crossing changes it by two.
    """
    it = blackboard(lifted_eight(lift), 50)
    number, miss = link(it.quat, it.length)
    assert number == np.sign(lift)
    assert miss < 1e-10


def test_writhe_of_a_nearly_flat_figure_eight():
    """Wr -> 1 with the lift (Fuller 1971): short of it by less than twice the lift of 1e-3."""
    assert 1.0 - 2e-3 < blackboard(lifted_eight(1e-3), 50).wr < 1.0


@SEEDS
def test_mirror_image_has_the_opposite_link(seed):
    """Reflection in a plane turns right into left: Tw, Wr and Lk change sign; to rounding."""
    it = random_ribbon(seed)
    mirror = np.array([1.0, 1.0, -1.0])
    other = ribbon(it.x * mirror, it.d1 * mirror)
    assert other.tw == pytest.approx(-it.tw, abs=1e-12)
    assert other.wr == pytest.approx(-it.wr, abs=1e-12)


@SEEDS
def test_link_does_not_see_signs_of_quaternions(seed):
    """q and -q are one frame; twist sums the same arctangents."""
    it = random_ribbon(seed)
    sign = np.where(np.arange(len(it.quat)) % 3 == 0, -1.0, 1.0)[:, None]
    assert twist(sign * it.quat) == it.tw


# --- sectors --------------------------------------------------------------------------------


def symmetric_ring(n: int, copies: int) -> Ribbon:
    """Twisted ring with a half-turn about E3 (copies = 2), and about E2 as well (copies = 4).

    s -> -s keeps x3 and reverses x1, x2 and the angle of the frame; s -> pi - s keeps x2.
    """
    t, middle = places(n)

    def curve(s: np.ndarray) -> np.ndarray:
        x = [
            0.8 * np.sin(2.0 * s) - 0.2 * np.sin(4.0 * s),
            np.sin(s) + 0.4 * np.sin(3.0 * s),
            -np.cos(s) + 0.3 * np.cos(3.0 * s),
        ]
        if copies == 2:
            x[0] += 0.3 * np.sin(3.0 * s)
            x[2] += 0.2 * np.cos(2.0 * s)
        return np.column_stack(x)

    angle = 0.9 * np.sin(2.0 * middle) + (0.4 * np.sin(middle) if copies == 2 else 0.0)
    x = curve(t)
    x -= 0.5 * np.mean(x[[0, -1]], axis=0) + 0.5 * np.mean(x[[n // 2 - 1, n // 2]], axis=0)
    return ribbon(x, np.tile([1.0, 0.0, 0.0], (n, 1)), angle)


def sector_of(it: Ribbon, copies: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames and lengths of a sector: a quarter runs from free point to grip, a half grip to grip.

    Its end edges are halves: the other half lies beyond the plane of symmetry.
    """
    n = len(it.x)
    if copies == 1:
        return it.quat, it.length
    part = slice(n // 4 if copies == 4 else 0, n // 2 + 1)
    length = it.length[part].copy()
    length[[0, -1]] *= 0.5
    return np.ascontiguousarray(it.quat[part]), length


EVERY_SECTOR = pytest.mark.parametrize(
    ("n", "symmetry", "copies"),
    [(n, s, c) for n in (16, 24) for s in (4, 2) for c in (1, 2, 4) if c <= s],
)


@EVERY_SECTOR
def test_unfold_gives_the_frames_of_the_ring(n, symmetry, copies):
    """Half-turns of the sector's frames are the ring's own.

    These stand on differences of vertices, so a rounding is divided by the edge length: 1e-13.
    """
    it = symmetric_ring(n, symmetry)
    frames = rotation(unfold(sector_of(it, copies)[0], copies))
    assert_allclose(frames, rotation(it.quat), rtol=0, atol=1e-13)


@EVERY_SECTOR
def test_unfold_lengths_gives_the_lengths_of_the_ring(n, symmetry, copies):
    """Edges in a plane of symmetry are complete again; as above, relative: 1e-13."""
    it = symmetric_ring(n, symmetry)
    lengths = unfold_lengths(sector_of(it, copies)[1], copies)
    assert_allclose(lengths, it.length, rtol=1e-13, atol=0)


@EVERY_SECTOR
def test_vertices_of_the_unfolded_sector(n, symmetry, copies):
    """The ring itself, its origin midway between the grips; roundings summed round the ring."""
    it = symmetric_ring(n, symmetry)
    quat, length = sector_of(it, copies)
    x = vertices(unfold(quat, copies), unfold_lengths(length, copies))
    assert_allclose(x, it.x, rtol=0, atol=1e-13)


@EVERY_SECTOR
def test_writhe_of_a_symmetric_ring_from_its_sector(n, symmetry, copies):
    """Pairs of one sector's edges with all, times the copies; roundings of 500 arctangents."""
    it = symmetric_ring(n, symmetry)
    assert writhe(it.x, copies) == pytest.approx(it.wr, abs=1e-12)


@EVERY_SECTOR
def test_link_of_a_symmetric_ring_from_its_sector(n, symmetry, copies):
    """Same integer from a quarter, a half and the full ring; misses are rounding."""
    it = symmetric_ring(n, symmetry)
    number, miss = link(*sector_of(it, copies), copies)
    assert number == round(it.tw + it.wr)
    assert miss < 1e-10


@COPIES
def test_flat_untwisted_ring_has_link_zero(copies):
    """The ring of a scene at gamma = 0: d1 = E1 all around, Tw = Wr = Lk = 0 to rounding."""
    t, _ = places(16)
    x = np.column_stack([0.0 * t, np.sin(t), -np.cos(t)])
    it = ribbon(x, np.tile([1.0, 0.0, 0.0], (16, 1)))
    assert link_number(*sector_of(it, copies), copies) == pytest.approx(0.0, abs=1e-13)
