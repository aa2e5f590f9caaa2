"""`--rrd`: the recording is read back, and holds what the path holds."""

import os
import subprocess
import sys

import numpy as np
import pytest
from rerun.chunk import RrdReader

import der
from der import view_rerun


@pytest.fixture(scope="module")
def path():
    """The snap-back at h/t = 1.6, with its shapes."""
    scene = der.Scene(der.circle(), der.rectangular_section(1.6), n_edges=32, shapes=True)
    return der.fold(scene)


@pytest.fixture(scope="module")
def columns(path, tmp_path_factory):
    """What is logged over the steps: (entity, component) -> one value a step."""
    file = tmp_path_factory.mktemp("rrd") / "path.rrd"
    view_rerun.save_recording(path, file)
    return read(file)


def read(file):
    """Columns of a recording that change with the step, in the order of the steps."""
    found = {}
    for chunk in RrdReader(str(file)).stream():
        if chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        steps = batch.column("step").to_pylist()
        for name in batch.schema.names:
            if ":" in name or name in ("step", "gamma_mdeg"):
                rows = zip(steps, batch.column(name).to_pylist(), strict=True)
                found.setdefault((chunk.entity_path, name), []).extend(rows)
    return {
        key: [value for _, value in sorted(rows, key=lambda row: row[0])]
        for key, rows in found.items()
    }


def test_every_state_is_a_step(path, columns):
    """In path order, from 0 on; gamma in millidegrees beside it, which is not monotonic."""
    assert columns["/series/moment", "step"] == list(range(len(path)))
    mdeg = np.array(columns["/series/moment", "gamma_mdeg"])
    np.testing.assert_allclose(mdeg, 1e3 * np.degrees(path.gamma), atol=0.5)


def test_moment_is_that_of_the_path(path, columns):
    """Scalars are doubles."""
    logged = [value for (value,) in columns["/series/moment", "Scalars:scalars"]]
    assert logged == path.moment.tolist()


def test_centreline_is_that_of_the_shapes(path, columns):
    """Single precision; closed."""
    (line,) = columns["/ring/centreline", "LineStrips3D:strips"][7]
    np.testing.assert_allclose(line[: len(path.shapes.x[7])], path.shapes.x[7], atol=1e-6)


def test_every_special_point_is_an_event(path, columns):
    """Folds, limits and contacts, at their steps."""
    steps = columns["/events", "step"]
    assert {point.position for point in path.points} <= set(steps)


def test_identical_paths_make_identical_recordings(path, columns, tmp_path):
    """All that is logged is the same, bit for bit."""
    view_rerun.save_recording(path, tmp_path / "again.rrd")
    assert read(tmp_path / "again.rrd") == columns


@pytest.mark.parametrize("place", ["missing/p.rrd", "p.txt"])
def test_a_bad_place_is_named_and_left_clean(path, tmp_path, place):
    """No half of a recording stays behind."""
    with pytest.raises(ValueError, match=place.split("/")[-1]):
        view_rerun.save_recording(path, tmp_path / place)
    assert not list(tmp_path.iterdir())


def test_on_a_full_disk_nothing_stays_behind(path, tmp_path, monkeypatch):
    """The error names the file; rerun itself would exit 0."""

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(ValueError, match=r"p\.rrd.*No space left"):
        view_rerun.save_recording(path, tmp_path / "p.rrd")
    assert not list(tmp_path.iterdir())


def test_rerun_is_imported_only_for_a_recording(tmp_path):
    """A fold without --rrd does not pay for it."""
    program = (
        "import sys; from der.cli import main\n"
        "try: main(['fold', 'circle', '--h-over-t', '4', '--edges', '16', '--quiet'])\n"
        "except SystemExit: pass\n"
        "sys.exit('rerun' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=False)
    assert done.returncode == 0
