"""Places that cannot be written to, closed streams, and files that are links: nothing is lost."""

import os
import subprocess
import sys

import pytest

from der.cli.commands import main
from der.packs.folders import FOLDER, keep_kernels
from der.paper import DIAGRAMS, Drawn
from der.utils.files import write_whole

SMALL = ["fold", "circle", "--h-over-t", "4", "--edges", "16", "--gamma-max", "0.1"]


# --- Kernels ---------------------------------------------------------------------------------


def unwritable(tmp_path, monkeypatch):
    """A package and a home below files, so that no folder can be made there, not by root either."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(FOLDER, "")  # as it was, afterwards
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file" / "cache"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "file" / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    return tmp_path / "file" / "der"


@pytest.mark.parametrize("given", [None, "file/kernels"])
def test_kernels_go_to_a_temporary_folder_where_no_other_can_be_written(
    given, tmp_path, monkeypatch, capsys
):
    """One line says so; the folder is the owner's alone, because what it holds is run."""
    package = unwritable(tmp_path, monkeypatch)
    monkeypatch.delenv(FOLDER, raising=False)
    if given:
        monkeypatch.setenv(FOLDER, str(tmp_path / given))
    keep_kernels(package)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("der: compiled kernels cannot be kept")
    assert os.stat(os.environ[FOLDER]).st_mode & 0o777 == 0o700
    keep_kernels(package)  # a worker
    assert capsys.readouterr().err == ""


def test_kernels_stay_where_a_folder_can_be_written(tmp_path, monkeypatch, capsys):
    """In the package, in the user's folder, or where the user says."""
    package = unwritable(tmp_path, monkeypatch)
    monkeypatch.delenv(FOLDER, raising=False)
    keep_kernels(tmp_path / "der")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("sys.platform", "linux")
    keep_kernels(package)
    assert FOLDER not in os.environ
    unwritable(tmp_path, monkeypatch)
    monkeypatch.setenv(FOLDER, str(tmp_path / "mine"))
    keep_kernels(package)
    assert os.environ[FOLDER] == str(tmp_path / "mine")
    assert capsys.readouterr().err == ""


# --- Streams ---------------------------------------------------------------------------------


def der_in_shell(command, tmp_path):
    """The command with its streams as a shell redirects them."""
    words = f"{sys.executable} -m der {' '.join(command)}"
    return subprocess.run(["sh", "-c", words], cwd=tmp_path, capture_output=True, text=True)


def test_closed_standard_error_loses_no_answer(tmp_path):
    """`2>&-`: the summary, the file, and the exit code are those of an open one."""
    usual = der_in_shell([*SMALL, "--json", "a.json"], tmp_path)
    closed = der_in_shell([*SMALL, "--json", "b.json", "2>&-"], tmp_path)
    assert (usual.returncode, closed.returncode) == (0, 0)
    assert closed.stdout.splitlines()[0] == usual.stdout.splitlines()[0]
    assert (tmp_path / "b.json").exists()
    assert der_in_shell(["fold", "cube", "2>&-"], tmp_path).returncode == 2


def test_closed_standard_output_is_told(tmp_path):
    """`>&-`: the file is written, and one line says what was not printed."""
    closed = der_in_shell([*SMALL, "--json", "a.json", ">&-"], tmp_path)
    assert closed.returncode == 3
    assert closed.stderr.count("\n") == 1
    assert "could not write to standard output" in closed.stderr
    assert (tmp_path / "a.json").exists()


# --- Files -----------------------------------------------------------------------------------


def put(file, content=b"new"):
    write_whole(file, lambda opened: opened.write(content))


def test_rights_of_a_file_that_is_written_again_are_kept(tmp_path):
    """A record that others may not read stays one; a new file has the rights of the umask."""
    file, fresh = tmp_path / "a.json", tmp_path / "b.json"
    file.write_bytes(b"old")
    file.chmod(0o600)
    put(file)
    put(fresh)
    (tmp_path / "c").write_bytes(b"")
    assert (file.read_bytes(), file.stat().st_mode & 0o777) == (b"new", 0o600)
    assert fresh.stat().st_mode == (tmp_path / "c").stat().st_mode


def test_a_symbolic_link_is_written_through(tmp_path):
    """Also one to a file that is not there yet, in another folder."""
    (tmp_path / "real").mkdir()
    for name in ("there", "not_yet"):
        link = tmp_path / name
        link.symlink_to(tmp_path / "real" / name)
        if name == "there":
            (tmp_path / "real" / name).write_bytes(b"old")
        put(link)
        assert link.is_symlink()
        assert (tmp_path / "real" / name).read_bytes() == b"new"
    assert sorted(os.listdir(tmp_path)) == ["not_yet", "real", "there"]


def test_what_a_killed_process_left_is_removed(tmp_path):
    """When the same file is written an hour later; not what another process is writing now."""
    file = tmp_path / "a[1].json"
    left, busy = (tmp_path / f".a[1].json.{digit * 16}.tmp" for digit in "ab")
    other = tmp_path / f".a1.json.{'c' * 16}.tmp"
    for one in (left, busy, other):
        one.write_bytes(b"part")
    for one in (left, other):
        os.utime(one, (0.0, 0.0))
    put(file)
    assert {*tmp_path.iterdir()} == {file, busy, other}


@pytest.mark.parametrize(
    "words",
    [
        "fold circle --h-over-t 4 --out a/b --plot x.txt",
        "fold circle --h-over-t 4 --out a/b --json a/b/path.png",
        "fold circle --h-over-t 4 --out a/b --rrd nowhere/x.rrd",
        "fold circle --h-over-t 4 --out a/b --live --port 0",
        "bvp circle --h-over-t 4 --out a/b --beside c --html x.html",
        "landscape circle --h-over-t 4 --out a/b --rrd x.png",
        "states circle --h-over-t 4 --out a/b --edges 7",
        "phase fig3a --out a/b --workers 0",
        "phase fig3a --out a/b --sample 0",
        "figure fig2b --out a/b --workers 0",
        "figure fig99 --out a/b",
    ],
)
def test_no_folder_is_left_where_a_command_is_refused(words, tmp_path, monkeypatch, capsys):
    """Code 2, one line, and nothing on the disk."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not os.listdir(tmp_path)


def test_figure_says_at_ctrl_c_what_was_drawn(tmp_path, monkeypatch, capsys):
    """Code 130; of a diagram that was begun, where its cases are."""

    def pressed(*_):
        raise KeyboardInterrupt("7 cases are in x")

    done = Drawn({"fig2b": [tmp_path / "fig2b.png"]}, {})
    monkeypatch.setattr("der.paper.figures.draw_all", lambda *_: done)
    monkeypatch.setitem(DIAGRAMS, "fig3a", pressed)
    with pytest.raises(SystemExit) as ended:
        main(["figure", "fig2b", "fig3a", "fig5a", "--out", str(tmp_path)])
    said = capsys.readouterr()
    assert ended.value.code == 130
    assert said.out == f"{tmp_path / 'fig2b.png'}\n"
    assert said.err == (
        "der: stopped by the user; drawn: fig2b; not drawn: fig3a, fig5a; 7 cases are in x\n"
    )


def test_phase_says_at_ctrl_c_where_its_cases_are(tmp_path, monkeypatch, capsys):
    """And not that nothing was found."""

    def pressed(*_, **options):
        raise KeyboardInterrupt("7 cases are in x")

    monkeypatch.setattr("der.diagram.diagram.phase_diagram", pressed)
    with pytest.raises(SystemExit) as ended:
        main(["phase", "fig3a", "--out", str(tmp_path)])
    assert ended.value.code == 130
    assert capsys.readouterr().err == "der: stopped by the user; 7 cases are in x\n"
