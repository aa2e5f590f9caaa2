"""The layout of the playback in the rerun viewer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import (
    ComponentSourceKind,
    TextLogColumn,
    TextLogColumnKind,
    VisualizerComponentMapping,
)

from der.viz.animation import ENERGIES, Motion
from der.viz.rerun.axes import HIGH, WIDE

UNDER = ("first", "second")  # where two motions that are beside each other put their sent
SOLVING = "solving"  # entity and timeline of the states as they are found
FPS, LASTS = 30.0, 10.0  # frames a second at most; seconds that a motion of fewer states lasts
CAMERA = np.array([3.1, 1.75, 1.3])  # from the middle, over the mean radius; the ring lies in y, z
PAPER, NIGHT = (243, 243, 240), (13, 16, 17)  # of the ring's views; of axes, as labels' boxes


def while_solving() -> rrb.Blueprint:
    """The last state that was found, until the path is known."""
    view = rrb.Spatial3DView(origin=SOLVING, name="solving", background=PAPER, line_grid=False)
    panel = rrb.TimePanel(timeline=SOLVING, play_state="following", state="collapsed")
    return rrb.Blueprint(view, panel, *_aside())


def layout(motion: Motion) -> rrb.Blueprint:
    """The ring on the left, once for each energy; curves, series and texts on the right."""
    n = len(motion.x)
    curves = rrb.Horizontal(
        _curve_view("moment", "M a/GJ over gamma"), _curve_view("energy", "U a/GJ over gamma")
    )
    right = rrb.Vertical(
        curves, _series(n), _states(n), _log_and_about(), row_shares=[4, 3, 1.7, 3]
    )
    everything = rrb.Horizontal(_ring_and_key(motion), right, column_shares=[1.05, 1])
    return rrb.Blueprint(everything, _time(n), *_aside())


def beside(motions: Sequence[Motion], called: Sequence[str]) -> rrb.Blueprint:
    """Two rings beside each other above; the curves of both, and texts, below."""
    n = len(motions[0].x)
    size = max(motion.size for motion in motions)
    rings = [
        _ring_view("bending", motion, under=f"{under}/", name=name, size=size)
        for under, motion, name in zip(UNDER, motions, called, strict=True)
    ]
    curves = [
        rrb.Spatial2DView(
            origin="/",
            contents=[f"/curves/{name}/**", *(f"/{under}/curves/{name}/**" for under in UNDER)],
            name=title,
            background=NIGHT,
            visual_bounds=_bounds(-20, WIDE + 8, -HIGH - 18, 14),
        )
        for name, title in (("moment", "M a/GJ over gamma"), ("energy", "U a/GJ over gamma"))
    ]
    series = [
        rrb.TimeSeriesView(
            origin="/",
            contents=[f"/{under}/series/{name}" for under in UNDER],
            name=title,
            axis_x=rrb.TimeAxis(view_range=_steps(n)),
            plot_legend=rrb.PlotLegend(visible=True),
        )
        for name, title in (("gamma", "gamma over steps"), ("index", "index over steps"))
    ]
    log = rrb.TextLogView(
        origin="/",
        contents=[f"/{under}/events" for under in UNDER],
        name="events",
        columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn(TextLogColumnKind.Body)]),
    )
    texts = rrb.Horizontal(log, rrb.TextDocumentView(origin="about", name="about"))
    above = rrb.Vertical(rrb.Horizontal(*rings), _key(), row_shares=[9, 1])
    right = rrb.Vertical(*curves, rrb.Horizontal(*series), texts, row_shares=[3, 3, 2, 2.2])
    return rrb.Blueprint(rrb.Horizontal(above, right, column_shares=[1.35, 1]), _time(n), *_aside())


def landscape_layout(motion: Motion, *, well: bool, surface: bool) -> rrb.Blueprint:
    """The ring on the left; on the right the landscape, in one dimension or in both."""
    n = len(motion.x)
    bounds = _bounds(-24, WIDE + 26, -HIGH - 10, 14)
    all_of_it = rrb.Spatial2DView(
        origin="landscape/whole",
        name="energy landscape, U a/GJ over gamma",
        background=NIGHT,
        visual_bounds=bounds,
    )
    part = rrb.Spatial2DView(
        origin="landscape/well",
        name="its saddle and the folded well",
        background=NIGHT,
        visual_bounds=_bounds(-26, WIDE + 14, -HIGH - 10, 14),
    )
    curves = rrb.Horizontal(all_of_it, part) if well else all_of_it
    texts = rrb.Horizontal(_log_and_about(), _series_view(n, "M and gamma", ["moment", "gamma"]))
    if not surface:
        right = rrb.Vertical(curves, _states(n), texts, row_shares=[5, 1.2, 3])
        left = _ring_and_key(motion)
        return rrb.Blueprint(
            rrb.Horizontal(left, right, column_shares=[1, 1.25]), _time(n), *_aside()
        )
    eye = rrb.EyeControls3D(
        kind="orbital",
        position=[-1.35, -2.0, 1.25],
        look_target=[0.0, 0.0, -0.15],
        eye_up=[0.0, 0.0, 1.0],
    )
    relief = rrb.Spatial3DView(
        origin="surface",
        name="least energy over twist and distance of the grips",
        background=PAPER,
        line_grid=False,
        eye_controls=eye,
    )
    views = rrb.Horizontal(_ring_view("bending", motion), relief, column_shares=[1, 1.5])
    above = rrb.Vertical(views, _key(), row_shares=[7, 1])
    return rrb.Blueprint(
        rrb.Vertical(above, rrb.Horizontal(curves, texts), row_shares=[2, 1]), _time(n), *_aside()
    )


def _ring_and_key(motion: Motion) -> rrb.Vertical:
    """The ring once for each energy, and the colours of both."""
    ring = [_ring_view(name, motion) for name in ENERGIES]
    return rrb.Vertical(rrb.Horizontal(*ring), _key(), row_shares=[9, 1])


def _key() -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin="key", name="colours", background=NIGHT, visual_bounds=_bounds(-12, 312, -10, 24)
    )


def _series(n: int) -> rrb.Horizontal:
    return rrb.Horizontal(
        _series_view(n, "M and gamma", ["moment", "gamma"]),
        _series_view(n, "U", ["energy"]),
        _series_view(n, "index and eigenvalues", ["index", "eigenvalues/**"]),
    )


def _states(n: int) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(
        origin="states",
        name="stability, last event",
        time_view=rrb.TimeAxis(view_range=_steps(n)),
    )


def _log_and_about() -> rrb.Horizontal:
    """The log of events, and the parameters."""
    return rrb.Horizontal(
        rrb.TextLogView(
            origin="events",
            name="events",
            columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn(TextLogColumnKind.Body)]),
        ),
        rrb.TextDocumentView(origin="about", name="about"),
    )


def _time(n: int) -> rrb.TimePanel:
    return rrb.TimePanel(
        timeline="step",
        fps=min(FPS, max(1.0, n / LASTS)),
        loop_mode="all",
        play_state="paused",
        state="collapsed",
    )


def _aside() -> tuple[rrb.BlueprintPanel, rrb.SelectionPanel]:
    """The viewer's own panels, out of the way."""
    return rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")


def _ring_view(
    energy: str,
    motion: Motion,
    *,
    under: str = "",
    name: str = "",
    size: float | None = None,
) -> rrb.Spatial3DView:
    """The ring in the colours of one energy, the twisting axis upright.

    Parameters
    ----------
    under, name : of a ring that is not alone.
    size : that the camera's distance goes with; the ring's own if not given.
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
    eye = rrb.EyeControls3D(
        kind="orbital",
        position=(size or motion.size) * CAMERA,
        look_target=[0.0, 0.0, 0.0],
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(
        origin=f"{under}ring",
        name=f"{name}, energy of {energy}" if name else f"energy of {energy}{scale}",
        background=PAPER,
        line_grid=False,
        eye_controls=eye,
        overrides={
            f"{under}ring/ribbon": rr.Mesh3D.from_fields().visualizer(mappings=[mapping]),
            f"{under}ring/trace/0": past,
            f"{under}ring/trace/1": past,
        },
    )


def _curve_view(name: str, title: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=f"curves/{name}",
        name=title,
        background=NIGHT,
        visual_bounds=_bounds(-20, WIDE + 8, -HIGH - 8, 14),
    )


def _series_view(n: int, title: str, series: Sequence[str]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="series",
        contents=[f"$origin/{name}" for name in series],
        name=title,
        axis_x=rrb.TimeAxis(view_range=_steps(n)),
        plot_legend=rrb.PlotLegend(visible=True),
    )


def _bounds(left: float, right: float, top: float, bottom: float) -> rrb.VisualBounds2D:
    return rrb.VisualBounds2D(x_range=[left, right], y_range=[top, bottom])


def _steps(n: int) -> rr.TimeRange:
    """All steps of a motion."""
    first, last = (rr.TimeRangeBoundary.absolute(seq=k) for k in (0, n - 1))
    return rr.TimeRange(start=first, end=last)
