"""A path as a film for those without a viewer: the ring beside M(gamma) and U(gamma).

GIF by Pillow, MP4 by ffmpeg, both through matplotlib's writers. What stands still is drawn once;
what moves is drawn on a copy of it, and the writer is shown the finished picture.
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
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox

from der.records.path import Path
from der.utils.checks import Array
from der.utils.files import FilePath, write_whole
from der.viz.animation import Playback, grips
from der.viz.captions import captions, names
from der.viz.curve import SNAP, stretches
from der.viz.palette import DASHES, INK, QUIET, STABLE, UNSTABLE
from der.viz.ribbon import HALF_WIDTH
from der.viz.ribbon import projected as flat
from der.viz.ribbon import quadrilaterals as seen
from der.viz.tween import in_step

FORMATS = (".gif", ".mp4")
SIZE, DPI = (8.0, 4.5), 100  # inches; 800 x 450 px
CODEC = "libx264"  # of an MP4
FPS = 15
FRAMES = 105  # and what special points add: seven seconds
REST = 0.8  # seconds that the first and the last picture stay
PALE, FALLING = "#d9d9d9", QUIET
STRETCHES: dict[bool | str | None, tuple[str, str, Any]] = {
    True: ("stable", STABLE, "-"),
    False: ("unstable", UNSTABLE, DASHES),
    None: ("equilibria", STABLE, "-"),
    SNAP: ("the ring snaps", FALLING, (0, (1.2, 1.4))),
}
PAIR = (STABLE, "#CC79A7")  # of two rings, whose curves share panels
POINTER = 0.42  # length of a grip's arrow, over the ring's mean radius
ARC = 25  # points on the arc that shows how far it has turned


def save_movie(
    path: Path | Sequence[Path], file: FilePath, *, fps: int = FPS, frames: int = FRAMES
) -> None:
    """Write the film of a path, or of two beside each other, whole or not at all.

    Parameters
    ----------
    path : with shapes; of two, both move at equal gamma wherever there are any (`tween.in_step`).
    file : .gif, which needs nothing, or .mp4, which needs ffmpeg.
    fps : pictures a second.
    frames : pictures, special points besides.

    Raises
    ------
    ValueError
        If the suffix is another, ffmpeg is missing, the place cannot be written to, a path has no
        shapes, or there are more than two.
    """
    paths = [path] if isinstance(path, Path) else list(path)
    check_movie(file)
    if not 1 <= fps <= 60:
        raise ValueError(f"fps must be from 1 to 60, got {fps!r}")
    if len(paths) not in (1, 2):
        raise ValueError(f"path must be one or two, got {len(paths)}")
    if frames < 2:
        raise ValueError(f"frames must be at least 2, got {frames!r}")
    stage = _Stage(paths, in_step(paths, frames), fps)
    with tempfile.TemporaryDirectory() as folder:
        made = File(folder) / f"film{File(file).suffix.lower()}"
        try:
            _write(stage, made, fps)
            content = made.read_bytes()
            write_whole(file, lambda opened: opened.write(content))
        except subprocess.CalledProcessError as problem:
            raise ValueError(
                f"movie {str(file)!r} cannot be written: ffmpeg ended with code "
                f"{problem.returncode}; it may lack the codec {CODEC}, a .gif needs none"
            ) from problem
        except OSError as problem:
            reason = problem.strerror or problem
            raise ValueError(f"movie {str(file)!r} cannot be written: {reason}") from problem


def check_movie(file: FilePath) -> None:
    """Refuse, before anything is solved, a file that no film can be written to."""
    suffix = File(file).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f"movie must end in {', '.join(FORMATS)}, got {str(file)!r}")
    if suffix == ".mp4" and shutil.which("ffmpeg") is None:
        raise ValueError(
            f"movie {str(file)!r} needs the program ffmpeg, which is not installed here; "
            f"a .gif needs nothing"
        )


def _write(stage: _Stage, file: File, fps: int) -> None:
    """Show the pictures to the writer of the file's kind."""
    screen = _Screen(figsize=SIZE, dpi=DPI)
    writer: FFMpegWriter | PillowWriter
    if file.suffix == ".gif":
        writer = PillowWriter(fps=fps)
    else:
        more = ["-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"]
        writer = FFMpegWriter(fps=fps, codec=CODEC, extra_args=more)
    with writer.saving(screen, str(file), DPI):
        for screen.picture in stage.pictures():
            writer.grab_frame()


class _Screen(Figure):
    """What a writer is shown: pictures that are finished, in place of drawing all of a figure."""

    picture = b""

    def savefig(self, fname: Any, **_: Any) -> None:
        """Write the picture, RGBA bytes."""
        fname.write(self.picture)


# --- The stage -------------------------------------------------------------------------------


class _Ring:
    """One ring on the stage: what moves in its picture and in both panels."""

    def __init__(self, path: Path, film: Playback, colour: str, panels: Sequence[Axes]) -> None:
        self.film = film
        self.said = captions(path, film)
        self.pointers = grips(film, POINTER, ARC)
        self.width = HALF_WIDTH * film.size
        self.ribbon: Any = PolyCollection([], linewidths=0.5)
        look: dict[str, Any] = {
            "color": INK,
            "linewidth": 1.1,
            "solid_capstyle": "round",
            "clip_on": False,
        }
        self.arrows = [Line2D([], [], **look) for _ in range(2)]
        self.dots = [
            panel.plot(
                [],
                [],
                "o",
                color=colour,
                markersize=7.5,
                zorder=6,
                clip_on=False,
                markeredgecolor="white",
                markeredgewidth=1.3,
            )[0]
            for panel in panels
        ]
        self.words: list[Any] = []

    @property
    def reach(self) -> Array:
        """Least and largest coordinates (2, 2) of the picture, at all times."""
        pads = self.width * np.array([[-1.3], [1.3]])
        places = [flat(self.film.x.reshape(-1, 3)) + pad for pad in pads]
        everything = np.concatenate([*places, flat(self.pointers.reshape(-1, 3))])
        return np.stack([everything.min(axis=0), everything.max(axis=0)])

    def place(self, row: Axes, reach: Array) -> None:
        """Put the ring on its own axes, in limits that never change."""
        row.set_xlim(*reach[:, 0])
        row.set_ylim(*reach[:, 1])
        row.set_aspect("equal")
        row.set_axis_off()
        z = 1.25 * float(np.abs(self.film.x[..., 2]).max())
        axis = flat(np.array([[0.0, 0.0, -z], [0.0, 0.0, z]]))
        dashed: Any = (0, (6, 2, 1, 2))
        row.plot(*axis.T, color=QUIET, linewidth=0.8, linestyle=dashed, zorder=0, clip_on=False)
        row.add_collection(self.ribbon, autolim=False)
        for line in self.arrows:
            row.add_line(line)

    def show(self, step: int) -> Iterator[Any]:
        """Move everything to a step, and hand out what has been moved, in the order of drawing."""
        film, said = self.film, self.said[step]
        corners, colours = seen(film.x[step], film.frames[step, :, 0], self.width)
        self.ribbon.set_verts(corners)
        self.ribbon.set_facecolor(colours)
        self.ribbon.set_edgecolor(colours)
        yield self.ribbon
        for grip, line in enumerate(self.arrows):
            line.set_data(*flat(self.pointers[grip, step]).T)
            yield line
        for dot, value in zip(self.dots, (film.moment[step], film.energy[step]), strict=True):
            dot.set_data([film.gamma[step] / math.pi], [value])
            yield dot
        colour = {True: STABLE, False: UNSTABLE, None: QUIET}[said.stable]
        self.words[1].set_color(colour)
        for text, words in zip(self.words, (said.numbers, said.line, said.event), strict=True):
            text.set_text(words)
            yield text


class _Stage:
    """The figure with all that stands still, and the pictures made on it."""

    def __init__(self, paths: Sequence[Path], films: Sequence[Playback], fps: int) -> None:
        self.figure = Figure(figsize=SIZE, dpi=DPI, facecolor="white")
        self.canvas = FigureCanvasAgg(self.figure)
        self.hold = round(REST * fps)
        two = len(paths) == 2
        rows, panels = self._two() if two else self._one()
        colours = PAIR if two else (INK,)
        called = names(paths)
        self.rings = []
        for path, film, row, colour, name in zip(paths, films, rows, colours, called, strict=True):
            ring = _Ring(path, film, colour, panels)
            box = row.get_position(original=True)
            self._say(ring, box, name, colour if two else INK)
            for panel, height in zip(panels, (path.moment, path.energy), strict=True):
                _draw(panel, path, height, colour if two else None)
            self.rings.append(ring)
        reach = np.array([ring.reach for ring in self.rings])  # one scale for both
        limits = np.stack([reach[:, 0].min(axis=0), reach[:, 1].max(axis=0)])
        for ring, row in zip(self.rings, rows, strict=True):
            ring.place(row, limits)
        _dress(panels, beside=two)
        self._legend(paths, called, two=two)
        for ring in self.rings:
            for artist in ring.show(0):
                artist.set_animated(True)

    def _one(self) -> tuple[list[Axes], list[Axes]]:
        add = self.figure.add_axes
        return [add((0.01, 0.05, 0.47, 0.73))], [
            add((0.565, 0.53, 0.42, 0.43)),
            add((0.565, 0.165, 0.42, 0.33)),
        ]

    def _two(self) -> tuple[list[Axes], list[Axes]]:
        add = self.figure.add_axes
        return [add((0.02, 0.40, 0.46, 0.405)), add((0.52, 0.40, 0.46, 0.405))], [
            add((0.075, 0.155, 0.405, 0.235)),
            add((0.575, 0.155, 0.405, 0.235)),
        ]

    def _say(self, ring: _Ring, box: Bbox, name: str, colour: str) -> None:
        """The lines above a ring: its name, in the size that fits, and those that change."""
        look: dict[str, Any] = {"ha": "center", "va": "center"}
        x = box.x0 + 0.5 * box.width
        head = self.figure.text(x, 0.955, name, color=colour, fontweight="bold", **look)
        head.set_fontsize(10)
        room = box.width * self.figure.bbox.width / head.get_window_extent().width
        if room < 1.0:  # a long name takes two lines
            head.set_text("\n".join(textwrap.wrap(name, -(-len(name) // 2) + 6)))
            room = box.width * self.figure.bbox.width / head.get_window_extent().width
            head.set(fontsize=min(8.5, 10.0 * room), y=0.96, linespacing=1.05)
        ring.words = [
            self.figure.text(x, 0.905, "", fontsize=9.5, color=INK, **look),
            self.figure.text(x, 0.862, "", fontsize=9, color=INK, **look),
            self.figure.text(x, 0.822, "", fontsize=8.5, color=INK, fontstyle="italic", **look),
        ]

    def _legend(self, paths: Sequence[Path], called: Sequence[str], *, two: bool) -> None:
        kinds = {kind for path in paths for kind, _ in stretches(path, path.energy)}
        handles = []
        if two:
            handles = [
                Line2D([], [], color=colour, marker="o", label=name)
                for colour, name in zip(PAIR, called, strict=True)
            ]
        for kind, (label, colour, style) in STRETCHES.items():
            if kind in kinds and not (two and kind in (True, None)):
                colour = QUIET if two else colour
                handles.append(Line2D([], [], color=colour, linestyle=style, label=label))
        self.figure.legend(
            handles=handles,
            loc="lower center",
            bbox_to_anchor=(0.5 if two else 0.775, 0.0),
            ncols=4,
            frameon=False,
            fontsize=7.5,
            handlelength=2.2,
            columnspacing=1.4,
            labelcolor=INK,
        )

    def pictures(self) -> Iterator[bytes]:
        """Every picture of the film, RGBA; the ends stay for a while."""
        self.canvas.draw()
        still = self.canvas.copy_from_bbox(self.figure.bbox)
        last = len(self.rings[0].film.x) - 1
        for step in [0] * self.hold + list(range(last + 1)) + [last] * self.hold:
            self.canvas.restore_region(still)
            for ring in self.rings:
                for artist in ring.show(step):
                    self.figure.draw_artist(artist)
            yield bytes(self.canvas.buffer_rgba())


def _draw(panel: Axes, path: Path, height: Array, colour: str | None) -> None:
    """The curve of one path; in a colour of its own where it shares the panel."""
    for kind, points in stretches(path, height):
        _, own, style = STRETCHES[kind]
        panel.plot(*points.T, color=colour or own, linestyle=style, linewidth=1.6, zorder=2)
    at = [point.position for point in path.points if point.kind in ("fold", "limit", "snap")]
    panel.plot(
        path.gamma[at] / math.pi,
        height[at],
        "o",
        markersize=3.0,
        zorder=3,
        markerfacecolor="white",
        markeredgecolor=colour or INK,
        markeredgewidth=0.9,
    )


def _dress(panels: Sequence[Axes], *, beside: bool) -> None:
    """Axes, ticks and labels."""
    for panel, label in zip(panels, ("moment  $M\\,a/GJ$", "energy  $U\\,a/GJ$"), strict=True):
        panel.set_ylabel(label, fontsize=8.5, color=INK)
        panel.margins(x=0.03, y=0.1)
        panel.tick_params(labelsize=7.5, color=QUIET, labelcolor=INK, direction="in")
        panel.spines[["top", "right"]].set_visible(False)
        panel.spines[["left", "bottom"]].set_color(QUIET)
        panel.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
        panel.yaxis.set_major_locator(MaxNLocator(4))
        panel.set_xlabel("rotation of a grip  $\\gamma/\\pi$", fontsize=8.5, color=INK)
    panels[0].axhline(0.0, color=PALE, linewidth=0.7, zorder=0)
    if not beside:
        panels[0].set_xlabel("")
        panels[0].tick_params(labelbottom=False)
        panels[1].set_xlim(panels[0].get_xlim())
        for panel in panels:
            panel.yaxis.set_label_coords(-0.105, 0.5)
