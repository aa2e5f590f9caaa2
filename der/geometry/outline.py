"""Closed planar curves by arc length, mirror symmetric about their second axis.

A curve starts at s = 0 on the negative second axis, along the first axis, and runs
counter-clockwise; halfway, at s = L/2, it crosses the positive second axis. Its tangent is
(cos Theta, sin Theta); places are complex numbers, first + i second coordinate.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]
Bends: TypeAlias = tuple[Array, Array, Array]  # knots, curvature just after and just before them
Piece: TypeAlias = tuple[float, float]  # length, curvature

ROUNDING = 1e-14  # lengths below this are none: the straights left by the largest fillet, say
LARGEST_TURN = 4 * np.pi  # of one piece: beyond, the Gauss sums lose digits
LITTLE_TURN = 0.1


@dataclass(frozen=True, eq=False)
class PiecewiseLinear:
    """A curve whose curvature is linear in arc length between its knots.

    Straights and circular arcs are the pieces of constant curvature. The angle is a quadratic of
    arc length, exactly; positions are Gauss sums, exact to rounding.
    """

    knots: Array  # (n+1,) arc lengths, increasing from 0
    curvature_start: Array  # (n,) just after a piece's first knot
    curvature_end: Array  # (n,) just before its last
    knot_angle: Array  # (n+1,) Theta at the knots
    knot_place: ComplexArray  # (n+1,) position at the knots

    @classmethod
    def integrated(cls, knots: Array, start: Array, end: Array) -> "PiecewiseLinear":
        """Return the open curve of this curvature, from the origin along the first axis."""
        kept = np.diff(knots) > ROUNDING
        knots, start, end = np.append(0.0, knots[1:][kept]), start[kept], end[kept]
        length = np.diff(knots)
        knot_angle = np.append(0.0, np.cumsum(length * (start + end) / 2))
        chord = _chord(length, knot_angle[:-1], start, (end - start) / length)
        return cls(knots, start, end, knot_angle, np.append(0.0, np.cumsum(chord)))

    def mirrored(self) -> "PiecewiseLinear":
        """Return the closed curve of which this is the first half, its ends about the origin."""
        place = self.knot_place - 0.5j * self.knot_place[-1].imag
        return PiecewiseLinear(
            *reflected(self.knots, self.curvature_start, self.curvature_end),
            knot_angle=np.append(self.knot_angle, 2 * np.pi - self.knot_angle[-2::-1]),
            knot_place=np.append(place, -np.conj(place[-2::-1])),
        )

    @property
    def length(self) -> float:
        """Full length of the curve."""
        return float(self.knots[-1])

    @property
    def breaks(self) -> tuple[float, ...]:
        """Arc lengths of the jumps in curvature."""
        jumps = self.curvature_end[:-1] != self.curvature_start[1:]
        return tuple(self.knots[1:-1][jumps].tolist())

    @property
    def kinks(self) -> tuple[float, ...]:
        """Arc lengths of all knots."""
        return tuple(self.knots[1:-1].tolist())

    @property
    def slope_jumps(self) -> Array:
        """Jumps of the curvature's slope at the knots of `kinks`, units of 1/a^3."""
        slope = (self.curvature_end - self.curvature_start) / np.diff(self.knots)
        return np.diff(slope)

    def angle(self, s: Array) -> Array:
        """Tangent angle at `s`, exactly."""
        i, u, slope = self._locate(s)
        return self.knot_angle[i] + u * (self.curvature_start[i] + slope * u / 2)

    def curvature(self, s: Array) -> Array:
        """Curvature at `s`, right-continuous."""
        i, u, slope = self._locate(s)
        return self.curvature_start[i] + slope * u

    def place(self, s: Array) -> ComplexArray:
        """Position at `s`."""
        i, u, slope = self._locate(s)
        chord = _chord(u, self.knot_angle[i], self.curvature_start[i], slope)
        return self.knot_place[i] + chord

    def _locate(self, s: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return for each `s` its piece, the arc length into it and the curvature's slope there."""
        last = len(self.curvature_start) - 1
        i = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, last)
        rise = self.curvature_end[i] - self.curvature_start[i]
        return i, s - self.knots[i], rise / (self.knots[i + 1] - self.knots[i])


def _chord(u: Array, angle: Array, curvature: Array, slope: Array) -> ComplexArray:
    """Return the integral of exp(i Theta) over [0, u], Theta = angle + curvature u + slope u^2/2.

    24 Gauss points are exact to rounding up to LARGEST_TURN, and seven up to LITTLE_TURN.
    """
    turn = np.abs(u) * (np.abs(curvature) + np.abs(slope * u) / 2)
    node, weight = _gauss(24 if np.max(turn, initial=0.0) > LITTLE_TURN else 7)
    v = np.multiply.outer(u, (1 + node) / 2)
    turned = v * (curvature[..., None] + slope[..., None] * v / 2)
    return u / 2 * np.exp(1j * angle) * (np.exp(1j * turned) @ weight)


@cache
def _gauss(n: int) -> tuple[Array, Array]:
    """The Gauss points in [-1, 1] and their weights, which take longer to find than to use."""
    node, weight = np.polynomial.legendre.leggauss(n)
    return node, weight


def reflected(knots: Array, start: Array, end: Array) -> Bends:
    """Return this curvature followed by its mirror image."""
    return (
        np.append(knots, 2 * knots[-1] - knots[-2::-1]),
        np.append(start, end[::-1]),
        np.append(end, start[::-1]),
    )


def straight(length: float) -> Piece:
    """Return a straight piece."""
    return length, 0.0


def arc(radius: float, turn: float) -> Piece:
    """Return a circular arc that turns by `turn` radians."""
    return radius * turn, 1 / radius


def closed_curve(*half: Piece) -> PiecewiseLinear:
    """Return the closed curve whose first half is made of these straights and arcs."""
    length, curvature = np.array(half).T
    knots = np.append(0.0, np.cumsum(length))
    return PiecewiseLinear.integrated(knots, curvature, curvature).mirrored()


@dataclass(frozen=True)
class Ellipse:
    """An ellipse, (across sin tau, -along cos tau), with tau(s) from elliptic integrals.

    Notes
    -----
    With u the arc length from the nearer end of the second axis, u = across E(tau | m) with
    m = 1 - (along/across)^2, and each half-turn adds pi to tau. Curvature: paper, Eq. (1).
    """

    across: float  # semi-axis along the first axis
    along: float  # semi-axis along the second
    breaks: ClassVar[tuple[float, ...]] = ()  # its curvature is analytic
    kinks: ClassVar[tuple[float, ...]] = ()
    slope_jumps: ClassVar[Array] = np.zeros(0)

    @cached_property
    def length(self) -> float:
        """Full length, 4 across E(m)."""
        from scipy.special import ellipe

        return 4 * self.across * float(ellipe(self._m))

    def angle(self, s: Array) -> Array:
        """Tangent angle at `s`."""
        half_turns, tau = self._parameter(s)
        return half_turns * np.pi + np.arctan2(self.along * np.sin(tau), self.across * np.cos(tau))

    def curvature(self, s: Array) -> Array:
        """Curvature at `s`."""
        _, tau = self._parameter(s)
        return self.across * self.along / self._speed(tau) ** 3

    def place(self, s: Array) -> ComplexArray:
        """Position at `s`."""
        half_turns, tau = self._parameter(s)
        sign = 1 - 2 * (half_turns % 2)
        return sign * (self.across * np.sin(tau) - 1j * self.along * np.cos(tau))

    @property
    def _m(self) -> float:
        return 1 - (self.along / self.across) ** 2

    def _speed(self, tau: Array) -> Array:
        """Return ds/dtau."""
        return np.hypot(self.across * np.cos(tau), self.along * np.sin(tau))

    def _parameter(self, s: Array) -> tuple[Array, Array]:
        """Return the half-turns done at the nearer end and tau from there, in [-pi/2, pi/2]."""
        half_turns = np.round(2 * s / self.length)
        u = s - half_turns * self.length / 2
        return half_turns, np.copysign(self._quarter(np.abs(u)), u)

    def _quarter(self, u: Array) -> Array:
        """Return tau in [0, pi/2] at arc length `u` from an end, by Newton's method.

        On a quarter u(tau) is convex or concave: after its first step, or from the end that step is
        clipped to, Newton's method runs up to the root from one side and cannot miss it.
        """
        from scipy.special import ellipeinc

        tau = 2 * np.pi * u / self.length
        for _ in range(100):
            residual = self.across * ellipeinc(tau, self._m) - u
            tau = np.clip(tau - residual / self._speed(tau), 0, np.pi / 2)
            # One step from here squares the error: what remains is rounding.
            if np.max(np.abs(residual), initial=0.0) <= 1e-14 * self.length:
                return tau
        raise ValueError(f"an ellipse of semi-axes {self.across}, {self.along} is too slender")


Outline: TypeAlias = PiecewiseLinear | Ellipse  # a closed planar curve, s in [0, L]
