"""Packing ratios: closed forms, the numbers the paper prints, and its figures."""

import numpy as np
import pytest

import der
from der.bvp.planar.folded_shape import Folded, folded
from der.bvp.planar.packing import envelope_area, natural_area, packing_ratio
from der.paper.packing import fig3b, fig6, fig9


def triangle(degrees, r):
    return der.triangle(np.radians(degrees), r)


@pytest.mark.parametrize("n", [120, 1200, 3600])
def test_circle_packs_to_a_ninth(n):
    """A third of the radius; exact on every mesh whose points coincide on the three turns."""
    assert packing_ratio(der.circle(), n) == pytest.approx(1 / 9, abs=1e-13)


@pytest.mark.parametrize(
    ("ring", "printed", "exact"),
    [
        (der.rectangle(0.2, 0.1), 0.80, 0.79995118),
        (der.rectangle(1.0, 0.1), 0.24, 0.24328061),
        (triangle(120, 1 / 30), 0.66, 0.66259870),
        (triangle(60, 0.2), 0.12, 0.11933974),
    ],
    ids=str,
)
def test_paper_values(ring, printed, exact):
    """Sections 3.3 and 3.4 print two digits; the further ones are ours, converged to 1e-8."""
    ratio = packing_ratio(ring)
    assert round(ratio, 2) == printed
    assert ratio == pytest.approx(exact, abs=2e-8)


def test_a_circular_triangle_packs_like_the_circle():
    """r = R_C is a circle, folded by the half-ring problem."""
    assert packing_ratio(triangle(60, np.tan(np.pi / 6) / 2)) == pytest.approx(1 / 9, abs=1e-10)


def test_both_axes_pack_alike():
    """The folded shape is the same, turned."""
    x, y = (packing_ratio(der.ellipse(0.6, axis)) for axis in "xy")
    assert x == pytest.approx(y, abs=1e-12)


def test_narrow_and_sharp_rings_pack_worse():
    """Sections 3.2 and 3.3: the ratio rises with narrowness, from 1/9 at the circle."""
    ratios = [packing_ratio(der.ellipse(b), 720) for b in (1.0, 0.9, 0.7, 0.5)]
    assert np.all(np.diff(ratios) > 0)
    assert packing_ratio(der.rectangle(0.2, 0.1)) > packing_ratio(der.rectangle(0.2, 0.2))


@pytest.mark.parametrize(
    "ring", [der.ellipse(0.5), der.rectangle(0.4, 0.2), triangle(90, 0.05)], ids=str
)
def test_error_falls_with_the_third_power_of_the_edge(ring):
    """Crossings cut edges anywhere, so the order is a bound: 1e-8 at 3600 is safe at 900."""
    fine = packing_ratio(ring, 14400)
    assert packing_ratio(ring, 900) == pytest.approx(fine, abs=1e-7)
    assert packing_ratio(ring, 3600) == pytest.approx(fine, abs=3e-9)


def test_holes_are_filled():
    """A limacon r = 1/2 + cos: the loop inside counts once, as part of the area outside it."""
    n = 3600
    t = 2 * np.pi * np.arange(n) / n
    z = (0.5 + np.cos(t)) * np.exp(1j * t)
    velocity = (0.5 + np.cos(t)) * 1j * np.exp(1j * t) - np.sin(t) * np.exp(1j * t)
    angle = np.unwrap(np.angle(velocity))
    points = np.column_stack([z.real, z.imag])
    # shift-free: turning is declared to be none, so the polygon is taken as it is
    flat = Folded(t, points, 0 * angle, 0 * angle, 0.0, 0.0, 0.0)
    half = 2 * np.pi / 3  # the outer loop is |t| < 2 pi/3
    outer = 0.75 * half + 2 * 0.5 * np.sin(half) + np.sin(2 * half) / 4
    assert envelope_area(flat) == pytest.approx(outer, abs=1e-5)


@pytest.mark.parametrize(
    ("ring", "area"),
    [
        (der.circle(), np.pi),
        (der.circle(0.0), np.pi),
        (der.ellipse(0.3, "y"), 0.3 * np.pi),
        (der.rectangle(0.5, 0.5), 1.0 + np.pi / 4),
        (triangle(60, np.tan(np.pi / 6) / 2), np.pi / 12),
        (triangle(60, 1e-5), np.sqrt(3) / 4 - (3 * np.sqrt(3) - np.pi) * 1e-10),
    ],
    ids=str,
)
def test_natural_areas(ring, area):
    """Circle, ellipse, stadium, inscribed circle, and a triangle that is nearly sharp."""
    assert natural_area(ring) == pytest.approx(area, rel=1e-11)


def test_area_of_a_profile_is_green_s():
    """A rectangle given by its curvature."""
    ring = der.rectangle(0.6, 0.3)
    line = ring.outline
    s = np.column_stack([line.knots[:-1], line.knots[1:]]).ravel()
    k = np.column_stack([line.curvature_start, line.curvature_end]).ravel()
    profile = der.profile(s, k)
    assert natural_area(profile) == pytest.approx(natural_area(ring), rel=1e-12)
    assert packing_ratio(profile, 720) == pytest.approx(packing_ratio(ring, 720), abs=1e-12)


def test_envelope_is_smaller_than_the_convex_hull():
    """The notches between the loops are outside the ring: the envelope is no hull."""
    from shapely import MultiPoint

    shape = folded(der.rectangle(1.0, 0.1), 720)
    assert envelope_area(shape) < 0.8 * MultiPoint(shape.points).convex_hull.area


@pytest.mark.parametrize("n", [11, 2.0, True])
def test_number_of_points_is_checked(n):
    with pytest.raises(ValueError, match="n must be an even integer"):
        packing_ratio(der.circle(), n)


@pytest.mark.parametrize(
    ("figure", "name", "header", "last"),
    [
        (fig3b, "fig3b", "b_over_a,packing_ratio,stays_folded", [1.0, 1 / 9, 1.0]),
        (fig6, "fig6", "b_over_a,r_over_a,packing_ratio,stays_folded", [1.0, 1.0, 1 / 9, 1.0]),
        (
            fig9,
            "fig9",
            "vertex_angle,r_over_a,packing_ratio,stays_folded",
            [120.0, np.tan(np.pi / 12) / 2, 1 / 9, 1.0],
        ),
    ],
)
def test_figures_write_a_picture_and_its_numbers(figure, name, header, last, tmp_path):
    """Both files, named in the answer; the last row is the circle."""
    written = figure(tmp_path, columns=3)
    assert written == [tmp_path / f"{name}.png", tmp_path / f"{name}.csv"]
    assert sorted(tmp_path.iterdir()) == sorted(written)
    assert written[0].read_bytes().startswith(b"\x89PNG")
    first, *rows = written[1].read_text().splitlines()
    assert first == header
    assert len(rows) == (3 if name == "fig3b" else 9)
    assert [float(v) for v in rows[-1].split(",")] == pytest.approx(last, rel=1e-9)


def test_figures_refuse_what_they_cannot_do(tmp_path):
    """Too few columns, a folder that is not there: nothing is written."""
    with pytest.raises(ValueError, match="columns must be an integer >= 2, got 1"):
        fig3b(tmp_path, columns=1)
    with pytest.raises(FileNotFoundError):
        fig3b(tmp_path / "none", columns=2)
    assert not list(tmp_path.iterdir())
