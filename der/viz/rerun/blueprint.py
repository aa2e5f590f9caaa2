"""The layout of the playback in the rerun viewer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike
from rerun.blueprint.encodings import (
    ComponentSourceKind,
    TextLogColumn,
    TextLogColumnKind,
    VisualizerComponentMapping,
)

from der.geometry.scale import Scale
from der.records.units import head
from der.viz.animation import ENERGIES, Motion
from der.viz.rerun.axes import HIGH, WIDE

UNDER = ("first", "second")  # entities of two motions beside each other
CURVES = {"moment": "M", "energy": "U"}
ROOTS = ("", *(f"/{under}" for under in UNDER))
SERIES = {  # entities by the title of their view
    "M and gamma": ["/series/moment", "/series/gamma"],
    "U": ["/series/energy"],
    "index and eigenvalues": ["/series/index", "/series/eigenvalues/**"],
}
SOLVING = "solving"  # entity and timeline of the states as they are found
FPS, LASTS = 30.0, 10.0  # frames a second at most; seconds that a motion of fewer states lasts
CAMERA = np.array([3.1, 1.75, 1.3])  # from the middle, over the mean radius; the ring lies in y, z
PAPER, NIGHT = (243, 243, 240), (13, 16, 17)  # of the ring's views; of axes, as labels' boxes


def while_solving() -> rrb.Blueprint:
    """The last computed state, until the path is known."""
    panel = rrb.TimePanel(timeline=SOLVING, play_state="following", state="collapsed")
    return rrb.Blueprint(_space(SOLVING, "solving"), panel, *_aside())


def _titles(scale: Scale | None) -> dict[str, str]:
    """Titles of the views of curves, by what they show."""
    return {name: f"{head(scale, symbol, name)} over gamma" for name, symbol in CURVES.items()}


def layout(motion: Motion) -> rrb.Blueprint:
    """The ring on the left, once for each energy; curves, series and texts on the right."""
    n = len(motion.x)
    bounds = (-20, WIDE + 8, -HIGH - 8, 14)
    curves = [
        _plane(f"curves/{name}", title, bounds) for name, title in _titles(motion.scale).items()
    ]
    series = [_series_view(n, *one) for one in SERIES.items()]
    parts = (rrb.Horizontal(*curves), rrb.Horizontal(*series), _states(n), _log_and_about())
    right = rrb.Vertical(*parts, row_shares=[4, 3, 1.7, 3])
    return _page(n, rrb.Horizontal(_ring_and_key(motion), right, column_shares=[1.05, 1]))


def beside(motions: Sequence[Motion], called: Sequence[str]) -> rrb.Blueprint:
    """Two rings beside each other above; the curves of both, and texts, below."""
    n = len(motions[0].x)
    size = max(motion.size for motion in motions)
    rings = [
        _ring_view("bending", motion, under=f"{under}/", name=name, size=size)
        for under, motion, name in zip(UNDER, motions, called, strict=True)
    ]
    bounds = (-20, WIDE + 8, -HIGH - 18, 14)
    entities = {name: [f"{under}/curves/{name}/**" for under in ROOTS] for name in CURVES}
    titles = _titles(motions[0].scale)
    curves = [_plane("/", title, bounds, contents=entities[name]) for name, title in titles.items()]
    series = [
        _series_view(n, f"{name} over steps", [f"/{under}/series/{name}" for under in UNDER])
        for name in ("gamma", "index")
    ]
    log = _log("/", contents=[f"/{under}/events" for under in UNDER])
    texts = rrb.Horizontal(log, rrb.TextDocumentView(origin="about", name="about"))
    above = rrb.Vertical(rrb.Horizontal(*rings), _key(), row_shares=[9, 1])
    right = rrb.Vertical(*curves, rrb.Horizontal(*series), texts, row_shares=[3, 3, 2, 2.2])
    return _page(n, rrb.Horizontal(above, right, column_shares=[1.35, 1]))


def landscape_layout(motion: Motion, *, well: bool, surface: bool) -> rrb.Blueprint:
    """The ring on the left; on the right the landscape, in one dimension or in both."""
    n = len(motion.x)
    title = f"energy landscape, {_titles(motion.scale)['energy']}"
    bounds = (-24, WIDE + 26, -HIGH - 10, 14)
    curves: Any = _plane("landscape/whole", title, bounds)
    if well:
        bounds = (-26, WIDE + 14, -HIGH - 10, 14)
        part = _plane("landscape/well", "its saddle and the folded well", bounds)
        curves = rrb.Horizontal(curves, part)
    load = "M and gamma"
    texts = rrb.Horizontal(_log_and_about(), _series_view(n, load, SERIES[load]))
    if not surface:
        right = rrb.Vertical(curves, _states(n), texts, row_shares=[5, 1.2, 3])
        return _page(n, rrb.Horizontal(_ring_and_key(motion), right, column_shares=[1, 1.25]))
    title = "least energy over twist and distance of the grips"
    eye = _eye([-1.35, -2.0, 1.25], [0.0, 0.0, -0.15])
    relief = _space("surface", title, eye_controls=eye)
    views = rrb.Horizontal(_ring_view("bending", motion), relief, column_shares=[1, 1.5])
    above = rrb.Vertical(views, _key(), row_shares=[7, 1])
    return _page(n, rrb.Vertical(above, rrb.Horizontal(curves, texts), row_shares=[2, 1]))


def _page(n: int, views: rrb.Horizontal | rrb.Vertical) -> rrb.Blueprint:
    """The layout of views of ``n`` steps."""
    fps = min(FPS, max(1.0, n / LASTS))
    look: dict[str, Any] = {"loop_mode": "all", "play_state": "paused", "state": "collapsed"}
    return rrb.Blueprint(views, rrb.TimePanel(timeline="step", fps=fps, **look), *_aside())


def _space(origin: str, name: str, **more: Any) -> rrb.Spatial3DView:
    """A view in space, on paper."""
    look: dict[str, Any] = {"background": PAPER, "line_grid": False}
    return rrb.Spatial3DView(origin=origin, name=name, **look, **more)


def _ring_and_key(motion: Motion) -> rrb.Vertical:
    """The ring once for each energy, and the colours of both."""
    ring = [_ring_view(name, motion) for name in ENERGIES]
    return rrb.Vertical(rrb.Horizontal(*ring), _key(), row_shares=[9, 1])


def _key() -> rrb.Spatial2DView:
    return _plane("key", "colours", (-12, 312, -10, 24))


def _states(n: int) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(
        origin="states", name="stability, last event", time_view=rrb.TimeAxis(view_range=_steps(n))
    )


def _log_and_about() -> rrb.Horizontal:
    """The log of events, and the parameters."""
    return rrb.Horizontal(_log("events"), rrb.TextDocumentView(origin="about", name="about"))


def _aside() -> tuple[rrb.BlueprintPanel, rrb.SelectionPanel]:
    """The viewer's own panels, collapsed."""
    return rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")


def _ring_view(
    energy: str, motion: Motion, *, under: str = "", name: str = "", size: float | None = None
) -> rrb.Spatial3DView:
    """The ring in the colours of one energy, the twisting axis upright.

    Parameters
    ----------
    under, name : of a ring beside another one.
    size : to which the camera's distance is proportional; the ring's own if not given.
    """
    mapping = VisualizerComponentMapping(
        "Mesh3D:vertex_colors",
        ComponentSourceKind.SourceComponent,
        source_component=f"{energy}:colors",
    )
    times = motion.section.factor
    scale = "" if times == 1.0 else f" (section drawn {times:g} times as large)"
    past = rrb.VisibleTimeRanges(
        timeline="step",
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return _space(
        f"{under}ring",
        f"{name}, energy of {energy}" if name else f"energy of {energy}{scale}",
        eye_controls=_eye((size or motion.size) * CAMERA, [0.0, 0.0, 0.0]),
        overrides={
            f"{under}ring/ribbon": rr.Mesh3D.from_fields().visualizer(mappings=[mapping]),
            f"{under}ring/trace/0": past,
            f"{under}ring/trace/1": past,
        },
    )


def _eye(position: ArrayLike, target: ArrayLike) -> rrb.EyeControls3D:
    """A camera with the twisting axis upright."""
    up = [0.0, 0.0, 1.0]
    return rrb.EyeControls3D(kind="orbital", position=position, look_target=target, eye_up=up)


def _series_view(n: int, title: str, series: Sequence[str]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(series),
        name=title,
        axis_x=rrb.TimeAxis(view_range=_steps(n)),
        plot_legend=rrb.PlotLegend(visible=True),
    )


def _log(origin: str, **more: Any) -> rrb.TextLogView:
    """The log of events."""
    columns = rrb.TextLogColumns(text_log_columns=[TextLogColumn(TextLogColumnKind.Body)])
    return rrb.TextLogView(origin=origin, name="events", columns=columns, **more)


def _plane(
    origin: str, name: str, bounds: tuple[float, float, float, float], **more: Any
) -> rrb.Spatial2DView:
    """A view of axes in a plane; bounds: left, right, top, bottom."""
    box = rrb.VisualBounds2D(x_range=bounds[:2], y_range=bounds[2:])
    return rrb.Spatial2DView(origin=origin, name=name, background=NIGHT, visual_bounds=box, **more)


def _steps(n: int) -> rr.TimeRange:
    """All steps of a motion."""
    first, last = (rr.TimeRangeBoundary.absolute(seq=k) for k in (0, n - 1))
    return rr.TimeRange(start=first, end=last)
