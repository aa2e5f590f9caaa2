"""Error bars: the path on N, N/2 and N/4 edges, extrapolated state by state (Richardson, Romberg).

Frames sit on the same material points at every resolution, so every second (fourth) frame of a
state on N edges is nearly a state on N/2 (N/4), and Newton's method makes it one in two or three
iterations, folds or not, if its corrections stay in the plane normal to the path of N edges:

    N      ----o---->  tangent        the three states of a plane are *matched*: gamma, M, U and
    N/2    ....|.....                 their rates along the tangent have errors in even powers
    N/4    ....|.....                 of h, h^2 first

What is sought (a gamma that was asked for, a fold, a limit) is a root, along the path of N edges,
of the extrapolated curve. An error is the last correction that the extrapolation made.

Sources: Richardson (1911), Phil. Trans. A 210; Romberg (1955), K. Norske Vid. Selsk. Forh. 28.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from der.equilibrium import Control, Direction, Equilibrium, dot, equilibrium, moved
from der.frames import Array, rotation_vector
from der.rod import State
from der.sector import Sector
from der.special import Visit

LEVELS = 3
GAMMA, MOMENT, ENERGY = 0, 1, 2  # columns of a table of values
RATE = 3  # added to these: columns of the rates along the path

_PROBE = 1e-3  # of s: the first step towards a fold or limit, whose second derivative is not known
_SMALL = 1e-6  # of s: a step that is as good as its linear prediction, to the square of this
_FARTHEST = 0.3  # of s: about two steps of the path; what is sought lies h^2 away
_MOST = 12  # steps of the secant method
_EXACT = 1e-9  # of the largest values: a state that is the same on every mesh, as the folded one
_REST = 3.0  # see `_Corrections.bound`


@dataclass(frozen=True)
class ErrorBars:
    """The states of a path, extrapolated, in path order.

    Where a level has no state, errors are None and the values are those of N edges.
    """

    order: tuple[int, ...]  # (n,) positions among the visits; see `error_bars` for what is missing
    gamma: Array  # (n,) rad
    moment: Array  # (n,) GJ/a, of one arm
    energy: Array  # (n,) GJ/a, of the full ring
    gamma_error: list[float | None]  # (n,) rad; 0 where gamma was asked for
    moment_error: list[float | None]  # (n,) GJ/a
    energy_error: list[float | None]  # (n,) GJ/a
    raw: dict[str, list[float]]  # gamma, moment, energy (n,) on N edges
    slope: float | None  # dM/dgamma at the first arrival at pi, GJ/a; None: no such state
    slope_error: float | None
    how: str

    @property
    def error(self) -> dict[str, object]:
        """The record's entry."""
        return {
            "gamma": self.gamma_error,
            "moment": self.moment_error,
            "energy": self.energy_error,
            "slope_at_pi": self.slope_error,
            "how": self.how,
        }


def error_bars(
    pieces: Sequence[Sector],
    visits: Sequence[Visit],
    asked: Collection[float],
    *,
    tolerance: float = 1e-10,
) -> ErrorBars:
    """Extrapolated values and errors of a path that was followed on the finest of three meshes.

    Parameters
    ----------
    pieces : the sector at the three levels, finest first (`scene.meshes`).
    visits : the path on the finest, from `path.follow`.
    asked : values of gamma that states were solved for [rad]: there gamma stays what it is and
        moment and energy become those at this gamma on the extrapolated curve.
    tolerance : of the residual of an equilibrium, GJ/a.

    Notes
    -----
    Folds and limits move to those of the extrapolated curve, a little forward or backward on the
    path. States that nobody asked for and that they overtake are left out of ``order``: their index
    would be that of the other side. Branch and contact points are placed on N edges only; they have
    values on the extrapolated curve, but no errors.
    """
    family = _Family(tuple(pieces), tolerance)
    places = [_placed(family, visit, asked) for visit in visits]
    order = _order(_arc_lengths(pieces[0], visits), places)
    scales = _scales(family, visits)
    kept = [places[k] for k in order]
    corrections = _Corrections.of(kept, scales)
    bounds = [corrections.bound(k) for k in range(len(kept))]
    raw = np.array([family.values(0, visits[k].at) for k in order]).reshape(-1, RATE)
    values = np.array(
        [r if p is None else p.values for p, r in zip(kept, raw, strict=True)]
    ).reshape(-1, RATE)
    slope, slope_error = _slope_at_pi(kept, [visits[k] for k in order], corrections)
    errors: list[list[float | None]] = [
        [None if b is None else float(b[c]) for b in bounds] for c in range(RATE)
    ]
    return ErrorBars(
        tuple(order),
        values[:, GAMMA],
        values[:, MOMENT],
        values[:, ENERGY],
        errors[GAMMA],
        errors[MOMENT],
        errors[ENERGY],
        dict(zip(("gamma", "moment", "energy"), raw.T.tolist(), strict=True)),
        slope,
        slope_error,
        _how(pieces, bounds),
    )


class _Matched(NamedTuple):
    """Three matched states."""

    table: Array  # (LEVELS, 6) gamma, M, U and their rates per s, finest level first
    residual: float  # the largest of the three


@dataclass(frozen=True)
class _Family:
    """The curves of equilibria on three meshes, matched along the finest."""

    pieces: tuple[Sector, ...]
    tolerance: float

    def values(self, level: int, at: Equilibrium) -> tuple[float, float, float]:
        """Return gamma [rad], M of one arm [GJ/a] and U of the full ring [GJ/a]."""
        piece = self.pieces[level]
        return at.state.load, piece.moment(at.moment), piece.copies * at.energy

    def matched(self, fine: Equilibrium) -> _Matched | None:
        """The states matched to one on the finest mesh; None where a level has none."""
        q, load = fine.tangent.q, fine.tangent.load
        speed = dot(self.pieces[0].body, _normal(self.pieces[0], q, load), fine.tangent)
        lines, state, residual = [self._line(0, fine, 1.0)], fine.state, fine.residual
        for level, piece in enumerate(self.pieces[1:], start=1):
            q = np.ascontiguousarray(q[::2])
            row = _normal(piece, q, load)
            at = equilibrium(
                piece.body,
                piece.held,
                _coarser(state),
                along=row,
                control=Control.DIRECTION,
                tolerance=self.tolerance,
            )
            if not at.converged:
                return None
            lines.append(self._line(level, at, speed / dot(piece.body, row, at.tangent)))
            state, residual = at.state, max(residual, at.residual)
        return _Matched(np.array(lines), residual)

    def _line(self, level: int, at: Equilibrium, speed: float) -> tuple[float, ...]:
        """Values and rates at a level; ``speed`` turns the unit tangent to a rate per s."""
        gamma, moment, energy = self.values(level, at)
        gamma_rate = speed * at.tangent.load
        moment_rate = speed * self.pieces[level].moment(at.moment_rate)
        return gamma, moment, energy, gamma_rate, moment_rate, 4.0 * moment * gamma_rate

    def near(self, base: Equilibrium, s: float) -> _Matched | None:
        """The matched states at the distance ``s`` along the path of the finest mesh."""
        piece, t = self.pieces[0], base.tangent
        at = equilibrium(
            piece.body,
            piece.held,
            moved(piece.held, base.state, Direction(s * t.q, s * t.force, s * t.load)),
            along=t,
            control=Control.DIRECTION,
            tolerance=self.tolerance,
        )
        return self.matched(at) if at.converged else None


def _normal(piece: Sector, q: Array, load: float) -> Direction:
    """The direction of rates ``q`` (n, b) of the frames and ``load`` of gamma, as a normal.

    Notes
    -----
    Its product with another direction is the trapezoidal rule for the integral of the product of
    both rotations, the grips' included: they turn with gamma and are no entries of q. Without them
    an end of the integral would be missing, and the series in h would have odd powers.
    """
    grips = float(np.sum(piece.body.mass[:, 0] * piece.held.turn**2))
    return Direction(q, np.zeros(len(piece.held.target)), grips * load)


def _coarser(state: State) -> State:
    """Every second frame of a state."""
    return state.but(
        quat=np.ascontiguousarray(state.quat[::2]), stretch=np.ascontiguousarray(state.stretch[::2])
    )


def romberg(levels: Array) -> Array:
    """Values at h, the same less their h^2 term, and less their h^4 term: (3, ...) as ``levels``.

    Parameters
    ----------
    levels : (3, ...) values at h, 2h and 4h, with errors in even powers of h.
    """
    once = (4.0 * levels[:-1] - levels[1:]) / 3.0
    return np.array([levels[0], once[0], (16.0 * once[0] - once[1]) / 15.0])


@dataclass(frozen=True)
class _Place:
    """A state of the extrapolated curve, and how an error of the curve moves it.

    Notes
    -----
    What is sought is F(s) = 0, F a column of the table less a constant. If the curve is off by
    c(s), the root is off by ds = -c_F/F', and the values there by c + rates ds.
    """

    s: float  # distance from the visit along the path
    table: Array  # (LEVELS, 6)
    residual: float
    values: Array  # (3,) gamma, M, U
    spread: Array  # (3, 6) error of values = spread . correction of the table's columns
    bend: Array  # (LEVELS, 3) d rates/ds; zero where the state did not have to be sought
    fixed: bool  # whether the place on the path means something
    sought: bool = True  # whether it is a place of the extrapolated curve; else of N edges


class _Goal(NamedTuple):
    """What is sought on the extrapolated curve."""

    column: int  # of the table
    value: float
    direction: float  # where gamma is sought: sign of dgamma/ds on this side of a fold


def _goal(visit: Visit, asked: Collection[float]) -> _Goal | None:
    """What a visited state stands for; None: for nothing but a place on the curve."""
    load = visit.at.state.load
    if visit.kind == "fold":
        return _Goal(RATE + GAMMA, 0.0, 0.0)
    if visit.kind == "limit":
        return _Goal(RATE + MOMENT, 0.0, 0.0)
    if visit.kind == "" and load in asked:
        return _Goal(GAMMA, load, visit.at.tangent.load)
    return None


def _placed(family: _Family, visit: Visit, asked: Collection[float]) -> _Place | None:
    """Where a visited state belongs on the extrapolated curve; None where a level has no state."""
    here = family.matched(visit.at)
    goal = _goal(visit, asked)
    if here is None:
        return None
    if goal is not None:
        return _sought(family, visit.at, here, goal)
    values, bend = romberg(here.table)[-1][:RATE], np.zeros((LEVELS, RATE))
    marked = visit.kind != ""
    return _Place(0.0, here.table, here.residual, values, np.eye(RATE, 6), bend, marked, not marked)


def _sought(family: _Family, base: Equilibrium, here: _Matched, goal: _Goal) -> _Place | None:
    """Where the goal is, by the secant method from ``base``, to which ``here`` is matched."""
    s, now, bend = 0.0, romberg(here.table)[-1], np.zeros((LEVELS, RATE))
    slope = float(now[RATE + goal.column]) if goal.column < RATE else 0.0
    for _ in range(_MOST):
        step = (goal.value - float(now[goal.column])) / slope if slope else _PROBE
        if slope and abs(step) <= _SMALL:
            return _found(goal, s + step, _advanced(here, step, bend), slope, bend)
        s += step
        new = family.near(base, s) if abs(s) < _FARTHEST else None
        if new is None:
            return None
        bend = (new.table[:, RATE:] - here.table[:, RATE:]) / step
        after = romberg(new.table)[-1]
        slope = float(after[goal.column] - now[goal.column]) / step
        here, now = new, after
    return None


def _advanced(here: _Matched, step: float, bend: Array) -> _Matched:
    """Matched states one small ``step`` further, where the rates change by ``bend`` per s."""
    table = here.table.copy()
    table[:, :RATE] += step * table[:, RATE:]
    table[:, RATE:] += step * bend
    return here._replace(table=table)


def _found(goal: _Goal, s: float, here: _Matched, slope: float, bend: Array) -> _Place | None:
    """The place of a goal; None for a gamma that lies beyond a fold of the extrapolated curve.

    ``slope`` is the rate of what is sought along s.
    """
    line, spread = romberg(here.table)[-1], np.eye(RATE, 6)
    if goal.column == GAMMA:
        slope = float(line[RATE])
        if slope * goal.direction <= 0.0:
            return None
        line[GAMMA] = goal.value
    spread[:, goal.column] -= line[RATE:] / slope
    if goal.column == GAMMA:
        spread[GAMMA] = 0.0  # given, to the last digit
    return _Place(s, here.table, here.residual, line[:RATE], spread, bend, fixed=True)


def _arc_lengths(piece: Sector, visits: Sequence[Visit]) -> Array:
    """Distances (n,) of the visits from the first, along chords, in the norm of the path."""
    mass, lengths = piece.body.mass, [0.0] * bool(visits)
    for a, b in pairwise(visits):
        turn = rotation_vector(a.at.state.quat, b.at.state.quat)
        turn[~piece.held.free[:, :3]] = 0.0
        rise = b.at.state.load - a.at.state.load
        lengths.append(math.sqrt(float(np.sum(mass * turn**2)) + rise * rise))
    return np.cumsum(lengths)


def _order(lengths: Array, places: Sequence[_Place | None]) -> list[int]:
    """Positions of the visits in their order on the extrapolated curve, without overtaken ones."""
    at = [s + (0.0 if p is None else p.s) for s, p in zip(lengths, places, strict=True)]
    fixed = [p is not None and p.fixed for p in places]
    before = accumulate((a if f else -math.inf for a, f in zip(at, fixed, strict=True)), max)
    backward = zip(reversed(at), reversed(fixed), strict=True)
    after = reversed(list(accumulate((a if f else math.inf for a, f in backward), min)))
    kept = []
    for k, (low, high) in enumerate(zip(before, after, strict=True)):
        if places[k] is None:
            at[k] = min(max(at[k], low), high)  # known on N edges only: among its old neighbours
        if fixed[k] or places[k] is None or low < at[k] < high:
            kept.append(k)
    return sorted(kept, key=lambda k: at[k])


def _scales(family: _Family, visits: Sequence[Visit]) -> Array:
    """What the columns of a table are measured in (6,): pi and the largest |M| and |U|."""
    values = np.array([family.values(0, visit.at) for visit in visits]).reshape(-1, RATE)
    largest = np.abs(values).max(axis=0, initial=0.0)
    largest[GAMMA] = math.pi
    return np.tile(np.where(largest > 0.0, largest, 1.0), 2)


@dataclass(frozen=True)
class _Corrections:
    """What the two extrapolations change at the states of a path."""

    places: Sequence[_Place | None]
    first: Array  # (n, 6) T10 - T00; zero where there is no state
    last: Array  # (n, 6) T20 - T10
    exact: NDArray[np.bool_]  # (n,) the same on every mesh; or no state
    rest: float  # what the corrections left out may add, as a fraction of the first
    scales: Array  # (6,)

    @classmethod
    def of(cls, places: Sequence[_Place | None], scales: Array) -> _Corrections:
        """Corrections at these places."""
        none = np.zeros((LEVELS, 6))
        changes = np.array(
            [np.diff(romberg(none if p is None else p.table), axis=0) for p in places]
        ).reshape(-1, 2, 6)
        first, last = changes[:, 0], changes[:, 1]
        sizes = np.linalg.norm(changes[:, :, :RATE] / scales[:RATE], axis=2)
        exact = sizes[:, 0] < _EXACT
        ratio = (sizes[~exact, 1] / sizes[~exact, 0]).max(initial=0.0)
        return cls(places, first, last, exact, _REST * ratio * ratio, scales)

    def bound(self, k: int) -> Array | None:
        """Errors (3,) of the values at a place; None where they are not known.

        Notes
        -----
        The last correction, T20 - T10, is several times the error of T20 where the series of h is
        well behaved. It passes through zero where the error does not, so it is the largest of a
        state and its two neighbours, and the corrections to come are added as those of a geometric
        series: the first correction times the square of the largest ratio of the two along the
        path, times `_REST`. The residual of the states is the floor.
        """
        place = self.places[k]
        if place is None or not place.sought:
            return None
        floor = 2.0 * place.residual * np.any(place.spread != 0.0, axis=1)
        if self.exact[k]:
            return np.abs(place.spread @ self.last[k]) + floor
        near = [j for j in (k - 1, k, k + 1) if 0 <= j < len(self.places) and not self.exact[j]]
        last = np.abs(self.last[near] @ place.spread.T).max(axis=0)
        return last + np.abs(place.spread) @ self.remainder(k) + floor

    def remainder(self, k: int) -> Array:
        """What the corrections left out may add to the columns of the table (6,)."""
        halves = (self.first[k] / self.scales).reshape(2, RATE)
        return self.rest * self.scales * np.repeat(np.linalg.norm(halves, axis=1), RATE)


def _slope_at_pi(
    places: Sequence[_Place | None], visits: Sequence[Visit], corrections: _Corrections
) -> tuple[float | None, float | None]:
    """dM/dgamma at the first arrival at pi, and its error."""
    found = [k for k, v in enumerate(visits) if v.kind == "" and v.at.state.load == math.pi]
    place = places[found[0]] if found else None
    if place is None:
        return None, None
    k = found[0]
    gamma_rate, moment_rate = place.table[:, RATE + GAMMA], place.table[:, RATE + MOMENT]
    plain, once, twice = romberg(moment_rate / gamma_rate)
    # and by how much it changes if the state lies elsewhere on the curve
    change = romberg(
        (place.bend[:, MOMENT] - moment_rate / gamma_rate * place.bend[:, GAMMA]) / gamma_rate
    )[-1]
    away = (abs(corrections.last[k, GAMMA]) + corrections.remainder(k)[GAMMA]) / gamma_rate[0]
    error = abs(twice - once) + corrections.rest * abs(once - plain) + abs(change * away)
    return float(twice), float(error)


def _how(pieces: Sequence[Sector], bounds: Sequence[Array | None]) -> str:
    """How the errors were found, in a sentence."""
    sizes = ", ".join(str(_edges(piece)) for piece in pieces)
    text = (
        f"Romberg extrapolation from {sizes} edges, states matched in the planes normal to the path"
        " of the finest; an error is the last correction, the largest of a state and its"
        " neighbours, and an estimate of those to come"
    )
    missing = sum(bound is None for bound in bounds)
    if missing:
        text += (
            f"; null at {missing} of {len(bounds)} states: a coarser mesh has no such state, or it"
            f" is a branch or contact point, whose place on the path is that of {_edges(pieces[0])}"
            " edges"
        )
    return text


def _edges(piece: Sector) -> int:
    """Edges of the full ring."""
    return len(piece.body.cell) * piece.copies
