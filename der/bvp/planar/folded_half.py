r"""The folded half of a ring, between its grips, by the reduced planar rod.

The folded ring lies flat and turns by 6 pi instead of 2 pi (paper, Appendix B). In the plane
(E2, E3) with d1 = E1 and tangent d3 = (cos phi, sin phi), the balance of moments M' + r' x F = 0,
(A.4), leaves M1' = F2 sin phi - F3 cos phi, F constant, M1 = EI1 k_d, k_d = phi' - k1u. The grips
slide freely along E3, so F3 = 0: reflecting the ring about E3 and reversing its sense turns
(F2, F3) into (F2, -F3). With lengths in units of a and f = F2 a^2/EI1 this is

    phi' = k1u + k_d,     k_d' = f sin phi,     so  k_d = k_d(0) + f (r3 - r3(0)),     (*)

which does not know h/t. On the half ring from grip to grip, both on the axis r2 = 0,

    phi(0) = 0,     phi(L/2) = 3 pi,     integral of cos phi ds over [0, L/2] = 0,

are three conditions for phi(0), k_d(0) and f. A ring that is symmetric about E2 as well has f = 0
and k_d = 4 pi/L, (B.1): its second quarter is the first, turned, and the last condition holds by
itself.

Everything is a sum over panels of Gauss points: on each the tangent is a polynomial to rounding,
which is checked, and its integrals are exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from der.bvp.gauss import Array
from der.bvp.planar.elastica import FOLDED_TURN, followed
from der.bvp.planar.panels import NODES, TO_SERIES, Panels
from der.geometry.outline import ComplexArray, PiecewiseLinear
from der.geometry.ring import Ring

TURN = 1.8  # rad, of a panel to begin with
RESOLVED = 1e-12  # last Legendre coefficients of exp(i phi), of modulus 1, on a panel
DEEPEST = 60  # halvings of a panel
IMPERFECTION = 1.0  # rad, of the homotopy from the circle to the ring


class NotFolded(RuntimeError):
    """No planar three-covered shape was found."""


@dataclass(frozen=True, eq=False)
class Half:
    """The folded half ring from the first grip, at the origin, to the second."""

    ring: Ring
    panels: Panels
    phi: Array  # (p, NODES) tangent angle at the nodes
    rest: Array  # (p, NODES) that of the ring cut open and freed of stress
    bending_start: float  # k_d at the first grip
    force: float  # f

    @cached_property
    def tangent(self) -> ComplexArray:
        """Legendre coefficients of exp(i phi), shape (NODES, p)."""
        return TO_SERIES @ np.exp(1j * self.phi).T

    @cached_property
    def knot_place(self) -> ComplexArray:
        """Places r2 + i r3 of the panels' ends, shape (p+1,)."""
        return np.append(0.0, np.cumsum(self.panels.length * self.tangent[0]))

    @cached_property
    def knot_angle(self) -> Array:
        """Tangent angle at the panels' ends, shape (p+1,)."""
        knots = self.panels.knots
        bent = self.panels.length * (TO_SERIES[0] @ self.bending_at_nodes.T)
        rest = self.ring.natural_angle(knots)
        return rest + np.append(0.0, np.cumsum(bent))

    @cached_property
    def bending_at_nodes(self) -> Array:
        """k_d at the nodes, (*)."""
        height = self.panels.running_integral(np.sin(self.phi))
        return self.bending_start + self.force * height

    def angle(self, s: Array) -> Array:
        """Return phi at arc lengths in [0, L/2]."""
        i, x, _ = self._locate(s)
        change = TO_SERIES @ (self.phi - self.rest).T
        bent: Any = legendre.legval(x, change[:, i], tensor=False)
        return self.ring.natural_angle(s) + bent

    def place(self, s: Array) -> ComplexArray:
        """Return r2 + i r3 at arc lengths in [0, L/2]."""
        i, x, length = self._locate(s)
        within = legendre.legint(self.tangent, lbnd=-1)
        change: Any = legendre.legval(x, within[:, i], tensor=False)
        return self.knot_place[i] + length / 2 * change

    def bending(self, s: Array) -> Array:
        """Return k_d at arc lengths in [0, L/2], (*)."""
        return self.bending_start + self.force * self.place(s).imag

    @property
    def unresolved(self) -> NDArray[np.bool_]:
        """Which panels are too long for polynomials, shape (p,).

        An angle is no better than the rounding of its arc length times the curvature.
        """
        sharpest = np.max(np.abs(self.ring.curvature(self.panels.nodes)), axis=1)
        noise = 2 * NODES * np.finfo(float).eps * self.ring.length * sharpest
        rest: NDArray[np.bool_] = np.max(np.abs(self.tangent[-2:]), axis=0) > RESOLVED + noise
        return rest

    def _locate(self, s: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return the panel of every arc length, the place in it from -1 to 1, and its length."""
        knots = self.panels.knots
        i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
        length = np.diff(knots)[i]
        return i, 2 * (s - knots[i]) / length - 1, length


def folded_half(ring: Ring) -> Half:
    """Return the folded half of a ring.

    Raises
    ------
    NotFolded
        If no solution is found.
    """
    return uniform_bending(ring) if ring.symmetry == "D2" else bent_by_force(ring)


def uniform_bending(ring: Ring) -> Half:
    """Return the folded half of a ring of D2 symmetry: f = 0 and k_d = 4 pi/L, Eq. (B.1).

    With a natural curvature that does not close the ring, k_d makes up for its turning as well.
    """
    bending = (FOLDED_TURN - float(ring.natural_angle(ring.length))) / ring.length

    def solve(panels: Panels) -> Half:
        rest = ring.natural_angle(panels.nodes)
        return Half(ring, panels, rest + bending * panels.nodes, rest, bending, 0.0)

    return _resolved(ring, solve)


def bent_by_force(ring: Ring) -> Half:
    """Return the folded half of any ring, (*), of the least bending energy that was found.

    Raises
    ------
    NotFolded
        If no solution is found.

    Notes
    -----
    Solutions are followed from the circle, phi = 6 pi s/L with f = 0, by a homotopy of its natural
    angle to the ring's. Triangles with small fillets have several solutions: the threefold symmetry
    of the equilateral one makes its branch bifurcate, and neighbouring triangles keep the parts. So
    the homotopy is followed twice, with an imperfection of either sign that vanishes at its end,
    and the solution with the smaller integral of k_d^2 is kept. Other initial guesses found no
    smaller one on 188 triangles over the range of the paper's figure 9. Two triangles that were
    twisted, of 60 and 90 degrees, end in these shapes. Only mirror-symmetric shapes are compared.
    """
    turning = float(ring.natural_angle(ring.length / 2))

    def solve(panels: Panels) -> Half:
        rest = ring.natural_angle(panels.nodes)
        ends = [followed(panels, rest, turning, size) for size in (IMPERFECTION, -IMPERFECTION)]
        found = [Half(ring, panels, end.phi, rest, end.k, end.f) for end in ends if end is not None]
        if not found:
            raise NotFolded(f"{ring!r}: no planar three-covered shape was found")
        return min(found, key=lambda half: float(panels.integral(half.bending_at_nodes**2)))

    return _resolved(ring, solve)


def _resolved(ring: Ring, solve: Callable[[Panels], Half]) -> Half:
    """Return the solution on panels that are halved until it is a polynomial on each."""
    knots = _first_knots(ring)
    for _ in range(DEEPEST):
        found = solve(Panels.between(knots))
        long = found.unresolved
        if not np.any(long):
            return found
        knots = np.sort(np.append(knots, (knots[1:] + knots[:-1])[long] / 2))
    raise NotFolded(f"{ring!r}: the folded shape is not resolved by {len(knots)} panels")


def _first_knots(ring: Ring) -> Array:
    """Return the ends of panels that begin and end at jumps and turn by about TURN at most."""
    half = ring.length / 2
    knots = np.array([0.0, half])
    if isinstance(ring.outline, PiecewiseLinear):
        inner = ring.outline.knots
        knots = np.insert(knots, 1, inner[(inner > 0) & (inner < half * (1 - 1e-14))])
    uniform = FOLDED_TURN / 2 - float(ring.natural_angle(half))
    turn = np.abs(np.diff(ring.natural_angle(knots) + uniform * knots / half))
    parts = np.maximum(np.ceil(turn / TURN), 1).astype(int)
    starts = [
        np.linspace(first, last, n, endpoint=False)
        for first, last, n in zip(knots[:-1], knots[1:], parts, strict=True)
    ]
    return np.append(np.concatenate(starts), half)
