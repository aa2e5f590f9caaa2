"""Fold an ellipse, b/a = 0.6, h/t = 4: about its short axis it folds, about its long axis not.

Twisted by grips at the ends of its short axis ("about x") the ring turns into three loops and stays
folded. Twisted by grips at the ends of its long axis, it still has a large moment at gamma = pi.
The ring and its folded shape are the same; only the path differs (paper, Fig. 4).

    python -m scenarios.fold_ellipse [DIR]

writes path.* and about_y.* (json, npz, png, rrd) to DIR (default: out/fold_ellipse).
"""

from __future__ import annotations

import der
from scenarios.output import usage, write

if __name__ == "__main__":
    usage(__file__, __doc__)

SECTION = der.rectangular_section(h_over_t=4.0)

path = der.fold(der.Scene(der.ellipse(0.6), SECTION, n_edges=128, shapes=True, modes=True))
about_y = der.fold(der.Scene(der.ellipse(0.6, "y"), SECTION, n_edges=128, shapes=True, modes=True))

if __name__ == "__main__":
    write(path, "fold_ellipse")
    write(about_y, "fold_ellipse", stem="about_y")
