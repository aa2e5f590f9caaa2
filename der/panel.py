"""A panel of the playback: where a curve over gamma, its ticks and its drops lie in the plane."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from der.checks import Array

WIDE, HIGH = 150.0, 90.0  # in its own units
DASH = 1.3  # of a dotted line, and the gap between two, in the same


class Panel:
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

    @property
    def turns(self) -> Array:
        """Ticks of gamma: multiples of pi/4."""
        return np.arange(0.0, self.gamma[1] + 1e-9, math.pi / 4)

    @property
    def rounds(self) -> Array:
        """Ticks of the value: three to seven multiples of 1, 2 or 5 times a power of ten."""
        low, high = self.values
        rough = (high - low) / 5.0
        power = 10.0 ** math.floor(math.log10(rough))
        step = power * next(k for k in (1.0, 2.0, 5.0, 10.0) if k * power >= rough)
        return step * np.arange(
            math.ceil(low / step), math.floor(high / step) + 1, dtype=np.float64
        )


def dotted(line: Array) -> list[Array]:
    """The dashes (2, 2) of a line from its first point (2,) to its last, straight."""
    way = line[-1] - line[0]
    length = float(np.hypot(*way)) or DASH
    starts = np.arange(0.0, length, 2.0 * DASH)
    ends = np.minimum(starts + DASH, length)
    return [line[0] + np.outer(pair, way / length) for pair in zip(starts, ends, strict=True)]
