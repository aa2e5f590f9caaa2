"""The ring by PyElastica, a Cosserat rod in explicit dynamics, where that is installed.

The closed ring has n straight elements, and two of them are the grips: their frames and the
transverse positions of their nodes are prescribed, and they slide along the axis. The grips turn at
a constant rate and are held until the damped ring is at rest. Statics do not depend on mass,
inertia or damping, so these are chosen for speed. The inertia of the section is so large that its
own frequencies do not limit the time step, and the damping is near critical for the slowest mode.
Stretch and shear are those of a ring with a/t = 30 instead of 200. That allows time steps nearly 7
times longer and changes M by 2e-5; the error of discretisation is larger at every n used.

Source: Gazzola, Dudte, McCormick, Mahadevan (2018), R. Soc. Open Sci. 5, 171628; PyElastica, PyPI.
"""

from __future__ import annotations

import math
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numba import njit

import der
from der.bvp.gauss import Array

A_OVER_T = 30.0
INERTIA = 0.4  # a, radius of a disk with the inertia of the section
DAMPING = 2.0  # 1/T, T = a^2 sqrt(mass per length / GJ)
RAMP = 10.0  # T, time in which the grips turn
REST = 1e-6  # a/T: no node moves faster once the ring is at rest
PATIENCE = 200.0  # T
COURANT = 0.9


def installed() -> str:
    """PyElastica's version; empty where it is not installed."""
    try:
        return version("pyelastica")
    except PackageNotFoundError:
        return ""


def moment(section: der.Section, n: int, gamma: float) -> float:
    """Moment M of one arm [GJ/a] of a circle of ``n`` elements turned to ``gamma`` and at rest.

    Raises
    ------
    ValueError
        If it does not come to rest.
    """
    import elastica

    # of the fastest motions, stretching of an element and its turning against shear
    length = 1.0 / math.hypot(n / (2.0 * math.pi), 1.0 / INERTIA)
    step = COURANT * length / math.sqrt(_stiff(section))
    ring, collection = _ring(section, n, gamma, step)
    stepper, time = elastica.PositionVerlet(), 0.0
    while time < PATIENCE:
        for _ in range(round(1.0 / step)):
            time = stepper.step(collection, time, step)
        speed = float(np.abs(ring.velocity_collection).max())
        if not math.isfinite(speed):
            break
        if time > RAMP and speed < REST:
            return _moment(ring, collection, n)
    raise ValueError(f"n must be a ring that comes to rest, got {n}: speed {speed:.1e} at the end")


def _stiff(section: der.Section) -> float:
    """Stretch and shear stiffness, GJ/a^2."""
    return 12.0 * section.alpha * A_OVER_T**2


def _ring(section: der.Section, n: int, gamma: float, step: float) -> tuple[Any, Any]:
    """The ring between its grips, and the collection that steps it."""
    import elastica

    parts: Any = (elastica.BaseSystemCollection, elastica.Constraints, elastica.Damping)

    class Collection(*parts):  # type: ignore[misc]
        """The system that PyElastica steps."""

    places, frames = _polygon(n)
    ring = elastica.CosseratRod.ring_rod(
        n,
        np.zeros(3),
        np.array([0.0, 1.0, 0.0]),
        np.array([1.0, 0.0, 0.0]),
        2.0 * math.pi,
        INERTIA,
        1.0 / (math.pi * INERTIA**2),  # unit mass per length
        youngs_modulus=1.0,
        shear_modulus=1.0,
        position=places,
        directors=frames,
    )
    for k, stiffness in enumerate((section.alpha, section.beta, 1.0)):
        ring.bend_matrix[k, k, :] = stiffness
        ring.shear_matrix[k, k, :] = _stiff(section)
    collection = Collection()
    collection.append(ring)
    grip = _grip()
    for edge, sign in ((0, 1.0), (n // 2, -1.0)):
        collection.constrain(ring).using(grip, edge, sign * gamma)
    collection.dampen(ring).using(
        elastica.AnalyticalLinearDamper, uniform_damping_constant=DAMPING, time_step=step
    )
    collection.finalize()
    _forces(collection)
    ring.rest_kappa[:] = ring.kappa
    return ring, collection


def _polygon(n: int) -> tuple[Array, Array]:
    """Nodes (3, n) and frames (3, 3, n) of the flat ring, grips in the middle of two elements."""
    radius = math.pi / n / math.sin(math.pi / n)  # sides as long as the circle's arcs
    angle = (np.arange(n) - 0.5) * 2.0 * math.pi / n
    x = radius * np.array([np.zeros(n), np.sin(angle), -np.cos(angle)])
    d3 = np.roll(x, -1, axis=1) - x
    d3 /= np.linalg.norm(d3, axis=0)
    d1 = np.zeros((3, n))
    d1[0] = 1.0  # the height, across the plane of the ring
    d2 = np.cross(d3.T, d1.T).T
    return x, np.array([d1, d2, d3])


def _grip() -> type:
    """The constraint class of a grip; it is made here because its base is PyElastica's."""
    import elastica

    class Grip(elastica.ConstraintBase):  # type: ignore[misc]
        """An element that turns about the third axis and slides along it."""

        def __init__(self, edge: int, gamma: float, **given: Any) -> None:
            super().__init__(**given)
            x = self._system.position_collection
            self.edge, self.gamma = edge, gamma
            self.frame = self._system.director_collection[:, :, edge].copy()
            self.half = 0.5 * (x[:, edge + 1] - x[:, edge])

        def constrain_values(self, system: Any, time: float) -> None:
            angle = self.gamma * min(1.0, float(time) / RAMP)
            _place(
                system.position_collection,
                system.director_collection,
                self.edge,
                angle,
                self.half,
                self.frame,
            )

        def constrain_rates(self, system: Any, time: float) -> None:
            _stop(system.velocity_collection, system.omega_collection, self.edge)

    return Grip


@njit(cache=True)
def _place(x, frames, edge, angle, half, frame):
    """Put a grip's nodes and frame, flat at ``half`` and ``frame``, where the angle [rad] says."""
    c, s = math.cos(angle), math.sin(angle)
    aside, along = c * half[0] - s * half[1], s * half[0] + c * half[1]
    x[0, edge], x[0, edge + 1] = -aside, aside
    x[1, edge], x[1, edge + 1] = -along, along
    for k in range(3):
        frames[k, 0, edge] = c * frame[k, 0] - s * frame[k, 1]
        frames[k, 1, edge] = s * frame[k, 0] + c * frame[k, 1]
        frames[k, 2, edge] = frame[k, 2]


@njit(cache=True)
def _stop(velocity, omega, edge):
    """Set the velocities of a grip to zero, except that along the axis."""
    for k in range(3):
        omega[k, edge] = 0.0
    for k in range(2):
        velocity[k, edge] = velocity[k, edge + 1] = 0.0


def _forces(collection: Any) -> None:
    """Compute internal forces and couples of the present configuration."""
    for system in collection.final_systems():
        system.compute_internal_forces_and_torques(0.0)


def _moment(ring: Any, collection: Any, n: int) -> float:
    """Half of the moment of the ring on a grip about the axis, mean of both grips."""
    _forces(collection)
    total = 0.0
    for edge, sign in ((0, 1.0), (n // 2, -1.0)):
        couple = ring.director_collection[:, :, edge].T @ ring.internal_torques[:, edge]
        x = ring.position_collection[:, edge : edge + 2]
        force = ring.internal_forces[:, edge : edge + 2]
        arm = x[0] * force[1] - x[1] * force[0]
        total -= sign * float(couple[2] + arm.sum())
    return 0.25 * total
