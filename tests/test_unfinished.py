"""Ctrl-C and alarms: where they may raise, and that none is lost."""

import signal
import subprocess
import sys
import time

import pytest
from boundary_value import scene

import der
from der.bvp.solve import solve_bvp
from der.utils.interrupts import interrupts_between_states, interrupts_heard, put_off

SOME = 20


class Alarm(BaseException):
    """What the alarm raises; the ``except Exception`` of a library does not take it."""


@pytest.fixture
def alarm():
    """Set an alarm [s] that raises where it may."""

    def ring(number, frame):
        if not put_off(number, frame):
            raise Alarm

    usual = signal.signal(signal.SIGALRM, ring)
    yield lambda after: signal.setitimer(signal.ITIMER_REAL, after)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, usual)


def press():
    signal.raise_signal(signal.SIGINT)


def _numba_unpickle(done):
    """What numba's wrappers call, by its name; an exception would end them."""
    press()
    done.append("handed over")


def _compile_for_args():
    """What numba compiles below, by its name."""
    press()


def wait():
    """For what comes again a moment later."""
    for _ in range(1000):
        time.sleep(1e-3)


def test_alarms_in_kernels_come_out_as_they_are(alarm):
    """Each of them as itself, whatever the kernel was at: no SystemError, no crash.

    Two alarms in five arrive while a kernel's results are handed over.
    """
    ring = scene(der.circle(), 1.6)
    solve_bvp(ring)
    for k in range(SOME):
        with pytest.raises(Alarm):  # noqa: PT012 - it may come at any time
            alarm(2e-3 + 3.1e-4 * k)
            while True:
                solve_bvp(ring)


def test_ctrl_c_waits_until_results_are_handed_over():
    """The wrapper ends; then it is heard."""
    done = []
    with interrupts_heard(), pytest.raises(KeyboardInterrupt):  # noqa: PT012
        _numba_unpickle(done)
        wait()
    assert done == ["handed over"]


def test_a_second_ctrl_c_waits_for_that_too():
    """The first is taken down, the second raises, not within the wrapper."""
    done = []
    with interrupts_between_states() as pressed, pytest.raises(KeyboardInterrupt):  # noqa: PT012
        press()
        assert len(pressed) == 1
        _numba_unpickle(done)
        wait()
    assert done == ["handed over"]


def test_ctrl_c_ends_compiling_in_a_program_that_ends():
    """At once; in a session it is taken down, since numba cannot go on after it."""
    with interrupts_between_states() as pressed:
        _compile_for_args()
    assert len(pressed) == 1
    with interrupts_heard(), interrupts_between_states(), pytest.raises(KeyboardInterrupt):
        _compile_for_args()


def test_handlers_are_put_back():
    """Each leaves what it found."""
    usual = signal.getsignal(signal.SIGINT)
    with interrupts_heard():
        ours = signal.getsignal(signal.SIGINT)
        with interrupts_between_states():
            assert signal.getsignal(signal.SIGINT) not in (usual, ours)
        assert signal.getsignal(signal.SIGINT) is ours
    assert signal.getsignal(signal.SIGINT) is usual


LOADING = """
import signal, sys

class Pressed:
    def find_spec(name, path, target=None):
        if name == "der.cli.output":
            signal.raise_signal({number})

sys.meta_path.insert(0, Pressed)
sys.argv[1:] = ["--version"]
signal.signal({number}, signal.{handler})
from der.__main__ import main
main()
"""


@pytest.mark.parametrize(
    ("number", "handler"), [("SIGINT", "default_int_handler"), ("SIGTERM", "SIG_DFL")]
)
def test_the_command_hears_while_it_loads(number, handler):
    """One line and code 130, as later; Python alone prints a traceback, or dies of it."""
    code = LOADING.format(number=f"signal.{number}", handler=handler)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "der: stopped by the user\n"


def test_a_command_that_must_not_hear_does_not():
    """Of a batch: `nohup` and shells have set the signal to be ignored."""
    code = LOADING.format(number="signal.SIGINT", handler="SIG_IGN")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("der ")
