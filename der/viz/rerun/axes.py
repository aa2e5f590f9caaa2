"""Axes of a recording: where curves over gamma, ticks and labels lie in a plane."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from der.utils.checks import Array
from der.viz.rerun.entities import CHALK, QUIET, Colour, Entities

WIDE, HIGH = 150.0, 90.0  # in its own units
DASH = 1.3  # of a dotted line, and the gap between two, in the same


class PlotAxes:
    """Where (gamma, value) is drawn: in a box WIDE by HIGH, of which y points down.

    Parameters
    ----------
    gamma, values : arrays that the axes are to hold, 0 with them.
    window : instead, the least and largest gamma and value of a part that is shown larger.
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
        across = (np.asarray(gamma, dtype=float) - self.gamma[0]) / (self.gamma[1] - self.gamma[0])
        up = (np.asarray(values, dtype=float) - self.values[0]) / (self.values[1] - self.values[0])
        return np.stack(np.broadcast_arrays(WIDE * across, -HIGH * up), axis=-1)

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, 2) lie within a window; all do where there is none."""
        if self.window is None:
            return np.ones(len(points), dtype=bool)
        x, y = points[:, 0], -points[:, 1]
        return (x >= 0.0) & (x <= WIDE) & (y >= 0.0) & (y <= HIGH)

    def inside(self, line: Array) -> list[Array]:
        """The pieces of a line (n, 2) that lie within a window; all of it where there is none."""
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
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    length = float(along[-1]) or DASH
    starts = np.arange(0.0, length, 2.0 * DASH)
    ends = np.minimum(starts + DASH, length)
    x, y = (np.interp([starts, ends], along, v) for v in line.T)
    return list(np.moveaxis(np.stack([x, y]), -1, 0).swapaxes(1, 2))


def send_axes(sent: Entities, entity: str, axes: PlotAxes) -> None:
    """The axes of a axes with their ticks."""
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
