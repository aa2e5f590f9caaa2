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


def crescent(r, angle=1.2):
    """Two arcs about one centre, 2 r apart, joined by half circles: thin, and bent."""
    ends = np.cumsum([0.0, angle, math.pi * r, (1.0 - 2.0 * r) * angle])
    s, k = np.repeat(ends, 2)[1:-1], np.repeat([1.0, 1.0 / r, -1.0 / (1.0 - 2.0 * r)], 2)
    return der.profile(np.append(s, 2.0 * ends[-1] - s[::-1]), np.append(k, k[::-1]))
