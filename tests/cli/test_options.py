"""Every option of every command: its help, and what is said of a wrong value."""

import re

import pytest
import typer

from der.cli import landscapes, paths, states
from der.cli.commands import app, main

COMMANDS = typer.main.get_command(app).commands
RING = ["circle", "--h-over-t", "4", "--quiet"]
BASE = {
    **dict.fromkeys(("fold", "bvp", "compare", "landscape", "states", "planar"), RING),
    "phase": ["fig3a", "--out", "o", "--quiet"],
    "figure": ["fig2b", "--out", "o"],
}
WRONG = ("wrong", "nan", "-7", "1e999", "", "--edges")
SLOW = {("phase", "--scheduler")}  # it would be waited for


def options(command):
    """The options of a command by their names."""
    return {
        name: one
        for one in COMMANDS[command].params
        if one.param_type_name == "option"
        for name in (*one.opts, *one.secondary_opts)
    }


EVERY = [(command, name) for command in BASE for name in options(command)]


def said(words, capsys):
    """The exit code and what is said, in one line, of a command that is refused."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    err = capsys.readouterr().err
    assert ended.value.code in (0, 2), err
    if ended.value.code == 2:
        assert err.count("\n") == 1
        assert err.startswith("der: ")
    return ended.value.code, err


@pytest.fixture(autouse=True)
def nothing_is_solved(monkeypatch, tmp_path):
    """What is accepted ends at once."""
    monkeypatch.chdir(tmp_path)
    for module in (paths, states, landscapes):
        monkeypatch.setattr(module, "run", lambda *_, **options: (None, 0))


@pytest.mark.parametrize(("command", "name"), EVERY)
def test_a_wrong_value_is_refused_by_the_name_of_the_option(command, name, capsys):
    """And by no other that the command does not have."""
    known = options(command)
    if (command, name) in SLOW or name in ("--help", "--live"):
        return
    if command in ("phase", "figure") and known[name].is_flag:
        return  # it would be drawn
    refused = 0
    for value in WRONG if name != "--out" else ("-7", "--edges"):
        words = [name] if known[name].is_flag else [name, value]
        code, err = said([command, *BASE[command], *words], capsys)
        if code:
            refused += 1
            assert name in err or f"--{name[5:]}" in err, err
            assert set(re.findall(r"--[a-z][a-z-]*", err.replace(repr(value), ""))) <= set(known)
        if known[name].is_flag:
            return
    assert refused


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("phase fig3a --out o --range ba=", "--range must be like b_over_a=0.7:1, got 'ba='"),
        ("phase fig3a --out o --range ba=1:2", "--range of fig3a must be of b_over_a, h_over_t"),
        ("figure fig2b --out file/x", "--out must be one that can be made, got 'file/x'"),
        ("figure fig99 --out o", "NAME must be one of fig2b, "),
        ("fold profile nowhere --h-over-t 4", "FILE must be readable, got 'nowhere'"),
        ("fold circle --h-over-t 4 --edges 7", "--edges must be from 8 to 65536"),
        ("fold circle --h-over-t 4 --gamma-max 180", "--gamma-max must be at most 10 pi"),
    ],
)
def test_an_option_is_named_as_the_command_has_it(words, message, tmp_path, capsys):
    """Where the argument of the package has another name."""
    (tmp_path / "file").write_text("")
    code, err = said(words.split(), capsys)
    assert code == 2
    assert err.startswith(f"der: {message}")


HIDDEN = [
    *((command, "--control", "angle") for command in ("bvp", "compare", "landscape")),
    *((command, "--solver", "relaxation") for command in ("bvp", "compare", "landscape")),
    *((command, "--unload", None) for command in ("bvp", "compare", "landscape")),
    *((command, "--stretch", "finite") for command in ("bvp", "compare")),
    ("landscape", "--gamma-max", "2"),
]


@pytest.mark.parametrize(("command", "name", "value"), HIDDEN)
def test_help_lists_what_the_command_takes(command, name, value, capsys):
    """An option that it refuses is not in its help, and is refused by its name."""
    with pytest.raises(SystemExit):
        main([command, "--help"])
    shown = set(re.findall(r"--[a-z][a-z-]*", capsys.readouterr().out))
    assert name not in shown
    assert shown <= {*options(command), "--help"}
    words = [name] if value is None else [name, value]
    code, err = said([command, *RING, *words], capsys)
    assert code == 2
    assert err.startswith(f"der: {name}")
