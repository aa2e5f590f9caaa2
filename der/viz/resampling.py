"""Animations resampled to even motion, and two of them in step.

A path has few states, which are dense where its curvature is large. An animation needs steps of
about equal motion. Between two equilibria the ring is drawn on a spline through its states, as the
curves are (see `curve`). Within snaps it is drawn on straight lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from der.records.path import Path
from der.records.units import in_units
from der.utils.checks import Array
from der.viz.animation import Motion, animate
from der.viz.curve import chord_length, pieces, smooth, spline
from der.viz.ribbon import unit

PER = 16  # points of the drawn curve in an interval; the present state moves on them
FINE = 240  # steps of each of two motions before they are aligned
_ROUND = 1e-9


def resampled(path: Path, n: int) -> Motion:
    """A path in ``n`` steps of about equal motion; special points are kept besides."""
    motion = animate(path)
    return between(path, motion, _even(path, motion, n))


def one_or_two(path: Path | Sequence[Path]) -> list[Path]:
    """One path or two as a list, with their numbers in their units where these are the same.

    Raises
    ------
    ValueError
        If there are more, or none.
    """
    paths = [path] if isinstance(path, Path) else list(path)
    if len(paths) not in (1, 2):
        raise ValueError(f"path must be one or two, got {len(paths)}")
    if len({None if one.scale is None else one.scale.units for one in paths}) > 1:
        return [replace(one, scale=None) for one in paths]
    return list(map(in_units, paths))


def in_step(paths: Sequence[Path], n: int) -> list[Motion]:
    """Motions of one or two paths in about ``n`` common steps, at equal gamma where that exists.

    Where the gamma of one ring turns back, or the ring snaps, the other one waits.

    Raises
    ------
    ValueError
        If ``n`` is below 2.
    """
    if n < 2:
        raise ValueError(f"frames must be at least 2, got {n!r}")
    if len(paths) == 1:
        return [resampled(paths[0], n)]
    motions = list(map(animate, paths))
    fine = [_even(path, motion, FINE) for path, motion in zip(paths, motions, strict=True)]
    gamma = [motion.gamma for motion in map(between, paths, motions, fine)]
    pairs = aligned(*gamma)
    at = [places[chosen] for places, chosen in zip(fine, pairs.T, strict=True)]
    rows = np.linspace(0, len(pairs) - 1, n).round().astype(int)
    for path, motion, places in zip(paths, motions, at, strict=True):
        rows = np.append(rows, np.searchsorted(places, np.subtract(_kept(path, motion), _ROUND)))
    rows = np.unique(rows)
    return list(map(between, paths, motions, [places[rows] for places in at]))


def aligned(one: Array, other: Array) -> NDArray[np.int64]:
    """Pairs (k, 2) of places in two sequences, ascending in both, with the closest values.

    They have the least sum of differences, by dynamic programming (time warping). Of equal sums,
    the one is taken in which both sequences advance.
    """
    n, m = len(one), len(other)
    apart = np.abs(one[:, None] - other) + 1e-9
    cost = np.full((n + 1, m + 1), np.inf)
    cost[0, 0] = 0.0
    for i in range(n):
        above, row = cost[i], cost[i + 1]
        ahead = np.minimum(above[:-1], above[1:])
        for j in range(m):
            row[j + 1] = apart[i, j] + min(ahead[j], row[j])
    pairs = [(n, m)]
    while pairs[-1] != (1, 1):
        i, j = pairs[-1]
        pairs.append(min(((i - 1, j - 1), (i - 1, j), (i, j - 1)), key=lambda p: cost[p]))
    return np.array(pairs[::-1], dtype=np.int64) - 1


def between(path: Path, motion: Motion, places: Array) -> Motion:
    """The motion at places between its steps, without modes.

    Parameters
    ----------
    places : (m,) ascending; 2.5 is in the middle between the steps 2 and 3. Where a snap has no
        history, the ring is shown before or after it.
    """
    last = len(motion.x) - 1
    at = np.clip(np.asarray(places, dtype=float), 0.0, last)
    at = np.where(np.abs(at - at.round()) < _ROUND, at.round(), at)
    landed = [motion.step_of(p.position) for p in path.points if p.kind == "snap" and p.position]
    for step in landed:
        if motion.position[step - 1] >= 0:  # no history
            at = np.where((at > step - 1) & (at < step), (at + 0.5).astype(int), at)
    k = np.minimum(at.astype(int), max(last - 1, 0))
    snapping = (motion.position[k] < 0) | (motion.position[np.minimum(k + 1, last)] < 0)
    n, n_v, _ = motion.x.shape
    density = np.moveaxis(motion.density, 0, -1)
    drawn = np.concatenate([motion.x, motion.frames.reshape(n, n_v, 9), density], axis=2)
    drawn = _splined(path, motion, drawn.reshape(n, -1), at).reshape(len(at), n_v, -1)
    share = at - k
    position = motion.position[np.where(share == 1.0, np.minimum(k + 1, last), k)]
    inside = snapping & ((position < 0) | (share > 0.0) & (share < 1.0))
    names = ("gamma", "moment", "energy")
    values: dict[str, Any] = {name: _on_curve(path, motion, name, at, inside) for name in names}
    return replace(
        motion,
        **values,
        x=drawn[..., :3],
        frames=_orthonormal(drawn[..., 3:12].reshape(len(at), n_v, 3, 3)),
        position=np.where(inside, -1, position),
        density=np.moveaxis(np.maximum(drawn[..., 12:], 0.0), -1, 0),
        classes=(),
        eigenvalues=np.empty((len(at), 0)),
        u=None,
    )


def _even(path: Path, motion: Motion, n: int) -> Array:
    """Places in steps of equal motion; the motion is half that of the ring, half that of grips."""
    if len(motion.x) == 1:
        return np.zeros(1)
    moved = np.linalg.norm(np.diff(motion.x, axis=0), axis=2).max(axis=1)
    turned = np.abs(np.diff(motion.gamma))
    steps = moved / (float(moved.sum()) or 1.0) + turned / (float(turned.sum()) or 1.0)
    length = np.append(0.0, np.cumsum(steps))
    rising = np.flatnonzero(np.append(True, steps > 0.0))
    places = np.interp(np.linspace(0.0, length[-1], n), length[rising], rising)
    return np.unique(np.concatenate([places, _kept(path, motion)]))


def _kept(path: Path, motion: Motion) -> list[float]:
    """Steps that are always shown: special points and the last one."""
    return [*(float(motion.step_of(p.position)) for p in path.points), len(motion.x) - 1.0]


def _on_curve(path: Path, motion: Motion, name: str, at: Array, inside: Array) -> Array:
    """Values at places of the motion: on the drawn curve; within snaps those of the snap."""
    steps = np.arange(len(motion.x))
    known = motion.position >= 0
    # a step of a snap has no place in the path: it gets that of the state before the snap
    place = np.interp(at, steps[known], motion.position[known].astype(float))
    if len(path) == 1:
        values = np.repeat(getattr(path, name), len(at))
    else:
        column, height = (0, path.energy) if name == "gamma" else (1, getattr(path, name))
        curve = smooth(path, height, PER)[:, column] * (np.pi if name == "gamma" else 1.0)
        values = np.interp(place * PER, np.arange(len(curve)), curve)
    own: Array = getattr(motion, name)
    snapping = np.nan if name == "moment" else np.interp(at, steps, own)
    return np.where(inside, snapping, values)


def _splined(path: Path, motion: Motion, values: Array, at: Array) -> Array:
    """Rows of values (n, m) at places: splines along the smooth pieces, lines within snaps."""
    k = np.minimum(at.astype(int), max(len(values) - 2, 0))
    after = np.minimum(k + 1, len(values) - 1)
    share = (at - k)[:, None]
    out = (1.0 - share) * values[k] + share * values[after]
    if len(path) == 1:
        return out
    length = chord_length(path)  # that of the curve, so that gamma is that of the grips
    for first, last in pieces(path):
        a, b = motion.step_of(first), motion.step_of(last)
        inside = (at > a) & (at < b)
        out[inside] = spline(length[first : last + 1], values[a : b + 1], at[inside] - a)
    return out


def _orthonormal(frames: Array) -> Array:
    """Orthonormal frames near to these, with the same direction of d3."""
    d3 = unit(frames[..., 2, :])
    d1 = frames[..., 0, :]
    d1 = unit(d1 - np.sum(d1 * d3, axis=-1, keepdims=True) * d3)
    return np.stack([d1, np.cross(d3, d1), d3], axis=-2)
