"""Rings and scenes that several tests use."""

import math

import numpy as np

import der


def scene(ring: der.Ring, h_over_t: float, nu: float = 0.3, **wants: object) -> der.Scene:
    """Return a ring of rectangular section, and what is wanted of it."""
    return der.Scene(ring, der.rectangular_section(h_over_t, nu), **wants)


def egg() -> der.Ring:
    """Return a user's ring, symmetric about the twisting axis alone."""
    s = np.arange(48) * math.pi / 24
    return der.profile(
        points=np.column_stack([(1.0 + 0.2 * np.cos(s)) * np.sin(s), -0.8 * np.cos(s)])
    )


KINKS = (  # arc length and curvature, linear between: kinks and no jump
    (0.0, 0.436205016357688),
    (0.958185759344887, 1.30861504907306),
    (1.5707963267949, 1.09051254089422),
    (2.18340689424491, 1.30861504907306),
    (3.14159265358979, 0.436205016357688),
    (4.099778412934677, 1.30861504907306),
    (4.71238898038469, 1.09051254089422),
    (5.3249995478347, 1.30861504907306),
    (6.28318530717959, 0.436205016357688),
)


def kinked() -> der.Ring:
    """Return a ring of piecewise-linear natural curvature, symmetric about both axes."""
    return der.profile(*np.transpose(KINKS))


def through_points(count: int, r) -> der.Ring:
    """Return the ring through points of the polar curve r(theta), theta from the first grip on."""
    theta = 2.0 * math.pi * np.arange(count) / count
    return der.profile(
        points=np.column_stack([r(theta) * np.sin(theta), -r(theta) * np.cos(theta)])
    )


def crescent(r, angle=1.2):
    """Two arcs about one centre, 2 r apart, joined by half circles: thin, and bent."""
    ends = np.cumsum([0.0, angle, math.pi * r, (1.0 - 2.0 * r) * angle])
    s, k = np.repeat(ends, 2)[1:-1], np.repeat([1.0, 1.0 / r, -1.0 / (1.0 - 2.0 * r)], 2)
    return der.profile(np.append(s, 2.0 * ends[-1] - s[::-1]), np.append(k, k[::-1]))
