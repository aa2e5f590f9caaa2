r"""The folded three-covered shape of a ring, by the reduced planar rod.

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
from operator import index
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from der.geometry.outline import PiecewiseLinear
from der.geometry.ring import Ring

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FOLDED_TURN = 6 * np.pi  # of the three-covered ring
NODES = 16
TURN = 1.8  # rad, of a panel to begin with
RESOLVED = 1e-12  # last Legendre coefficients of exp(i phi), of modulus 1, on a panel
DEEPEST = 60  # halvings of a panel
IMPERFECTION = 1.0  # rad, on the way from the circle to the ring
# Shares of the way done in one step; steps of 0.5 were seen to miss branches of least energy.
FIRST_STEP, SMALLEST_STEP = 0.2, 0.01
CONVERGED, ON_THE_WAY = 1e-12, 1e-3  # rad, Newton's last change of angle
LARGEST_CHANGE = 3.0  # rad, of a Newton step that is still believed
INEXACT = 1e-5  # relative, of a Newton step: what is left of the error, for the next one
SWEEPS, ITERATIONS = 100, 8


class NotFolded(RuntimeError):
    """No planar three-covered shape was found."""


@dataclass(frozen=True, eq=False)
class Folded:
    """The centreline of a folded ring, in the plane (E2, E3), at equal arc lengths.

    Parameters
    ----------
    s : (n,) array
        Arc lengths i L/n from the first grip, units of a; the closing point is not repeated.
    points : (n, 2) array
        Places (r2, r3), units of a. The twisting axis is r2 = 0, with r3 = 0 midway between grips.
    angle : (n,) array
        Tangent angle phi, rad, 0 at s = 0.
    curvature : (n,) array
        phi', units of 1/a; right-continuous at jumps of the natural curvature.
    force : float
        Internal force F2, units of EI1/a^2; 0 for rings of D2 symmetry.
    turning : float
        Total turning, rad: 6 pi.
    closure_error : float
        Distance of the second grip from the twisting axis, or its error of angle in rad, whichever
        is the larger, relative to L/2 and 3 pi.
    """

    s: Array
    points: Array
    angle: Array
    curvature: Array
    force: float
    turning: float
    closure_error: float


def folded(ring: Ring, n: int = 960) -> Folded:
    """Return the folded three-covered shape of a ring.

    Parameters
    ----------
    ring : der.Ring
        Any; the shape does not depend on the cross-section.
    n : int
        Number of points, even, at least 12.

    Returns
    -------
    Folded
        Exact to rounding, about 1e-14 L, or its multiple by the largest curvature: 1e-11 L for
        fillets of 1e-6 a.

    Raises
    ------
    ValueError
        If `ring` is no ring or `n` no such number.
    NotFolded
        If the equations of the half ring have no solution that Newton's method finds.
    """
    if not isinstance(ring, Ring):
        raise ValueError(f"ring must be a der.Ring, got {ring!r}")
    n = _checked_count(n)
    half = uniform_bending(ring) if ring.symmetry == "D2" else bent_by_force(ring)
    s = np.linspace(0.0, ring.length, n, endpoint=False)
    first = s[: n // 2 + 1]
    turned, z = half.angle(first), half.place(first)
    z = z - 0.5j * half.knot_place[-1].imag
    angle = np.append(turned, FOLDED_TURN - turned[-2:0:-1])
    z = np.append(z, -np.conj(z[-2:0:-1]))
    off_axis = abs(half.knot_place[-1].real) / (ring.length / 2)
    off_angle = abs(half.knot_angle[-1] / (FOLDED_TURN / 2) - 1)
    return Folded(
        s=s,
        points=np.column_stack([z.real, z.imag]),
        angle=angle,
        curvature=ring.curvature(s) + half.bending(np.minimum(s, ring.length - s)),
        force=half.force,
        turning=2 * float(half.knot_angle[-1]),
        closure_error=max(off_axis, off_angle),
    )


def _checked_count(n: object) -> int:
    try:
        count = index(n)  # type: ignore[arg-type]
    except TypeError:
        count = 0
    if isinstance(n, bool) or count < 12 or count % 2:
        raise ValueError(f"n must be an even whole number >= 12, got {n!r}")
    return count


# --- Panels ----------------------------------------------------------------------------------


class Panels(NamedTuple):
    """Panels of Gauss points on the half ring."""

    knots: Array  # (p+1,) arc lengths of their ends, increasing from 0 to L/2
    length: Array  # (p,)
    nodes: Array  # (p, NODES) arc lengths of the Gauss points

    @classmethod
    def between(cls, knots: Array) -> Panels:
        """Return the panels between these arc lengths."""
        length = np.diff(knots)
        return cls(knots, length, knots[:-1, None] + np.multiply.outer(length, _NODE))

    def integral(self, values: Array) -> Array:
        """Return the integral over the half ring; values are (..., p, NODES)."""
        return (values @ _ONCE[-1]) @ self.length

    def running_integral(self, values: Array) -> Array:
        """Return the integral from 0 up to every node; both are (..., p, NODES)."""
        within = self.length[:, None] * (values @ _ONCE.T)
        whole = within[..., -1]
        return within[..., :-1] + (np.cumsum(whole, axis=-1) - whole)[..., None]

    def double_integral(self, values: Array) -> Array:
        """Return the running integral of the running integral."""
        whole = self.length * (values @ _ONCE[-1])
        entry = np.cumsum(whole, axis=-1) - whole  # of the inner one, at a panel's first end
        within = self.length[:, None] * (
            self.length[:, None] * (values @ _TWICE.T) + entry[..., None] * _NODE_AND_END
        )
        whole = within[..., -1]
        return within[..., :-1] + (np.cumsum(whole, axis=-1) - whole)[..., None]


def _rules() -> tuple[Array, Array, Array, Array]:
    """Return Gauss nodes in [0, 1], two matrices of integration there, and one to series.

    The first two, (NODES + 1, NODES), take values at the nodes to the integral, and to the integral
    of the integral, from 0 up to every node and to 1; the last takes them to Legendre coefficients.
    """
    node, weight = legendre.leggauss(NODES)
    degree = np.arange(NODES)
    to_series = (degree[:, None] + 0.5) * legendre.legvander(node, NODES - 1).T * weight
    ends = np.append(node, 1.0)
    once = legendre.legint(to_series, lbnd=-1, scl=0.5)
    twice = legendre.legint(once, lbnd=-1, scl=0.5)
    return (
        (1 + node) / 2,
        legendre.legvander(ends, NODES) @ once,
        legendre.legvander(ends, NODES + 1) @ twice,
        to_series,
    )


_NODE, _ONCE, _TWICE, _TO_SERIES = _rules()
_NODE_AND_END = np.append(_NODE, 1.0)


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
        return _TO_SERIES @ np.exp(1j * self.phi).T

    @cached_property
    def knot_place(self) -> ComplexArray:
        """Places r2 + i r3 of the panels' ends, shape (p+1,)."""
        return np.append(0.0, np.cumsum(self.panels.length * self.tangent[0]))

    @cached_property
    def knot_angle(self) -> Array:
        """Tangent angle at the panels' ends, shape (p+1,)."""
        knots = self.panels.knots
        bent = self.panels.length * (_TO_SERIES[0] @ self.bending_at_nodes.T)
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
        change = _TO_SERIES @ (self.phi - self.rest).T
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


# --- Equilibria ------------------------------------------------------------------------------


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
    Solutions are followed from the circle, phi = 6 pi s/L with f = 0, by morphing its natural angle
    into the ring's. Triangles with small fillets have several: the threefold symmetry of the
    equilateral one makes its branch bifurcate, and neighbouring triangles keep the parts. So the
    way is gone twice, with either sign of an imperfection that vanishes at its end, and the
    solution with the smaller integral of k_d^2 is kept. Other starts found no smaller one on 188
    triangles over the range of the paper's figure 9; two triangles that were twisted, of 60 and 90
    degrees, end in these shapes. It is the least among mirror-symmetric shapes only.
    """
    turning = float(ring.natural_angle(ring.length / 2))

    def solve(panels: Panels) -> Half:
        rest = ring.natural_angle(panels.nodes)
        ways = [_followed(panels, rest, turning, size) for size in (IMPERFECTION, -IMPERFECTION)]
        found = [Half(ring, panels, way.phi, rest, way.k, way.f) for way in ways if way is not None]
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


class _State(NamedTuple):
    """An approximate solution of (*)."""

    phi: Array  # (p, NODES) rad
    k: float  # k_d(0)
    f: float

    def plus(self, amount: float, change: _State) -> _State:
        """Return this state, changed by a multiple of `change`."""
        return _State(
            self.phi + amount * change.phi, self.k + amount * change.k, self.f + amount * change.f
        )


def _followed(panels: Panels, rest: Array, turning: float, imperfection: float) -> _State | None:
    """Return the solution at the end of the way from the circle to the ring, None if it is lost.

    On the way, 0 <= w <= 1, the natural angle is (1 - w) (that of the circle + imperfection) + w
    rest. The imperfection, of one wave on the ring, makes the loop at one grip tighter.
    """
    s, length = panels.nodes, panels.knots[-1]
    bump = imperfection * np.sin(np.pi * s / length)
    uniform = (FOLDED_TURN / 2 - turning) / length
    circle = turning * s / length + bump
    now = _State(circle + uniform * s, uniform, 0.0)
    slope = _State(0 * s, 0.0, 0.0)
    way, step = 0.0, FIRST_STEP
    while way < 1:
        ahead = min(way + step, 1.0)
        mixed = circle + ahead * (rest - circle)
        accuracy = CONVERGED if ahead == 1 else ON_THE_WAY
        found = _newton(panels, mixed, turning, now.plus(ahead - way, slope), accuracy)
        if found is not None:
            slope = found.plus(-1, now)
            slope = slope.plus(1 / (ahead - way) - 1, slope)
            way, now = ahead, found
        elif step < SMALLEST_STEP:
            return None
        else:
            step /= 2
    return now


def _newton(
    panels: Panels, rest: Array, turning: float, state: _State, accuracy: float
) -> _State | None:
    """Return the solution of (*) with its three conditions near a state, None if it is not reached.

    In integral form, I being the double integral from 0, (*) is phi = rest + k s + f I sin phi. A
    Newton step satisfies its linearisation, d = residual + dk s + df I sin phi + f I(d cos phi),
    and the linearised conditions at s = L/2. The three columns of d solve Volterra equations of
    the second kind, whose Neumann series always converges.
    """
    s = panels.nodes
    lever = panels.knots[-1] - s  # the double integral up to L/2 is the integral with this lever
    for _ in range(ITERATIONS):
        phi, k, f = state
        sin, cos = np.sin(phi), np.cos(phi)
        pushed = panels.double_integral(sin)
        columns = np.stack([rest + k * s + f * pushed - phi, s, pushed])
        d = columns
        for _ in range(SWEEPS):
            last, d = d, columns + f * panels.double_integral(cos * d)
            if np.max(np.abs(d - last)) <= INEXACT * np.max(np.abs(d)):
                break
        end = panels.integral(lever * sin)
        turned = f * panels.integral(lever * cos * d)
        turned += [
            turning + k * panels.knots[-1] + f * end - FOLDED_TURN / 2,
            panels.knots[-1],
            end,
        ]
        offset = -panels.integral(sin * d)
        offset[0] += panels.integral(cos)
        dk, df = np.linalg.solve([turned[1:], offset[1:]], [-turned[0], -offset[0]])
        change = d[0] + dk * d[1] + df * d[2]
        state = _State(phi + change, k + float(dk), f + float(df))
        size = np.max(np.abs(change))
        if size <= accuracy:
            return state
        if not size <= LARGEST_CHANGE:
            return None
    return None
