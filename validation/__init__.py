"""The ring as a boundary-value problem, and the rod held against it and other references.

    path = validation.solve(scene, tolerance=1e-8)   # a der.Path, as from der.fold
    validation.packing_ratio(der.ellipse(0.8))       # of the folded ring, by the planar rod

Names are imported when they are first used, so that ``import validation`` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from validation.comparison import Comparison, compare
    from validation.figures import draw
    from validation.packing import packing_ratio
    from validation.planar import Folded, folded
    from validation.solving import solve

__all__ = ["Comparison", "Folded", "compare", "draw", "folded", "packing_ratio", "solve"]

_HOME = {
    "comparison": ("Comparison", "compare"),
    "figures": ("draw",),
    "packing": ("packing_ratio",),
    "planar": ("Folded", "folded"),
    "solving": ("solve",),
}


def __getattr__(name: str) -> Any:
    for module, names in _HOME.items():
        if name in names:
            value = getattr(import_module(f"validation.{module}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'validation' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
