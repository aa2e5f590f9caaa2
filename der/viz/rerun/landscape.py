"""An energy landscape in a recording, with the present state on it in step with the ring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from der.records.energy_surface import Surface
from der.records.landscape import Landscape, Rest
from der.utils.checks import Array
from der.viz.animation import Motion, middles
from der.viz.rerun.axes import PlotAxes, send_axes, send_labels
from der.viz.rerun.curves import send_curve
from der.viz.rerun.entities import CHALK, INK, ORANGE, SKY, VERMILION, Entities
from der.viz.ribbon import viridis

CEILING = 1.35  # of the path's largest energy: what lies above is not shown
SIDES = (2.0, 1.6, 1.1)  # of the box that the surface fills
PALE = (235, 235, 235)
COLOURS = {"well": SKY, "saddle": VERMILION}


# --- Along the path --------------------------------------------------------------------------


def send_landscape(sent: Entities, landscape: Landscape) -> None:
    """U over gamma with M = 0 states and barriers; beside it, larger, the folded well."""
    path, found = landscape.path, landscape.barriers
    parts = [("whole", "fold", PlotAxes(path.gamma, path.energy), landscape.rests[0], 0.05)]
    if found.saddle is not None and found.open is not None:
        parts.append(("well", "open", well(landscape), landscape.rests[-1], 0.9))
    for part, name, axes, low, share in parts:
        entity, height = f"landscape/{part}", getattr(found, name)
        _send_part(sent, landscape, entity, axes)
        if found.saddle is not None and height is not None:
            saddle, text = landscape.rests[found.saddle], f"to {name} {height:.4g}"
            _send_barrier(sent, f"{entity}/{name}", axes, (low, saddle, share), text)


def well(landscape: Landscape) -> PlotAxes:
    """The axes of the saddle and the folded ring's well, which are small beside the barrier.

    The landscape must have a barrier to open the ring.
    """
    found = landscape.barriers
    if found.open is None or found.saddle is None:
        raise ValueError("landscape must have a barrier to open, got none")
    saddle, end = landscape.rests[found.saddle], landscape.rests[-1]
    span = abs(end.gamma - saddle.gamma)
    across = (saddle.gamma - 0.8 * span, end.gamma + 0.4 * span)
    up = (end.energy - 0.6 * found.open, saddle.energy + 0.4 * found.open)
    return PlotAxes(landscape.path.gamma, landscape.path.energy, window=(across, up))


def _send_part(sent: Entities, landscape: Landscape, entity: str, axes: PlotAxes) -> None:
    """Axes with U over gamma and the M = 0 states."""
    send_axes(sent, entity, axes)
    send_curve(sent, landscape.path, "energy", axes=axes, entity=entity)
    for kind, colour in COLOURS.items():
        rests = [rest for rest in landscape.rests if rest.kind == kind]
        places = axes.place([r.gamma for r in rests], [r.energy for r in rests]).reshape(-1, 2)
        shown = axes.holds(places)
        texts = np.array([f"{kind}, U = {round(rest.energy, 9) + 0.0:.4g}" for rest in rests])
        if axes.window is None:
            texts = np.full(len(rests), kind)
        if shown.any():
            look: dict[str, Any] = {"colors": colour, "radii": 2.0, "draw_order": 40.0}
            labels = texts[shown].tolist()
            points = rr.Points2D(places[shown], labels=labels, show_labels=True, **look)
            sent.still(f"{entity}/{kind}", points)


def _send_barrier(
    sent: Entities, entity: str, axes: PlotAxes, ends: tuple[Rest, Rest, float], text: str
) -> None:
    """Levels through two states, and an arrow between the levels at a share of gamma."""
    low, high, share = ends
    gamma = axes.gamma[0] + share * (axes.gamma[1] - axes.gamma[0])
    foot, top = axes.place([gamma, gamma], [low.energy, high.energy])
    level = axes.place([gamma, high.gamma], high.energy)
    base = axes.place([gamma, low.gamma], low.energy)
    sent.still(f"{entity}/levels", rr.LineStrips2D([level, base], colors=CHALK, radii=0.25))
    arrow = rr.Arrows2D(origins=[foot], vectors=[top - foot], colors=CHALK, radii=0.5)
    sent.still(f"{entity}/height", arrow)
    send_labels(sent, f"{entity}/text", [0.5 * (foot + top) + [9.0, 0.0]], [text])


# --- Over twist and distance -----------------------------------------------------------------


@dataclass(frozen=True)
class Box:
    """Map (gamma, distance, energy) to the view: to a box of SIDES about the origin."""

    gamma: tuple[float, float]
    distance: tuple[float, float]
    ceiling: float

    def place(self, gamma: Array, distance: Array, energy: Array) -> Array:
        """Points (..., 3)."""
        low = np.array([self.gamma[0], self.distance[0], 0.0])
        high = np.array([self.gamma[1], self.distance[1], self.ceiling])
        values = np.stack([gamma, distance, energy], axis=-1)
        return np.asarray(SIDES * ((values - low) / (high - low) - 0.5))


def send_surface(sent: Entities, surface: Surface) -> None:
    """The least energy as a surface, with the path, its special points, and the present state."""
    ceiling = CEILING * float(np.nanmax(surface.path[:, 2]))
    ends = [(float(v[0]), float(v[-1])) for v in (surface.gamma, surface.distance)]
    box = Box(ends[0], ends[1], ceiling)
    _send_relief(sent, surface, box)
    lift = 0.012 * ceiling  # lines lie on the surface, not in it
    turn, away, energy = surface.path.T
    shown = (turn >= ends[0][0]) & (turn <= ends[0][1])
    line = box.place(turn, away, energy + lift)[shown]
    sent.still("surface/path", rr.LineStrips3D([line], colors=INK, radii=0.011))
    for k, snap in enumerate(surface.snaps):
        over = box.place(snap[:, 0], snap[:, 1], snap[:, 2] + lift)
        sent.still(f"surface/snaps/{k}", rr.LineStrips3D([over], colors=VERMILION, radii=0.008))
    for name, colour, label in (("folds", ORANGE, "fold"), ("rests", SKY, "M = 0")):
        rows = getattr(surface, name)
        if len(rows):
            places = box.place(rows[:, 0], rows[:, 1], rows[:, 2] + lift)
            look: dict[str, Any] = {"colors": colour, "radii": 0.022, "show_labels": False}
            points = rr.Points3D(places, labels=[label] * len(rows), **look)
            sent.still(f"surface/{name}", points)
    motion = sent.motion
    now = box.place(motion.gamma, grip_distance(motion), motion.energy + lift)
    sent.still("surface/now", rr.Points3D.from_fields(colors=(204, 121, 167), radii=0.05))
    sent.run("surface/now", rr.Points3D.columns(positions=now.astype(np.float32)))
    _send_box(sent, box)


def grip_distance(motion: Motion) -> Array:
    """Distance (n,) between the grips along the twisting axis, a; negative after they passed."""
    middle = middles(motion.x)[..., 2]
    return middle[:, middle.shape[1] // 2] - middle[:, 0]


def _send_relief(sent: Entities, surface: Surface, box: Box) -> None:
    """The surface as a mesh, without cells that are unknown or above the ceiling."""
    gamma, distance = np.meshgrid(surface.gamma, surface.distance, indexing="ij")
    energy = surface.energy
    known = np.isfinite(energy) & (energy <= box.ceiling)
    n, m = energy.shape
    points = box.place(gamma, distance, np.where(known, energy, 0.0))
    number = np.arange(n * m).reshape(n, m)
    corners = np.stack(
        [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1
    )
    triangles = np.concatenate([corners[..., three] for three in ([0, 1, 2], [0, 2, 3])])
    triangles = triangles[known.ravel()[triangles].all(axis=-1)]
    if not len(triangles):
        return
    flat = points.reshape(-1, 3)
    a, b, c = flat[triangles].swapaxes(0, 1)
    normals = np.zeros_like(flat)
    for corner in triangles.T:
        np.add.at(normals, corner, np.cross(b - a, c - a))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    mesh = rr.Mesh3D(
        vertex_positions=flat.astype(np.float32),
        vertex_normals=normals.astype(np.float32),
        vertex_colors=viridis(np.where(known, energy, 0.0).ravel() / box.ceiling),
        triangle_indices=triangles.astype(np.uint32),
    )
    sent.still("surface/energy", mesh)


def _send_box(sent: Entities, box: Box) -> None:
    """Edges of the box at its foot, and ticks as texts."""
    x, y, z = (np.array([-0.5, 0.5]) * side for side in SIDES)
    foot = [[x[0], y[0], z[0]], [x[1], y[0], z[0]], [x[1], y[1], z[0]], [x[0], y[1], z[0]]]
    lines = [[*foot, foot[0]], [foot[0], [x[0], y[0], z[1]]]]
    sent.still("surface/axes", rr.LineStrips3D(lines, colors=(150, 150, 150), radii=0.004))
    turn, away = (
        [f"{low:.2g} {unit}", name, f"{high:.2g} {unit}"]
        for (low, high), unit, name in (
            ((box.gamma[0] / math.pi, box.gamma[1] / math.pi), "π", "gamma"),
            (box.distance, "a", "distance of the grips"),
        )
    )
    heights = [f"U = {share * box.ceiling:.3g}" for share in (0.5, 1.0)]
    places = [[x[0] + share * SIDES[0], y[0] - 0.12, z[0]] for share in (0.0, 0.5, 1.0)]
    places += [[x[1] + 0.12, y[0] + share * SIDES[1], z[0]] for share in (0.0, 0.5, 1.0)]
    places += [[x[0] - 0.08, y[0], z[0] + share * SIDES[2]] for share in (0.5, 1.0)]
    look: dict[str, Any] = {"radii": 0.001, "colors": PALE, "show_labels": True}
    points = rr.Points3D(places, labels=[*turn, *away, *heights], **look)
    sent.still("surface/values", points)
