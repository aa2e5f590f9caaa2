"""Regions of a phase diagram as labels of pixels, from the labels of solved cases.

Places are in unit coordinates, from 0 to 1 along both parameters of the picture.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from der.utils.checks import Array
from der.viz.curve import arc_length

Labels = NDArray[np.int64]

NOT_FOLDABLE, FAILED = 0, 7
HELD, BACK = 2, 1  # a foldable ring: 1 + HELD where stable at fixed moment + HELD where it stays
# folded when released + BACK where it snaps back
FINER = (4, 32)  # pixels between two nodes, at least and at most
PIXELS = 512  # across all nodes
BETWEEN = 6  # pieces of the line between two points of a boundary
NEIGHBOURS = 64  # visible places with which a hidden one is compared


class Sheet(NamedTuple):
    """The solved cases of one twisting axis, in one plane of a diagram."""

    axis: str  # "x" or "y"
    labels: Labels  # (n, n) at the nodes of a lattice: NOT_FOLDABLE, 1 to 6, or FAILED
    slopes: Array  # (n, n) dM/dgamma at pi, interpolated within cells
    beside: Array  # (m, 2) places of cases that are not nodes
    beside_labels: Labels  # (m,)


class Boundary(NamedTuple):
    """A boundary between folding modes."""

    kind: str  # followed by " (scan)" where only the scan locates it
    axis: str
    places: Array  # (n, 2) in order

    @property
    def line(self) -> Array:
        """The places and more between them, on Akima's curve, which does not oscillate at a kink.

        A scanned boundary has its own places only.
        """
        from scipy.interpolate import Akima1DInterpolator

        steps = np.linalg.norm(np.diff(self.places, axis=0), axis=1)
        places = self.places[np.append(True, steps > 1e-9 * steps.max(initial=0.0))]
        if len(places) < 3 or self.kind.endswith(")"):
            return places
        along = arc_length(places)
        n = np.arange(BETWEEN * (len(places) - 1) + 1) / BETWEEN
        at = np.interp(n, np.arange(len(along)), along)
        return np.asarray(Akima1DInterpolator(along, places)(at))


def pixels(sheet: Sheet, boundaries: Iterable[Boundary]) -> Labels:
    """Labels (k, k) of pixels between the nodes of a sheet.

    Beside a boundary the label is that of the nearest case on the same side. Elsewhere, a ring is
    foldable, snaps back or stays folded if most of its neighbours do, weighted by distance. It is
    stable at fixed moment if the interpolated slope at pi is positive.
    """
    labels = sheet.labels
    n = len(labels)
    finer = int(np.clip(PIXELS // (n - 1), *FINER))
    place = (np.arange(finer * (n - 1)) + 0.5) / finer
    weight = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(n)))

    def mean(values: Array | NDArray[np.bool_]) -> Array:
        return weight @ values.astype(float) @ weight.T

    foldable = (labels > NOT_FOLDABLE) & (labels < FAILED)
    back = foldable & ((labels - 1) % 2 == BACK)
    stable = mean(np.where(foldable, sheet.slopes, 0.0)) > 0.0
    snaps_back = mean(back) > 0.5 * mean(foldable)
    held = np.where(foldable, (labels - 1) // HELD, 0)
    stays = mean(held == 2) > 0.5 * mean(held > 0)
    found: Labels = 1 + HELD * np.where(stable, 1 + stays, 0) + np.where(snaps_back, BACK, 0)
    parts = [mean(labels == NOT_FOLDABLE), mean(foldable), mean(labels == FAILED)]
    winner = np.argmax(parts, axis=0)
    found[winner == 0] = NOT_FOLDABLE
    found[winner == 2] = FAILED
    lines = [b.line * (n - 1) for b in boundaries if b.axis == sheet.axis and len(b.places) > 1]
    segments = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
    _correct(found, sheet, np.concatenate([np.empty((0, 2, 2)), *segments]))
    return found


def _correct(found: Labels, sheet: Sheet, segments: Array) -> None:
    """In cells with different labels, give each pixel the label of its side of a boundary.

    Parameters
    ----------
    found : (k, k) labels of pixels, which are changed.
    segments : (m, 2, 2) pieces of boundaries, in units of the lattice, as all places below.
    """
    labels, n = sheet.labels, len(sheet.labels) - 1
    finer = len(found) // n
    low, high = segments.min(axis=1), segments.max(axis=1)
    inner = (np.arange(finer) + 0.5) / finer
    offsets = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    around = [labels[:-1, :-1], labels[:-1, 1:], labels[1:, :-1], labels[1:, 1:]]
    mixed = np.ptp(around, axis=0) > 0
    beside = sheet.beside * n
    homes = np.clip(beside.astype(np.int64), 0, n - 1)
    mixed[tuple(homes[sheet.beside_labels != around[0][tuple(homes.T)]].T)] = True
    for i, j in np.argwhere(mixed):
        near = ((low <= (i + 1, j + 1)) & (high >= (i, j))).all(axis=1)
        if not near.any():
            continue
        nodes = np.array((i, j)) + steps
        own = (homes == (i, j)).all(axis=1)
        cases = np.concatenate([nodes, beside[own]])
        names = np.concatenate([labels[tuple(nodes.T)], sheet.beside_labels[own]])
        block = found[i * finer : (i + 1) * finer, j * finer : (j + 1) * finer]
        places = nodes[0] + offsets
        block[...] = _on_sides(places, block.ravel(), cases, names, segments[near]).reshape(
            block.shape
        )


def _on_sides(
    places: Array, labels: Labels, cases: Array, names: Labels, segments: Array
) -> Labels:
    """Labels of places (k, 2): that of the nearest case that no segment hides.

    Where segments hide all cases, the label is that of the nearest place that is not hidden.
    """
    from scipy.spatial import KDTree

    far = np.linalg.norm(places[:, None] - cases, axis=2)
    seen = _first_seen(places, cases, np.argsort(far, axis=1, kind="stable"), segments)
    hidden = seen < 0
    chosen: Labels = np.where(hidden, labels, names[seen])
    if hidden.any() and not hidden.all():
        shown = places[~hidden]
        count = range(1, min(NEIGHBOURS, len(shown)) + 1)
        near = KDTree(shown).query(places[hidden], count)[1]
        seen = _first_seen(places[hidden], shown, near, segments)
        chosen[hidden] = chosen[~hidden][np.where(seen < 0, near[:, 0], seen)]
    return chosen


def _first_seen(places: Array, others: Array, near: Labels, segments: Array) -> Labels:
    """The first of others that no segment hides from a place, by place; -1 where there is none.

    Parameters
    ----------
    near : (places, k) numbers of others, from the nearest on
    """
    found = np.full(len(places), -1)
    left = np.arange(len(places))
    for column in near.T:
        chosen = column[left]
        hidden = _crossed(places[left], others[chosen], segments)
        found[left[~hidden]] = chosen[~hidden]
        left = left[hidden]
    return found


def _crossed(p: Array, q: Array, segments: Array) -> NDArray[np.bool_]:
    """Whether a segment lies between places p and q, both (k, 2)."""
    p, q = p[:, None], q[:, None]
    a, b = segments[:, 0], segments[:, 1]
    sides = _area(p, q, a) * _area(p, q, b) < 0.0
    ends = _area(a, b, p) * _area(a, b, q) < 0.0
    return np.any(sides & ends, axis=1)


def _area(a: Array, b: Array, c: Array) -> Array:
    """Twice the area of a triangle, positive for counterclockwise corners."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
