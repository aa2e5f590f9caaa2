"""The decorator of kernels: functions of arrays and numbers, run as machine code.

A kernel that Python calls is looked up in the packs, which need no compiler. What they lack, or
cannot take, numba compiles at the first call and keeps in its own way.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from der.packs.folders import keep_kernels

# kernels never raise: what is divided by zero becomes infinite or NaN, and is tested for
OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}

instead: Callable[..., Any] | None = None  # called with a kernel and its arguments, to watch calls


class Seen(NamedTuple):
    """A call of a kernel by Python."""

    name: str
    args: tuple[Any, ...]


class Kernel:
    """A compiled function; Python and other kernels call it by its name."""

    def __init__(self, py_func: Callable[..., Any]) -> None:
        functools.update_wrapper(self, py_func)
        self.py_func = py_func
        self.name = f"{py_func.__module__}:{py_func.__name__}"
        self._run: Callable[..., Any] | None = None

    def __call__(self, *args: Any) -> Any:
        """Run it on C-contiguous arrays and numbers."""
        run = self._run
        if run is None:
            run = self._found()
        result = run(*args)
        return self.dispatcher(*args) if result is NotImplemented else result

    def _found(self) -> Callable[..., Any]:
        """What runs it, from now on."""
        if instead is not None:
            return functools.partial(instead, self)
        from der.packs.load import loaded

        self._run = loaded(self.name) or self.dispatcher
        return self._run

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it."""
        return _njit()(**OPTIONS)(self.py_func)


def kernel(py_func: Callable[..., Any]) -> Kernel:
    """Have a function run as machine code."""
    return Kernel(py_func)


@functools.cache
def _njit() -> Any:
    """Numba's decorator; numba is told what kernels are."""
    keep_kernels(Path(__file__).parent.parent)
    import numba
    from numba.core import types
    from numba.extending import typeof_impl

    @typeof_impl.register(Kernel)
    def _(value: Kernel, context: Any) -> Any:
        return types.Dispatcher(value.dispatcher)

    return numba.njit
