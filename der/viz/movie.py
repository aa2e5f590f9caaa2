"""A path as a movie: the ring beside M(gamma) and U(gamma).

matplotlib's writers make GIF by Pillow and MP4 by ffmpeg. Still parts are drawn once, moving parts
on a copy of them, and the writer gets the finished picture.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path as File
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from der.geometry.scale import Scale
from der.records.path import Path
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.animation import Motion, grips
from der.viz.captions import captions
from der.viz.files import checked_suffix, refused, write
from der.viz.palette import INK, PAIR, QUIET, STABLE, UNSTABLE
from der.viz.plots import style
from der.viz.resampling import in_step, one_or_two
from der.viz.ribbon import HALF_WIDTH, projected, quadrilaterals
from der.viz.titles import names

FORMATS = (".gif", ".mp4")
SIZE, DPI = (8.0, 4.5), 100  # inches; 800 x 450 px
CODEC = "libx264"  # of an MP4
FPS = 15
FRAMES = 105  # seven seconds; special points add to them
REST = 0.8  # s: how long the first and the last picture stay
POINTER = 0.42  # length of a grip's arrow, over the ring's mean radius
ARC = 25  # points on the arc of its rotation
PLACES = {  # boxes of rings and of both curves, over the figure's size, by the number of rings
    1: ([(0.01, 0.05, 0.47, 0.73)], [(0.565, 0.53, 0.42, 0.43), (0.565, 0.165, 0.42, 0.33)]),
    2: (
        [(0.02, 0.40, 0.46, 0.405), (0.52, 0.40, 0.46, 0.405)],
        [(0.075, 0.155, 0.405, 0.235), (0.575, 0.155, 0.405, 0.235)],
    ),
}
AXIS = (0, (6, 2, 1, 2))  # dashes of the twisting axis
POINTER_LOOK: dict[str, Any] = {"color": INK, "linewidth": 1.1, "solid_capstyle": "round"}
DOT = style.mark("o", 7.5) | {"markeredgecolor": "white", "markeredgewidth": 1.3}
SAID = (  # height and look of the lines above a ring: numbers, stability, event
    (0.905, {"fontsize": 9.5}),
    (0.862, {"fontsize": 9}),
    (0.822, {"fontsize": 8.5, "fontstyle": "italic"}),
)


def save_movie(
    path: Path | Sequence[Path], file: FilePath, *, fps: int = FPS, frames: int = FRAMES
) -> None:
    """Write the movie of a path, or of two beside each other, atomically.

    Parameters
    ----------
    path : with shapes; two of them move at equal gamma where they can (`resampling.in_step`).
    file : .gif, which needs nothing, or .mp4, which needs ffmpeg.
    fps : pictures a second.
    frames : pictures, special points besides.

    Raises
    ------
    ValueError
        If the suffix is another, ffmpeg is missing, the place cannot be written to, a path has no
        shapes, or there are more than two.
    """
    check_movie(file)
    if not 1 <= fps <= 60:
        raise ValueError(f"fps must be from 1 to 60, got {fps!r}")
    paths = one_or_two(path)
    figure = MovieFigure(paths, in_step(paths, frames), fps)
    with tempfile.TemporaryDirectory() as folder:
        made = File(folder) / f"movie{File(file).suffix.lower()}"
        with refused("movie", file):
            try:
                _encode(figure, made, fps)
            except subprocess.CalledProcessError as problem:
                reason = f"ffmpeg ended with code {problem.returncode}"
                hint = f"it may lack the codec {CODEC}, a .gif needs none"
                raise OSError(f"{reason}; {hint}") from problem
        write("movie", file, made.read_bytes())


def check_movie(file: FilePath) -> None:
    """Refuse a file to which no movie can be written; called before solving."""
    suffix = checked_suffix("movie", file, FORMATS)
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ValueError(
            f"movie {str(file)!r} needs the program ffmpeg, which is not installed here; "
            f"a .gif needs nothing"
        )


def _encode(figure: MovieFigure, file: File, fps: int) -> None:
    """Give the pictures to the writer of the file's kind."""
    screen = _Screen(figsize=SIZE, dpi=DPI)
    writer: FFMpegWriter | PillowWriter
    if file.suffix == ".gif":
        writer = PillowWriter(fps=fps)
    else:
        more = ["-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"]
        writer = FFMpegWriter(fps=fps, codec=CODEC, extra_args=more)
    with writer.saving(screen, str(file), DPI):
        for screen.picture in figure.pictures():
            writer.grab_frame()


class _Screen(Figure):
    """A figure for a writer, which gives it finished pictures instead of drawing."""

    picture = b""

    def savefig(self, fname: Any, **_: Any) -> None:
        """Write the picture, RGBA bytes."""
        fname.write(self.picture)


# --- Pictures --------------------------------------------------------------------------------


class _Ring:
    """One ring: what moves in its picture and on both curves."""

    def __init__(self, path: Path, motion: Motion, colour: str, curves: Sequence[Axes]) -> None:
        self.motion = motion
        self.said = captions(path, motion)
        self.pointers = grips(motion, POINTER, ARC)
        self.width = HALF_WIDTH * motion.size
        self.ribbon: Any = PolyCollection([], linewidths=0.5)
        self.arrows = [Line2D([], [], clip_on=False, **POINTER_LOOK) for _ in range(2)]
        dot = DOT | {"markerfacecolor": colour, "zorder": 6, "clip_on": False}
        self.dots = [axes.plot([], [], **dot)[0] for axes in curves]
        self.texts: list[Any] = []

    @property
    def reach(self) -> Array:
        """Least and largest coordinates (2, 2) of the picture, at all times."""
        pads = self.width * np.array([[-1.3], [1.3]])
        places = [projected(self.motion.x.reshape(-1, 3)) + pad for pad in pads]
        everything = np.concatenate([*places, projected(self.pointers.reshape(-1, 3))])
        return np.stack([everything.min(axis=0), everything.max(axis=0)])

    def place(self, row: Axes, reach: Array) -> None:
        """Put the ring on its own axes, in constant limits."""
        row.set_xlim(*reach[:, 0])
        row.set_ylim(*reach[:, 1])
        row.set_aspect("equal")
        row.set_axis_off()
        z = 1.25 * float(np.abs(self.motion.x[..., 2]).max())
        axis = projected(np.array([[0.0, 0.0, -z], [0.0, 0.0, z]]))
        look: dict[str, Any] = {"color": QUIET, "linewidth": 0.8, "linestyle": AXIS, "zorder": 0}
        row.plot(*axis.T, clip_on=False, **look)
        row.add_collection(self.ribbon, autolim=False)
        for line in self.arrows:
            row.add_line(line)

    def show(self, step: int) -> Iterator[Any]:
        """Move all artists to a step, and yield them in the order of drawing."""
        motion, said = self.motion, self.said[step]
        corners, colours = quadrilaterals(motion.x[step], motion.frames[step, :, 0], self.width)
        self.ribbon.set_verts(corners)
        self.ribbon.set_facecolor(colours)
        self.ribbon.set_edgecolor(colours)
        for line, pointer in zip(self.arrows, self.pointers[:, step], strict=True):
            line.set_data(*projected(pointer).T)
        for dot, value in zip(self.dots, (motion.moment[step], motion.energy[step]), strict=True):
            dot.set_data([motion.gamma[step] / math.pi], [value])
        self.texts[1].set_color({True: STABLE, False: UNSTABLE, None: QUIET}[said.stable])
        for text, now in zip(self.texts, (said.numbers, said.line, said.event), strict=True):
            text.set_text(now)
        yield from (self.ribbon, *self.arrows, *self.dots, *self.texts)


class MovieFigure:
    """The figure with the still parts, and the pictures made on it."""

    def __init__(self, paths: Sequence[Path], motions: Sequence[Motion], fps: int) -> None:
        self.figure = Figure(figsize=SIZE, dpi=DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        self.hold = round(REST * fps)
        two = len(paths) == 2
        rows, curves = ([self.figure.add_axes(box) for box in half] for half in PLACES[len(paths)])
        colours = PAIR if two else (INK,)
        called = names(paths)
        self.rings = []
        for path, motion, row, colour, name in zip(
            paths, motions, rows, colours, called, strict=True
        ):
            ring = _Ring(path, motion, colour, curves)
            self._name(ring, row.get_position(original=True), name, colour)
            for axes, height in zip(curves, (path.moment, path.energy), strict=True):
                _draw(axes, path, height, colour if two else None)
            self.rings.append(ring)
        reach = np.array([ring.reach for ring in self.rings])  # one scale for both
        limits = np.stack([reach[:, 0].min(axis=0), reach[:, 1].max(axis=0)])
        for ring, row in zip(self.rings, rows, strict=True):
            ring.place(row, limits)
        _label(curves, paths[0].scale, beside=two)
        self._legend(paths, called, two=two)
        for ring in self.rings:
            for artist in ring.show(0):
                artist.set_animated(True)

    def _name(self, ring: _Ring, box: Bbox, name: str, colour: str) -> None:
        """The lines above a ring: its name, in the size that fits, and those that change."""
        look: dict[str, Any] = {"ha": "center", "va": "center", "color": colour}
        x = box.x0 + 0.5 * box.width
        head = self.figure.text(x, 0.955, name, fontweight="bold", fontsize=10, **look)
        share = self._share(head, box)
        if share < 1.0:  # a long name takes two lines
            head.set_text("\n".join(textwrap.wrap(name, -(-len(name) // 2) + 6)))
            size = min(8.5, 10.0 * self._share(head, box))
            head.set(fontsize=size, y=0.96, linespacing=1.05)
        look["color"] = INK
        ring.texts = [self.figure.text(x, y, "", **look | own) for y, own in SAID]

    def _share(self, text: Text, box: Bbox) -> float:
        """Width of a box over that of a text."""
        return float(box.width * self.figure.bbox.width / text.get_window_extent().width)

    def _legend(self, paths: Sequence[Path], called: Sequence[str], *, two: bool) -> None:
        """The legend of the curves; two rings have entries of their own."""
        handles = list(style.stretch_entries(*paths))
        if two:  # curves have the colours of their rings
            handles = [one for one in handles if one.get_linestyle() != "-"]
            for one in handles:
                one.set_color(QUIET)
            rings = zip(PAIR, called, strict=True)
            handles = [*(style.entry(name, color=c, marker="o") for c, name in rings), *handles]
        style.legend_below(self.figure, handles, fontsize=7.5)

    def pictures(self) -> Iterator[bytes]:
        """Every picture of the motion, RGBA; the first and the last are repeated."""
        self.canvas.draw()
        still = self.canvas.copy_from_bbox(self.figure.bbox)
        last = len(self.rings[0].motion.x) - 1
        for step in [0] * self.hold + list(range(last + 1)) + [last] * self.hold:
            self.canvas.restore_region(still)
            for ring in self.rings:
                for artist in ring.show(step):
                    self.figure.draw_artist(artist)
            yield bytes(self.canvas.buffer_rgba())


def _draw(axes: Axes, path: Path, height: Array, colour: str | None) -> None:
    """The curve of one path, in its own colour where two share the axes."""
    style.draw_stretches(axes, path, height, colour)
    at = [point.position for point in path.points if point.kind in ("fold", "limit", "snap")]
    look = style.mark("o", 3.0) | {"markeredgecolor": colour or INK}
    axes.plot(path.gamma[at] / math.pi, height[at], zorder=3, **look)


def _label(curves: Sequence[Axes], scale: Scale | None, *, beside: bool) -> None:
    """Labels and ticks of the axes of M and U."""
    for axes, label in zip(curves, (style.moment(scale), style.energy(scale)), strict=True):
        style.label_axes(axes, style.GAMMA, label, fontsize=8.5)
        axes.margins(x=0.03, y=0.1)
        axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
        axes.yaxis.set_major_locator(MaxNLocator(4))
    style.zero_line(curves[0])
    if not beside:
        curves[0].set_xlabel("")
        curves[0].tick_params(labelbottom=False)
        curves[1].set_xlim(curves[0].get_xlim())
        for axes in curves:
            axes.yaxis.set_label_coords(-0.105, 0.5)
