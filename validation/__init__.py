"""The evidence: rod, boundary-value problem and other codes compared; benchmark and stress test.

    python -m validation benchmark|stress     from a clone

`solve`, `compare` and `packing_ratio` are those of `der`, under the names that scripts use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from der import Comparison, compare, packing_ratio
    from der import solve_bvp as solve
    from der.bvp.planar.folded_shape import Folded, folded
    from der.paper import draw

__all__ = ["Comparison", "Folded", "compare", "draw", "folded", "packing_ratio", "solve"]

_HOME = {
    "Comparison": ("der.analysis.compare", "Comparison"),
    "Folded": ("der.bvp.planar.folded_shape", "Folded"),
    "compare": ("der.analysis.compare", "compare"),
    "draw": ("der.paper", "draw"),
    "folded": ("der.bvp.planar.folded_shape", "folded"),
    "packing_ratio": ("der.bvp.planar.packing", "packing_ratio"),
    "solve": ("der.bvp.solve", "solve_bvp"),
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'validation' has no attribute {name!r}")
    module, public = _HOME[name]
    value = globals()[name] = getattr(import_module(module), public)
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
