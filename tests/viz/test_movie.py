"""Movies: GIF without any program, MP4 by ffmpeg; atomic; each picture at its state."""

import errno
import shutil
import subprocess
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

import der
from der.utils import files
from der.viz.movie import DPI, SIZE, MovieFigure, save_movie
from der.viz.palette import PAIR
from der.viz.resampling import resampled

FRAMES = 6


@pytest.fixture(scope="module")
def path():
    scene = der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=32, shapes=True)
    return der.fold(scene)


@pytest.fixture(scope="module")
def pictures(path, tmp_path_factory):
    """All pictures of a small GIF, (n, height, width, 3)."""
    file = tmp_path_factory.mktemp("movie") / "some.gif"
    save_movie(path, file, frames=FRAMES, fps=2)
    return opened(file)


def opened(file):
    with Image.open(file) as motion:
        found = []
        for k in range(motion.n_frames):
            motion.seek(k)
            found.append(np.asarray(motion.convert("RGB")).astype(float))
    return np.array(found)


def apart(a, b):
    """How many points differ in colour."""
    return np.count_nonzero(np.abs(a - b).max(axis=-1) > 40)


def test_there_is_a_picture_a_step_in_the_size_said(path, pictures):
    """Equal neighbours, as at both ends, are one picture that stays longer."""
    n = len(resampled(path, FRAMES).x)
    assert pictures.shape == (n, SIZE[1] * DPI, SIZE[0] * DPI, 3)


def test_ring_and_dots_move_and_axes_do_not(pictures):
    """Ring on the left, curves on the right; the strip with tick labels stays as it is."""
    width = pictures.shape[2]
    for before, after in pairwise(pictures):
        assert apart(before[80:, : width // 2], after[80:, : width // 2]) > 100
        assert apart(before[:, width // 2 :], after[:, width // 2 :]) > 20
        assert apart(before[-60:, width // 2 :], after[-60:, width // 2 :]) < 20


def test_dot_is_where_the_state_is(path):
    """In the units of the axes, at every step; none of M within snaps."""
    scene = der.Scene(
        der.circle(),
        der.rectangular_section(1.6),
        n_edges=32,
        shapes=True,
        history=True,
        control="angle",
    )
    path = der.fold(scene)
    motion = resampled(path, 40)
    figure = MovieFigure([path], [motion], 15)
    (ring,) = figure.rings
    for step in range(len(motion.x)):
        list(ring.show(step))
        for dot, value in zip(ring.dots, (motion.moment[step], motion.energy[step]), strict=True):
            (x,), (y,) = dot.get_data()
            assert x == pytest.approx(motion.gamma[step] / np.pi)
            np.testing.assert_equal(y, value)
    assert np.isnan(motion.moment).any()


def test_all_of_the_ring_is_in_sight_at_all_times(path):
    motion = resampled(path, 30)
    figure = MovieFigure([path], [motion], 15)
    (ring,) = figure.rings
    for step in range(len(motion.x)):
        list(ring.show(step))
        places = np.concatenate([p.vertices for p in ring.ribbon.get_paths()])
        row = ring.ribbon.axes
        for k, limits in enumerate((row.get_xlim(), row.get_ylim())):
            assert limits[0] <= places[:, k].min() <= places[:, k].max() <= limits[1]


def test_two_rings_are_in_one_movie_and_in_one_scale(path, tmp_path):
    """Both colours of dots are there."""
    scene = der.Scene(der.ellipse(0.6), der.rectangular_section(4), n_edges=32, shapes=True)
    other = der.fold(scene)
    save_movie([path, other], tmp_path / "two.gif", frames=3, fps=2)
    last = opened(tmp_path / "two.gif")[-1]
    for colour in PAIR:
        rgb = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
        assert np.count_nonzero(np.abs(last - rgb).max(axis=-1) < 24) > 100
    figure = MovieFigure([path, other], [resampled(path, 5), resampled(other, 5)], 2)
    one, two = (ring.ribbon.axes for ring in figure.rings)
    assert (one.get_xlim(), one.get_ylim()) == (two.get_xlim(), two.get_ylim())


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed here")
def test_mp4_is_a_movie_that_ffmpeg_reads(path, tmp_path):
    """As many pictures as steps, and those that stay at both ends."""
    save_movie(path, tmp_path / "some.mp4", frames=FRAMES, fps=5)
    command = ["ffmpeg", "-v", "error", "-i", tmp_path / "some.mp4", "-f", "rawvideo", "-"]
    command[-1:] = ["-pix_fmt", "gray", "-"]
    raw = subprocess.run(command, capture_output=True, check=True).stdout
    n = len(resampled(path, FRAMES).x) + 2 * 4  # 0.8 s at both ends
    assert len(raw) == n * SIZE[0] * DPI * SIZE[1] * DPI


# --- What is refused -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["movie.mov", "movie", "gif"])
def test_other_suffix_is_refused(path, tmp_path, name):
    with pytest.raises(ValueError, match=rf"movie must end in .gif, .mp4, got '.*{name}'"):
        save_movie(path, tmp_path / name)


def test_missing_ffmpeg_is_named_with_what_needs_none(path, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ValueError, match=r"movie '.*a\.mp4' needs the program ffmpeg.* \.gif"):
        save_movie(path, tmp_path / "a.mp4")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed here")
def test_what_ffmpeg_refuses_is_said_in_one_line(path, tmp_path, monkeypatch):
    """Such as a codec that it was built without."""
    monkeypatch.setattr("der.viz.movie.CODEC", "of no such name")
    with pytest.raises(ValueError, match=r"movie '.*a\.mp4' cannot be written: ffmpeg") as refused:
        save_movie(path, tmp_path / "a.mp4", frames=2, fps=1)
    assert "\n" not in str(refused.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "value"), [("fps", 0), ("fps", 1000), ("frames", 1)])
def test_bad_numbers_are_named(path, tmp_path, name, value):
    with pytest.raises(ValueError, match=rf"{name} must be .*, got {value}"):
        save_movie(path, tmp_path / "a.gif", **{name: value})


def test_three_rings_are_too_many(path, tmp_path):
    with pytest.raises(ValueError, match="path must be one or two, got 3"):
        save_movie([path] * 3, tmp_path / "a.gif")


def test_full_disk_leaves_the_old_file_and_nothing_else(path, tmp_path, monkeypatch):
    file = tmp_path / "some.gif"
    file.write_bytes(b"before")

    def fill(place, write):
        def full(opened):
            opened.write(b"GIF8")
            raise OSError(errno.ENOSPC, "No space left on device")

        files.write_whole(place, full)

    monkeypatch.setattr("der.viz.files.write_whole", fill)
    with pytest.raises(ValueError, match=r"some\.gif' cannot be written: No space left on device"):
        save_movie(path, file, frames=2, fps=1)
    assert file.read_bytes() == b"before"
    assert [found.name for found in tmp_path.iterdir()] == ["some.gif"]
