"""A scene: a ring, its section, and how its path is computed. No kernels."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import wraps
from numbers import Integral

from der.geometry.ring import Ring
from der.geometry.scale import THINNEST, Scale
from der.geometry.section import Section
from der.utils.checks import checked_number, one_of, optional, positive, shown, truth

MEASURES = ("logarithm", "angle", "tangent")  # of curvature, see strain.py
CONTROLS = ("arclength", "angle", "moment")
SOLVERS = ("newton", "relaxation")
STRETCH = ("inextensible", "finite")
COPIES = {"full": 1, "half": 2, "quarter": 4}  # how many of a sector make the ring

_STATED = (("ring", Ring, "circle()"), ("section", Section, "rectangular_section(4.0)"))

FARTHEST = 10.0 * math.pi  # rad: gamma_max of more is taken for degrees
UNFOLDED = 4.0 * math.pi  # rad: a path that is followed until it folds, at pi, ends there
FEWEST_EDGES = 8
MOST_EDGES = 65_536
CROSSINGS_UP_TO = 1024  # edges; the writhe that finds self-crossings costs O(N^2)


@dataclass(frozen=True)
class Scene:
    """A ring that is folded by twisting, and how its path is computed.

    Parameters
    ----------
    ring : the closed planar shape with its grips, from `circle` and its like.
    section : stiffness ratios, from `rectangular_section` or `section`.
    n_edges : edges of the full ring; even, and divisible by 4 where a quarter is solved.
    sector : the symmetry sector that is solved: "full", "half", "quarter", or "auto", the smallest
        that the ring has.
    stability : whether to compute the index of the full ring at every state.
    self_crossings : whether to look for states where the ideal curve passes through itself; None:
        up to 1024 edges. (Its old name, ``contacts``, is accepted with a DeprecationWarning.)
    error_bars : whether to solve on N/2 and N/4 edges, too, and to extrapolate. The path then holds
        extrapolated values with their errors. N must be at least 32, and divisible by 16 on a
        quarter, by 8 otherwise.
    shapes : whether to keep vertices and frames of every state.
    history : whether to keep how the ring moves in each snap; needs ``shapes``.
    modes : whether to compute the softest mode of each symmetry at every state; needs ``shapes``.
    forces : whether to keep the forces and moments of the grips and in the arms; with ``shapes``
        also force, moment and strains along the ring.
    control : "arclength" follows the path of equilibria through its folds. "angle" turns the grips,
        "moment" raises a dead moment: each state is then a minimum, and the ring snaps where the
        minimum ends.
    unload : with angle or moment control, return to gamma = 0 afterwards. A dead moment is
        lowered from that of the ring at ``gamma_max``, through 0 where the folded ring is stable,
        and the ring ends where gamma stops at 0.
    solver : "newton", or "relaxation": the march of the angle by dynamic relaxation alone.
    gamma_max : the path ends at its first arrival there [rad], at most 10 pi.
    until : "folded": the path ends at the three-covered state at pi, even if it first passes pi
        and turns back; ``gamma_max`` then ends it only where it is above pi. Without it, the path
        is given up, as not converged, where gamma leaves -4 pi to 4 pi.
    save_at : values of gamma at which states are solved for [rad]; None: multiples of pi/8.
    curvature : measure of curvature, one of `MEASURES`.
    stretch : "inextensible", or "finite": EA = 12 EI1 (a_over_t / a)^2, a rectangular section's.
    a_over_t : reference length over thickness; matters for finite stretch and for drawing.
    tolerance : of the residual of an equilibrium, GJ/a.
    scale : the ring's size and stiffness, where texts and pictures are to have units; see
        `dimensional`.
    finest : edges of the finest of several meshes, a multiple of ``n_edges``: the frames of this
        one are among those of the finest, as extrapolation needs them; None: ``n_edges``.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed.
    """

    ring: Ring
    section: Section
    _: KW_ONLY
    n_edges: int = 64
    sector: str = "auto"
    stability: bool = True
    self_crossings: bool | None = None
    error_bars: bool = False
    shapes: bool = False
    history: bool = False
    modes: bool = False
    forces: bool = False
    control: str = "arclength"
    unload: bool = False
    solver: str = "newton"
    gamma_max: float = math.pi
    until: str | None = None
    save_at: Sequence[float] | None = None
    curvature: str = "logarithm"
    stretch: str = "inextensible"
    a_over_t: float = 200.0
    tolerance: float = 1e-10
    scale: Scale | None = None
    finest: int | None = None

    def __post_init__(self) -> None:
        for name, kind, like in _STATED:
            if not isinstance(value := getattr(self, name), kind):
                wanted = f"a der.{kind.__name__} such as der.{like}"
                raise ValueError(f"{name} must be {wanted}, got {shown(value)}")
        self._replace("n_edges", _integer)
        self._replace("finest", optional(_integer))
        if self.finest is not None and self.finest % self.n_edges:
            raise ValueError(f"finest must be a multiple of {self.n_edges}, got {self.finest!r}")
        sector = sector_name(self.ring, self.sector, self.n_edges)
        for name in ("stability", "error_bars", "shapes", "history", "modes", "forces", "unload"):
            self._replace(name, truth)
        if self.error_bars:
            meshes(self.n_edges, sector)
        for name in ("history", "modes"):
            if getattr(self, name) and not self.shapes:
                raise ValueError(f"{name} must come with shapes, got shapes=False")
        self._replace("self_crossings", optional(truth))
        if not isinstance(self.scale, Scale | None):
            raise ValueError(f"scale must be a der.Scale or None, got {shown(self.scale)}")
        self._check_control()
        one_of("curvature", self.curvature, MEASURES)
        one_of("stretch", self.stretch, STRETCH)
        if self.until is not None:
            one_of("until", self.until, ("folded",))
        for name in ("gamma_max", "a_over_t", "tolerance"):
            self._replace(name, positive)
        if self.gamma_max > FARTHEST:
            radians = f"{self.gamma_max:g} degrees are {math.radians(self.gamma_max):.10g}"
            raise ValueError(
                f"gamma_max must be at most 10 pi, in radians ({radians}), got {self.gamma_max!r}"
            )
        if not 1.0 <= self.a_over_t <= THINNEST:
            raise ValueError(f"a_over_t must be from 1 to {THINNEST:g}, got {self.a_over_t!r}")
        if self.tolerance > 1e-4:
            raise ValueError(f"tolerance must be at most 1e-4, got {self.tolerance!r}")
        if self.until == "folded" and self.gamma_max < math.pi:
            raise ValueError(
                f"gamma_max must be at least pi where until is 'folded', got {self.gamma_max!r}"
            )
        if self.save_at is not None:
            self._check_save_at(self.save_at)

    def _replace(self, name: str, check: Callable[[str, object], object]) -> None:
        """Replace what was given by what a check makes of it."""
        object.__setattr__(self, name, check(name, getattr(self, name)))

    def _check_control(self) -> None:
        one_of("control", self.control, CONTROLS)
        one_of("solver", self.solver, SOLVERS)
        for what, asked, setting, allowed in (
            ("unload", self.unload, "control", ("angle", "moment")),
            ("solver 'relaxation'", self.solver == "relaxation", "control", ("angle",)),
            ("modes", self.modes, "solver", ("newton",)),
            ("until", self.until is not None, "control", ("arclength",)),
            ("error_bars", self.error_bars, "control", ("arclength",)),
        ):
            if asked and (value := getattr(self, setting)) not in allowed:
                words = " or ".join(map(repr, allowed))
                raise ValueError(f"{what} must come with {setting} {words}, got {value!r}")

    def _check_save_at(self, values: Sequence[float]) -> None:
        last = math.inf if self.until == "folded" else self.gamma_max
        allowed = "numbers >= 0" if last == math.inf else f"numbers from 0 to gamma_max = {last}"
        try:
            given = None if isinstance(values, str) else list(values)
        except TypeError:  # nothing to iterate over, or an array of no dimension
            given = None
        if given is None:
            raise ValueError(f"save_at must be a sequence of {allowed}, got {shown(values)}")
        gammas = {
            checked_number("save_at", gamma, allowed, lambda g: 0.0 <= g <= last) for gamma in given
        }
        object.__setattr__(self, "save_at", tuple(sorted(gammas)))

    @property
    def stretching(self) -> float:
        """EA in GJ/a^2; 0 for an inextensible ring."""
        return 12.0 * self.section.alpha * self.a_over_t**2 if self.stretch == "finite" else 0.0

    @property
    def last_gamma(self) -> float:
        """The path ends at this gamma, or at its negative, at the latest [rad]."""
        return UNFOLDED if self._without_end else self.gamma_max

    @property
    def _without_end(self) -> bool:
        return self.until == "folded" and self.gamma_max <= math.pi

    def unfolded(self, gamma: float) -> bool:
        """Whether a path that should have ended folded is given up at this gamma."""
        return self._without_end and abs(gamma) == UNFOLDED

    @property
    def looks_for_self_crossings(self) -> bool:
        """Whether states where the curve passes through itself are looked for."""
        if self.self_crossings is None:
            return self.n_edges <= CROSSINGS_UP_TO
        return self.self_crossings

    @property
    def contacts(self) -> bool | None:
        """Old name of `self_crossings`."""
        _warn_of_contacts()
        return self.self_crossings


def _accepting_contacts(init: Callable[..., None]) -> Callable[..., None]:
    """`Scene.__init__` that takes ``self_crossings`` by its old name, too."""

    @wraps(init)
    def accepting(scene: Scene, *given: object, **named: object) -> None:
        if "contacts" in named:
            _warn_of_contacts()
            named["self_crossings"] = named.pop("contacts")
        init(scene, *given, **named)

    return accepting


def _warn_of_contacts() -> None:
    text = "contacts of a der.Scene is now called self_crossings"
    warnings.warn(text, DeprecationWarning, stacklevel=3)


Scene.__init__ = _accepting_contacts(Scene.__init__)  # type: ignore[method-assign]


def sector_name(ring: Ring, name: str, n_edges: int) -> str:
    """The sector that ``name`` means; checks that the ring has it, and that the edges divide.

    Raises
    ------
    ValueError
        Naming the argument, its value and what is allowed.
    """
    one_of("sector", name, ("auto", *COPIES))
    if name == "auto":
        name = "quarter" if ring.symmetry == "D2" else "half"
    if name == "quarter" and ring.symmetry != "D2":
        raise ValueError(f"sector must be auto, half or full for a {ring.shape}, got 'quarter'")
    divisor = 4 if name == "quarter" else 2
    if n_edges % divisor or not FEWEST_EDGES <= n_edges <= MOST_EDGES:
        raise ValueError(
            f"n_edges must be from {FEWEST_EDGES} to {MOST_EDGES} and divisible by {divisor}"
            f" for the sector {name!r}, got {shown(n_edges)}"
        )
    return name


def meshes(n_edges: int, sector: str) -> tuple[int, int, int]:
    """Edges of the full ring at the three levels.

    Parameters
    ----------
    sector : "full", "half" or "quarter"; "auto" is resolved before (`sector_name`).

    Raises
    ------
    ValueError
        Where N/4 edges are too few or do not divide into the sector.
    """
    divisor = 4 * (4 if sector == "quarter" else 2)
    if n_edges % divisor or n_edges < 32:
        raise ValueError(
            f"n_edges must be at least 32 and divisible by {divisor} for error bars on the sector"
            f" {sector!r} (they need N/2 and N/4 edges), got {n_edges}"
        )
    return n_edges, n_edges // 2, n_edges // 4


def _integer(name: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise ValueError(f"{name} must be an integer, got {shown(value)}")
    return int(value)
