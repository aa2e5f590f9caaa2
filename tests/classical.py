"""The discrete elastic rod as its papers write it: vertices, material angles, reference frames.

Plain numpy after Bergou et al. 2008 ("Discrete elastic rods") and 2010 ("Discrete viscous
threads"), sharing nothing with the engine but the naming of the material axes: kappa1 = k . d1,
kappa2 = k . d2, with k the Darboux vector, where Bergou's pair is (k . m2, -k . m1). Slow, and
the thing that the engine's quaternions are held against. The last two functions serve the tests
of derivatives.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


class Classical(NamedTuple):
    """A rod in positions and material angles."""

    x: Array  # (n_v, 3) vertices; n_v = n_e of a ring, n_e + 1 otherwise
    a1: Array  # (n_e, 3) first vector of the reference frame, at right angles to the edge
    theta: Array  # (n_e,) material angle, from a1 towards a2 = t x a1
    ref_twist: Array  # (n_s,) unwrapped
    closed: bool


def edge_vectors(x: Array, closed: bool) -> Array:
    """Edges e (n_e, 3) from each vertex to the next."""
    return np.roll(x, -1, axis=0) - x if closed else np.diff(x, axis=0)


def unit(v: Array) -> Array:
    """Vectors (..., 3) over their lengths."""
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def dot(a: Array, b: Array) -> Array:
    """Scalar products (..., 1)."""
    return np.sum(a * b, axis=-1, keepdims=True)


def transported(v: Array, t0: Array, t1: Array) -> Array:
    """Vectors ``v`` parallel-transported from the tangents ``t0`` to ``t1`` (Bergou 2008, 4.2.2).

    The smallest rotation that takes t0 to t1: about t0 x t1, by the angle between them.
    """
    b, c = np.cross(t0, t1), dot(t0, t1)
    return c * v + np.cross(b, v) + b * dot(b, v) / (1.0 + c)


def pairs(per_edge: Array, closed: bool) -> tuple[Array, Array]:
    """Values on the edges before and after each vertex where two edges meet."""
    if closed:
        return per_edge, np.roll(per_edge, -1, axis=0)
    return per_edge[:-1], per_edge[1:]


def curvature_binormal(e0: Array, e1: Array) -> Array:
    """Kb (n_s, 3), of length 2 tan(phi/2) (Bergou 2008, Eq. 1)."""
    lengths = np.linalg.norm(e0, axis=-1, keepdims=True) * np.linalg.norm(
        e1, axis=-1, keepdims=True
    )
    return 2.0 * np.cross(e0, e1) / (lengths + dot(e0, e1))


def left_by_transport(a1: Array, t: Array, closed: bool) -> Array:
    """Angles (n_s,) from a1 carried over each vertex to the a1 that is there, in (-pi, pi]."""
    (t0, t1), (before, after) = pairs(t, closed), pairs(a1, closed)
    carried = transported(before, t0, t1)
    sine, cosine = dot(np.cross(carried, after), t1), dot(carried, after)
    return np.arctan2(sine, cosine)[:, 0]


def material_frames(rod: Classical) -> tuple[Array, Array, Array]:
    """Directors d1, d2, d3 (n_e, 3 each)."""
    t = unit(edge_vectors(rod.x, rod.closed))
    a2 = np.cross(t, rod.a1)
    c, s = np.cos(rod.theta)[:, None], np.sin(rod.theta)[:, None]
    return c * rod.a1 + s * a2, -s * rod.a1 + c * a2, t


def strains(rod: Classical, measure: str) -> Array:
    """Integrated strains kappa1, kappa2, twist (n_s, 3)."""
    d1, d2, t = material_frames(rod)
    if measure == "logarithm":
        before, after = pairs(np.stack([d1, d2, t], axis=-1), rod.closed)
        return Rotation.from_matrix(before.swapaxes(1, 2) @ after).as_rotvec()
    kb = curvature_binormal(*pairs(edge_vectors(rod.x, rod.closed), rod.closed))
    theta_before, theta_after = pairs(rod.theta, rod.closed)
    twist = theta_after - theta_before + rod.ref_twist
    if measure == "angle":  # the turning angle instead of twice the tangent of its half
        size = np.linalg.norm(kb, axis=1, keepdims=True)
        kb = kb * (2.0 * np.arctan(0.5 * size) / size)
    # averages of the directors of both edges (Bergou 2010, Eq. 3)
    kappa = [dot(kb, 0.5 * sum(pairs(d, rod.closed)))[:, 0] for d in (d1, d2)]
    return np.column_stack([*kappa, twist])


def energies(
    rod: Classical, measure: str, rest: Array, stiffness: tuple[float, float, float], cell: Array
) -> Array:
    """Energies (n_s,): sum_k stiffness_k (strain_k - rest_k)^2/(2 voronoi length)."""
    return 0.5 * (strains(rod, measure) - rest) ** 2 @ np.array(stiffness) / cell


def moved(rod: Classical, dx: Array, dtheta: Array) -> Classical:
    """Rod with vertices and angles moved; reference frames carried in time (Bergou 2010, 4)."""
    x = rod.x + dx
    t0, t1 = (unit(edge_vectors(y, rod.closed)) for y in (rod.x, x))
    a1 = transported(rod.a1, t0, t1)
    change = left_by_transport(a1, t1, rod.closed) - rod.ref_twist
    ref_twist = rod.ref_twist + np.angle(np.exp(1j * change))
    return Classical(x, a1, rod.theta + dtheta, ref_twist, rod.closed)


def regauged(rod: Classical, turn: Array) -> Classical:
    """Rod as it is in other reference frames, each turned by ``turn`` (n_e,) about its edge."""
    a1, _, _ = material_frames(rod._replace(theta=turn))
    before, after = pairs(turn, rod.closed)
    return rod._replace(a1=a1, theta=rod.theta - turn, ref_twist=rod.ref_twist + after - before)


def bent_and_twisted(rng: np.random.Generator, n_e: int, *, closed: bool) -> Classical:
    """Random rod, turning by up to some 100 degrees at a vertex, in random reference frames."""
    if closed:
        s = 2.0 * np.pi * np.arange(n_e) / n_e
        x = np.column_stack([0.0 * s, np.sin(s), -np.cos(s)])
        x += rng.uniform(-0.25, 0.25, size=x.shape)
    else:
        t = unit(rng.normal(size=(1, 3)))
        for _ in range(n_e - 1):
            t = np.vstack([t, unit(t[-1:] + rng.uniform(-0.8, 0.8, size=(1, 3)))])
        x = np.vstack([np.zeros(3), np.cumsum(rng.uniform(0.5, 1.5, size=(n_e, 1)) * t, axis=0)])
    t = unit(edge_vectors(x, closed))
    a1 = unit(np.cross(t, rng.normal(size=t.shape)))
    ref_twist = left_by_transport(a1, t, closed)
    theta = np.zeros(n_e)
    theta[1:] = np.cumsum(rng.uniform(-1.5, 1.5, size=n_e - 1) - ref_twist[: n_e - 1])
    if closed:  # what is missing at the last vertex, shared among all
        missing = np.angle(np.exp(1j * (theta[0] - theta[-1] + ref_twist[-1])))
        theta += missing * np.arange(n_e) / n_e
    before, after = pairs(theta, closed)
    turns = np.round((after - before + ref_twist) / (2.0 * np.pi))
    return Classical(x, a1, theta, ref_twist - 2.0 * np.pi * turns, closed)


def quaternions(rod: Classical) -> Array:
    """Material frames (n_e, 4) as the engine keeps them, in arbitrary signs."""
    xyzw = Rotation.from_matrix(np.stack(material_frames(rod), axis=-1)).as_quat()
    return np.ascontiguousarray(np.roll(xyzw, 1, axis=1))


def spun(quat: Array, w: Array) -> Array:
    """Frames (n, 4) turned by the rotation vector(s) ``w`` given in the global basis."""
    xyzw = (Rotation.from_rotvec(w) * Rotation.from_quat(np.roll(quat, -1, axis=1))).as_quat()
    return np.ascontiguousarray(np.roll(xyzw, 1, axis=1))


def difference(f: Callable[[float], Any], h: float = 1e-3) -> Any:
    """Slope of ``f`` at 0 by the central stencil of fourth order: error h^4 f'''''/30."""
    return (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)


def right_jacobian(w: Array) -> Array:
    """J (3, 3) of exp(w + v) = exp(w) o exp(J v) + O(v^2), rotation vectors w, v."""
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return np.eye(3)
    X = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    first = 2.0 * np.sin(0.5 * angle) ** 2 / angle**2
    # (angle - sin angle)/angle^3, by its series where the difference would lose digits
    second = 1.0 / 6.0 - angle**2 / 120.0
    if angle > 0.01:
        second = (angle - np.sin(angle)) / angle**3
    return np.eye(3) - first * X + second * X @ X
