"""Colours and names that still pictures, movies and pages share."""

from __future__ import annotations

from typing import Any, NamedTuple

from der.viz.curve import SNAP

INK, QUIET, PALE = "#222222", "#8a8a8a", "#dddddd"
STABLE, UNSTABLE, FREE, ROSE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"  # Okabe and Ito
PAIR = (STABLE, ROSE)  # of two rings whose curves share axes
DASHES = (0, (3.5, 1.6))  # of unstable curves


class Stretch(NamedTuple):
    """How a stretch of a curve is drawn."""

    label: str
    colour: str
    style: Any  # of matplotlib
    dash: str  # of plotly


# by the stability of a stretch in `curve.stretches`
STRETCHES: dict[bool | str | None, Stretch] = {
    True: Stretch("stable at fixed γ", STABLE, "-", "solid"),
    False: Stretch("unstable at fixed γ", UNSTABLE, DASHES, "dash"),
    None: Stretch("equilibria (stability not computed)", STABLE, "-", "solid"),
    SNAP: Stretch("snap", QUIET, (0, (1.2, 1.4)), "dot"),
}
POINTS = {  # names of special points, by their kind
    "fold": "fold",
    "limit": "limit of M",
    "branch": "branch point",
    "snap": "end of a snap",
    "contact": "self-crossing",
}
