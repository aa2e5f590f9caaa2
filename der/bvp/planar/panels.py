"""Panels of Gauss points on half a ring: integrals of functions that are polynomials on each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from der.bvp.gauss import Array

NODES = 16


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
        return _running(self.length[:, None] * (values @ _ONCE.T))

    def double_integral(self, values: Array) -> Array:
        """Return the running integral of the running integral."""
        total = self.length * (values @ _ONCE[-1])
        entry = np.cumsum(total, axis=-1) - total  # of the inner one, at a panel's first end
        within = self.length[:, None] * (
            self.length[:, None] * (values @ _TWICE.T) + entry[..., None] * _NODE_AND_END
        )
        return _running(within)


def _running(within: Array) -> Array:
    """Integrals up to every node, of those from the start of each panel up to nodes and end."""
    total = within[..., -1]
    return within[..., :-1] + (np.cumsum(total, axis=-1) - total)[..., None]


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


_NODE, _ONCE, _TWICE, TO_SERIES = _rules()
_NODE_AND_END = np.append(_NODE, 1.0)
