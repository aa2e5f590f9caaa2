"""Profiles as strangers write them: any dialect, start, direction, spacing and rounding."""

import io
from itertools import product

import numpy as np
import pytest

import der
from der.geometry.outline import arc, closed_curve, straight
from der.geometry.profile import knots_of
from der.geometry.profile_csv import read_profile

CELLS = np.linspace(0, 1, 65)


def hexagon():
    """A hexagon of circumradius 1 with fillets of 0.2, from the middle of a side."""
    cut = 0.2 * np.tan(np.pi / 6)
    half, side, fillet = straight(0.5 - cut), straight(1 - 2 * cut), arc(0.2, np.pi / 3)
    curve = closed_curve(half, fillet, side, fillet, side, fillet, half)
    return der.profile(**knots_of(curve))


def waves():
    """r = 1 + 0.1 cos 3 theta: the curvature of polar coordinates at 4000 places."""
    t = np.linspace(0, 2 * np.pi, 4001)
    r, slope, bend = 1 + 0.1 * np.cos(3 * t), -0.3 * np.sin(3 * t), -0.9 * np.cos(3 * t)
    speed = np.hypot(r, slope)
    s = np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t)))
    return der.profile(s, (r**2 + 2 * slope**2 - r * bend) / speed**3)


SHAPES = {
    "hexagon": hexagon(),
    "ellipse": der.ellipse(0.6),
    "stadium": der.rectangle(0.5, 0.5),
    "triangle": der.triangle(1.2, 0.15),
    "waves": waves(),
}


def outline(shape, n=600, begin=0.0, seed=None):
    """Points of a shape of size 100, at even or uneven places."""
    ring = SHAPES[shape]
    at = np.arange(n) / n
    if seed is not None:
        at = at + np.random.default_rng(seed).uniform(-0.3, 0.3, n) / n
    return 100 * ring.position((at + begin) * ring.length)[:, 1:]


def difference(ring, shape):
    """How curvatures differ, as `curvature_error` says it: beside any of the true ring's axes."""
    true = SHAPES[shape]
    turn = np.diff(ring.angle(CELLS * ring.length))
    starts = np.arange(12) / 12  # of all axes of these shapes
    exact = [np.diff(true.angle((CELLS + start) * true.length)) for start in starts]
    return min(np.linalg.norm(turn - one) for one in exact) / np.linalg.norm(turn)


def saved(points, head="", separator=",", digits=None, comma=False, **more):
    """Points as a text."""
    text = io.StringIO()
    form = "%.17g" if digits is None else f"%.{digits}f"
    np.savetxt(text, points, fmt=form, delimiter=separator, header=head, comments="", **more)
    return text.getvalue().replace(".", ",") if comma else text.getvalue()


DIALECTS = {
    "plain": lambda p: saved(p, "x,y"),
    "semicolons and decimal commas": lambda p: saved(p, "X [mm];Y [mm]", ";", 4, comma=True),
    "tabs": lambda p: saved(p, "x (mm)\ty (mm)", "\t", 4),
    "spaces": lambda p: saved(p, "X Y", "  ", 4),
    "spaces and decimal commas": lambda p: saved(p, "", " ", 4, comma=True),
    "no names": lambda p: saved(p),
    "comments": lambda p: "# a ring\n% of mine\n\n" + saved(p, "x, y") + "# end\n",
    "names in a comment": lambda p: saved(p, "# r2 r3", " "),
    "byte order mark": lambda p: "\ufeff" + saved(p, "x,y"),
    "lines of Windows": lambda p: saved(p, "x,y", newline="\r\n"),
    "quotes": lambda p: '"x","y"\n' + saved(p),
    "commas at the end": lambda p: saved(p, "x,y").replace("\n", ",\n"),
    "constant z": lambda p: saved(np.insert(p, 2, 7.25, axis=1), "x,y,z"),
    "constant x": lambda p: saved(np.insert(p, 0, 0.0, axis=1), "r1 r2 r3", " "),
    "tilted": lambda p: saved(np.column_stack([p[:, 0], 0.8 * p[:, 1], 0.6 * p[:, 1]])),
    "more columns": lambda p: saved(np.insert(p, 0, np.arange(len(p)), axis=1), "no,x,y"),
    "closed": lambda p: saved(np.vstack([p, p[:1] + 1e-9])),
    "points twice": lambda p: saved(np.repeat(p, 2, axis=0) + [[0, 0], [1e-9, 0]] * len(p)),
    "radius 1e9": lambda p: saved(p * 1e7),
    "radius 1e-6": lambda p: saved(p * 1e-8),
    "rounded to 0.01": lambda p: saved(p, "x,y", ",", 2),
}


@pytest.mark.parametrize(("shape", "dialect"), [*product(SHAPES, DIALECTS)])
def test_a_file_of_any_dialect_is_the_ring(tmp_path, shape, dialect):
    """Also clockwise, from anywhere; the curvature is as well known as the ring says."""
    file = tmp_path / "ring.txt"
    points = outline(shape, begin=0.137)
    if len(dialect) % 2:
        points = points[::-1]
    file.write_text(DIALECTS[dialect](points), encoding="utf-8", newline="")
    ring = read_profile(str(file), "x")
    error = ring.parameters["curvature_error"]
    assert error < 0.1
    assert difference(ring, shape) < 1.5 * error + 1e-4
    unit = {"radius 1e9": 1e9, "radius 1e-6": 1e-6}.get(dialect, 100)
    exact = SHAPES[shape]
    assert ring.parameters["reference_length"] / unit * ring.length == pytest.approx(
        exact.length, rel=1e-3
    )
