"""The kernels of a run by themselves: what its time would be without Python between them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np

from der.packs.kernel import Kernel

Call = tuple[Kernel, tuple[Any, ...]]


def kernel_time(work: Callable[[], object], repeats: int) -> tuple[float, int]:
    """Median CPU time [s] of the kernels that a run calls, on the same arrays, and their number."""
    calls = recorded(work)
    return statistics.median(_replayed(calls) for _ in range(repeats)), len(calls)


def recorded(work: Callable[[], object]) -> list[Call]:
    """The kernels that Python calls in a run, with copies of their arguments."""
    work()
    calls: list[Call] = []
    run = Kernel.__call__

    def call(kernel: Kernel, *args: Any) -> Any:
        calls.append((kernel, _copied(args)))
        return run(kernel, *args)

    with patch.object(Kernel, "__call__", call):
        work()
    return calls


def _replayed(calls: list[Call]) -> float:
    """CPU time of the calls once more [s]; kernels write to their arguments, so on copies."""
    fresh = [(kernel, _copied(args)) for kernel, args in calls]
    begin = time.process_time()
    for kernel, args in fresh:
        kernel(*args)
    return time.process_time() - begin


def _copied(values: Any) -> Any:
    """Arguments with arrays of their own, also inside of named tuples."""
    if isinstance(values, np.ndarray):
        return values.copy()
    if not isinstance(values, tuple):
        return values
    parts = [_copied(value) for value in values]
    return type(values)(*parts) if hasattr(values, "_fields") else tuple(parts)
