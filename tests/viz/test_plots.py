"""The picture of a path shows the record, and is saved completely or with a clear error."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from numpy.testing import assert_allclose

from der.records.configurations import Shapes
from der.records.path import AtPi, Mode, Path, Point, Timing, counts
from der.viz.palette import STRETCHES
from der.viz.plots.path import draw
from der.viz.plots.style import blank, save

STABLE, UNSTABLE, UNKNOWN = (STRETCHES[key].label for key in (True, False, None))


def special(kind, position, gamma, moment):
    return Point(kind, float(gamma), float(moment), 1.0, None, None, position)


def path(**changes):
    """Two folds, gamma = 1.5 + s^3/2 - 3s/4 at M = 1.5 + s, with the middle branch unstable."""
    s = np.array([-1.8, -1.4, -1.0, -(2**-0.5), -0.4, 0.0, 0.4, 2**-0.5, 1.0, 1.4, 1.8])
    gamma, moment = 1.5 + s**3 / 2 - 0.75 * s, 1.5 + s
    energy = 4 * (1.5 * (s**3 / 2 - 0.75 * s) + 0.375 * s**4 - 0.375 * s**2)
    entries = {
        "solver": "der",
        "ring": {"shape": "ellipse", "b_over_a": 0.85, "twist_axis": "y"},
        "section": {"h_over_t": 1.6, "nu": 0.3, "alpha": 1.0, "beta": 2.56},
        "numerics": {"n_edges": 32},
        "gamma": gamma,
        "moment": moment,
        "energy": energy,
        "index": counts([0, 0, 0, None, 1, 1, 1, None, 0, 0, 0]),
        "index_moment": counts([None] * 11),
        "points": tuple(special("fold", k, gamma[k], moment[k]) for k in (3, 7)),
        "at_pi": AtPi(0.0, 0.3, 1.0, 0, 0, None),
        "mode": Mode(foldable=True, stable=True, snapping="snap-back", stable_3d=True),
        "error": None,
        "timing": Timing(0.1, 20, 10),
    }
    return Path(**(entries | changes))


def shapes(n=11, edges=16):
    """Circles that tilt from state to state; the directors d1 are the circles' normals."""
    angle = 2 * np.pi * (np.arange(edges) + 0.5) / edges
    middle = angle - np.pi / edges
    tilt = np.linspace(0.0, 1.0, n)[:, None]
    c, s = np.cos(tilt), np.sin(tilt)
    x = np.stack([s * np.sin(angle), c * np.sin(angle), -np.cos(angle) + 0 * s], axis=-1)
    d3 = np.stack([s * np.cos(middle), c * np.cos(middle), np.sin(middle) + 0 * s], axis=-1)
    d1 = np.broadcast_to(np.stack([c, -s, 0 * c], axis=-1), d3.shape)
    return Shapes(x, np.stack([d1, np.cross(d3, d1), d3], axis=2))


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def lines(panel, stability):
    """Curves in the colour of stable or unstable stretches."""
    colour = STRETCHES[stability].colour
    return [line for line in panel.lines if to_hex(line.get_color()) == colour.lower()]


def test_moment_and_energy_share_gamma():
    above, below = draw(path()).axes
    assert above.get_shared_x_axes().joined(above, below)
    assert ("moment" in above.get_ylabel(), "energy" in below.get_ylabel()) == (True, True)


@pytest.mark.parametrize("panel", [0, 1])
def test_style_changes_at_the_folds(panel):
    """Solid, dashed, solid: a state of unknown index ends one stretch and begins the next."""
    subject = path()
    axes = draw(subject).axes[panel]
    solid, dashed = lines(axes, True), lines(axes, False)
    assert [line.is_dashed() for line in (*solid, *dashed)] == [False, False, True]
    ends = dashed[0].get_xdata()[[0, -1]]
    assert_allclose(ends, subject.gamma[[3, 7]] / np.pi, atol=1e-12)


def test_curve_goes_through_every_state_and_near_the_true_path():
    """M = 1.5 + s gives gamma exactly; chords between these few states are off by 3%."""
    subject = path()
    drawn = [line.get_xydata() for line in draw(subject).axes[0].lines]
    curve = np.concatenate([points for points in drawn if len(points) > 20])
    states = np.column_stack([subject.gamma / np.pi, subject.moment])
    nearest = np.linalg.norm(states[:, None] - curve, axis=2).min(axis=1)
    assert_allclose(nearest, 0, atol=1e-12)
    s = curve[:, 1] - 1.5
    true = 1.5 + s**3 / 2 - 0.75 * s
    assert_allclose(curve[:, 0] * np.pi, true, atol=1.2e-2 * np.ptp(subject.gamma))


def test_special_points_are_marked_where_they_are():
    subject = path()
    above = draw(subject).axes[0]
    (folds,) = [line for line in above.lines if line.get_marker() == "D" and len(line.get_xdata())]
    assert_allclose(folds.get_xdata(), subject.gamma[[3, 7]] / np.pi)
    assert_allclose(folds.get_ydata(), subject.moment[[3, 7]])


def test_legend_lists_only_what_occurs():
    assert legend(draw(path())) == [STABLE, UNSTABLE, "fold", "computed state"]


@pytest.mark.parametrize(
    ("kind", "label"),
    [
        ("limit", "limit of M"),
        ("branch", "branch point"),
        ("contact", "self-crossing"),
    ],
)
def test_every_kind_of_point_has_its_entry(kind, label):
    subject = path(points=(special(kind, 5, 1.5, 1.5),))
    assert legend(draw(subject)) == [STABLE, UNSTABLE, label, "computed state"]


def test_snap_is_a_line_of_its_own():
    """No equilibria join the states before and after it: a straight dotted line does."""
    subject = path(points=(special("snap", 5, 1.5, 1.5),))
    figure = draw(subject)
    assert "snap" in legend(figure)
    assert "end of a snap" in legend(figure)
    ends = np.column_stack([subject.gamma, subject.moment])[4:6] / (np.pi, 1.0)
    curves = [line.get_xydata() for line in figure.axes[0].lines]
    (jump,) = [c for c in curves if len(c) > 2 and np.allclose(c[[0, -1]], ends)]
    along = np.linspace(0.0, 1.0, len(jump))[:, None]
    assert_allclose(jump, ends[0] + along * (ends[1] - ends[0]), atol=1e-12)


def test_a_snap_under_a_dead_moment_is_level_and_ends_at_the_ring_s_own():
    """M is given until gamma meets its stop; the curve goes level, then to the landing."""
    subject = path(
        points=(special("snap", 5, 1.5, 1.5),), numerics={"n_edges": 32, "control": "moment"}
    )
    ends = np.column_stack([subject.gamma, subject.moment])[4:6] / (np.pi, 1.0)
    curves = [line.get_xydata() for line in draw(subject).axes[0].lines]
    (jump,) = [c for c in curves if len(c) > 2 and np.allclose(c[[0, -1]], ends)]
    assert_allclose(jump[:-1, 1], ends[0, 1], atol=1e-12)
    assert jump[-2, 0] == pytest.approx(ends[1, 0])


def test_title_of_a_path_that_comes_back_says_so():
    """Gamma goes up and ends at 0 again."""
    gamma = np.append(np.linspace(0.0, np.pi, 6), np.linspace(np.pi, 0.0, 6)[1:])
    subject = path(gamma=gamma, mode=None, at_pi=None, points=())
    assert draw(subject).texts[0].get_text().endswith("= π and back")


def test_states_that_would_hide_their_line_are_left_out():
    """Hundreds of dots are a thick line: they and their entry in the legend are not drawn."""
    gamma = np.linspace(0.0, 3.0, 300)
    unknown = counts([None] * 300)
    many = {"gamma": gamma, "moment": np.sin(gamma), "energy": gamma**2}
    subject = path(**many, index=unknown, index_moment=unknown, points=())
    assert "computed state" not in legend(draw(subject))
    assert "computed state" in legend(draw(path()))


def test_path_without_index_says_that_stability_was_not_computed():
    figure = draw(path(index=counts([None] * 11)))
    assert legend(figure)[0] == UNKNOWN
    assert not any(line.is_dashed() for line in figure.axes[0].lines)


def test_title_names_ring_section_edges_and_mode():
    title = draw(path()).texts[0].get_text()
    for part in ("ellipse, b/a = 0.85, about y", "h/t = 1.6", "0.3", "32 edges"):
        assert part in title
    assert title.endswith("stable at fixed M, released: unknown, snap-back")


def test_title_of_an_incomplete_path_says_so():
    subject = path(mode=None, at_pi=None, status="interrupted")
    assert draw(subject).texts[0].get_text().endswith("interrupted")


def test_section_without_shape_is_named_by_its_ratios():
    subject = path(section={"h_over_t": None, "nu": None, "alpha": 0.9, "beta": 2.5})
    assert "α = 0.9, β = 2.5" in draw(subject).texts[0].get_text()


def test_snapshots_hold_the_ends_and_the_peak_and_are_lettered_on_both_curves():
    subject = path(shapes=shapes(), moment=np.sin(np.linspace(0.0, np.pi, 11)) + 0.1)
    above, below, row = draw(subject).axes
    said = [text.get_text().split("$   ")[1] for text in row.texts]
    named = [f"{gamma / np.pi:.3g} π" for gamma in subject.gamma]
    assert [said[0], said[-1]] == [rf"$\gamma$ = {named[k]}" for k in (0, -1)]
    assert rf"$\gamma$ = {named[5]}" in said
    assert len(row.collections) == len(said) == 6
    for panel in (above, below):
        assert [text.get_text() for text in panel.texts] == list("ABCDEF")


def test_ribbons_are_in_one_scale():
    """A ring of half the size is drawn half as large, its ribbon as wide."""
    flat = shapes(1)
    size = np.linspace(1.0, 0.5, 11)[:, None, None]
    shrinking = Shapes(flat.x * size, np.repeat(flat.frames, 11, axis=0))
    row = draw(path(shapes=shrinking)).axes[2]
    first, last = (
        np.ptp(np.concatenate([p.vertices for p in drawn.get_paths()])[:, 1])
        for drawn in (row.collections[0], row.collections[-1])
    )
    assert 0.5 < last / first < 0.62


def test_path_of_one_state_is_a_point():
    one = path(
        **{name: getattr(path(), name)[:1] for name in ("gamma", "moment", "energy", "index")},
        index_moment=counts([None]),
        points=(),
        shapes=shapes(1),
    )
    figure = draw(one)
    assert [text.get_text() for text in figure.axes[0].texts] == ["A"]


def test_path_without_states_is_refused():
    empty = {name: np.array([]) for name in ("gamma", "moment", "energy")}
    subject = path(**empty, index=counts([]), index_moment=counts([]), points=())
    with pytest.raises(ValueError, match="at least one state"):
        draw(subject)


@pytest.mark.parametrize(
    ("suffix", "begins"), [(".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")]
)
def test_format_follows_the_suffix(tmp_path, suffix, begins):
    file = tmp_path / f"plot{suffix}"
    save(draw(path(shapes=shapes())), file)
    assert file.read_bytes().startswith(begins)


@pytest.mark.parametrize("name", ["plot.gif", "plot", "png"])
def test_unknown_suffix_is_named(tmp_path, name):
    with pytest.raises(ValueError, match=rf"must end in .png, .pdf, .svg, got '.*{name}'"):
        save(draw(path()), tmp_path / name)


def test_absent_folder_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"nowhere/plot\.png' cannot be written"):
        save(draw(path()), tmp_path / "nowhere" / "plot.png")


def test_folder_in_place_of_the_file_is_named_and_nothing_is_left(tmp_path):
    (tmp_path / "plot.png").mkdir()
    with pytest.raises(ValueError, match=r"plot\.png' cannot be written"):
        save(draw(path()), tmp_path / "plot.png")
    assert [file.name for file in tmp_path.iterdir()] == ["plot.png"]


def test_drawing_needs_neither_display_nor_pyplot():
    """No global state: pyplot, with its figures and its backend, is never loaded."""
    code = "import sys, der.viz.plots.path; print('matplotlib.pyplot' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "False"


def test_path_is_the_same_after_drawing():
    subject = path(shapes=shapes())
    before = replace(subject).to_json()
    draw(subject)
    assert subject.to_json() == before


@pytest.mark.parametrize("width", [5.7, 6.5, 8.0])
def test_a_long_title_fits_into_its_picture(width):
    """Letters of a smaller size are not narrower in proportion."""
    name = "profile, reference length = 100, curvature error = 0.11, resolution = 0.01"
    rest = "   |   h/t = 10, ν = 0.35   |   a = 100 mm   |   in its plane"
    figure = blank(width, 3.0, name + rest)
    box = figure.texts[0].get_window_extent()
    assert box.x0 > 0.01 * figure.bbox.width
    assert box.x1 < 0.99 * figure.bbox.width
