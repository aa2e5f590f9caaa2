"""`--rrd` and `--live` from the command line; what they show is tested in test_view_rerun.py."""

import json
import signal
import socket
import subprocess
import sys
from contextlib import closing

import pytest
from rerun.chunk import RrdReader

import der
from der.cli import main
from der.shapes import Shapes

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


def test_rrd_shows_snaps_and_softest_modes_and_leaves_the_record_alone(tmp_path):
    """They are kept for the recording and in shapes.npz; the JSON is what it is without."""
    words = (
        "fold",
        "circle",
        "--h-over-t",
        "1.6",
        "--edges",
        "32",
        "--control",
        "angle",
        "--quiet",
    )
    records = []
    for folder, more in (("a", ()), ("b", ("--rrd", str(tmp_path / "p.rrd")))):
        with pytest.raises(SystemExit) as ended:
            main([*words, "--out", str(tmp_path / folder), *more])
        assert ended.value.code == 0
        records.append(json.loads((tmp_path / folder / "path.json").read_text()) | {"timing": None})
    assert records[0] == records[1]
    entities = {chunk.entity_path for chunk in RrdReader(str(tmp_path / "p.rrd")).stream()}
    assert {"/ring/softest_mode", "/curves/moment/snaps", "/series/eigenvalues/odd"} <= entities
    kept = Shapes.load(tmp_path / "b" / "shapes.npz")
    assert (len(kept.falls), kept.softest is None) == (1, False)


@pytest.mark.parametrize(
    "more", [("--no-stability",), ("--control", "angle", "--solver", "relaxation")]
)
def test_modes_are_not_computed_where_stability_is_not(tmp_path, more):
    """Neither where it was not asked for nor where there is no Hessian."""
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, *more, "--rrd", str(tmp_path / "p.rrd")])
    assert ended.value.code == 0
    entities = {chunk.entity_path for chunk in RrdReader(str(tmp_path / "p.rrd")).stream()}
    assert "/ring/softest_mode" not in entities


# --- Live ------------------------------------------------------------------------------------


def free_port():
    with socket.socket() as found:
        found.bind(("", 0))
        return found.getsockname()[1]


def test_live_serves_until_ctrl_c(tmp_path):
    """It tells the address, writes the recording, answers, and ends with code 0, at once."""
    port, file = free_port(), tmp_path / "p.rrd"
    command = [sys.executable, "-m", "der", *SMALL, "--live", "--port", str(port), "--rrd", file]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as live:
        try:
            lines = [live.stderr.readline(), live.stderr.readline()]
            assert f"rerun rerun+http://127.0.0.1:{port}/proxy" in lines[0]
            assert lines[1] == "der: the film can be watched until Ctrl-C\n"
            socket.create_connection(("127.0.0.1", port), timeout=5).close()
            live.send_signal(signal.SIGINT)
            assert live.wait(timeout=20) == 0
            assert live.stderr.read() == ""
        finally:
            live.kill()
    assert file.exists()


def test_live_names_a_port_in_use(capsys):
    """Code 2 and one line, before anything is solved."""
    with closing(socket.socket()) as taken:
        taken.bind(("", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(SystemExit) as ended:
            main([*SMALL, "--live", "--port", str(port)])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"der: --port must be free, got {port}: Address already in use"


@pytest.mark.parametrize("port", ["0", "65536"])
def test_live_refuses_what_is_no_port(capsys, port):
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, "--live", "--port", port])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"der: --port must be from 1 to 65535, got {port}\n"
