"""Rings of the user's own shape from files."""

import json

import numpy as np
import pytest

import der
from der.geometry.profile_csv import read_profile

ANGLE = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False) - 0.5 * np.pi
ELLIPSE = np.stack([np.cos(ANGLE), 0.6 * np.sin(ANGLE)], axis=1)  # first point at -E3, the grip


def test_points_of_an_ellipse_fold_like_the_ellipse(tmp_path):
    """Its length to 1e-7: the periodic cubic spline through 400 points is that close."""
    file = tmp_path / "ring.csv"
    rows = [f"{x!r},{y!r}" for x, y in ELLIPSE.tolist()]
    file.write_text("\n".join(["# an ellipse", "x,y", *rows]) + "\n")
    ring = read_profile(str(file))
    assert ring.length == pytest.approx(der.ellipse(0.6).length, rel=1e-7)
    paths = [
        der.fold(der.Scene(r, der.rectangular_section(4.0), n_edges=32, self_crossings=False))
        for r in (ring, der.ellipse(0.6))
    ]
    assert paths[0].at_pi.slope == pytest.approx(paths[1].at_pi.slope, rel=1e-4)


@pytest.mark.parametrize("name", ["ring.csv", "ring.json"])
def test_curvature_of_a_circle_is_the_circle(tmp_path, name):
    """Constant curvature 1 over 2 pi, in both formats."""
    s = [0.0, np.pi, 2.0 * np.pi]
    file = tmp_path / name
    if name.endswith("json"):
        file.write_text(json.dumps({"arc_length": s, "curvature": [1.0, 1.0, 1.0]}))
    else:
        file.write_text("arc_length, curvature\n" + "\n".join(f"{x!r}, 1.0" for x in s))
    ring = read_profile(str(file))
    np.testing.assert_allclose(ring.curvature(np.linspace(0, 6, 7)), 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "x,y\n1,2\n1,two\n", "line 3 must be 2 finite numbers as line 2 is, got '1,two'"),
        ("a.csv", "x,y\n\n1,2\n#\n3,\n", "line 5 must be 2 finite numbers as line 3 is, got '3,'"),
        ("a.csv", "1 2\n3 nan\n", "line 2 must be 2 finite numbers"),
        ("a.csv", "x,y\n1,2,3\n", "line 1 must name the 3 columns below it, got 'x,y'"),
        ("a.csv", "theta,r\n1,2\n", "columns must be named x,y .*, got 'theta,r'"),
        ("a.csv", "0,5,1,5\n", "decimal commas must be separated by semicolons"),
        ("a.csv", "1,2\n3,4\n", r"\(numbers from line 1 on\): points must be at least 8, .* got 2"),
        ("a.csv", "", "must have lines of numbers, such as 1.5,2.5, got none"),
        ("a.csv", "x,y\n0,0\n1,1\n", "points"),
        ("a.json", "{", "a.json"),
        ("a.json", "[1, 2]", "must be an object with arc_length and curvature, or with points"),
        ("a.json", '{"points": 3}', "a.json"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, name, text, message):
    """One ValueError that names the file and the place."""
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(ValueError, match=message) as wrong:
        read_profile(str(file))
    assert str(file) in str(wrong.value)
