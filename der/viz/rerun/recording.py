"""A path as a film to scrub through: a rerun recording, in a file or served while it is made.

A recording is made in memory, column by column, once the path is known, and written whole or not
at all. The main timeline is `step`, the steps of the film; since gamma turns back at folds,
`gamma_mdeg` (millidegrees) is the second one.
"""

from __future__ import annotations

import hashlib
import socket
from collections.abc import Sequence
from pathlib import Path as File
from typing import Self

import numpy as np
import rerun as rr

from der.records.energy_surface import Surface
from der.records.landscape import Landscape
from der.records.path import Path
from der.utils.checks import Array
from der.utils.files import FilePath, write_whole
from der.viz.animation import Playback, playback
from der.viz.axes2d import HIGH, Panel
from der.viz.captions import about, names, title
from der.viz.rerun.blueprint import SOLVING, UNDER, beside, layout, terrain, while_solving
from der.viz.rerun.entities import PAIR, VERMILION, Reel, send_ring
from der.viz.rerun.landscape import send_landscape, send_surface
from der.viz.rerun.panels import (
    send_axes,
    send_curve,
    send_events,
    send_key,
    send_labels,
    send_series,
)
from der.viz.tween import in_step

APPLICATION = "ring_origami"
SUFFIX = ".rrd"
STEPS = 240  # of two films side by side


def save_recording(
    path: Path | Sequence[Path], file: FilePath, *, rest: Array | None = None
) -> None:
    """Write the recording of a path, or of two beside each other, whole or not at all.

    Parameters
    ----------
    path : with shapes. Two move at equal gamma wherever there are any (`tween.in_step`), in steps
        between their states.
    rest : of one path, as in `film.playback`.

    Raises
    ------
    ValueError
        If the suffix is not .rrd, the place cannot be written to, there are more than two paths,
        or `playback` refuses the rest.
    """
    _check_suffix(file)
    _write(recording_bytes(path, rest=rest), file)


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
    _check_suffix(file)
    path = landscape.path
    film = playback(path)
    stream = _stream(_identity(path, film), title(path, film))
    memory = stream.memory_recording()
    stream.send_blueprint(terrain(film, well=_has_well(landscape), surface=surface is not None))
    reel = Reel(stream, film)
    send_ring(reel)
    send_key(reel)
    send_landscape(reel, landscape)
    if surface is not None:
        send_surface(reel, surface)
    send_series(reel, path)
    send_events(reel, path)
    _send_about(reel, about(path, film))
    content = memory.drain_as_bytes()
    stream.disconnect()
    _write(content, file)


def recording_bytes(path: Path | Sequence[Path], *, rest: Array | None = None) -> bytes:
    """The recording as the bytes of its file; arguments and errors as in `save_recording`."""
    paths = [path] if isinstance(path, Path) else list(path)
    if len(paths) not in (1, 2):
        raise ValueError(f"path must be one or two, got {len(paths)}")
    if len(paths) == 1:
        film = playback(paths[0], rest=rest)
        stream = _stream(_identity(paths[0], film), title(paths[0], film))
        memory = stream.memory_recording()
        _send(stream, paths[0], film)
    else:
        films = in_step(paths, STEPS)
        both = "".join(_identity(p, film) for p, film in zip(paths, films, strict=True))
        stream = _stream(hashlib.sha256(both.encode()).hexdigest()[:32], " and ".join(names(paths)))
        memory = stream.memory_recording()
        _send_both(stream, paths, films)
    content = memory.drain_as_bytes()
    stream.disconnect()
    return content


def _check_suffix(file: FilePath) -> None:
    if File(file).suffix != SUFFIX:
        raise ValueError(f"rrd must end in {SUFFIX}, got {str(file)!r}")


def _write(content: bytes, file: FilePath) -> None:
    try:
        write_whole(file, lambda opened: opened.write(content))
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(f"rrd {str(file)!r} cannot be written: {reason}") from problem


class Live:
    """A recording that is served for watching while the path is solved; a context.

    `show` gives it the states one by one, on a timeline of their own; `finish` the whole film.

    Raises
    ------
    ValueError
        If the port is none, or in use.
    """

    def __init__(self, port: int) -> None:
        _check_free(port)
        self._shown = 0
        self._stream = rr.RecordingStream(APPLICATION, send_properties=False)
        self._stream.set_log_time_enabled(False)
        self.address: str = self._stream.serve_grpc(grpc_port=port)
        self._stream.send_blueprint(while_solving())

    def show(self, x: Array) -> None:
        """Show the vertices (N, 3) of the next state."""
        self._stream.set_time(SOLVING, sequence=self._shown)
        closed = np.append(x, x[:1], axis=0).astype(np.float32)
        line = rr.LineStrips3D([closed], colors=VERMILION, radii=0.03)
        self._stream.log(SOLVING, line, strict=True)
        self._shown += 1

    def finish(self, path: Path) -> None:
        """Show the film of a path; errors as in `playback`."""
        film = playback(path)
        self._stream.reset_time()
        self._stream.send_recording_name(title(path, film))
        _send(self._stream, path, film)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.flush()  # else the server complains of what it could not send
        self._stream.disconnect()


def _check_free(port: int) -> None:
    """Refuse a port that cannot be listened on: rerun's server would only log that it failed."""
    if not 0 < port < 65536:
        raise ValueError(f"port must be from 1 to 65535, got {port}")
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
        try:
            trial.bind(("", port))
        except OSError as problem:
            raise ValueError(f"port must be free, got {port}: {problem.strerror}") from problem


def _stream(identity: str, name: str) -> rr.RecordingStream:
    """An empty recording, named after what it will show."""
    stream = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.send_recording_name(name)
    return stream


def _send(stream: rr.RecordingStream, path: Path, film: Playback) -> None:
    """Send all of a film, its layout first."""
    stream.send_blueprint(layout(film))
    reel = Reel(stream, film)
    send_ring(reel)
    send_key(reel)
    send_curve(reel, path, "moment")
    send_curve(reel, path, "energy")
    send_series(reel, path)
    send_events(reel, path)
    _send_about(reel, about(path, film))


def _send_both(
    stream: rr.RecordingStream, paths: Sequence[Path], films: Sequence[Playback]
) -> None:
    """Send two films on one timeline: rings beside each other, curves in the same panels."""
    called = names(paths)
    stream.send_blueprint(beside(films, called))
    top = max(film.top for film in films)
    reels = [
        Reel(stream, film, under=f"{under}/", gamma=films[0].gamma, top=top)
        for under, film in zip(UNDER, films, strict=True)
    ]
    common = Reel(stream, films[0], top=top)
    send_key(common)
    for name in ("moment", "energy"):
        gamma, heights = (
            np.concatenate([getattr(path, n) for path in paths]) for n in ("gamma", name)
        )
        panel = Panel(gamma, heights)
        send_axes(common, f"curves/{name}", panel)
        for k, (reel, path, colour) in enumerate(zip(reels, paths, PAIR, strict=True)):
            send_curve(reel, path, name, panel=panel, colour=colour)
            place = [[75.0, -HIGH - 12.0 + 7.0 * k]]
            send_labels(reel, f"curves/{name}/name", place, [called[k]], colour=colour)
    for reel, path, name, colour in zip(reels, paths, called, PAIR, strict=True):
        send_ring(reel)
        send_series(reel, path, name=name, colour=colour)
        send_events(reel, path, name=name)
    texts = [about(path, film) for path, film in zip(paths, films, strict=True)]
    _send_about(common, "\n\n".join([BESIDE, *texts]))


BESIDE = (
    "Both rings are turned together: wherever there are two states of equal gamma they are shown "
    "together; where one turns back or snaps, the other waits. Between the states of a path the "
    "rings are drawn on a spline through them."
)


def _send_about(reel: Reel, text: str) -> None:
    reel.still("about", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


def _has_well(landscape: Landscape) -> bool:
    return landscape.barriers.open is not None and landscape.barriers.saddle is not None


def _identity(path: Path, film: Playback) -> str:
    """A recording id that depends on what is shown, and not on when."""
    digest = hashlib.sha256(about(path, film).encode())
    for array in (film.x, film.frames, film.gamma, film.moment, film.energy):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]
