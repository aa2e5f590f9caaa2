"""A recording shows the record, is read back here, and is written completely or not at all."""

import errno
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from numpy.testing import assert_allclose, assert_array_equal
from rerun.chunk import RrdReader

import der
from der.analysis.landscape.landscape import landscape
from der.analysis.landscape.surface import energy_surface
from der.records.configurations import Fall, Shapes, Softest
from der.records.path import Timing, counts
from der.utils import files
from der.viz.animation import animate
from der.viz.rerun.recording import recording_bytes, save_landscape, save_recording

EDGES = 32


@pytest.fixture(scope="module", autouse=True)
def strict():
    """Wrong shapes raise: by default rerun only warns."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture(scope="module")
def path():
    """A circle of h/t = 1.6, which snaps back: two folds with an unstable branch in between."""
    scene = der.Scene(
        der.circle(), der.rectangular_section(h_over_t=1.6), n_edges=EDGES, shapes=True
    )
    return der.fold(scene)


@pytest.fixture(scope="module")
def read(path, tmp_path_factory):
    """The recording of that path, read back."""
    file = tmp_path_factory.mktemp("rrd") / "path.rrd"
    save_recording(path, file)
    return Recording(file)


class Recording:
    """Columns of a file, by entity and component; None for the step of what is static."""

    def __init__(self, file):
        self.columns = {}
        for chunk in RrdReader(file).stream():
            batch = chunk.to_record_batch()
            steps = None if chunk.is_static else batch.column("step").to_pylist()
            for name in batch.schema.names:
                if ":" in name:
                    rows = batch.column(name).to_pylist()
                    key = (chunk.entity_path, name)
                    known = self.columns.setdefault(key, ([], []))
                    known[0].extend(steps or [None] * len(rows))
                    known[1].extend(rows)

    def rows(self, entity, name):
        """Values by step, in their order: a chunk may be sorted by the other timeline."""
        steps, values = self.columns[entity, name]
        order = sorted(range(len(steps)), key=lambda k: steps[k] or 0)
        return {steps[k]: values[k] for k in order}

    def series(self, name):
        """Steps and values of a scalar."""
        rows = self.rows(f"/series/{name}", "Scalars:scalars")
        return list(rows), np.array([value for (value,) in rows.values()])

    @property
    def entities(self):
        """Paths of all that was logged."""
        return {entity for entity, _ in self.columns}


def written(tmp_path, path):
    save_recording(path, tmp_path / "some.rrd")
    return Recording(tmp_path / "some.rrd")


def falling(path, steps=5):
    """The path with a fall: from the first fold to where gamma is the same on the last branch."""
    after = path.folds[0].position
    chosen = np.linspace(after, len(path) - 1, steps).astype(int)
    kept = (getattr(path, name)[chosen] for name in ("gamma", "energy"))
    fall = Fall(after, *kept, path.shapes.x[chosen], path.shapes.frames[chosen])
    return replace(path, shapes=replace(path.shapes, falls=(fall,)))


def softened(path, classes, eigenvalues, u):
    """The path with softest modes."""
    softest = Softest(classes, eigenvalues, u)
    return replace(path, shapes=replace(path.shapes, softest=softest))


def same(one, other):
    command = [sys.executable, "-m", "rerun", "rrd", "compare", "--unordered", one, other]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


# --- What is in it ---------------------------------------------------------------------------


def test_everything_asked_for_has_its_place(read):
    for entity in (
        *("ring/ribbon", "ring/centreline", "ring/axis", "ring/trace/0", "ring/trace/1"),
        *(f"ring/grips/{g}/{k}" for g in ("first", "second") for k in ("rotation", "moment")),
        *(
            f"curves/{c}/{k}"
            for c in ("moment", "energy")
            for k in ("stable_at_fixed_gamma", "unstable_at_fixed_gamma", "now")
        ),
        *("series/moment", "series/energy", "series/gamma", "series/index"),
        *("events", "states/stability", "states/event", "about", "key/bar"),
    ):
        assert f"/{entity}" in read.entities
    assert "/ring/softest_mode" not in read.entities


def test_every_state_is_a_step_and_nothing_else_is(path, read):
    for entity, name in (
        ("/ring/ribbon", "Mesh3D:vertex_positions"),
        ("/ring/ribbon", "bending:colors"),
        ("/ring/centreline", "LineStrips3D:strips"),
        ("/curves/energy/now", "Points2D:positions"),
    ):
        assert list(read.rows(entity, name)) == list(range(len(path)))


@pytest.mark.parametrize("name", ["moment", "energy", "gamma"])
def test_series_are_those_of_the_record(path, read, name):
    """Bit for bit: scalars are float64."""
    steps, values = read.series(name)
    assert steps == list(range(len(path)))
    assert_array_equal(values, getattr(path, name))


def test_index_is_there_where_it_is_known(path, read):
    steps, values = read.series("index")
    known = [k for k, index in enumerate(path.index.tolist()) if index is not None]
    assert steps == known
    assert_array_equal(values, path.index[known])


def test_second_timeline_is_gamma_in_millidegrees(path, tmp_path):
    file = tmp_path / "some.rrd"
    save_recording(path, file)
    chunks = [c for c in RrdReader(file).stream() if c.entity_path == "/series/gamma"]
    (batch,) = [c.to_record_batch() for c in chunks if not c.is_static]
    steps, mdeg = (batch.column(name).to_numpy() for name in ("step", "gamma_mdeg"))
    assert_allclose(mdeg, 1e3 * np.degrees(path.gamma[steps]), atol=0.5)


def test_centreline_is_closed_and_goes_through_the_vertices(path, read):
    """To float32, of numbers below 2."""
    rows = read.rows("/ring/centreline", "LineStrips3D:strips")
    for k in (0, len(path) // 2, len(path) - 1):
        line = np.array(rows[k][0])
        assert_array_equal(line[0], line[-1])
        assert_allclose(line[:-1], path.shapes.x[k], atol=2e-7)


def test_section_is_a_rectangle_to_scale_about_its_vertex(path, read):
    """Eight corners, in pairs, of a rectangle h by t along d1 and d2 of the flat ring."""
    t, h = 1 / 200, 1.6 / 200
    corners = np.array(read.rows("/ring/ribbon", "Mesh3D:vertex_positions")[0])[:8]
    assert_allclose(corners.mean(axis=0), path.shapes.x[0, 0], atol=1e-6)
    assert_array_equal(corners[::2], corners[1::2])
    sides = np.linalg.norm(np.diff(corners[::2], axis=0), axis=1)
    factor = animate(path).section.factor
    assert_allclose(sides, factor * np.array([h, t, h]), rtol=1e-4)
    assert corners[0, 0] - corners[2, 0] == pytest.approx(factor * h, rel=1e-4)  # d1 = E1
    assert f"{factor:g} times as large" in read.rows("/about", "TextDocument:text")[None][0]


def test_section_that_can_be_seen_is_drawn_as_it_is(path):
    thick = replace(path, numerics={**path.numerics, "a_over_t": 5.0})
    assert animate(thick).section.factor == 1.0
    assert animate(thick).section.t == pytest.approx(0.2)


def test_section_without_shape_has_that_of_its_stiffnesses(path):
    """beta/alpha = (h/t)^2 (paper, Eq. A.16)."""
    bare = replace(path, section={**path.section, "h_over_t": None, "nu": None})
    drawn = animate(bare).section
    assert drawn.h / drawn.t == pytest.approx(1.6)


def test_normals_are_unit_and_point_out_of_the_faces(path, read):
    """Along every normal, the vertex lies farther out than the middle of its section."""
    k = len(path) // 2
    positions = np.array(read.rows("/ring/ribbon", "Mesh3D:vertex_positions")[k])
    normals = np.array(read.rows("/ring/ribbon", "Mesh3D:vertex_normals")[k])
    assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    from_middle = positions - np.repeat(path.shapes.x[k], 8, axis=0)
    assert np.all(np.sum(from_middle * normals, axis=1) > 0.01)


def test_triangles_turn_outwards_and_close_the_surface(path, read):
    """Volume enclosed, by the divergence theorem: h t 2 pi (Pappus), to 1% at N = 32."""
    positions = np.array(read.rows("/ring/ribbon", "Mesh3D:vertex_positions")[0])
    triangles = np.array(read.rows("/ring/ribbon", "Mesh3D:triangle_indices")[None])
    assert triangles.shape == (8 * EDGES, 3)
    a, b, c = positions[triangles].swapaxes(0, 1)
    volume = np.sum(a * np.cross(b, c)) / 6
    drawn = animate(path).section
    assert volume == pytest.approx(drawn.h * drawn.t * 2 * np.pi, rel=0.01)


def test_energy_densities_add_up_to_the_energy(path):
    """Sum over the cells of both = U of the record, to rounding (logarithmic curvature)."""
    motion = animate(path)
    cell = 2 * np.pi / EDGES
    assert_allclose(cell * motion.density.sum(axis=(0, 2)), path.energy, atol=1e-10)


def test_folded_ring_is_bent_and_not_twisted(path):
    """At pi, curvature 3 against natural 1: density alpha (3 - 1)^2 / 2 all round."""
    bending, twisting = animate(path).density[:, -1]
    assert_allclose(bending, 2 * path.section["alpha"], rtol=1e-6)
    assert_allclose(twisting, 0, atol=1e-8)


def test_colours_rise_with_the_density(path, read):
    """Darkest where there is none, brightest at the largest, eight alike in each section."""
    motion = animate(path)
    for name, density in zip(("bending", "twisting"), motion.density, strict=True):
        rows = read.rows("/ring/ribbon", f"{name}:colors")
        assert set(rows[0]) == {0x440154FF}  # the flat ring is free of stress
        at = int(np.argmax(density.max(axis=1)))
        colours = np.array(rows[at]).reshape(EDGES, 8)
        assert np.all(colours == colours[:, :1])
        red, green, blue = ((colours[:, 0] >> shift) & 255 for shift in (24, 16, 8))
        light = (0.2126 * red + 0.7152 * green + 0.0722 * blue)[np.argsort(density[at])]
        assert np.all(np.diff(light) >= -1.0)


@pytest.mark.parametrize(("grip", "edge", "sign"), [("first", 0, 1), ("second", EDGES // 2, -1)])
def test_grip_arrows_show_its_turn_and_its_moment(path, read, grip, edge, sign):
    """One grip turns +gamma about the axis, the other -gamma; moments likewise along it."""
    turned = read.rows(f"/ring/grips/{grip}/rotation", "Arrows3D:vectors")
    moments = read.rows(f"/ring/grips/{grip}/moment", "Arrows3D:vectors")
    arcs = read.rows(f"/ring/grips/{grip}/angle", "LineStrips3D:strips")
    centres = read.rows(f"/ring/grips/{grip}/rotation", "Arrows3D:origins")
    for k in range(len(path)):
        x, y, z = turned[k][0]
        gamma = sign * path.gamma[k]
        size = np.hypot(x, y)
        assert_allclose([x / size, y / size, z], [np.cos(gamma), np.sin(gamma), 0], atol=1e-6)
        end = np.array(arcs[k][0][-1]) - centres[k][0]  # the arc ends on the arrow
        assert_allclose(np.cross(end, turned[k][0]), 0, atol=1e-6)
        share = moments[k][0][2] / np.abs(path.moment).max()
        assert sign * path.moment[k] * share >= 0
    largest = int(np.argmax(path.moment))
    assert sign * moments[largest][0][2] == pytest.approx(0.4, rel=0.01)


def test_trace_leads_to_where_the_free_point_is(path, read):
    rows = read.rows("/ring/trace/0", "LineStrips3D:strips")
    x, j = path.shapes.x, EDGES // 4
    for k in range(1, len(path)):
        before, now = np.array(rows[k][0])
        assert_allclose(now, 0.5 * (x[k, j - 1] + x[k, j]), atol=1e-6)
        assert_array_equal(before, rows[k - 1][0][1])


def test_dot_is_on_the_curve_and_the_curve_has_its_two_kinds(path, read):
    dots = read.rows("/curves/moment/now", "Points2D:positions")
    stable, unstable = (
        [np.array(s) for s in read.rows(f"/curves/moment/{k}", "LineStrips2D:strips")[None]]
        for k in ("stable_at_fixed_gamma", "unstable_at_fixed_gamma")
    )
    assert (len(stable), len(unstable)) == (2, 1)
    first, second = (fold.position for fold in path.folds)
    assert_allclose(unstable[0][[0, -1]], [dots[first][0], dots[second][0]], atol=1e-4)
    curve = np.concatenate([*stable, *unstable])
    for ((x, y),) in dots.values():
        assert np.hypot(*(curve - [x, y]).T).min() < 1e-4


def test_events_are_in_the_log_at_their_steps(path, read):
    rows = read.rows("/events", "TextLog:text")
    assert list(rows) == [point.position for point in path.points]
    fold = rows[path.folds[0].position][0]
    assert fold.startswith(f"fold, gamma {path.folds[0].gamma:.8g}")
    assert "index 0 -> 1" in fold


def test_state_lines_change_where_the_ring_does(path, read):
    said = [state for (state,) in read.rows("/states/stability", "StateChange:state").values()]
    assert said == ["stable at fixed γ", "index 1", "stable at fixed γ"]
    events = read.rows("/states/event", "StateChange:state")
    assert events[0] == ["start"]
    assert events[path.folds[0].position] == ["fold"]


def test_parameters_are_in_the_text(read):
    text = read.rows("/about", "TextDocument:text")[None][0]
    assert text.startswith("# circle, h/t = 1.6\n")
    assert f"| n edges | {EDGES} |" in text


# --- What may be given besides ---------------------------------------------------------------


def test_fall_is_put_in_after_its_state(path, tmp_path):
    """M is not known while the ring falls; all states keep their order."""
    path = falling(path)
    (fall,) = path.shapes.falls
    motion = animate(path)
    new = slice(fall.after + 1, fall.after + 6)
    assert len(motion.x) == len(path) + 5
    assert_array_equal(motion.x[new], fall.x)
    assert_array_equal(motion.gamma[new], fall.gamma)
    assert_array_equal(motion.energy[new], fall.energy)
    assert_array_equal(motion.position[motion.position >= 0], np.arange(len(path)))

    read = written(tmp_path, path)
    _, moments = read.series("moment")  # a nan breaks the line
    assert_array_equal(moments, np.insert(path.moment, fall.after + 1, [np.nan] * 5))
    assert read.rows("/curves/moment/now", "Points2D:positions")[new.start] == []
    assert len(read.rows("/curves/energy/now", "Points2D:positions")[new.start]) == 1
    assert read.rows("/states/stability", "StateChange:state")[new.start] == ["in motion"]
    *_, last = read.rows("/events", "TextLog:text")
    assert last == path.points[-1].position + 5


def test_eigenvalues_are_series_named_after_their_symmetry(path, tmp_path):
    """Bit for bit, one series each."""
    values = np.linspace(1, -1, 2 * len(path)).reshape(-1, 2)
    path = softened(path, ("in phase", "odd"), values, path.shapes.x)
    read = written(tmp_path, path)
    assert_array_equal(read.series("eigenvalues/in_phase")[1], values[:, 0])
    assert_array_equal(read.series("eigenvalues/odd")[1], values[:, 1])


def test_softest_mode_is_a_ghost_but_not_in_a_fall(path, tmp_path):
    """Displaced by the mode, at most by a fifth of the ring's radius."""
    u = np.zeros_like(path.shapes.x)
    u[:, :, 1] = np.cos(np.arange(EDGES))
    falls = falling(softened(path, ("odd",), np.ones((len(path), 1)), u))
    rows = written(tmp_path, falls).rows("/ring/softest_mode", "LineStrips3D:strips")
    assert rows[falls.shapes.falls[0].after + 1] == []
    moved = np.array(rows[4][0])[:-1] - path.shapes.x[4]
    assert_allclose(moved[:, [0, 2]], 0, atol=1e-6)
    assert np.abs(moved).max() == pytest.approx(0.2, rel=0.01)


def test_mode_without_displacements_has_no_ghost(path, tmp_path):
    """As of a ring that only spins about its own centreline."""
    still = softened(path, ("odd",), np.ones((len(path), 1)), 0.0 * path.shapes.x)
    rows = written(tmp_path, still).rows("/ring/softest_mode", "LineStrips3D:strips")
    assert set(map(len, rows.values())) == {0}


def test_a_snap_is_a_dotted_drop_and_no_part_of_the_curve(tmp_path):
    """The smooth strips end at the fold; the dashes begin there and end at the landing."""
    scene = der.Scene(
        der.circle(), der.rectangular_section(1.6), n_edges=EDGES, control="angle", shapes=True
    )
    path = der.fold(scene)
    read = written(tmp_path, path)
    (snap,) = (point.position for point in path.points if point.kind == "snap")
    dots = read.rows("/curves/moment/now", "Points2D:positions")
    dashes = np.array(read.rows("/curves/moment/snaps", "LineStrips2D:strips")[None])
    assert len(dashes) > 10
    assert_allclose(dashes[0, 0], dots[snap - 1][0], atol=1e-4)
    assert np.hypot(*(dashes[-1, -1] - dots[snap][0])) < 1.5
    curve = read.rows("/curves/moment/stable_at_fixed_gamma", "LineStrips2D:strips")[None]
    assert [len(strip) > 10 for strip in curve] == [True, True]
    assert_allclose(curve[0][-1], dots[snap - 1][0], atol=1e-4)
    assert_allclose(curve[1][0], dots[snap][0], atol=1e-4)


def test_rest_takes_the_place_of_the_flat_ring(path):
    """Natural strains of no bar: the flat circle then bears alpha/2 all round."""
    bending, _ = animate(path, rest=np.zeros((EDGES, 3))).density[:, 0]
    assert_allclose(bending, 0.5 * path.section["alpha"], rtol=1e-9)


def cut(path, states, **changes):
    """Some states of a path."""
    arrays = {name: getattr(path, name)[states] for name in ("gamma", "moment", "energy")}
    entries = {name: getattr(path, name)[states] for name in ("index", "index_moment")}
    shapes = Shapes(path.shapes.x[states], path.shapes.frames[states])
    return replace(path, **arrays, **entries, points=(), shapes=shapes, **changes)


def test_one_state_is_a_recording(path, tmp_path):
    assert written(tmp_path, cut(path, slice(0, 1))).series("moment")[0] == [0]


def test_path_without_stability_has_neither_index_nor_its_line(path, tmp_path):
    unknown = replace(path, index=counts([None] * len(path)))
    entities = written(tmp_path, unknown).entities
    assert not entities & {
        "/series/index",
        "/states/stability",
        "/curves/moment/stable_at_fixed_gamma",
    }


# --- What is refused -------------------------------------------------------------------------


def test_path_without_shapes_is_refused(path):
    with pytest.raises(ValueError, match="path must have shapes"):
        recording_bytes(replace(path, shapes=None))


def test_path_that_does_not_begin_flat_needs_its_natural_strains(path):
    with pytest.raises(ValueError, match="rest must be given where gamma begins at"):
        animate(cut(path, slice(3, None)))


def test_rest_of_another_ring_is_refused(path):
    with pytest.raises(ValueError, match=r"rest must have shape \(32, 3\), got \(2, 3\)"):
        animate(path, rest=np.zeros((2, 3)))


@pytest.mark.parametrize("name", ["motion.mp4", "motion", "rrd"])
def test_other_suffix_is_refused_before_any_work(path, tmp_path, name):
    with pytest.raises(ValueError, match=rf"rrd must end in .rrd, got '.*{name}'"):
        save_recording(path, tmp_path / name)


def test_absent_folder_is_named(path, tmp_path):
    with pytest.raises(ValueError, match=r"rrd '.*nowhere/some\.rrd' cannot be written"):
        save_recording(path, tmp_path / "nowhere" / "some.rrd")


def test_full_disk_leaves_the_old_file_and_nothing_else(path, tmp_path, monkeypatch):
    """Half of the bytes go to the disk before it is full."""
    file = tmp_path / "some.rrd"
    file.write_bytes(b"before")

    def fill(place, write):
        def full(opened):
            opened.write(b"RRF2")
            raise OSError(errno.ENOSPC, "No space left on device")

        files.write_whole(place, full)

    monkeypatch.setattr("der.viz.files.write_whole", fill)
    with pytest.raises(ValueError, match=r"some\.rrd' cannot be written: No space left on device"):
        save_recording(path, file)
    assert file.read_bytes() == b"before"
    assert [found.name for found in tmp_path.iterdir()] == ["some.rrd"]


# --- Always the same, small, and fast --------------------------------------------------------


def test_equal_paths_have_equal_recordings_and_others_have_not(path, tmp_path):
    """By `rerun rrd compare`: row ids are random, all else is the same."""
    one, two, three = (tmp_path / f"{k}.rrd" for k in (1, 2, 3))
    save_recording(path, one)
    again = replace(path, timing=Timing(9.0, 9, 9), shapes=Shapes(**vars(path.shapes)))
    save_recording(again, two)
    save_recording(replace(path, moment=path.moment + 1e-9), three)
    names = [RrdReader(file).recordings()[0].recording_id for file in (one, two, three)]
    assert names[0] == names[1] != names[2]
    assert same(one, two)
    assert not same(one, three)


def test_400_steps_of_128_edges_stay_below_10_megabytes():
    """The bound that was set; neighbouring states repeated would be no easier to compress."""
    scene = der.Scene(
        der.circle(),
        der.rectangular_section(h_over_t=1.6),
        n_edges=128,
        shapes=True,
        stability=False,
        save_at=tuple(np.linspace(0, np.pi, 341)[1:]),
    )
    long = der.fold(scene)
    assert len(long) >= 400
    assert len(recording_bytes(long)) / len(long) * 400 < 10e6


# --- Two rings, and landscapes ---------------------------------------------------------------


@pytest.fixture(scope="module")
def slim():
    """A circle of h/t = 4, whose gamma never turns back."""
    scene = der.Scene(der.circle(), der.rectangular_section(4), n_edges=EDGES, shapes=True)
    return der.fold(scene)


def test_two_rings_are_on_one_timeline(path, slim, tmp_path):
    """Each with its own entities, a row a step, at equal gamma until the first of them folds."""
    read = written(tmp_path, [path, slim])
    rows = [
        read.rows(f"/{under}/ring/centreline", "LineStrips3D:strips")
        for under in ("first", "second")
    ]
    assert list(rows[0]) == list(rows[1]) == list(range(len(rows[0])))
    gamma = [
        np.array([v for (v,) in read.rows(f"/{under}/series/gamma", "Scalars:scalars").values()])
        for under in ("first", "second")
    ]
    until = int(np.argmax(gamma[0] > path.folds[1].gamma - 0.1))
    assert until > 50
    assert_allclose(gamma[0][:until], gamma[1][:until], atol=2 * np.pi / 240)
    for whole, strips in zip((path, slim), rows, strict=True):
        last = np.array(strips[len(strips) - 1][0])[:-1]
        assert_allclose(last, whole.shapes.x[-1], atol=2e-7)


def test_two_rings_share_panels_and_the_log_names_them(path, slim, tmp_path):
    """One pair of axes; the point where both are flat is in the same place."""
    read = written(tmp_path, [path, slim])
    for name in ("moment", "energy"):
        assert f"/curves/{name}/axes" in read.entities
        dots = [
            read.rows(f"/{under}/curves/{name}/now", "Points2D:positions")[0][0]
            for under in ("first", "second")
        ]
        assert_allclose(*dots, atol=1e-6)
    for under, called, whole in (("first", "1.6", path), ("second", "4", slim)):
        lines = read.rows(f"/{under}/events", "TextLog:text")
        assert len(lines) == len(whole.points)
        assert all(line.startswith(f"circle, h/t = {called}: ") for (line,) in lines.values())


def test_three_rings_are_too_many(path):
    with pytest.raises(ValueError, match="path must be one or two, got 3"):
        recording_bytes([path] * 3)


def landscape_scene(h_over_t):
    return der.Scene(
        der.circle(), der.rectangular_section(h_over_t), n_edges=16, shapes=True, error_bars=False
    )


def test_landscape_has_its_rests_barriers_and_the_present_state(tmp_path):
    """Wells flat and folded, the saddle in between, and a dot on U at every step."""
    found = landscape(landscape_scene(4))
    save_landscape(found, tmp_path / "l.rrd")
    read = Recording(tmp_path / "l.rrd")
    whole = read.rows("/landscape/whole/well", "Points2D:positions")[None]
    saddle = read.rows("/landscape/whole/saddle", "Points2D:positions")[None]
    dots = read.rows("/landscape/whole/now", "Points2D:positions")
    assert list(dots) == list(range(len(found.path)))
    at = [rest.position for rest in found.rests]
    for place, k in zip((whole[0], saddle[0], whole[1]), at, strict=True):
        assert_allclose(place, dots[k][0], atol=1e-4)
    said = read.rows("/landscape/whole/fold/text", "Points2D:labels")[None]
    assert said == [f"to fold {found.barriers.fold:.4g}"]
    said = read.rows("/landscape/well/open/text", "Points2D:labels")[None]
    assert said == [f"to open {found.barriers.open:.4g}"]
    inside = [k for k, row in read.rows("/landscape/well/now", "Points2D:positions").items() if row]
    assert inside == [k for k in range(len(found.path)) if k >= min(inside)]
    assert inside[0] <= at[1] <= at[2] == inside[-1]


def test_present_state_moves_on_the_surface(tmp_path):
    """Its places are those of the path of twisting: the same states on another mesh of gamma."""
    scene = landscape_scene(1.6)
    ground = energy_surface(scene, shape=(7, 6))
    save_landscape(landscape(scene), tmp_path / "s.rrd", surface=ground)
    read = Recording(tmp_path / "s.rrd")
    dots = np.array([row[0] for row in read.rows("/surface/now", "Points3D:positions").values()])
    line = np.array(read.rows("/surface/path", "LineStrips3D:strips")[None][0])
    ends = [np.linalg.norm(line - dot, axis=1).min() for dot in dots[[0, -1]]]
    assert_allclose(ends, 0, atol=1e-5)
    for dot in dots:
        a, way = line[:-1], np.diff(line, axis=0)
        share = np.clip(np.sum((dot - a) * way, axis=1) / np.sum(way**2, axis=1), 0, 1)
        assert np.linalg.norm(a + share[:, None] * way - dot, axis=1).min() < 0.02
    corners = np.array(read.rows("/surface/energy", "Mesh3D:vertex_positions")[None])
    triangles = np.array(read.rows("/surface/energy", "Mesh3D:triangle_indices")[None])
    assert len(corners) == ground.energy.size
    known = np.isfinite(ground.energy.ravel()) & (corners[:, 2] <= 0.55 + 1e-6)
    assert known[triangles].all()


def test_landscape_without_shapes_is_refused(tmp_path):
    found = landscape(replace(landscape_scene(4), shapes=False))
    with pytest.raises(ValueError, match="path must have shapes"):
        save_landscape(found, tmp_path / "l.rrd")
