"""Distance of two shapes of a ring, up to rigid motions and the symmetries of the problem.

A shape is described by its curvatures k = (k1, k2, k3) about d1, d2, d3: the rotation vectors from
frame to frame over the length between them. Rigid motions do not change them. Two shapes are the
same state if a symmetry of the problem maps one onto the other:

    mirror      x -> -x1, d1 and the sense of rotation reversed:   k(s) -> (k1, -k2, -k3)(s)
    reversal    the curve run backwards, d1 and d3 reversed:       k(s) -> (k1, -k2,  k3)(-s)
    shift       of the material along the curve:                   k(s) -> k(s + c)
    roll        of the bar by half a turn about its tangent:       k(s) -> (-k1, -k2, k3)(s)

All but the last keep k1. They are symmetries if the natural curvature about d1 has the same value
at s + c, or at -s + c: any c on a uniform ring, half the length on an ellipse. A naturally straight
bar may be rolled, and an isotropic one by any angle; such states are compared by k1^2 + k2^2,
k1 k2' - k2 k1' and k3, which a roll does not change. With grips, a symmetry must map grips to
grips. The mirror reverses their rotation: it is a symmetry only at multiples of pi. The distance is
the least root mean square difference of k over all symmetries, times the ring's mean radius. Over
all shifts of a uniform ring it is least where the correlation of the two shapes is largest. The
correlation is a trigonometric polynomial; its peak is found by FFT and Newton's method, so a shift
need not be a multiple of a cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from der.kernels.quaternions import Array, rotation_vector
from der.rod.rod import Rod, State
from der.rod.supports import Supports

Signal = NDArray[np.complex128]

SAME = 1e-3  # of the distance: below, two shapes are one
_ALIKE = 1e-9  # of cells and natural strains
_FINER = 4  # samples of the correlation between two vertices
_HARMONICS = 24  # of a uniform ring's curvatures: finer ones do not distinguish states
_UNMOVED = 1e-6  # of the largest Fourier coefficient: noise

_MIRROR = np.array([1.0, -1.0, -1.0])
_ROLL = np.array([-1.0, -1.0, 1.0])
_REVERSAL = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Move:
    """One symmetry of a ring: signs of k, reversal, then a shift by an integer number of cells."""

    sign: Array  # (3,)
    backwards: bool
    cells: int

    def of(self, k: Array) -> Array:
        """The curvatures (n, 3) of the image."""
        image = k[::-1] if self.backwards else k
        return np.roll(self.sign * image, self.cells, axis=0)


@dataclass(frozen=True)
class Images:
    """All symmetries of a ring in its supports."""

    moves: tuple[Move, ...]
    slides: bool  # whether any shift is a symmetry: moves then have no shift
    spins: bool  # whether the bar may be rolled by any angle
    weight: Array  # (n,) of the vertices, in a mean square over the length
    radius: float  # mean radius L/(2 pi)

    def signature(self, k: Array) -> Signal:
        """Curvatures (n, 3) as `distances` takes them: (h, 3) Fourier coefficients, or weighted."""
        if self.spins:
            k = _unrolled(k)
        if self.slides:
            half = min(_HARMONICS, (len(k) - 1) // 2)
            return np.fft.fft(k, axis=0)[np.arange(-half, half + 1)] * (self.radius / len(k))
        return (self.radius * np.sqrt(self.weight)[:, None] * k).astype(complex)

    def all_of(self, k: Array) -> Signal:
        """Signatures (m, h, 3) of a shape's distinct images, its own first; shifts left out."""
        distinct = self.signature(k)[None]
        for move in self.moves[1:]:
            image = self.signature(move.of(k))
            if self.distances(image, distinct).min() >= SAME:
                distinct = np.append(distinct, image[None], axis=0)
        return distinct

    def distances(self, a: Signal, b: Signal) -> Array:
        """Distances (m,) of one signature (h, 3) from others (m, h, 3)."""
        if self.slides:
            return _least_over_shifts(a, b)
        return np.sqrt(np.sum(np.abs(a - b) ** 2, axis=(1, 2)))


def curvatures(rod: Rod, state: State) -> Array:
    """Rotation vectors between neighbouring frames over the lengths between them (n, 3), 1/a."""
    turn = rotation_vector(state.quat, np.roll(state.quat, -1, axis=0))
    return turn / rod.cell[:, None]


def images(rod: Rod, supports: Supports, load: float) -> Images:
    """Return the symmetries of a full ring, in its grips turned to ``load`` if it has any."""
    n = rod.n_edges
    gripped = bool(np.any(supports.turn))
    uniform = _equal(rod.cell, rod.cell[0]) and _equal(rod.rest, rod.rest[0])
    slides = uniform and not gripped
    straight = not gripped and _equal(rod.rest, np.zeros(3))
    spins = straight and slides and _equal(rod.stiffness[0], rod.stiffness[1])
    shifts = [0] if slides else [0, n // 2] if gripped else list(range(n))
    signs = [np.ones(3)]
    if not gripped or math.isclose(math.sin(load), 0.0, abs_tol=1e-12):
        signs.append(_MIRROR)
    if straight:
        signs += [_ROLL * sign for sign in signs]
    moves = []
    for backwards in (False, True):
        for cells in shifts:
            plain = Move(np.ones(3), backwards, cells)
            if _equal(plain.of(rod.cell[:, None]), rod.cell[:, None]) and _equal(
                plain.of(rod.rest), rod.rest
            ):
                turned = _REVERSAL if backwards else np.ones(3)
                moves += [Move(turned * sign, backwards, cells) for sign in signs]
    weight = rod.cell / rod.cell.sum()
    radius = float(rod.cell.sum()) / (2.0 * math.pi)
    return Images(tuple(moves), slides, spins, weight, radius)


def repeats(k: Array) -> int:
    """Return how often a shape of a uniform ring repeats around it; 0: it is uniform.

    The greatest common divisor of the orders of all Fourier coefficients that are not noise.
    """
    size = np.abs(np.fft.rfft(k, axis=0)).max(axis=1)
    orders = np.flatnonzero(size[1:] > _UNMOVED * max(float(size.max()), 1e-300)) + 1
    return int(np.gcd.reduce(orders)) if len(orders) else 0


def _unrolled(k: Array) -> Array:
    """Invariants (n, 3) of curvatures under a roll of the bar by any angle."""
    rate = 0.5 * (np.roll(k, -1, axis=0) - np.roll(k, 1, axis=0))
    turning = k[:, 0] * rate[:, 1] - k[:, 1] * rate[:, 0]
    return np.stack([k[:, 0] ** 2 + k[:, 1] ** 2, turning, k[:, 2]], axis=1)


def _equal(a: Array, b: Array) -> bool:
    return bool(np.all(np.abs(a - b) <= _ALIKE))


def _least_over_shifts(a: Signal, b: Signal) -> Array:
    """Least root mean square differences (m,) of one curve from shifts of others.

    Both are given by their Fourier coefficients from -h to h, (2 h + 1, 3) and (m, 2 h + 1, 3). By
    Parseval the mean square is sum_j |a_j - b_j exp(i j x)|^2, least where the real part c(x) of
    sum_j conj(a_j) b_j exp(i j x) is largest.
    """
    half = len(a) // 2
    order = np.arange(-half, half + 1)
    cross = np.sum(np.conj(a) * b, axis=2)
    places = _FINER * len(a)
    padded = np.zeros((len(b), places), dtype=complex)
    padded[:, order] = cross
    x = 2.0 * np.pi * np.argmax(np.fft.ifft(padded, axis=1).real, axis=1) / places
    for _ in range(3):
        wave = cross * np.exp(1j * order * x[:, None])
        slope, bend = -wave.imag @ order, wave.real @ order**2
        curved = bend > 0.0  # not uniform, where any shift will do
        step = np.divide(slope, bend, out=np.zeros(len(b)), where=curved)
        x = x + np.clip(step, -np.pi / len(a), np.pi / len(a))
    difference = a - b * np.exp(1j * order * x[:, None])[:, :, None]
    return np.sqrt(np.sum(np.abs(difference) ** 2, axis=(1, 2)))
