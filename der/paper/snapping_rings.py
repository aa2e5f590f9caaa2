"""The paper's rings that snap where their angle is controlled, with h/t: Figs. 7b, 11, D.1b."""

from __future__ import annotations

import math

from der.geometry.shapes import ellipse, rectangle, triangle

SNAPPING = {
    "triangle_120": (triangle(2 * math.pi / 3, 1 / 15), 1.0),
    "triangle_90": (triangle(math.pi / 2, 1 / 30), 4.0),
    "ellipse": (ellipse(0.85, "y"), 4.0),
    "rectangle": (rectangle(0.6, 0.3, "y"), 4.0),
}
