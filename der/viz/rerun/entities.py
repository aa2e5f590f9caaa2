"""A ring in a recording: its entities, those that never change and those that do at every step."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from der.utils.checks import Array
from der.viz.animation import ENERGIES, Motion, grips, middles
from der.viz.ribbon import ribbon, triangles, viridis

Colour: TypeAlias = tuple[int, ...]

GHOST = 0.2  # largest displacement of the softest mode, over the mean radius
REACH = 1.55  # half the length of the twisting axis, over the mean radius
INK, QUIET, CHALK = (34, 34, 34), (140, 140, 140), (225, 225, 225)
SKY, VERMILION, GREEN, ORANGE = (86, 180, 233), (213, 94, 0), (0, 158, 115), (230, 159, 0)
PAIR = (SKY, ORANGE)  # of two rings, whose curves share axes
ARC = 25  # points on the arc that shows a grip's rotation
TURNED = 0.34  # radius of that arc, over the mean radius


class Entities:
    """The entities of a ring in a recording: sends those that are still and those that move.

    Parameters
    ----------
    under : prefix of the names of entities where there are two rings, "first/" for instance.
    gamma : (n,) of the second timeline [rad]; the motion's own if not given.
    top : the energy density of the brightest colour; the motion's own if not given.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        motion: Motion,
        *,
        under: str = "",
        gamma: NDArray[np.float64] | None = None,
        top: float | None = None,
    ) -> None:
        self.stream = stream
        self.motion = motion
        self.under = under
        self.top = motion.top if top is None else top
        turned = motion.gamma if gamma is None else gamma
        self.mdeg = np.rint(1e3 * np.degrees(turned)).astype(np.int64)

    def still(self, entity: str, *what: rr.AsComponents) -> None:
        """Log what does not change."""
        self.stream.log(self.under + entity, *what, static=True, strict=True)

    def run(self, entity: str, columns: rr.ComponentColumnList, steps: ArrayLike = ()) -> None:
        """Send columns with a row a step, of all steps or of some."""
        at = np.asarray(steps, dtype=np.int64)
        if not len(at):
            at = np.arange(len(self.motion.x))
        lines = {"step": at, "gamma_mdeg": self.mdeg[at]}
        times = [rr.TimeColumn(name, sequence=values) for name, values in lines.items()]
        self.stream.send_columns(self.under + entity, times, columns, strict=True)

    def strips(self, entity: str, lines: Array, colour: Colour, radius: float) -> None:
        """Send a line (n, k, 3) a step; its radius is over the ring's mean radius."""
        look = rr.LineStrips3D.from_fields(colors=colour, radii=radius * self.motion.size)
        self.still(entity, look)
        self.run(entity, rr.LineStrips3D.columns(strips=list(lines.astype(np.float32))))

    def arrows(
        self, entity: str, origins: Array, vectors: Array, colour: Colour, radius: float
    ) -> None:
        """Send an arrow (n, 3) a step; its radius is over the ring's mean radius."""
        look = rr.Arrows3D.from_fields(colors=colour, radii=radius * self.motion.size)
        self.still(entity, look)
        self.run(entity, rr.Arrows3D.columns(origins=origins, vectors=vectors))


def send_ring(sent: Entities) -> None:
    """The ribbon, the lines about it, the grips, and the softest mode where it is known."""
    _send_ribbon(sent)
    _send_lines(sent)
    _send_grips(sent)
    _send_modes(sent)


def _send_ribbon(sent: Entities) -> None:
    """The ribbon, with one set of colours for bending and one for twisting."""
    motion = sent.motion
    n, n_v, _ = motion.x.shape
    positions, normals = ribbon(motion.x, motion.frames, motion.section)
    sent.still("ring/ribbon", rr.Mesh3D.from_fields(triangle_indices=triangles(n_v)))
    columns = rr.Mesh3D.columns(
        vertex_positions=positions.reshape(-1, 3).astype(np.float32),
        vertex_normals=normals.reshape(-1, 3).astype(np.float32),
    )
    sent.run("ring/ribbon", columns.partition([8 * n_v] * n))
    for name, density in zip(ENERGIES, motion.density, strict=True):
        shades = np.repeat(viridis(density / sent.top).reshape(-1), 8)
        batch = {"colors": rr.components.ColorBatch(shades)}
        dynamic = rr.DynamicArchetype.columns(archetype=name, components=batch)
        sent.run("ring/ribbon", dynamic.partition([8 * n_v] * n))


def _send_lines(sent: Entities) -> None:
    """The centreline, the twisting axis, and the path of the free points up to the present."""
    motion = sent.motion
    sent.strips("ring/centreline", closed(motion.x), INK, 0.004)
    end = REACH * motion.size
    axis = rr.LineStrips3D([[[0, 0, -end], [0, 0, end]]], colors=QUIET, radii=0.003 * motion.size)
    sent.still("ring/axis", axis)
    n_v = motion.x.shape[1]
    middle = middles(motion.x)
    for arm, s in enumerate((n_v / 4, 3 * n_v / 4)):
        point = 0.5 * (middle[:, math.floor(s)] + middle[:, math.ceil(s)])
        before = np.concatenate([point[:1], point[:-1]])
        sent.strips(f"ring/trace/{arm}", np.stack([before, point], axis=1), GREEN, 0.006)


def closed(x: Array) -> Array:
    """Closed polygons (..., N + 1, 3) through vertices."""
    return np.concatenate([x, x[..., :1, :]], axis=-2)


def _send_grips(sent: Entities) -> None:
    """The grips: the rotation of each, and the moment on it, along the axis and beside it."""
    motion = sent.motion
    size, n_v = motion.size, motion.x.shape[1]
    largest = float(np.nanmax(np.abs(motion.moment))) or 1.0
    middle, arcs = middles(motion.x), grips(motion, TURNED, ARC)
    for k, (name, edge, sign) in enumerate((("first", 0, 1.0), ("second", n_v // 2, -1.0))):
        entity = f"ring/grips/{name}"
        centre, d1 = middle[:, edge], motion.frames[:, edge, 0]
        sent.arrows(f"{entity}/rotation", centre, 0.42 * size * d1, INK, 0.012)
        sent.strips(f"{entity}/angle", arcs[k, :, :-1], INK, 0.005)
        vectors = np.zeros_like(centre)
        vectors[:, 2] = sign * 0.4 * size * np.nan_to_num(motion.moment) / largest
        start = centre - [0.0, 0.0, sign * 0.3 * size] - 0.5 * vectors
        sent.arrows(f"{entity}/moment", start, vectors, VERMILION, 0.018)


def _send_modes(sent: Entities) -> None:
    """The softest mode as a ghost of the centreline, where it is known."""
    motion = sent.motion
    if motion.u is None:
        return
    largest = np.linalg.norm(motion.u, axis=2).max(axis=1)
    known = np.isfinite(largest) & (largest > 0.0)
    ghost = motion.x[known] + GHOST * motion.size * motion.u[known] / largest[known, None, None]
    style = rr.LineStrips3D.from_fields(colors=(*VERMILION, 150), radii=0.008 * motion.size)
    sent.still("ring/softest_mode", style)
    strips = rr.LineStrips3D.columns(strips=list(closed(ghost).astype(np.float32)))
    sent.run("ring/softest_mode", strips.partition(known.astype(int)))
