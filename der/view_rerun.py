"""A path as a film to scrub through: a rerun recording, in a file or served while it is made.

With `view_layout` the only file that imports rerun. A recording is made in memory, column by
column, once the path is known, and written whole or not at all. The main timeline is `step`, the
steps of the film; since gamma turns back at folds, `gamma_mdeg` (millidegrees) is the second one.
"""

from __future__ import annotations

import hashlib
import math
import socket
from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from pathlib import Path as File
from typing import Self, TypeAlias

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from der.captions import WORDS, about, in_words, title
from der.checks import Array
from der.curve import SNAP, stretches
from der.files import FilePath, write_whole
from der.film import ENERGIES, Playback, middles, playback, spread
from der.panel import Panel, dotted
from der.record import Path
from der.ribbon import ribbon, triangles, viridis
from der.view_layout import SOLVING, layout, while_solving

Colour: TypeAlias = tuple[int, ...]

APPLICATION = "ring_origami"
SUFFIX = ".rrd"
GHOST = 0.2  # largest displacement of the softest mode, over the mean radius
REACH = 1.55  # half the length of the twisting axis, over the mean radius
INK, QUIET, CHALK = (34, 34, 34), (140, 140, 140), (225, 225, 225)
SKY, VERMILION, GREEN, ORANGE = (86, 180, 233), (213, 94, 0), (0, 158, 115), (230, 159, 0)
# label, colour and radius of a stretch of the curves by whether it is stable
STRETCHES: dict[bool | str | None, tuple[str, Colour, float]] = {
    True: ("stable", SKY, 0.9),
    False: ("unstable", VERMILION, 0.5),
    None: ("unknown", QUIET, 0.8),
    SNAP: ("snaps", ORANGE, 0.5),
}
CLASSES = (GREEN, SKY, ORANGE)  # of the eigenvalues of each symmetry
MOVING = "in motion"
# colours of the state lines; any index but 0 is vermilion
STATES: dict[str, Colour] = {
    "stable": (0, 114, 178),
    MOVING: (120, 94, 20),
    "start": (70, 70, 70),
    "fold": (204, 121, 167),
    "limit of M": (0, 114, 178),
    "branch point": (150, 80, 0),
    "snap": (120, 94, 20),
    "self-crossing": GREEN,
}
STEPS = rr.components.InterpolationMode.StepAfter  # a count stays until it changes
ARC = 25  # points on the arc that shows a grip's rotation


def save_recording(path: Path, file: FilePath, *, rest: Array | None = None) -> None:
    """Write the recording of a path, whole or not at all; arguments as in `film.playback`.

    Raises
    ------
    ValueError
        If the suffix is not .rrd, the place cannot be written to, or `playback` refuses the rest.
    """
    if File(file).suffix != SUFFIX:
        raise ValueError(f"rrd must end in {SUFFIX}, got {str(file)!r}")
    content = recording_bytes(path, rest=rest)
    try:
        write_whole(file, lambda opened: opened.write(content))
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(f"rrd {str(file)!r} cannot be written: {reason}") from problem


def recording_bytes(path: Path, *, rest: Array | None = None) -> bytes:
    """The recording of a path as the bytes of its file; arguments and errors as in `playback`."""
    film = playback(path, rest=rest)
    stream = _stream(path, film)
    memory = stream.memory_recording()
    _send(stream, path, film)
    content = memory.drain_as_bytes()
    stream.disconnect()
    return content


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


def _stream(path: Path, film: Playback) -> rr.RecordingStream:
    """An empty recording, named after what it will show."""
    identity = _identity(path, film)
    stream = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=False)
    stream.set_log_time_enabled(False)
    stream.send_recording_name(title(path, film))
    return stream


def _send(stream: rr.RecordingStream, path: Path, film: Playback) -> None:
    """Send all of a film, its layout first."""
    stream.send_blueprint(layout(film))
    reel = _Reel(stream, film)
    _send_ribbon(reel)
    _send_lines(reel)
    _send_grips(reel)
    _send_modes(reel)
    _send_key(reel)
    _send_curve(reel, path, "moment")
    _send_curve(reel, path, "energy")
    _send_series(reel, path)
    _send_events(reel, path)
    text = rr.TextDocument(about(path, film), media_type=rr.MediaType.MARKDOWN)
    reel.still("about", text)


# --- Sending ----------------------------------------------------------------------------------


class _Reel:
    """A recording under way: what stands still, and what changes from step to step."""

    def __init__(self, stream: rr.RecordingStream, film: Playback) -> None:
        self.stream = stream
        self.film = film
        self.mdeg = np.rint(1e3 * np.degrees(film.gamma)).astype(np.int64)

    def still(self, entity: str, *what: rr.AsComponents) -> None:
        """Log what never changes."""
        self.stream.log(entity, *what, static=True, strict=True)

    def run(self, entity: str, columns: rr.ComponentColumnList, steps: ArrayLike = ()) -> None:
        """Send columns, a row a step, of the whole film or of some steps."""
        at = np.asarray(steps, dtype=np.int64)
        if not len(at):
            at = np.arange(len(self.film.x))
        times = [
            rr.TimeColumn("step", sequence=at),
            rr.TimeColumn("gamma_mdeg", sequence=self.mdeg[at]),
        ]
        self.stream.send_columns(entity, times, columns, strict=True)


def _send_ribbon(reel: _Reel) -> None:
    """The ribbon, with one set of colours for bending and one for twisting."""
    film = reel.film
    n, n_v, _ = film.x.shape
    positions, normals = ribbon(film.x, film.frames, film.section)
    reel.still("ring/ribbon", rr.Mesh3D.from_fields(triangle_indices=triangles(n_v)))
    columns = rr.Mesh3D.columns(
        vertex_positions=positions.reshape(-1, 3).astype(np.float32),
        vertex_normals=normals.reshape(-1, 3).astype(np.float32),
    )
    reel.run("ring/ribbon", columns.partition([8 * n_v] * n))
    for name, density in zip(ENERGIES, film.density, strict=True):
        shades = np.repeat(viridis(density / film.top).reshape(-1), 8)
        batch = {"colors": rr.components.ColorBatch(shades)}
        dynamic = rr.DynamicArchetype.columns(archetype=name, components=batch)
        reel.run("ring/ribbon", dynamic.partition([8 * n_v] * n))


def _send_lines(reel: _Reel) -> None:
    """The centreline, the twisting axis, and the way of the free points up to the present."""
    film = reel.film
    closed = np.concatenate([film.x, film.x[:, :1]], axis=1).astype(np.float32)
    _send_strips(reel, "ring/centreline", list(closed), INK, 0.004)
    end = REACH * film.size
    axis = rr.LineStrips3D([[[0, 0, -end], [0, 0, end]]], colors=QUIET, radii=0.003 * film.size)
    reel.still("ring/axis", axis)
    n_v = film.x.shape[1]
    middle = middles(film.x)
    for arm, s in enumerate((n_v / 4, 3 * n_v / 4)):
        point = 0.5 * (middle[:, math.floor(s)] + middle[:, math.ceil(s)])
        before = np.concatenate([point[:1], point[:-1]])
        strips = np.stack([before, point], axis=1).astype(np.float32)
        _send_strips(reel, f"ring/trace/{arm}", list(strips), GREEN, 0.006)


def _send_strips(
    reel: _Reel, entity: str, strips: list[NDArray[np.float32]], colour: Colour, radius: float
) -> None:
    """A line strip a step."""
    style = rr.LineStrips3D.from_fields(colors=colour, radii=radius * reel.film.size)
    reel.still(entity, style)
    reel.run(entity, rr.LineStrips3D.columns(strips=strips))


def _send_grips(reel: _Reel) -> None:
    """The grips: how far each has turned, and the moment on it, along the axis and beside it."""
    film = reel.film
    size, n_v = film.size, film.x.shape[1]
    largest = float(np.nanmax(np.abs(film.moment))) or 1.0
    middle = middles(film.x)
    for name, edge, sign in (("first", 0, 1.0), ("second", n_v // 2, -1.0)):
        entity = f"ring/grips/{name}"
        centre, d1 = middle[:, edge], film.frames[:, edge, 0]
        reel.still(f"{entity}/rotation", rr.Arrows3D.from_fields(colors=INK, radii=0.012 * size))
        reel.run(
            f"{entity}/rotation", rr.Arrows3D.columns(origins=centre, vectors=0.42 * size * d1)
        )
        turned = np.linspace(0.0, sign * film.gamma, ARC, axis=1)[..., None]
        across = np.cross([0.0, 0.0, 1.0], d1[0])
        arc = centre[:, None] + 0.34 * size * (np.cos(turned) * d1[0] + np.sin(turned) * across)
        _send_strips(reel, f"{entity}/angle", list(arc.astype(np.float32)), INK, 0.005)
        vectors = np.zeros_like(centre)
        vectors[:, 2] = sign * 0.4 * size * np.nan_to_num(film.moment) / largest
        beside = centre - [0.0, 0.0, sign * 0.3 * size]
        reel.still(
            f"{entity}/moment", rr.Arrows3D.from_fields(colors=VERMILION, radii=0.018 * size)
        )
        reel.run(
            f"{entity}/moment",
            rr.Arrows3D.columns(origins=beside - 0.5 * vectors, vectors=vectors),
        )


def _send_modes(reel: _Reel) -> None:
    """The softest mode as a ghost of the centreline, where it is known."""
    film = reel.film
    if film.u is None:
        return
    largest = np.linalg.norm(film.u, axis=2).max(axis=1)
    known = np.isfinite(largest) & (largest > 0.0)
    ghost = film.x[known] + GHOST * film.size * film.u[known] / largest[known, None, None]
    closed = np.concatenate([ghost, ghost[:, :1]], axis=1).astype(np.float32)
    style = rr.LineStrips3D.from_fields(colors=(*VERMILION, 150), radii=0.008 * film.size)
    reel.still("ring/softest_mode", style)
    strips = rr.LineStrips3D.columns(strips=list(closed))
    reel.run("ring/softest_mode", strips.partition(known.astype(int)))


# --- Curves and series ------------------------------------------------------------------------


def _send_key(reel: _Reel) -> None:
    """The colours of the energy density, as a bar."""
    share = np.linspace(0.0, 1.0, 65)
    bars = [[[300 * a, 0], [300 * b, 0]] for a, b in pairwise(share)]
    shades = viridis(0.5 * (share[1:] + share[:-1]))
    reel.still("key/bar", rr.LineStrips2D(bars, colors=shades, radii=5.0))
    ends = ["0", "energy density, GJ/a²", f"{reel.film.top:.3g}"]
    _send_labels(reel, "key/values", [[0, 14], [150, 14], [300, 14]], ends)


def _send_labels(reel: _Reel, entity: str, places: ArrayLike, labels: Sequence[str]) -> None:
    """Words on a 2-D panel."""
    points = rr.Points2D(places, labels=labels, radii=0.01, colors=CHALK, show_labels=True)
    reel.still(entity, points)


def _send_curve(reel: _Reel, path: Path, name: str) -> None:
    """One panel: the whole curve over gamma, its special points, and the present state on it."""
    film, entity = reel.film, f"curves/{name}"
    heights: Array = getattr(path, name)
    panel = Panel(path.gamma, heights)
    _send_axes(reel, entity, panel)
    pieces = [
        (side, panel.place(math.pi * line[:, 0], line[:, 1]))
        for side, line in stretches(path, heights)
    ]
    for key, (label, colour, width) in STRETCHES.items():
        strips = [piece for side, piece in pieces if side is key]
        if key is SNAP:
            strips = [dash for strip in strips for dash in dotted(strip)]
        if strips:
            reel.still(f"{entity}/{label}", rr.LineStrips2D(strips, colors=colour, radii=width))
    at = [point.position for point in path.points]
    if at:
        names = [WORDS[point.kind] for point in path.points]
        places = panel.place(path.gamma[at], heights[at])
        marks = rr.Points2D(places, colors=ORANGE, radii=1.3, labels=names, show_labels=False)
        reel.still(f"{entity}/points", marks)
    values: Array = getattr(film, name)
    known = np.isfinite(values)
    dots = panel.place(film.gamma, values)[known]
    reel.still(
        f"{entity}/now", rr.Points2D.from_fields(colors=(255, 255, 255), radii=2.4, draw_order=50.0)
    )
    columns = rr.Points2D.columns(positions=dots.astype(np.float32))
    reel.run(f"{entity}/now", columns.partition(known.astype(int)))


def _send_axes(reel: _Reel, entity: str, panel: Panel) -> None:
    """The axes of a panel with their ticks."""
    foot = panel.values[0]
    across = panel.place([0.0, panel.gamma[1]], foot)
    upright = panel.place(0.0, panel.values)
    level = panel.place([0.0, panel.gamma[1]], 0.0)
    below, beside = panel.place(panel.turns, foot), panel.place(0.0, panel.rounds)
    ticks = [*np.stack([below, np.add(below, [0.0, 2.0])], axis=1)]
    ticks += [*np.stack([beside, np.add(beside, [-2.0, 0.0])], axis=1)]
    lines = rr.LineStrips2D([across, upright, level, *ticks], colors=QUIET, radii=0.2)
    reel.still(f"{entity}/axes", lines)
    places = np.concatenate([np.add(below, [0.0, 3.0]), np.add(beside, [-9.0, -4.0])])
    words = [f"{turn / math.pi:.2g} π" for turn in panel.turns]
    words += [f"{value:g}" for value in panel.rounds]
    _send_labels(reel, f"{entity}/values", places, words)


def _send_series(reel: _Reel, path: Path) -> None:
    """M, U, gamma, the index and the lowest eigenvalues over the steps."""
    film = reel.film
    index = spread(np.ma.filled(path.index.astype(float), np.nan), film.position)
    series = {
        "moment": (film.moment, "M a/GJ", SKY),
        "gamma": (film.gamma, "gamma, rad", QUIET),
        "energy": (film.energy, "U a/GJ", ORANGE),
        "index": (index, "index", VERMILION),
    }
    for k, (name, column) in enumerate(zip(film.classes, film.eigenvalues.T, strict=True)):
        series[f"eigenvalues/{name.replace(' ', '_')}"] = (column, name, CLASSES[k])
    for name, (values, label, colour) in series.items():
        known = np.isfinite(values)
        if known.any():
            steps = np.flatnonzero(known | (film.position < 0))  # a nan breaks the line
            shape = STEPS if name == "index" else rr.components.InterpolationMode.Linear
            style = rr.SeriesLines(colors=colour, names=label, widths=2.0, interpolation_mode=shape)
            reel.still(f"series/{name}", style)
            reel.run(f"series/{name}", rr.Scalars.columns(scalars=values[steps]), steps)


# --- Words ------------------------------------------------------------------------------------


def _send_events(reel: _Reel, path: Path) -> None:
    """Special points in the log; stability and the last event as lines over the steps."""
    film = reel.film
    steps = [film.step_of(point.position) for point in path.points]
    if steps:
        reel.run("events", rr.TextLog.columns(text=[in_words(p) for p in path.points]), steps)
    kinds = [WORDS[point.kind] for point in path.points]
    index = path.index.tolist()
    states: dict[int, str] = {}
    for step, k in enumerate(film.position.tolist()):
        if k < 0:
            states[step] = MOVING
        elif index[k] is not None:
            states[step] = f"index {index[k]}" if index[k] else "stable"
    _send_states(reel, "states/stability", states)
    _send_states(reel, "states/event", {0: "start", **dict(zip(steps, kinds, strict=True))})


def _send_states(reel: _Reel, entity: str, states: Mapping[int, str]) -> None:
    """A line of states, each from its step on until another follows."""
    changes = [next(group) for _, group in groupby(sorted(states), key=lambda k: states[k])]
    if not changes:
        return
    values = sorted(set(states.values()))
    colours = [STATES.get(value, VERMILION) for value in values]
    reel.still(entity, rr.StateConfiguration(values=values, colors=colours))
    reel.run(entity, rr.StateChange.columns(state=[states[k] for k in changes]), changes)


def _identity(path: Path, film: Playback) -> str:
    """A recording id that depends on what is shown, and not on when."""
    digest = hashlib.sha256(about(path, film).encode())
    for array in (film.x, film.frames, film.gamma, film.moment, film.energy):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]
