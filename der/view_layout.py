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

from der.film import ENERGIES, Playback
from der.panel import HIGH, WIDE

SOLVING = "solving"  # entity and timeline of the states as they are found
FPS, FILM = 30.0, 10.0  # frames a second at most; seconds that a film of fewer states lasts
CAMERA = np.array([3.1, 1.75, 1.3])  # from the middle, over the mean radius; the ring lies in y, z
PAPER, NIGHT = (243, 243, 240), (13, 16, 17)  # of the ring's views; of panels, as labels' boxes


def while_solving() -> rrb.Blueprint:
    """The last state that was found, until there is a film."""
    view = rrb.Spatial3DView(origin=SOLVING, name="solving", background=PAPER, line_grid=False)
    panel = rrb.TimePanel(timeline=SOLVING, play_state="following", state="collapsed")
    return rrb.Blueprint(view, panel, *_aside())


def layout(film: Playback) -> rrb.Blueprint:
    """The ring on the left, once for each energy; curves, series and words on the right."""
    n = len(film.x)
    ring = [_ring_view(name, film) for name in ENERGIES]
    key = rrb.Spatial2DView(
        origin="key", name="colours", background=NIGHT, visual_bounds=_bounds(-12, 312, -10, 24)
    )
    curves = rrb.Horizontal(
        _curve_view("moment", "M a/GJ over gamma"), _curve_view("energy", "U a/GJ over gamma")
    )
    series = rrb.Horizontal(
        _series_view(n, "M and gamma", ["moment", "gamma"]),
        _series_view(n, "U", ["energy"]),
        _series_view(n, "index and eigenvalues", ["index", "eigenvalues/**"]),
    )
    states = rrb.StateTimelineView(
        origin="states",
        name="stability, last event",
        time_view=rrb.TimeAxis(view_range=_whole(n)),
    )
    words = rrb.Horizontal(
        rrb.TextLogView(
            origin="events",
            name="events",
            columns=rrb.TextLogColumns(text_log_columns=[TextLogColumn(TextLogColumnKind.Body)]),
        ),
        rrb.TextDocumentView(origin="about", name="about"),
    )
    panel = rrb.TimePanel(
        timeline="step",
        fps=min(FPS, max(1.0, n / FILM)),
        loop_mode="all",
        play_state="paused",
        state="collapsed",
    )
    left = rrb.Vertical(rrb.Horizontal(*ring), key, row_shares=[9, 1])
    right = rrb.Vertical(curves, series, states, words, row_shares=[4, 3, 1.7, 3])
    return rrb.Blueprint(rrb.Horizontal(left, right, column_shares=[1.05, 1]), panel, *_aside())


def _aside() -> tuple[rrb.BlueprintPanel, rrb.SelectionPanel]:
    """The viewer's own panels, out of the way."""
    return rrb.BlueprintPanel(state="collapsed"), rrb.SelectionPanel(state="collapsed")


def _ring_view(energy: str, film: Playback) -> rrb.Spatial3DView:
    """The ring in the colours of one energy, the twisting axis upright."""
    mapping = VisualizerComponentMapping(
        "Mesh3D:vertex_colors",
        ComponentSourceKind.SourceComponent,
        source_component=f"{energy}:colors",
    )
    times = film.section.factor
    scale = "" if times == 1.0 else f" (section drawn {times:g} times as large)"
    past = rrb.VisibleTimeRanges(
        timeline="step",
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    eye = rrb.EyeControls3D(
        kind="orbital",
        position=film.size * CAMERA,
        look_target=[0.0, 0.0, 0.0],
        eye_up=[0.0, 0.0, 1.0],
    )
    return rrb.Spatial3DView(
        origin="ring",
        name=f"energy of {energy}{scale}",
        background=PAPER,
        line_grid=False,
        eye_controls=eye,
        overrides={
            "ring/ribbon": rr.Mesh3D.from_fields().visualizer(mappings=[mapping]),
            "ring/trace/0": past,
            "ring/trace/1": past,
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
        axis_x=rrb.TimeAxis(view_range=_whole(n)),
        plot_legend=rrb.PlotLegend(visible=True),
    )


def _bounds(left: float, right: float, top: float, bottom: float) -> rrb.VisualBounds2D:
    return rrb.VisualBounds2D(x_range=[left, right], y_range=[top, bottom])


def _whole(n: int) -> rr.TimeRange:
    """All steps of a film."""
    first, last = (rr.TimeRangeBoundary.absolute(seq=k) for k in (0, n - 1))
    return rr.TimeRange(start=first, end=last)
