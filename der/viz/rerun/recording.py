"""A path as a recording for the rerun viewer, in a file or served while the path is solved.

A recording is made in memory, column by column, when the path is known. The file is written
atomically. The main timeline is `step`, the steps of the motion. The second one is `gamma_mdeg`
(millidegrees), which turns back at folds.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Self

import numpy as np
import rerun as rr

from der.records.energy_surface import Surface
from der.records.landscape import Landscape
from der.records.path import Path
from der.records.units import in_units
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.animation import Motion, animate
from der.viz.captions import about
from der.viz.files import checked_suffix, write
from der.viz.rerun.axes import HIGH, PlotAxes, send_axes, send_labels
from der.viz.rerun.blueprint import (
    CURVES,
    SOLVING,
    UNDER,
    beside,
    landscape_layout,
    layout,
    while_solving,
)
from der.viz.rerun.curves import send_curve, send_events, send_key, send_series
from der.viz.rerun.entities import PAIR, VERMILION, Entities, closed, send_ring
from der.viz.rerun.landscape import send_landscape, send_surface
from der.viz.rerun.server import serving
from der.viz.resampling import in_step, one_or_two
from der.viz.titles import names

APPLICATION = "ring_origami"
SUFFIX = ".rrd"
STEPS = 240  # of two motions side by side


def save_recording(
    path: Path | Sequence[Path], file: FilePath, *, rest: Array | None = None
) -> None:
    """Write the recording of a path, or of two beside each other, atomically.

    Parameters
    ----------
    path : with shapes; two of them move at equal gamma where they can (`resampling.in_step`).
    rest : of one path, as in `animation.animate`.

    Raises
    ------
    ValueError
        If the suffix is not .rrd, the place cannot be written to, there are more than two paths,
        or `animate` refuses the rest.
    """
    checked_suffix("rrd", file, [SUFFIX])
    write("rrd", file, recording_bytes(path, rest=rest))


def save_landscape(landscape: Landscape, file: FilePath, *, surface: Surface | None = None) -> None:
    """Write the recording of a landscape: the ring on its path, and the present state on U.

    Parameters
    ----------
    landscape : of a scene with shapes.
    surface : of the same ring over twist and grip distance, to be shown, too.

    Raises
    ------
    ValueError
        If the suffix is not .rrd, the place cannot be written to, or there are no shapes.
    """
    checked_suffix("rrd", file, [SUFFIX])
    landscape = in_units(landscape)
    surface = None if surface is None else in_units(surface)
    path = landscape.path
    motion = animate(path)

    def send(stream: rr.RecordingStream) -> None:
        has_well = landscape.barriers.open is not None and landscape.barriers.saddle is not None
        stream.send_blueprint(landscape_layout(motion, well=has_well, surface=surface is not None))
        sent = Entities(stream, motion)
        send_landscape(sent, landscape)
        if surface is not None:
            send_surface(sent, surface)
        _send_motion(sent, path)

    write("rrd", file, _recorded([path], [motion], send))


def recording_bytes(path: Path | Sequence[Path], *, rest: Array | None = None) -> bytes:
    """The recording as the bytes of its file; arguments and errors as in `save_recording`."""
    paths = one_or_two(path)
    if len(paths) == 1:
        motion = animate(paths[0], rest=rest)
        return _recorded(paths, [motion], lambda stream: _send(stream, paths[0], motion))
    motions = in_step(paths, STEPS)
    return _recorded(paths, motions, lambda stream: _send_both(stream, paths, motions))


class Live:
    """A recording that is served on this computer while the path is solved; a context.

    `show` adds the states one by one, on their own timeline; `finish` adds the complete path.

    Raises
    ------
    ValueError
        If the port is none, or in use.
    """

    def __init__(self, port: int) -> None:
        self._server = serving(port)
        self.address = self._server.__enter__()
        self._shown = 0
        self._stream = rr.RecordingStream(APPLICATION, send_properties=False)
        self._stream.set_log_time_enabled(False)
        self._stream.connect_grpc(self.address)
        self._stream.send_blueprint(while_solving())

    def show(self, x: Array) -> None:
        """Show the vertices (N, 3) of the next state."""
        self._stream.set_time(SOLVING, sequence=self._shown)
        line = rr.LineStrips3D([closed(x).astype(np.float32)], colors=VERMILION, radii=0.03)
        self._stream.log(SOLVING, line, strict=True)
        self._shown += 1

    def finish(self, path: Path) -> None:
        """Show the complete path; errors as in `animate`."""
        path = in_units(path)
        motion = animate(path)
        self._stream.reset_time()
        self._stream.send_recording_name(names([path])[0])
        _send(self._stream, path, motion)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.flush()  # else the server reports data that it could not send
        self._stream.disconnect()
        self._server.__exit__(None, None, None)


def _recorded(
    paths: Sequence[Path],
    motions: Sequence[Motion],
    send: Callable[[rr.RecordingStream], None],
) -> bytes:
    """The bytes of a recording to which ``send`` adds the contents, named after the paths."""
    identity = _identity(paths, motions)
    stream = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.send_recording_name(" and ".join(names(paths)))
    memory = stream.memory_recording()
    send(stream)
    content = memory.drain_as_bytes()
    stream.disconnect()
    return content


def _send(stream: rr.RecordingStream, path: Path, motion: Motion) -> None:
    """Send the layout and the contents of a motion with its curves."""
    stream.send_blueprint(layout(motion))
    sent = Entities(stream, motion)
    for name in CURVES:
        send_curve(sent, path, name)
    _send_motion(sent, path)


def _send_motion(sent: Entities, path: Path) -> None:
    """Send the ring, its series and events, and what is shown."""
    send_ring(sent)
    send_key(sent)
    send_series(sent, path)
    send_events(sent, path)
    _send_about(sent, about(path, sent.motion))


def _send_both(
    stream: rr.RecordingStream, paths: Sequence[Path], motions: Sequence[Motion]
) -> None:
    """Send two motions on one timeline: rings beside each other, curves in the same axes."""
    called = names(paths)
    stream.send_blueprint(beside(motions, called))
    top = max(motion.top for motion in motions)
    both = [
        Entities(stream, motion, under=f"{under}/", gamma=motions[0].gamma, top=top)
        for under, motion in zip(UNDER, motions, strict=True)
    ]
    common = Entities(stream, motions[0], top=top)
    send_key(common)
    gamma = np.concatenate([path.gamma for path in paths])
    for name in CURVES:
        axes = PlotAxes(gamma, np.concatenate([getattr(path, name) for path in paths]))
        send_axes(common, f"curves/{name}", axes)
        for k, (sent, path, colour) in enumerate(zip(both, paths, PAIR, strict=True)):
            send_curve(sent, path, name, axes=axes, colour=colour)
            place = [[75.0, -HIGH - 12.0 + 7.0 * k]]
            send_labels(sent, f"curves/{name}/name", place, [called[k]], colour=colour)
    for sent, path, name, colour in zip(both, paths, called, PAIR, strict=True):
        send_ring(sent)
        send_series(sent, path, name=name, colour=colour)
        send_events(sent, path, name=name)
    _send_about(common, "\n\n".join([BESIDE, *map(about, paths, motions)]))


BESIDE = (
    "Both rings are twisted together: two states of equal gamma are shown at the same step. Where "
    "one ring turns back or snaps, the other waits. Between the states of a path the rings are "
    "drawn on a spline through them."
)


def _send_about(sent: Entities, text: str) -> None:
    sent.still("about", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


def _identity(paths: Sequence[Path], motions: Sequence[Motion]) -> str:
    """A recording id that depends on the contents, and not on the time."""
    digest = hashlib.sha256()
    for path, motion in zip(paths, motions, strict=True):
        digest.update(about(path, motion).encode())
        for array in (motion.x, motion.frames, motion.gamma, motion.moment, motion.energy):
            digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]
