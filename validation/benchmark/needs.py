"""What each need of a scene costs, over the same path without it: CPU time and memory.

A need is what may be asked for or left out. A ring that stays in its plane leaves out twist and the
way out: its rows are the rod with one unknown an edge over the one in space, from state to state of
one path. Where a ring leaves its plane twist cannot be left out, for a frame turns about three
axes; neither can anisotropy: its rows say that a section with two stiffnesses costs what one with
a single stiffness does. Memory is what is asked of the system: a history reserves room for the
longest snap there can be, most of it never touched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np

import der
from der.analysis.landscape.actuators import struts
from der.analysis.landscape.landscape import scene_sector
from der.geometry.section import section
from der.rod.equilibrium import equilibrium
from der.rod.free_ring import balance
from der.rod.planar_march import solved
from der.rod.planar_ring import covered, planar_ring
from validation.benchmark.paths import circle
from validation.benchmark.rows import Row, measured

BARE: Mapping[str, object] = {"stability": False, "self_crossings": False}
KEPT: Mapping[str, object] = {"shapes": True}
TURNED: Mapping[str, object] = {"control": "angle", "unload": True}

# name -> (h/t, what is wanted besides, what it is compared with)
NEEDS: Mapping[str, tuple[float, Mapping[str, object], Mapping[str, object]]] = {
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
    "softest modes, over frames": (4.0, {**KEPT, "modes": True}, KEPT),
    "angle up and down, two snaps": (1.6, TURNED, {}),
    "history of the snaps, over frames": (
        1.6,
        {**TURNED, **KEPT, "history": True},
        {**TURNED, **KEPT},
    ),
}


def rows(repeats: int, n_edges: int = 64) -> Iterator[Row]:
    """One row for the bare path, and two for each need: times the CPU time, and memory added."""
    bare: dict[tuple[float, str], tuple[float, int]] = {}

    def base(h_over_t: float, wants: Mapping[str, object]) -> tuple[float, int]:
        key = (h_over_t, repr(wants))
        if key not in bare:
            bare[key] = _cost(_folding(h_over_t, wants, n_edges), repeats)
        return bare[key]

    seconds, memory = base(4.0, {})
    note = f"{1e-3 * memory:.0f} kB"
    yield Row("need", f"none: h/t 4, N {n_edges}, quarter", 1e3 * seconds, "ms", None, note)
    for name, (h_over_t, wants, without) in NEEDS.items():
        before, held = base(h_over_t, without)
        taken, peak = _cost(_folding(h_over_t, wants, n_edges), repeats)
        yield Row("need", name, taken / before, "times", None, _added(taken - before, peak - held))
    yield from _outputs(repeats, seconds, n_edges)
    yield from _always(repeats, seconds, n_edges)
    yield from _planar(repeats, n_edges)


def _outputs(repeats: int, seconds: float, n_edges: int) -> Iterator[Row]:
    """What showing and storing a path costs, over folding it: files are left out, disks differ."""
    from der.viz.plots.path import figure_of_path
    from der.viz.rerun.recording import recording_bytes

    path = der.fold(circle(4.0, n_edges=n_edges, **BARE))
    shaped = der.fold(circle(4.0, n_edges=n_edges, **BARE, **KEPT))
    works: Mapping[str, Callable[[], object]] = {
        "record as JSON": path.to_json,
        "recording for playback": lambda: recording_bytes(shaped),
        "plot": lambda: figure_of_path(path).canvas.draw(),
    }
    for name, work in works.items():
        taken, peak = _cost(work, min(repeats, 5))
        yield Row("need", name, 1.0 + taken / seconds, "times", None, _added(taken, peak))


def _always(repeats: int, seconds: float, n_edges: int) -> Iterator[Row]:
    """Anisotropy, per Newton iteration: the section alone differs, and with it the path."""
    cases = {"anisotropic section": (4.0, None), "isotropic section": (4.0, section(1.0, 1.0))}
    scenes = {
        name: circle(h, n_edges=n_edges, **BARE)
        if given is None
        else der.Scene(der.circle(), given, n_edges=n_edges, **BARE)  # type: ignore[arg-type]
        for name, (h, given) in cases.items()
    }
    for name, scene in scenes.items():
        done = measured(lambda scene=scene: der.fold(scene), repeats, memory=False)  # type: ignore[misc]
        each = 1e6 * done.cpu / done.result.timing.newton_iterations
        yield Row("need", f"{name}, per Newton iteration", each, "us")


def _planar(repeats: int, n_edges: int) -> Iterator[Row]:
    """A circle squeezed from state to state, in its plane and in space, with a strut in it."""
    for n in (n_edges, 16 * n_edges):
        scene = circle(4.0, n_edges=n, **BARE)
        mesh = planar_ring(scene)
        flat = solved(mesh.rod(1), covered(mesh, 1), np.zeros(2))
        first = float(mesh.way() @ (mesh.length * np.sin(flat.phi)))
        lengths = np.linspace(first, 0.1 * first, 19)
        whole = scene_sector(scene, "full")
        tool = struts(balance(whole.body, whole.start.quat, whole.start.stretch), (0, n // 2))[-1]

        def in_plane(mesh=mesh, flat=flat, lengths=lengths) -> tuple[int, float]:  # type: ignore[no-untyped-def]
            phi, force, count = np.append(flat.phi, 0.5 * math.pi), np.zeros(4), 0
            rod = mesh.strutted()
            for length in lengths:
                at = solved(rod, phi, force, length)
                phi, force, count = at.phi, at.force, count + at.iterations + 1
            return count, at.moment

        def in_space(tool=tool, lengths=lengths) -> tuple[int, float]:  # type: ignore[no-untyped-def]
            state, count, piece = tool.piece.start, 0, tool.piece
            for length in lengths:
                at = equilibrium(piece.body, piece.held, state.but(load=tool.first - length))
                state, count = at.state, count + at.iterations + 1
            return count, -at.moment

        plane = measured(in_plane, repeats, memory=False)
        space = measured(in_space, repeats, memory=False)
        off = abs(scene.section.alpha * plane.result[1] / space.result[1] - 1.0)
        each = [1e9 * done.cpu / done.result[0] / n for done in (plane, space)]
        note = f"{1e3 * plane.cpu:.2f} of {1e3 * space.cpu:.2f} ms for 19 states; "
        note += f"{each[0]:.0f} of {each[1]:.0f} ns an edge and iteration; force {off:.0e} off"
        name = f"none out of the plane: N {n}, full ring"
        yield Row("need", name, plane.cpu / space.cpu, "times", None, note)


def _folding(h_over_t: float, wants: Mapping[str, object], n_edges: int) -> Callable[[], object]:
    scene = circle(h_over_t, **{**BARE, "n_edges": n_edges, **wants})
    return lambda: der.fold(scene)


def _cost(work: Callable[[], object], repeats: int) -> tuple[float, int]:
    done = measured(work, repeats)
    return done.cpu, done.memory or 0


def _added(seconds: float, memory: int) -> str:
    return f"{1e3 * seconds:+.1f} ms, {1e-3 * memory:+.0f} kB"
