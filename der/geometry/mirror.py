"""Mirror axes of a closed plane curve, found from its Fourier series.

With places z(s) = sum c_k exp(2 pi i k s/L), a mirror image that exchanges s and t - s is
exp(2 i phi) conj z(t - s). Its mean square distance from the curve is 2 (sum |c_k|^2 - |S(t)|) for
the best phi, half the argument of S(t) = sum c_k^2 exp(2 pi i k t/L). So axes are peaks of |S|.
Noise of high wave number, which spoils curvatures, has no weight in S.
"""

from dataclasses import dataclass

import numpy as np

from der.geometry.outline import ComplexArray

MOST = 32  # axes that are looked at, the best ones
AGREE = 1.5  # an axis at the first point whose image is worse by this is as good as the best
ROUNDING = 1e-12  # of the curve's size


@dataclass(frozen=True)
class Axis:
    """A straight line about which a curve is mirrored; arc lengths in units of the curve's."""

    start: float  # arc length of its first end, in [0, 1/2); its second is at start + 1/2
    deviation: float  # largest distance between the curve and its mirror image
    where: float  # arc length at which it is that large
    span: float  # distance between its ends

    @property
    def away(self) -> float:
        """Arc length between the curve's first point and the nearer end."""
        return min(self.start, 0.5 - self.start)


def fourier_series(place: ComplexArray) -> ComplexArray:
    """Return c_k of a closed curve given at even steps of arc length, about its centroid."""
    series = np.fft.fft(place) / len(place)
    series[0] = 0.0
    return series


def mirror_axes(series: ComplexArray) -> list[Axis]:
    """Return the axes of a closed curve, the best first.

    Parameters
    ----------
    series : ndarray, shape (n,)
        Of its places, by `fourier_series`.

    Returns
    -------
    list of Axis
        At least one, if the curve has no symmetry the best. On a circle every line is as good as
        another, and the one through the first point comes first.
    """
    n = len(series)
    match = np.abs(np.fft.ifft(series**2))
    is_peak = (match >= np.roll(match, 1)) & (match >= np.roll(match, -1))
    peaks = np.flatnonzero(is_peak)
    best = peaks[np.argsort(-match[peaks], kind="stable")][:MOST]
    found = [axis_at(series, _refined(series, peak / (2 * n), 1 / n)) for peak in best.tolist()]
    first, least = axis_at(series, 0.0), min(axis.deviation for axis in found)
    if first.deviation <= AGREE * least + ROUNDING * np.sum(np.abs(series)):
        found = [first, *(axis for axis in found if axis.away > 1 / n)]
    return sorted(found, key=lambda axis: axis.deviation)


def axis_at(series: ComplexArray, start: float) -> Axis:
    """Return the axis with an end at `start`, in units of the length."""
    n = len(series)
    k = np.fft.fftfreq(n, 1 / n)
    shift = np.exp(2j * np.pi * k * start)
    match = np.sum((series * shift) ** 2)
    image = np.conj(series * shift**2) * np.exp(1j * np.angle(match))
    gap = n * np.abs(np.fft.ifft(series - image))
    worst = int(np.argmax(gap))
    ends = np.sum(series * shift * (1 - np.exp(1j * np.pi * k)))
    return Axis(start % 0.5, float(gap[worst]), worst / n, float(abs(ends)))


def _refined(series: ComplexArray, start: float, step: float) -> float:
    """Return the peak of |S|^2 near `start`, by Newton's method within `step`."""
    wave = 4j * np.pi * np.fft.fftfreq(len(series), 1 / len(series))
    square, at = series**2, start
    for _ in range(6):
        terms = square * np.exp(wave * at)
        zeroth, first, second = (np.sum(terms * wave**order) for order in range(3))
        slope = (np.conj(zeroth) * first).real
        bend = abs(first) ** 2 + (np.conj(zeroth) * second).real
        if bend >= 0:
            return start
        at = float(np.clip(at - slope / bend, start - step, start + step))
    return at
