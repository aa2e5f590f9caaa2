"""The cost of each need of a scene, relative to the same path without it: CPU time and memory.

A need is an entry of the scene that can be left out. A ring that stays in its plane needs no twist:
its rows compare the rod with one unknown an edge with the rod in space, on the states of one path.
A ring that leaves its plane cannot do without twist, because a frame turns about three axes. It
cannot do without anisotropy either: its rows show that two stiffnesses cost as much as one. Memory
is what is allocated: a history reserves space for the longest possible snap, and uses little of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import numpy as np

import der
from der.analysis.landscape.actuators import struts
from der.analysis.request import ring_of
from der.rod.free_ring import balance
from der.rod.planar_ring import covered, planar_ring
from der.rod.planar_system import solved
from validation.benchmark.rings import BARE, circle
from validation.benchmark.rows import Measured, Row, measured

Wants = dict[str, object]
KEPT: Wants = {"shapes": True}
TURNED: Wants = {"control": "angle", "unload": True}

# name -> (h/t, entries of the scene, entries of the scene that it is compared with)
NEEDS: Mapping[str, tuple[float, Wants, Wants]] = {
    "stability of every state": (4.0, {"stability": True}, {}),
    "self-crossings": (4.0, {"self_crossings": True}, {}),
    "error bars": (4.0, {"error_bars": True}, {}),
    "full ring": (4.0, {"sector": "full"}, {}),
    "half ring": (4.0, {"sector": "half"}, {}),
    "full ring and stability": (4.0, {"sector": "full", "stability": True}, {}),
    "finite stretch": (4.0, {"stretch": "finite"}, {}),
    "turning angle for the logarithm": (4.0, {"curvature": "angle"}, {}),
    "tangent for the logarithm": (4.0, {"curvature": "tangent"}, {}),
    "frames of every state kept": (4.0, KEPT, {}),
    "softest modes, over frames": (4.0, KEPT | {"modes": True}, KEPT),
    "angle up and down, two snaps": (1.6, TURNED, {}),
    "history of the snaps, over frames": (1.6, TURNED | KEPT | {"history": True}, TURNED | KEPT),
}


def rows(repeats: int, n_edges: int = 64) -> Iterator[Row]:
    """One row for the bare path, and two for each need: times the CPU time, and memory added."""
    costs: dict[tuple[float, str], Measured[object]] = {}

    def cost(h_over_t: float, wants: Wants) -> Measured[object]:
        key = (h_over_t, repr(wants))
        if key not in costs:
            scene = circle(h_over_t, **{**BARE, "n_edges": n_edges, **wants})
            costs[key] = measured(partial(der.fold, scene), repeats)
        return costs[key]

    bare = cost(4.0, {})
    case = f"none: h/t 4, N {n_edges}, quarter"
    yield Row("need", case, 1e3 * bare.cpu, "ms", note=f"{1e-3 * (bare.memory or 0):.0f} kB")
    for name, (h_over_t, wants, without) in NEEDS.items():
        less, more = cost(h_over_t, without), cost(h_over_t, wants)
        added = _added(more.cpu - less.cpu, (more.memory or 0) - (less.memory or 0))
        yield Row("need", name, more.cpu / less.cpu, "times", note=added)
    yield from _outputs(repeats, bare.cpu, n_edges)
    yield from _sections(repeats, n_edges)
    for n in (n_edges, 16 * n_edges):
        yield _planar(repeats, n)


def _added(seconds: float, memory: int) -> str:
    return f"{1e3 * seconds:+.1f} ms, {1e-3 * memory:+.0f} kB"


def _outputs(repeats: int, seconds: float, n_edges: int) -> Iterator[Row]:
    """The cost of drawing and encoding a path, relative to folding it; no files are written."""
    from der.viz.plots.path import draw
    from der.viz.rerun.recording import recording_bytes

    path = der.fold(circle(4.0, n_edges=n_edges, **BARE))
    shaped = der.fold(circle(4.0, n_edges=n_edges, **BARE, **KEPT))
    works: Mapping[str, Callable[[], object]] = {
        "record as JSON": path.to_json,
        "recording for playback": lambda: recording_bytes(shaped),
        "plot": lambda: draw(path).canvas.draw(),
    }
    for name, work in works.items():
        done = measured(work, min(repeats, 5))
        added = _added(done.cpu, done.memory or 0)
        yield Row("need", name, 1.0 + done.cpu / seconds, "times", note=added)


def _sections(repeats: int, n_edges: int) -> Iterator[Row]:
    """Anisotropy, per Newton iteration: only the section differs, and with it the path."""
    for name, section in (
        ("anisotropic", der.rectangular_section(4.0)),
        ("isotropic", der.section(1.0, 1.0)),
    ):
        scene = der.Scene(der.circle(), section, n_edges=n_edges, **BARE)  # type: ignore[arg-type]
        done = measured(partial(der.fold, scene), repeats, memory=False)
        each = 1e6 * done.cpu / done.result.timing.newton_iterations
        yield Row("need", f"{name} section, per Newton iteration", each, "us")


def _planar(repeats: int, n: int) -> Row:
    """A circle squeezed from state to state, in its plane and in space, by a strut inside."""
    scene = circle(4.0, n_edges=n, **BARE)
    mesh = planar_ring(scene)
    flat = solved(mesh.rod(1), covered(mesh, 1), np.zeros(2))
    first = float(mesh.chord() @ (mesh.length * np.sin(flat.phi)))
    lengths = np.linspace(first, 0.1 * first, 19)
    ring = ring_of(scene, "full")
    strut = struts(balance(ring.rod, ring.start.quat, ring.start.stretch), (0, n // 2))[-1]

    def in_plane() -> tuple[int, float]:
        phi, force, count = np.append(flat.phi, 0.5 * math.pi), np.zeros(4), 0
        rod = mesh.strutted()
        for length in lengths:
            at = solved(rod, phi, force, length)
            phi, force, count = at.phi, at.force, count + at.iterations + 1
        return count, at.moment

    def in_space() -> tuple[int, float]:
        state, count = strut.start, 0
        for length in lengths:
            at = strut.system.correct(state.but(load=strut.first - length))
            state, count = at.state, count + at.iterations + 1
        return count, -at.moment

    plane, space = (measured(work, repeats, memory=False) for work in (in_plane, in_space))
    off = abs(scene.section.alpha * plane.result[1] / space.result[1] - 1.0)
    each = [1e9 * done.cpu / done.result[0] / n for done in (plane, space)]
    note = f"{1e3 * plane.cpu:.2f} of {1e3 * space.cpu:.2f} ms for 19 states; "
    note += f"{each[0]:.0f} of {each[1]:.0f} ns an edge and iteration; force {off:.0e} off"
    name = f"none out of the plane: N {n}, full ring"
    return Row("need", name, plane.cpu / space.cpu, "times", note=note)
