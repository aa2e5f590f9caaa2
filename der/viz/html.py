"""A path as one page that any browser opens offline: the ring turns, a slider moves it.

plotly draws. The page contains plotly's code and all states as packed numbers. `html_page.js` is
part of the page; it moves the ring, the dots and the captions.
"""

from __future__ import annotations

import base64
import html
import importlib.util
import json
import math
import re
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from der.records.path import Path
from der.records.units import head
from der.utils.checks import Array
from der.utils.files import FilePath
from der.viz.animation import Motion, grips
from der.viz.captions import about, captions, density_unit
from der.viz.curve import stretches
from der.viz.files import checked_suffix, write
from der.viz.palette import INK, PAIR, PALE, POINTS, QUIET, STRETCHES
from der.viz.resampling import in_step, one_or_two
from der.viz.ribbon import VIRIDIS, ribbon, triangles
from der.viz.titles import names

SUFFIX = ".html"
FRAMES = 160  # steps of the slider, special points besides
POINTER, ARC = 0.42, 13  # length of a grip's arrow over the mean radius; points on its arc
REACH = 1.3  # half the length of the twisting axis, over the farthest point along it
AXES = {"moment": {"xaxis": "x", "yaxis": "y"}, "energy": {"xaxis": "x2", "yaxis": "y2"}}
LEGEND = {"orientation": "h", "x": 1.0, "xanchor": "right", "y": -0.09, "yanchor": "top"}
QUIETLY = {"showlegend": False, "hoverinfo": "skip"}  # traces without entry and without labels
LOOK = {  # of the figure
    "margin": {"l": 10, "r": 16, "t": 8, "b": 46},
    "paper_bgcolor": "white",
    "plot_bgcolor": "white",
    "font": {"family": "system-ui, sans-serif", "color": INK},
    "legend": LEGEND | {"font": {"size": 11}},
    "uirevision": "keep",
    "hovermode": "closest",
}
MESH = {  # the look of the ribbon
    "type": "mesh3d",
    "name": "ring",
    "hoverinfo": "skip",
    "cmin": 0.0,
    "colorscale": [[n / 8, f"rgb{tuple(shade)}"] for n, shade in enumerate(VIRIDIS.tolist())],
    "lighting": {"ambient": 0.62, "diffuse": 0.6, "specular": 0.15, "roughness": 0.6},
    "lightposition": {"x": 3000, "y": -1500, "z": 4000},
}
BAR = {  # the look of the colour bar
    "thickness": 9,
    "len": 0.55,
    "outlinewidth": 0,
    "tickfont": {"size": 10},
}
SAID = {"numbers": "numbers", "stability": "line", "stable": "stable", "events": "event"}
_SCENES = ("scene", "scene2")  # plotly's names of the views of the rings
EYE = {"x": 1.14, "y": 0.64, "z": 0.48}


PLACES = {  # domains (x, y) of views and of both curves, by the number of rings
    1: ([([0.0, 0.52], [0.0, 1.0])], [([0.6, 1.0], [0.55, 1.0]), ([0.6, 1.0], [0.0, 0.45])]),
    2: (
        [([0.0, 0.48], [0.42, 1.0]), ([0.52, 1.0], [0.42, 1.0])],
        [([0.05, 0.47], [0.0, 0.36]), ([0.56, 1.0], [0.0, 0.36])],
    ),
}


def save_html(path: Path | Sequence[Path], file: FilePath, *, frames: int = FRAMES) -> None:
    """Write the page of a path, or of two beside each other, atomically.

    Parameters
    ----------
    path : with shapes; two of them move at equal gamma where they can (`resampling.in_step`).
    file : .html.
    frames : steps of the slider, special points besides.

    Raises
    ------
    ValueError
        If the suffix is another, plotly is missing, the place cannot be written to, a path has no
        shapes, or there are more than two.
    """
    check_html(file)
    write("html", file, page(path, frames=frames).encode())


def check_html(file: FilePath) -> None:
    """Refuse a file to which no page can be written; called before solving."""
    checked_suffix("html", file, [SUFFIX])
    if importlib.util.find_spec("plotly") is None:
        raise ValueError(
            f"html {str(file)!r} needs the package plotly, which is not installed: "
            f"pip install plotly"
        )


def page(path: Path | Sequence[Path], *, frames: int = FRAMES) -> str:
    """The page of a path, or of two beside each other; arguments as in `save_html`."""
    from plotly.offline import get_plotlyjs

    paths = one_or_two(path)
    motions = in_step(paths, frames)
    colours = PAIR if len(paths) == 2 else (INK,)
    rings = list(map(_ring, paths, motions, names(paths), colours))
    data = {"figure": _figure(paths, motions, colours), "rings": rings}
    head, body = "ring-origami: " + " and ".join(names(paths)), files("der.viz") / "html_page.html"
    parts = {
        "TITLE": html.escape(head),
        # no "<" that could end the element or begin a comment; JSON's text is otherwise ASCII
        "DATA": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "ABOUT": html.escape("\n\n".join(map(about, paths, motions))),
        "PLAYER": (files("der.viz") / "html_page.js").read_text(encoding="utf-8"),
        "PLOTLY": get_plotlyjs(),
    }
    text = body.read_text(encoding="utf-8")
    return re.sub(f"%({'|'.join(parts)})%", lambda place: parts[place[1]], text)  # in one pass


def packed(values: ArrayLike, kind: str = "f4") -> str:
    """Numbers as base64 of little-endian float32 (or another kind); NaN is kept."""
    return base64.b64encode(np.asarray(values, dtype=f"<{kind}").tobytes()).decode()


def _ring(path: Path, motion: Motion, name: str, colour: str) -> dict[str, Any]:
    """What changes from step to step."""
    positions, _ = ribbon(motion.x, motion.frames, motion.section)
    said = captions(path, motion)
    return {
        "name": name,
        "colour": colour,
        "sections": motion.x.shape[1],
        "positions": packed(positions[:, ::2]),  # each corner occurs twice, once for each face
        "grips": packed(np.moveaxis(grips(motion, POINTER, ARC), 0, 1)),
        "arc": ARC + 1,
        "density": packed(motion.density.sum(axis=0)),
        "gamma": packed(motion.gamma / math.pi, "f8"),
        **{value: packed(getattr(motion, value), "f8") for value in AXES},
        **{key: [getattr(one, text) for one in said] for key, text in SAID.items()},
        "marks": sorted({motion.step_of(point.position) for point in path.points}),
    }


# --- The figure ------------------------------------------------------------------------------


def _figure(
    paths: Sequence[Path], motions: Sequence[Motion], colours: Sequence[str]
) -> dict[str, Any]:
    """plotly's figure. What moves: the meshes and the grips, first; the dots, last."""
    two = len(paths) == 2
    top = max(float(one.density[:, one.position >= 0].sum(axis=0).max()) for one in motions) or 1.0
    traces = [_mesh(motion, k, top, two=two) for k, motion in enumerate(motions)]
    traces += [_line(k, INK, 5.0, [0.0], "grips") for k in range(len(motions))]
    for k, motion in enumerate(motions):
        end = REACH * float(np.abs(motion.x[..., 2]).max())
        traces.append(_line(k, QUIET, 1.5, [-end, end], "twisting axis"))
    for name, axes in AXES.items():
        for path, colour, called in zip(paths, colours, names(paths), strict=True):
            drawn = _curve(path, name, colour if two else None, called if two else "")
            traces += [trace | axes for trace in drawn]
    for name, axes in AXES.items():
        for colour in colours:
            dot = _marks([0.0], [0.0], 13, color=colour, line={"color": "white", "width": 2})
            traces.append(dot | axes | QUIETLY | {"name": f"present {name}", "cliponaxis": False})
    return {"data": traces, "layout": _layout(paths, motions)}


def _mesh(motion: Motion, k: int, top: float, *, two: bool) -> dict[str, Any]:
    """The ribbon, coloured by its energy up to ``top``; the page sets its vertices."""
    n_v = motion.x.shape[1]
    place = {"x": 0.487, "xanchor": "center", "y": 0.72} if two else {"x": 0.0, "xanchor": "left"}
    faces = dict(zip("ijk", triangles(n_v).T.tolist(), strict=True))
    vertices = dict.fromkeys(("x", "y", "z", "intensity"), [0.0] * (8 * n_v))
    text = f"energy per length, {density_unit(motion.scale)}"
    title = {"text": text, "side": "right", "font": {"size": 11}}
    bar = {"cmax": top, "showscale": k == 0, "colorbar": BAR | place | {"title": title}}
    return MESH | faces | vertices | bar | {"scene": _SCENES[k]}


def _line(k: int, colour: str, width: float, z: list[float], name: str) -> dict[str, Any]:
    """A line along the twisting axis, or one that the page places elsewhere."""
    look = {"type": "scatter3d", "mode": "lines", "line": {"color": colour, "width": width}}
    zeros = [0.0] * len(z)
    return look | QUIETLY | {"x": zeros, "y": zeros, "z": z, "name": name, "scene": _SCENES[k]}


def _marks(x: list[float], y: list[float], size: float, **marker: Any) -> dict[str, Any]:
    """Points in the axes of a curve."""
    return {
        "type": "scatter",
        "mode": "markers",
        "x": x,
        "y": y,
        "marker": {"size": size, **marker},
    }


def _curve(path: Path, name: str, own: str | None, label: str) -> Iterator[dict[str, Any]]:
    """The curve in stretches of one stability, and its special points.

    Parameters
    ----------
    own, label : colour and name of the ring, where there are two.
    """
    heights: Array = getattr(path, name)
    said: set[object] = set()
    for kind, points in stretches(path, heights):
        look = STRETCHES[kind]
        # plotly reads names as HTML
        text = html.escape(f"{label}, {look.label}" if label else look.label, quote=False)
        yield {
            "type": "scatter",
            "mode": "lines",
            **dict(zip("xy", points.T.tolist(), strict=True)),
            "line": {
                "color": own or look.colour,
                "dash": look.dash,
                "width": 2.2,
                "simplify": False,
            },
            "name": text,
            "legendgroup": text,
            "showlegend": name == "moment" and kind not in said,
            "hovertemplate": "γ = %{x:.4f} π<br>%{y:.4f}<extra></extra>",
        }
        said.add(kind)
    at = [point.position for point in path.points]
    if at:
        x, y = (path.gamma[at] / math.pi).tolist(), heights[at].tolist()
        yield _marks(x, y, 7, color="white", line={"color": own or INK, "width": 1.4}) | {
            "text": [POINTS[point.kind] for point in path.points],
            "name": "special points",
            "showlegend": False,
            "hovertemplate": "%{text}<br>γ = %{x:.6f} π<br>%{y:.6f}<extra></extra>",
        }


def _range(paths: Sequence[Path], name: str) -> list[float]:
    """Limits that contain the values of all paths, with a margin."""
    values = np.concatenate([getattr(path, name) for path in paths])
    low, high = float(values.min()), float(values.max())
    room = 0.05 * ((high - low) or 1.0)
    return [low - room, high + room]


def _layout(paths: Sequence[Path], motions: Sequence[Motion]) -> dict[str, Any]:
    """Places and limits of the views, which never change."""
    views, ((mx, my), (ux, uy)) = PLACES[len(motions)]
    scene = _scene(motions)
    places = [{"domain": {"x": x, "y": y}} for x, y in views]
    scenes = {name: scene | place for name, place in zip(_SCENES, places, strict=False)}
    turned, turns = "rotation of a grip, γ/π", [v / math.pi for v in _range(paths, "gamma")]
    scale = paths[0].scale
    moments, energies = _range(paths, "moment"), _range(paths, "energy")
    return {
        **scenes,
        "xaxis": _axis(turned, domain=mx, anchor="y", range=turns),
        "yaxis": _axis(
            "moment " + head(scale, "M", "moment"), domain=my, anchor="x", range=moments
        ),
        "xaxis2": _axis(turned, domain=ux, anchor="y2", matches="x"),
        "yaxis2": _axis(
            "energy " + head(scale, "U", "energy"), domain=uy, anchor="x2", range=energies
        ),
    } | LOOK


def _scene(motions: Sequence[Motion]) -> dict[str, Any]:
    """The view of a ring, in limits that contain it at all times."""
    reach = max(float(np.abs(motion.x).max()) + 0.6 * motion.section.h for motion in motions)
    side = {"range": [-reach, reach], "visible": False}
    return {
        **{f"{name}axis": dict(side) for name in "xyz"},
        "aspectmode": "cube",
        "camera": {"eye": EYE, "up": {"x": 0, "y": 0, "z": 1}},
        "dragmode": "orbit",
    }


def _axis(text: str, **more: Any) -> dict[str, Any]:
    """An axis of a curve, with its label."""
    look = {"showgrid": True, "gridcolor": PALE, "zerolinecolor": "#bdbdbd", "linecolor": QUIET}
    ticks = {"ticks": "outside", "tickcolor": QUIET, "tickfont": {"size": 11}}
    return {**look, **ticks, "title": {"text": text, "font": {"size": 12}, "standoff": 6}, **more}
