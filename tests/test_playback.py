"""`--rrd` from the command line; what a recording holds is tested in test_view_rerun.py."""

import subprocess
import sys

import pytest
from rerun.chunk import RrdReader

import der
from der.cli import main

SMALL = ("fold", "circle", "--h-over-t", "4", "--edges", "16", "--quiet")


def test_rrd_writes_a_recording_of_every_state(tmp_path):
    """One row of M a state, in as many steps as the record has states."""
    record, file = tmp_path / "p.json", tmp_path / "p.rrd"
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, "--rrd", str(file), "--json", str(record)])
    assert ended.value.code == 0
    rows = [
        chunk.to_record_batch().num_rows
        for chunk in RrdReader(str(file)).stream()
        if chunk.entity_path == "/series/moment" and not chunk.is_static
    ]
    assert sum(rows) == len(der.Path.load(record))


@pytest.mark.parametrize("place", ["missing/p.rrd", "p.txt"])
def test_a_bad_place_is_named_before_anything_is_solved(tmp_path, capsys, place):
    """Code 2 and one line; nothing stays behind."""
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, "--rrd", str(tmp_path / place)])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("der: --rrd must ")
    assert place in line
    assert not list(tmp_path.iterdir())


def test_rerun_is_imported_only_for_a_recording(tmp_path):
    """A fold without --rrd does not pay for it."""
    program = (
        "import sys; from der.cli import main\n"
        f"try: main({list(SMALL)!r})\n"
        "except SystemExit: pass\n"
        "sys.exit('rerun' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=False)
    assert done.returncode == 0
