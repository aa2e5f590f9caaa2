"""What all tests share."""

import os
import signal

import pytest

# Matrices are small here, and two workers share two cores: threads of the linear algebra would only
# wait for each other. This must be said before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_configure(config: pytest.Config) -> None:
    """Have kernels compiled once, before the workers start."""
    if not hasattr(config, "workerinput"):
        from der.packs.load import GROUPS, loaded

        for modules in GROUPS.values():
            loaded(f"{modules[0]}:")


@pytest.fixture(autouse=True, scope="session")
def ctrl_c_is_heard():
    """Ctrl-C works as in a terminal, also where the tests run in the background of a shell.

    Such a shell lets its children ignore the signal, and these theirs.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
