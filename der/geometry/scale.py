"""Physical numbers: a scene from numbers with units, and the way back from non-dimensional ones.

Inside the package lengths are in units of a, moments and energies of GJ/a. A `Scale` knows both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from der.geometry.section import poisson_ratio, rectangular_section, torsion_constant
from der.utils.checks import positive, shown

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
FORCES = {"N": 1.0, "kN": 1e3, "mN": 1e-3, "uN": 1e-6, "lbf": 4.4482216152605}
STRESSES = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "psi": 6894.757293168361}
SI = "N,m"
THINNEST = 1e6  # a/t; above it, rounding of EA hides bending
# powers of force and length
DIMENSIONS = {"moment": (1, 1), "energy": (1, 1), "force": (1, 0), "length": (0, 1)}
_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?) ?([A-Za-zµμ]+)")


def quantity(name: str, value: object, units: Mapping[str, float], example: str) -> float:
    """Return a number > 0 that is given with its unit, such as "3.5 GPa", in SI units.

    Parameters and errors are those of `number_and_unit`.
    """
    number, unit = number_and_unit(name, value, units, example)
    return positive(name, number * units[unit])


def number_and_unit(
    name: str, value: object, units: Mapping[str, float], example: str
) -> tuple[float, str]:
    """Return a number > 0 and the unit with which it is given.

    Parameters
    ----------
    units : the units that are allowed, with their values in SI units.
    example : for the message.

    Raises
    ------
    ValueError
        If it is no such text.
    """
    found = _NUMBER.fullmatch(value.strip()) if isinstance(value, str) else None
    number = math.nan if found is None else float(found[1])
    unit = "" if found is None else re.sub("[µμ]", "u", found[2])
    if unit not in units or not 0.0 < number < math.inf:
        raise ValueError(
            f"{name} must be a number > 0 with its unit ({', '.join(units)}), such as {example}, "
            f"got {shown(value)}"
        )
    return number, unit


@dataclass(frozen=True)
class Scale:
    """The size and stiffness of a ring, and the units in which answers are shown.

    Parameters
    ----------
    a : float
        The ring's reference length, m.
    GJ : float
        Torsional stiffness of its section, N m^2.
    units : str
        Units of force and length of texts and pictures: "N,m", "N,mm", ...

    Raises
    ------
    ValueError
        If a number is not finite and > 0, a unit of moments or forces under- or overflows, or
        the units are not known.
    """

    a: float
    GJ: float
    units: str = SI

    def __post_init__(self) -> None:
        for name in ("a", "GJ"):
            object.__setattr__(self, name, positive(name, getattr(self, name)))
        for name in ("moment", "force"):
            positive(name, getattr(self, name))
        given = self.units if isinstance(self.units, str) else ""
        force, _, length = (word.strip() for word in given.partition(","))
        if force not in FORCES or length not in LENGTHS:
            raise ValueError(
                f"units must be one of force ({', '.join(FORCES)}) and one of length "
                f"({', '.join(LENGTHS)}), such as N,mm, got {shown(self.units)}"
            )
        object.__setattr__(self, "units", f"{force},{length}")

    @property
    def moment(self) -> float:
        """GJ/a, N m."""
        return self.GJ / self.a

    @property
    def energy(self) -> float:
        """GJ/a, J."""
        return self.moment

    @property
    def length(self) -> float:
        """a, m."""
        return self.a

    @property
    def force(self) -> float:
        """GJ/a^2, N."""
        return self.GJ / self.a / self.a

    def unit(self, quantity: str) -> tuple[float, str]:
        """Return a quantity's non-dimensional unit as a number of shown units, and their name.

        Parameters
        ----------
        quantity : one of `DIMENSIONS`.
        """
        force, length = self.units.split(",")
        powers = DIMENSIONS[quantity]
        factor = (self.force / FORCES[force]) ** powers[0] * (self.a / LENGTHS[length]) ** powers[1]
        if quantity == "energy" and self.units == SI:
            return factor, "J"
        return factor, " ".join(
            unit for unit, power in zip((force, length), powers, strict=True) if power
        )

    @classmethod
    def of(cls, young_modulus: float, nu: float, h: float, t: float, a: float) -> Self:
        """Return the scale of a ring with a rectangular cross-section.

        Parameters
        ----------
        young_modulus : float
            E, Pa.
        nu : float
            Poisson's ratio, in (-1, 0.5].
        h, t : float
            Height and thickness of the section, m.
        a : float
            The ring's reference length, m.

        Raises
        ------
        ValueError
            If an argument is not allowed, or a unit under- or overflows.

        Notes
        -----
        GJ = E/(2(1+nu)) J, with J of the paper's Eq. (A.8).
        """
        young_modulus = positive("young_modulus", young_modulus)
        shear_modulus = young_modulus / (2 * (1 + poisson_ratio(nu)))
        return cls(positive("a", a), shear_modulus * torsion_constant(h, t))


def dimensional(
    *, young: str, height: str, thickness: str, size: str, nu: float = 0.3, units: str = SI
) -> dict[str, Any]:
    """Return what a scene needs of a bar of rectangular section, from numbers with their units.

    ``der.Scene(ring, **der.dimensional(young="3.5 GPa", height="10 mm", thickness="1 mm",
    size="100 mm"))`` has the section, a/t and scale of this bar.

    Parameters
    ----------
    young : Young's modulus.
    height, thickness : of the section, along d1 and along d2.
    size : the ring's reference length a.
    nu : Poisson's ratio.
    units : of force and length in texts and pictures, such as "N,mm".

    Returns
    -------
    dict
        With the entries `section`, `a_over_t` and `scale` of a `Scene`.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed; a number without unit is refused.
    """
    E = quantity("young", young, STRESSES, "3.5GPa")
    h = quantity("height", height, LENGTHS, "10mm")
    t = quantity("thickness", thickness, LENGTHS, "1mm")
    a = quantity("size", size, LENGTHS, "100mm")
    if not 1.0 <= a / t <= THINNEST:
        raise ValueError(f"size must be 1 to {THINNEST:g} times the thickness, got {size!r}")
    scale = replace(Scale.of(E, nu, h, t, a), units=units)
    try:
        section = rectangular_section(h / t, nu)
    except ValueError as wrong:  # not what the user gave
        raise ValueError(f"height over thickness is too extreme: {wrong}") from None
    return {"section": section, "a_over_t": a / t, "scale": scale}
