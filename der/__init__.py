"""Discrete elastic rods for rings that fold by twisting.

    scene = der.Scene(der.circle(), der.rectangular_section(h_over_t=4))
    path = der.fold(scene)   # arrays gamma, moment, energy, index; points; at_pi; mode
    path.save("path.json")
    path.plot("path.png")

A function takes a scene, or a ring, and returns a record. Names are imported when they are first
used, so that ``import der`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from der.analysis.compare import compare
    from der.analysis.fold import fold
    from der.analysis.landscape.barrier import barrier
    from der.analysis.landscape.landscape import landscape
    from der.analysis.landscape.opening import least_push
    from der.analysis.landscape.surface import energy_surface
    from der.analysis.multistability.states import states
    from der.analysis.planar.planar_states import planar
    from der.analysis.planar.squeeze import squeeze
    from der.bvp.planar.packing import packing_ratio
    from der.bvp.solve import solve_bvp
    from der.continuation.arclength import follow
    from der.continuation.events import Events
    from der.diagram.diagram import PhaseDiagram, phase_diagram
    from der.errors import Interrupted, NotConverged, Reason
    from der.geometry.ring import Ring
    from der.geometry.scale import Scale, dimensional
    from der.geometry.section import Section, rectangular_section, section
    from der.geometry.shapes import circle, ellipse, profile, rectangle, triangle
    from der.problem import Options
    from der.records.barriers import BarrierCurves
    from der.records.comparison import ComparedPoint, ComparedState, Comparison
    from der.records.configurations import Shapes
    from der.records.energy_surface import Surface
    from der.records.landscape import Barriers, Landscape, Pass, Rest, Saddle
    from der.records.opening import Instant, LeastPush, Push
    from der.records.path import AtPi, Mode, Path, Point, Timing
    from der.records.planar import PlanarState, PlanarStates, Squeeze, SqueezePoint
    from der.records.states import RingState, States, Transition
    from der.rod.rod import discrete_rod, straight
    from der.rod.supports import supported
    from der.rod.system import RodSystem
    from der.scene import Scene

# fmt: off
__all__ = [
    "AtPi", "BarrierCurves", "Barriers", "ComparedPoint", "ComparedState", "Comparison",
    "Events", "Instant", "Interrupted", "Landscape", "LeastPush", "Mode", "NotConverged",
    "Options", "Pass", "Path", "PhaseDiagram", "PlanarState", "PlanarStates", "Point", "Push",
    "Reason", "Rest", "Ring", "RingState", "RodSystem", "Saddle", "Scale", "Scene", "Section",
    "Shapes", "Squeeze", "SqueezePoint", "States", "Surface", "Timing", "Transition",
    "__version__", "barrier", "circle", "compare", "dimensional", "discrete_rod", "ellipse",
    "energy_surface", "fold", "follow", "landscape", "least_push", "packing_ratio",
    "phase_diagram", "planar", "profile", "rectangle", "rectangular_section", "section",
    "solve_bvp", "squeeze", "states", "straight", "supported", "triangle",
]
# fmt: on

_NAMES = {  # by the module where they live
    "der.analysis.compare": "compare",
    "der.analysis.fold": "fold",
    "der.analysis.landscape.barrier": "barrier",
    "der.analysis.landscape.landscape": "landscape",
    "der.analysis.landscape.opening": "least_push",
    "der.analysis.landscape.surface": "energy_surface",
    "der.analysis.multistability.states": "states",
    "der.analysis.planar.planar_states": "planar",
    "der.analysis.planar.squeeze": "squeeze",
    "der.bvp.planar.packing": "packing_ratio",
    "der.bvp.solve": "solve_bvp",
    "der.continuation.arclength": "follow",
    "der.continuation.events": "Events",
    "der.diagram.diagram": "PhaseDiagram phase_diagram",
    "der.errors": "Interrupted NotConverged Reason",
    "der.geometry.ring": "Ring",
    "der.geometry.scale": "Scale dimensional",
    "der.geometry.section": "Section rectangular_section section",
    "der.geometry.shapes": "circle ellipse profile rectangle triangle",
    "der.problem": "Options",
    "der.records.barriers": "BarrierCurves",
    "der.records.comparison": "ComparedPoint ComparedState Comparison",
    "der.records.configurations": "Shapes",
    "der.records.energy_surface": "Surface",
    "der.records.landscape": "Barriers Landscape Pass Rest Saddle",
    "der.records.opening": "Instant LeastPush Push",
    "der.records.path": "AtPi Mode Path Point Timing",
    "der.records.planar": "PlanarState PlanarStates Squeeze SqueezePoint",
    "der.records.states": "RingState States Transition",
    "der.rod.rod": "discrete_rod straight",
    "der.rod.supports": "supported",
    "der.rod.system": "RodSystem",
    "der.scene": "Scene",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("ring-origami")
    if name not in _HOME:
        raise AttributeError(f"module 'der' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
