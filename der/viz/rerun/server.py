"""rerun's server on this computer alone: the SDK's own listens on every interface."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as File

HERE = "127.0.0.1"
PATIENCE = 20.0  # s until the server answers
PROGRAMS = ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe")  # within the package rerun_cli
# Ends the server with this process, however that ends: its end of the pipe is then closed.
KEEPER = """
import subprocess, sys
server = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL)
sys.stdin.read()
server.terminate()
server.wait()
"""


@contextmanager
def serving(port: int) -> Iterator[str]:
    """Serve recordings on 127.0.0.1 until leaving: the address.

    Raises
    ------
    ValueError
        If the port is none, or in use, or the server does not start.
    """
    import rerun_cli

    _check_free(port)
    folder = File(rerun_cli.__file__).parent
    program = next(str(folder / name) for name in PROGRAMS if (folder / name).is_file())
    command = [program, "--serve-grpc", "--bind", HERE, "--port", str(port)]
    keeper = subprocess.Popen(
        [sys.executable, "-c", KEEPER, *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for us
    )
    try:
        _wait_for(port)
        yield f"rerun+http://{HERE}:{port}/proxy"
    finally:
        keeper.communicate()


def _check_free(port: int) -> None:
    """Refuse a port that cannot be listened on: rerun's server would only log that it failed."""
    if not 0 < port < 65536:
        raise ValueError(f"port must be from 1 to 65535, got {port}")
    with socket.socket() as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as the server does
        try:
            trial.bind((HERE, port))
        except OSError as problem:
            raise ValueError(f"port must be free, got {port}: {problem.strerror}") from problem


def _wait_for(port: int) -> None:
    """Wait until the server answers."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            socket.create_connection((HERE, port), timeout=1.0).close()
        except OSError:
            time.sleep(0.02)
        else:
            return
    raise ValueError(f"port must be one that rerun's server can listen on, got {port}: no answer")
