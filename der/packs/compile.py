"""Machine code of kernels, from numba: lowered function by function, optimised as a whole."""

from __future__ import annotations

import gc
import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
from llvmlite import ir
from numba.core import codegen, registry
from numba.core.compiler_lock import global_compiler_lock

from der.packs import kernel as kernels
from der.packs.kernel import Kernel, Seen
from der.packs.wrapper import Wrapper

Called = dict[str, Callable[..., Any]]

MOST_KNOWN = 64  # objects in a pack's table


def compiled(group: str, seen: list[Seen]) -> tuple[list[str], bytes, Called]:
    """Names of the objects in a pack's table, its code, and the kernels as numba calls them.

    The last are not optimised; nothing is left out but what packs do otherwise.
    """
    gc.disable()  # numba makes millions of objects that all live for long
    kernels.OPTIONS.pop("cache", None)
    context = registry.cpu_target.target_context
    generator, executable = context.codegen(), type(context).get_executable
    with _linked_only(context, generator):
        roots = _roots(seen)
    module, known = _wrappers(group, context, roots)
    with global_compiler_lock:
        whole, plainly = (codegen.JITCodeLibrary(generator, name) for name in ("pack", "reference"))
        for root in roots.values():
            root.library._ensure_finalized()
            for library in (whole, plainly):
                library._final_module.link_in(root.library._final_module.clone())
        plainly._finalize_final_module()
        whole.add_ir_module(module)
        for function in whole._final_module.functions:
            if not (function.is_declaration or function.name.startswith("call.")):
                function.linkage = "internal"  # what is not called goes, numba's wrappers too
        whole._optimize_final_module()
        code = generator._tm.emit_object(whole._final_module)
    reference = {
        name: executable(context, plainly, root.fndesc, root.environment)
        for name, root in roots.items()
    }
    return known, code, reference


class _Linked(codegen.JITCodeLibrary):
    """Code that is optimised and made executable where it is linked to, not here."""

    def finalize(self) -> None:
        """Link what it calls."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True


@contextmanager
def _linked_only(context: Any, generator: Any) -> Iterator[None]:
    """Have numba compile without code that can be run: it would optimise each kernel by itself."""
    executable = type(context).get_executable
    generator._library_class = _Linked
    type(context).get_executable = lambda *args: [].append  # a function that nobody calls
    try:
        yield
    finally:
        del generator._library_class
        type(context).get_executable = executable


def _roots(seen: list[Seen]) -> dict[str, Any]:
    """What numba makes of each kernel for the types of its first call."""
    roots = {}
    for one in seen:
        if one.name not in roots:
            module, function = one.name.split(":")
            kernel: Kernel = getattr(importlib.import_module(module), function)
            signature = tuple(map(numba.typeof, one.args))
            kernel.dispatcher.compile(signature)
            roots[one.name] = kernel.dispatcher.overloads[signature]
    return roots


def _wrappers(group: str, context: Any, roots: dict[str, Any]) -> tuple[ir.Module, list[str]]:
    """The functions that Python calls, and the names of the objects in their table."""
    known: list[str] = []
    module = ir.Module(f"wrappers.{group}")
    pointers = ir.ArrayType(ir.IntType(8).as_pointer(), MOST_KNOWN)
    table = ir.GlobalVariable(module, pointers, f"known.{group}")
    table.initializer = ir.Constant(pointers, None)
    for name, root in roots.items():
        Wrapper(context, table, known, f"call.{name}").write(root.fndesc)
    if len(known) > MOST_KNOWN:
        raise LookupError(f"{len(known)} objects to compare with, at most {MOST_KNOWN}")
    return module, known
