"""Where the frames of a discrete ring sit: close where it is sharply bent, on every joint.

Frames sit on grips, free points, jumps and kinks of the natural curvature at every resolution;
between these, cells share a density equally. It is the mean curvature of the folded ring beside
that of the flat one: |k1u| + 4 pi/L (paper, Eq. B.1), so that straights, which bend most when the
ring folds, are resolved like its fillets.

Twice as many cells are the same cells halved: where cells of N halve those of N/2, a smooth
solution's errors have even powers of 1/N. For that, the cells are shared out among the segments at
the coarsest of the numbers n, n/2, n/4, ... that has two for each segment, and then doubled.
"""

from __future__ import annotations

import heapq
from functools import lru_cache
from itertools import pairwise

import numpy as np

from der.geometry.outline import Array
from der.geometry.ring import Ring

CLOSE = 1e-12  # of the length: joints nearer to an end than this are that end
FEW = 1e-3  # of a cell's share: a segment with less has no cell
SLIGHT = 1e-9  # of the curvature over the length: smaller jumps of its slope are rounding
UNEVEN = 2.0  # times its share: the most that a cell may have for the sake of kinks
STRONG = 0.1  # of the strongest kink: weaker ones may lie inside of cells
SAMPLES = 256  # of the density in a segment whose curvature varies


def sites(ring: Ring, n_edges: int, name: str, finest: int | None = None) -> Array:
    """Arc lengths of the frames of a sector, both of its ends included.

    Parameters
    ----------
    n_edges : edges of the full ring, divisible into the sector (`scene.sector_name`).
    name : "full", "half" or "quarter". The full ring's first frame stands at its end, too.
    finest : edges of the mesh of which this is a coarser one for error bars; None: it is none.

    Notes
    -----
    The sites have the ring's symmetry: those of a half are those of a quarter and their mirror
    image. Where there are fewer cells than segments, jumps of curvature lie inside of cells, which
    see their mean. Where cells of N/4 edges are too few for all kinks, weak ones lie inside of
    cells, or all of them; `natural_turning` makes up for that.
    """
    length = ring.length
    finest = n_edges if finest is None else finest
    if ring.symmetry == "D2" and n_edges % 4 == 0:
        quarter = _graded(ring, 0.25 * length, 0.5 * length, n_edges // 4, finest // 4)
        half = _mirrored(quarter, 0.5 * length)
    else:
        half = _graded(ring, 0.0, 0.5 * length, n_edges // 2, finest // 2)
    if name == "half":
        return half
    return quarter if name == "quarter" else np.append(half, (length - half)[-2::-1])


def natural_turning(ring: Ring, s: Array) -> Array:
    """Natural turning (n,) of the cells between frames at the sites ``s`` (n + 1,), rad."""
    return np.asarray(np.diff(ring.natural_angle(s) + kink_offsets(ring, s)))


def kink_offsets(ring: Ring, s: Array) -> Array:
    """Small turns (n + 1,) of the frames at the sites ``s`` that make up for kinks in cells, rad.

    Notes
    -----
    Positions are sums of edges by the trapezoidal rule. The tangent's second derivative jumps by
    J d2 at a kink, where the slope of k1u jumps by J. With the kink at the fraction t of a cell c,
    the Euler-Maclaurin formula has one more term there, - J c^3 B3(t)/6 d2, with the Bernoulli
    polynomial B3(t) = t (t - 1/2)(t - 1). It is zero at nodes; on finer meshes it is of no fixed
    sign, which would spoil the even series. The two edges beside the kink, turned by this over
    their lengths, move the rod by that much in every deformed state: what is left is c^4.
    Frames on a symmetry axis cannot turn, and leave it to the other one.
    """
    offsets = np.zeros(len(s))
    at, jump = _kinks(ring, s[0], s[-1])
    if not len(at):
        return offsets
    cell = np.diff(s)
    i = np.searchsorted(s, at, side="right") - 1
    t = (at - s[i]) / cell[i]
    t[np.minimum(t, 1.0 - t) * cell[i] < CLOSE * ring.length] = 0.0  # a node, but for rounding
    axes = s / (ring.length * (0.25 if ring.symmetry == "D2" else 0.5))
    held = np.abs(axes - np.round(axes)) < CLOSE
    left = np.where(held[i], 0.0, np.where(held[i + 1], 1.0, 1.0 - t))
    moved = -jump * cell[i] ** 3 * t * (t - 0.5) * (t - 1.0) / 6.0
    np.add.at(offsets, i, left * moved)
    np.add.at(offsets, i + 1, (1.0 - left) * moved)
    length = 0.5 * (np.append(cell, 0.0) + np.append(0.0, cell))
    return offsets / length


def _mirrored(s: Array, end: float) -> Array:
    """Sites from ``end`` - s[-1] on to s[-1], of which ``s`` are the second half."""
    return np.append((end - s)[:0:-1], s)


def _graded(ring: Ring, begin: float, end: float, n_cells: int, finest: int) -> Array:
    """Sites (n_cells + 1,) from ``begin`` to ``end``; on the finest mesh, ``finest`` cells."""
    joints, kinked = _joints(ring, begin, end, n_cells, finest)
    segments = [_segment(ring, a, b) for a, b in pairwise(joints)]
    # a straight that rounding leaves between two fillets has no cell of its own
    least = FEW * sum(segment.weight for segment in segments) / n_cells
    if any(segment.weight < least for segment in segments):
        kept = [segment.end for segment in segments[:-1] if segment.weight >= least]
        if segments[-1].weight < least:
            kept = kept[:-1]
        joints = [begin, *kept, end]
        segments = [_segment(ring, a, b) for a, b in pairwise(joints)]
    coarsest, enough = (finest, _quarter(finest)) if kinked else (n_cells, n_cells)
    while coarsest % 2 == 0 and (coarsest > enough or coarsest // 2 >= 2 * len(segments)):
        coarsest //= 2
    counts = _shared([segment.weight for segment in segments], coarsest)
    places = [
        segment.places(count * n_cells // coarsest)[:-1]
        for segment, count in zip(segments, counts, strict=True)
    ]
    return np.append(np.concatenate(places), end)


def _joints(
    ring: Ring, begin: float, end: float, n_cells: int, finest: int
) -> tuple[list[float], bool]:
    """Ends of the segments, and whether kinks are among them: all, the strong ones, or none."""
    margin = CLOSE * ring.length
    joints = [begin, *(s for s in ring.breaks if begin + margin < s < end - margin), end]
    if n_cells < len(joints) - 1:
        joints = [begin, end]
    at, jump = _kinks(ring, begin + margin, end - margin)
    if not len(at):
        return joints, False
    size = np.abs(jump)
    size[np.isin(at, joints)] = 0.0
    for share in (0.0, STRONG):
        strong = at[size > share * size.max(initial=0.0)].tolist()
        tried = sorted([*joints, *strong])
        if strong and _is_even(ring, tried, _quarter(finest)):
            return tried, True
    return joints, False


def _is_even(ring: Ring, joints: list[float], n_cells: int) -> bool:
    """Whether cells between these joints share the density as without them, but for a factor."""
    if n_cells < len(joints) - 1:
        return False
    weights = [_segment(ring, a, b).weight for a, b in pairwise(joints)]
    counts = _shared(weights, n_cells)
    most = max(weight / count for weight, count in zip(weights, counts, strict=True))
    return most * n_cells <= UNEVEN * sum(weights)


def _quarter(finest: int) -> int:
    """Cells of the coarsest mesh that error bars need; a mesh that cannot be halved has none."""
    return finest // 4 if finest % 4 == 0 else finest


def _kinks(ring: Ring, begin: float, end: float) -> tuple[Array, Array]:
    """Arc lengths between two others at which the curvature has a kink, and its jumps of slope."""
    at, jump = np.array(ring.kinks), ring.outline.slope_jumps
    if not np.any(jump):
        return np.zeros(0), np.zeros(0)
    slight = SLIGHT * np.abs(ring.curvature(at)).max() / ring.length
    kept = (at > begin) & (at < end) & (np.abs(jump) > slight)
    return at[kept], jump[kept]


class _Segment:
    """A part of the ring with smooth natural curvature, and the density of frames on it."""

    def __init__(self, ring: Ring, begin: float, end: float) -> None:
        self.end = end
        self.s = np.linspace(begin, end, SAMPLES + 1)
        middle = 0.5 * (self.s[1:] + self.s[:-1])
        density = np.abs(ring.curvature(middle)) + 4.0 * np.pi / ring.length
        self.share = np.append(0.0, np.cumsum(density * np.diff(self.s)))
        self.even = bool(np.ptp(density) <= 1e-12 * density.max())

    @property
    def weight(self) -> float:
        """Integral of the density."""
        return float(self.share[-1])

    def places(self, count: int) -> Array:
        """Sites (count + 1,) that share the density equally."""
        if self.even:
            return np.linspace(self.s[0], self.s[-1], count + 1)
        return np.interp(np.linspace(0.0, self.weight, count + 1), self.share, self.s)


@lru_cache(maxsize=1024)
def _segment(ring: Ring, begin: float, end: float) -> _Segment:
    """A segment, remembered: the meshes of a ring's error bars share it."""
    return _Segment(ring, begin, end)


def _shared(weights: list[float], total: int) -> list[int]:
    """Integers >= 1 in proportion to ``weights``, ``total`` together (Jefferson's rule)."""
    counts = [1] * len(weights)
    heap = [(-weight / 2.0, k) for k, weight in enumerate(weights)]
    heapq.heapify(heap)
    for _ in range(total - len(weights)):
        _, k = heapq.heappop(heap)
        counts[k] += 1
        heapq.heappush(heap, (-weights[k] / (counts[k] + 1.0), k))
    return counts
