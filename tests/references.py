"""Paths of twisted circles, computed by AUTO-07p (validation/reference), by h/t.

Orthogonal collocation, 11 digits; nu = 0.3, radius and GJ are 1. The path of h/t = 1 goes beyond
pi, until the ring is folded.
"""

import functools

from der.analysis.curve_distance import ReferenceCurve, read_reference
from validation.benchmark.rings import TABLES

NAMES = {4.0: "circ_ht4", 1.6: "circ_ht1.6", 1.0: "circ_ht1_beyond_pi"}


@functools.cache
def reference(h_over_t: float) -> ReferenceCurve:
    """Curve of a circle."""
    return read_reference(TABLES / f"{NAMES[h_over_t]}.csv")
