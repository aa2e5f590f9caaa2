"""Systems from textbooks, each with a potential V(x, p): what rests where dV/dx = 0.

They offer the five operations of `der.problem.System` and the index of `Stability` by dense linear
algebra, and are all that a path follower may know of a system.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from der.errors import Reason
from der.problem import PARAMETER, PLANE, Array, Increment, Indices, Softest, Solution

_UNCERTAIN = 1e-12  # of the largest eigenvalue: smaller ones have no certain sign
_ROUNDING = 1e-15  # of the terms of a residual


class Configuration(NamedTuple):
    """One configuration."""

    x: Array  # (n,)
    p: float


class Terms(NamedTuple):
    """Derivatives of the potential at a configuration."""

    grad: Array  # (n,) dV/dx
    hess: Array  # (n, n)
    rate: Array  # (n,) d2V/dx dp
    work: float  # dV/dp
    work_rate: float  # d2V/dp2


Observable = Callable[[Array, float], tuple[float, Array]]  # value, and its derivatives (n + 1,)


@dataclass(frozen=True)
class Potential:
    """A system with a potential; the conjugate of its parameter is "work", dV/dp.

    Parameters
    ----------
    terms : derivatives of the potential.
    weight : (n,) of the inner product.
    symmetry : which unknowns belong to a class of modes; each counts once.
    observed : further observables.
    inside : whether the potential is defined at a configuration.
    """

    terms: Callable[[Array, float], Terms]
    weight: Array = field(default_factory=lambda: np.ones(1))
    symmetry: Mapping[str, list[int]] | None = None
    observed: Mapping[str, Observable] = field(default_factory=dict)
    inside: Callable[[Array, float], bool] = lambda x, p: True
    soft: float = 0.1
    parameter_name: str = "p"
    conjugate: str = "work"

    @property
    def classes(self) -> Mapping[str, int]:
        """How often the modes of each class count."""
        return dict.fromkeys(self.symmetry or ["all"], 1)

    def correct(
        self,
        guess: Configuration,
        *,
        along: Increment | None = None,
        hold: str = PARAMETER,
        value: float | None = None,
        tolerance: float = 1e-10,
        iterations: int = 12,
    ) -> Solution[Configuration]:
        """Newton's method on the residual and the condition that closes it."""
        n = len(guess.x)
        along = np.eye(n + 1)[-1] if along is None else along
        unknowns = np.append(guess.x, guess.p)
        if hold == PARAMETER and value is not None:
            unknowns[-1] = value
        first, iteration = np.inf, 0
        while True:
            x, p = unknowns[:-1], float(unknowns[-1])
            if not self.inside(x, p):
                return self._ended(unknowns, Reason.OUT_OF_RANGE, iteration, "x = " + str(x))
            terms = self.terms(x, p)
            gap, row = self._closing(unknowns, hold, value, along)
            matrix = np.vstack([np.column_stack([terms.hess, terms.rate]), row])
            residual = max(float(np.abs(terms.grad).max()), abs(gap))
            floor = _ROUNDING * float((np.abs(matrix[:-1]) @ np.abs(unknowns)).max())
            first = residual if iteration == 0 else first
            if residual <= max(tolerance, floor):
                break
            if not residual < 1e3 * max(first, 1.0):
                return self._ended(unknowns, Reason.DIVERGED, iteration)
            if iteration >= iterations:
                return self._ended(unknowns, Reason.TOO_MANY_ITERATIONS, iteration)
            try:
                step = np.linalg.solve(matrix, -np.append(terms.grad, gap))
            except np.linalg.LinAlgError:
                return self._ended(unknowns, Reason.SINGULAR, iteration)
            unknowns, iteration = unknowns + step, iteration + 1
        return self._at_rest(unknowns, terms, along, iteration, residual)

    def _closing(
        self, unknowns: Array, hold: str, value: float | None, along: Increment
    ) -> tuple[float, Array]:
        """What is left of the condition, and its derivatives (n + 1,)."""
        if hold == PARAMETER:
            return 0.0, np.eye(len(along))[-1]
        if hold == PLANE:
            return 0.0, self._weighted(along)
        now, slope = self._observable(hold, unknowns)
        return now - float(value or 0.0), slope

    def _observable(self, name: str, unknowns: Array) -> tuple[float, Array]:
        x, p = unknowns[:-1], float(unknowns[-1])
        if name != self.conjugate:
            return self.observed[name](x, p)
        terms = self.terms(x, p)
        return terms.work, np.append(terms.rate, terms.work_rate)

    def _at_rest(
        self, unknowns: Array, terms: Terms, along: Increment, taken: int, residual: float
    ) -> Solution[Configuration]:
        matrix = np.column_stack([terms.hess, terms.rate])
        matrix = np.vstack([matrix, self._weighted(along)])
        try:
            tangent = np.linalg.solve(matrix, np.eye(len(unknowns))[-1])
        except np.linalg.LinAlgError:
            return self._ended(unknowns, Reason.SINGULAR, taken)
        tangent /= np.sqrt(self.inner(tangent, tangent))
        found = self._ended(unknowns, Reason.CONVERGED, taken)
        observables = {}
        for name in (self.conjugate, *self.observed):
            value, slope = self._observable(name, unknowns)
            observables[name] = (value, float(slope @ tangent))
        return replace(
            found,
            tangent=tangent,
            observables=observables,
            index=int(np.sum(np.linalg.eigvalsh(terms.hess) < 0.0)),
            residual=residual,
        )

    @staticmethod
    def _ended(
        unknowns: Array, reason: Reason, taken: int, detail: str = ""
    ) -> Solution[Configuration]:
        state = Configuration(unknowns[:-1], float(unknowns[-1]))
        nothing = np.zeros(len(unknowns))
        return Solution(state, state.p, nothing, {}, None, reason, detail, taken, np.nan)

    def _weighted(self, along: Increment) -> Array:
        return np.append(self.weight, 1.0) * along

    def retract(self, state: Configuration, increment: Increment) -> Configuration:
        """Return the configuration to which an increment leads."""
        return Configuration(state.x + increment[:-1], state.p + float(increment[-1]))

    def difference(self, a: Configuration, b: Configuration) -> Increment:
        """Return the increment that leads from one configuration to another."""
        return np.append(b.x - a.x, b.p - a.p)

    def transport(self, along: Increment, rates: Increment) -> Increment:
        """Return the rates as they are: the space is flat."""
        return rates.copy()

    def inner(self, a: Increment, b: Increment) -> float:
        """Return the weighted inner product."""
        return float(self._weighted(a) @ b)

    def eigenvalues(self, state: Configuration, symmetry: str | None = None) -> Array:
        """Eigenvalues of the Hessian per weight, of one class or of all, ascending."""
        which = (self.symmetry or {}).get(symmetry or "", list(range(len(state.x))))
        scale = 1.0 / np.sqrt(self.weight[which])
        hess = self.terms(state.x, state.p).hess[np.ix_(which, which)]
        return np.linalg.eigvalsh(scale[:, None] * hess * scale)

    def indices(self, state: Configuration, symmetry: str | None = None) -> tuple[Indices, Softest]:
        """Return index and lowest stiffness of every class, or of one."""
        counts: list[int | None] = []
        softest = []
        for name in self.classes if symmetry is None else [symmetry]:
            values = self.eigenvalues(state, name)
            softest.append(float(values[np.argmin(np.abs(values))]))
            certain = abs(softest[-1]) > _UNCERTAIN * max(1.0, float(np.abs(values).max()))
            counts.append(self.count(state, name) if certain else None)
        return tuple(counts), tuple((one,) for one in softest)

    def count(self, state: Configuration, symmetry: str) -> int:
        """Return the negative eigenvalues of one class."""
        return int(np.sum(self.eigenvalues(state, symmetry) < 0.0))


# --- One unknown ------------------------------------------------------------------------------


def scalar(
    residual: Callable[[float, float], float],
    slope: Callable[[float, float], float],
    rate: Callable[[float, float], float],
    work: Callable[[float, float], tuple[float, float]] = lambda x, p: (0.0, 0.0),
    **options: object,
) -> Potential:
    """Return the system of one unknown with this residual and its derivatives by x and p.

    Parameters
    ----------
    work : dV/dp and d2V/dp2, where folds have to be told from branch points.
    """

    def terms(x: Array, p: float) -> Terms:
        one = float(x[0])
        return Terms(
            np.array([residual(one, p)]),
            np.array([[slope(one, p)]]),
            np.array([rate(one, p)]),
            *work(one, p),
        )

    unknown = {"x": lambda x, p: (float(x[0]), np.array([1.0, 0.0]))}
    return Potential(terms, observed=unknown, **options)


def cusp(u: float) -> Potential:
    """Return V = x^4/4 - u x^2/2 - p x: folds at p = -+2 (u/3)^(3/2), x = +-sqrt(u/3)."""
    return scalar(
        lambda x, p: x**3 - u * x - p,
        lambda x, p: 3.0 * x * x - u,
        lambda x, p: -1.0,
        lambda x, p: (-x, 0.0),
    )


def pitchfork() -> Potential:
    """Return V = x^4/4 - p x^2/2: the path x = 0 loses its stability at p = 0 to x^2 = p."""
    return scalar(
        lambda x, p: x**3 - p * x,
        lambda x, p: 3.0 * x * x - p,
        lambda x, p: -x,
        lambda x, p: (-0.5 * x * x, 0.0),
    )


def transcritical() -> Potential:
    """Return V = x^3/3 - p x^2/2: the paths x = 0 and x = p exchange their stability at p = 0."""
    return scalar(
        lambda x, p: x * x - p * x,
        lambda x, p: 2.0 * x - p,
        lambda x, p: -x,
        lambda x, p: (-0.5 * x * x, 0.0),
    )


def isola(r: float) -> Potential:
    """Return V = x^3/3 + (p^2 - r^2) x: its equilibria are the circle x^2 + p^2 = r^2."""
    return scalar(
        lambda x, p: x * x + p * p - r * r,
        lambda x, p: 2.0 * x,
        lambda x, p: 2.0 * p,
        lambda x, p: (2.0 * p * x, 2.0 * x),
    )


def hyperbola(e: float) -> Potential:
    """Return V = x^3/3 - (p^2 - e^2) x: two paths, x^2 = p^2 - e^2, that come within 2 e."""
    return scalar(
        lambda x, p: x * x - p * p + e * e,
        lambda x, p: 2.0 * x,
        lambda x, p: -2.0 * p,
        lambda x, p: (-2.0 * p * x, -2.0 * x),
    )


def graph(
    f: Callable[[float], float], rate: Callable[[float], float], **options: object
) -> Potential:
    """Return V = x^2/2 - f(p) x, whose one path is the graph x = f(p); ``rate``: df/dp."""
    return scalar(lambda x, p: x - f(p), lambda x, p: 1.0, lambda x, p: -rate(p), **options)


# --- Several unknowns -------------------------------------------------------------------------


def branch_beside_fold(b: float, *, apart: bool) -> Potential:
    """Return V = y^3/3 + (p - 1) y + (y - b) z^2/2 + z^4/4.

    On its symmetric path z = 0, p = 1 - y^2, the mode in y makes a fold at y = 0, p = 1, and the
    one in z a branch point at y = b, p = 1 - b^2.

    Parameters
    ----------
    apart : whether the two modes are of different classes.
    """

    def terms(x: Array, p: float) -> Terms:
        y, z = map(float, x)
        return Terms(
            np.array([y * y + p - 1.0 + 0.5 * z * z, (y - b) * z + z**3]),
            np.array([[2.0 * y, z], [z, y - b + 3.0 * z * z]]),
            np.array([1.0, 0.0]),
            y,
            0.0,
        )

    symmetry = {"symmetric": [0], "asymmetric": [1]} if apart else None
    return Potential(terms, np.ones(2), symmetry)


def bratu(n: int) -> Potential:
    """Return the problem of Bratu, u'' + p exp(u) = 0, u(0) = u(1) = 0, on n points between.

    V = sum (u_(i+1) - u_i)^2/(2 h) - p h sum exp(u_i).
    """
    h = 1.0 / (n + 1)
    stiffness = (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) / h

    def terms(u: Array, p: float) -> Terms:
        source = h * np.exp(u)
        hess = stiffness - p * np.diag(source)
        return Terms(stiffness @ u - p * source, hess, -source, -float(source.sum()), 0.0)

    return Potential(terms, np.full(n, h))
