"""`--rrd` and `--live` from the command line; what they show is tested in test_recording.py."""

import json
import signal
import socket
import subprocess
import sys
import time
from contextlib import closing

import pytest
from rerun.chunk import RrdReader

import der
from der.cli.commands import main
from der.records.configurations import Shapes
from der.viz.movie import save_movie

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
        "import sys; from der.cli.commands import main\n"
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


@pytest.mark.parametrize(
    ("option", "name"), [("--movie", "p.mov"), ("--html", "p.htm"), ("--movie", "missing/p.gif")]
)
def test_a_film_or_page_in_a_bad_place_is_named_before_anything_is_solved(
    tmp_path, capsys, option, name
):
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, option, str(tmp_path / name)])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"der: {option} must ")
    assert name in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("solver", "option", "name", "start"),
    [("fold", "--movie", "p.gif", b"GIF89a"), ("bvp", "--html", "p.html", b"<!DOCT")],
)
def test_film_and_page_are_written(tmp_path, monkeypatch, solver, option, name, start):
    """Of either solver; in few pictures here."""
    monkeypatch.setattr(save_movie, "__kwdefaults__", {"fps": 2, "frames": 2})
    with pytest.raises(SystemExit) as ended:
        main([solver, *SMALL[1:], "--gamma-max", "0.5", option, str(tmp_path / name)])
    assert ended.value.code == 0
    assert (tmp_path / name).read_bytes().startswith(start)


def test_beside_shows_the_ring_of_an_earlier_command(tmp_path):
    """Of either solver; both are in the recording."""
    for words in (("bvp", *SMALL[1:]), (*SMALL, "--sector", "half")):
        with pytest.raises(SystemExit) as ended:
            main([*words, "--gamma-max", "1", "--out", str(tmp_path / "kept")])
        assert ended.value.code == 0
        file = tmp_path / f"{words[0]}.rrd"
        with pytest.raises(SystemExit) as ended:
            main(
                [*SMALL, "--gamma-max", "1", "--beside", str(tmp_path / "kept"), "--rrd", str(file)]
            )
        assert ended.value.code == 0
        entities = {chunk.entity_path for chunk in RrdReader(str(file)).stream()}
        assert {"/first/ring/ribbon", "/second/ring/ribbon"} <= entities


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ((), "--beside must go with --rrd, --movie or --html"),
        (("--rrd", "p.rrd"), "--beside must be a folder with path.json and shapes.npz"),
    ],
)
def test_beside_names_what_is_missing(tmp_path, capsys, monkeypatch, more, said):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, "--beside", "nowhere", *more])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"der: {said}")
    assert "'nowhere'" in line
    assert not list(tmp_path.iterdir())


def test_beside_names_a_broken_record(tmp_path, capsys):
    (tmp_path / "path.json").write_text("{")
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, "--beside", str(tmp_path), "--rrd", str(tmp_path / "p.rrd")])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("der: --beside must be a folder as --out writes")
    assert "path.json: not JSON" in line


@pytest.mark.parametrize(("name", "option"), [("movie", "save_movie"), ("html", "save_html")])
def test_a_full_disk_costs_the_film_and_nothing_else(tmp_path, capsys, monkeypatch, name, option):
    """Code 3, one line that names the file; the record is there."""

    def full(*_):
        raise ValueError(f"{name} 'f' cannot be written: No space left on device")

    monkeypatch.setattr(f"der.viz.{name}.{option}", full)
    file = tmp_path / {"movie": "p.gif", "html": "p.html"}[name]
    with pytest.raises(SystemExit) as ended:
        main([*SMALL, f"--{name}", str(file), "--json", str(tmp_path / "p.json")])
    assert ended.value.code == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"der: could not write {file}: ")
    assert der.Path.load(tmp_path / "p.json").status == "done"


@pytest.mark.parametrize("more", [(), ("--two-dimensional", "--cells", "5")])
def test_a_landscape_is_recorded_with_the_ring(tmp_path, more):
    file = tmp_path / "l.rrd"
    words = ["landscape", *SMALL[1:], "--edges", "32", *more, "--rrd", str(file)]
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0
    entities = {chunk.entity_path for chunk in RrdReader(str(file)).stream()}
    assert {"/ring/ribbon", "/landscape/whole/now"} <= entities
    assert ("/surface/now" in entities) is bool(more)


def test_a_landscape_without_grips_is_not_recorded(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["landscape", *SMALL[1:], "--free", "--rrd", str(tmp_path / "l.rrd")])
    assert ended.value.code == 2
    assert "--rrd cannot be given together with --free" in capsys.readouterr().err


# --- Live ------------------------------------------------------------------------------------


def free_port():
    with socket.socket() as found:
        found.bind(("", 0))
        return found.getsockname()[1]


def reached_elsewhere(port):
    """Whether a server answers at another address than the one it says, as one for all would."""
    with socket.socket() as asking:
        asking.settimeout(5.0)
        return asking.connect_ex(("127.0.0.2", port)) == 0


def test_live_serves_until_ctrl_c(tmp_path):
    """It tells the address, writes the recording, answers, and ends with code 0, at once."""
    port, file = free_port(), tmp_path / "p.rrd"
    command = [sys.executable, "-m", "der", *SMALL, "--live", "--port", str(port), "--rrd", file]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as live:
        try:
            lines = [live.stderr.readline(), live.stderr.readline()]
            assert f"rerun rerun+http://127.0.0.1:{port}/proxy" in lines[0]
            assert lines[1] == "der: the recording can be watched until Ctrl-C\n"
            socket.create_connection(("127.0.0.1", port), timeout=5).close()
            assert not reached_elsewhere(port)
            live.send_signal(signal.SIGINT)
            assert live.wait(timeout=20) == 0
            assert live.stderr.read() == ""
        finally:
            live.kill()
    assert file.exists()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), timeout=5)


def test_server_ends_with_a_run_that_is_killed(tmp_path):
    """A server left behind would keep the port, and the ring."""
    port = free_port()
    command = [sys.executable, "-m", "der", *SMALL, "--live", "--port", str(port)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as live:
        live.stderr.readline()
        live.kill()
    for _ in range(100):
        try:
            socket.create_connection(("127.0.0.1", port), timeout=5).close()
        except ConnectionRefusedError:
            return
        time.sleep(0.05)
    pytest.fail("the server still listens")


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
