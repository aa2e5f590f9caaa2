"""Discrete elastic rods for rings that fold by twisting.

    scene = der.Scene(der.circle(), der.rectangular_section(h_over_t=4))
    path = der.fold(scene)   # arrays gamma, moment, energy, index; points; at_pi; mode

Names are imported when they are first used, so that ``import der`` costs nothing.
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
    from der.bvp.packing import packing_ratio
    from der.bvp.solve import solve_bvp
    from der.diagram.diagram import phase_diagram
    from der.errors import Interrupted, NotConverged
    from der.geometry.ring import Ring
    from der.geometry.section import Scale, Section, rectangular_section, section
    from der.geometry.shapes import circle, ellipse, profile, rectangle, triangle
    from der.records.comparison import Comparison
    from der.records.configurations import Shapes
    from der.records.energy_surface import Surface
    from der.records.landscape import BarrierCurves, Landscape, Pass
    from der.records.opening import LeastPush
    from der.records.path import Path, Point
    from der.records.planar import PlanarState, PlanarStates, Squeeze, SqueezePoint
    from der.records.states import RingState, States, Transition
    from der.scene import Scene

__all__ = [
    "BarrierCurves",
    "Comparison",
    "Interrupted",
    "Landscape",
    "LeastPush",
    "NotConverged",
    "Pass",
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
    "Surface",
    "Transition",
    "__version__",
    "barrier",
    "circle",
    "compare",
    "ellipse",
    "energy_surface",
    "fold",
    "landscape",
    "least_push",
    "packing_ratio",
    "phase_diagram",
    "planar",
    "profile",
    "rectangle",
    "rectangular_section",
    "section",
    "solve_bvp",
    "squeeze",
    "states",
    "triangle",
]

# where each public name lives
_HOME = {
    "compare": ("der.analysis.compare", "compare"),
    "fold": ("der.analysis.fold", "fold"),
    "barrier": ("der.analysis.landscape.barrier", "barrier"),
    "landscape": ("der.analysis.landscape.landscape", "landscape"),
    "least_push": ("der.analysis.landscape.opening", "least_push"),
    "energy_surface": ("der.analysis.landscape.surface", "energy_surface"),
    "states": ("der.analysis.multistability.states", "states"),
    "planar": ("der.analysis.planar.planar_states", "planar"),
    "squeeze": ("der.analysis.planar.squeeze", "squeeze"),
    "packing_ratio": ("der.bvp.packing", "packing_ratio"),
    "solve_bvp": ("der.bvp.solve", "solve_bvp"),
    "phase_diagram": ("der.diagram.diagram", "phase_diagram"),
    "Ring": ("der.geometry.ring", "Ring"),
    "circle": ("der.geometry.shapes", "circle"),
    "ellipse": ("der.geometry.shapes", "ellipse"),
    "profile": ("der.geometry.shapes", "profile"),
    "rectangle": ("der.geometry.shapes", "rectangle"),
    "triangle": ("der.geometry.shapes", "triangle"),
    "Scale": ("der.geometry.section", "Scale"),
    "Section": ("der.geometry.section", "Section"),
    "rectangular_section": ("der.geometry.section", "rectangular_section"),
    "section": ("der.geometry.section", "section"),
    "Comparison": ("der.records.comparison", "Comparison"),
    "Shapes": ("der.records.configurations", "Shapes"),
    "Surface": ("der.records.energy_surface", "Surface"),
    "BarrierCurves": ("der.records.landscape", "BarrierCurves"),
    "Landscape": ("der.records.landscape", "Landscape"),
    "Pass": ("der.records.landscape", "Pass"),
    "LeastPush": ("der.records.opening", "LeastPush"),
    "Path": ("der.records.path", "Path"),
    "Point": ("der.records.path", "Point"),
    "PlanarState": ("der.records.planar", "PlanarState"),
    "PlanarStates": ("der.records.planar", "PlanarStates"),
    "Squeeze": ("der.records.planar", "Squeeze"),
    "SqueezePoint": ("der.records.planar", "SqueezePoint"),
    "RingState": ("der.records.states", "RingState"),
    "States": ("der.records.states", "States"),
    "Transition": ("der.records.states", "Transition"),
    "Scene": ("der.scene", "Scene"),
    "Interrupted": ("der.errors", "Interrupted"),
    "NotConverged": ("der.errors", "NotConverged"),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("ring-origami")
    if name not in _HOME:
        raise AttributeError(f"module 'der' has no attribute {name!r}")
    module, public = _HOME[name]
    value = globals()[name] = getattr(import_module(module), public)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
