"""Axes of a recording: the places of curves over gamma, ticks and labels in a plane."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from der.utils.checks import Array
from der.viz.curve import arc_length
from der.viz.rerun.entities import CHALK, QUIET, Colour, Entities

WIDE, HIGH = 150.0, 90.0  # in its own units
DASH = 1.3  # of a dotted line, and the gap between two, in the same


class PlotAxes:
    """Map (gamma, value) to the picture: to a box WIDE by HIGH, whose y points down.

    Parameters
    ----------
    gamma, values : arrays that the axes contain, together with 0.
    window : instead, the least and largest gamma and value of an enlarged part.
    """

    def __init__(
        self,
        gamma: Array,
        values: Array,
        *,
        window: tuple[tuple[float, float], tuple[float, float]] | None = None,
    ) -> None:
        self.window = window
        if window is not None:
            self.gamma, self.values = window
            return
        self.gamma = (0.0, float(gamma.max()) or 1.0)
        low, high = min(0.0, float(values.min())), float(values.max())
        self.values = (low, high if high > low else low + 1.0)

    def place(self, gamma: ArrayLike, values: ArrayLike) -> Array:
        """Points (n, 2) of the axes."""
        points = np.stack(np.broadcast_arrays(gamma, values), axis=-1).astype(float)
        (left, right), (low, high) = self.gamma, self.values
        return (points - (left, low)) / (right - left, low - high) * (WIDE, HIGH)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 2) lie within the window; all do where there is none."""
        if self.window is None:
            return np.ones(len(points), dtype=bool)
        x, y = points[:, 0], -points[:, 1]
        return (x >= 0.0) & (x <= WIDE) & (y >= 0.0) & (y <= HIGH)

    def inside(self, line: Array) -> list[Array]:
        """The pieces of a line (n, 2) within the window; the complete line where there is none."""
        shown = self.holds(line)
        if shown.all():
            return [line]
        cuts = np.flatnonzero(np.diff(shown)) + 1
        pieces = zip(np.split(line, cuts), np.split(shown, cuts), strict=True)
        return [piece for piece, there in pieces if there[0] and len(piece) > 1]

    @property
    def turns(self) -> Array:
        """Ticks of gamma: multiples of pi/4, in a window some of pi."""
        if self.window is not None:
            return math.pi * _rounds(self.gamma[0] / math.pi, self.gamma[1] / math.pi)
        return np.arange(0.0, self.gamma[1] + 1e-9, math.pi / 4)

    @property
    def rounds(self) -> Array:
        """Ticks of the value: three to seven multiples of 1, 2 or 5 times a power of ten."""
        return _rounds(*self.values)


def _rounds(low: float, high: float) -> Array:
    """Three to seven round numbers from low to high."""
    rough = (high - low) / 5.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = power * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * power >= rough)
    return step * np.arange(math.ceil(low / step), math.floor(high / step) + 1, dtype=np.float64)


def dotted(line: Array) -> list[Array]:
    """The dashes (2, 2) of a line (n, 2), alike along it."""
    along = arc_length(line)
    length = float(along[-1]) or DASH
    starts = np.arange(0.0, length, 2.0 * DASH)
    ends = np.minimum(starts + DASH, length)
    x, y = (np.interp([starts, ends], along, v) for v in line.T)
    return list(np.moveaxis(np.stack([x, y]), -1, 0).swapaxes(1, 2))


def send_axes(sent: Entities, entity: str, axes: PlotAxes) -> None:
    """Send the lines, ticks and numbers of axes."""
    foot = axes.values[0]
    across = axes.place(axes.gamma, foot)
    upright = axes.place(axes.gamma[0], axes.values)
    lines = [across, upright]
    if foot <= 0.0 <= axes.values[1]:
        lines.append(axes.place(axes.gamma, 0.0))
    below = axes.place(axes.turns, foot)
    beside = axes.place(axes.gamma[0], axes.rounds)
    lines += [*np.stack([below, np.add(below, [0.0, 2.0])], axis=1)]
    lines += [*np.stack([beside, np.add(beside, [-2.0, 0.0])], axis=1)]
    sent.still(f"{entity}/axes", rr.LineStrips2D(lines, colors=QUIET, radii=0.2))
    places = np.concatenate([np.add(below, [0.0, 3.0]), np.add(beside, [-9.0, -4.0])])
    texts = [f"{turn / math.pi:.5g} π" for turn in axes.turns]
    texts += [f"{value:.6g}" for value in axes.rounds]
    send_labels(sent, f"{entity}/values", places, texts)


def send_labels(
    sent: Entities, entity: str, places: ArrayLike, labels: Sequence[str], *, colour: Colour = CHALK
) -> None:
    """Send texts at places of 2-D axes."""
    points = rr.Points2D(places, labels=labels, radii=0.01, colors=colour, show_labels=True)
    sent.still(entity, points)
