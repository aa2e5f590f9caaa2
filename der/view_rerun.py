"""A path as a film to scrub through: a rerun recording with its own layout.

The only file that imports rerun. A recording is made in memory, column by column, once the path is
known, and written whole or not at all. The main timeline is `step`, states in path order; since
gamma turns back at folds, `gamma_mdeg` (millidegrees) is the second one. States are those of the
path; those of a snap, between two of them, come from the motion that the caller hands in.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path as File
from typing import TypeAlias

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike, NDArray
from rerun.blueprint.encodings import (
    ComponentSourceKind,
    TextLogColumn,
    TextLogColumnKind,
    VisualizerComponentMapping,
)

from der.files import FilePath, write_whole
from der.record import Path, Point

Array: TypeAlias = NDArray[np.float64]
Colour: TypeAlias = tuple[int, ...]

APPLICATION = "ring_origami"
SUFFIX = ".rrd"
A_OVER_T = 200.0  # of a ring whose record does not say
SEEN = 0.13  # the wider side of the section, over the ring's mean radius, to be seen at all
GHOST = 0.2  # largest displacement of the softest mode, over the mean radius
REACH = 1.55  # half the length of the twisting axis, over the mean radius
FPS, FILM = 30.0, 10.0  # frames a second at most; seconds that a film of fewer states lasts
CAMERA = np.array([3.1, 1.75, 1.3])  # from the middle, over the mean radius; the ring lies in y, z
CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])  # along d1, d2
VIRIDIS = np.array(  # every eighth of matplotlib's viridis: even steps for all colour vision
    [
        (68, 1, 84),
        (71, 44, 122),
        (59, 81, 139),
        (44, 113, 142),
        (33, 144, 141),
        (39, 173, 129),
        (92, 200, 99),
        (170, 220, 50),
        (253, 231, 37),
    ]
)
PAPER, INK, QUIET = (243, 243, 240), (34, 34, 34), (140, 140, 140)  # of the ring's views
NIGHT, CHALK = (13, 16, 17), (225, 225, 225)  # of the panels: labels have dark boxes
SKY, VERMILION, GREEN, ORANGE = (86, 180, 233), (213, 94, 0), (0, 158, 115), (230, 159, 0)
# label, colour and radius of a stretch of the curves by whether it is stable
STRETCHES: dict[bool | None, tuple[str, Colour, float]] = {
    True: ("stable", SKY, 0.9),
    False: ("unstable", VERMILION, 0.5),
    None: ("unknown", QUIET, 0.8),
}
WORDS = {
    "fold": "fold",
    "limit": "limit of M",
    "branch": "branch point",
    "snap": "snap",
    "contact": "self-crossing",
}
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
WIDE, HIGH = 150.0, 90.0  # panels of the curves, in their own units
ARC = 25  # points on the arc that shows a grip's rotation
ENERGIES = ("bending", "twisting")


@dataclass(frozen=True, eq=False)
class Motion:
    """What happens between two states of a path, such as a snap.

    Parameters
    ----------
    after : position in the path of the state that it leaves.
    x : (k, N, 3) vertices, in the order of time.
    frames : (k, N, 3, 3) material frames, rows d1, d2, d3.
    energy : (k,) of the full ring; None: that of bending and twisting is computed.
    """

    after: int
    x: Array
    frames: Array
    energy: Array | None = None


@dataclass(frozen=True)
class Drawn:
    """The section as it is drawn."""

    h: float  # along d1, a
    t: float  # along d2, a
    factor: float  # over the real ones


@dataclass(frozen=True, eq=False)
class Playback:
    """All that is shown, one entry a step of the film."""

    x: Array  # (n, N, 3) vertices
    frames: Array  # (n, N, 3, 3) material frames of the edges
    position: NDArray[np.int64]  # (n,) in the path; -1 in the middle of a motion
    gamma: Array  # (n,) rad
    moment: Array  # (n,) GJ/a; nan in the middle of a motion
    energy: Array  # (n,) GJ/a
    density: Array  # (2, n, N) energies of bending and of twisting over length, at the vertices
    section: Drawn
    eigenvalues: Array | None  # (n, m); nan where not known
    modes: Array | None  # (n, N, 3); nan where not known

    @property
    def size(self) -> float:
        """Mean radius of the ring at its first state."""
        return _mean_radius(self.x[0])

    @property
    def top(self) -> float:
        """The energy density of the brightest colour: the largest of all equilibria."""
        return float(self.density[:, self.position >= 0].max()) or 1.0

    def step_of(self, position: int) -> int:
        """The step of the film that shows a state of the path."""
        return int(np.flatnonzero(self.position == position)[0])


def save_recording(
    path: Path,
    file: FilePath,
    *,
    motions: Sequence[Motion] = (),
    eigenvalues: Array | None = None,
    modes: Array | None = None,
    rest: Array | None = None,
) -> None:
    """Write the recording of a path, whole or not at all; arguments as in `playback`.

    Raises
    ------
    ValueError
        If the suffix is not .rrd, the place cannot be written to, or `playback` refuses the rest.
    """
    if File(file).suffix != SUFFIX:
        raise ValueError(f"rrd must end in {SUFFIX}, got {str(file)!r}")
    content = recording_bytes(
        path, motions=motions, eigenvalues=eigenvalues, modes=modes, rest=rest
    )
    try:
        write_whole(file, lambda opened: opened.write(content))
    except OSError as problem:
        reason = problem.strerror or problem
        raise ValueError(f"rrd {str(file)!r} cannot be written: {reason}") from problem


def recording_bytes(
    path: Path,
    *,
    motions: Sequence[Motion] = (),
    eigenvalues: Array | None = None,
    modes: Array | None = None,
    rest: Array | None = None,
) -> bytes:
    """The recording of a path as the bytes of its file; arguments and errors as in `playback`."""
    film = playback(path, motions=motions, eigenvalues=eigenvalues, modes=modes, rest=rest)
    stream = rr.RecordingStream(
        APPLICATION, recording_id=_identity(path, film), send_properties=False
    )
    stream.set_log_time_enabled(False)
    stream.send_recording_name(_title(path, film))
    memory = stream.memory_recording()
    stream.send_blueprint(_blueprint(film))
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
    about = rr.TextDocument(_about(path, film), media_type=rr.MediaType.MARKDOWN)
    reel.still("about", about)
    content = memory.drain_as_bytes()
    stream.disconnect()
    return content


# --- The film ---------------------------------------------------------------------------------


def playback(
    path: Path,
    *,
    motions: Sequence[Motion] = (),
    eigenvalues: Array | None = None,
    modes: Array | None = None,
    rest: Array | None = None,
) -> Playback:
    """The film of a path: its states, with the motions put in between.

    Parameters
    ----------
    path : with shapes.
    motions : what happens between two states.
    eigenvalues : (n, m) lowest eigenvalues at every state, nan where not known.
    modes : (n, N, 3) displacements of the softest mode at every state, nan where not known.
    rest : (N, 3) natural strains of the vertices, integrated [rad]; None for a path that begins
        flat: those of its first state, times the natural curvature.

    Raises
    ------
    ValueError
        If the path has no state or no shapes, an array is of another shape, a motion leaves a
        state that is not there, or `rest` is needed.
    """
    if path.shapes is None or not len(path):
        raise ValueError("path must have shapes to be recorded, got none")
    n, n_v, _ = path.shapes.x.shape
    _check_shape("eigenvalues", eigenvalues, (n, None))
    _check_shape("modes", modes, (n, n_v, 3))
    _check_shape("rest", rest, (n_v, 3))
    for motion in motions:
        _check_motion(motion, n, n_v)
    if rest is None:
        if path.gamma[0] != 0.0:
            raise ValueError(f"rest must be given where gamma begins at {path.gamma[0]:g}")
        rest = _number(path.ring, "natural_curvature", 1.0) * _strains(path.shapes.frames[0])
    order = _order(n, motions)
    position = np.where(order < n, order, -1)
    x = np.concatenate([path.shapes.x, *(motion.x for motion in motions)])[order]
    frames = np.concatenate([path.shapes.frames, *(motion.frames for motion in motions)])[order]
    density, computed = _energies(path, x, frames, rest)
    given = [np.full(len(m.x), np.nan) if m.energy is None else m.energy for m in motions]
    energy = np.concatenate([path.energy, *given])[order]
    leaves = [m.after for m in motions for _ in m.x]
    return Playback(
        x=x,
        frames=frames,
        position=position,
        gamma=np.append(path.gamma, path.gamma[leaves])[order],
        moment=_spread(path.moment, position),
        energy=np.where(np.isnan(energy), computed, energy),
        density=density,
        section=_section(path, x[0]),
        eigenvalues=None if eigenvalues is None else _spread(eigenvalues, position),
        modes=None if modes is None else _spread(modes, position),
    )


def _check_shape(name: str, array: Array | None, shape: tuple[int | None, ...]) -> None:
    """Refuse an array of another shape, where None in `shape` is any number."""
    if array is None:
        return
    fits = len(shape) == array.ndim and all(
        wanted in (None, given) for wanted, given in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if number is None else str(number) for number in shape)
        raise ValueError(f"{name} must have shape ({wanted}), got {array.shape}")


def _check_motion(motion: Motion, n: int, n_v: int) -> None:
    """Refuse a motion that does not fit a path of `n` states of `n_v` vertices."""
    k = len(motion.x)
    _check_shape("x of a motion", motion.x, (k, n_v, 3))
    _check_shape("frames of a motion", motion.frames, (k, n_v, 3, 3))
    _check_shape("energy of a motion", motion.energy, (k,))
    if not 0 <= motion.after < n:
        raise ValueError(f"after of a motion must be a state, 0 to {n - 1}, got {motion.after}")


def _order(n: int, motions: Sequence[Motion]) -> NDArray[np.int64]:
    """Places, in the `n` states followed by all motions, of the film's steps."""
    lengths = [len(motion.x) for motion in motions]
    after = np.repeat([float(motion.after) + 0.5 for motion in motions], lengths)
    return np.argsort(np.append(np.arange(n), after), kind="stable")


def _spread(values: Array, position: NDArray[np.int64]) -> Array:
    """Values of the states at every step of the film, nan in the middle of a motion."""
    out = np.asarray(values, dtype=float)[position]
    out[position < 0] = np.nan
    return out


def _edges(x: Array) -> Array:
    """Edge vectors (..., N, 3) of closed polygons; edge j ends at vertex j."""
    return x - np.roll(x, 1, axis=-2)


def _middles(x: Array) -> Array:
    """Middles (..., N, 3) of the edges."""
    return 0.5 * (x + np.roll(x, 1, axis=-2))


def _strains(frames: Array) -> Array:
    """Rotation vectors (..., N, 3) [rad] from each frame to the next, seen in the frames."""
    turn = frames @ np.roll(frames, -1, axis=-3).swapaxes(-1, -2)
    axis = 0.5 * np.stack(
        [
            turn[..., 2, 1] - turn[..., 1, 2],
            turn[..., 0, 2] - turn[..., 2, 0],
            turn[..., 1, 0] - turn[..., 0, 1],
        ],
        axis=-1,
    )
    sine = np.linalg.norm(axis, axis=-1, keepdims=True)
    cosine = 0.5 * (np.trace(turn, axis1=-2, axis2=-1)[..., None] - 1.0)
    small = sine < 1e-9
    return axis * np.where(small, 1.0, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))


def _energies(path: Path, x: Array, frames: Array, rest: Array) -> tuple[Array, Array]:
    """Densities (2, n, N) of bending and twisting, GJ/a^2, and their sums (n,), GJ/a."""
    length = np.linalg.norm(_edges(x[0]), axis=1)
    cell = 0.5 * (length + np.roll(length, -1))
    per_length = (_strains(frames) - rest) / cell[:, None]
    stiffness = np.array([_number(path.section, name, 1.0) for name in ("alpha", "beta", "GJ")])
    parts = 0.5 * stiffness * per_length**2
    density = np.stack([parts[..., 0] + parts[..., 1], parts[..., 2]])
    return density, (density.sum(axis=0) * cell).sum(axis=-1)


def _number(entries: Mapping[str, object], name: str, default: float) -> float:
    """A number of a record's mapping, or what stands for one that is not there."""
    value = entries.get(name)
    return float(value) if isinstance(value, int | float) else default


def _section(path: Path, flat: Array) -> Drawn:
    """h and t of the section, and how many times larger they are drawn."""
    alpha, beta = (_number(path.section, name, 1.0) for name in ("alpha", "beta"))
    t = 1.0 / _number(path.numerics, "a_over_t", A_OVER_T)
    h = t * _number(path.section, "h_over_t", math.sqrt(beta / alpha))
    factor = float(max(1, math.ceil(SEEN * _mean_radius(flat) / max(h, t))))
    return Drawn(factor * h, factor * t, factor)


def _mean_radius(flat: Array) -> float:
    return float(np.linalg.norm(_edges(flat), axis=1).sum()) / (2 * math.pi)


# --- Ribbon -----------------------------------------------------------------------------------


def _ribbon(x: Array, frames: Array, section: Drawn) -> tuple[Array, Array]:
    """Vertices and normals (n, 8 N, 3): each corner of a section once for either of its faces."""
    d1, d3 = (frames[..., k, :] + np.roll(frames[..., k, :], -1, axis=-2) for k in (0, 2))
    d2 = _unit(np.cross(d3, d1))
    d1 = _unit(np.cross(d2, d3))
    along = np.stack([d1, d2], axis=-2)
    corners = x[..., None, :] + (0.5 * CORNERS * (section.h, section.t)) @ along
    positions = np.repeat(corners, 2, axis=-2)
    # neighbours in memory alike: the file is compressed
    normals = (np.array([(s, 0.0) if k else (0.0, c) for s, c in CORNERS for k in (0, 1)])) @ along
    shape = (len(x), -1, 3)
    return positions.reshape(shape), normals.reshape(shape)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _triangles(n_v: int) -> NDArray[np.uint32]:
    """Triangles (8 N, 3) of a closed ribbon, whose outer sides are on the left."""
    sides = ((0, 2), (3, 5), (4, 6), (7, 1))  # pairs of the 8 vertices of a section
    here = 8 * np.arange(n_v)[:, None]
    there = np.roll(here, -1, axis=0)
    pieces = [
        np.concatenate(triangle, axis=1)
        for a, b in sides
        for triangle in ((here + a, here + b, there + b), (here + a, there + b, there + a))
    ]
    return np.concatenate(pieces).astype(np.uint32)


def _colours(share: Array) -> NDArray[np.uint32]:
    """Colours 0xRRGGBBAA of shares 0 to 1 of the largest density."""
    at = np.clip(share, 0.0, 1.0) * (len(VIRIDIS) - 1)
    nodes = np.arange(len(VIRIDIS))
    red, green, blue = (np.interp(at, nodes, v).round().astype(np.uint32) for v in VIRIDIS.T)
    return (red << 24) | (green << 16) | (blue << 8) | np.uint32(255)


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
    positions, normals = _ribbon(film.x, film.frames, film.section)
    reel.still("ring/ribbon", rr.Mesh3D.from_fields(triangle_indices=_triangles(n_v)))
    columns = rr.Mesh3D.columns(
        vertex_positions=positions.reshape(-1, 3).astype(np.float32),
        vertex_normals=normals.reshape(-1, 3).astype(np.float32),
    )
    reel.run("ring/ribbon", columns.partition([8 * n_v] * n))
    for name, density in zip(ENERGIES, film.density, strict=True):
        colours = np.repeat(_colours(density / film.top).reshape(-1), 8)
        batch = {"colors": rr.components.ColorBatch(colours)}
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
    middles = _middles(film.x)
    for arm, s in enumerate((n_v / 4, 3 * n_v / 4)):
        point = 0.5 * (middles[:, math.floor(s)] + middles[:, math.ceil(s)])
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
    middles = _middles(film.x)
    for name, edge, sign in (("first", 0, 1.0), ("second", n_v // 2, -1.0)):
        entity = f"ring/grips/{name}"
        centre, d1 = middles[:, edge], film.frames[:, edge, 0]
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
    if film.modes is None:
        return
    ghosts: list[list[NDArray[np.float32]]] = []
    for x, mode in zip(film.x, film.modes, strict=True):
        largest = float(np.linalg.norm(mode, axis=1).max())
        known = math.isfinite(largest) and largest > 0.0
        ghost = x + GHOST * film.size * mode / largest if known else x
        ghosts.append([np.append(ghost, ghost[:1], axis=0).astype(np.float32)] if known else [])
    style = rr.LineStrips3D.from_fields(colors=(*VERMILION, 150), radii=0.008 * film.size)
    reel.still("ring/softest_mode", style)
    strips = rr.LineStrips3D.columns(strips=[ghost for row in ghosts for ghost in row])
    reel.run("ring/softest_mode", strips.partition([len(row) for row in ghosts]))


# --- Curves and series ------------------------------------------------------------------------


def _send_key(reel: _Reel) -> None:
    """The colours of the energy density, as a bar."""
    share = np.linspace(0.0, 1.0, 65)
    bars = [[[300 * a, 0], [300 * b, 0]] for a, b in pairwise(share)]
    colours = _colours(0.5 * (share[1:] + share[:-1]))
    reel.still("key/bar", rr.LineStrips2D(bars, colors=colours, radii=5.0))
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
    panel = _Panel(path.gamma, heights)
    _send_axes(reel, entity, panel)
    curve = panel.place(path.gamma, heights)
    for key, (label, colour, width) in STRETCHES.items():
        strips = [
            curve[first : last + 1] for first, last, stable in _stretches(path) if stable is key
        ]
        if strips:
            reel.still(f"{entity}/{label}", rr.LineStrips2D(strips, colors=colour, radii=width))
    at = [point.position for point in path.points]
    if at:
        names = [WORDS[point.kind] for point in path.points]
        marks = rr.Points2D(curve[at], colors=ORANGE, radii=1.3, labels=names, show_labels=False)
        reel.still(f"{entity}/points", marks)
    values: Array = getattr(film, name)
    known = np.isfinite(values)
    dots = panel.place(film.gamma, values)[known]
    reel.still(
        f"{entity}/now", rr.Points2D.from_fields(colors=(255, 255, 255), radii=2.4, draw_order=50.0)
    )
    columns = rr.Points2D.columns(positions=dots.astype(np.float32))
    reel.run(f"{entity}/now", columns.partition(known.astype(int)))


class _Panel:
    """Where (gamma, value) is drawn: in a box WIDE by HIGH, of which y points down."""

    def __init__(self, gamma: Array, values: Array) -> None:
        self.gamma = (0.0, float(gamma.max()) or 1.0)
        low, high = min(0.0, float(values.min())), float(values.max())
        self.values = (low, high if high > low else low + 1.0)

    def place(self, gamma: ArrayLike, values: ArrayLike) -> Array:
        """Points (n, 2) of the panel."""
        across = np.asarray(gamma, dtype=float) / self.gamma[1]
        up = (np.asarray(values, dtype=float) - self.values[0]) / (self.values[1] - self.values[0])
        return np.stack(np.broadcast_arrays(WIDE * across, -HIGH * up), axis=-1)


def _send_axes(reel: _Reel, entity: str, panel: _Panel) -> None:
    """The axes of a panel with their ticks: multiples of pi/4, and round values."""
    turns = np.arange(0.0, panel.gamma[1] + 1e-9, math.pi / 4)
    values = _round_values(*panel.values)
    foot = panel.values[0]
    across = panel.place([0.0, panel.gamma[1]], foot)
    upright = panel.place(0.0, panel.values)
    level = panel.place([0.0, panel.gamma[1]], 0.0)
    below, beside = panel.place(turns, foot), panel.place(0.0, values)
    ticks = [*np.stack([below, np.add(below, [0.0, 2.0])], axis=1)]
    ticks += [*np.stack([beside, np.add(beside, [-2.0, 0.0])], axis=1)]
    lines = rr.LineStrips2D([across, upright, level, *ticks], colors=QUIET, radii=0.2)
    reel.still(f"{entity}/axes", lines)
    places = np.concatenate([np.add(below, [0.0, 3.0]), np.add(beside, [-9.0, -4.0])])
    words = [f"{turn / math.pi:.2g} π" for turn in turns] + [f"{value:g}" for value in values]
    _send_labels(reel, f"{entity}/values", places, words)


def _round_values(low: float, high: float) -> Array:
    """Three to seven multiples of 1, 2 or 5 times a power of ten between two values."""
    rough = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * power >= rough)
    return step * np.arange(math.ceil(low / step), math.floor(high / step) + 1, dtype=np.float64)


def _stretches(path: Path) -> list[tuple[int, int, bool | None]]:
    """First and last state of each stretch of the path that is stable, unstable, or not known.

    A state of unknown index, as special points are, takes the side of the state before it.
    """
    sides: list[bool | None] = []
    for index in path.index.tolist():
        sides.append((sides[-1] if sides else None) if index is None else index == 0)
    found = []
    for side, group in groupby(range(len(sides)), key=lambda k: sides[k]):
        states = list(group)
        found.append((max(states[0] - 1, 0), states[-1], side))
    return found


def _send_series(reel: _Reel, path: Path) -> None:
    """M, U, gamma, the index and the lowest eigenvalues over the steps."""
    film = reel.film
    index = _spread(np.ma.filled(path.index.astype(float), np.nan), film.position)
    series = {
        "moment": (film.moment, "M a/GJ", SKY),
        "gamma": (film.gamma, "gamma, rad", QUIET),
        "energy": (film.energy, "U a/GJ", ORANGE),
        "index": (index, "index", VERMILION),
    }
    for k, column in enumerate([] if film.eigenvalues is None else film.eigenvalues.T):
        series[f"eigenvalues/{k}"] = (column, f"eigenvalue {k + 1}", GREEN)
    for name, (values, label, colour) in series.items():
        steps = np.flatnonzero(np.isfinite(values))
        if len(steps):
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
        reel.run("events", rr.TextLog.columns(text=[_in_words(p) for p in path.points]), steps)
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


def _in_words(point: Point) -> str:
    """A special point as a line of the log."""
    line = f"{WORDS[point.kind]}, gamma {point.gamma:.8g} ({point.gamma / math.pi:.4g} π)"
    if point.index_before is not None or point.index_after is not None:
        before, after = ("?" if i is None else i for i in (point.index_before, point.index_after))
        line += f", index {before}" if before == after else f", index {before} -> {after}"
    line += f", M {point.moment:.6g}, U {point.energy:.6g}"
    return line + "".join(f", {k.replace('_', ' ')} {v}" for k, v in point.details.items())


def _title(path: Path, film: Playback) -> str:
    """The ring in a few words."""
    return f"{path.ring['shape']}, h/t = {film.section.h / film.section.t:.4g}"


def _about(path: Path, film: Playback) -> str:
    """What is to be seen, and the parameters, in Markdown."""
    drawn = film.section
    h, t = drawn.h / drawn.factor, drawn.t / drawn.factor
    scale = "to scale" if drawn.factor == 1.0 else f"**{drawn.factor:g} times as large as it is**"
    states, between = len(path), len(film.x) - len(path)
    lines = [
        f"# {_title(path, film)}",
        f"The section is drawn {scale}: h = {h:.4g} a, t = {t:.4g} a.",
        "Colour: energy of bending (left) and of twisting (right) per length, from 0 to "
        f"{film.top:.4g} GJ/a².",
        "Black arrows: how far the grips have turned. Vermilion arrows: the moment on each, along "
        "the twisting axis. Green: the way of the free points.",
        f"{states} equilibria; {between} states between them are of a motion, in slow motion, and "
        "no equilibria.",
        f"Status: {path.status}. {path.message}".rstrip(),
        "",
        "| parameter | value |",
        "|---|---|",
    ]
    for part in (path.ring, path.section, path.numerics):
        lines += [f"| {name.replace('_', ' ')} | {value} |" for name, value in part.items()]
    return "\n\n".join(lines[:6]) + "\n" + "\n".join(lines[6:]) + "\n"


def _identity(path: Path, film: Playback) -> str:
    """A recording id that depends on what is shown, and not on when."""
    digest = hashlib.sha256(_about(path, film).encode())
    for array in (film.x, film.frames, film.gamma, film.moment, film.energy):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()[:32]


# --- Layout -----------------------------------------------------------------------------------


def _blueprint(film: Playback) -> rrb.Blueprint:
    """The ring on the left, once for each energy; curves, series and words on the right."""
    n = len(film.x)
    ring = [_ring_view(name, film) for name in ENERGIES]
    key = rrb.Spatial2DView(
        origin="key", name="colours", background=NIGHT, visual_bounds=_bounds(-12, 312, -10, 24)
    )
    curves = rrb.Horizontal(
        _curve_view("moment", "M a/GJ over gamma"), _curve_view("energy", "U a/GJ over gamma")
    )
    series = rrb.Horizontal(
        _series_view(n, "M and gamma", ["moment", "gamma"]),
        _series_view(n, "U", ["energy"]),
        _series_view(n, "index and eigenvalues", ["index", "eigenvalues/**"]),
    )
    states = rrb.StateTimelineView(
        origin="states",
        name="stability, last event",
        time_view=rrb.TimeAxis(view_range=_whole(n)),
    )
    words = rrb.Horizontal(
        rrb.TextLogView(
            origin="events",
            name="events",
            columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn(TextLogColumnKind.Body)]),
        ),
        rrb.TextDocumentView(origin="about", name="about"),
    )
    panel = rrb.TimePanel(
        timeline="step",
        fps=min(FPS, max(1.0, n / FILM)),
        loop_mode="all",
        play_state="paused",
        state="collapsed",
    )
    left = rrb.Vertical(rrb.Horizontal(*ring), key, row_shares=[9, 1])
    right = rrb.Vertical(curves, series, states, words, row_shares=[4, 3, 1.7, 3])
    aside = (rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed"))
    return rrb.Blueprint(rrb.Horizontal(left, right, column_shares=[1.05, 1]), panel, *aside)


def _ring_view(energy: str, film: Playback) -> rrb.Spatial3DView:
    """The ring in the colours of one energy, the twisting axis upright."""
    mapping = VisualizerComponentMapping(
        "Mesh3D:vertex_colors",
        ComponentSourceKind.SourceComponent,
        source_component=f"{energy}:colors",
    )
    times = film.section.factor
    scale = "" if times == 1.0 else f" (section drawn {times:g} times as large)"
    past = rrb.VisibleTimeRanges(
        timeline="step",
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    eye = rrb.EyeControls3D(
        kind="orbital",
        position=film.size * CAMERA,
        look_target=[0.0, 0.0, 0.0],
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(
        origin="ring",
        name=f"energy of {energy}{scale}",
        background=PAPER,
        line_grid=False,
        eye_controls=eye,
        overrides={
            "ring/ribbon": rr.Mesh3D.from_fields().visualizer(mappings=[mapping]),
            "ring/trace/0": past,
            "ring/trace/1": past,
        },
    )


def _curve_view(name: str, title: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=f"curves/{name}",
        name=title,
        background=NIGHT,
        visual_bounds=_bounds(-20, WIDE + 8, -HIGH - 8, 14),
    )


def _series_view(n: int, title: str, series: Sequence[str]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="series",
        contents=[f"$origin/{name}" for name in series],
        name=title,
        axis_x=rrb.TimeAxis(view_range=_whole(n)),
        plot_legend=rrb.PlotLegend(visible=True),
    )


def _bounds(left: float, right: float, top: float, bottom: float) -> rrb.VisualBounds2D:
    return rrb.VisualBounds2D(x_range=[left, right], y_range=[top, bottom])


def _whole(n: int) -> rr.TimeRange:
    """All steps of a film."""
    first, last = (rr.TimeRangeBoundary.absolute(seq=k) for k in (0, n - 1))
    return rr.TimeRange(start=first, end=last)
