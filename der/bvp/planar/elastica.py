"""The reduced planar rod on half a ring, by Newton's method and continuation from the circle.

Equations and symbols are those of `der.bvp.planar.folded_half`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from der.bvp.gauss import Array
from der.bvp.planar.panels import Panels

FOLDED_TURN = 6 * np.pi  # of the three-covered ring
# Steps of the homotopy; steps of 0.5 have missed branches of least energy.
FIRST_STEP, SMALLEST_STEP = 0.2, 0.01
CONVERGED, BETWEEN = 1e-12, 1e-3  # rad, Newton's last change of angle
LARGEST_CHANGE = 3.0  # rad, of a Newton step that is still believed
INEXACT = 1e-5  # relative error of a Newton step, left for the next one
SWEEPS, ITERATIONS = 100, 8


class Planar(NamedTuple):
    """An approximate solution of (*)."""

    phi: Array  # (p, NODES) rad
    k: float  # k_d(0)
    f: float

    def plus(self, amount: float, change: Planar) -> Planar:
        """Return this state, changed by a multiple of `change`."""
        return Planar(
            self.phi + amount * change.phi, self.k + amount * change.k, self.f + amount * change.f
        )


def followed(panels: Panels, rest: Array, turning: float, imperfection: float) -> Planar | None:
    """Return the solution at the end of the homotopy from circle to ring, None if it is lost.

    For 0 <= w <= 1 the natural angle is (1 - w) (that of the circle + imperfection) + w
    rest. The imperfection, of one wave on the ring, makes the loop at one grip tighter.
    """
    s, length = panels.nodes, panels.knots[-1]
    bump = imperfection * np.sin(np.pi * s / length)
    uniform = (FOLDED_TURN / 2 - turning) / length
    circle = turning * s / length + bump
    now = Planar(circle + uniform * s, uniform, 0.0)
    slope = Planar(0 * s, 0.0, 0.0)
    w, step = 0.0, FIRST_STEP
    while w < 1:
        ahead = min(w + step, 1.0)
        mixed = circle + ahead * (rest - circle)
        accuracy = CONVERGED if ahead == 1 else BETWEEN
        found = _newton(panels, mixed, turning, now.plus(ahead - w, slope), accuracy)
        if found is not None:
            slope = found.plus(-1, now)
            slope = slope.plus(1 / (ahead - w) - 1, slope)
            w, now = ahead, found
        elif step < SMALLEST_STEP:
            return None
        else:
            step /= 2
    return now


def _newton(
    panels: Panels, rest: Array, turning: float, state: Planar, accuracy: float
) -> Planar | None:
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
        state = Planar(phi + change, k + float(dk), f + float(df))
        size = np.max(np.abs(change))
        if size <= accuracy:
            return state
        if not size <= LARGEST_CHANGE:
            return None
    return None
