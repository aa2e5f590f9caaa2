"""A smooth closed curve through points, as close as the points themselves are known.

Points that are exact are joined by the periodic cubic spline through them. Rounded ones lie on a
grid, which is found; a quintic smoothing spline then passes them at the distance of rounding, as
the second derivative of a curve through them would be noise.
"""

import warnings
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from der.geometry.outline import Array, Bends, ComplexArray
from der.utils.checks import checked_array

Rate: TypeAlias = Callable[[Array, int], ComplexArray]  # derivative of an order, at parameters

FEWEST = 8  # points
MOST = 4096  # points that are joined, and pieces of curvature: more than any mesh needs
INTEGER = 1e-4  # how near to integers coordinates on a grid are, in its steps
ENOUGH = 64  # points, for noise to be told from a lack of points
STEADY = 0.6  # of the error at half the distance: the errors of noise hardly fall
LEAST = 1e-9  # of the extent: noise that is rounding of the computer
NORMAL = 0.6745  # the median size of normal errors, in standard deviations
COARSE = 4  # grid steps: points nearer to each other are replaced by their mean
SAMPLED = 10_000  # coordinates among which a grid is sought
OPEN = 5.0  # times the next largest step: a gap, in which nothing is known of the curve
STRAIGHT = 0.1  # rad: turns at both ends of a side, which needs no points
PLANAR = 1e-3  # of the extent
SMALLEST = 1e-100  # extent: squares of smaller ones are not numbers


def planar_points(points: ArrayLike) -> tuple[ComplexArray, float]:
    """Return points as complex numbers, counter-clockwise, once each, and the grid they lie on.

    Parameters
    ----------
    points : array_like, shape (n, 2) or (n, 3)
        Along a closed curve, of which the last may repeat the first. Three coordinates must be in
        a plane.

    Raises
    ------
    ValueError
        If they are not such points.
    """
    xyz = checked_array("points", points, ("n", "m"))
    if xyz.shape[1] not in (2, 3):
        raise ValueError(f"points must have shape (n, 2) or (n, 3), got {xyz.shape}")
    extent = float(np.max(np.ptp(xyz, axis=0), initial=0.0)) if len(xyz) else 0.0
    if len(xyz) >= FEWEST and extent < SMALLEST:
        raise ValueError(f"points must have an extent of at least {SMALLEST:g}, got {extent:g}")
    grid = min((_grid(column) for column in xyz.T if np.ptp(column) > 0), default=0.0)
    xy = xyz if xyz.shape[1] == 2 else _in_plane(xyz, extent, grid)
    z = _once_each(xy[:, 0] + 1j * xy[:, 1], grid)
    if len(z) < FEWEST:
        raise ValueError(
            f"points must be at least {FEWEST}, each unlike its neighbour, got {len(z)}"
        )
    _refuse_gap(z)
    turned = z - z[0]
    is_clockwise = np.sum((np.conj(turned) * np.roll(turned, -1)).imag / extent) < 0
    return np.roll(z[::-1], 1) if is_clockwise else z, grid


def _grid(values: Array) -> float:
    """Return the step of the grid on which coordinates lie, 0 where they are exact.

    Powers of ten are tried, down to the ninth digit, then the step in which the two nearest of them
    differ. Coordinates of fixed significant digits have finer grids near 0, so only the larger ones
    are asked.
    """
    largest = float(np.max(np.abs(values)))
    large = values[np.abs(values) > 0.1 * largest]
    offset = np.unique(large[:: 1 + len(large) // SAMPLED] - large[0])
    gaps = np.diff(offset)
    gaps = gaps[gaps > 1e-9 * largest]
    if len(gaps) < FEWEST:
        return 0.0
    decade = np.floor(np.log10(offset[-1] - offset[0]))
    for unit in [*(10.0 ** (decade - np.arange(9))).tolist(), float(gaps.min())]:
        steps = np.round(offset / unit)
        if np.max(np.abs(offset / unit - steps)) < INTEGER:
            return unit * float(np.gcd.reduce(steps.astype(np.int64)))
    return 0.0


def unsteadiness(z: ComplexArray) -> float:
    """Return the step of the grid whose rounding is as large as the noise in points; 0 if none.

    Splines through every other point tell those between them. Their errors fall at least as the
    square of the distance if the curve is smooth, and do not if the points are noise: then their
    variance is 1.7 times that of a point, weights of a cubic spline halfway between its knots.
    """
    z = z[_first_in_steps(z, _perimeter(z) / MOST)]
    if len(z) < ENOUGH:
        return 0.0
    near, far = _error_between(z), _error_between(z[::2])
    is_noise = near > max(STEADY * far, LEAST)
    return float(np.sqrt(12 / 1.7) * near / NORMAL) if is_noise else 0.0


def _error_between(z: ComplexArray) -> float:
    """Return the median distance of odd points from the spline through the even ones."""
    z = z[: len(z) // 2 * 2]
    u = np.append(0.0, np.cumsum(np.abs(np.diff(np.append(z, z[0])))))
    rate = _interpolated(u[::2], np.append(z[::2], z[0]))[1]
    at, direction = rate(u[1::2], 0), rate(u[1::2], 1)
    speed = np.maximum(np.abs(direction), np.finfo(float).tiny)  # 0 at cusps
    return float(np.median(np.abs((np.conj(direction) * (z[1::2] - at)).imag / speed)))


def _refuse_gap(z: ComplexArray) -> None:
    """Refuse points of an open curve: one step is far longer than all others, and no side."""
    step = np.roll(z, -1) - z
    turn = np.abs(np.angle(step * np.conj(np.roll(step, 1))))
    k = int(np.argmax(np.abs(step)))
    times = abs(step[k]) / np.sort(np.abs(step))[-2]
    after = (k + 1) % len(z)
    if times > OPEN and max(turn[k], turn[after]) > STRAIGHT:
        start, end = (f"({one.real:.6g}, {one.imag:.6g})" for one in (z[k], z[after]))
        raise ValueError(
            f"points must lie all around the curve, got none on {abs(step[k]):.4g} from {start} to "
            f"{end}, {times:.3g} times the next largest step: give points there, too"
        )


def _in_plane(xyz: Array, extent: float, grid: float) -> Array:
    """Return the two coordinates of points in their plane."""
    spread = np.ptp(xyz, axis=0)
    if spread.min() <= grid:  # a coordinate that is constant is left out
        return np.delete(xyz, int(np.argmin(spread)), axis=1)
    centred = (xyz - xyz.mean(axis=0)) / extent
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    height = np.abs(centred @ axes[2]) * extent
    if height.max() > PLANAR * extent + grid:
        worst = int(np.argmax(height))
        raise ValueError(
            f"points must lie in a plane, got point {worst + 1} at a distance of "
            f"{height[worst]:.3g} from the best plane, {height[worst] / extent:.1g} of the extent"
        )
    return extent * centred @ axes[:2].T


def _once_each(z: ComplexArray, grid: float) -> ComplexArray:
    """Return points without those that repeat the one before, but for rounding."""
    step = np.abs(np.roll(z, -1) - z)
    z, step = z[step > 0], step[step > 0]
    if not len(z):
        return z
    close = 1e-3 * float(step.mean())
    if grid < 0.1 * np.median(step):
        close = max(close, 1.5 * grid)
    return z[step > close]


def joined(z: ComplexArray, grid: float) -> tuple[Bends, ComplexArray]:
    """Return the curvature of the smooth closed curve through points, or near rounded ones.

    Parameters
    ----------
    z : ndarray, shape (n,)
        Of an extent near 1.
    grid : float
        Step of the grid on which they lie; 0 where they are exact.

    Returns
    -------
    Bends
        Arc lengths from the first point on, and curvatures just after and before them.
    ndarray
        The curve's places there.
    """
    count = np.ones(len(z))
    if grid > 0:
        z, count = _averaged(z, min(COARSE * grid, _perimeter(z) / 32))
    kept = _first_in_steps(z, _perimeter(z) / MOST)
    z, count = z[kept], count[kept]
    closed = np.append(z, z[0])
    u = np.append(0.0, np.cumsum(np.abs(np.diff(closed))))
    knots, rate = (
        _smoothed(u, closed, count, grid)
        if grid > 0 and len(z) >= FEWEST
        else _interpolated(u, closed)
    )
    pieces = max(min(8, 2 * MOST // len(knots)), 512 // len(knots))
    samples = np.arange(pieces * (len(knots) - 1) + 1) / pieces
    u = np.interp(samples, np.arange(len(knots)), knots)
    velocity, acceleration = rate(u, 1), rate(u, 2)
    if not np.abs(velocity).min() > 0:  # a smooth curve near noise may shrink to a point
        raise ValueError("points must be in order along a smooth closed curve, got one with cusps")
    k = (np.conj(velocity) * acceleration).imag / np.abs(velocity) ** 3
    node, weight = np.polynomial.legendre.leggauss(8)
    step = np.diff(u)
    speed = np.abs(rate(u[:-1, None] + np.multiply.outer(step, (1 + node) / 2), 1))
    s = np.append(0.0, np.cumsum(step / 2 * (speed @ weight)))
    return (s, k[:-1], k[1:]), rate(u, 0)


def _perimeter(z: ComplexArray) -> float:
    return float(np.abs(z - np.roll(z, 1)).sum())


def _first_in_steps(z: ComplexArray, step: float) -> NDArray[np.intp]:
    """Return which points are the first in their step along the polygon; all if few."""
    if len(z) <= MOST:
        return np.arange(len(z))
    u = np.append(0.0, np.cumsum(np.abs(np.diff(z))))
    return np.flatnonzero(np.diff(np.floor(u / step), prepend=-1.0))


def _averaged(z: ComplexArray, step: float) -> tuple[ComplexArray, Array]:
    """Return the means of the points in every step along the polygon, and their numbers."""
    u = np.append(0.0, np.cumsum(np.abs(np.diff(z))))
    first = np.flatnonzero(np.diff(np.floor(u / step), prepend=-1.0))
    count = np.diff(np.append(first, len(z)))
    return np.asarray(np.add.reduceat(z, first) / count), count.astype(np.float64)


def _interpolated(u: Array, closed: ComplexArray) -> tuple[Array, Rate]:
    """Return the periodic cubic spline through points."""
    from scipy.interpolate import CubicSpline

    return u, CubicSpline(u, closed, bc_type="periodic")


def _smoothed(u: Array, closed: ComplexArray, count: Array, grid: float) -> tuple[Array, Rate]:
    """Return the quintic spline of least jumps whose distance from points is that of rounding.

    The error of a rounded coordinate has the variance grid^2/12, that of a mean of m less by m.
    FITPACK adds knots until the weighted squares, of two coordinates, are no more than that.
    """
    from scipy.interpolate import splev, splprep

    weight = np.sqrt(12 * np.append(count, count[0])) / grid
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a closer fit that the given knots do not allow
        (knots, coefficients, degree), _ = splprep(
            [closed.real, closed.imag], w=weight, u=u, per=True, k=5, s=2 * len(count)
        )

    def rate(at: Array, order: int) -> ComplexArray:
        x, y = splev(at, (knots, coefficients, degree), order)
        return np.asarray(x + 1j * y)

    return knots[degree:-degree], rate
