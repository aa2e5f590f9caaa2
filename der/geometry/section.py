"""Cross-sections: the stiffness ratios alpha and beta.

Inside the package a section is two numbers, alpha = EI1/GJ and beta = EI2/GJ; lengths are in units
of the ring's reference length a, moments and energies in units of GJ/a.
"""

import math
from dataclasses import dataclass

from der.utils.checks import checked_number, positive

SPREAD = 1e10  # of the stiffnesses, GJ among them: beyond, rounding of one hides another
ODD_ZETA_5 = 31 / 32 * 1.0369277551433699  # sum of 1/(2n-1)^5 over n >= 1, with zeta(5)


def poisson_ratio(value: object) -> float:
    """Return Poisson's ratio, checked."""
    return checked_number("nu", value, "a number in (-1, 0.5]", lambda number: -1 < number <= 0.5)


@dataclass(frozen=True)
class Section:
    """A cross-section, as its ratios of bending to torsional stiffness.

    Parameters
    ----------
    alpha : float
        EI1/GJ, bending about d1: in the plane of the natural ring.
    beta : float
        EI2/GJ, bending about d2: out of that plane.
    h_over_t : float, optional
        Height (along d1) over thickness (along d2), where the section is a rectangle.
    nu : float, optional
        Poisson's ratio, where known.

    Raises
    ------
    ValueError
        If a number is not finite, a ratio not > 0, nu outside (-1, 0.5], or the largest of alpha,
        beta and 1 more than 1e10 times the smallest.
    """

    alpha: float
    beta: float
    h_over_t: float | None = None
    nu: float | None = None

    def __post_init__(self) -> None:
        checked: dict[str, float] = {
            "alpha": positive("alpha", self.alpha),
            "beta": positive("beta", self.beta),
        }
        if self.h_over_t is not None:
            checked["h_over_t"] = positive("h_over_t", self.h_over_t)
        if self.nu is not None:
            checked["nu"] = poisson_ratio(self.nu)
        for name, number in checked.items():
            object.__setattr__(self, name, number)
        if not max(self.alpha, self.beta, 1.0) <= SPREAD * min(self.alpha, self.beta, 1.0):
            farther = abs(math.log(self.alpha)) >= abs(math.log(self.beta))
            name, other = ("alpha", "beta") if farther else ("beta", "alpha")
            raise ValueError(
                f"{name} must be such that alpha, beta and 1 are within a factor of {SPREAD:g}, "
                f"got {getattr(self, name)!r} and {other} = {getattr(self, other)!r}"
            )


def section(alpha: float, beta: float) -> Section:
    """Return the section of given stiffness ratios.

    Parameters
    ----------
    alpha, beta : float
        EI1/GJ and EI2/GJ, > 0.

    Returns
    -------
    Section
        With `h_over_t` and `nu` unknown.

    Raises
    ------
    ValueError
        If a ratio is not a finite number > 0.
    """
    return Section(alpha, beta)


def rectangular_section(h_over_t: float, nu: float = 0.3) -> Section:
    """Return the section of a rectangular bar.

    Parameters
    ----------
    h_over_t : float
        Height (along d1, normal to the ring's plane) over thickness (along d2), > 0.
    nu : float
        Poisson's ratio, in (-1, 0.5].

    Returns
    -------
    Section
        alpha = (1+nu)/(2 lambda) and beta = alpha (h/t)^2.

    Raises
    ------
    ValueError
        If `h_over_t` or `nu` is not allowed, or so extreme that a ratio overflows.

    Notes
    -----
    Paper, Eq. (A.16).
    """
    h_over_t = positive("h_over_t", h_over_t)
    nu = poisson_ratio(nu)
    # The ratio of the softer bending stiffness to GJ; a bar on its side has h and t exchanged.
    softer = (1 + nu) / (2 * _torsion_factor(max(h_over_t, 1 / h_over_t)))
    if h_over_t >= 1:
        alpha, beta = softer, softer * h_over_t * h_over_t
    else:
        alpha, beta = softer / h_over_t / h_over_t, softer
    return Section(alpha, beta, h_over_t, nu)


def torsion_constant(h: float, t: float) -> float:
    """Return J of a rectangle of height h and thickness t, in the fourth power of their unit.

    Notes
    -----
    Paper, Eq. (A.8); J does not change when h and t are exchanged.
    """
    thickness, width = sorted((positive("h", h), positive("t", t)))
    return width * thickness * thickness * thickness / 3 * _torsion_factor(width / thickness)


def _torsion_factor(width_over_thickness: float) -> float:
    """Return lambda of Eq. (A.16), with J = (width) (thickness)^3 lambda / 3, for ratios >= 1.

    The tanh are 1 but for a part that falls by exp(-2 pi) or faster from term to term, so that five
    terms reach rounding where the plain series takes hundreds.
    """
    defect = 0.0
    for odd in (1, 3, 5, 7, 9):
        decay = math.exp(-math.pi * odd * width_over_thickness)
        defect += 2 * decay / (1 + decay) / odd**5  # 1 - tanh(x) = 2 e^-2x / (1 + e^-2x)
    return 1 - 192 / math.pi**5 / width_over_thickness * (ODD_ZETA_5 - defect)
