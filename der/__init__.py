"""Discrete elastic rods for rings that fold by twisting.

    scene = der.Scene(der.circle(), der.rectangular_section(h_over_t=4))
    path = der.fold(scene)   # arrays gamma, moment, energy, index; points; at_pi; mode

Names are imported when they are first used, so that ``import der`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from der.folding import fold
    from der.landscape_push import least_push
    from der.planar_record import PlanarState, PlanarStates, Squeeze, SqueezePoint
    from der.planar_squeeze import squeeze
    from der.planar_states import planar
    from der.record import Path, Point
    from der.ring import Ring, circle, ellipse, profile, rectangle, triangle
    from der.scene import Scene
    from der.sections import Scale, Section, rectangular_section, section
    from der.shapes import Shapes
    from der.states_record import RingState, States, Transition
    from der.states_search import states
    from der.unfinished import Interrupted, NotConverged

__all__ = [
    "Interrupted",
    "NotConverged",
    "Path",
    "PlanarState",
    "PlanarStates",
    "Point",
    "Ring",
    "RingState",
    "Scale",
    "Scene",
    "Section",
    "Shapes",
    "Squeeze",
    "SqueezePoint",
    "States",
    "Transition",
    "circle",
    "ellipse",
    "fold",
    "least_push",
    "planar",
    "profile",
    "rectangle",
    "rectangular_section",
    "section",
    "squeeze",
    "states",
    "triangle",
]

_HOME = {
    "folding": ("fold",),
    "landscape_push": ("least_push",),
    "planar_record": ("PlanarState", "PlanarStates", "Squeeze", "SqueezePoint"),
    "planar_squeeze": ("squeeze",),
    "planar_states": ("planar",),
    "record": ("Path", "Point"),
    "ring": ("Ring", "circle", "ellipse", "profile", "rectangle", "triangle"),
    "scene": ("Scene",),
    "sections": ("Scale", "Section", "rectangular_section", "section"),
    "shapes": ("Shapes",),
    "states_record": ("RingState", "States", "Transition"),
    "states_search": ("states",),
    "unfinished": ("Interrupted", "NotConverged"),
}


def __getattr__(name: str) -> Any:
    for module, names in _HOME.items():
        if name in names:
            value = getattr(import_module(f"der.{module}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'der' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
