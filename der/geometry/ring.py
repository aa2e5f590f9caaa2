r"""Rings: closed planar curves, their grips, and the bars that were bent to make them.

Lengths are in units of the ring's reference length a. The ring lies in the plane (E2, E3) and is
traversed counter-clockwise, E2 being the first axis and E3 the second. E3 is always the twisting
axis: s = 0 is the first grip, at -E3 with tangent +E2, and s = L/2 the second, at +E3. Every ring
is its own mirror image about E3.

        E3
        ^      second grip, s = L/2
        |    .-o-.
        |   /     \
        |  |       |        tangent (0, cos Theta, sin Theta)
        |   \     /
        |    '-o-'
        |      first grip, s = 0 ->
        +-------------> E2
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from der.geometry.outline import Array, Outline
from der.utils.checks import shown


@dataclass(frozen=True, repr=False)
class Ring:
    """A ring: a closed planar curve, its natural curvature and its twisting axis.

    Made by the functions of `der.geometry.shapes`. Two rings are equal where
    shape, parameters and axis are.

    Parameters
    ----------
    shape : str
        "circle", "ellipse", "rectangle", "triangle" or "profile".
    parameters : dict
        What defines the shape, as it goes into the record (angles in degrees).
    twist_axis : str
        "x": the grips are at the ends of the short semi-axis; "y": of the long one.
    symmetry : str
        "D2": mirror symmetric about E2 and E3; "C2": about E3 only.
    outline : Outline
        The closed curve.
    natural_ratio : float
        Natural curvature over that of the closed curve, 1 for a ring that is free of stress.

    Notes
    -----
    The methods take arc lengths `s` from the first grip in units of a, any real numbers in an array
    of any shape, and raise ValueError where one is not finite.
    """

    shape: str
    parameters: Mapping[str, Any] = field(hash=False)
    twist_axis: str
    symmetry: str
    outline: Outline = field(compare=False)
    natural_ratio: float = field(default=1.0, compare=False)

    def __repr__(self) -> str:
        if self.shape == "profile":
            return f"Ring(profile, {len(self.parameters['arc_length'])} knots)"
        values = ", ".join(f"{name}={value}" for name, value in self.parameters.items())
        return f"Ring({self.shape}, {values}, twist_axis={self.twist_axis})"

    @property
    def length(self) -> float:
        """Full length L, units of a."""
        return self.outline.length

    @property
    def breaks(self) -> tuple[float, ...]:
        """Arc lengths in (0, L) at which the natural curvature jumps, increasing."""
        return self.outline.breaks

    @property
    def kinks(self) -> tuple[float, ...]:
        """Arc lengths in (0, L) at which the natural curvature is not smooth, increasing."""
        return self.outline.kinks

    def angle(self, s: ArrayLike) -> Array:
        """Return the tangent angle Theta of the closed ring, rad: 2 pi more with every turn."""
        turns, local = self._around(s)
        return self.outline.angle(local) + 2 * np.pi * turns

    def natural_angle(self, s: ArrayLike) -> Array:
        """Return the tangent angle of the ring cut open and freed of stress, rad."""
        return self.natural_ratio * self.angle(s)

    def curvature(self, s: ArrayLike) -> Array:
        """Return the natural curvature k1u, units of 1/a; right-continuous at jumps."""
        _, local = self._around(s)
        return self.natural_ratio * self.outline.curvature(local)

    def position(self, s: ArrayLike) -> Array:
        """Return points (r1, r2, r3) of the flat ring, one more dimension than `s`; r1 = 0.

        The twisting axis is r2 = 0, with r3 = 0 midway between the grips.
        """
        _, local = self._around(s)
        place = self.outline.place(local)
        return np.stack([np.zeros_like(place.real), place.real, place.imag], axis=-1)

    def to_json(self) -> dict[str, Any]:
        """Return the ring as it stands in the record: shape, parameters, twisting axis."""
        plain = {k: list(v) if isinstance(v, tuple) else v for k, v in self.parameters.items()}
        return {"shape": self.shape, **plain, "twist_axis": self.twist_axis}

    def _around(self, s: ArrayLike) -> tuple[Array, Array]:
        """Return full turns done, and the arc length since the last."""
        given = np.asarray(s) if not isinstance(s, list | tuple) else np.array(s, dtype=object)
        try:
            s = given.astype(float) if given.dtype.kind in "iufO" else np.array(np.nan)
        except (TypeError, ValueError, OverflowError):
            s = np.array(np.nan)
        if not np.all(np.isfinite(s)):
            raise ValueError(f"s must be finite arc lengths, got {shown(given)}")
        turns = np.floor(s / self.length)
        return turns, s - turns * self.length
