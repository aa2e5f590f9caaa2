"""The motion of a ring along a path, as arrays with one entry a step.

The states are those of the path in its order. Between the states before and after a snap are those
of the snap's dynamics, if the shapes of the path contain them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from der.geometry.scale import Scale
from der.records.configurations import Fall, Shapes
from der.records.path import Path
from der.records.units import factor
from der.utils import checks
from der.utils.checks import Array

ENERGIES = ("bending", "twisting")
A_OVER_T = 200.0  # of a ring whose record does not say
SEEN = 0.13  # least wider side of the drawn section, over the ring's mean radius


@dataclass(frozen=True)
class Section:
    """The section as it is drawn."""

    h: float  # along d1, a
    t: float  # along d2, a
    factor: float  # over the real ones


@dataclass(frozen=True, eq=False)
class Motion:
    """What is shown, with one entry a step of the motion."""

    x: Array  # (n, N, 3) vertices
    frames: Array  # (n, N, 3, 3) material frames of the edges
    position: NDArray[np.int64]  # (n,) in the path; -1 within a snap
    gamma: Array  # (n,) rad
    moment: Array  # (n,) GJ/a; nan within a snap
    energy: Array  # (n,) GJ/a
    density: Array  # (2, n, N) each of ENERGIES over length, at the vertices
    section: Section
    classes: tuple[str, ...]  # (m,) symmetry classes of the softest modes
    eigenvalues: Array  # (n, m); nan within a snap
    u: Array | None  # (n, N, 3) displacements in the softest mode; nan within a snap
    scale: Scale | None  # None: energies in GJ/a; else in its units, as those of the path

    @property
    def size(self) -> float:
        """Mean radius of the ring at its first state."""
        return mean_radius(self.x[0])

    @property
    def top(self) -> float:
        """The energy density of the brightest colour: the largest of all equilibria."""
        return float(self.density[:, self.position >= 0].max()) or 1.0

    def step_of(self, position: int) -> int:
        """The step of the motion that shows a state of the path."""
        return int(np.flatnonzero(self.position == position)[0])


def animate(path: Path, *, rest: Array | None = None) -> Motion:
    """The motion of a path: its states, with the states of its snaps between them.

    Parameters
    ----------
    path : with shapes; as it is shown (`in_units`).
    rest : (N, 3) natural strains of the vertices, integrated [rad]; None for a path that begins
        flat: those of its first state, times the natural curvature.

    Raises
    ------
    ValueError
        If the path has no state or no shapes, or `rest` is needed or of another shape.
    """
    if path.shapes is None or not len(path):
        raise ValueError("path must have shapes to be recorded, got none")
    shapes, snaps, softest = path.shapes, path.shapes.falls, path.shapes.softest
    n, n_v, _ = shapes.x.shape
    if rest is not None:
        rest = checks.checked_array("rest", rest, (n_v, 3))
    elif path.gamma[0] == 0.0:
        rest = number(path.ring, "natural_curvature", 1.0) * _strains(shapes.frames[0])
    else:
        raise ValueError(f"rest must be given where gamma begins at {path.gamma[0]:g}")
    order = _order(n, snaps)
    position = np.where(order < n, order, -1)
    x, frames, gamma, energy = (
        np.concatenate([states, *(times * getattr(snap, name) for snap in snaps)])[order]
        for name, states, times in (
            ("x", shapes.x, 1.0),
            ("frames", shapes.frames, 1.0),
            ("gamma", path.gamma, 1.0),
            ("energy", path.energy, factor(path.scale, "energy")),
        )
    )
    values = np.empty((n, 0)) if softest is None else softest.eigenvalues
    return Motion(
        x=x,
        frames=frames,
        position=position,
        gamma=gamma,
        moment=spread(path.moment, position),
        energy=energy,
        density=factor(path.scale, "force") * _densities(path, _cells(shapes), frames, rest),
        section=_section(path, x[0]),
        classes=() if softest is None else softest.classes,
        eigenvalues=spread(values, position),
        u=None if softest is None else spread(softest.u, position),
        scale=path.scale,
    )


def _order(n: int, snaps: Sequence[Fall]) -> NDArray[np.int64]:
    """Positions of the motion's steps in the `n` states of the path followed by all snaps."""
    after = [np.full(len(snap.x), snap.after + 0.5) for snap in snaps]
    return np.argsort(np.concatenate([np.arange(n), *after]), kind="stable")


def spread(values: Array, position: NDArray[np.int64]) -> Array:
    """Values of the states at every step of the motion, nan within a snap."""
    out = np.asarray(values, dtype=float)[position]
    out[position < 0] = np.nan
    return out


def edges(x: Array) -> Array:
    """Edge vectors (..., N, 3) of closed polygons; edge j ends at vertex j."""
    return x - np.roll(x, 1, axis=-2)


def middles(x: Array) -> Array:
    """Middles (..., N, 3) of the edges."""
    return 0.5 * (x + np.roll(x, 1, axis=-2))


def grips(motion: Motion, radius: float, points: int) -> Array:
    """The rotation of each grip as an arc, and its own middle last, (2, n, points + 1, 3).

    Parameters
    ----------
    radius : of the arcs, over the ring's mean radius.
    points : on each arc, from where the grip began to where it is.
    """
    n_v = motion.x.shape[1]
    middle = middles(motion.x)
    found = []
    for edge, sign in ((0, 1.0), (n_v // 2, -1.0)):
        centre, d1 = middle[:, edge], motion.frames[0, edge, 0]
        across = np.cross([0.0, 0.0, 1.0], d1)
        turned = np.linspace(0.0, sign * motion.gamma, points, axis=1)[..., None]
        arc = radius * motion.size * (np.cos(turned) * d1 + np.sin(turned) * across)
        found.append(np.concatenate([centre[:, None] + arc, centre[:, None]], axis=1))
    return np.array(found)


def _strains(frames: Array) -> Array:
    """Rotation vectors (..., N, 3) [rad] from each frame to the next, in frame components."""
    from scipy.spatial.transform import Rotation

    turn = frames @ np.roll(frames, -1, axis=-3).swapaxes(-1, -2)
    vectors: Array = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(frames.shape[:-1])


def _cells(shapes: Shapes) -> Array:
    """Arc lengths (N,) between neighbouring frames; the last one mirrors the first."""
    if shapes.arc_length is not None:
        s = shapes.arc_length
        return np.diff(s, append=s[-1] + s[1])
    return np.linalg.norm(edges(shapes.x[0]), axis=1)


def _densities(path: Path, cell: Array, frames: Array, rest: Array) -> Array:
    """Densities (2, n, N) of bending and twisting, GJ/a^2."""
    per_length = (_strains(frames) - rest) / cell[:, None]
    stiffness = np.array([number(path.section, name, 1.0) for name in ("alpha", "beta", "GJ")])
    parts = 0.5 * stiffness * per_length**2
    return np.stack([parts[..., 0] + parts[..., 1], parts[..., 2]])


def number(entries: Mapping[str, object], name: str, default: float) -> float:
    """A number of a record's mapping, or the default."""
    value = entries.get(name)
    return float(value) if isinstance(value, int | float) else default


def _section(path: Path, flat: Array) -> Section:
    """h and t of the section, and how many times larger they are drawn."""
    alpha, beta = (number(path.section, name, 1.0) for name in ("alpha", "beta"))
    t = 1.0 / number(path.numerics, "a_over_t", A_OVER_T)
    h = t * number(path.section, "h_over_t", math.sqrt(beta / alpha))
    factor = float(max(1, math.ceil(SEEN * mean_radius(flat) / max(h, t))))
    return Section(factor * h, factor * t, factor)


def mean_radius(flat: Array) -> float:
    """Length of a closed polygon (N, 3) over 2 pi."""
    return float(np.linalg.norm(edges(flat), axis=1).sum()) / (2 * math.pi)
