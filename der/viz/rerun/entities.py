"""A ring in a recording: its entities, those that never change and those that do at every step."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

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
    """The entities of a ring in a recording: sends what never changes, and what does at every step.

    Parameters
    ----------
    under : before the names of entities where there are two rings, "first/" for instance.
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
        """Log what never changes."""
        self.stream.log(self.under + entity, *what, static=True, strict=True)

    def run(self, entity: str, columns: rr.ComponentColumnList, steps: ArrayLike = ()) -> None:
        """Send columns, a row a step, of all steps or of some."""
        at = np.asarray(steps, dtype=np.int64)
        if not len(at):
            at = np.arange(len(self.motion.x))
        times = [
            rr.TimeColumn("step", sequence=at),
            rr.TimeColumn("gamma_mdeg", sequence=self.mdeg[at]),
        ]
        self.stream.send_columns(self.under + entity, times, columns, strict=True)


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
    closed = np.concatenate([motion.x, motion.x[:, :1]], axis=1).astype(np.float32)
    send_strips(sent, "ring/centreline", list(closed), INK, 0.004)
    end = REACH * motion.size
    axis = rr.LineStrips3D([[[0, 0, -end], [0, 0, end]]], colors=QUIET, radii=0.003 * motion.size)
    sent.still("ring/axis", axis)
    n_v = motion.x.shape[1]
    middle = middles(motion.x)
    for arm, s in enumerate((n_v / 4, 3 * n_v / 4)):
        point = 0.5 * (middle[:, math.floor(s)] + middle[:, math.ceil(s)])
        before = np.concatenate([point[:1], point[:-1]])
        strips = np.stack([before, point], axis=1).astype(np.float32)
        send_strips(sent, f"ring/trace/{arm}", list(strips), GREEN, 0.006)


def send_strips(
    sent: Entities, entity: str, strips: list[NDArray[np.float32]], colour: Colour, radius: float
) -> None:
    """A line strip a step."""
    style = rr.LineStrips3D.from_fields(colors=colour, radii=radius * sent.motion.size)
    sent.still(entity, style)
    sent.run(entity, rr.LineStrips3D.columns(strips=strips))


def _send_grips(sent: Entities) -> None:
    """The grips: how far each has turned, and the moment on it, along the axis and beside it."""
    motion = sent.motion
    size, n_v = motion.size, motion.x.shape[1]
    largest = float(np.nanmax(np.abs(motion.moment))) or 1.0
    middle, arcs = middles(motion.x), grips(motion, TURNED, ARC)
    for name, edge, sign in (("first", 0, 1.0), ("second", n_v // 2, -1.0)):
        entity = f"ring/grips/{name}"
        centre, d1 = middle[:, edge], motion.frames[:, edge, 0]
        sent.still(f"{entity}/rotation", rr.Arrows3D.from_fields(colors=INK, radii=0.012 * size))
        sent.run(
            f"{entity}/rotation", rr.Arrows3D.columns(origins=centre, vectors=0.42 * size * d1)
        )
        arc = arcs[0 if sign > 0.0 else 1, :, :-1].astype(np.float32)
        send_strips(sent, f"{entity}/angle", list(arc), INK, 0.005)
        vectors = np.zeros_like(centre)
        vectors[:, 2] = sign * 0.4 * size * np.nan_to_num(motion.moment) / largest
        beside = centre - [0.0, 0.0, sign * 0.3 * size]
        sent.still(
            f"{entity}/moment", rr.Arrows3D.from_fields(colors=VERMILION, radii=0.018 * size)
        )
        sent.run(
            f"{entity}/moment", rr.Arrows3D.columns(origins=beside - 0.5 * vectors, vectors=vectors)
        )


def _send_modes(sent: Entities) -> None:
    """The softest mode as a ghost of the centreline, where it is known."""
    motion = sent.motion
    if motion.u is None:
        return
    largest = np.linalg.norm(motion.u, axis=2).max(axis=1)
    known = np.isfinite(largest) & (largest > 0.0)
    ghost = motion.x[known] + GHOST * motion.size * motion.u[known] / largest[known, None, None]
    closed = np.concatenate([ghost, ghost[:, :1]], axis=1).astype(np.float32)
    style = rr.LineStrips3D.from_fields(colors=(*VERMILION, 150), radii=0.008 * motion.size)
    sent.still("ring/softest_mode", style)
    strips = rr.LineStrips3D.columns(strips=list(closed))
    sent.run("ring/softest_mode", strips.partition(known.astype(int)))
