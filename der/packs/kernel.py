"""The decorator of kernels: functions of arrays and numbers that numba compiles.

Numba is imported when the first of them has to be compiled.
"""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable
from typing import Any

# kernels never raise: what is divided by zero becomes infinite or NaN, and is tested for
OPTIONS = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class Kernel:
    """A compiled function; Python and other kernels call it by its name."""

    def __init__(self, py_func: Callable[..., Any]) -> None:
        functools.update_wrapper(self, py_func)
        self.py_func = py_func
        self._run: Callable[..., Any] | None = None

    def __call__(self, *args: Any) -> Any:
        """Run it on C-contiguous arrays and numbers."""
        run = self._run
        if run is None:
            run = self._run = self.dispatcher
        return run(*args)

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        return _njit()(**OPTIONS)(self.py_func)


def kernel(py_func: Callable[..., Any]) -> Kernel:
    """Compile a function at its first call."""
    return Kernel(py_func)


@functools.cache
def _njit() -> Any:
    """Numba's decorator; numba is told what kernels are, and not to be slowed down by rubbish.

    It makes millions of objects that all live for long: collecting them takes a fifth of the time.
    """
    import numba
    from numba.core import event, types
    from numba.extending import typeof_impl

    @typeof_impl.register(Kernel)
    def _(value: Kernel, context: Any) -> Any:
        return types.Dispatcher(value.dispatcher)

    class Uncollected(event.Listener):
        depth, was_on = 0, False

        def on_start(self, event: Any) -> None:
            if self.depth == 0:
                self.was_on = gc.isenabled()
                gc.disable()
            self.depth += 1

        def on_end(self, event: Any) -> None:
            self.depth -= 1
            if self.depth == 0 and self.was_on:
                gc.enable()

    event.register("numba:compile", Uncollected())
    return numba.njit
