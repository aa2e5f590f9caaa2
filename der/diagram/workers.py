"""Who solves the cases: processes of this machine, or those of a Dask cluster.

Both are used through `concurrent.futures.Executor`; what differs is how one is made, how many
tasks it can do at a time, and what it raises where a worker died.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import Any, TypeAlias

from der.utils.interrupts import interrupts_ignored

ONE_THREAD = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def died(problem: BaseException) -> bool:
    """Whether a task's exception says that its worker died."""
    return isinstance(problem, BrokenExecutor) or type(problem).__name__ == "KilledWorker"


@contextmanager
def workers(number: int | None = None, scheduler: str | None = None) -> Iterator[Workers]:
    """Workers, stopped on leaving.

    Parameters
    ----------
    number : of processes on this machine; None: one a core
    scheduler : address of a Dask scheduler, whose workers are used instead; they must have this
        package installed

    Raises
    ------
    ValueError
        For a number of workers below 1, or given together with a scheduler; a scheduler that
        cannot be reached; or without Dask installed.
    """
    if scheduler is not None and number is not None:
        raise ValueError(f"workers cannot be given together with a scheduler, got {number!r}")
    crew: Workers = Processes(processes(number)) if scheduler is None else Cluster(scheduler)
    try:
        with one_thread_each():
            yield crew
    except BaseException:
        crew.stop()
        raise
    crew.close()


class Processes:
    """Fresh processes of this machine, one thread each."""

    def __init__(self, number: int) -> None:
        self._number = number
        self._others = set(multiprocessing.active_children())
        self.executor: Executor = self._pool()

    @property
    def width(self) -> int:
        """The number of processes."""
        return self._number

    def start(self) -> None:
        """Have them start now, and not at their first task."""
        for _ in range(self._number):
            self.executor.submit(os.getpid)

    def restart(self) -> None:
        """Start others."""
        self.stop()
        self.executor = self._pool()

    def close(self) -> None:
        """End them once their work is done."""
        self.executor.shutdown()

    def stop(self) -> None:
        """End them; none has an unfinished file."""
        with interrupts_ignored():
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()
            self.executor.shutdown(cancel_futures=True)

    def _pool(self) -> ProcessPoolExecutor:
        spawn = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self._number, spawn, _start)


class Cluster:
    """The workers of a Dask cluster; Dask itself replaces those that die and repeats their tasks.

    Raises
    ------
    ValueError
        If Dask is not installed, or no scheduler answers at the address.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise ValueError(
                f"scheduler must come with Dask (pip install 'ring-origami[cluster]'), "
                f"got {address!r}"
            ) from None
        try:
            self._client: Any = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise ValueError(
                f"scheduler must be the address of a Dask scheduler, got {address!r}: {problem}"
            ) from problem
        self.executor: Executor = self._client.get_executor()

    @property
    def width(self) -> int:
        """Threads of all workers that are there now."""
        return max(1, sum(self._client.nthreads().values()))

    def start(self) -> None:
        """Do nothing: they are there."""

    def restart(self) -> None:
        """Do nothing: the cluster replaces workers itself."""

    def close(self) -> None:
        """Leave."""
        self.stop()

    def stop(self) -> None:
        """Cancel what is not done, and leave."""
        self.executor.shutdown(wait=False)
        self._client.close()


Workers: TypeAlias = Processes | Cluster


def processes(number: int | None) -> int:
    """The number of workers; None: one for each core that this process may use.

    Raises
    ------
    ValueError
        If it is below 1.
    """
    if number is None:
        if hasattr(os, "sched_getaffinity"):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise ValueError(f"workers must be an integer from 1, got {number!r}")
    return number


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Have processes that are started here compute on one thread."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start() -> None:
    """Leave Ctrl-C to the parent, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    """End with the parent: a killed one closes no queue, and workers would wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
