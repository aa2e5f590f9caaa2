"""What a scene does not ask for is neither computed, nor allocated, nor imported."""

import json
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest

import der
from der.kernels.assembly import derivatives
from der.kernels.planar import assemble_planar
from der.rod.gripped_ring import gripped_ring
from der.rod.planar_ring import covered, planar_ring
from der.rod.relaxation import relax
from validation.benchmark.rows import peak_memory

BARE = {"n_edges": 32, "stability": False, "self_crossings": False, "gamma_max": 0.6}

# what may be asked for -> who does it, in the module that calls it
DOERS = {
    "stability": ({"stability": True}, "der.rod.stability.indices_and_stiffness"),
    "self_crossings": ({"self_crossings": True}, "der.rod.gripped_ring.link"),
    "error bars": ({"error_bars": True}, "der.analysis.error_bars.error_bars"),
    "shapes": ({"shapes": True}, "der.analysis.full_ring.shapes"),
    "forces": ({"forces": True}, "der.rod.forces.forces"),
    "forces along the ring": ({"shapes": True, "forces": True}, "der.rod.forces.internal"),
    "modes": ({"shapes": True, "modes": True}, "der.rod.stability.softest_modes"),
    "relaxation": ({"control": "angle", "solver": "relaxation"}, "der.rod.relaxation._relax"),
}


class Done(Exception):
    """The thing was done."""


def scene(**wants):
    return der.Scene(der.circle(), der.rectangular_section(4.0), **{**BARE, **wants})


@pytest.mark.parametrize("need", DOERS)
def test_what_is_not_asked_for_is_not_computed(need, monkeypatch):
    """Whoever computes it is not called without, and is called with it."""
    wants, doer = DOERS[need]
    der.fold(scene())  # kernels load before, and check stability and contacts never by the way

    def done(*_, **__):
        raise Done

    monkeypatch.setattr(doer, done)
    der.fold(scene())
    with pytest.raises(Done):
        der.fold(scene(**wants))


def test_what_is_not_asked_for_is_not_in_the_record():
    """No index, error, raw values, forces or shapes; with frames alone, no modes and no falls."""
    path = der.fold(scene())
    assert path.error is None
    assert path.forces is None
    assert path.scale is None
    assert path.raw is None
    assert path.shapes is None
    assert np.ma.getmaskarray(path.index).all()
    kept = der.fold(scene(shapes=True)).shapes
    assert kept.softest is None
    assert kept.internal is None
    assert kept.falls == ()


def test_history_of_snaps_is_kept_only_where_it_is_asked_for():
    """A ring that snaps (h/t = 1.6) has falls with history, and none without."""
    wants = {"n_edges": 16, "stability": False, "self_crossings": False, "control": "angle"}
    section = der.rectangular_section(1.6)
    falls = [
        der.fold(der.Scene(der.circle(), section, shapes=True, history=asked, **wants)).shapes.falls
        for asked in (False, True)
    ]
    assert falls[0] == ()
    assert len(falls[1]) > 0


def kept_bytes(work):
    """Memory that the result of ``work`` holds on to."""
    work()  # what is loaded by the way is no memory of the result
    tracemalloc.start()
    try:
        result = work()
        return tracemalloc.get_traced_memory()[0], result
    finally:
        tracemalloc.stop()


def test_frames_are_kept_only_where_they_are_asked_for():
    """A record without frames holds less than one with them, by 12 numbers an edge and state."""
    lean, path = kept_bytes(lambda: der.fold(scene(n_edges=64)))
    full, _ = kept_bytes(lambda: der.fold(scene(n_edges=64, shapes=True)))
    frames = len(path) * 64 * 12 * 8
    assert full - lean == pytest.approx(frames, rel=0.1)
    assert lean < frames


def test_history_is_allocated_only_where_it_is_asked_for():
    """A relaxation reserves room for its configurations, or none."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 16)

    def rest(every):
        relax(ring, ring.start, every=every, most=20_000)

    rest(0)
    assert peak_memory(lambda: rest(0)) < 0.1 * peak_memory(lambda: rest(1))


@pytest.mark.parametrize(("stretching", "block"), [(0.0, 3), (1e4, 4)])
def test_stretch_takes_unknowns_only_where_it_is_finite(stretching, block):
    """Three unknowns an edge, and four where the edges stretch: blocks of that size."""
    ring = gripped_ring(der.circle(), der.rectangular_section(4.0), 16, stretching=stretching)
    state = ring.start
    system, _ = derivatives(ring.rod, ring.supports, *state)
    assert system.diag.shape[1:] == (block, block)
    assert len(system.diag) < 8  # of a quarter, not of the ring


OPTIONAL = (
    "der.analysis.error_bars",
    "der.analysis.extrapolation.curve",
    "der.analysis.loading",
    "der.analysis.snap",
    "der.rod.relaxation",
    "der.analysis.loading_by_relaxation",
    "der.analysis.full_ring",
    "der.rod.forces",
    "der.viz.rerun.recording",
    "der.viz.plots.path",
    "validation",
    "matplotlib",
    "rerun",
    "rich",
    "shapely",
    "distributed",
)
NEEDED = {
    "": set(),
    "error_bars=True, shapes=True": {
        "der.analysis.error_bars",
        "der.analysis.extrapolation.curve",
        "der.analysis.full_ring",
    },
    "control='angle'": {"der.analysis.loading", "der.analysis.snap", "der.rod.relaxation"},
}


@pytest.mark.parametrize("wants", NEEDED)
def test_what_is_not_asked_for_is_not_imported(wants):
    """A fresh Python folds a ring and has loaded what the scene needs, and nothing else of it."""
    code = (
        "import json, sys, der\n"
        "scene = der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=32,"
        f" stability=False, self_crossings=False, gamma_max=0.1, {wants})\n"
        f"der.fold(scene)\nprint(json.dumps([n for n in {OPTIONAL!r} if n in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(json.loads(done.stdout)) == NEEDED[wants]


SPATIAL = (
    "der.kernels.quaternions",
    "der.kernels.strain",
    "der.kernels.assembly",
    "der.rod.equilibrium",
    "der.rod.rod",
    "der.rod.gripped_ring",
)


@pytest.mark.parametrize(
    ("work", "area"),
    [("der.planar(scene)", True), ("der.squeeze(scene, 1.0)", False)],
)
def test_a_planar_scene_knows_nothing_of_space(work, area):
    """It loads no kernel of the rod in space, and shapely only for a packing ratio."""
    code = (
        "import json, sys, der\n"
        "scene = der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=32)\n"
        f"{work}\n"
        f"print(json.dumps([n for n in {(*SPATIAL, *OPTIONAL)!r} if n in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == ["shapely"] * area


def test_a_planar_scene_allocates_one_unknown_an_edge():
    """What it asks for at most is less than half of what the rod in space does, at equal edges."""
    in_grips = gripped_ring(der.circle(), der.rectangular_section(4.0), 1024, name="full")
    state = in_grips.start
    in_its_plane = planar_ring(der.Scene(der.circle(), der.rectangular_section(4.0), n_edges=1024))
    rod, phi = in_its_plane.rod(1), covered(in_its_plane, 1)

    def in_space():
        derivatives(in_grips.rod, in_grips.supports, *state)

    def in_plane():
        assemble_planar(rod, phi, np.zeros(2), 0.0)

    for load in (in_space, in_plane):
        load()  # kernels are no memory of the work
    assert peak_memory(in_plane) < 0.5 * peak_memory(in_space)
